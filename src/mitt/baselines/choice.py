"""Choose the catch: where and when on the ball's flight the arm will meet it.

Candidates are the instants at which the catch point can be where the ball will be. A quintic from
the arm's state to each is evaluated at a few instants: it costs eq. (22), and more where it uses
much of a limit or ends low. The distance that the brake needs after the catch counts as range.

| columns of ``table`` | meaning                                                        |
|----------------------|----------------------------------------------------------------|
| 0                    | price [1]; infinite where there is no catch                    |
| 1                    | largest utilization of a limit [1]                             |
| 2                    | which limit: kind n + joint, kinds torque, speed, range        |
"""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import NamedTuple, final

import numpy as np

from mitt.baselines.intercept import hand_of, meet, meetings
from mitt.baselines.paths import sample
from mitt.generator.feasibility import Outcome, Verdict
from mitt.generator.mapping import DirectMap
from mitt.generator.prediction import flown, fly_on, state_of
from mitt.generator.utilization import Plant, Work, assess, plant_of, work_of
from mitt.jit import kernel
from mitt.robot.arm import Arm
from mitt.robot.dynamics import inverse_dynamics
from mitt.signals import Array, BallState

#: Smallest and largest relative acceleration along the palm's normal [m/s^2].
APPROACH = (70.0, 160.0)
#: Candidates: shortest and longest time ahead, and step [s].
SOONEST, HORIZON, STRIDE = 0.06, 0.9, 0.02
#: Instants at which the path to a candidate is evaluated.
INSTANTS = 8
#: Utilization above which a candidate pays, price per squared excess, and price of a low catch.
SPARE, PRICE, LOW = 0.9, 100.0, 2.0
#: Utilization beyond which a throw is refused.
REFUSED = 1.6
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
        binding_limit: The limit that the path there uses most.
        utilization: How much of it is used.
        low: Whether the catch is lower than any that the map was learned on, where a surface may
            be in the way.
    """

    t_c: float
    end: Array
    r_c: Array
    binding_limit: str
    utilization: float
    low: bool


class Search(NamedTuple):
    """What the search knows of the arm, and scratch."""

    packed: Array  # this, hand and work as of mitt.baselines.intercept
    hand: Array
    work: Array
    bounds: Array  # (3, n) lowest and highest joints; where the first inverse starts [rad]
    plant: Plant
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
    def hand(self) -> Array:
        """Numbers of the kernels."""
        return hand_of(self.arm)

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
        return Search(f.packed, self.hand, f.work, bounds, plant_of(arm), work_of(arm), self.floor)

    def choose(self, ball: BallState, motion: Array) -> Intercept | None:
        """Return the best catch: the best in even steps, then the best about that.

        Args:
            ball: The ball's estimate.
            motion: The arm's q, dq, ddq at the same time, shape (3, n).

        Returns:
            None where there is no catch.
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
        ends, table = np.zeros((len(after), 3, self.arm.n)), np.zeros((len(after), 3))
        weigh(self._search, after, balls, motion, ends, table)
        k = int(np.argmin(table[:, 0]))
        price, utilization, which = table[k].tolist()
        if not price < np.inf:
            return None
        kind, joint = divmod(int(which), self.arm.n)
        return Intercept(
            t_c=float(after[k]),
            end=ends[k],
            r_c=balls[k, 0],
            binding_limit=f"{('torque', 'speed', 'range')[kind]}:{self.arm.names[joint]}",
            utilization=utilization,
            low=bool(balls[k, 0, 2] < self.floor),
        )

    def aim(self, catch: Intercept, ball: BallState) -> Intercept:
        """Return the catch with its end where the ball is now predicted to be at its time."""
        f, at, end = self.map, np.empty((3, 3)), catch.end.copy()
        fly_on(state_of(ball), catch.t_c - ball.t, at)
        if np.isfinite(at).all() and meet(f.packed, self.hand, APPROACH, at, end, f.work):
            return replace(catch, end=end, r_c=at[0])
        return catch

    def verdict(self, catch: Intercept | None, *, sigma: float) -> Verdict:
        """Return the verdict on a throw by the catch chosen for it; feasible or unreachable."""
        if catch is None:
            return Verdict(
                outcome=Outcome.UNREACHABLE, binding_limit="domain", share=np.inf,
                t_catch=np.inf, sigma=sigma,
            )  # fmt: skip
        fits = catch.utilization <= REFUSED
        return Verdict(
            outcome=Outcome.FEASIBLE if fits else Outcome.UNREACHABLE,
            binding_limit=catch.binding_limit, share=catch.utilization,
            t_catch=catch.t_c, sigma=sigma,
        )  # fmt: skip


@kernel
def weigh(g: Search, after: Array, balls: Array, motion: Array, ends: Array, table: Array) -> None:
    """Weigh several catches; those that need much too high speeds only if there are no others.

    Args:
        g: The arm.
        after: Their times from now [s], shape (K,).
        balls: r_o, dr_o, ddr_o then, shape (K, 3, 3).
        motion: q, dq, ddq now, shape (3, n).
        ends: Result: q, dq, ddq then, shape (K, 3, n).
        table: Result: the module's table, shape (K, 3).
    """
    p, n = g.plant, motion.shape[1]
    ends[0, 0] = g.bounds[2]
    found = meetings(g.packed, g.hand, APPROACH, balls, ends, g.work)
    paths, speed = np.empty((len(after), INSTANTS, 3, n)), np.full(len(after), np.inf)
    for k in range(len(after)):
        for j in range(n):
            found[k] &= g.bounds[0, j] < ends[k, 0, j] < g.bounds[1, j]
        if found[k]:
            sample(motion, ends[k], after[k], paths[k])
            speed[k] = np.max(np.abs(paths[k, :, 1] / p.scales[1]))
            if not speed[k] < np.inf:  # one that is no number would win every comparison
                found[k], speed[k] = False, np.inf
    most = max(REFUSED, np.min(speed))
    for k in range(len(after)):
        table[k, 0] = np.inf
        if found[k] and speed[k] <= most:
            _weigh(g, balls[k, 0, 2] < g.floor, ends[k], paths[k], table[k])
            if not table[k, 0] < np.inf:
                table[k, 0] = np.inf


@kernel
def _weigh(g: Search, low: bool, end: Array, path: Array, out: Array) -> None:
    """Write a row of the table, shape (3,), for a path, shape (S, 3, n)."""
    p, w, inertia = g.plant, g.scratch, g.hand[3:]
    shares, at, cost = np.zeros((3, len(w.tau))), np.empty((3, len(w.tau))), 0.0
    for j in range(path.shape[2]):
        stop = end[0, j] + FOLLOW * end[1, j] + 0.5 * end[1, j] * abs(end[1, j]) * inertia[j]
        x = abs(stop - p.scales[2, j]) / p.scales[3, j]
        shares[2, p.joints[j]] = max(shares[2, p.joints[j]], x)
    for s in range(len(path)):
        w.motion[:] = path[s]
        inverse_dynamics(p.bodies, path[s, 0], path[s, 1], path[s, 2], w.tau, w.notes)
        cost += assess(p, s, np.inf, shares, at, w)[0]
    share, which = -1.0, 0
    for kind in range(3):
        for j in range(path.shape[2]):
            if shares[kind, p.joints[j]] > share:
                share, which = shares[kind, p.joints[j]], kind * path.shape[2] + j
    out[0] = cost / len(path) + PRICE * max(share - SPARE, 0.0) ** 2 + LOW * low
    out[1], out[2] = share, which
