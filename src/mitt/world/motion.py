"""A tick of the plant: motors, MuJoCo's steps, contacts, the trace; one compiled call.

A plant is one flat tuple: what :func:`mitt.world.engine.views_of` shows, the kind of each geom
(KINDS), scratch for which of them touch the ball (TOUCHING), the state beside MuJoCo's own (STATE)
in one vector, and what :mod:`mitt.world.clearing` needs: MuJoCo's switches (SWITCHES), centres and
axes of the geoms (CENTRES, AXES) and its three tables (PAIRS, JOINTS, MEASURED); last, the drives
between commands and torques (DRIVES) as of :mod:`mitt.world.drives`. Each kernel has it lent, so
that it counts no references to what it takes out.

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
| BRAKED     | when the brakes were told to engage; negative before                 | s      |
| STOPPED    | when the catcher stopped, after which is watched on; negative before | s      |
| NUMBERS    | of the plant, as in :mod:`mitt.world.stepping`                       |        |
| the rest   | the brakes, as in :mod:`mitt.world.brakes`                           |        |
"""

from typing import TypeAlias

import numpy as np

from mitt.jit import kernel
from mitt.signals import Array
from mitt.views import lent
from mitt.world.brakes import ROWS, hold
from mitt.world.build import STEP
from mitt.world.clearing import OFF, is_clear
from mitt.world.contacts import BALL_ANY, BALL_FLOOR, BALL_HAND, survey
from mitt.world.drives import MEAN, command, follow
from mitt.world.engine import Views, step1, step2
from mitt.world.stepping import BROKEN as INSANE
from mitt.world.stepping import FINE, finish, prepare, tip_velocity

Plant: TypeAlias = Views

KINDS, TOUCHING, STATE = 13, 14, 15
SWITCHES, CENTRES, AXES, PAIRS, JOINTS, MEASURED, DRIVES = 16, 17, 18, 19, 20, 21, 22

#: Control tick [s].
TICK = 0.001

#: Simulation steps in a tick where a contact may begin; else one will do.
FINE_STEPS = round(TICK / STEP)

TICKS, STEPS, SEEN, BROKEN, FORCE, PEAK, TOUCHED = range(7)
FIRST, FLIGHT, SURVEY, BRAKED, STOPPED, NUMBERS = 7, 19, 25, 32, 33, 34

#: How long a trial goes on after the catcher has stopped [s].
WATCHED = 3.0


def fresh_motion(numbers: Array, brakes: Array) -> Array:
    """Return the vector of the module's table at release."""
    state = np.concatenate([np.zeros(NUMBERS), numbers, brakes.ravel()])
    state[STEPS], state[TOUCHED], state[BRAKED], state[STOPPED] = 1.0, -1.0, -1.0, -1.0
    return state


@kernel
def tell(state: Array, brakes: bool, stopped: bool) -> None:
    """Tell the plant whether brakes are to engage, for good, and whether the catcher has stopped.

    Args:
        state: As in the module's table.
        brakes: Of the command for the next tick.
        stopped: Whether the catcher has stopped: the trial is watched on.
    """
    t = state[TICKS] * TICK
    if brakes and state[BRAKED] < 0.0:
        state[BRAKED] = t
    if not brakes:
        state[BRAKED] = -1.0
    if stopped and state[STOPPED] < 0.0:
        state[STOPPED] = t


@kernel
def begin(plant: Plant, tau: Array, hand: float) -> None:
    """Take the command of a tick, and forget the contacts of the tick before.

    Args:
        plant: As in the module's text.
        tau: Commanded torques of the arm [N m], shape (n,).
        hand: Commanded closing angle [rad].
    """
    plant = lent(plant)
    state = plant[STATE]
    state[FORCE], state[SEEN] = 0.0, 0.0
    command(plant[DRIVES], int(state[TICKS]), tau, hand)


@kernel
def leave(plant: Plant) -> None:
    """Make a step up to the new positions and velocities, with the torques of the drives."""
    plant = lent(plant)
    address, qpos, qvel, ctrl, passive = plant[0], plant[4], plant[5], plant[6], plant[7]
    kinds, touching, state = plant[KINDS], plant[TOUCHING], plant[STATE]
    flight, alone = state[FLIGHT : FLIGHT + 6], plant[1][0] == 0
    h = TICK / state[STEPS]
    hand = follow(plant[DRIVES], int(state[TICKS]), h)
    tau = plant[DRIVES][MEAN, : len(plant[12])]
    if not prepare(qpos, qvel, ctrl, passive, tau, hand, state[NUMBERS:], h, alone, flight):
        state[BROKEN] = 1.0
    if state[BRAKED] >= 0.0:
        n = len(plant[12])
        since = state[TICKS] * TICK - state[BRAKED]
        hold(state[len(state) - ROWS * n :], since, qvel, ctrl, passive, h)
    step2(address[0], address[1])
    if alone:
        return
    largest = state[SURVEY : SURVEY + 7]
    largest[0] = state[FORCE]
    touched = survey(plant, kinds, touching, True, largest)
    state[FORCE], state[SEEN] = largest[0], int(state[SEEN]) | touched
    if not touched & BALL_ANY:
        ball = ctrl.shape[0]
        for i in range(3):
            qpos[ball + i], qvel[ball + i] = flight[i], flight[3 + i]


@kernel
def arrive(plant: Plant, t: float) -> int:
    """Find what follows from the new state, at ``t`` [s], and note the first contact.

    Returns:
        Bits of what touches what, as long as the hand has not touched the ball before.
    """
    plant = lent(plant)
    address, qpos, qvel, ball = plant[0], plant[4], plant[5], plant[6].shape[0]
    kinds, touching, state = plant[KINDS], plant[TOUCHING], plant[STATE]
    step1(address[0], address[1])
    if plant[1][0] == 0 or state[TOUCHED] >= 0.0:
        return 0
    touched = survey(plant, kinds, touching, False, state[SURVEY : SURVEY + 7])
    state[SEEN] = int(state[SEEN]) | touched
    if touched & BALL_HAND:
        state[TOUCHED] = t
        for i in range(3):
            state[FIRST + i], state[FIRST + 3 + i] = qpos[ball + i], qvel[ball + i]
            state[FIRST + 6 + i] = plant[9][i]
        tip_velocity(plant[9], plant[10], plant[11], plant[12], qvel, state[FIRST + 9 : FIRST + 12])
    return int(touched)


@kernel
def note(plant: Plant, rows: Array) -> None:
    """Write the present state into the trace, judge it, and set the steps of the next tick.

    Args:
        plant: As in the module's text.
        rows: The trace, one row a tick, in the order of ``Trace``.
    """
    plant, rows = lent(plant), lent(rows)
    state, tau = plant[STATE], plant[DRIVES][MEAN, : len(plant[12])]
    t = state[TICKS] * TICK
    judged = finish(
        rows,
        int(state[TICKS]),
        int(state[SEEN]),
        t,
        plant[4],
        plant[5],
        plant[8],
        tau,
        plant[9],
        plant[10],
        plant[11],
        plant[12],
        state[FORCE : FORCE + 2],
        -1.0 if state[TOUCHED] < 0.0 else t - state[TOUCHED],
    )
    if judged == INSANE:
        state[BROKEN] = 1.0
    steps = FINE_STEPS if judged == FINE else 1
    if steps != state[STEPS]:
        state[STEPS], plant[3][0] = steps, TICK / steps
    _switch(plant)


@kernel
def _switch(plant: Plant) -> None:
    """Switch contacts and stops off for the next tick if there can be none, else on."""
    plant = lent(plant)
    switches, joints = plant[SWITCHES], plant[JOINTS]
    off = switches[0] | OFF
    if plant[STATE][TOUCHED] < 0.0 and is_clear(
        plant[4], plant[5], plant[CENTRES], plant[AXES], plant[PAIRS], joints, plant[MEASURED],
        TICK, len(plant[12]),
    ):  # fmt: skip
        switches[0] = off
    else:
        switches[0] = off - OFF


@kernel
def move(plant: Plant, tau: Array, hand: float, rows: Array) -> None:
    """Let the motors follow a command for one tick; see :func:`leave` and :func:`note`."""
    plant, tau, rows = lent(plant), lent(tau), lent(rows)
    state = plant[STATE]
    start, steps = state[TICKS] * TICK, int(state[STEPS])
    begin(plant, tau, hand)
    for step in range(1, steps + 1):
        leave(plant)
        arrive(plant, start + step * (TICK / steps))
    state[TICKS] += 1.0
    note(plant, rows)


@kernel
def over(state: Array, longest: float, held: float) -> bool:
    """Say whether a trial is at its end; one whose catcher stopped is watched for a while.

    Args:
        state: As in the module's table.
        longest: Time at which a trial without contact ends [s]; or when the ball is on the floor.
        held: How long a trial goes on after the first contact [s].
    """
    t = state[TICKS] * TICK
    if state[BROKEN] > 0.0:
        return True
    if state[STOPPED] >= 0.0:
        return bool(t >= state[STOPPED] + WATCHED)
    if state[TOUCHED] >= 0.0:
        return bool(t >= state[TOUCHED] + held)
    return bool(t >= longest or int(state[SEEN]) & BALL_FLOOR)
