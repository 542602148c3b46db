"""Choose the catch: where and when on the ball's flight the arm will meet it, and how.

**How**, by inverse kinematics: the catch point is where the ball is, and as fast, but for a closing
speed ``u`` with which the ball comes in along the palm's normal n: dl = dr_o + u n. It is 0 where
the limits allow it. The acceleration of the hand is not the ball's: the ball must enter the open
hand from the front, so relative to the hand it accelerates, ddl = ddr_o - a n with a > 0; t seconds
before the catch it is u t + a t^2 / 2 in front of the palm. Of the accelerations ``a`` between two
bounds the one with the least joint torques is taken, each joint by itself.

**Where, when and how fast**: candidates are the instants at which the catch point can be where the
ball will be. A quintic from the arm's state to each is evaluated at a few instants: it costs
eq. (22), and more where it uses much of a limit, ends low, or leaves a closing speed. That is
raised towards the one with the least joint speeds until some of each limit is left, as a map's line
is turned inwards until the speeds suffice (:mod:`mitt.core.map.family`). The distance that the
brake needs after the catch counts as range.

| here     | meaning                                          | unit          | shape  |
|----------|--------------------------------------------------|---------------|--------|
| ``ball`` | r_o, dr_o, ddr_o                                 | m, m/s, m/s^2 | (3, 3) |
| ``rows`` | q, dq, ddq; row 0 is where the iteration starts  | rad ...       | (3, n) |
"""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from mitt.core.arm.arm import Arm
from mitt.core.arm.kinematics import (
    IDENTITY,
    ZERO,
    Chain,
    Vec,
    compose,
    cross,
    dot,
    matrix,
    minus,
    place,
    plus,
    rotate,
    row,
    sweep,
    times,
    turn,
)
from mitt.core.kernels import kernel
from mitt.core.map.demand import (
    KINDS,
    ArmNumbers,
    Tolerance,
    Work,
    arm_numbers,
    reckon,
    room_of_demand,
    work_of,
)
from mitt.core.map.mapping import DirectMap
from mitt.core.map.prediction import flown, fly_on, state_of
from mitt.core.map.tangent import unfold, unpack
from mitt.core.signals import Array, BallState
from mitt.core.verdict.feasibility import Approach, Outcome, Verdict, asked
from mitt.lab.rivals.paths import sample_quintic

#: Newton: largest step of a joint [rad], residual [m], steps allowed.
_STEP = 0.4
_RESIDUAL = 1e-9
_STEPS = 30
#: How long before the catch a ball is in front of the palm by its way in alone [s].
_EARLY = 0.05


class HandNumbers(NamedTuple):
    """What the kernels know of the hand and of what moves it.

    Attributes:
        normal: The palm's normal n in the last joint's frame, shape (3,).
        inertia: M_kk / tau_max of each joint [s^2/rad], shape (n,).
        speed: Largest speed of each joint [rad/s], shape (n,).
    """

    normal: Array
    inertia: Array
    speed: Array


def hand_numbers(arm: Arm) -> HandNumbers:
    """Return the hand of an arm."""
    q = arm.q_ready
    frame = np.array([_frame(arm.chain, q, axis) for axis in np.eye(3)]).T
    normal = frame.T @ arm.orientation(q)[:, 2]
    return HandNumbers(normal, np.diag(arm.mass_matrix(q)) / arm.tau_max, arm.dq_max)


@kernel
def _frame(chain: Chain, q: Array, local: Array) -> Vec:
    """Return a direction fixed in the last joint's frame in the world."""
    frame = IDENTITY
    for k in range(len(q)):
        frame = compose(frame, matrix(chain.R, k))
        if chain.prismatic[k] == 0.0:
            frame = compose(frame, turn(row(chain.axis, k), q[k]))
    out: Vec = rotate(frame, (local[0], local[1], local[2]))
    return out


@kernel
def resolve(J: Array, b: Vec, out: Array) -> None:
    """Write x with J' x = b by damped least squares, J of shape (n, 3).

    x = J (J' J + lambda I)^-1 b, damped only where det(J' J) is below 1e-3 m^6, with 1e-2 m^2 at 0
    (Nakamura and Hanafusa 1986); elsewhere the solution is exact.
    """
    a, c, e = _gram(J, 0), _gram(J, 1), _gram(J, 2)
    det = dot(a, cross(c, e))
    poor = max(0.0, 1.0 - det / 1e-3)
    damp = 1e-2 * poor * poor
    a, c, e = (a[0] + damp, a[1], a[2]), (c[0], c[1] + damp, c[2]), (e[0], e[1], e[2] + damp)
    normal = cross(c, e)
    det = dot(a, normal)
    y = (dot(b, normal) / det, dot(b, cross(e, a)) / det, dot(b, cross(a, c)) / det)
    for k in range(len(out)):
        out[k] = dot(row(J, k), y)


@kernel
def _gram(J: Array, i: int) -> Vec:
    """Return row i of J' J."""
    x, y, z = 0.0, 0.0, 0.0
    for k in range(J.shape[0]):
        x += J[k, i] * J[k, 0]
        y += J[k, i] * J[k, 1]
        z += J[k, i] * J[k, 2]
    return x, y, z


@kernel
def reach_point(packed: Array, r: Array, q: Array, work: Array) -> float:
    """Move ``q`` to where the catch point is at ``r``; return the distance that is left [m]."""
    g = unpack(packed)
    w = unfold(work, len(q))
    m, gap = w.motion, np.inf
    for _ in range(_STEPS):
        place(g.chain, q, m)
        b = minus((r[0], r[1], r[2]), row(m.tip, 0))
        gap = np.sqrt(dot(b, b))
        if not gap > _RESIDUAL:
            break
        resolve(m.J, b, w.step)
        largest = 0.0
        for k in range(len(q)):
            largest = max(largest, abs(w.step[k]))
        for k in range(len(q)):
            q[k] += w.step[k] * min(1.0, _STEP / max(largest, 1e-300))
    return float(gap)


@kernel
def follow_point(
    packed: Array, hand: HandNumbers, ahead: Vec, point: Array, rows: Array, work: Array
) -> float:
    """Write q, dq, ddq at which a point in front of the palm follows a moving point.

    Args:
        packed: The arm.
        hand: The hand.
        ahead: Distance in front of the catch point along the palm's normal, and its two
            derivatives in time [m, m/s, m/s^2].
        point: Position, velocity, acceleration to be followed [m ...], shape (3, 3).
        rows: Result; row 0 is where the iteration starts and so chooses the branch, shape (3, n).
        work: Scratch.

    Returns:
        Distance that is left [m].
    """
    longer = packed.copy()  # kept by its use as an argument below: views do not keep it
    tip = unpack(longer).chain.tip
    for c in range(3):
        tip[c] += ahead[0] * hand.normal[c]
    gap: float = _lift(longer, hand, ahead, point, rows, work)
    return gap


@kernel
def _lift(
    packed: Array, hand: HandNumbers, ahead: Vec, point: Array, rows: Array, work: Array
) -> float:
    """As :func:`follow_point`, for an arm whose tip is the point in front of the palm."""
    g = unpack(packed)
    gap = reach_point(packed, point[0], rows[0], work)
    w = unfold(work, rows.shape[1])
    m = w.motion
    normal = _frame(g.chain, rows[0], hand.normal)
    resolve(m.J, minus(row(point, 1), times(ahead[1], normal)), rows[1])
    sweep(g.chain, rows[0], rows[1], m)
    turning = ZERO
    for k in range(rows.shape[1]):
        turning = plus(turning, times(rows[1, k], cross(row(m.W, k), normal)))
    fixed = plus(row(m.tip, 2), plus(times(2.0 * ahead[1], turning), times(ahead[2], normal)))
    resolve(m.J, minus(row(point, 2), fixed), rows[2])
    return float(gap)


class Entry(NamedTuple):
    """How a ball comes into the hand, along the palm's normal.

    Attributes:
        closing: Its speed relative to the hand u [m/s].
        least: Smallest relative acceleration a where it has no closing speed [m/s^2].
        most: Largest.
    """

    closing: float
    least: float
    most: float


@kernel
def meet_ball(
    packed: Array, hand: HandNumbers, how: Entry, ball: Array, rows: Array, work: Array
) -> bool:
    """Write how the ball is met, shape (3, n); False where the catch point cannot be there."""
    n = rows.shape[1]
    if not _lift(packed, hand, (0.0, -how.closing, 0.0), ball, rows, work) <= 1e3 * _RESIDUAL:
        return False
    g = unpack(packed)
    w = unfold(work, n)
    resolve(w.motion.J, _frame(g.chain, rows[0], hand.normal), w.dq)
    along, size = 0.0, 1e-300
    for k in range(n):
        along += rows[2, k] * w.dq[k] * hand.inertia[k] ** 2
        size += (w.dq[k] * hand.inertia[k]) ** 2
    # By its speed it is in front a while before, so less acceleration does.
    least = max(how.least - 2.0 * how.closing / _EARLY, 0.0)
    a = min(max(along / size, least), how.most)
    for k in range(n):
        rows[2, k] -= a * w.dq[k]
    return True


@kernel
def slowest(packed: Array, hand: HandNumbers, rows: Array, work: Array) -> float:
    """Return the closing speed with the least joint speeds [m/s], from how a ball is met at 0.

    0 where the joints would have to be faster for any.
    """
    n, g = rows.shape[1], unpack(packed)
    w = unfold(work, n)
    resolve(w.motion.J, _frame(g.chain, rows[0], hand.normal), w.dq)
    along, size = 0.0, 1e-300
    for k in range(n):
        along -= rows[1, k] * w.dq[k] / hand.speed[k] ** 2
        size += (w.dq[k] / hand.speed[k]) ** 2
    return float(max(along / size, 0.0))


#: Smallest and largest relative acceleration along the palm's normal [m/s^2].
APPROACH = (70.0, 160.0)
#: Candidates: shortest and longest time ahead, and step [s].
SOONEST = 0.06
HORIZON = 0.9
STRIDE = 0.02
#: Instants at which the path to a candidate is evaluated.
INSTANTS = 8
#: Utilization above which a candidate pays, price per squared excess, and price of a low catch.
SPARE = 0.9
PRICE = 100.0
LOW = 2.0
#: Closing speeds that are tried, in this order, as shares of the one with the least joint speeds.
CLOSINGS = (0.0, 0.25, 0.5, 0.75, 1.0)
#: Price of the squared closing speed [(m/s)^-2]: it tells catches within the limits apart, and is
#: far below that of a limit, as a learned map keeps its limits first.
LEFT = 0.1
#: Share of a speed limit beyond which the next closing speed is tried without weighing all limits.
_TOO_FAST = 1.6
#: Instants at which the demand of the way to a catch is reckoned for a verdict.
_JUDGED = 25
#: Time after the catch for which the ball is still followed [s].
FOLLOW = 0.004


@final
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Intercept:
    """A chosen catch.

    Attributes:
        t_c: Its time [s].
        end: q, dq, ddq then [rad ...], shape (3, n).
        r_c: The ball's predicted position then [m], shape (3,).
        closing: Speed of the ball relative to the hand then, along the palm's normal [m/s].
        binding_limit: The limit that the path there uses most.
        utilization: How much of it is used.
        low: Whether the catch is lower than any that the map was learned on, where a surface may
            be in the way.
    """

    t_c: float
    end: Array
    r_c: Array
    closing: float = 0.0
    binding_limit: str
    utilization: float
    low: bool

    @property
    def entry(self) -> Entry:
        """How the ball may come into the hand."""
        return Entry(self.closing, *APPROACH)


#: What a catch comes to: its price [1], infinite where there is none; the largest utilization of a
#: limit [1]; which limit, kind n + joint, of the first three of KINDS; and the closing speed [m/s].
WEIGHED = np.dtype(
    [
        ("price", np.float64),
        ("utilization", np.float64),
        ("limit", np.int64),
        ("closing", np.float64),
    ]
)


class Search(NamedTuple):
    """What the search knows of the arm, and scratch."""

    packed: Array  # the arm, as :attr:`DirectMap.packed`
    hand: HandNumbers
    work: Array
    bounds: Array  # (3, n) lowest and highest joints; where the first inverse starts [rad]
    plant: ArmNumbers
    scratch: Work
    floor: float  # height below which a catch is low [m]


@final
@dataclass(frozen=True, eq=False)
class Chooser:
    """Chooses the catch for the arm of a map."""

    map: DirectMap

    @property
    def arm(self) -> Arm:
        """The arm."""
        return self.map.arm

    @cached_property
    def hand(self) -> HandNumbers:
        """The hand, as the kernels take it."""
        return hand_numbers(self.arm)

    @cached_property
    def floor(self) -> float:
        """Height of the lowest catch that the map was learned on [m]; nothing else of it counts."""
        low, high = self.map.region
        if not np.all(np.isfinite(self.map.region)):
            return -np.inf
        corners = product(*zip(low, high, strict=True))
        return float(min(self.arm.position(np.array(q))[2] for q in corners))

    @cached_property
    def _search(self) -> Search:
        """The arm, as the kernels take it."""
        f, arm = self.map, self.arm
        bounds = np.array([arm.q_min, arm.q_max, f.start])
        return Search(
            f.packed, self.hand, f.work, bounds, arm_numbers(arm), work_of(arm), self.floor
        )

    def choose(self, ball: BallState, motion: Array) -> Intercept | None:
        """Return the best catch: the best in even steps, then the best about that; None without.

        ``motion`` is the arm's q, dq, ddq at the ball's time, shape (3, n).
        """
        after = np.arange(SOONEST, HORIZON, STRIDE)
        first = self.best(after, flown(ball, after), motion)
        if first is None:
            return None
        near = np.linspace(first.t_c - STRIDE / 2, first.t_c + STRIDE / 2, 3)
        near = near[near >= SOONEST]
        best = self.best(near, flown(ball, near), motion) or first
        return replace(best, t_c=ball.t + best.t_c)

    def best(self, after: Array, balls: Array, motion: Array) -> Intercept | None:
        """Return the best of several catches, its time counted from now; None without one.

        Args:
            after: Times from now [s], shape (K,).
            balls: r_o, dr_o, ddr_o then, shape (K, 3, 3).
            motion: q, dq, ddq now, shape (3, n).
        """
        ends, table = np.zeros((len(after), 3, self.arm.n)), np.zeros(len(after), WEIGHED)
        weigh_catches(self._search, after, balls, motion, ends, table)
        k = int(np.argmin(table["price"]))
        price, utilization, limit, closing = table[k].tolist()
        if not price < np.inf:
            return None
        kind, joint = divmod(limit, self.arm.n)
        return Intercept(
            t_c=float(after[k]),
            end=ends[k],
            r_c=balls[k, 0],
            closing=closing,
            binding_limit=f"{KINDS[kind]}:{self.arm.names[joint]}",
            utilization=utilization,
            low=bool(balls[k, 0, 2] < self.floor),
        )

    def aim(self, catch: Intercept, ball: BallState) -> Intercept:
        """Return the catch with its end where the ball is now predicted to be at its time."""
        f, at, end = self.map, np.empty((3, 3)), catch.end.copy()
        fly_on(state_of(ball), catch.t_c - ball.t, at)
        if np.isfinite(at).all() and meet_ball(f.packed, self.hand, catch.entry, at, end, f.work):
            return replace(catch, end=end, r_c=at[0])
        return catch

    def beside(self, ball: Array, closing: float, after: float, rows: Array) -> bool:
        """Write how the hand goes on after a catch, the ball closing in as it did; say if it can.

        Args:
            ball: r_o, dr_o, ddr_o as if nothing had touched it, shape (3, 3).
            closing: Its closing speed at the catch [m/s].
            after: Time since the catch [s].
            rows: Result; row 0 is where the hand was, shape (3, n).
        """
        ahead, f = (-closing * after, -closing, 0.0), self.map
        return bool(follow_point(f.packed, self.hand, ahead, ball, rows, f.work) <= 1e3 * _RESIDUAL)

    def verdict(
        self, catch: Intercept | None, ball: BallState, motion: Array, *, sigma: float
    ) -> Verdict:
        """Return the verdict on a throw by the quintic to the catch chosen for it, as of a map.

        Args:
            catch: The catch; None where there is none.
            ball: Estimate of the ball.
            motion: q, dq, ddq now, shape (3, n).
            sigma: Predicted 1-sigma of the ball at the catch [m].
        """
        if catch is None:
            return Verdict(
                outcome=Outcome.UNREACHABLE,
                binding_limit="domain",
                share=np.inf,
                t_catch=np.inf,
                sigma=sigma,
            )
        after, way = catch.t_c - ball.t, np.empty((_JUDGED, 3, self.arm.n))
        way[0] = motion
        sample_quintic(motion, catch.end, after, way[1:])
        dr_o = flown(ball, np.array([after]))[0, 1]
        approach = Approach(motion=way, step=after / (_JUDGED - 1), dr_o=dr_o)
        return asked(self.arm, approach, Tolerance(), t_catch=catch.t_c, sigma=sigma)


@kernel
def weigh_catches(
    g: Search, after: Array, balls: Array, motion: Array, ends: Array, table: NDArray[np.void]
) -> None:
    """Weigh several catches, each with the hand as fast as the limits allow.

    Args:
        g: The arm.
        after: Their times from now [s], shape (K,).
        balls: r_o, dr_o, ddr_o then, shape (K, 3, 3).
        motion: q, dq, ddq now, shape (3, n).
        ends: Result: q, dq, ddq then, shape (K, 3, n).
        table: Result: rows of :data:`WEIGHED`, shape (K,).
    """
    tried, known = np.empty((3, motion.shape[1])), g.bounds[2].copy()
    for k in range(len(after)):
        table[k].price, top = np.inf, 0.0
        tried[0] = known
        for share in CLOSINGS:
            closing = share * top
            if not meet_ball(g.packed, g.hand, Entry(closing, *APPROACH), balls[k], tried, g.work):
                break
            known[:] = tried[0]
            price, used, limit = _weigh(g, after[k], balls[k], closing, motion, tried)
            if price < table[k].price:  # one that is no number never is
                ends[k] = tried
                table[k].price, table[k].utilization = price, used
                table[k].limit, table[k].closing = limit, closing
            if share == 0.0:
                top = slowest(g.packed, g.hand, tried, g.work)
            if used <= SPARE or top == 0.0:
                break


@kernel
def _weigh(
    g: Search, after: float, ball: Array, closing: float, motion: Array, end: Array
) -> tuple[float, float, int]:
    """Return price, utilization and limit, as in :data:`WEIGHED`, of the way to an end, (3, n).

    The price is infinite where the end is beyond a joint's range, or the way far too fast.
    """
    p, inertia, n = g.plant, g.hand.inertia, motion.shape[1]
    links, path = len(g.scratch.tau), np.empty((INSTANTS, 3, n))
    sample_quintic(motion, end, after, path)
    for j in range(n):
        if not g.bounds[0, j] < end[0, j] < g.bounds[1, j]:
            return np.inf, np.inf, 0
        if not np.max(np.abs(path[:, 1, j])) <= _TOO_FAST * p.dq_max[j]:
            return np.inf, np.inf, 0
    d = room_of_demand(INSTANTS, n, links)
    reckon(p, path, d, g.scratch)
    share, which = -1.0, 0
    for kind in range(3):
        for j in range(n):
            if kind == 0:
                x = np.max(d.torque[:, p.joints[j]])
            elif kind == 1:
                x = np.max(d.speed[:, p.joints[j]])
            else:
                dq = end[1, j]
                stop = end[0, j] + FOLLOW * dq + 0.5 * dq * abs(dq) * inertia[j]
                x = max(np.max(d.range[:, j]), abs(stop - p.middle[j]) / p.half[j])
            if x > share:
                share, which = x, kind * n + j
    low = ball[0, 2] < g.floor
    cost = np.sum(d.cost_torque + d.cost_speed) / INSTANTS
    price = cost + PRICE * max(share - SPARE, 0.0) ** 2 + LEFT * closing * closing + LOW * low
    return price, share, which
