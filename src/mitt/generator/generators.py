"""Generators of desired joint motion behind one call; rivals implement the same methods."""

from dataclasses import dataclass, field, replace
from typing import Protocol, Self, TypeAlias, final, runtime_checkable

import numpy as np

from mitt import checks
from mitt.errors import InputError
from mitt.fields import brief
from mitt.generator.demand import Tolerance
from mitt.generator.feasibility import (
    Outcome,
    Verdict,
    judge,
    levelled,
    returns,
    sharpness,
    unsettled,
)
from mitt.generator.learn import Learned
from mitt.generator.mapping import DirectMap
from mitt.generator.online import Online, Refinement
from mitt.robot.arm import Arm
from mitt.robot.shapes import Surroundings
from mitt.signals import Array, BallState, JointReference

#: Online steps before the verdict.
_STEPS_BEFORE = 3


@runtime_checkable
class Generator(Protocol):
    """What turns the ball's estimate into desired joint motion."""

    def sharpness(self, ball: BallState) -> float:
        """Return the predicted 1-sigma of the ball at the catch [m]; infinite without one."""
        ...

    def verdict(self, ball: BallState, q: Array) -> Verdict:
        """Say before moving whether a ball can be caught from rest in ``q`` [rad], shape (n,)."""
        ...

    def unsettled(self, ball: BallState, q: Array) -> bool:
        """Say, at less cost than a verdict, that it would be UNSETTLED; False where unclear."""
        ...

    def returns(self, ball: BallState) -> bool:
        """Say whether a ball whose verdict was OPEN can now be caught."""
        ...

    def waiting(self, ball: BallState) -> BallState:
        """Return the ball to be followed in place of one whose verdict is OPEN."""
        ...

    def adapt(self, ball: BallState, q: Array, dq: Array) -> Self:
        """Return the generator that starts in ``q``, ``dq`` [rad, rad/s], shapes (n,)."""
        ...

    def reference(self, ball: BallState) -> JointReference:
        """Return the desired joint motion for the ball; pure."""
        ...

    def as_map(self) -> DirectMap | None:
        """Return the map that ``reference`` evaluates, for the compiled tick; None if another."""
        ...


@final
@dataclass(frozen=True, slots=True)
class Direct:
    """The learned map, adapted to each throw by one projection, and refined in flight if wished.

    Attributes:
        map: The map in use.
        tolerance: Share of each limit at which a throw is refused.
        online: What refines it in flight; None for the projection alone.
        learned: The map that adaptations start from; the one in use where None.
    """

    map: DirectMap
    tolerance: Tolerance = field(default_factory=Tolerance)
    online: Online | None = None
    learned: DirectMap | None = None

    __repr__ = brief

    def __post_init__(self) -> None:
        """Refuse what is no map, no tolerance, and no online step."""
        checks.instance("map", self.map, DirectMap)
        checks.instance("tolerance", self.tolerance, Tolerance)
        if self.online is not None:
            checks.instance("online", self.online, Online)
        if self.learned is not None:
            checks.instance("learned", self.learned, DirectMap)

    def sharpness(self, ball: BallState) -> float:
        """Fly the estimate on to the catch."""
        return sharpness(self.map, ball)

    def verdict(self, ball: BallState, q: Array) -> Verdict:
        """Judge the throw by the demand of the adapted map, refined by a few steps if wished."""
        judged = judge(self.map, ball, q, tolerance=self.tolerance)
        if self.online is None or ball.led or not np.isfinite(judged.share):
            return judged
        g = self.adapt(ball, q, np.zeros(len(q)))
        for _ in range(_STEPS_BEFORE):
            g = g.refined(ball)
        refined = g.certificate(ball)
        return judged if refined is None else replace(refined, approach=judged.approach)

    def unsettled(self, ball: BallState, q: Array) -> bool:
        """Look whether the ball is led and its catch far ahead or outside the region."""
        checks.vector("q", q, self.map.arm.n, finite=True)
        return unsettled(self.map, ball)

    def returns(self, ball: BallState) -> bool:
        """Look whether the predicted catch lies in the region of the map."""
        return returns(self.map, ball)

    def waiting(self, ball: BallState) -> BallState:
        """Wait at the nominal catch height."""
        return levelled(self.map, ball)

    def adapt(self, ball: BallState, q: Array, dq: Array) -> "Direct":
        """Project alpha onto the initial constraint, eq. (12); refining begins anew."""
        if self.online is not None:
            self.online.restart()
        start = self.map if self.learned is None else self.learned
        return replace(self, map=start.adapt(ball, q, dq))

    def refined(self, ball: BallState) -> "Direct":
        """Return the generator of the next tick, one online step better for the flight's rest."""
        if checks.instance("ball", ball, BallState).led or self.online is None:
            return self
        answer = self.online.refine(self.map.alpha, ball)
        if answer.status is not Refinement.REFINED:
            return self
        return replace(self, map=self.map.with_alpha(answer.alpha))

    def certificate(self, ball: BallState) -> Verdict | None:
        """Return the certificate of the course last refined; None without one."""
        ball = checks.instance("ball", ball, BallState)
        if self.online is None:
            return None
        return self.online.certify(self.map.alpha, ball, tolerance=self.tolerance)

    def reference(self, ball: BallState) -> JointReference:
        """Evaluate the map."""
        return self.map.reference(ball)

    def as_map(self) -> DirectMap:
        """Hand the map over."""
        return self.map


def refining(f: DirectMap, around: Surroundings | None = None) -> Direct:
    """Return the learned map with an online step each millisecond, clear of what stands around."""
    return Direct(f, online=Online(f, around=around), learned=f)


@final
@dataclass(frozen=True, slots=True)
class Unoptimised:
    """The map with alpha = 0, as the paper's figs. 10 and 11 show it; it never refuses."""

    map: DirectMap

    __repr__ = brief

    def __post_init__(self) -> None:
        """Refuse what is no map."""
        checks.instance("map", self.map, DirectMap)

    def sharpness(self, ball: BallState) -> float:
        """Fly the estimate on to the catch."""
        return sharpness(self.map, ball)

    def verdict(self, ball: BallState, q: Array) -> Verdict:
        """Never refuse; the limits are still reckoned, to be reported."""
        judged = judge(self.map, ball, q, tolerance=Tolerance())
        return replace(judged, outcome=Outcome.FEASIBLE)

    def unsettled(self, ball: BallState, q: Array) -> bool:  # noqa: ARG002
        """Wait for nothing: every verdict is feasible."""
        return False

    def returns(self, ball: BallState) -> bool:  # noqa: ARG002
        """Follow whatever comes."""
        return True

    def waiting(self, ball: BallState) -> BallState:
        """Wait for nothing."""
        return ball

    def adapt(self, ball: BallState, q: Array, dq: Array) -> "Unoptimised":  # noqa: ARG002
        """Start nowhere in particular: alpha stays 0."""
        return self

    def reference(self, ball: BallState) -> JointReference:
        """Evaluate the map."""
        return self.map.reference(ball)

    def as_map(self) -> DirectMap:
        """Hand the map over."""
        return self.map


GeneratorLike: TypeAlias = Generator | DirectMap | Learned
"""What is taken for a generator: itself, a map, or what :func:`mitt.learn` returned."""


def generator_of(given: object, *, name: str = "generator") -> Generator:
    """Return a generator as a user gives one: itself, a map, or what :func:`mitt.learn` returned.

    Raises:
        InputError: It is none of them; it is called ``name``.
    """
    given = given.map if isinstance(given, Learned) else given
    if isinstance(given, DirectMap):
        return Direct(given)
    if not isinstance(given, Generator) or isinstance(given, type):
        wanted = "a generator, a map, or what mitt.learn returned"
        raise InputError(name, wanted, checks.shown(given))
    return given


def map_of(generator: Generator) -> DirectMap | None:
    """Return the map that a generator evaluates; None for one of another kind."""
    return generator_of(generator).as_map()


def for_arm(arm: Arm, given: object) -> tuple[Generator, DirectMap | None]:
    """Return a generator as a user gives one for an arm, and the map that it evaluates, if any.

    Raises:
        InputError: It is none, or its map is for an arm of other joints, lengths or masses.
    """
    generator = generator_of(given)
    f = generator.as_map()
    if f is not None:
        check_arm(arm, f)
    return generator, f


def check_arm(arm: Arm, f: DirectMap) -> None:
    """Refuse a map that was learned for an arm of other joints, lengths or masses."""
    same = f.arm.names == arm.names and np.array_equal(f.arm.bodies, arm.bodies)
    if f.arm is not arm and not same:
        raise InputError("generator", f"a map for {arm}", f"one for {f.arm}",
                         do="learn a map for this arm")  # fmt: skip
