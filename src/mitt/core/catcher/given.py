"""What is given for a generator: taken for an arm, and held to its answers.

A generator of another package is held to what a catcher goes on with (:class:`Added`).
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from math import inf
from typing import TypeAlias, final

import numpy as np

from mitt.core import checks
from mitt.core.arm.arm import Arm, difference, identity_of
from mitt.core.arm.limits import HELD_BACK, IN_WORDS
from mitt.core.catcher.family import direct
from mitt.core.catcher.generators import Direct, Generator, Movable, Remembering
from mitt.core.errors import InputError, answered_by
from mitt.core.map.learn import Learned
from mitt.core.map.mapping import DirectMap
from mitt.core.signals import Array, BallState, JointReference, MapStatus
from mitt.core.verdict.feasibility import Approach, Outcome, Verdict

#: Least time between two instants of a motion [s].
_BRIEFEST = 1e-6
#: Least share of the torque that an arm commands which is the same but for a reserve.
_KEPT = 0.95
#: Parts of an arm's identity that are limits: what a map was learned for, not what it is made of.
_LIMITS = ("joint ranges", *IN_WORDS.values())
#: Those of which an arm may command a share alone.
_HELD_BACK = tuple(IN_WORDS[name] for name in HELD_BACK)

GeneratorLike: TypeAlias = Generator | DirectMap | Learned
"""What is taken for a generator: itself; what :func:`mitt.learn` returned, for the default one; or
one map, for the paper's."""


def generator_of(given: object, *, name: str = "generator") -> Generator:
    """Return the generator that is meant; see :data:`GeneratorLike`.

    Raises:
        InputError: It is none of them; it is called ``name``.
    """
    if isinstance(given, Learned):
        return direct(given.map)
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
        raise InputError(
            "generator",
            f"one for {arm}",
            f"one for another arm: {unlike}",
            do="learn a map for this arm",
        )


@lru_cache(maxsize=32)
def _difference(arm: Arm, other: Arm, *, limits: bool) -> str | None:
    """Return what tells two arms apart, in words; None where they are the same.

    An arm that keeps a little of its torque in reserve is the same.
    """
    if arm.names != other.names:
        return f"its joints are {', '.join(other.names)}"
    mine, theirs = identity_of(arm), identity_of(other)
    for name in _LIMITS:
        reserved = name in _HELD_BACK and _is_reserve(mine[name], theirs[name])
        if reserved or not limits:
            mine[name] = theirs[name]
    shapes, others = (
        [x.base_capsules, *(link.capsules for link in x.links)]
        for x in (arm.model.complete(), other.model.complete())
    )
    return "its shapes differ" if shapes != others else difference(mine, theirs)


def _is_reserve(mine: list[float | None], whole: list[float | None]) -> bool:
    """Say whether torques, of which None is infinite, are nearly the whole, and no more."""
    pairs = [
        (np.inf if x is None else x, np.inf if y is None else y)
        for x, y in zip(mine, whole, strict=False)
    ]
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

    def afresh(self) -> "Added":
        """Ask the package, where its generator keeps anything of a ball."""
        if not isinstance(self.inner, Remembering):
            return self
        with answered_by(self.name):
            return added(self.name, self.inner.afresh(), self.n)

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
