"""Rival ``mpc``: model-predictive control of the joints' dynamics, up to the predicted catch.

A quadratic programme over the accelerations at even instants until the catch, linear between
them: least cost (22), torques linearised along the quintic that would do the same, bounds on the
drives' torques (soft, so that an answer is always there) and on speeds and ranges, and the
meeting with the ball at the end. One Gauss-Newton step each time (real-time iteration, Diehl and
others 2005), condensed onto the accelerations, solved by DAQP (Arnstroem and others 2022).

| here | meaning                                               | unit    | shape             |
|------|-------------------------------------------------------|---------|-------------------|
| ``a``| accelerations, instant by instant                     | rad/s^2 | ((M + 1) n,)      |
| ``T``| drives' torques over their limits per acceleration    | s^2/rad | ((M + 1) N, (M + 1) n) |
"""

from dataclasses import dataclass
from typing import final

import daqp
import numpy as np
from numpy.typing import NDArray

from mitt.generator.generators import Generator
from mitt.generator.mapping import DirectMap
from mitt.rivals.course import Course
from mitt.rivals.pieces import Motion, responses
from mitt.rivals.planned import Plan, Planned, PlannedSettings
from mitt.rivals.pursuit import rival
from mitt.rivals.quintics import quintic
from mitt.robot.arm import Arm
from mitt.signals import Array

#: Kinds of DAQP's rows: an inequality, an equality, an inequality that may give way.
_HARD, _EQUAL, _SOFT = 0, 5, 8
#: Residual of the meeting beyond which an answer is not believed [rad, rad/s].
_RESIDUAL = 1e-4


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class MpcSettings:
    """How the programme is set up.

    Attributes:
        parts: Parts M of the horizon.
        share: Share of the torque limits.
        speed: Share of the speed limits.
        gap: Gap to a joint stop that is kept [rad].
        damping: Weight that keeps the programme strictly convex.
    """

    parts: int = 10
    share: float = 0.9
    speed: float = 0.98
    gap: float = 0.06
    damping: float = 1e-7


@final
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Quadratic:
    """min a' H a / 2 + f' a, low <= A a <= high; ``kind`` as DAQP names its rows."""

    H: Array
    f: Array
    A: Array
    low: Array
    high: Array
    kind: NDArray[np.int32]


@final
@dataclass(frozen=True, slots=True, eq=False)
class _Way:
    """The two ends of a plan, and how its instants follow from the accelerations."""

    start: Array
    end: Array
    step: float
    angle: Array
    speed: Array
    drift_q: Array
    drift_dq: Array


@final
@dataclass(frozen=True, slots=True)
class MpcPlanner:
    """Plans for one arm."""

    arm: Arm
    settings: MpcSettings

    def __call__(self, motion: Array, t: float, course: Course) -> Plan | None:
        """Return the plan that ends at the catch; None where the programme has no answer."""
        step = (course.t_c - t) / self.settings.parts
        if not step > 1e-4:
            return None
        a = solve(self.problem(motion, course.end, step))
        return None if a is None else self._read(a, motion, t, step)

    def problem(self, motion: Array, end: Array, step: float) -> Quadratic:
        """Return the programme from q, dq, ddq (3, n) to ``end`` in M steps of ``step`` [s]."""
        arm, s, M, n = self.arm, self.settings, self.settings.parts, self.arm.n
        D, P = responses(M, step)
        ticks = step * np.arange(M + 1, dtype=np.float64)[:, None]
        drift_q, drift_dq = motion[0] + ticks * motion[1], np.tile(motion[1], (M + 1, 1))
        speed, angle = (np.asarray(np.kron(x, np.eye(n)), np.float64) for x in (D, P))
        way = _Way(motion, end, step, angle, speed, drift_q, drift_dq)
        T, load, torque, torque_at = self._torques(way)
        per_speed = np.tile(1.0 / arm.dq_max, M + 1)
        v, v_0 = per_speed[:, None] * speed, per_speed * drift_dq.ravel()
        H = 2.0 * (torque.T @ torque + v.T @ v) + s.damping * np.eye(len(v))
        f = 2.0 * (torque.T @ torque_at + v.T @ v_0)
        last, first = slice(M * n, (M + 1) * n), np.eye(len(v))
        fixed = np.vstack([first[:n], first[last], angle[last], speed[last]])
        to = np.concatenate([motion[2], end[2], end[0] - drift_q[-1], end[1] - drift_dq[-1]])
        inner = slice(n, M * n)
        low, high = (np.tile(x, M - 1) - drift_q[1:-1].ravel()
                     for x in (arm.q_min + s.gap, arm.q_max - s.gap))  # fmt: skip
        fast = np.full((M - 1) * n, s.speed)
        many = np.full(len(load), s.share)
        kinds = ((_EQUAL, len(to)), (_SOFT, len(T)), (_SOFT, len(low)), (_SOFT, len(low)))
        return Quadratic(
            H=H, f=f, A=np.vstack([fixed, T, angle[inner], v[inner]]),
            low=np.concatenate([to, -many - load, low, -fast - v_0[inner]]),
            high=np.concatenate([to, many - load, high, fast - v_0[inner]]),
            kind=np.concatenate([np.full(count, kind, np.int32) for kind, count in kinds]),
        )  # fmt: skip

    def _torques(self, way: "_Way") -> tuple[Array, Array, Array, Array]:
        """Return drives' and joints' torques over their limits: per acceleration, and at none."""
        arm, M, n = self.arm, self.settings.parts, self.arm.n
        limits, N = arm.limits, len(arm.model.links)
        T, load = np.empty(((M + 1) * N, (M + 1) * n)), np.empty((M + 1) * N)
        J, at, rows = np.empty(((M + 1) * n, (M + 1) * n)), np.empty((M + 1) * n), np.empty((3, n))
        active = list(arm.model.active)
        for k in range(M + 1):
            quintic(way.start, way.end, M * way.step, k * way.step, rows)
            tau = arm.torque(*rows)
            by_q, by_dq, mass = arm.torque_derivatives(*rows)
            own = slice(k * n, (k + 1) * n)
            per = by_q @ way.angle[own] + by_dq @ way.speed[own]
            per[:, own] += mass
            none = tau + by_q @ (way.drift_q[k] - rows[0]) + by_dq @ (way.drift_dq[k] - rows[1])
            none -= mass @ rows[2]
            drive = limits.drive_torque(tau)
            bound = limits.torque_bound(drive, limits.drive_speed(arm.all_joints(rows[1])))
            scale = limits.to_drive / np.maximum(bound, 0.05 * limits.tau_peak)[:, None]
            T[k * N : (k + 1) * N], load[k * N : (k + 1) * N] = scale @ per, scale @ none
            J[own], at[own] = per[active] / arm.tau_max[:, None], none[active] / arm.tau_max
        return T, load, J, at

    def _read(self, a: Array, motion: Array, t: float, step: float) -> Motion:
        """Return the answer as a motion."""
        M, n = self.settings.parts, self.arm.n
        D, P = responses(M, step)
        rows = a.reshape(M + 1, n)
        ticks = step * np.arange(M + 1)[:, None]
        q, dq = motion[0] + ticks * motion[1] + P @ rows, motion[1] + D @ rows
        return Motion(t=t, step=step, q=q.T, dq=dq.T, ddq=rows.T, cost=0.0)


def solve(problem: Quadratic) -> Array | None:
    """Return the minimiser; None where DAQP finds none, or says so and is wrong."""
    parts = (problem.H, problem.f, problem.A, problem.low, problem.high)
    if not all(np.all(np.isfinite(x)) for x in parts):
        return None
    a, _, flag, _ = daqp.solve(
        problem.H, problem.f, problem.A, problem.high, problem.low, problem.kind
    )
    a = np.asarray(a, np.float64)
    if flag < 1 or not np.all(np.isfinite(a)):
        return None
    must = problem.kind == _EQUAL
    left = np.abs(problem.A[must] @ a - problem.low[must]).max()
    return a if left < _RESIDUAL else None


def make_mpc(f: DirectMap) -> Generator:
    """Return the rival for the arm of a map."""
    settings = PlannedSettings(dead_q=0.0, dead_dq=0.0, every=0.01, settled=0.06)
    return rival(f, Planned(planner=MpcPlanner(f.arm, MpcSettings()), settings=settings))
