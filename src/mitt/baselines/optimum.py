"""The least-cost catch as a nonlinear programme: free time and place, all limits kept.

min (22) over q(t), t_c subject to eq. (14) within the drives' torques, speeds and ranges, the
start, the meeting with the ball at t_c, and room for the brake after it. Accelerations are linear
between M + 1 even instants, so the motion between them is exact. Solved by IPOPT.

| here   | meaning                                              | unit            | shape    |
|--------|------------------------------------------------------|-----------------|----------|
| ``a``  | accelerations at the instants                        | rad/s^2         | (n, M+1) |
| ``c``  | the ball's flight around a time: r = sum c_k (t-t_m)^k | m/s^k         | (3, 7)   |
"""

from dataclasses import dataclass
from functools import cached_property
from types import ModuleType
from typing import final

import numpy as np

from mitt.baselines.choice import APPROACH, FOLLOW, Intercept
from mitt.baselines.intercept import hand_of
from mitt.baselines.paths import Motion, quintic
from mitt.baselines.symbolic import Expression, casadi, symbolic
from mitt.robot.arm import Arm
from mitt.signals import Array

#: Degree of the polynomial that stands for the ball's flight around the catch.
DEGREE = 6
#: Parts M of the motion.
PARTS = 16
#: Share of torque and speed limits that may be used; between the instants and in feedback a
#: little more is needed.
_SHARE = 0.95
#: Bound on IPOPT's iterations, and gap to a joint stop that is kept [rad].
_ITERATIONS, _GAP = 120, 0.08


@final
@dataclass(frozen=True, eq=False)
class Programme:
    """The programme of one arm; built once, solved for each throw."""

    arm: Arm

    def solve(
        self, t: float, motion: Array, guess: Intercept, *, flight: Array, window: float
    ) -> Motion | None:
        """Return the least-cost catch near a guessed one; None where IPOPT finds none.

        Args:
            t: Time of the start [s].
            motion: q, dq, ddq then, shape (3, n).
            guess: Catch to start from.
            flight: Polynomial of the ball's flight about the guess's time, shape (3, 7).
            window: How far the catch may move from the guess in time [s].
        """
        n, M, span = self.arm.n, PARTS, guess.t_c - t
        rows = np.empty((M + 1, 3, n))
        for k in range(M + 1):
            quintic(motion, guess.end, span, span * k / M, rows[k])
        rows[:, 0] = np.clip(rows[:, 0], self.arm.q_min, self.arm.q_max)
        start = np.concatenate([rows[:, d].ravel() for d in range(3)])
        soft, hard = APPROACH
        x0 = np.concatenate([start, [span, soft]])
        low = np.concatenate([self._bounds[0], [max(span - window, 0.05), soft]])
        high = np.concatenate([self._bounds[1], [span + window, hard]])
        p = np.concatenate([motion[0], motion[1], flight.ravel(order="F"), [span]])
        lbg, ubg = self._parts[4:]
        answer = self._solver(x0=x0, lbx=low, ubx=high, p=p, lbg=lbg, ubg=ubg)
        if not self._solver.stats()["success"]:
            return None
        x = np.asarray(answer["x"]).ravel()
        if not np.all(np.isfinite(x)):
            return None
        q, dq, ddq = x[: 3 * n * (M + 1)].reshape(3, M + 1, n).transpose(0, 2, 1)
        step = float(x[-2]) / M
        return Motion(t=t, step=step, q=q, dq=dq, ddq=ddq, cost=float(answer["f"]))

    @cached_property
    def _bounds(self) -> tuple[Array, Array]:
        """Bounds of angles, speeds and accelerations at the instants, each (3 n (M + 1),)."""
        arm, many = self.arm, PARTS + 1
        free = np.full(arm.n * many, np.inf)
        speed = np.tile(_SHARE * arm.dq_max, many)
        low = np.concatenate([np.tile(arm.q_min + _GAP, many), -speed, -free])
        return low, np.concatenate([np.tile(arm.q_max - _GAP, many), speed, free])

    @cached_property
    def _solver(self) -> Expression:
        """IPOPT on the programme, silent."""
        ca, (x, p, cost, g) = casadi(), self._parts[:4]
        options = {
            "ipopt.print_level": 0, "ipopt.sb": "yes", "print_time": False,
            "ipopt.max_iter": _ITERATIONS, "ipopt.tol": 1e-5,
            "ipopt.acceptable_tol": 1e-4, "ipopt.mu_strategy": "adaptive", "expand": True,
        }  # fmt: skip
        return ca.nlpsol("catch", "ipopt", {"x": x, "p": p, "f": cost, "g": g}, options)

    @cached_property
    def _parts(self) -> tuple[Expression, Expression, Expression, Expression, Array, Array]:
        """Variables, parameters, cost, constraints and their bounds."""
        ca, arm, n, M = casadi(), self.arm, self.arm.n, PARTS
        model = symbolic(arm)
        q, dq, a = (ca.MX.sym(name, n, M + 1) for name in ("q", "dq", "a"))
        span, approach = ca.MX.sym("span"), ca.MX.sym("approach")
        q_0, dq_0, mid = ca.MX.sym("q_0", n), ca.MX.sym("dq_0", n), ca.MX.sym("mid")
        c = ca.MX.sym("c", 3, DEGREE + 1)
        h = span / M
        tau = model.torque.map(M + 1)(q, dq, a)
        rows = _Rows()
        rows.equal(q[:, 0] - q_0, dq[:, 0] - dq_0)
        rows.equal(*steps(q, dq, a, h))
        ball = _flight(ca, c, span - mid)
        tip = model.tip(q[:, -1], dq[:, -1], a[:, -1])
        met = tip - ball
        rows.equal(met[:, 0], 0.1 * met[:, 1])
        rows.equal(0.01 * (met[:, 2] + approach * model.normal(q[:, -1])))
        for value, low, high in drive_rows(arm, tau, dq, share=_SHARE):
            rows.within(value, np.full(M + 1, low), np.full(M + 1, high))
        rows.within(braked(arm, q[:, -1], dq[:, -1]), arm.q_min + _GAP, arm.q_max - _GAP)
        active = tau[list(arm.model.active), :] / ca.DM(arm.tau_max)
        cost = (ca.sumsqr(active) + ca.sumsqr(dq / ca.DM(arm.dq_max))) / (M + 1)
        x = ca.vertcat(ca.vec(q), ca.vec(dq), ca.vec(a), span, approach)
        p = ca.vertcat(q_0, dq_0, ca.vec(c), mid)
        return x, p, cost, ca.vertcat(*rows.values), np.array(rows.low), np.array(rows.high)


class _Rows:
    """Constraints and their bounds, as they are collected."""

    def __init__(self) -> None:
        """Start empty."""
        self.values: list[Expression] = []
        self.low: list[float] = []
        self.high: list[float] = []

    def equal(self, *values: Expression) -> None:
        """Add what must be zero."""
        for value in values:
            flat = value.reshape((-1, 1))
            self.within(flat, np.zeros(flat.shape[0]), np.zeros(flat.shape[0]))

    def within(self, value: Expression, low: Array, high: Array) -> None:
        """Add what must lie between two bounds."""
        self.values.append(value)
        self.low.extend(low.tolist())
        self.high.extend(high.tolist())


def steps(
    q: Expression, dq: Expression, a: Expression, h: Expression
) -> tuple[Expression, Expression]:
    """Return what is zero where accelerations are linear between instants ``h`` s apart.

    Args:
        q: Angles at the instants, shape (n, M + 1).
        dq: Speeds there.
        a: Accelerations there.
        h: Time between them [s].
    """
    gained = dq[:, 1:] - dq[:, :-1] - 0.5 * h * (a[:, 1:] + a[:, :-1])
    moved = q[:, 1:] - q[:, :-1] - h * dq[:, :-1] - h**2 / 6 * (2 * a[:, :-1] + a[:, 1:])
    return gained, moved


def drive_rows(
    arm: Arm, tau: Expression, dq: Expression, *, share: float
) -> list[tuple[Expression, float, float]]:
    """Return the drives' torques and speeds with their bounds: peak, and stall to no load.

    Args:
        arm: The arm.
        tau: Torques of all N links at the instants [N m], shape (N, M + 1).
        dq: Speeds of the active joints there [rad/s], shape (n, M + 1).
        share: Part of each limit that may be used.
    """
    ca, limits = casadi(), arm.limits
    drive = ca.mtimes(ca.DM(limits.to_drive), tau)
    speed = ca.mtimes(ca.DM(limits.transmission[:, list(arm.model.active)]), dq)
    rows = list[tuple[Expression, float, float]]()
    for k, peak in enumerate(share * limits.tau_peak):
        run = speed[k, :].T / limits.dq_max[k]
        rows.append((drive[k, :].T / peak, -1.0, 1.0))
        rows.append((run, -share, share))
        if np.isfinite(limits.tau_stall[k]):
            rows.append((drive[k, :].T / (share * limits.tau_stall[k]) + run, -1.0, 1.0))
    return rows


def braked(arm: Arm, q: Expression, dq: Expression) -> Expression:
    """Return about where the joints stand once the arm has braked after the catch, shape (n,).

    Args:
        arm: The arm.
        q: Angles at the catch, shape (n,).
        dq: Speeds there, shape (n,).
    """
    size, inertia = casadi().sqrt(dq**2 + 0.01), hand_of(arm)[3:]
    return q + FOLLOW * dq + 0.5 * dq * size * inertia


def _flight(ca: ModuleType, c: Expression, s: Expression) -> Expression:
    """Return position, velocity, acceleration of the ball, shape (3, 3) by column."""
    columns = []
    for d in range(3):
        factor = [float(np.prod(np.arange(k - d + 1, k + 1))) for k in range(DEGREE + 1)]
        row = [factor[k] * s ** (k - d) if k > d else factor[k] * (k == d)
               for k in range(DEGREE + 1)]  # fmt: skip
        columns.append(ca.mtimes(c, ca.vertcat(*row)))
    return ca.horzcat(*columns)
