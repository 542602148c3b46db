"""Predict the catch: where and when on the ball's flight the arm will meet it.

Of all instants at which the catch point can be where the ball will be, that one is chosen at
which a quintic from the arm's state costs least by eq. (22) within the limits. The room that the
brake after the catch takes is part of the range.
"""

from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from typing import final

import numpy as np

from mitt.generator.certificate import Outcome as Feasible
from mitt.generator.certificate import Verdict
from mitt.generator.foresight import state_of
from mitt.generator.mapping import DirectMap
from mitt.generator.strain import plant_of, work_of
from mitt.rivals.meeting import hand_of, meet_at
from mitt.rivals.offers import Numbers
from mitt.rivals.search import Arena, Known, arena_of, elect, search
from mitt.robot.arm import Arm
from mitt.signals import Array, BallState


@dataclass(frozen=True, slots=True, kw_only=True)
class CourseSettings:
    """How the catch is chosen.

    Attributes:
        approach: Smallest and largest relative acceleration along the palm's normal [m/s^2].
        soonest: Shortest time in which the arm is thrown into a new plan [s].
        horizon: Longest look ahead [s].
        stride: Step of the candidates [s].
        instants: Instants at which a candidate is held against the limits.
        spare: Share of a limit above which a candidate pays for it.
        price: What it pays per squared share.
        low: What a low catch pays.
        refused: Share of a limit beyond which a throw is refused.
        follow: Time after the catch that is still followed [s].
    """

    approach: tuple[float, float] = (70.0, 160.0)
    soonest: float = 0.06
    horizon: float = 0.9
    stride: float = 0.02
    instants: int = 8
    spare: float = 0.9
    price: float = 100.0
    low: float = 2.0
    refused: float = 1.6
    follow: float = 0.004


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Course:
    """A chosen catch.

    Attributes:
        t_c: Its time [s].
        end: q, dq, ddq then [rad ...], shape (3, n).
        r_c: The ball's predicted position then [m], shape (3,).
        binding_limit: The limit that the way there asks most.
        share: How much of it is asked.
        low: Whether the catch is lower than any that the map was learned on, where a surface may
            be in the way.
    """

    t_c: float
    end: Array
    r_c: Array
    binding_limit: str
    share: float
    low: bool


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Chooser:
    """Chooses the catch for one arm."""

    map: DirectMap
    settings: CourseSettings = field(default_factory=CourseSettings)

    @property
    def arm(self) -> Arm:
        """The arm."""
        return self.map.arm

    @cached_property
    def hand(self) -> Array:
        """Numbers of the kernels."""
        return hand_of(self.arm)

    @cached_property
    def floor(self) -> float:
        """Height of the lowest catch that the map was learned on [m]; nothing else of it counts."""
        low, high = self.map.region
        if not np.all(np.isfinite(self.map.region)):
            return -np.inf
        corners = product(*zip(low, high, strict=True))
        return float(min(self.arm.position(np.array(q))[2] for q in corners))

    @cached_property
    def _known(self) -> Known:
        """What a search knows of the arm, and its buffers."""
        f, arm = self.map, self.arm
        return Known(
            f.packed, self.hand, self.settings.approach,
            np.array([arm.q_min, arm.q_max, f.start]), f.work,
            plant_of(arm), work_of(arm), self._numbers,
        )  # fmt: skip

    @cached_property
    def _steps(self) -> tuple[Array, Arena, float]:
        """Times of the candidates [s], buffers for them, and their step [s]."""
        s = self.settings
        after = np.arange(s.soonest, s.horizon, s.stride)
        return after, arena_of(len(after), s.instants, self.arm.n), s.stride

    @cached_property
    def _numbers(self) -> Numbers:
        """Settings of :func:`mitt.rivals.offers.cheapest`."""
        s = self.settings
        return s.refused, s.spare, s.price, s.low, s.follow, self.floor

    @cached_property
    def _limits(self) -> tuple[str, ...]:
        """Names of the limits, kind by kind and joint by joint."""
        kinds = ("torque", "speed", "range")
        return tuple(f"{kind}:{name}" for kind in kinds for name in self.arm.names)

    def choose(self, ball: BallState, motion: Array) -> Course | None:
        """Return the best catch for an arm in q, dq, ddq, shape (3, n); None where there is none.

        Args:
            ball: The ball's estimate.
            motion: The arm's state at the same time.
        """
        end, at = np.empty((3, self.arm.n)), np.empty((3, 3))
        after, share, which, low = search(
            self._known, *self._steps, state_of(ball), motion, end, at
        )
        if after == np.inf:
            return None
        return Course(
            t_c=ball.t + after, end=end, r_c=at[0], binding_limit=self._limits[which],
            share=share, low=low,
        )  # fmt: skip

    def best(self, after: Array, balls: Array, motion: Array) -> Course | None:
        """Return the best of several catches, its time counted from now; None without one.

        Args:
            after: Times from now [s], shape (K,).
            balls: r_o, dr_o, ddr_o then, shape (K, 3, 3).
            motion: q, dq, ddq now, shape (3, n).
        """
        arena = arena_of(len(after), self.settings.instants, self.arm.n)
        arena.balls[:] = balls
        k = elect(self._known, after, arena, motion)
        if k < 0:
            return None
        _, _, share, which, low = arena.offers[k].tolist()
        return Course(
            t_c=float(after[k]), end=arena.ends[k], r_c=balls[k, 0],
            binding_limit=self._limits[int(which)], share=share, low=low > 0.0,
        )  # fmt: skip

    def aim(self, course: Course, state: Array, t: float) -> Course:
        """Return the course with its end where the ball is now predicted to be at its time.

        Args:
            course: The course.
            state: The ball, as of :func:`mitt.generator.foresight.state_of`, shape (10,).
            t: Time of it [s].
        """
        f, at, end, bounds = self.map, np.empty((3, 3)), course.end.copy(), self.settings.approach
        if not meet_at(f.packed, self.hand, bounds, state, course.t_c - t, at, end, f.work):
            return course
        return Course(
            t_c=course.t_c, end=end, r_c=at[0],
            binding_limit=course.binding_limit, share=course.share, low=course.low,
        )  # fmt: skip

    def verdict(self, course: Course | None, *, sigma: float) -> Verdict:
        """Return the verdict on a throw by the course chosen for it; feasible or unreachable."""
        if course is None:
            return Verdict(
                outcome=Feasible.UNREACHABLE, binding_limit="domain", share=np.inf,
                t_catch=np.inf, sigma=sigma,
            )  # fmt: skip
        fits = course.share <= self.settings.refused
        return Verdict(
            outcome=Feasible.FEASIBLE if fits else Feasible.UNREACHABLE,
            binding_limit=course.binding_limit,
            share=course.share,
            t_catch=course.t_c,
            sigma=sigma,
        )
