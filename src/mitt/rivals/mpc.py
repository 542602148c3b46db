"""Rival ``mpc``: model-predictive control of the joints' dynamics, up to the predicted catch.

A quadratic programme over the accelerations at even instants until the catch, linear between
them: least cost (22), torques linearised along the quintic that would do the same, bounds on the
drives' torques (soft, so that an answer is always there) and on speeds and ranges, and the
meeting with the ball at the end. One Gauss-Newton step each time (real-time iteration, Diehl and
others 2005), condensed onto the accelerations, solved by DAQP (Arnstroem and others 2022).

| here  | meaning                                              | unit    | shape             |
|-------|------------------------------------------------------|---------|-------------------|
| ``a`` | accelerations, instant by instant                    | rad/s^2 | ((M + 1) n,)      |
"""

from dataclasses import dataclass
from functools import cached_property
from typing import final

import daqp
import numpy as np
from numpy.typing import NDArray

from mitt.generator.generators import Generator
from mitt.generator.mapping import DirectMap
from mitt.generator.strain import Plant, Work, plant_of, work_of
from mitt.rivals.condensed import condense
from mitt.rivals.course import Course
from mitt.rivals.pieces import Motion, responses
from mitt.rivals.planned import Plan, Planned, PlannedSettings
from mitt.rivals.pursuit import rival
from mitt.robot.arm import Arm
from mitt.signals import Array

#: Kinds of DAQP's rows: an equality, an inequality that may give way.
_EQUAL, _SOFT = 5, 8
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
@dataclass(frozen=True)
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
        s, size, kind = self.settings, (self.settings.parts + 1) * self.arm.n, self._kind
        rows, low, high = np.empty((len(kind), size)), np.empty(len(kind)), np.empty(len(kind))
        price, at = np.empty((2 * size, size)), np.empty(2 * size)
        shares = s.share, s.speed
        condense(*self._scales, self._ranges, motion, end, step, shares, rows, low, high, price, at)
        H = 2.0 * (price.T @ price)
        H.ravel()[:: size + 1] += s.damping
        return Quadratic(H=H, f=2.0 * (at @ price), A=rows, low=low, high=high, kind=kind)

    @cached_property
    def _scales(self) -> tuple[Plant, Work]:
        """The arm as the kernel takes it, and buffers."""
        return plant_of(self.arm), work_of(self.arm)

    @cached_property
    def _ranges(self) -> Array:
        """Smallest and largest angles allowed [rad], shape (2, n)."""
        return np.array([self.arm.q_min + self.settings.gap, self.arm.q_max - self.settings.gap])

    @cached_property
    def _kind(self) -> NDArray[np.int32]:
        """Kinds of the rows: the ends; torques, angles and speeds, which may give way."""
        M, n, links = self.settings.parts, self.arm.n, len(self.arm.model.links)
        soft = (M + 1) * links + 2 * (M - 1) * n
        return np.array([_EQUAL] * (4 * n) + [_SOFT] * soft, np.int32)

    def _read(self, a: Array, motion: Array, t: float, step: float) -> Motion:
        """Return the answer as a motion."""
        M, n = self.settings.parts, self.arm.n
        D, P = responses(M, step)
        rows = a.reshape(M + 1, n)
        ticks = step * np.arange(M + 1)[:, None]
        q, dq = motion[0] + ticks * motion[1] + P @ rows, motion[1] + D @ rows
        q, dq, ddq = (np.ascontiguousarray(x.T) for x in (q, dq, rows))
        return Motion(t=t, step=step, q=q, dq=dq, ddq=ddq, cost=0.0)


def solve(problem: Quadratic) -> Array | None:
    """Return the minimiser; None where DAQP finds none, or says so and is wrong."""
    parts = (problem.H, problem.f, problem.A, problem.low, problem.high)
    if not all(np.isfinite(x).all() for x in parts):
        return None
    a, _, flag, _ = daqp.solve(
        problem.H, problem.f, problem.A, problem.high, problem.low, problem.kind
    )
    a = np.asarray(a, np.float64)
    if flag < 1 or not np.all(np.isfinite(a)):
        return None
    must = np.count_nonzero(problem.kind == _EQUAL)  # the first rows
    left = np.abs(problem.A[:must] @ a - problem.low[:must]).max()
    return a if left < _RESIDUAL else None


def make_mpc(f: DirectMap) -> Generator:
    """Return the rival for the arm of a map."""
    settings = PlannedSettings(dead_q=0.0, dead_dq=0.0, every=0.01, settled=0.06)
    return rival(f, Planned(planner=MpcPlanner(f.arm, MpcSettings()), settings=settings))
