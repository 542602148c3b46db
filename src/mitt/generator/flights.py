"""Flights as the learner and the verdict see them: the ball's motion at a few instants.

| here     | meaning                                  | unit           | shape      |
|----------|------------------------------------------|----------------|------------|
| ``t``    | instants from t_0 to a little past t_c   | s              | (K,)       |
| ``ball`` | r_o, dr_o, ddr_o at each                 | m, m/s, m/s^2  | (K, 3, 3)  |
| ``seen`` | the same at t_0, as the filter believed  | m, m/s, m/s^2  | (3, 3)     |
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mitt import checks
from mitt.fields import brief
from mitt.generator.constraints import initial_gap
from mitt.generator.coordinates import coordinates
from mitt.generator.evaluation import root_time
from mitt.generator.mapping import DirectMap
from mitt.signals import Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Flight:
    """One flight to learn from or to judge."""

    t: Array
    ball: Array
    seen: Array

    __repr__ = brief

    def __post_init__(self) -> None:
        """Hold the arrays to each other."""
        t = checks.array("t", self.t, (None,), finite=True)
        ball = checks.array("ball", self.ball, (len(t), 3, 3))
        fields = {"t": t, "ball": ball, "seen": checks.array("seen", self.seen, (3, 3))}
        for name, value in fields.items():
            object.__setattr__(self, name, value)


#: Farthest from its end that the catch of a flight is looked for [s].
_NEAR_CATCH = 0.05


class Lifted(NamedTuple):
    """A flight in virtual joints: all that q_d along it depends on besides alpha."""

    virtual: Array  # (K, 3, n) q_o, dq_o, ddq_o
    phi: Array  # (K, 3, m) monomials and their two time derivatives
    phi_0: Array  # (2, m) monomials and their rate at t_0
    gap: Array  # (2n,) d of eq. (12) for an arm at rest in its ready pose
    relative: Array  # (3,) velocity of the ball relative to the hand at the catch, alpha = 0 [m/s]
    slope: Array  # (3, m n) of that in alpha; (0,) and (0, m n) where the map does not weigh it

    def motion(self, alpha: Array) -> Array:
        """Return q_d, dq_d, ddq_d along the flight, shape (K, 3, n)."""
        out: Array = self.virtual + self.phi @ alpha
        return out

    def relative_velocity(self, alpha: Array) -> Array:
        """Return the velocity of the ball relative to the hand at the catch [m/s], shape (3,)."""
        out: Array = self.relative + self.slope @ alpha.ravel()
        return out


def lift_flight(f: DirectMap, flight: Flight) -> Lifted | None:
    """Return the flight in virtual joints; None where it leaves the domain of l_c^-1."""
    rows = [f.virtual(ball) for ball in (flight.seen, *flight.ball)]
    if not all(inside for inside, _ in rows):
        return None
    virtual = np.array([row for _, row in rows])
    phi = np.array([f.basis.jets(*coordinates(f.tangent, row)) for row in virtual])
    gap = initial_gap(f.arm.q_ready, np.zeros(f.arm.n), virtual[0])
    return Lifted(virtual[1:], phi[1:], phi[0, :2], gap, *_met(f, flight, virtual[-1]))


def _met(f: DirectMap, flight: Flight, last: Array) -> tuple[Array, Array]:
    """Return the relative velocity at the catch [m/s], (3,), and its slope in alpha, (3, m n).

    There b vanishes, so the pose is l_c^-1(r_o), and the velocity of the hand is linear in alpha.
    Nothing where the map does not weigh it, or where the flight ends far from its catch.

    Args:
        f: The map.
        flight: The flight, which ends a little past the catch.
        last: Virtual joints and two derivatives at its end, shape (3, n).
    """
    size = f.alpha.size
    nothing = np.zeros(0), np.zeros((0, size))
    if f.design.match_weight == 0.0:
        return nothing
    s, ds, dds = coordinates(f.tangent, last)[:, f.tangent.catch] - [f.design.q_catch, 0.0, 0.0]
    after, before = root_time(s, ds, dds), root_time(s, -ds, dds)
    dt, (r, dr, ddr) = after if after < before else -before, flight.ball[-1]
    if not abs(dt) <= _NEAR_CATCH:
        return nothing
    ball = np.array([r + dt * dr + 0.5 * dt * dt * ddr, dr + dt * ddr, ddr])
    inside, rows = f.virtual(ball)
    if not inside:
        return nothing
    J = f.arm.jacobian(rows[0])
    rate = f.basis.jets(*coordinates(f.tangent, rows))[1]
    slope = -np.einsum("cj,a->caj", J, rate).reshape(3, size)
    return ball[1] - J @ rows[1], slope
