"""Generators of desired joint motion behind one call; rivals implement the same methods."""

from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import (
    Generic,
    Protocol,
    Self,
    TypeGuard,
    TypeVar,
    final,
    runtime_checkable,
)

import numpy as np

from mitt.core import checks
from mitt.core.arm.arm import Arm
from mitt.core.catcher.refine import certify, refine
from mitt.core.errors import InputError
from mitt.core.fields import brief
from mitt.core.map.demand import Tolerance
from mitt.core.map.foresight import sharpness
from mitt.core.map.mapping import DirectMap
from mitt.core.map.prediction import state_of
from mitt.core.signals import Array, BallState, JointReference, MapStatus
from mitt.core.verdict.feasibility import (
    Outcome,
    Verdict,
    has_come_back,
    judge,
    levelled,
    unsettled,
)
from mitt.core.verdict.pieces import Pieces

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


#: A kind of generator.
_K = TypeVar("_K", bound=Generator)


def fits(generator: Generator, kind: type[_K]) -> TypeGuard[_K]:
    """Say whether a generator is of a kind, one of the protocols here.

    Looked at once for each class: ``isinstance`` takes 20 us each time, and a loop asks often.
    """
    return _fits(type(generator), kind)


@lru_cache(maxsize=256)
def _fits(given: type, kind: type) -> bool:
    """Say whether a class has all that a protocol asks for."""
    return all(hasattr(given, name) for name in dir(kind) if not name.startswith("_"))


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
class Piecewise(Underway, Protocol):
    """A generator whose verdict is worked out in pieces, and that may choose for it what follows.

    What the verdict rests on is not chosen again when the arm starts.
    """

    def consider(
        self, ball: BallState, q: Array, dq: Array | None, pieces: Pieces
    ) -> tuple[Verdict, Self]:
        """Return the verdict, and the generator that it rests on, which is to be adapted.

        Args:
            ball: Estimate of the ball.
            q: Joint angles [rad], shape (n,).
            dq: Joint speeds [rad/s], shape (n,); None at rest.
            pieces: What is known of this verdict, and how much may be worked out.

        Raises:
            Unfinished: It is to be gone on with.
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


class GeneratorParts(Protocol):
    """Plain data that makes a generator again, for an arm."""

    def made(self, arm: Arm) -> Generator:
        """Return the generator, before any target."""
        ...


@runtime_checkable
class Recordable(Remembering, Protocol):
    """A generator that recordings hold in parts: its maps and its name do not make it again."""

    @property
    def parts(self) -> GeneratorParts:
        """What makes it again, a dataclass."""
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
            raise InputError(
                "a map refined in flight", "match_weight 0", weight, do="leave --adapt refine out"
            )

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
        return self.consider(ball, q, dq, Pieces())[0]

    def consider(
        self, ball: BallState, q: Array, dq: Array | None, pieces: Pieces, name: str = ""
    ) -> tuple[Verdict, "Direct"]:
        """Return that verdict, worked out in pieces called by a ``name``; nothing is chosen."""
        f, tolerance = self.learned or self.map, self.tolerance
        judged = judge(f, ball, q, tolerance=tolerance, dq=dq, pieces=pieces, name=name)
        if not self.refines or ball.led or not np.isfinite(judged.share):
            return judged, self
        dq = np.zeros(len(q)) if dq is None else dq
        refined = pieces.of(f"{name}refined", self.adapt, ball, q, dq).certificate
        return (judged if refined is None else refined), self

    def unsettled(self, ball: BallState, q: Array) -> bool:
        """Look whether the ball is led and its catch far ahead or outside the region."""
        checks.vector("q", q, self.map.arm.n, finite=True)
        return unsettled(self.map, ball)

    def returns(self, ball: BallState) -> bool:
        """Look whether the predicted catch lies in the region of the map."""
        return has_come_back(self.map, ball)

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


def fresh_for_throw(generator: Generator) -> Generator:
    """Return a generator as a throw begins with it: it knows nothing of a ball before."""
    return generator.afresh() if fits(generator, Remembering) else generator
