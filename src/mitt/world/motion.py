"""A tick of the plant: motors, MuJoCo's steps, contacts, the trace; compiled.

MuJoCo's integrator is of first order: in half a second of flight it puts a ball 1.2 mm (steps of
0.5 ms) or 2.5 mm (1 ms) too low. So a ball that touches nothing flies by the kernel of
:mod:`mitt.ball.flight`, independent of the length of the steps, and the integrator is given the
force and the start with which dr' = dr + h ddr, r' = r + h dr' end where that kernel does.

The state beside MuJoCo's own is one vector:

| place      | meaning                                                              | unit   |
|------------|----------------------------------------------------------------------|--------|
| TICKS      | ticks since release                                                  | 1      |
| STEPS      | simulation steps in the next tick                                    | 1      |
| SEEN       | contacts in the last tick, flags of :mod:`mitt.world.contacts`       | bits   |
| BROKEN     | whether the physics broke down, or a command was not finite          | 0, 1   |
| FORCE      | largest contact force on the ball in the last tick, and in the trial;| N      |
|            | of a hand without fingers the resultant of all its contacts          |        |
| TOUCHED    | time of the first contact of ball and hand; negative before          | s      |
| FIRST      | r_o, dr_o, position, velocity then, as in ``FirstContact``           | m, m/s |
| FLIGHT     | ball at the end of a step if it flies freely: position, velocity     | m, m/s |
| SURVEY     | scratch                                                              |        |
| BRAKED     | when the brakes were commanded to engage; negative before                 | s      |
| STOPPED    | when the catcher stopped; negative before                            | s      |
| SERVO      | the finger servo, as of :func:`mitt.world.drives.servo_numbers`       |        |
| MASS       | mass of the ball                                                     | kg     |
| DRAG       | drag coefficient of the ball                                         | 1/m    |
| FRICTION   | viscous, then dry friction of each joint                             | SI     |
| the rest   | the brakes, as in :mod:`mitt.world.brakes`                           |        |
"""

import numpy as np

from mitt.ball.flight import advance
from mitt.jit import kernel
from mitt.signals import GRAVITY, TICK, Array
from mitt.world.brakes import ROWS, hold
from mitt.world.build import STEP
from mitt.world.contacts import BALL_ANY, BALL_FLOOR, BALL_HAND, survey, tip_velocity
from mitt.world.drives import MEAN, actuate, command, follow
from mitt.world.engine import Plant, step1, step2

#: Simulation steps in a tick where a contact may begin; elsewhere one is enough.
FINE_STEPS = round(TICK / STEP)

TICKS, STEPS, SEEN, BROKEN, FORCE, PEAK, TOUCHED = range(7)
FIRST, FLIGHT, SURVEY, BRAKED, STOPPED = 7, 19, 25, 32, 33
SERVO, MASS, DRAG, FRICTION = 34, 38, 39, 40

#: How long a trial goes on after the catcher has stopped [s].
WATCHED = 3.0

#: No throw and no grip makes a ball this fast [m/s]; a contact that breaks down does.
TOP_SPEED = 30.0

#: No position, velocity or acceleration is so large (SI units); NaN is not below it.
HUGE = 1e8

#: A ball farther than this from the catch point touches no part of the hand within a tick [m]:
#: a fingertip of the default hand is 0.12 m away, the largest ball 0.06 m thick, and at 30 m/s
#: a tick is 0.03 m.
NEAR = 0.25

#: A ball at rest in the hand: so slow against the catch point [m/s], so long after the first
#: contact [s].
REST_SPEED, REST_AFTER = 0.2, 0.08


def fresh_motion(
    servo: tuple[float, ...], friction: Array, ball: tuple[float, float], brakes: Array
) -> Array:
    """Return the vector of the module's table at release.

    Args:
        servo: As of :func:`mitt.world.drives.servo_numbers`.
        friction: Viscous and dry friction of each joint, shape (2, n).
        ball: Mass [kg] and drag coefficient [1/m] of the ball.
        brakes: As of :func:`mitt.world.brakes.brake_numbers`.
    """
    state = np.concatenate([np.zeros(SERVO), servo, ball, friction.ravel(), brakes.ravel()])
    state[STEPS], state[TOUCHED], state[BRAKED], state[STOPPED] = 1.0, -1.0, -1.0, -1.0
    return state


@kernel
def note_stop(state: Array, brakes: bool, stopped: bool) -> None:
    """Note whether brakes are to engage, and whether the catcher has stopped.

    Args:
        state: As in the module's table.
        brakes: Of the command for the next tick.
        stopped: Whether the catcher has stopped: the trial then goes on for ``WATCHED``.
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
    """Take the command of a tick, torques [N m] and closing angle [rad]; forget old contacts."""
    plant.state[FORCE], plant.state[SEEN] = 0.0, 0.0
    command(plant.drives, int(plant.state[TICKS]), tau, hand)


@kernel
def _prepare(plant: Plant, h: float, alone: bool) -> None:
    """Write what acts in the second half of a step, in which positions are no longer read.

    Args:
        plant: The plant.
        h: Length of the step [s].
        alone: Whether nothing is touched, so that the ball can be made to fly exactly.
    """
    qpos, qvel, passive = plant.qpos, plant.qvel, plant.passive
    state, n = plant.state, len(plant.slides)
    flight, ball = state[FLIGHT : FLIGHT + 6], len(plant.ctrl)
    hand = follow(plant.drives, int(state[TICKS]), h)
    for i in range(3):
        flight[i], flight[3 + i] = qpos[ball + i], qvel[ball + i]
    advance(flight[:3], flight[3:], state[DRAG], h)
    if not actuate(
        qpos, qvel, plant.ctrl, passive, plant.drives[MEAN, :n], hand, state[SERVO:MASS],
        state[FRICTION:], state[DRAG] * state[MASS],
    ):  # fmt: skip
        state[BROKEN] = 1.0
    if alone:
        for i in range(3):
            weight = -GRAVITY if i == 2 else 0.0
            passive[ball + i] = state[MASS] * ((flight[3 + i] - qvel[ball + i]) / h - weight)
            qpos[ball + i] = flight[i] - h * flight[3 + i]
    if state[BRAKED] >= 0.0:
        since = state[TICKS] * TICK - state[BRAKED]
        hold(state[len(state) - ROWS * n :], since, qvel, plant.ctrl, passive, h)


@kernel
def leave(plant: Plant) -> None:
    """Make a step up to the new positions and velocities, with the torques of the drives."""
    state, alone, ball = plant.state, plant.contacts[0] == 0, len(plant.ctrl)
    _prepare(plant, TICK / state[STEPS], alone)
    step2(plant.address[0], plant.address[1])
    if alone:
        return
    largest = state[SURVEY : SURVEY + 7]
    largest[0] = state[FORCE]
    touched = survey(plant, True, largest)
    if len(plant.ctrl) == len(plant.slides):  # many cords share the force of a net: it is one thing
        x, y, z = plant.constraint[ball], plant.constraint[ball + 1], plant.constraint[ball + 2]
        largest[0] = max(largest[0], np.sqrt(x * x + y * y + z * z))
    state[FORCE], state[SEEN] = largest[0], int(state[SEEN]) | touched
    if not touched & BALL_ANY:
        for i in range(3):
            plant.qpos[ball + i] = state[FLIGHT + i]
            plant.qvel[ball + i] = state[FLIGHT + 3 + i]


@kernel
def arrive(plant: Plant, t: float) -> int:
    """Find what follows from the new state, at ``t`` [s], and note the first contact.

    Returns:
        Bits of what touches what, as long as the hand has not touched the ball before.
    """
    state, ball = plant.state, len(plant.ctrl)
    step1(plant.address[0], plant.address[1])
    if plant.contacts[0] == 0 or state[TOUCHED] >= 0.0:
        return 0
    touched = survey(plant, False, state[SURVEY : SURVEY + 7])
    state[SEEN] = int(state[SEEN]) | touched
    if touched & BALL_HAND:
        state[TOUCHED] = t
        for i in range(3):
            state[FIRST + i], state[FIRST + 3 + i] = plant.qpos[ball + i], plant.qvel[ball + i]
            state[FIRST + 6 + i] = plant.place[i]
        velocity = state[FIRST + 9 : FIRST + 12]
        tip_velocity(plant, velocity)
    return int(touched)


@kernel
def _is_sane(plant: Plant) -> bool:
    """Tell whether a state can be real; MuJoCo's own warnings come later, if they come."""
    for values in (plant.qpos, plant.qvel, plant.qacc):
        for x in values:
            if not abs(x) < HUGE:
                return False
    dr, ball = plant.qvel, len(plant.ctrl)
    square = dr[ball] ** 2 + dr[ball + 1] ** 2 + dr[ball + 2] ** 2
    return bool(square <= TOP_SPEED * TOP_SPEED)


@kernel
def note(plant: Plant, rows: Array) -> None:
    """Write the present state into the trace, judge it, and set the steps of the next tick.

    Args:
        plant: The plant.
        rows: The trace, one row a tick, in the order of ``Trace``.
    """
    state, ball, t = plant.state, len(plant.ctrl), plant.state[TICKS] * TICK
    row, k = rows[int(state[TICKS])], 1
    row[0] = t
    tau = plant.drives[MEAN, : len(plant.slides)]
    for column in (plant.qpos, plant.qvel, tau, plant.place):
        for i in range(column.shape[0]):
            row[k + i] = column[i]
        k += column.shape[0]
    velocity = row[k : k + 3]
    tip_velocity(plant, velocity)
    row[k + 3], row[k + 4] = state[FORCE], state[SEEN]
    state[PEAK] = max(state[FORCE], state[PEAK])
    gap, speed = 0.0, 0.0
    for i in range(3):
        gap += (plant.qpos[ball + i] - plant.place[i]) ** 2
        speed += (plant.qvel[ball + i] - velocity[i]) ** 2
    sane, touched = _is_sane(plant), state[TOUCHED] >= 0.0
    if not sane:
        state[BROKEN] = 1.0
    resting = touched and t - state[TOUCHED] > REST_AFTER and speed < REST_SPEED * REST_SPEED
    steps = 1 if not sane or gap > NEAR * NEAR or resting else FINE_STEPS
    if steps != state[STEPS]:
        state[STEPS], plant.step[0] = steps, TICK / steps


@kernel
def move(plant: Plant, tau: Array, hand: float, rows: Array) -> None:
    """Let the motors follow a command for one tick; see :func:`begin` and :func:`note`."""
    state = plant.state
    start, steps = state[TICKS] * TICK, int(state[STEPS])
    begin(plant, tau, hand)
    for step in range(1, steps + 1):
        leave(plant)
        arrive(plant, start + step * (TICK / steps))
    state[TICKS] += 1.0
    note(plant, rows)


@kernel
def over(state: Array, longest: float, held: float) -> bool:
    """Tell whether a trial is at its end.

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
