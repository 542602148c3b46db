"""Generators of somebody else: the same calls, held to what a catcher goes on with."""

from dataclasses import dataclass
from math import inf
from typing import final

from mitt import checks
from mitt.errors import InputError, answered_by
from mitt.generator.feasibility import Outcome, Verdict
from mitt.generator.generators import Generator, arms_of
from mitt.generator.mapping import DirectMap
from mitt.robot.arm import Arm
from mitt.signals import Array, BallState, JointReference, MapStatus


@final
@dataclass(frozen=True, slots=True)
class Added:
    """A generator of another package: the same calls, its exceptions and answers named after it.

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
            return checks.number("sharpness", self.inner.sharpness(ball), least=0.0)

    def verdict(self, ball: BallState, q: Array) -> Verdict:
        """Ask the package; a verdict that rests on finite motion, if on any."""
        with answered_by(self.name):
            verdict = checks.instance("verdict", self.inner.verdict(ball, q), Verdict)
            checks.instance("verdict.outcome", verdict.outcome, Outcome)
            if (approach := verdict.approach) is not None:
                motion, shape = approach.motion, (None, 3, self.n)
                checks.array("verdict.approach.motion", motion, shape, finite=True)
                checks.vector("verdict.approach.dr_o", approach.dr_o, 3, finite=True)
            return verdict

    def unsettled(self, ball: BallState, q: Array) -> bool:
        """Ask the package; a truth value."""
        with answered_by(self.name):
            return checks.flag("unsettled", self.inner.unsettled(ball, q))

    def returns(self, ball: BallState) -> bool:
        """Ask the package; a truth value."""
        with answered_by(self.name):
            return checks.flag("returns", self.inner.returns(ball))

    def waiting(self, ball: BallState) -> BallState:
        """Ask the package; a ball."""
        with answered_by(self.name):
            return checks.instance("waiting", self.inner.waiting(ball), BallState)

    def adapt(self, ball: BallState, q: Array, dq: Array) -> "Added":
        """Ask the package; a generator, with a map of the same size if this one has a map."""
        with answered_by(self.name):
            other, before = added(self.name, self.inner.adapt(ball, q, dq), self.n), self.as_map()
            after = other.as_map()
            sizes = [None if f is None else f.alpha.shape for f in (before, after)]
            if sizes[0] != sizes[1]:
                raise InputError("adapt", f"a map with alpha of shape {sizes[0]}", sizes[1])
            return other

    def reference(self, ball: BallState) -> JointReference:
        """Ask the package; finite motion of n joints."""
        with answered_by(self.name):
            said = checks.instance("reference", self.inner.reference(ball), JointReference)
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


def added(name: str, generator: Generator, n: int) -> Added:
    """Return a generator of another package for an arm of n joints, held to its answers."""
    if not isinstance(generator, Generator) or isinstance(generator, type):
        raise InputError(name, "a generator", checks.shown(generator), do="repair that package")
    return Added(name, generator, n)


def answering(generator: Generator, n: int) -> Generator:
    """Return a generator that somebody made, held to its answers where it is none of ours."""
    kind = type(generator)
    ours = kind.__module__.startswith("mitt.")
    return generator if ours else added(f"generator {kind.__name__}", generator, n)
