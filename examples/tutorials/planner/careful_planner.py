"""A whole generator: the learned map, but a ball that asks for much of a limit is refused."""

from dataclasses import dataclass, replace

from mitt.core.catcher.generators import Direct, Generator
from mitt.core.map.mapping import DirectMap
from mitt.core.signals import Array, BallState, JointReference
from mitt.core.verdict.feasibility import Outcome, Verdict

SHARE = 0.6  # of the limit that is asked most


@dataclass(frozen=True)
class Careful:
    """Each method says what it is asked for, and here asks the generator `inner`."""

    inner: Generator

    def sharpness(self, ball: BallState) -> float:
        """How well is the ball known at the catch [m]? The arm waits until it is known well."""
        return self.inner.sharpness(ball)

    def verdict(self, ball: BallState, q: Array) -> Verdict:
        """Can it be caught from rest in q? Asked once the ball is known, before the arm moves."""
        said = self.inner.verdict(ball, q)
        much = said.outcome is Outcome.FEASIBLE and said.share > SHARE
        return replace(said, outcome=Outcome.UNREACHABLE) if much else said

    def unsettled(self, ball: BallState, q: Array) -> bool:
        """Is the verdict UNSETTLED for sure? False is always right, and slower."""
        return self.inner.unsettled(ball, q)

    def returns(self, ball: BallState) -> bool:
        """After the verdict OPEN: does the ball now come where it can be caught?"""
        return self.inner.returns(ball)

    def waiting(self, ball: BallState) -> BallState:
        """After the verdict OPEN: which ball is to be followed until it does?"""
        return self.inner.waiting(ball)

    def adapt(self, ball: BallState, q: Array, dq: Array) -> "Careful":
        """Return the generator of this throw; its motion begins in q, dq at the time ball.t."""
        return replace(self, inner=self.inner.adapt(ball, q, dq))

    def reference(self, ball: BallState) -> JointReference:
        """Return the desired motion for the newest estimate of the ball, each millisecond."""
        return self.inner.reference(ball)

    def as_map(self) -> DirectMap | None:
        """Return None: `reference` is called. A map would be evaluated by compiled code instead."""
        return None


def make_careful(f: DirectMap) -> Generator:
    """Return the generator for the arm of a map."""
    return Careful(Direct(f))
