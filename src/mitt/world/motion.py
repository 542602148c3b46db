"""A tick of the plant: motors, MuJoCo's steps, contacts, the trace; one compiled call.

The state beside MuJoCo's own lies in one vector:

| place      | meaning                                                              | unit   |
|------------|----------------------------------------------------------------------|--------|
| TICKS      | ticks since release                                                  | 1      |
| STEPS      | simulation steps in the next tick                                    | 1      |
| SEEN       | contacts in the last tick, flags of :mod:`mitt.world.contacts`       | bits   |
| BROKEN     | whether the physics broke down, or a command was not finite          | 0, 1   |
| FORCE      | largest contact force on the ball in the last tick, and in the trial | N      |
| TOUCHED    | time of the first contact of ball and hand; negative before          | s      |
| FIRST      | r_o, dr_o, position, velocity then, as in ``FirstContact``           | m, m/s |
| FLIGHT     | ball at the end of a step if it flies freely: position, velocity     | m, m/s |
| SURVEY     | scratch                                                              |        |
| NUMBERS    | of the plant, as in :mod:`mitt.world.stepping`                       |        |
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mitt.signals import Array
from mitt.world.build import STEP
from mitt.world.contacts import BALL_ANY, BALL_FLOOR, BALL_HAND, survey
from mitt.world.engine import Views, step1, step2
from mitt.world.stepping import BROKEN as INSANE
from mitt.world.stepping import FINE, finish, prepare, tip_velocity

#: Control tick [s].
TICK = 0.001

#: Simulation steps in a tick where a contact may begin; else one will do.
FINE_STEPS = round(TICK / STEP)

TICKS, STEPS, SEEN, BROKEN, FORCE, PEAK, TOUCHED = range(7)
FIRST, FLIGHT, SURVEY, NUMBERS = 7, 19, 25, 32


def fresh_motion(numbers: Array) -> Array:
    """Return the vector of the module's table at release."""
    plant = np.zeros(NUMBERS + len(numbers))
    plant[STEPS], plant[TOUCHED], plant[NUMBERS:] = 1.0, -1.0, numbers
    return plant


@njit(cache=True)
def begin(plant: Array) -> None:
    """Forget the contacts of the tick before."""
    plant[FORCE], plant[SEEN] = 0.0, 0.0


@njit(cache=True)
def leave(
    views: Views,
    kinds: NDArray[np.int32],
    touching: NDArray[np.bool_],
    plant: Array,
    tau: Array,
    hand: float,
) -> None:
    """Make a step up to the new positions and velocities.

    Args:
        views: As of :func:`mitt.world.engine.views_of`.
        kinds: Kind of each geom, shape (g,).
        touching: Result, whether a geom touches the ball, shape (g,).
        plant: As in the module's table.
        tau: Commanded torques of the arm [N m], shape (n,).
        hand: Commanded closing angle [rad].
    """
    address, qpos, qvel, ctrl, passive = views[0], views[4], views[5], views[6], views[7]
    flight, alone = plant[FLIGHT : FLIGHT + 6].reshape(2, 3), views[1][0] == 0
    h = TICK / plant[STEPS]
    if not prepare(qpos, qvel, ctrl, passive, tau, hand, plant[NUMBERS:], h, alone, flight):
        plant[BROKEN] = 1.0
    step2(address[0], address[1])
    if alone:
        return
    largest = plant[SURVEY : SURVEY + 7]
    largest[0] = plant[FORCE]
    touched = survey(views, kinds, touching, True, largest)
    plant[FORCE], plant[SEEN] = largest[0], int(plant[SEEN]) | touched
    if not touched & BALL_ANY:
        ball = ctrl.shape[0]
        for i in range(3):
            qpos[ball + i], qvel[ball + i] = flight[0, i], flight[1, i]


@njit(cache=True)
def arrive(
    views: Views,
    kinds: NDArray[np.int32],
    touching: NDArray[np.bool_],
    plant: Array,
    t: float,
) -> int:
    """Find what follows from the new state, at ``t`` [s], and note the first contact.

    See :func:`leave` for the rest.

    Returns:
        Bits of what touches what, as long as the hand has not touched the ball before.
    """
    address, qpos, qvel, ball = views[0], views[4], views[5], views[6].shape[0]
    step1(address[0], address[1])
    if views[1][0] == 0 or plant[TOUCHED] >= 0.0:
        return 0
    touched = survey(views, kinds, touching, False, plant[SURVEY : SURVEY + 7])
    plant[SEEN] = int(plant[SEEN]) | touched
    if touched & BALL_HAND:
        plant[TOUCHED] = t
        for i in range(3):
            plant[FIRST + i], plant[FIRST + 3 + i] = qpos[ball + i], qvel[ball + i]
            plant[FIRST + 6 + i] = views[9][i]
        tip_velocity(views[9], views[10], views[11], views[12], qvel, plant[FIRST + 9 : FIRST + 12])
    return int(touched)


@njit(cache=True)
def note(views: Views, plant: Array, tau: Array, rows: Array) -> None:
    """Write the present state into the trace, judge it, and set the steps of the next tick.

    Args:
        views: As of :func:`mitt.world.engine.views_of`.
        plant: As in the module's table.
        tau: Torques in the last tick [N m], shape (n,).
        rows: The trace, one row a tick, in the order of ``Trace``.
    """
    t = plant[TICKS] * TICK
    judged = finish(
        rows,
        int(plant[TICKS]),
        int(plant[SEEN]),
        t,
        views[4],
        views[5],
        views[8],
        tau,
        views[9],
        views[10],
        views[11],
        views[12],
        plant[FORCE : FORCE + 2],
        -1.0 if plant[TOUCHED] < 0.0 else t - plant[TOUCHED],
    )
    if judged == INSANE:
        plant[BROKEN] = 1.0
    steps = FINE_STEPS if judged == FINE else 1
    if steps != plant[STEPS]:
        plant[STEPS], views[3][0] = steps, TICK / steps


@njit(cache=True)
def move(
    views: Views,
    kinds: NDArray[np.int32],
    touching: NDArray[np.bool_],
    plant: Array,
    tau: Array,
    hand: float,
    rows: Array,
) -> None:
    """Let the motors follow a command for one tick; see :func:`leave` and :func:`note`."""
    start, steps = plant[TICKS] * TICK, int(plant[STEPS])
    begin(plant)
    for step in range(1, steps + 1):
        leave(views, kinds, touching, plant, tau, hand)
        arrive(views, kinds, touching, plant, start + step * (TICK / steps))
    plant[TICKS] += 1.0
    note(views, plant, tau, rows)


@njit(cache=True)
def over(plant: Array, longest: float, held: float) -> bool:
    """Say whether a trial is at its end.

    Args:
        plant: As in the module's table.
        longest: Time at which a trial without contact ends [s]; or when the ball is on the floor.
        held: How long a trial goes on after the first contact [s].
    """
    t = plant[TICKS] * TICK
    if plant[BROKEN] > 0.0:
        return True
    if plant[TOUCHED] >= 0.0:
        return bool(t >= plant[TOUCHED] + held)
    return bool(t >= longest or int(plant[SEEN]) & BALL_FLOOR)
