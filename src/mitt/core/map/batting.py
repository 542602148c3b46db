"""The map that strikes: the paper's, with the paddle's motion at the contact as two more rows.

b has terms of first order in s = q_i - q_alpha, so its rate need not vanish at s = 0, where b does:
the paddle is at the ball whatever the coefficients are. There the joints are those of l_c^-1, and
what they are to move at is linear in alpha,

    phi-dot(t_c)' alpha = dq* - dq_o(t_c),

and so is how they accelerate there: as if they had come to these speeds within a given time. These
are 2 n rows below those of eq. (12): one projection moves the learned coefficients to a throw.
Where the paddle points is a matter of q* itself (:mod:`mitt.core.map.striking`): of each throw
q_alpha is the angle of the catch joint in q*, and the joints that are not free rest at theirs.

| here       | meaning                                             | unit      | shape    |
|------------|-----------------------------------------------------|-----------|----------|
| ``strike`` | q*, dq* and the ball at the contact                 | rad ...   |          |
| ``phi``    | monomials and rate at t_0, both rates at t_c        | 1, 1/s .. | (4, m)   |
| ``d``      | q - q_o and rate at t_0; both rates of it at t_c    | rad ...   | (4 n,)   |
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, final

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.errors import InputError, ModelError
from mitt.core.fields import brief
from mitt.core.map.demand import arm_numbers, demand
from mitt.core.map.learn import Flight, Learned, LearnSettings, Lifted, learn_lifted, lift_flight
from mitt.core.map.map_design import MapDesign, check_joints
from mitt.core.map.mapping import DirectMap, coordinates, initial_gap, project
from mitt.core.map.polynomial import CatchBasis
from mitt.core.map.striking import (
    ASTRAY,
    Aiming,
    Impact,
    PaddleStrike,
    aim_at_target,
    aiming_of,
    attained,
)
from mitt.core.signals import GRAVITY, Array, BallState

#: Largest speed of a motion from rest to rest, in units of its mean, and largest acceleration, in
#: units of that by its time: of a quintic.
_PEAK = 1.875
_PUSH = 5.774
#: Time in which the accelerations at the contact would bring about the speeds there [s]. Left free
#: they are twice as large, and the torque of a WAM's joints 2 and 4 ends 10 ms before the contact;
#: from 0.05 to 0.1 s as many balls pass within 15 cm of the target.
_SWING = 0.07
#: Share of its bound that no joint's acceleration exceeds at the contact: then it takes longer.
_HELD_BACK = 0.7
#: How often the instants about the easiest contact are looked at more closely.
_HALVINGS = 3
#: Share of a limit beyond which a flight is left out of learning.
_MOST = 1.3
#: Least scale of a variable of b [rad].
_NARROWEST = 1e-3
#: What maps of one arm have in common, whatever the throw.
_SHARED: Final = ("H_inverse", "work")


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class BattingMap:
    """The batting map of one arm.

    Attributes:
        map: Learned coefficients and their metric.
        held: Joints that are not free and turn to aim; they rest at another angle in each throw.
    """

    map: DirectMap
    held: tuple[int, ...]

    __repr__ = brief

    def __post_init__(self) -> None:
        """Hold the parts to each other."""
        design = self.map.design
        if set(self.held) & set(design.free) or not set(self.held) <= set(range(self.map.arm.n)):
            raise ModelError("held", f"joints besides the free ones {design.free}", self.held)
        if not self.map.basis.first_order:
            raise ModelError("basis", "terms of first order in q_i - q_alpha", "none")

    @property
    def arm(self) -> Arm:
        """The arm."""
        return self.map.arm

    @cached_property
    def aiming(self) -> Aiming:
        """The search for the pose of a strike."""
        return aiming_of(self.arm, tuple(sorted({*self.map.design.free, *self.held})))

    def strike(
        self, ball: Array, target: Array | None, impact: Impact, *, near: PaddleStrike | None = None
    ) -> PaddleStrike | None:
        """Return how the paddle meets a ball; see :func:`mitt.core.map.striking.aim_at_target`.

        Args:
            ball: r_o, v_o at the contact [m, m/s], shape (2, 3).
            target: Where the ball is to go [m], shape (3,); None for a shield.
            impact: How ball and paddle part.
            near: A strike from which the search starts; the middle of those learned if left out.
        """
        start = self.map.start if near is None else near.q
        T = None if near is None or near.T == 0.0 else near.T
        return aim_at_target(self.arm, self.aiming, ball, target, impact, start, T=T)

    def aims(self, strike: PaddleStrike, target: Array | None) -> bool:
        """Say whether a strike points the paddle as well as the arm can.

        An arm without a joint to aim with, and a shield, are as near to it as they can be.
        """
        return strike.astray <= ASTRAY or target is None or not self.held

    def ease(self, strike: PaddleStrike, q: Array, after: float) -> float:
        """Return about the share of the limits that a strike takes.

        Args:
            strike: The strike.
            q: Where the arm is [rad], shape (n,).
            after: Time until then [s].
        """
        arm = self.arm
        mean = np.abs(strike.q - q) / max(after, 1e-3)
        push = _PUSH * arm.mass_matrix(strike.q) @ mean / (max(after, 1e-3) * arm.tau_max)
        way = np.maximum(_PEAK * mean / arm.dq_max, np.abs(push))
        way = np.maximum(way, _PUSH * mean / (max(after, 1e-3) * arm_numbers(arm).ddq_max))
        middle, half = 0.5 * (arm.q_max + arm.q_min), 0.5 * (arm.q_max - arm.q_min)
        off = np.abs(strike.q - middle) / half
        beyond = np.where(off > 1.0, np.inf, 0.0)
        return float(max(way.max(), np.abs(strike.dq / attained(arm)).max(), beyond.max()))

    def posed(self, strike: PaddleStrike) -> DirectMap:
        """Return the map whose joints are those of a strike at s = 0, with alpha as learned."""
        f, q = self.map, strike.q
        i = f.design.catch_joint
        centre = f.basis.centre.copy()
        centre[f.basis.catch_joint] = q[i]
        basis = replace(f.basis, centre=centre)
        basis.__dict__["powers"] = f.basis.powers
        posed = replace(
            f,
            design=replace(f.design, q_catch=float(q[i])),
            basis=basis,
            q_rest=q,
            region=np.array([q, q]),
        )
        posed.__dict__.update({k: v for k, v in f.__dict__.items() if k in _SHARED})
        return posed

    def adapt(self, ball: BallState, q: Array, dq: Array, strike: PaddleStrike) -> DirectMap | None:
        """Return the map that starts where the arm is and ends in a strike.

        None where the ball is, or will be, outside the domain of l_c^-1, or where the strike turns
        the catch joint beyond its range.

        Args:
            ball: Estimate of the ball.
            q: Joint positions [rad], shape (n,).
            dq: Joint velocities [rad/s], shape (n,).
            strike: How the ball will be met.
        """
        i = self.map.design.catch_joint
        if not self.arm.q_min[i] <= strike.q[i] <= self.arm.q_max[i]:
            return None
        f = self.posed(strike)
        inside, virtual = f.virtual(np.array([ball.r_o, ball.dr_o, ball.ddr_o]))
        end = contact_rows(f, strike)
        if not inside or end is None:
            return None
        phi = f.basis.jets(*coordinates(f.tangent, virtual))[:2]
        d = np.concatenate([initial_gap(q, dq, virtual), end[1]])
        return f.with_alpha(project(f.alpha, f.H_inverse, np.vstack([phi, end[0]]), d))


def easiest(
    met: Callable[[float], tuple[float, PaddleStrike] | None], times: Array
) -> list[tuple[float, tuple[float, PaddleStrike]]]:
    """Return instants of a contact and how the ball is met then, the easiest first.

    Where a paddle can be brought to a ball, and how easily, changes within milliseconds: about the
    best of evenly spaced instants those between are looked at, and between these once more.

    Args:
        met: From an instant [s] to the share of the limits that a strike takes, and the strike.
        times: Evenly spaced instants [s].
    """
    found = {t: x for t in times.tolist() if (x := met(t)) is not None}
    step = float(times[1] - times[0]) if len(times) > 1 else 0.0
    for _ in range(_HALVINGS if found and step > 0.0 else 0):
        step *= 0.5
        middle = min(found, key=lambda t: found[t][0])
        for t in (middle - step, middle + step):
            x = met(t)
            if x is not None:
                found[t] = x
    return sorted(found.items(), key=lambda x: x[1][0])


def contact_rows(f: DirectMap, strike: PaddleStrike) -> tuple[Array, Array] | None:
    """Return both rates of the monomials at the contact, (2, m), and those of q* - q_o, (2 n,).

    None where l_c has no inverse there.

    Args:
        f: The map, posed.
        strike: The strike.
    """
    inside, virtual = f.virtual(np.array([*strike.ball, [0.0, 0.0, -GRAVITY]]))
    if not inside:
        return None
    phi = f.basis.jets(*coordinates(f.tangent, virtual))
    swing = np.abs(strike.dq / (_HELD_BACK * arm_numbers(f.arm).ddq_max)).max(initial=_SWING)
    return phi[1:], np.concatenate([strike.dq - virtual[1], strike.dq / swing - virtual[2]])


def unlearned_batting(
    arm: Arm, design: MapDesign, held: tuple[int, ...], middle: Array
) -> BattingMap:
    """Return the map with alpha = 0: where learning starts.

    Args:
        arm: The arm.
        design: Free joints, catch joint, line along which the ball comes, order.
        held: As of :class:`BattingMap`.
        middle: Pose in which the arm strikes in the middle of its throws [rad], shape (n,).
    """
    check_joints(arm, design)
    basis = _basis(design, middle[list(design.free)], np.ones(3))
    size = len(basis.powers) * arm.n
    f = DirectMap(
        arm=arm,
        design=replace(design, q_catch=float(middle[design.catch_joint])),
        basis=basis,
        alpha=np.zeros((len(basis.powers), arm.n)),
        H=np.eye(size),
        region=np.array([middle, middle]),
        q_rest=middle,
    )
    return BattingMap(map=f, held=held)


def _basis(design: MapDesign, centre: Array, scale: Array) -> CatchBasis:
    """Return the monomials of b."""
    i = design.free.index(design.catch_joint)
    return CatchBasis(design.order, i, centre, scale, first_order=True)


def lift_strike(g: BattingMap, flight: Flight, strike: PaddleStrike) -> Lifted | None:
    """Return a flight in virtual joints, held to its start and its strike; None outside l_c^-1."""
    f = g.posed(strike)
    lifted, end = lift_flight(f, flight), contact_rows(f, strike)
    if lifted is None or end is None:
        return None
    phi = np.vstack([lifted.phi_0, end[0]])
    return lifted._replace(phi_0=phi, gap=np.concatenate([lifted.gap, end[1]]))


def learn_batting(
    g: BattingMap,
    flights: Sequence[tuple[Flight, PaddleStrike]],
    *,
    settings: LearnSettings | None = None,
) -> tuple[BattingMap, Learned]:
    """Learn the coefficients over flights and their strikes.

    As :func:`mitt.core.map.learn.learn_from`. Then once more without those that ask for far more
    than a limit: they would be refused, and a few of them decide what is learned.

    Args:
        g: The map, unlearned.
        flights: Flights, from t_0 to a little past the contact, and how each ball is met.
        settings: How to learn.

    Raises:
        InputError: No flight is inside the map's domain.
    """
    settings = settings or LearnSettings()
    g, learned, kept = _learned(g, flights, len(flights), settings)
    if 2 * len(kept) < len(flights) or len(kept) == learned.flights:
        return replace(g, map=learned.map), learned
    g, learned, _ = _learned(g, kept, len(flights), settings)
    return replace(g, map=learned.map), learned


def _learned(
    g: BattingMap,
    flights: Sequence[tuple[Flight, PaddleStrike]],
    count: int,
    settings: LearnSettings,
) -> tuple[BattingMap, Learned, list[tuple[Flight, PaddleStrike]]]:
    """Return the map scaled to flights, what was learned from them, and those it is fit for."""
    inside = [(x, of) for of in flights if (x := lift_strike(g, *of)) is not None]
    if not inside:
        raise InputError(
            "flights to learn from", "at least one inside the map's domain", f"none of {count}"
        )
    g = _scaled(g, [x for x, _ in inside], [strike for _, (_, strike) in inside])
    both = [(x, of) for of in flights if (x := lift_strike(g, *of)) is not None]
    lifted = [x for x, _ in both]
    learned = learn_lifted(g.map, lifted, left_out=count - len(lifted), settings=settings)
    f, fit = learned.map, list[tuple[Flight, PaddleStrike]]()
    for x, of in both:
        motion = x.motion(project(f.alpha, f.H_inverse, x.phi_0, x.gap))
        if float(demand(g.arm, motion).shares.max()) <= _MOST:
            fit.append(of)
    return g, learned, fit


def _scaled(g: BattingMap, lifted: Sequence[Lifted], strikes: Sequence[PaddleStrike]) -> BattingMap:
    """Return the map with the variables of b scaled to what occurs, and the region of strikes."""
    design, q = g.map.design, np.array([x.q for x in strikes])
    i, c = design.free.index(design.catch_joint), design.catch_joint
    p = [x.virtual[:, 0, list(design.free)] for x in lifted]
    for rows, strike in zip(p, strikes, strict=True):
        rows[:, i] -= strike.q[c]
    every, region = np.concatenate(p), np.array([q.min(axis=0), q.max(axis=0)])
    middle = region.mean(axis=0)
    centre = 0.5 * (every.min(axis=0) + every.max(axis=0))
    centre[i] = 0.0
    scale = np.maximum(np.abs(every - centre).max(axis=0), _NARROWEST)
    centre[i] = middle[c]
    f = replace(
        g.map,
        design=replace(design, q_catch=float(middle[c])),
        region=region,
        q_rest=middle,
        basis=_basis(design, centre, scale),
    )
    return replace(g, map=f)
