"""Generators of somebody else: the same calls, held to what a catcher goes on with."""

from dataclasses import dataclass, replace
from math import inf
from typing import final

from mitt import checks
from mitt.errors import InputError, answered_by
from mitt.generator.feasibility import Approach, Outcome, Verdict
from mitt.generator.generators import Generator, arms_of, called
from mitt.generator.mapping import DirectMap
from mitt.robot.arm import Arm
from mitt.signals import Array, BallState, JointReference, MapStatus

#: Least time between two instants of a motion [s].
_BRIEFEST = 1e-6


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
