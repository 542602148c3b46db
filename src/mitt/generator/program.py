"""The quadratic programme of one learning step: cost and limits, linear in alpha.

| here       | meaning                                                   | shape          |
|------------|-----------------------------------------------------------|----------------|
| ``slope``  | d tau/dq, d tau/d dq, M at each instant                   | (K, 3, N, n)   |
| ``J``      | d residual / d alpha of the cost (22)                     | (2 K n, m n)   |
| ``rows``   | d (share of a limit) / d alpha, near the limit only       | (R, m n)       |
| ``room``   | what is left of each of those limits                      | (R,)           |
"""

from typing import NamedTuple

import numpy as np

from mitt.robot.arm import Arm
from mitt.signals import Array

#: Newton steps of the soft programme, and the relative step at which it has converged.
_NEWTON_STEPS, _SMALL = 30, 1e-9


class Cost(NamedTuple):
    """Least-squares form of eq. (22) for one motion: residual and its derivative."""

    torque: Array  # (K, n) tau / tau_max
    speed: Array  # (K, n) omega / omega_max
    J: Array  # (2 K n, m n)


class Rows(NamedTuple):
    """Linearised limits: rows @ step <= room, and the largest share of any limit."""

    rows: Array
    room: Array
    worst: float


class Sensitivity(NamedTuple):
    """A motion, its torques and how they answer to alpha."""

    motion: Array  # (K, 3, n)
    tau: Array  # (K, N)
    J_tau: Array  # (K, N, m n) d tau / d alpha
    J_dq: Array  # (K, n, m n)
    J_q: Array  # (K, n, m n)
    J_ddq: Array  # (K, n, m n)


def sensitivity(arm: Arm, motion: Array, phi: Array) -> Sensitivity:
    """Return d tau/d alpha = tau_q Phi + tau_qdot Phi-dot + M Phi-ddot and its companions."""
    tau = arm.torques(motion)
    slope = np.array([arm.torque_derivatives(*row) for row in motion])
    count, n = len(motion), arm.n
    J_tau = np.einsum("tdrk,tda->trak", slope, phi).reshape(count, tau.shape[1], -1)
    eye = np.eye(n)
    J_q = np.einsum("ta,jk->tjak", phi[:, 0], eye).reshape(count, n, -1)
    J_dq = np.einsum("ta,jk->tjak", phi[:, 1], eye).reshape(count, n, -1)
    J_ddq = np.einsum("ta,jk->tjak", phi[:, 2], eye).reshape(count, n, -1)
    return Sensitivity(motion, tau, J_tau, J_dq, J_q, J_ddq)


def cost(arm: Arm, s: Sensitivity) -> Cost:
    """Return the residual of eq. (22), K_tau = 1/tau_max^2 and K_omega = 1/omega_max^2."""
    torque, speed = arm.active(s.tau) / arm.tau_max, s.motion[:, 1] / arm.dq_max
    active = s.J_tau[:, arm.model.active] / arm.tau_max[:, None]
    size = s.J_tau.shape[-1]
    J = np.concatenate([active.reshape(-1, size), (s.J_dq / arm.dq_max[:, None]).reshape(-1, size)])
    return Cost(torque, speed, J)


def limit_rows(arm: Arm, s: Sensitivity, *, share: float, near: float) -> Rows:
    """Return the limits (18), (20), ranges and accelerations as rows, those above ``near`` of one.

    Args:
        arm: The arm.
        s: Motion and sensitivities.
        share: Share of each limit that may be used.
        near: Share from which a limit gets a row.
    """
    limits, count = arm.limits, len(s.motion)
    dq = np.zeros((count, len(arm.model.links)))
    dq[:, arm.model.active] = s.motion[:, 1]
    drive_tau, drive_dq = limits.drive_torque(s.tau), limits.drive_speed(dq)
    middle, half = 0.5 * (arm.q_max + arm.q_min), 0.5 * (arm.q_max - arm.q_min)
    torque, speed = drive_tau / limits.tau_peak, drive_dq / limits.dq_max
    J_torque = limits.to_drive @ s.J_tau
    J_speed = limits.transmission[:, arm.model.active] / limits.dq_max[:, None] @ s.J_dq
    values = [torque, speed, (s.motion[:, 0] - middle) / half]
    slopes = [J_torque / limits.tau_peak[:, None], J_speed, s.J_q / half[:, None]]
    if limits.no_load:
        driving = drive_tau * drive_dq > 0.0
        values.append(np.where(driving, drive_tau / limits.tau_stall + speed, 0.0))
        slopes.append(J_torque / limits.tau_stall[:, None] + J_speed)
    if limits.acceleration is not None:
        most = arm.active(limits.acceleration)
        values.append(s.motion[:, 2] / most)
        slopes.append(s.J_ddq / most[:, None])
    rows, room = [], []
    for value, slope in zip(values, slopes, strict=True):
        at = np.abs(value) > near
        sign = np.sign(value[at])
        rows.append(sign[:, None] * slope[at])
        room.append(share - np.abs(value[at]))
    worst = max(float(np.abs(value).max()) for value in values)
    return Rows(np.concatenate(rows), np.concatenate(room), worst)


def solve(H: Array, gradient: Array, limits: tuple[Array, Array], *, weight: float) -> Array | None:
    """Return the step that minimises the quadratic plus weighted squares of the excess.

    x'Hx/2 + g'x + weight sum max(rows x - room, 0)^2 is convex and piecewise quadratic: Newton's
    method on the rows in excess, with halved steps where the set of rows changes too much. A
    soft form, because some limits cannot be kept: the catch itself fixes the last instants.

    Returns:
        The step, shape (m n,); None where the problem or the answer is not finite.
    """
    rows, room = limits
    if not all(np.all(np.isfinite(x)) for x in (H, gradient, rows, room)):
        return None

    def value(x: Array) -> float:
        over = np.maximum(rows @ x - room, 0.0)
        return float(0.5 * x @ H @ x + gradient @ x + weight * (over @ over))

    x = np.zeros(len(gradient))
    for _ in range(_NEWTON_STEPS):
        over = rows @ x - room
        active = rows[over > 0.0]
        slope = H @ x + gradient + 2.0 * weight * active.T @ over[over > 0.0]
        newton = -np.linalg.solve(H + 2.0 * weight * active.T @ active, slope)
        if np.linalg.norm(newton) <= _SMALL * (1.0 + np.linalg.norm(x)):
            break
        share, here = 1.0, value(x)
        while value(x + share * newton) > here and share > _SMALL:
            share *= 0.5
        x = x + share * newton
    return x if np.all(np.isfinite(x)) else None
