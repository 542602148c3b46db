"""The clairvoyant that is told of a disturbance when it happens, and not before.

It plans for the flight as it would have been, follows that plan until the ball is thrown off its
course, and from there on the optimum from the state in which the arm then is. A yardstick of what
can still be caught after a kick, no rival.
"""

from dataclasses import dataclass, field, replace
from typing import final

from mitt.generator.certificate import Verdict
from mitt.rivals.clairvoyant import Clairvoyant
from mitt.signals import Array, BallState, JointReference


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Surprised:
    """Two plans of one arm, before and after; see the module's text.

    Attributes:
        before: Knows the flight as it would have been.
        after: Knows the flight as it is.
        when: Time after release at which they part [s].
        turned: The second plan from the first one's state then; None without a first plan, or
            where its catch comes before.
    """

    before: Clairvoyant
    after: Clairvoyant
    when: float
    turned: Clairvoyant | None = field(default=None)

    def sharpness(self, ball: BallState) -> float:
        """Return 0: there is nothing to wait for."""
        return self.before.sharpness(ball)

    def verdict(self, ball: BallState, q: Array) -> Verdict:
        """Judge the flight as it would have been."""
        return self.before.verdict(ball, q)

    def unsettled(self, ball: BallState, q: Array) -> bool:  # noqa: ARG002
        """Wait for nothing: both flights are known."""
        return False

    def returns(self, ball: BallState) -> bool:  # noqa: ARG002
        """Wait for nothing: no verdict is open."""
        return True

    def waiting(self, ball: BallState) -> BallState:
        """Wait for nothing."""
        return ball

    def adapt(self, ball: BallState, q: Array, dq: Array) -> "Surprised":
        """Plan from where the arm is, by what is known at that time."""
        if ball.t >= self.when:
            return replace(self, turned=self.after.adapt(ball, q, dq))
        before = self.before.adapt(ball, q, dq)
        turned, plan = None, before.plan
        if plan is not None and plan.t_c > self.when:
            rows = plan.at(self.when)
            turned = self.after.adapt(replace(ball, t=self.when), rows[0], rows[1])
        return replace(self, before=before, turned=turned)

    def as_map(self) -> None:
        """Say that this is no map."""

    def reference(self, ball: BallState) -> JointReference:
        """Evaluate the plan of the time; the first one where the second found no way."""
        turned = self.turned
        if ball.t < self.when or turned is None or turned.plan is None:
            return self.before.reference(ball)
        return turned.reference(ball)
