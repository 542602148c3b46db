"""Rivals that strike a ball as the batting map does: same contact, each with a path of its own.

Place, velocity and direction of the paddle at the contact, and when that is, are those that
:class:`mitt.core.catcher.batting.Batting` chooses; what it refuses, they refuse. All but the
oracle aim anew at each tick at what the ball's newest estimate asks for at that time; the joints'
accelerations at the contact are zero. After it they keep their speeds until the catcher brakes.

``quintic``, ``ruckig`` and ``mpc`` plan as in :mod:`mitt.lab.rivals.planned`. ``ik`` holds the pose
of the strike, turned back by its speeds, and sets off shortly before the contact
(:func:`mitt.lab.rivals.servo.run_up`).

``clairvoyant`` is an oracle, no rival: it is given the true flight and the true restitution, and
plans once, a quintic.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import inf
from typing import Final, final

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.catcher.batting import Batting, foreseen
from mitt.core.catcher.generators import Generator
from mitt.core.errors import UnknownNameError
from mitt.core.fields import brief
from mitt.core.map.striking import PaddleStrike
from mitt.core.signals import Array, BallState, JointReference
from mitt.core.verdict.feasibility import Verdict
from mitt.lab.rivals.clairvoyant import Flight
from mitt.lab.rivals.intercept import Intercept
from mitt.lab.rivals.mpc import mpc_path
from mitt.lab.rivals.planned import Planned, RuckigPlanner, plan_quintic
from mitt.lab.rivals.pursuit import Chase, ChaseMemory, Pursuit, coasting, resting
from mitt.lab.rivals.servo import Servo, pursuit_bounds, run_up


@final
@dataclass(frozen=True, slots=True, eq=False)
class BatRival(Generator):
    """A rival that strikes; see the module's text.

    Attributes:
        batting: What chooses the contact.
        pursuit: The path there.
        q_hold: Where the arm rests before [rad], shape (n,).
        flight: The true flight, for the oracle; None for a rival.
        memory: What was commanded before.
    """

    batting: Batting
    pursuit: Pursuit
    q_hold: Array
    flight: Flight | None = None
    memory: ChaseMemory = field(default_factory=lambda: ChaseMemory(None), repr=False)

    __repr__ = brief

    @property
    def arms(self) -> tuple[Arm, ...]:
        """The arm that it moves."""
        return self.batting.arms

    def sharpness(self, ball: BallState) -> float:
        """Return what the batting map says."""
        return self.batting.sharpness(self._known(ball))

    def verdict(self, ball: BallState, q: Array) -> Verdict:
        """Return what the batting map says."""
        return self.batting.verdict(self._known(ball), q)

    def afresh(self) -> "BatRival":
        """Return the rival before any target."""
        return replace(self, batting=self.batting.afresh(), memory=ChaseMemory(None))

    def pause(self) -> float:
        """Return what the batting map says."""
        return self.batting.pause()

    def adapt(self, ball: BallState, q: Array, dq: Array) -> "BatRival":
        """Take the contact of the batting map, and set out for it from where the arm is."""
        g, motion = self.batting.adapt(self._known(ball), q, dq), np.array([q, dq, 0.0 * q])
        if g.strike is None:
            return replace(self, q_hold=q.copy())
        catch = self._aimed(_contact(g.strike, g.t_contact), ball)
        pursuit = self.pursuit.begin(catch, ball.t, motion)
        chase = Chase(ball.t, pursuit, catch, catch.r_c, motion)
        return replace(self, batting=g, q_hold=q.copy(), memory=ChaseMemory(chase))

    def reference(self, ball: BallState) -> JointReference:
        """Go on with the pursuit of the contact, aimed anew; at rest without one."""
        chase, t = self.memory.at(ball.t), ball.t
        if chase is None:
            return resting(t, self.q_hold)
        catch, pursuit = self._aimed(chase.catch, ball), chase.pursuit
        if t <= catch.t_c:
            motion, pursuit = pursuit.step(catch, ball)
        else:
            motion = coasting(chase.motion, t - chase.t)
        return self.memory.follow(chase, Chase(t, pursuit, catch, catch.r_c, motion))

    def _known(self, ball: BallState) -> BallState:
        """Return what is known of the ball: the estimate; of an oracle the truth."""
        if self.flight is None:
            return ball
        r_o, dr_o = self.flight(ball.t)
        return replace(ball, r_o=r_o, dr_o=dr_o, covariance=0.0 * ball.covariance)

    def _aimed(self, catch: Intercept, ball: BallState) -> Intercept:
        """Return the contact as the ball asks for it now; as it was where it asks for none."""
        left, fly, near = catch.t_c - ball.t, self.flight, self.batting.strike
        if left <= 0.0 or near is None:
            return catch
        met = foreseen(ball, left) if fly is None else np.array(fly(catch.t_c))
        strike = self.batting.asked(met, ball, near)
        return catch if strike is None else _contact(strike, catch.t_c)


def _contact(strike: PaddleStrike, t_c: float) -> Intercept:
    """Return a strike at a time as what a pursuit leads to."""
    end = np.array([strike.q, strike.dq, 0.0 * strike.q])
    return Intercept(
        t_c=t_c, end=end, r_c=strike.ball[0], binding_limit="", utilization=0.0, low=False
    )


def _swing(catch: Intercept, ball: BallState, goal: Array) -> None:
    """Write the joints of the strike, turned back by its speeds, that set off before it."""
    early, ds, dds = run_up(catch.t_c - ball.t)
    q, dq = catch.end[:2]
    goal[0], goal[1], goal[2] = q - early * dq, ds * dq, dds * dq


PATHS: Final[dict[str, Callable[[Arm], Pursuit]]] = {
    "quintic": lambda _: Planned(planner=plan_quintic),
    "ruckig": lambda arm: Planned(planner=RuckigPlanner(arm)),
    "mpc": mpc_path,
    "ik": lambda arm: Servo(most=pursuit_bounds(arm), lead=_swing, slowest=15.0, join=0.95),
    "clairvoyant": lambda _: Planned(planner=plan_quintic, dead_q=inf, dead_dq=inf),
}
"""How each gets to the contact, by name."""

ORACLE: Final = "clairvoyant"
"""The one that is given what no catcher can know."""

BATTERS: Final = ("direct", *PATHS)
"""All that strike a ball, by name."""


def make_batter(name: str, batting: Batting, *, flight: Flight | None = None) -> Generator:
    """Return what strikes a ball, by name.

    Args:
        name: One of ``BATTERS``.
        batting: The map; of the oracle, one that believes in the true restitution.
        flight: The true flight, for the oracle; None for the others.

    Raises:
        UnknownNameError: There is none of that name.
    """
    if name not in BATTERS:
        raise UnknownNameError("--generator", name, BATTERS)
    if name == "direct":
        return batting
    arm = batting.map.arm
    return BatRival(batting, PATHS[name](arm), arm.q_ready, flight if name == ORACLE else None)
