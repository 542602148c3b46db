"""The verdict before moving: can this throw be caught, and which limit binds?

The ball's estimate is flown on by the flight model to the catch, the map is adapted to the arm,
and what the motion asks of the arm is held against its limits.
"""

from dataclasses import dataclass, field, replace
from enum import Enum

import numpy as np

from mitt.core import checks
from mitt.core.arm.arm import Arm
from mitt.core.fields import brief
from mitt.core.kernels import kernel
from mitt.core.map.demand import Tolerance, shares_of
from mitt.core.map.foresight import Foresight, foresee
from mitt.core.map.mapping import DirectMap, virtual
from mitt.core.map.prediction import HORIZON, STRIDE, flown, spread
from mitt.core.map.tangent import MapArrays, to_go, unpack
from mitt.core.signals import Array, BallState
from mitt.core.verdict.pieces import Pieces

#: Instants at which the demand is reckoned.
_INSTANTS = 25
#: How long before its catch the arm begins to follow a ball, or learns for good that it cannot
#: catch it [s]: about what learned flights last.
_START_AHEAD = 0.5


class Outcome(Enum):
    """Whether the throw can be caught.

    OPEN: the ball is about to pass below the region of the map, where only a bounce off a
    surface that nobody announced would bring it back up.
    UNSETTLED: the ball does not fly, so nobody can foretell it: the arm stays, and the ball is
    judged anew every tick, until it comes.
    """

    FEASIBLE = "feasible"
    OPEN = "open"
    UNSETTLED = "unsettled"
    UNREACHABLE = "unreachable"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Approach:
    """The motion that a verdict rests on, from now to the catch.

    Attributes:
        motion: q, dq, ddq asked at even instants, the last at the catch, shape (K, 3, n).
        step: Time between two of them [s].
        dr_o: Velocity of the ball at the catch [m/s], shape (3,).
    """

    motion: Array
    step: float
    dr_o: Array

    __repr__ = brief


#: What it means that the place of the catch is against it, not a limit.
_PLACES = {
    "domain": " (the ball does not come to where the map can meet it)",
    "region": " (the catch is not where the map was learned)",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """What the certificate says.

    Attributes:
        outcome: Feasible, open, unsettled or not.
        binding_limit: The limit that is asked most, such as ``torque:j2``.
        share: How much of it is asked; 1 is the limit.
        t_catch: Predicted time of the catch [s]; infinite without one.
        sigma: Predicted 1-sigma of the ball's position then [m].
        probability: Of a catch, given the ball's uncertainty; NaN where it was not reckoned.
        approach: The motion that it rests on; None where there is none.
    """

    outcome: Outcome
    binding_limit: str
    share: float
    t_catch: float
    sigma: float
    probability: float = np.nan
    approach: Approach | None = field(default=None, compare=False, repr=False)

    __repr__ = brief

    def __str__(self) -> str:
        """Say it in a few words, as ``feasible: 83 % of brake:j4, catch at 0.498 s``."""
        asked = f"{100.0 * self.share:.0f} % of " if np.isfinite(self.share) else ""
        when = f", catch at {self.t_catch:.3f} s" if np.isfinite(self.t_catch) else ""
        why = _PLACES.get(self.binding_limit.partition(":")[0], "")
        return f"{self.outcome.value}: {asked}{self.binding_limit}{why}{when}"

    @property
    def margin(self) -> float:
        """What is left of the binding limit, as a share of it; negative beyond it."""
        return 1.0 - self.share


def judge(
    f: DirectMap,
    ball: BallState,
    q: Array,
    *,
    tolerance: Tolerance,
    dq: Array | None = None,
    pieces: Pieces | None = None,
    name: str = "",
) -> Verdict:
    """Return the verdict on a ball for an arm in ``q`` [rad], (n,), at rest or moving at ``dq``.

    Args:
        f: The map.
        ball: Estimate of the ball.
        q: Joint angles [rad], shape (n,).
        tolerance: Share of each limit at which the throw is refused.
        dq: Joint speeds [rad/s], shape (n,); at rest if left out.
        pieces: What is known of this verdict, and how much may be worked out; all if left out.
        name: With which the names of its pieces begin.

    Raises:
        Unfinished: It is to be gone on with.
    """
    ball, q = checks.instance("ball", ball, BallState), checks.vector("q", q, f.arm.n, finite=True)
    dq = np.zeros(f.arm.n) if dq is None else checks.vector("dq", dq, f.arm.n, finite=True)
    pieces = Pieces() if pieces is None else pieces
    return tempered(_judged(f, ball, (q, dq), tolerance, pieces, name), ball)


def tempered(verdict: Verdict, ball: BallState) -> Verdict:
    """Return the verdict; on a ball that is led neither a refusal nor a start long before."""
    good = _comes_soon(ball, verdict.t_catch) and verdict.outcome is Outcome.FEASIBLE
    return replace(verdict, outcome=Outcome.UNSETTLED) if ball.led and not good else verdict


def unsettled(f: DirectMap, ball: BallState) -> bool:
    """Say at little cost where the verdict on a ball is UNSETTLED whatever the arm does.

    The ball is led, and its catch is far ahead or lies outside the map's region.
    """
    if not checks.instance("ball", ball, BallState).led:
        return False
    seen = foresee(f, ball)
    return not _comes_soon(ball, ball.t + seen.after) or _where(f, seen) is not None


def _comes_soon(ball: BallState, t_catch: float) -> bool:
    """Say whether the catch is so near that a start is not long before it."""
    return t_catch - ball.t <= _START_AHEAD


def _judged(
    f: DirectMap,
    ball: BallState,
    start: tuple[Array, Array],
    tolerance: Tolerance,
    pieces: Pieces,
    name: str,
) -> Verdict:
    """Return the verdict on a ball that goes on by its law of motion; see :func:`judge`.

    A way is worked out once, whatever tolerances it is held against, which takes little.
    """
    seen, where, alpha = pieces.of(f"{name}start", _started, f, ball, start)
    if alpha is None:
        waits = pieces.of(f"{name}rise", _may_rise, f, ball, seen)
        way = pieces.of(f"{name}level", _level_way, f, ball, start) if waits else None
        waits = way is not None and pieces.of(f"{name}wait {tolerance}", _keeps, f, *way, tolerance)
        return Verdict(
            outcome=Outcome.OPEN if waits else Outcome.UNREACHABLE,
            binding_limit=where or "domain",
            share=np.inf,
            t_catch=ball.t + seen.after,
            sigma=np.inf,
        )
    approach = pieces.of(f"{name}way", _way, f, alpha, ball, seen.after)
    return pieces.whole(
        f"{name}asked {tolerance}", _asked, f, approach, ball, seen.after, tolerance
    )


def _started(
    f: DirectMap, ball: BallState, start: tuple[Array, Array]
) -> tuple[Foresight, str | None, Array | None]:
    """Return the predicted catch, why it is none, and else alpha with which the arm goes there."""
    seen = foresee(f, ball)
    where = _where(f, seen)
    return seen, where, f.adapted(ball, *start) if where is None else None


def _way(f: DirectMap, alpha: Array, ball: BallState, after: float) -> Approach:
    """Return the way to a foreseen catch of a map with other coefficients."""
    path = flown(ball, np.linspace(0.0, after, _INSTANTS))
    step = after / (_INSTANTS - 1)
    return Approach(motion=f.motions(path, alpha), step=step, dr_o=path[-1, 1])


def _asked(
    f: DirectMap, way: Approach, ball: BallState, after: float, tolerance: Tolerance
) -> Verdict:
    """Return the verdict by what a way to a foreseen catch asks of the arm of a map."""
    sigma = spread(ball, after)
    return asked(f.arm, way, tolerance, t_catch=ball.t + after, sigma=sigma)


def weigh_way(f: DirectMap, ball: BallState, after: float, tolerance: Tolerance) -> Verdict:
    """Return the verdict by what the way to a foreseen catch asks of the arm of an adapted map.

    Args:
        f: The map, adapted.
        ball: Estimate of the ball.
        after: Time to the catch [s].
        tolerance: Share of each limit at which the throw is refused.
    """
    return _asked(f, _way(f, f.alpha, ball, after), ball, after, tolerance)


def asked(
    arm: Arm, approach: Approach, tolerance: Tolerance, *, t_catch: float, sigma: float
) -> Verdict:
    """Return the verdict by what a motion to a catch asks of an arm, whatever generates it.

    Args:
        arm: The arm.
        approach: The motion.
        tolerance: Share of each limit at which the throw is refused.
        t_catch: Predicted time of the catch [s].
        sigma: Predicted 1-sigma of the ball then [m].
    """
    shares = shares_of(arm, approach.motion, tolerance)
    binding = max(shares, key=lambda name: shares[name])
    return Verdict(
        outcome=Outcome.FEASIBLE if shares[binding] <= 1.0 else Outcome.UNREACHABLE,
        binding_limit=binding,
        share=shares[binding],
        t_catch=t_catch,
        sigma=sigma,
        approach=approach,
    )


def is_far(ball: BallState, hand: Array) -> bool:
    """Say whether a ball comes nearest to a hand only later than a motion has to begin.

    Until then it may be known better, or caught by a motion that begins later.

    Args:
        ball: Estimate of the ball.
        hand: Where the hand waits [m], shape (3,).
    """
    path = flown(checks.instance("ball", ball, BallState), np.arange(0.0, HORIZON, STRIDE))[:, 0]
    nearest = int(np.argmin(np.linalg.norm(path - checks.vector("hand", hand, 3), axis=1)))
    return nearest * STRIDE > _START_AHEAD


def has_come_back(f: DirectMap, ball: BallState) -> bool:
    """Say whether an open throw has come back: its predicted catch lies in the map's region."""
    return _where(f, foresee(f, checks.instance("ball", ball, BallState))) is None


def levelled(f: DirectMap, ball: BallState) -> BallState:
    """Return the ball as if it flew level at the nominal catch height: where to wait for a bounce.

    A bounce changes neither where over the ground the ball flies nor, much, how fast. What goes
    level does not fly: it is led.
    """
    ball = checks.instance("ball", ball, BallState)
    motion = np.array([ball.r_o, ball.dr_o, ball.ddr_o])
    level(motion, waiting_height(f))
    return replace(ball, r_o=motion[0], dr_o=motion[1], ddr_o=motion[2], led=True)


def waiting_height(f: DirectMap) -> float:
    """Return the nominal height of the catch [m]."""
    return float(f.arm.position(f.start)[2])


@kernel
def level(motion: Array, height: float) -> None:
    """Let a motion r_o, dr_o, ddr_o, shape (3, 3), go level at a height [m], in place."""
    motion[0, 2], motion[1, 2], motion[2, 2] = height, 0.0, 0.0


def _where(f: DirectMap, seen: Foresight) -> str | None:
    """Return why the predicted catch is outside the map's region; None inside."""
    if not np.isfinite(seen.after):
        return "domain"
    low, high = f.trusted
    for k, name in enumerate(f.arm.names):
        if not low[k] <= seen.q_o[k] <= high[k]:
            return f"region:{name}"
    return None


def _may_rise(f: DirectMap, ball: BallState, seen: Foresight) -> bool:
    """Say whether a bounce could bring the ball up into the region.

    It must come in low, and over the ground it must pass where the region is.
    """
    low = seen.below
    if np.isfinite(seen.after):
        low = bool(f.to_ball(seen.q_o)[2] < f.arm.position(f.start)[2])
    return low and _passes_over(f, ball)


def _level_way(
    f: DirectMap, ball: BallState, start: tuple[Array, Array]
) -> tuple[Array, Array] | None:
    """Return a ball's surrogate target up to its catch, (K, 3, 3), and alpha that follows it.

    None where the ball has passed by already, or is about to.

    Args:
        f: The map.
        ball: Estimate of the ball.
        start: q, dq of the arm [rad, rad/s], shape (n,) each.
    """
    path = flown(ball, np.arange(0.0, HORIZON, STRIDE))
    count = int(level_to_catch(f.arrays, waiting_height(f), path, np.zeros((3, f.arm.n))))
    alpha = f.adapted(levelled(f, ball), *start) if count > 0 else None
    return None if alpha is None else (path[:count], alpha)


def _keeps(f: DirectMap, path: Array, alpha: Array, tolerance: Tolerance) -> bool:
    """Say whether the arm can follow a path, (K, 3, 3), within the limits that are given.

    It is looked at where a way to a catch is, or at each instant where there are fewer.
    """
    at = np.unique(np.linspace(0, len(path) - 1, _INSTANTS).round().astype(int))
    return max(shares_of(f.arm, f.motions(path[at], alpha), tolerance).values()) <= 1.0


@kernel
def level_to_catch(f: MapArrays, height: float, path: Array, rows: Array) -> int:
    """Let a path go level at a height, and count its instants up to the catch.

    Args:
        f: The map.
        height: Where it goes [m].
        path: r_o, dr_o, ddr_o at each instant, overwritten up to the catch, shape (K, 3, 3).
        rows: Scratch, shape (3, n).

    Returns:
        How many there are, the first beyond the catch included; 0 where it leaves the domain before
        it, or comes to none.
    """
    g, first = unpack(f.packed), 0.0
    for k in range(len(path)):
        level(path[k], height)
        rows[0] = f.start
        if not virtual(f.packed, path[k], rows, f.work):
            return 0
        s = to_go(g, rows[0])
        first = s if k == 0 else first
        if first * s <= 0.0:
            return k + 1
    return 0


def _passes_over(f: DirectMap, ball: BallState) -> bool:
    """Say whether the ball's way over the ground leads through the map's region."""
    nominal = f.arm.position(f.start)
    path = flown(ball, np.arange(0.0, HORIZON, STRIDE))[:, 0]
    near = np.flatnonzero(np.hypot(path[:, 0], path[:, 1]) <= np.hypot(nominal[0], nominal[1]))
    if len(near) == 0:
        return False
    point = np.array([path[near[0], 0], path[near[0], 1], nominal[2]])
    inside, rows = f.virtual(np.array([point, np.zeros(3), np.zeros(3)]))
    low, high = f.trusted
    within = (rows[0] >= low) & (rows[0] <= high)
    return bool(inside and np.all(np.delete(within, f.design.catch_joint)))
