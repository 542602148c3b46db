"""The first half of a tick: encoders to joint states, images to the estimate of the ball."""

import numpy as np

from mitt.ball import memory as at
from mitt.ball.bounce import doubt_flight
from mitt.ball.estimator import doubt, predict, update
from mitt.catcher.result import Result
from mitt.catcher.settings import BRAKE, FOLLOW, SOON, STOPPED
from mitt.catcher.state import CatcherState
from mitt.control.encoder_faults import TRIFLE
from mitt.control.encoder_memory import Q as ANGLE
from mitt.control.health import BRIDGED_TIME, age_of_reading, pass_time, time_since
from mitt.control.monitor import estimate_joints
from mitt.control.rows import DDQ_BY_TAU
from mitt.jit import kernel
from mitt.robot.kinematics import tip_motion
from mitt.signals import TICK, Array, Image, Sighting
from mitt.vision.gaze import lead
from mitt.vision.head import aim, bearing
from mitt.vision.held import find_held
from mitt.vision.localization import MISSED, guide, localize

#: Time to the catch from which the hand comes so near the ball's images that its own light and the
#: rim that it hides move their centroids [s], until ``SOON`` after it, and what that adds to a
#: sighting's error [m].
BESIDE, TOUCHED = 0.08, 0.002

#: Time after the catch until which the ball may strike, once the fingers close [s].
#: Multiple of the hardest impact by :mod:`mitt.impact` that is still no fault of an encoder. Both
#: are choices of this project.
STRIKES, NO_FAULT = 0.03, 1.5


@kernel
def perceive(
    images: tuple[Image, ...],
    backgrounds: tuple[Image, ...],
    apart: int,
    t_exposed: float,
    t: float,
    t_read: float,
    q: Array,
    dq: Array,
    state: CatcherState,
    result: Result,
) -> None:
    """Take encoders and images in and carry the estimate to the time of the command; see tick."""
    s, out, told = state.scalars[0], result.scalars[0], t
    before = state.health_memory[0]
    t, s.clock_fault = pass_time(state.health_memory, told)
    s.passed = time_since(before, t)
    out.t, out.phase = t, s.phase
    beside = not s.surrogate and -SOON < out.time_to_catch < BESIDE
    out.inside, out.time_to_catch, out.sighted = False, np.inf, False
    out.following = s.phase == FOLLOW
    lag = s.lag
    _read(told, t_read, q, dq, state, result)
    _act_on(state.encoder_waiting, result.command, state)
    _measure(s.passed + lag - s.lag, state, result)
    if not s.begun:
        _wait_for_encoders(state, result)
    if s.phase in (BRAKE, STOPPED):  # the estimate stays
        if s.phase == BRAKE and before < s.t_rest:
            _see_held(images, apart, t_exposed, state, result)
        return
    if s.heads > 0:
        aim(state.eyes_heads, state.eyes_angles, state.eyes_cameras)
    _guide(images, t_exposed, beside, state, result)
    found = localize(
        images, backgrounds, apart, state.eyes_memory, state.eyes_settings, state.eyes_boxes,
        state.eyes_cameras, state.eyes_ball, state.eyes_work, state.z, state.R,
    )  # fmt: skip
    out.sighted, out.t_sighted = found and is_of_now(t_exposed, t, state), t_exposed
    if out.sighted:
        if beside:
            for k in range(3):
                state.R[k, k] += TOUCHED * TOUCHED
        update(state.ball_memory, t_exposed, state.z, state.R, state.ball_settings, state.ball_work)
    result.sighting[0], result.sighting[1:] = state.z, state.R
    memory = state.ball_memory
    tracked = predict(
        memory, t, state.ball_settings, result.ball, result.covariance, state.ball_work
    )
    out.tracked, out.t_ball = tracked, t
    out.led = tracked and memory[at.BEST] > 0.0
    out.drag = memory[at.DRAG] if tracked else 0.0
    out.t_seen = memory[at.T_SEEN] if tracked else -np.inf
    out.t_first = memory[at.T_FIRST] if tracked else -np.inf
    _doubt(state, result)
    if s.heads > 0:
        _turn_heads(images, t_exposed, state, result)


@kernel
def looks(state: CatcherState, result: Result) -> bool:
    """Say whether the next tick wants to see: not after a stop, nor once a braked arm rests."""
    s = state.scalars[0]
    return bool(result.scalars[0].t < s.t_rest) if s.phase == BRAKE else bool(s.phase != STOPPED)


@kernel
def _see_held(
    images: tuple[Image, ...], apart: int, t_exposed: float, state: CatcherState, result: Result
) -> None:
    """Find the ball that rides on the braking hand; its flight is over, the filter is not told."""
    s, out, hand, shown = state.scalars[0], result.scalars[0], state.target, False
    tip_motion(state.chain, state.estimated[0], state.estimated[1], hand)
    for n in range(len(images)):
        shown |= images[n].size > 0
    if shown:
        if s.heads > 0:
            aim(state.eyes_heads, state.eyes_angles, state.eyes_cameras)
        for i in range(3):
            hand[2, i] = hand[0, i] + (t_exposed - out.t) * hand[1, i]
        found = find_held(
            images, apart, state.eyes_memory, state.eyes_cameras, state.eyes_ball, state.eyes_work,
            hand[2], state.z, state.R,
        )  # fmt: skip
        out.sighted, out.t_sighted = found and is_of_now(t_exposed, out.t, state), t_exposed
        result.sighting[0], result.sighting[1:] = state.z, state.R
    if s.heads > 0:
        for i in range(3):
            hand[0, i] += TICK * hand[1, i]
        for n in range(s.heads):
            bearing(state.eyes_heads[n], hand[0], hand[1], result.gaze[n])


@kernel
def _doubt(state: CatcherState, result: Result) -> None:
    """Let the estimate know that the ball may fly no more as it did."""
    s, out, P = state.scalars[0], result.scalars[0], result.covariance
    s.flight_sigma = np.sqrt((P[0, 0] + P[1, 1] + P[2, 2]) / 3.0) if out.tracked else np.inf
    if out.tracked:
        missed = state.eyes_memory[len(state.eyes_memory) - 1, MISSED]
        doubt(state.ball_memory, out.t, state.ball_settings, P)
        doubt_flight(result.ball[1], out.t - out.t_seen, missed, state.target[0], P)


@kernel
def _wait_for_encoders(state: CatcherState, result: Result) -> None:
    """Stay where the arm is, on the brakes until each joint was read once."""
    s, out = state.scalars[0], result.scalars[0]
    state.last[0], state.last[1] = state.estimated[0], state.estimated[1]
    state.before[:] = state.last
    state.desired[0] = state.estimated[0]
    s.begun = _is_known(state.encoder_memory)
    out.brakes = not s.begun or s.phase == STOPPED
    if s.begun and out.brakes:  # stopped before it was known: released by a person alone
        s.t_brakes_on = out.t


@kernel
def _is_known(encoder_memory: Array) -> bool:
    """Say whether each joint was read since the start."""
    known = True
    for k in range(len(encoder_memory)):
        known &= not np.isnan(encoder_memory[k, ANGLE])
    return known


@kernel
def _guide(
    images: tuple[Image, ...], t_exposed: float, beside: bool, state: CatcherState, result: Result
) -> None:
    """Give the eyes the prediction of the ball from the tick before; see :func:`tick`."""
    out = result.scalars[0]
    memory, ball = state.eyes_memory, result.ball
    rig, shown = memory[len(memory) - 1], False
    for n in range(len(images)):
        shown |= images[n].size > 0
    if shown:
        guide(rig, ball[0], ball[1], t_exposed - out.t_ball, TICK, out.sigma, not beside)


@kernel
def _read(
    told: float, t_read: float, q: Array, dq: Array, state: CatcherState, result: Result
) -> None:
    """Keep what the encoders say, and how old it is; an old reading says nothing."""
    s, out, encoders, taken = state.scalars[0], result.scalars[0], result.encoders, state.taken
    s.age_told = told - t_read
    age, again = age_of_reading(t_read, told, out.t, s.t_read), t_read == s.stamp
    for k in range(len(q)):
        again &= q[k] == encoders[0, k]
        encoders[0, k], encoders[1, k] = q[k], dq[k]
    s.stale, s.stamp = again or np.isnan(age), t_read
    if s.stale:
        taken[:] = np.nan
        return
    s.t_read, s.lag = out.t - age, age
    taken[:] = encoders


@kernel
def _act_on(waiting: Array, command: Array, state: CatcherState) -> None:
    """Let the commands that wait act, each in its turn, for as long as has passed.

    The acceleration that they caused is their mean then: the last goes on until there is another.
    """
    s, last = state.scalars[0], len(waiting) - 1
    if last == 0:
        return
    ticks = min(s.passed, BRIDGED_TIME) / TICK
    count = max(round(ticks), 1)
    if count > 1 and not s.braked:
        command[DDQ_BY_TAU] = 0.0
        for i in range(count):
            command[DDQ_BY_TAU] += waiting[min(i, last)] / count
    s.waited += ticks
    moved = int(s.waited + TRIFLE)
    s.waited -= moved
    for i in range(last):
        waiting[i] = waiting[min(i + moved, last)]


@kernel
def _measure(dt: float, state: CatcherState, result: Result) -> None:
    """Let the monitor estimate the joints; the ball may strike soon after the fingers close."""
    s, out = state.scalars[0], result.scalars[0]
    closing, impact_dq = state.closing, state.impact_dq
    may_strike = closing[0] <= out.t <= closing[1] + STRIKES
    for k in range(len(impact_dq)):
        impact_dq[k] = NO_FAULT * abs(state.jump[k]) if may_strike else 0.0
    s.encoder_fault = estimate_joints(
        state.encoder_memory, state.encoder_bounds, state.encoder_table[0],
        state.encoder_ddq_unknown, state.encoder_coupling, state.taken, result.command,
        s.braked, impact_dq, s.passed, dt, s.lag, state.estimated,
    )  # fmt: skip


@kernel
def _turn_heads(
    images: tuple[Image, ...], t_exposed: float, state: CatcherState, result: Result
) -> None:
    """Let the heads look where the ball will be when the command acts."""
    s, out, target, ball = state.scalars[0], result.scalars[0], state.target, result.ball
    for n in range(len(images)):
        if images[n].size > 0:
            s.t_exposed = t_exposed
    for i in range(3):
        target[0, i], target[1, i] = ball[0, i] + TICK * ball[1, i], ball[1, i]
    lead(
        state.eyes_heads,
        state.eyes_cameras,
        state.eyes_memory,
        state.eyes_gaze,
        target,
        out.t_seen if out.tracked else -np.inf,
        s.t_exposed,
        out.t + TICK,
        state.eyes_gaze_work,
        result.gaze,
    )


@kernel
def is_of_now(t_seen: float, t: float, state: CatcherState) -> bool:
    """Say whether a sighting can be of the flight that is followed at ``t`` [s].

    One of the future, or older than the longest gap in a track, bears the stamp of another clock.
    """
    return bool(-state.ball_settings[at.LIMITS, at.MAX_GAP] <= t_seen - t <= TICK)


def take(points: tuple[Sighting, ...], t: float, state: CatcherState) -> None:
    """Take in positions from another source than images, seen about ``t`` [s]."""
    oldest = t - state.ball_settings[at.LIMITS, at.MAX_GAP]
    for point in points:
        if point.found and not (point.t > t + TICK or point.t < oldest):
            update(
                state.ball_memory, point.t, point.r_o, point.covariance, state.ball_settings,
                state.ball_work,
            )  # fmt: skip
