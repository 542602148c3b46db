"""A tick of the plant: motors, MuJoCo's steps, contacts, the trace; compiled.

MuJoCo's integrator is of first order: in half a second of flight it puts a ball 1.2 mm (steps of
0.5 ms) or 2.5 mm (1 ms) too low. So a ball that touches nothing flies by the kernel of
:mod:`mitt.core.ball.flight`, independent of the length of the steps, and the integrator is given
the force and the start with which dr' = dr + h ddr, r' = r + h dr' end where that kernel does.

A ball that spins has its lift in that flight. While it touches anything its lift is left out.

A ball that follows a path is moved along it by force, from the positions and velocities at the
ends of the ticks (:mod:`mitt.lab.world.prescribed`), until it first touches anything.
"""

import numpy as np

from mitt.core.arm.kinematics import Vec
from mitt.core.ball.flight import STILL, Lift, advance_spinning
from mitt.core.kernels import Record, big_kernel, kernel
from mitt.core.signals import GRAVITY, TICK, Array
from mitt.lab.world.drives import command, finger_torque, follow, hold
from mitt.lab.world.engine import (
    BALL_ANY,
    BALL_FLOOR,
    BALL_HAND,
    Plant,
    moved_by,
    step1,
    step2,
    survey,
    tip_velocity,
)
from mitt.lab.world.rubber import bend_on, face_normal, set_damping
from mitt.lab.world.truth import Trace

#: How long a trial goes on after the catcher has stopped [s].
WATCHED = 3.0

#: Speed at which dry friction is three quarters of its full size [rad/s]; a sharp step would
#: chatter at 0.5 ms.
STICTION_SPEED = 0.05

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
REST_SPEED = 0.2
REST_AFTER = 0.08


@big_kernel
def move_motors(plant: Plant, tau: Array, hand: float, trace: Trace, path: Array) -> None:
    """Let the motors follow a command for one tick.

    Args:
        plant: The plant.
        tau: Torques commanded [N m], shape (n,).
        hand: Closing angle commanded [rad].
        trace: The trace, a row of which is written.
        path: Position and velocity of the ball at the start of each tick [m, m/s], shape
            (k, 2, 3), up to the end of this one; read where ``state.prescribed`` is set.
    """
    state = plant.state[0]
    start, steps = state.ticks * TICK, state.steps
    begin(plant, tau, hand)
    for step in range(1, steps + 1):
        leave(plant)
        if state.prescribed:
            _prescribe(plant, path[state.ticks], path[state.ticks + 1], step / steps)
        if arrive(plant, start + step * (TICK / steps)) & BALL_ANY:
            state.prescribed = False
    state.ticks += 1
    note_state(plant, trace)


@kernel
def _prescribe(plant: Plant, before: Array, after: Array, share: float) -> None:
    """Put the ball where its path is after a share of a tick: a cubic between the tick's ends."""
    ball, s = len(plant.ctrl), share
    for i in range(3):
        r, dr, way = before[0, i], TICK * before[1, i], after[0, i] - before[0, i]
        bend = 3.0 * way - 2.0 * dr - TICK * after[1, i]
        twist = dr + TICK * after[1, i] - 2.0 * way
        plant.qpos[ball + i] = after[0, i] if s == 1.0 else r + s * (dr + s * (bend + s * twist))
        plant.qvel[ball + i] = (
            after[1, i] if s == 1.0 else (dr + s * (2.0 * bend + 3.0 * s * twist)) / TICK
        )


@kernel
def begin(plant: Plant, tau: Array, hand: float) -> None:
    """Take the command of a tick, torques [N m] and closing angle [rad]; forget old contacts."""
    state = plant.state[0]
    state.force, state.seen = 0.0, 0
    command(plant.drives, state.ticks, tau, hand)


@kernel
def leave(plant: Plant) -> None:
    """Make a step up to the new positions and velocities, with the torques of the drives."""
    state, alone, ball = plant.state[0], plant.contacts[0] == 0, len(plant.ctrl)
    _prepare(plant, TICK / state.steps, alone)
    step2(plant.address[0], plant.address[1])
    if alone:
        return
    touched, force = survey(plant, True)
    state.pressing = force
    x, y, z = plant.constraint[ball], plant.constraint[ball + 1], plant.constraint[ball + 2]
    resultant = np.sqrt(x * x + y * y + z * z)
    state.force = max(state.force, force)
    if len(plant.ctrl) == len(plant.slides):  # many cords share the force of a net: it is one thing
        state.force = max(state.force, resultant)
    if touched & BALL_HAND:
        state.load = max(state.load, force, resultant)
    state.seen |= touched
    if not touched & BALL_ANY:
        for i in range(3):
            plant.qpos[ball + i] = plant.flight[0, i]
            plant.qvel[ball + i] = plant.flight[1, i]


@kernel
def _prepare(plant: Plant, h: float, alone: bool) -> None:
    """Write what acts in the second half of a step, in which positions are no longer read.

    Args:
        plant: The plant.
        h: Length of the step [s].
        alone: Whether nothing is touched, so that the ball can be made to fly exactly.
    """
    qpos, qvel, passive, flight = plant.qpos, plant.qvel, plant.passive, plant.flight
    state, ball = plant.state[0], len(plant.ctrl)
    hand = follow(plant.drives, state.ticks, h)
    for i in range(3):
        flight[0, i], flight[1, i] = qpos[ball + i], qvel[ball + i]
    advance_spinning(flight[0], flight[1], plant.ball_drag, _lift(plant), h)
    _actuate(plant, hand)
    if plant.rubber.of[0].acts:
        _touch_rubber(plant, h, alone)
    if alone:
        for i in range(3):
            weight = -GRAVITY if i == 2 else 0.0
            passive[ball + i] = plant.ball_mass * ((flight[1, i] - qvel[ball + i]) / h - weight)
            qpos[ball + i] = flight[0, i] - h * flight[1, i]
    if state.braked >= 0.0:
        since = state.ticks * TICK - state.braked
        hold(plant.brakes, since, qvel, plant.ctrl, passive, h)


@kernel
def _turned(plant: Plant, v: Vec, sign: float) -> Vec:
    """Return a vector in the world that is given in the ball's frame; the other way for sign -1."""
    at = len(plant.ctrl) + 3
    w = plant.qpos[at]
    x, y, z = sign * plant.qpos[at + 1], sign * plant.qpos[at + 2], sign * plant.qpos[at + 3]
    a, b, c = y * v[2] - z * v[1], z * v[0] - x * v[2], x * v[1] - y * v[0]
    return (
        v[0] + 2.0 * (w * a + y * c - z * b),
        v[1] + 2.0 * (w * b + z * a - x * c),
        v[2] + 2.0 * (w * c + x * b - y * a),
    )


@kernel
def _spin(plant: Plant) -> Vec:
    """Return the ball's angular velocity in the world [rad/s]."""
    at = len(plant.ctrl) + 3
    x, y, z = plant.qvel[at], plant.qvel[at + 1], plant.qvel[at + 2]
    spin: Vec = _turned(plant, (x, y, z), 1.0)
    return spin


@kernel
def _lift(plant: Plant) -> Lift:
    """Return what the ball's spin does in flight."""
    at = len(plant.ctrl) + 3
    if plant.ball_lift == 0.0:
        return STILL
    if plant.qvel[at] == 0.0 and plant.qvel[at + 1] == 0.0 and plant.qvel[at + 2] == 0.0:
        return STILL
    (x, y, z), K = _spin(plant), plant.ball_lift
    return K * x, K * y, K * z, 2.0 * plant.ball_radius / K


@kernel
def _touch_rubber(plant: Plant, h: float, alone: bool) -> None:
    """Let the rubber act: ready for a ball that comes, along its face on one that touches it."""
    rubber, state, ball, n = plant.rubber, plant.state[0], len(plant.ctrl), len(plant.slides)
    normal, r, v, radius = face_normal(rubber), plant.qpos, plant.qvel, plant.ball_radius
    place = (
        r[ball] - radius * normal[0],
        r[ball + 1] - radius * normal[1],
        r[ball + 2] - radius * normal[2],
    )
    x, y, z = v[ball], v[ball + 1], v[ball + 2]
    for i in range(n):
        a, b, c = moved_by(plant, i, place)
        x, y, z = x - v[i] * a, y - v[i] * b, z - v[i] * c
    if alone or not plant.touching[rubber.of[0].face]:
        rubber.bend[:] = 0.0
        set_damping(rubber, -(x * normal[0] + y * normal[1] + z * normal[2]))
        return
    p, q, s = _spin(plant)
    slip = (
        x - radius * (q * normal[2] - s * normal[1]),
        y - radius * (s * normal[0] - p * normal[2]),
        z - radius * (p * normal[1] - q * normal[0]),
    )
    fx, fy, fz = bend_on(rubber, slip, plant.ball_mass, state.pressing, h)
    arm = -radius
    torque = (
        arm * (normal[1] * fz - normal[2] * fy),
        arm * (normal[2] * fx - normal[0] * fz),
        arm * (normal[0] * fy - normal[1] * fx),
    )
    own = _turned(plant, torque, -1.0)
    for i, force in enumerate((fx, fy, fz)):
        plant.passive[ball + i] += force
        plant.passive[ball + 3 + i] = own[i]
    for i in range(n):
        a, b, c = moved_by(plant, i, place)
        plant.passive[i] -= a * fx + b * fy + c * fz


@kernel
def _actuate(plant: Plant, hand: float) -> None:
    """Write what motors, friction and drag do in the next simulation step.

    Degrees of freedom come in the order arm (n), fingers (f), ball (6). A motor whose command is
    not finite gives nothing, and the trial is marked as broken. ``hand`` is the commanded closing
    angle [rad].
    """
    qpos, qvel, ctrl, passive = plant.qpos, plant.qvel, plant.ctrl, plant.passive
    tau, friction, finite, n, count = (
        plant.drives.mean,
        plant.friction,
        True,
        len(plant.slides),
        len(plant.ctrl),
    )
    for i in range(n):
        if not np.isfinite(tau[i]):
            finite = False
        ctrl[i] = tau[i] if np.isfinite(tau[i]) else 0.0
        slip = np.tanh(qvel[i] / STICTION_SPEED)
        passive[i] = -friction[0, i] * qvel[i] - friction[1, i] * slip
    if not np.isfinite(hand):
        finite, hand = False, 0.0
    for i in range(n, count):
        ctrl[i] = finger_torque(qpos[i], qvel[i], hand, plant.fingers)
    x, y, z = qvel[count], qvel[count + 1], qvel[count + 2]
    force = -(plant.ball_drag * plant.ball_mass) * np.sqrt(x * x + y * y + z * z)
    passive[count] = force * x
    passive[count + 1] = force * y
    passive[count + 2] = force * z
    for i in range(count + 3, count + 6):
        passive[i] = 0.0
    if not finite:
        plant.state[0].broken = True


@kernel
def arrive(plant: Plant, t: float) -> int:
    """Find what follows from the new state, at ``t`` [s], and note the first contact.

    Returns:
        Bits of what touches what, as long as the hand has not touched the ball before.
    """
    state, ball, first = plant.state[0], len(plant.ctrl), plant.first
    step1(plant.address[0], plant.address[1])
    if plant.contacts[0] == 0 or state.touched >= 0.0:
        return 0
    touched, _ = survey(plant, False)
    state.seen |= touched
    if touched & BALL_HAND:
        state.touched = t
        for i in range(3):
            first[0, i], first[1, i] = plant.qpos[ball + i], plant.qvel[ball + i]
            first[2, i] = plant.place[i]
        tip_velocity(plant, first[3])
    return int(touched)


@kernel
def note_state(plant: Plant, trace: Trace) -> None:
    """Write the present state into the trace, judge it, and set the steps of the next tick."""
    state, ball, n = plant.state[0], len(plant.ctrl), len(plant.slides)
    k, t = state.ticks, state.ticks * TICK
    trace.t[k], trace.force[k], trace.seen[k] = t, state.force, state.seen
    for i in range(trace.qpos.shape[1]):
        trace.qpos[k, i] = plant.qpos[i]
    for i in range(trace.qvel.shape[1]):
        trace.qvel[k, i] = plant.qvel[i]
    for i in range(n):
        trace.tau[k, i] = plant.drives.mean[i]
    velocity = trace.velocity[k]
    tip_velocity(plant, velocity)
    state.peak = max(state.force, state.peak)
    gap, speed = 0.0, 0.0
    for i in range(3):
        trace.position[k, i] = plant.place[i]
        gap += (plant.qpos[ball + i] - plant.place[i]) ** 2
        speed += (plant.qvel[ball + i] - velocity[i]) ** 2
    sane, touched = _is_sane(plant), state.touched >= 0.0
    if not sane:
        state.broken = True
    resting = touched and t - state.touched > REST_AFTER and speed < REST_SPEED * REST_SPEED
    steps = 1 if not sane or gap > NEAR * NEAR or resting else plant.fine
    if steps != state.steps:
        state.steps, plant.step[0] = steps, TICK / steps


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
def note_stop(state: Record, brakes: bool, stopped: bool) -> None:
    """Note whether brakes are to engage, and whether the catcher has stopped.

    Args:
        state: As of ``Plant``.
        brakes: Of the command for the next tick.
        stopped: Whether the catcher has stopped: the trial then goes on for ``WATCHED``.
    """
    s = state[0]
    t = s.ticks * TICK
    if brakes and s.braked < 0.0:
        s.braked = t
    if not brakes:
        s.braked = -1.0
    if stopped and s.stopped < 0.0:
        s.stopped = t


@kernel
def over(state: Record, longest: float, held: float) -> bool:
    """Tell whether a trial is at its end.

    Args:
        state: As of ``Plant``.
        longest: Time at which a trial without contact ends [s]; or when the ball is on the floor.
        held: How long a trial goes on after the first contact [s].
    """
    s = state[0]
    t = s.ticks * TICK
    if s.broken:
        return True
    if s.stopped >= 0.0:
        return bool(t >= s.stopped + WATCHED)
    if s.touched >= 0.0:
        return bool(t >= s.touched + held)
    return bool(t >= longest or s.seen & BALL_FLOOR)
