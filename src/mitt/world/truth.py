"""What really happens in the world, for scoring only: the catcher never gets it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mitt.signals import TICK, Array
from mitt.world import contacts, motion
from mitt.world.engine import Plant


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Truth:
    """True state of the plant at one instant.

    Attributes:
        t: Time since release [s].
        r_o: Ball centre [m], shape (3,).
        dr_o: Its velocity [m/s], shape (3,).
        position: Catch point l(q) of the plant [m], shape (3,).
        velocity: Its velocity [m/s], shape (3,).
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

    t: float
    r_o: Array
    dr_o: Array
    position: Array
    velocity: Array
    q: Array
    dq: Array
    tau: Array
    fingers: Array
    touching: frozenset[str]
    contact_force: float
    self_contact: bool
    floor_contact: bool
    ball_on_floor: bool


@dataclass(frozen=True, slots=True, eq=False)
class FirstContact:
    """True state at the first simulation step in which the ball touches the hand.

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
class Trace:
    """True states of a trial, one row a tick, the first at release.

    Attributes:
        t: Time since release [s], shape (k,).
        qpos: Positions of the whole plant, shape (k, n + f + 7).
        qvel: Velocities of the whole plant, shape (k, n + f + 6).
        tau: Torques applied in the tick before [N m], shape (k, n).
        position: Catch point [m], shape (k, 3).
        velocity: Its velocity [m/s], shape (k, 3).
        force: Largest contact force on the ball in the tick before [N], shape (k,).
        seen: Contacts in the tick before, flags of :mod:`mitt.world.contacts`, shape (k,).
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
    """A table behind a :class:`Trace`, one row a tick.

    Attributes:
        rows: The table; rows not yet written hold nothing.
    """

    def __init__(self, widths: tuple[int, ...], ticks: int = 2048) -> None:
        """Make a table of columns so wide for so many ticks; it doubles when full."""
        ends = np.cumsum(widths).tolist()
        self._columns = [slice(end - width, end) for end, width in zip(ends, widths, strict=True)]
        self.rows: Array = np.empty((ticks, ends[-1]))

    def reserve(self, ticks: int) -> Array:
        """Return the table, grown to hold so many rows and more."""
        while ticks > len(self.rows):
            self.rows = np.concatenate((self.rows, np.empty_like(self.rows)))
        return self.rows

    def trace(self, ticks: int) -> Trace:
        """Return a copy of the first rows."""
        rows = self.rows[:ticks].copy()
        columns = [rows[:, column] for column in self._columns]
        t, qpos, qvel, tau, position, velocity, force, seen = columns
        return Trace(
            t=t[:, 0],
            qpos=qpos,
            qvel=qvel,
            tau=tau,
            position=position,
            velocity=velocity,
            force=force[:, 0],
            seen=seen[:, 0].astype(np.int64),
        )

    def last(self, tick: int, *, column: int) -> Array:
        """Return a copy of one column of the row of a tick."""
        return self.rows[tick, self._columns[column]].copy()


def truth_of(plant: Plant, *, names: tuple[str | None, ...], tau: Array) -> Truth:
    """Return the true state of a plant at the end of its last tick.

    Args:
        plant: The plant.
        names: As of :func:`mitt.world.contacts.hand_names`.
        tau: Torques applied in that tick [N m], shape (n,).
    """
    state, velocity = plant.state, np.empty(3)
    qpos, qvel, seen = plant.qpos.copy(), plant.qvel.copy(), int(state[motion.SEEN])
    contacts.survey(plant, False, np.zeros(7))
    contacts.tip_velocity(plant, velocity)
    n, ball = len(plant.slides), len(plant.ctrl)
    return Truth(
        t=state.item(motion.TICKS) * TICK,
        r_o=qpos[ball : ball + 3],
        dr_o=qvel[ball : ball + 3],
        position=plant.place.copy(),
        velocity=velocity,
        q=qpos[:n],
        dq=qvel[:n],
        tau=tau,
        fingers=qpos[n:ball],
        touching=contacts.names_touching(names, plant.touching),
        contact_force=state.item(motion.FORCE),
        self_contact=bool(seen & contacts.SELF),
        floor_contact=bool(seen & contacts.ARM_FLOOR),
        ball_on_floor=bool(seen & contacts.BALL_FLOOR),
    )
