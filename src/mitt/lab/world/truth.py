"""What really happens in the world, for scoring only: the catcher never gets it."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mitt.core.signals import TICK, Array
from mitt.lab.world.engine import (
    ARM_FLOOR,
    BALL_FLOOR,
    SELF,
    Plant,
    names_touching,
    survey,
    tip_velocity,
)


@dataclass(frozen=True, slots=True, eq=False)
class Instant:
    """Ball and catch point at one instant, as they truly are.

    Attributes:
        t: Time since release [s].
        r_o: Ball centre [m], shape (3,).
        dr_o: Its velocity [m/s], shape (3,).
        position: Catch point [m], shape (3,).
        velocity: Its velocity [m/s], shape (3,).
    """

    t: float
    r_o: Array
    dr_o: Array
    position: Array
    velocity: Array

    @property
    def position_error(self) -> float:
        """Distance of the ball's centre from the catch point [m]."""
        return float(np.linalg.norm(self.r_o - self.position))

    @property
    def velocity_error(self) -> float:
        """Size of the difference of their velocities [m/s]."""
        return float(np.linalg.norm(self.dr_o - self.velocity))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Truth(Instant):
    """True state of the whole plant at one instant.

    Attributes:
        q: Active joints [rad], shape (n,).
        dq: Their velocities [rad/s], shape (n,).
        tau: Torques applied in the last tick [N m], shape (n,).
        fingers: Closing angles of the fingers [rad], shape (f,).
        touching: Names of the geoms of the hand that touch the ball.
        contact_force: Largest single contact force on the ball in the last tick [N].
        self_contact: Whether arm or hand touched the arm in the last tick.
        floor_contact: Whether arm or hand touched the floor in the last tick.
        ball_on_floor: Whether the ball touched the floor in the last tick.
    """

    q: Array
    dq: Array
    tau: Array
    fingers: Array
    touching: frozenset[str]
    contact_force: float
    self_contact: bool
    floor_contact: bool
    ball_on_floor: bool


class Trace(NamedTuple):
    """True states of a trial of k - 1 ticks, a row at the release and one after each tick.

    Attributes:
        t: Time since release [s], shape (k,).
        qpos: Positions of the whole plant, shape (k, n + f + 7).
        qvel: Velocities of the whole plant, shape (k, n + f + 6).
        tau: Torques applied in the tick before [N m], shape (k, n).
        position: Catch point [m], shape (k, 3).
        velocity: Its velocity [m/s], shape (k, 3).
        force: Largest contact force on the ball in the tick before [N], shape (k,).
        seen: Contacts in the tick before, flags of :mod:`mitt.lab.world.engine`, shape (k,).
    """

    t: Array
    qpos: Array
    qvel: Array
    tau: Array
    position: Array
    velocity: Array
    force: Array
    seen: NDArray[np.int64]

    @property
    def q(self) -> Array:
        """Active joints [rad], shape (k, n)."""
        return self.qpos[:, : self.tau.shape[1]]

    @property
    def dq(self) -> Array:
        """Their velocities [rad/s], shape (k, n)."""
        return self.qvel[:, : self.tau.shape[1]]

    @property
    def r_o(self) -> Array:
        """Ball centre [m], shape (k, 3)."""
        return self.qpos[:, -7:-4]

    @property
    def dr_o(self) -> Array:
        """Its velocity [m/s], shape (k, 3)."""
        return self.qvel[:, -6:-3]


class TraceBuffer:
    """Room for a :class:`Trace`.

    Attributes:
        rows: The trace; rows not yet written hold nothing.
    """

    def __init__(self, nq: int, nv: int, joints: int, ticks: int = 2048) -> None:
        """Make room for so many ticks of a plant of so many numbers; it doubles when full."""
        k, seen = ticks, np.zeros(ticks, np.int64)
        t, qpos, qvel, tau, force = (np.empty(x) for x in (k, (k, nq), (k, nv), (k, joints), k))
        self.rows = Trace(t, qpos, qvel, tau, np.empty((k, 3)), np.empty((k, 3)), force, seen)

    def reserve(self, ticks: int) -> Trace:
        """Return the trace, grown to hold so many rows and more."""
        while ticks > len(self.rows.t):
            self.rows = Trace._make(np.concatenate((x, np.empty_like(x))) for x in self.rows)
        return self.rows

    def trace(self, ticks: int) -> Trace:
        """Return a copy of the first rows."""
        return Trace._make(x[:ticks].copy() for x in self.rows)


def truth_of(plant: Plant, *, names: tuple[str | None, ...], tau: Array) -> Truth:
    """Return the true state of a plant at the end of its last tick.

    Args:
        plant: The plant.
        names: As of :func:`mitt.lab.world.engine.hand_names`.
        tau: Torques applied in that tick [N m], shape (n,).
    """
    state, velocity, seen = plant.state, np.empty(3), int(plant.state["seen"][0])
    qpos, qvel, n, ball = plant.qpos.copy(), plant.qvel.copy(), len(plant.slides), len(plant.ctrl)
    survey(plant, False)
    tip_velocity(plant, velocity)
    return Truth(
        t=int(state["ticks"][0]) * TICK,
        r_o=qpos[ball : ball + 3],
        dr_o=qvel[ball : ball + 3],
        position=plant.place.copy(),
        velocity=velocity,
        q=qpos[:n],
        dq=qvel[:n],
        tau=tau,
        fingers=qpos[n:ball],
        touching=names_touching(names, plant.touching),
        contact_force=float(state["force"][0]),
        self_contact=bool(seen & SELF),
        floor_contact=bool(seen & ARM_FLOOR),
        ball_on_floor=bool(seen & BALL_FLOOR),
    )
