"""Generators of desired joint motion behind one call; rivals implement the same methods.

Those of other packages are held to what a catcher goes on with (:class:`Added`).
"""

from dataclasses import dataclass, field, replace
from functools import lru_cache
from math import inf
from typing import Generic, Protocol, Self, TypeAlias, TypeVar, final, runtime_checkable

import numpy as np

from mitt import checks
from mitt.arm.arm import Arm, difference, identity_of
from mitt.catcher.refine import certify, refine
from mitt.errors import InputError, answered_by
from mitt.fields import brief
from mitt.map.demand import Tolerance
from mitt.map.foresight import sharpness
from mitt.map.learn import Learned
from mitt.map.mapping import DirectMap
from mitt.map.prediction import state_of
from mitt.signals import Array, BallState, JointReference, MapStatus
from mitt.verdict.feasibility import (
    Approach,
    Outcome,
    Verdict,
    judge,
    levelled,
    returns,
    unsettled,
)

#: Least time between two instants of a motion [s].
_BRIEFEST = 1e-6
#: Least share of the torque that an arm commands which is the same but for a reserve.
_KEPT = 0.95
#: Parts of an arm's identity that are limits: what a map was learned for, not what it is made of.
_TORQUES = ("peak torques", "stall torques")
_LIMITS = (*_TORQUES, "continuous torques", "transmission", "joint ranges", "joint speeds",
           "accelerations", "jerks", "torque rates")  # fmt: skip
#: What a generator planned.
_P = TypeVar("_P")


class Memory(Generic[_P]):
    """What was planned last: the catcher asks for the verdict, and then to adapt.

    Attributes:
        ball: The estimate that it was planned for; None before.
        plan: The plan.
    """

    def __init__(self) -> None:
        """Begin without a plan."""
        self.ball: BallState | None = None
        self.plan: _P | None = None

    def of(self, ball: BallState) -> _P | None:
        """Return the plan if it was made for this estimate, or for one that says the same."""
        mine = self.ball
        if mine is None or (ball.t, ball.drag) != (mine.t, mine.drag):
            return None
        return self.plan if np.array_equal(state_of(ball), state_of(mine)) else None

    def keep(self, ball: BallState, plan: _P) -> _P:
        """Keep a plan and return it."""
        self.ball, self.plan = ball, plan
        return plan


@runtime_checkable
class Generator(Protocol):
    """What turns the ball's estimate into desired joint motion.

    One that is derived from this waits for nothing, and is no map, unless it says otherwise.
    """

    def sharpness(self, ball: BallState) -> float:
        """Return the predicted 1-sigma of the ball at the catch [m]; infinite without one."""
        ...

    def verdict(self, ball: BallState, q: Array) -> Verdict:
        """Say before moving whether a ball can be caught from rest in ``q`` [rad], shape (n,)."""
        ...

    def unsettled(self, ball: BallState, q: Array) -> bool:  # noqa: ARG002
        """Say, at less cost than a verdict, that it would be UNSETTLED; False where unclear."""
        return False

    def returns(self, ball: BallState) -> bool:  # noqa: ARG002
        """Say whether a ball whose verdict was OPEN can now be caught."""
        return True

    def waiting(self, ball: BallState) -> BallState:
        """Return the ball to be followed in place of one whose verdict is OPEN."""
        return ball

    def adapt(self, ball: BallState, q: Array, dq: Array) -> Self:
        """Return the generator that starts in ``q``, ``dq`` [rad, rad/s], shapes (n,)."""
        ...

    def reference(self, ball: BallState) -> JointReference:
        """Return the desired joint motion for the ball; pure."""
        ...

    def as_map(self) -> DirectMap | None:
        """Return the map that ``reference`` evaluates, for the compiled tick; None if another."""
        return None


@runtime_checkable
class Movable(Generator, Protocol):
    """A generator that can be given the same arm with other limits."""

    def on(self, arm: Arm) -> Generator:
        """Return the generator for an arm."""
        ...


@runtime_checkable
class Underway(Generator, Protocol):
    """A generator that knows of an arm that moves: its verdict, and what else it could follow."""

    @property
    def certificate(self) -> Verdict | None:
        """What a refined map says of its catch; None where nothing was refined."""
        ...

    def verdict(self, ball: BallState, q: Array, dq: Array | None = None) -> Verdict:
        """Say whether an arm in ``q`` that moves at ``dq`` can catch a ball, shapes (n,)."""
        ...

    def astray(self, ball: BallState) -> bool:
        """Say whether what is followed cannot catch any more, and something else can."""
        ...

    def wait(self, ball: BallState, q: Array, dq: Array) -> Self:
        """Return the generator that waits, from ``q``, ``dq`` on, for a ball whose verdict is OPEN.

        It is to follow :meth:`waiting`.
        """
        ...


@runtime_checkable
class Farsighted(Generator, Protocol):
    """A generator whose verdict looks as far ahead as a motion may begin, on a ball however far."""

    def horizon(self) -> float:
        """Return how far ahead it looks [s]."""
        ...


@runtime_checkable
class Paced(Generator, Protocol):
    """A generator whose verdict takes long: it is asked again only after a while."""

    def pause(self) -> float:
        """Return the least time from one verdict to the next before the arm moves [s]."""
        ...


@runtime_checkable
class Remembering(Generator, Protocol):
    """A generator that keeps what it found out of a ball: a throw begins without."""

    def afresh(self) -> Self:
        """Return the generator as it is before any ball."""
        ...


@runtime_checkable
class Leaving(Generator, Protocol):
    """A generator that says how the arm goes away with what it has grasped.

    Where its reference has a motion but no catch ahead, the arm brakes at once, and a hand that was
    closing opens.
    """

    def leaving(self, motion: Array) -> Array | None:
        """Return q, dq, ddq each tick from a command on to rest, shape (k, 3, n).

        None where the arm is to brake.

        Args:
            motion: The command, shape (3, n).
        """
        ...


@final
@dataclass(frozen=True, slots=True)
class Direct:
    """The learned map, adapted to each throw by one projection, and refined for it if wished.

    Attributes:
        map: The map in use.
        tolerance: Share of each limit at which a throw is refused.
        refines: Whether each adaptation goes on by steps of eq. (22) for the ball that comes.
        learned: The map that adaptations start from; the one in use where None.
        certificate: What the refined map says of its catch; None where nothing was refined.
    """

    map: DirectMap
    tolerance: Tolerance = field(default_factory=Tolerance)
    refines: bool = False
    learned: DirectMap | None = None
    certificate: Verdict | None = None

    __repr__ = brief

    def __post_init__(self) -> None:
        """Refuse what is no map and no tolerance, and to refine a map that weighs its match."""
        checks.instance("map", self.map, DirectMap)
        checks.instance("tolerance", self.tolerance, Tolerance)
        checks.instance("refines", self.refines, bool)
        if self.learned is not None:
            checks.instance("learned", self.learned, DirectMap)
        if self.certificate is not None:
            checks.instance("certificate", self.certificate, Verdict)
        weight = self.map.design.match_weight
        if self.refines and weight > 0.0:  # eq. (22) alone would undo what the map has learned
            raise InputError("a map refined in flight", "match_weight 0", weight,
                             do="leave --adapt refine out")  # fmt: skip

    @property
    def arms(self) -> tuple[Arm, ...]:
        """The arms that its parts were made for."""
        return (self.map.arm, (self.learned or self.map).arm)

    def on(self, arm: Arm) -> "Direct":
        """Return the generator for the same arm with other limits."""
        learned = None if self.learned is None else self.learned.on(arm)
        return replace(self, map=self.map.on(arm), learned=learned)

    def sharpness(self, ball: BallState) -> float:
        """Fly the estimate on to the catch."""
        return sharpness(self.map, ball)

    def verdict(self, ball: BallState, q: Array, dq: Array | None = None) -> Verdict:
        """Judge the throw by the demand of the map as it would be adapted.

        The arm is at rest in ``q``, or moves at ``dq`` [rad, rad/s], shape (n,) each.
        """
        judged = judge(self.learned or self.map, ball, q, tolerance=self.tolerance, dq=dq)
        if not self.refines or ball.led or not np.isfinite(judged.share):
            return judged
        refined = self.adapt(ball, q, np.zeros(len(q)) if dq is None else dq).certificate
        return judged if refined is None else refined

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
        """Project alpha onto the initial constraint, eq. (12), and refine it for the ball."""
        q, dq = (checks.vector(*x, self.map.arm.n, finite=True) for x in (("q", q), ("dq", dq)))
        f = (self.learned or self.map).adapt(ball, q, dq)
        if not self.refines or ball.led or f.status is not MapStatus.INSIDE:
            return replace(self, map=f)
        g = refine(f, ball, q, dq)
        return replace(self, map=g, certificate=certify(g, ball, (q, dq), self.tolerance))

    def astray(self, ball: BallState) -> bool:
        """Know of nothing else that could."""
        checks.instance("ball", ball, BallState)
        return False

    def wait(self, ball: BallState, q: Array, dq: Array) -> "Direct":
        """Adapt to where it waits."""
        return self.adapt(self.waiting(ball), q, dq)

    def reference(self, ball: BallState) -> JointReference:
        """Evaluate the map."""
        return self.map.reference(ball)

    def as_map(self) -> DirectMap:
        """Hand the map over."""
        return self.map


def refining(f: DirectMap) -> Direct:
    """Return the learned map, refined for each ball."""
    return Direct(f, refines=True, learned=f)


@final
@dataclass(frozen=True, slots=True)
class Unoptimised(Generator):
    """The map with alpha = 0, as the paper's figs. 10 and 11 show it; it never refuses."""

    map: DirectMap

    __repr__ = brief

    def __post_init__(self) -> None:
        """Refuse what is no map."""
        checks.instance("map", self.map, DirectMap)

    def on(self, arm: Arm) -> "Unoptimised":
        """Return the generator for the same arm with other limits."""
        return Unoptimised(self.map.on(arm))

    def sharpness(self, ball: BallState) -> float:
        """Fly the estimate on to the catch."""
        return sharpness(self.map, ball)

    def verdict(self, ball: BallState, q: Array) -> Verdict:
        """Never refuse; the limits are still reckoned, to be reported."""
        judged = judge(self.map, ball, q, tolerance=Tolerance())
        return replace(judged, outcome=Outcome.FEASIBLE)

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
    given = generator_of(generator)
    with answered_by(called(given)):
        f = given.as_map()
        return None if f is None else checks.instance("as_map", f, DirectMap)


def called(generator: Generator) -> str:
    """Return what an error calls a generator that somebody made."""
    return f"generator {type(generator).__name__}"


def for_arm(arm: Arm, given: object) -> tuple[Generator, DirectMap | None]:
    """Return a generator as a user gives one for an arm, and the map that it evaluates, if any.

    A map that was learned with other limits of the same arm is judged by the limits of this one.

    Raises:
        InputError: It is none, or was made for another arm.
    """
    generator = generator_of(given)
    f = map_of(generator)
    others = {*arms_of(generator), *(() if f is None else (f.arm,))}
    for other in others:
        _check_same(arm, other, limits=not isinstance(generator, Movable))
    unlike = any(_difference(arm, other, limits=True) for other in others)
    if unlike and isinstance(generator, Movable):
        generator = generator_of(generator.on(arm), name=called(generator))
    return generator, map_of(generator)


def arms_of(generator: Generator) -> tuple[Arm, ...]:
    """Return the arms that a generator says its parts were made for; one need not say it."""
    with answered_by(called(generator)):
        return tuple(checks.instance("arms", arm, Arm) for arm in getattr(generator, "arms", ()))


def check_arm(arm: Arm, f: DirectMap) -> None:
    """Refuse a map that was learned for another arm; other limits of the same arm may do."""
    _check_same(arm, f.arm, limits=False)


def _check_same(arm: Arm, other: Arm, *, limits: bool) -> None:
    """Refuse what was made for an arm that is not this one by its numbers.

    Args:
        arm: The arm that is used.
        other: The arm that a map or another generator was made for.
        limits: Whether their limits have to be the same too.
    """
    unlike = None if other is arm else _difference(arm, other, limits=limits)
    if unlike is not None:
        raise InputError("generator", f"one for {arm}", f"one for another arm: {unlike}",
                         do="learn a map for this arm")  # fmt: skip


@lru_cache(maxsize=32)
def _difference(arm: Arm, other: Arm, *, limits: bool) -> str | None:
    """Return what tells two arms apart, in words; None where they are the same.

    An arm that keeps a little of its torque in reserve is the same.
    """
    if arm.names != other.names:
        return f"its joints are {', '.join(other.names)}"
    mine, theirs = identity_of(arm), identity_of(other)
    for name in _LIMITS:
        reserved = name in _TORQUES and _is_reserve(mine[name], theirs[name])
        if reserved or not limits:
            mine[name] = theirs[name]
    shapes, others = ([x.base_capsules, *(link.capsules for link in x.links)]
                      for x in (arm.model.complete(), other.model.complete()))  # fmt: skip
    return "its shapes differ" if shapes != others else difference(mine, theirs)


def _is_reserve(mine: list[float | None], whole: list[float | None]) -> bool:
    """Say whether torques, of which None is infinite, are nearly the whole, and no more."""
    pairs = [(np.inf if x is None else x, np.inf if y is None else y)
             for x, y in zip(mine, whole, strict=False)]  # fmt: skip
    return len(mine) == len(whole) and all(_KEPT * y <= x <= y for x, y in pairs)


@final
@dataclass(frozen=True, slots=True)
class Added:
    """A generator of another package: the same calls, its exceptions and answers named after it.

    It is lent copies: what it writes to what it was given changes nothing.

    Attributes:
        name: What an error calls it.
        inner: The generator.
        n: Number of joints of its arm.
    """

    name: str
    inner: Generator
    n: int

    @property
    def arms(self) -> tuple[Arm, ...]:
        """The arms that the package's generator says it is for."""
        return arms_of(self.inner)

    def sharpness(self, ball: BallState) -> float:
        """Ask the package; a number of at least 0."""
        with answered_by(self.name):
            return checks.number("sharpness", self.inner.sharpness(_lent(ball)), least=0.0)

    def verdict(self, ball: BallState, q: Array) -> Verdict:
        """Ask the package; a verdict that rests on finite motion, if on any."""
        with answered_by(self.name):
            verdict = checks.instance("verdict", self.inner.verdict(_lent(ball), q.copy()), Verdict)
            checks.instance("verdict.outcome", verdict.outcome, Outcome)
            checks.text("verdict.binding_limit", verdict.binding_limit)
            for name in ("share", "t_catch", "sigma", "probability"):
                checks.number(f"verdict.{name}", getattr(verdict, name))
            if (approach := verdict.approach) is not None:
                checks.instance("verdict.approach", approach, Approach)
                motion = checks.array(
                    "verdict.approach.motion", approach.motion, (None, 3, self.n), finite=True
                )
                if not len(motion):
                    raise InputError("verdict.approach.motion", "one row or more", "none")
                checks.number("verdict.approach.step", approach.step, least=_BRIEFEST, finite=True)
                checks.vector("verdict.approach.dr_o", approach.dr_o, 3, finite=True)
            return verdict

    def unsettled(self, ball: BallState, q: Array) -> bool:
        """Ask the package; a truth value."""
        with answered_by(self.name):
            return checks.flag("unsettled", self.inner.unsettled(_lent(ball), q.copy()))

    def returns(self, ball: BallState) -> bool:
        """Ask the package; a truth value."""
        with answered_by(self.name):
            return checks.flag("returns", self.inner.returns(_lent(ball)))

    def waiting(self, ball: BallState) -> BallState:
        """Ask the package; a ball."""
        with answered_by(self.name):
            return checks.instance("waiting", self.inner.waiting(_lent(ball)), BallState)

    def adapt(self, ball: BallState, q: Array, dq: Array) -> "Added":
        """Ask the package; a generator, with a map of the same size if this one has a map."""
        with answered_by(self.name):
            given = self.inner.adapt(_lent(ball), q.copy(), dq.copy())
        other = added(self.name, given, self.n)
        sizes = [None if f is None else f.alpha.shape for f in (self.as_map(), other.as_map())]
        if sizes[0] != sizes[1]:
            wanted = f"adapt to give a map with alpha of shape {sizes[0]}"
            raise InputError(self.name, wanted, sizes[1], do="repair that package")
        return other

    def reference(self, ball: BallState) -> JointReference:
        """Ask the package; finite motion of n joints."""
        with answered_by(self.name):
            said = checks.instance("reference", self.inner.reference(_lent(ball)), JointReference)
            for row in ("q_d", "dq_d", "ddq_d", "q_o", "dq_o"):
                checks.vector(f"reference.{row}", getattr(said, row), self.n, finite=True)
            checks.instance("reference.status", said.status, MapStatus)
            checks.number("reference.time_to_catch", said.time_to_catch, least=-inf)
            return said

    def as_map(self) -> DirectMap | None:
        """Ask the package; a map, or None."""
        with answered_by(self.name):
            f = self.inner.as_map()
            return None if f is None else checks.instance("as_map", f, DirectMap)


def _lent(ball: BallState) -> BallState:
    """Return a copy of a ball, its arrays too."""
    r_o, dr_o, ddr_o = ball.r_o.copy(), ball.dr_o.copy(), ball.ddr_o.copy()
    return replace(ball, r_o=r_o, dr_o=dr_o, ddr_o=ddr_o, covariance=ball.covariance.copy())


def added(name: str, generator: Generator, n: int) -> Added:
    """Return a generator of another package for an arm of n joints, held to its answers."""
    if not isinstance(generator, Generator) or isinstance(generator, type):
        raise InputError(name, "a generator", checks.shown(generator), do="repair that package")
    return Added(name, generator, n)


def answering(generator: Generator, n: int) -> Generator:
    """Return a generator that somebody made, held to its answers where it is none of ours."""
    ours = type(generator).__module__.startswith("mitt.")
    return generator if ours else added(called(generator), generator, n)
