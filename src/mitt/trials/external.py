"""A generator that another package adds: what goes wrong in it is said to be that package's."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import final

from mitt.errors import InputError, MittError
from mitt.generator.certificate import Verdict
from mitt.generator.generators import Generator
from mitt.generator.mapping import DirectMap
from mitt.signals import Array, BallState, JointReference


@contextmanager
def answered_by(name: str) -> Iterator[None]:
    """Call an exception in the block one of the package that adds a generator.

    Raises:
        InputError: There was one.
    """
    try:
        yield
    except MittError:
        raise
    except Exception as error:
        given = f"{type(error).__name__}: {error}"[:200]
        raise InputError(f"generator {name!r}", "an answer of the package that adds it", given,
                         do="repair that package") from error  # fmt: skip


@final
@dataclass(frozen=True, slots=True)
class Added:
    """A generator of another package, behind the same call.

    Attributes:
        name: Name of its entry point.
        inner: The generator.
    """

    name: str
    inner: Generator

    def sharpness(self, ball: BallState) -> float:
        """Ask the other package."""
        with answered_by(self.name):
            return self.inner.sharpness(ball)

    def verdict(self, ball: BallState, q: Array) -> Verdict:
        """Ask the other package."""
        with answered_by(self.name):
            return self.inner.verdict(ball, q)

    def unsettled(self, ball: BallState, q: Array) -> bool:
        """Ask the other package."""
        with answered_by(self.name):
            return self.inner.unsettled(ball, q)

    def returns(self, ball: BallState) -> bool:
        """Ask the other package."""
        with answered_by(self.name):
            return self.inner.returns(ball)

    def waiting(self, ball: BallState) -> BallState:
        """Ask the other package."""
        with answered_by(self.name):
            return self.inner.waiting(ball)

    def adapt(self, ball: BallState, q: Array, dq: Array) -> "Added":
        """Ask the other package."""
        with answered_by(self.name):
            return Added(self.name, self.inner.adapt(ball, q, dq))

    def reference(self, ball: BallState) -> JointReference:
        """Ask the other package."""
        with answered_by(self.name):
            return self.inner.reference(ball)

    def as_map(self) -> DirectMap | None:
        """Ask the other package."""
        with answered_by(self.name):
            return self.inner.as_map()
