"""What the rivals share: a generator that predicts the catch and pursues it.

Rivals differ in their :class:`Pursuit` alone. All choose the catch by
:mod:`mitt.lab.rivals.intercept`, aim at the newest prediction every tick, choose again where the
ball left its path (a kick, a bounce), and stay on the ball after the catch.

A pursuit remembers the motion of the tick before. The memory is kept by time: asked twice about
one instant, a rival answers from the same memory, so ``reference`` is a pure function of the balls
that it was given before this instant.
"""

from dataclasses import dataclass, field, replace
from math import dist
from typing import Protocol, Self, final

import numpy as np

from mitt.core import checks
from mitt.core.arm.arm import Arm
from mitt.core.ball.flight import forecast
from mitt.core.catcher.generators import Generator
from mitt.core.map.mapping import DirectMap
from mitt.core.map.prediction import HORIZON, STRIDE, flown, state_of
from mitt.core.signals import GRAVITY, Array, BallState, JointReference, MapStatus
from mitt.core.verdict.feasibility import Outcome, Verdict, tempered
from mitt.lab.rivals.intercept import Chooser, Intercept

#: A predicted catch point that has moved so far since it was chosen is chosen anew [m], if the
#: catch is at least so far away [s].
_MOVED = 0.03
_CHOOSE_UNTIL = 0.021
#: Utilization of a limit from which on a low catch is left for one after a bounce, and distance
#: from the nominal catch point within which a ball has come back [m].
_HARD = 0.95
_NEAR = 0.5
#: Share of the speed limits that rivals plan with.
SPEED = 0.98


class Pursuit(Protocol):
    """One rival's path to a predicted catch; a value, each step gives the next."""

    def begin(self, catch: Intercept, t: float, motion: Array) -> Self:
        """Return the pursuit of a catch from q, dq, ddq at time ``t`` [s], shape (3, n)."""
        ...

    def step(self, catch: Intercept, ball: BallState) -> tuple[Array, Self]:
        """Return q, dq, ddq at the ball's time, shape (3, n), and the pursuit from there on."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Chase:
    """What a rival remembers of one throw between two ticks.

    Attributes:
        t: Time of the command [s].
        pursuit: The path there.
        catch: The catch.
        chosen_at: Where it was when it was chosen [m], shape (3,).
        motion: q, dq, ddq as commanded, shape (3, n).
    """

    t: float
    pursuit: Pursuit
    catch: Intercept
    chosen_at: Array
    motion: Array


class ChaseMemory:
    """The chase before and after the newest instant."""

    def __init__(self, chase: Chase | None) -> None:
        """Start with one."""
        self.before, self.after = chase, chase

    def at(self, t: float) -> Chase | None:
        """Return the chase to continue for time ``t`` [s]."""
        if self.after is not None and t > self.after.t:
            self.before = self.after
        return self.before

    def follow(self, before: Chase, now: Chase, *, lost: bool = False) -> JointReference:
        """Go on to what is commanded now; rest where it was if that is not finite.

        No catch is ahead where the ball is ``lost``.
        """
        catch, motion = now.catch, now.motion
        if not np.isfinite(motion).all():
            return resting(now.t, before.motion[0])
        self.after = now
        return JointReference(
            t=now.t,
            status=MapStatus.INSIDE,
            q_d=motion[0],
            dq_d=motion[1],
            ddq_d=motion[2],
            q_o=catch.end[0],
            dq_o=catch.end[1],
            time_to_catch=np.inf if lost else catch.t_c - now.t,
        )


@final
@dataclass(frozen=True, eq=False)
class Rival(Generator):
    """A generator that predicts the catch and pursues it; see the module's text.

    Attributes:
        chooser: Chooses the catch.
        pursuit: The path there.
        q_hold: Where the arm rests without a catch [rad], shape (n,).
        foreign: Whether the path is another package's, whose motion is checked; ours may give up.
        memory: What was commanded before.
    """

    chooser: Chooser
    pursuit: Pursuit
    q_hold: Array
    foreign: bool = False
    memory: ChaseMemory = field(default_factory=lambda: ChaseMemory(None))

    @property
    def arms(self) -> tuple[Arm, ...]:
        """The arm that it moves."""
        return (self.chooser.arm,)

    def sharpness(self, ball: BallState) -> float:
        """Return the 1-sigma of the ball where it passes nearest to the nominal catch [m]."""
        ball = checks.instance("ball", ball, BallState)
        if not _sane(ball):
            return np.inf
        ahead = forecast(ball, ball.t + _passing(self.chooser.map, ball)).covariance[:3, :3]
        return float(np.sqrt(max(np.linalg.eigvalsh(ahead)[-1], 0.0)))

    @property
    def certificate(self) -> Verdict | None:
        """Nothing is refined."""
        return None

    def verdict(self, ball: BallState, q: Array, dq: Array | None = None) -> Verdict:
        """Judge the best catch from ``q``, at rest or at ``dq``, as a map's is judged."""
        ball = checks.instance("ball", ball, BallState)
        motion = self._moving(q, dq)
        catch = self._choose(ball, motion)
        judged = self.chooser.verdict(catch, ball, motion, sigma=self.sharpness(ball))
        if ball.led:
            return tempered(judged, ball)
        if not _easy(catch) and self._may_rise(ball, motion):
            return replace(judged, outcome=Outcome.OPEN, approach=None)
        return judged

    def unsettled(self, ball: BallState, q: Array) -> bool:
        """Look whether the ball is led and the best catch far ahead or beyond the limits."""
        ball = checks.instance("ball", ball, BallState)
        q = checks.vector("q", q, self.chooser.arm.n)
        if not ball.led:
            return False
        motion = self._moving(q, None)
        judged = self.chooser.verdict(self._choose(ball, motion), ball, motion, sigma=np.inf)
        return tempered(judged, ball).outcome is Outcome.UNSETTLED

    def returns(self, ball: BallState) -> bool:
        """Say whether the ball has come back: an arm that moves as this one does can catch it."""
        ball = checks.instance("ball", ball, BallState)
        f, after = self.chooser.map, _passing(self.chooser.map, ball)
        gap = flown(ball, np.array([after]))[0, 0] - f.arm.position(f.start)
        if not np.linalg.norm(gap) < _NEAR:
            return False
        chase = self.memory.after
        return _easy(self._choose(ball, at_rest(self.q_hold) if chase is None else chase.motion))

    def waiting(self, ball: BallState) -> BallState:
        """Wait for a ball that rises to the nominal catch height as it comes within reach."""
        ball = checks.instance("ball", ball, BallState)
        return lobbed(self.chooser.map, ball)

    def adapt(self, ball: BallState, q: Array, dq: Array) -> "Rival":
        """Choose a catch and pursue it from where the arm is."""
        ball = checks.instance("ball", ball, BallState)
        motion = self._moving(q, checks.vector("dq", dq, self.chooser.arm.n))
        catch, chase = self._choose(ball, motion), None
        if catch is not None:
            pursuit = self.pursuit.begin(catch, ball.t, motion)
            chase = Chase(ball.t, pursuit, catch, catch.r_c, motion)
        return replace(self, q_hold=motion[0].copy(), memory=ChaseMemory(chase))

    def astray(self, ball: BallState) -> bool:
        """Know of nothing else: what is pursued is chosen anew by itself."""
        checks.instance("ball", ball, BallState)
        return False

    def wait(self, ball: BallState, q: Array, dq: Array) -> "Rival":
        """Pursue the ball that is waited for."""
        return self.adapt(self.waiting(ball), q, dq)

    def reference(self, ball: BallState) -> JointReference:
        """Go on with the pursuit; at rest where there is nothing to pursue."""
        ball = checks.instance("ball", ball, BallState)
        chase, t = self.memory.at(ball.t), ball.t
        if chase is None or not _sane(ball):
            return resting(t, self.q_hold if chase is None else chase.motion[0])
        catch, pursuit, chosen_at = self._aimed(chase, ball)
        if t <= catch.t_c:
            motion, pursuit = pursuit.step(catch, ball)
            if self.foreign:
                shape = (3, self.chooser.arm.n)
                motion = checks.array("motion to the catch", motion, shape, finite=True)
        else:
            motion = self._following(chase, catch, ball)
        # It can not be met at the old catch, nor anywhere else.
        lost = catch is chase.catch and catch.t_c - t >= _CHOOSE_UNTIL
        return self.memory.follow(chase, Chase(t, pursuit, catch, chosen_at, motion), lost=lost)

    def _moving(self, q: Array, dq: Array | None) -> Array:
        """Return q, dq, ddq of an arm, shape (3, n); at rest where there is no ``dq``."""
        n = self.chooser.arm.n
        q = checks.vector("q", q, n, finite=True)
        dq = np.zeros(n) if dq is None else checks.vector("dq", dq, n, finite=True)
        return np.array([q, dq, np.zeros(n)])

    def _choose(self, ball: BallState, motion: Array) -> Intercept | None:
        """Return the best catch; None too where the ball cannot be."""
        return self.chooser.choose(ball, motion) if _sane(ball) else None

    def _aimed(self, chase: Chase, ball: BallState) -> tuple[Intercept, Pursuit, Array]:
        """Return the catch at the newest prediction, chosen anew if that has moved.

        With it the pursuit of it, and where the catch was when it was chosen [m], shape (3,).
        """
        old, pursuit, chosen_at = chase.catch, chase.pursuit, chase.chosen_at
        if ball.t > old.t_c:
            return old, pursuit, chosen_at
        aimed = self.chooser.aim(old, ball)
        near = aimed is not old and dist(aimed.r_c, chosen_at) <= _MOVED
        late = aimed.t_c - ball.t < _CHOOSE_UNTIL
        chosen = None if near or late else self._choose(ball, chase.motion)
        if chosen is None:
            return aimed, pursuit, chosen_at
        return chosen, pursuit.begin(chosen, chase.t, chase.motion), chosen.r_c

    def _following(self, chase: Chase, catch: Intercept, ball: BallState) -> Array:
        """Return the motion with the ball, after the catch."""
        rows, at = chase.motion.copy(), np.array([ball.r_o, ball.dr_o, ball.ddr_o])
        near = np.linalg.norm(ball.r_o - self.chooser.arm.position(rows[0])) < _MOVED
        if near and self.chooser.beside(at, catch.closing, ball.t - catch.t_c, rows):
            return rows
        return coasting(chase.motion, ball.t - chase.t)

    def _may_rise(self, ball: BallState, motion: Array) -> bool:
        """Say whether a bounce could make the ball catchable: it comes in low."""
        if not _sane(ball):
            return False
        f = self.chooser.map
        low = flown(ball, np.array([_passing(f, ball)]))[0, 0, 2] < f.arm.position(f.start)[2]
        return bool(low) and self._choose(lobbed(f, ball), motion) is not None


def rival(f: DirectMap, pursuit: Pursuit) -> Rival:
    """Return the rival with a pursuit for the arm of a map."""
    made = (type(pursuit), getattr(pursuit, "planner", None))
    foreign = any(not _module_of(x).startswith("mitt.") for x in made if x is not None)
    return Rival(Chooser(f), pursuit, f.arm.q_ready, foreign)


def _module_of(x: object) -> str:
    """Return the module of a class, a function, or an object's class."""
    return str(getattr(x, "__module__", None) or type(x).__module__)


def _easy(catch: Intercept | None) -> bool:
    """Say whether a catch is not low and within the limits."""
    return catch is not None and not catch.low and catch.utilization <= _HARD


def lobbed(f: DirectMap, ball: BallState) -> BallState:
    """Return a ball with the same path over the ground that tops out at the nominal catch height.

    It does so as it comes within reach: where a ball is that bounced off a level surface.
    """
    nominal = f.arm.position(f.start)
    over = float(np.hypot(*ball.r_o[:2]) - np.hypot(*nominal[:2]))
    after = max(over, 0.0) / max(float(np.hypot(*ball.dr_o[:2])), 0.1)
    r_o, dr_o = ball.r_o.copy(), ball.dr_o.copy()
    r_o[2], dr_o[2] = nominal[2] - 0.5 * GRAVITY * after**2, GRAVITY * after
    return replace(ball, r_o=r_o, dr_o=dr_o)


def at_rest(q: Array) -> Array:
    """Return rest in ``q`` as q, dq, ddq, shape (3, n)."""
    return np.array([q, np.zeros(len(q)), np.zeros(len(q))])


def _passing(f: DirectMap, ball: BallState) -> float:
    """Return when the ball passes nearest to the nominal catch point [s]."""
    if not _sane(ball):
        return 0.0
    after = np.arange(0.0, HORIZON, 2.0 * STRIDE)
    gap = flown(ball, after)[:, 0] - f.arm.position(f.start)
    return float(after[np.argmin(np.sum(gap * gap, axis=1))])


def _sane(ball: BallState) -> bool:
    """Say whether an estimate is finite and not absurd."""
    return bool(np.all(np.abs(state_of(ball)) < 1e3))


def coasting(motion: Array, after: float) -> Array:
    """Return q, dq, ddq so much later [s] of joints that keep their speeds, shape (3, n)."""
    return np.array([motion[0] + after * motion[1], motion[1], 0.0 * motion[2]])


def resting(t: float, q: Array) -> JointReference:
    """Return rest in ``q``, with nothing to catch."""
    zero = np.zeros(len(q))
    return JointReference(
        t=t,
        status=MapStatus.DOMAIN,
        q_d=q,
        dq_d=zero,
        ddq_d=zero,
        q_o=q,
        dq_o=zero,
        time_to_catch=np.inf,
    )
