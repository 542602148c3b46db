"""What a simulation step needs from us before it and after it: one compiled call each.

MuJoCo's integrator is of first order: in half a second of flight it puts a ball 1.2 mm (steps of
0.5 ms) or 2.5 mm (1 ms) too low. So a ball that touches nothing flies by the kernel of
:mod:`mitt.flight`, and then its flight does not depend on the length of the steps. The integrator
is led there: dr' = dr + h ddr, r' = r + h dr' end where the kernel does for the right force and
the right start.

Numbers of a plant, packed: four of the finger servo, mass [kg] and drag coefficient [1/m] of the
ball, then viscous and dry friction of each joint.
"""

import numpy as np
from numpy.typing import NDArray

from mitt.flight import GRAVITY, advance
from mitt.jit import kernel
from mitt.signals import Array
from mitt.views import lent
from mitt.world.contacts import is_sane
from mitt.world.servo import actuate

#: Result of :func:`finish`: the state cannot be real, or how the next tick is to be stepped.
BROKEN, COARSE, FINE = 0, 1, 2

#: No throw and no grip makes a ball this fast [m/s]; a contact that breaks down does.
TOP_SPEED = 30.0

#: A ball farther than this from the catch point touches no part of the hand within a tick [m]:
#: a fingertip of the default hand is 0.12 m away, the largest ball 0.06 m thick, and at 30 m/s
#: a tick is 0.03 m.
NEAR = 0.25

#: A ball at rest in the hand: so slow against the catch point [m/s], so long after the first
#: contact [s].
REST_SPEED, REST_AFTER = 0.2, 0.08


def pack_plant(
    servo: tuple[float, ...], friction: Array, drag_force: float, ball_mass: float
) -> Array:
    """Return the numbers of a plant in the order of the module's text.

    Args:
        servo: As of :func:`mitt.world.servo.servo_numbers`.
        friction: Viscous and dry friction of each joint, shape (2, n).
        drag_force: Force per squared speed of the ball [N s^2/m^2].
        ball_mass: Mass of the ball [kg].
    """
    return np.array([*servo, ball_mass, drag_force / ball_mass, *friction.ravel()])


@kernel
def prepare(
    qpos: Array,
    qvel: Array,
    ctrl: Array,
    passive: Array,
    tau: Array,
    hand: float,
    plant: Array,
    h: float,
    lead: bool,
    flight: Array,
) -> bool:
    """Write what acts in the second half of a step, in which positions are no longer read.

    Args:
        qpos: Positions of the plant, shape (n + f + 7,).
        qvel: Velocities of the plant, shape (n + f + 6,).
        ctrl: Result, motor torques [N m], shape (n + f,).
        passive: Result, friction and drag [N m, N], shape (n + f + 6,).
        tau: Commanded torques of the arm [N m], shape (n,).
        hand: Commanded closing angle [rad].
        plant: Numbers of the plant, shape (6 + 2 n,).
        h: Length of the step [s].
        lead: Whether nothing is touched, so that the ball can be led along its flight.
        flight: Result, position and velocity of a ball that flies freely, at the end of the
            step, shape (6,).

    Returns:
        Whether the command was finite.
    """
    qpos, qvel, ctrl, passive = lent((qpos, qvel, ctrl, passive))
    tau, plant, flight = lent((tau, plant, flight))
    ball, mass, drag = ctrl.shape[0], plant[4], plant[5]
    for i in range(3):
        flight[i], flight[3 + i] = qpos[ball + i], qvel[ball + i]
    advance(flight[:3], flight[3:], drag, h)
    finite = actuate(qpos, qvel, ctrl, passive, tau, hand, plant[:4], plant[6:], drag * mass)
    if lead:
        for i in range(3):
            weight = -GRAVITY if i == 2 else 0.0
            passive[ball + i] = mass * ((flight[3 + i] - qvel[ball + i]) / h - weight)
            qpos[ball + i] = flight[i] - h * flight[3 + i]
    return bool(finite)


@kernel
def tip_velocity(
    place: Array, anchor: Array, axis: Array, slides: NDArray[np.bool_], dq: Array, out: Array
) -> None:
    """Write the velocity of a point of the last link of a serial arm.

    Args:
        place: The point in the world [m], shape (3,).
        anchor: A point on each joint's axis [m], shape (>= n, 3).
        axis: Unit axes of the joints in the world, shape (>= n, 3).
        slides: Whether a joint is prismatic, shape (n,).
        dq: Joint velocities [rad/s, m/s], shape (>= n,).
        out: Result [m/s], shape (3,).
    """
    place, anchor, axis, slides, dq, out = lent((place, anchor, axis, slides, dq, out))
    out[:] = 0.0
    for i in range(slides.shape[0]):
        ax, ay, az = axis[i, 0], axis[i, 1], axis[i, 2]
        if slides[i]:
            x, y, z = ax, ay, az
        else:
            rx, ry, rz = place[0] - anchor[i, 0], place[1] - anchor[i, 1], place[2] - anchor[i, 2]
            x, y, z = ay * rz - az * ry, az * rx - ax * rz, ax * ry - ay * rx
        out[0] += dq[i] * x
        out[1] += dq[i] * y
        out[2] += dq[i] * z


@kernel
def finish(
    rows: Array,
    index: int,
    seen: int,
    t: float,
    qpos: Array,
    qvel: Array,
    qacc: Array,
    tau: Array,
    place: Array,
    anchor: Array,
    axis: Array,
    slides: NDArray[np.bool_],
    peaks: Array,
    since: float,
) -> int:
    """Write one tick into a row of the tape, in the order of ``Trace``, and judge the state.

    Args:
        rows: Result, in one of its rows, shape (ticks, w).
        index: Which of them.
        seen: Contacts in this tick, flags of :mod:`mitt.world.contacts`.
        t: Time since release [s].
        qpos: Positions of the plant, shape (n + f + 7,).
        qvel: Velocities of the plant, shape (n + f + 6,).
        qacc: Accelerations of the plant, shape (n + f + 6,).
        tau: Torques applied [N m], shape (n,).
        place: Catch point [m], shape (3,).
        anchor: As for :func:`tip_velocity`.
        axis: As for :func:`tip_velocity`.
        slides: As for :func:`tip_velocity`.
        peaks: Largest contact force on the ball in this tick, and in the trial, which it raises
            [N], shape (2,).
        since: Time since the first contact [s]; negative before it.

    Returns:
        BROKEN, COARSE or FINE.
    """
    qpos, qvel, qacc, tau, place = lent((qpos, qvel, qacc, tau, place))
    row, peaks, k = lent(rows)[index], lent(peaks), 1
    row[0] = t
    for column in (qpos, qvel, tau, place):
        for i in range(column.shape[0]):
            row[k + i] = column[i]
        k += column.shape[0]
    velocity = row[k : k + 3]
    tip_velocity(place, anchor, axis, slides, qvel, velocity)
    row[k + 3], row[k + 4] = peaks[0], seen
    peaks[1] = max(peaks[0], peaks[1])
    ball = qvel.shape[0] - 6
    if not is_sane(qpos, qvel, qacc, ball, TOP_SPEED):
        return BROKEN
    gap, speed = 0.0, 0.0
    for i in range(3):
        gap += (qpos[ball + i] - place[i]) ** 2
        speed += (qvel[ball + i] - velocity[i]) ** 2
    if gap > NEAR * NEAR or (since > REST_AFTER and speed < REST_SPEED * REST_SPEED):
        return COARSE
    return FINE
