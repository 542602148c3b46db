"""The quadratic programme of one learning step: cost and limits, linear in alpha.

| here       | meaning                                                   | shape          |
|------------|-----------------------------------------------------------|----------------|
| ``slope``  | d tau/dq, d tau/d dq, M at each instant                   | (K, 3, N, n)   |
| ``J``      | d residual / d alpha of the cost (22)                     | (2 K n, m n)   |
| ``rows``   | d (share of a limit) / d alpha, near the limit only       | (R, m n)       |
| ``room``   | what is left of each of those limits                      | (R,)           |
"""

from typing import NamedTuple

import daqp
import numpy as np

from mitt.robot.arm import Arm
from mitt.signals import Array

#: Violation above which the solver's answer is not believed to be one.
_RESIDUAL = 1e-6


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


def sensitivity(arm: Arm, motion: Array, phi: Array) -> Sensitivity:
    """Return d tau/d alpha = tau_q Phi + tau_qdot Phi-dot + M Phi-ddot and its companions."""
    tau = np.array([arm.torque(*row) for row in motion])
    slope = np.array([arm.torque_derivatives(*row) for row in motion])
    count, n = len(motion), arm.n
    J_tau = np.einsum("tdrk,tda->trak", slope, phi).reshape(count, tau.shape[1], -1)
    eye = np.eye(n)
    J_q = np.einsum("ta,jk->tjak", phi[:, 0], eye).reshape(count, n, -1)
    J_dq = np.einsum("ta,jk->tjak", phi[:, 1], eye).reshape(count, n, -1)
    return Sensitivity(motion, tau, J_tau, J_dq, J_q)


def cost(arm: Arm, s: Sensitivity) -> Cost:
    """Return the residual of eq. (22), K_tau = 1/tau_max^2 and K_omega = 1/omega_max^2."""
    torque, speed = arm.active(s.tau) / arm.tau_max, s.motion[:, 1] / arm.dq_max
    active = s.J_tau[:, arm.model.active] / arm.tau_max[:, None]
    size = s.J_tau.shape[-1]
    J = np.concatenate([active.reshape(-1, size), (s.J_dq / arm.dq_max[:, None]).reshape(-1, size)])
    return Cost(torque, speed, J)


def limit_rows(arm: Arm, s: Sensitivity, *, share: float, near: float) -> Rows:
    """Return the limits (18), (20) and the joint ranges as rows, those above ``near`` of one.

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
    bound = np.maximum(limits.torque_bound(drive_tau, drive_dq), 1e-3 * limits.tau_peak)
    middle, half = 0.5 * (arm.q_max + arm.q_min), 0.5 * (arm.q_max - arm.q_min)
    values = (drive_tau / bound, drive_dq / limits.dq_max, (s.motion[:, 0] - middle) / half)
    speeds = limits.transmission[:, arm.model.active] / limits.dq_max[:, None]
    slopes = (limits.to_drive @ s.J_tau / bound[..., None], speeds @ s.J_dq, s.J_q / half[:, None])
    rows, room = [], []
    for value, slope in zip(values, slopes, strict=True):
        at = np.abs(value) > near
        sign = np.sign(value[at])
        rows.append(sign[:, None] * slope[at])
        room.append(share - np.abs(value[at]))
    worst = max(float(np.abs(value).max()) for value in values)
    return Rows(np.concatenate(rows), np.concatenate(room), worst)


def solve(H: Array, gradient: Array, limits: tuple[Array, Array]) -> Array | None:
    """Return the step that minimises the quadratic within soft rows; None without a sound one.

    Limits that cannot be kept (the catch itself fixes the last instants) are violated as
    little as possible. DAQP's word alone is not taken: it answers NaN with ``solved``.
    """
    rows, room = limits
    if not all(np.all(np.isfinite(x)) for x in (H, gradient, rows, room)):
        return None
    if len(rows) == 0:
        return np.asarray(-np.linalg.solve(H, gradient), np.float64)
    kind = np.full(len(rows), 8, np.int32)
    low = np.full(len(rows), -1e30)
    step, _, flag, _ = daqp.solve(H, gradient, np.ascontiguousarray(rows), room, low, kind)
    step = np.asarray(step, np.float64)
    descends = gradient @ step + 0.5 * step @ H @ step <= _RESIDUAL or bool(np.any(room < 0.0))
    return step if flag > 0 and np.all(np.isfinite(step)) and descends else None
