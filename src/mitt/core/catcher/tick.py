"""One tick, from images to torque, in one compiled call.

    perceive   encoders -> estimate_joints -> joints, shape (2, n)
               images -> localize -> position, shape (3,) -> update, predict -> ball, shape (3, 3)
    refer      ball -> reference -> desired motion of the joints, shape (6, n)
    act        desired motion -> safety_filter -> close, derate, track -> command, shape (4, n)
               assess -> health;  predict_acceleration -> what the command will cause

The kernels are those of the stages, composed; none is written a second time. All that they know
and remember lies in ``state`` and in the ``result`` of the tick before, both as handles
(:mod:`mitt.core.catcher.state`).

A generator that is no map takes the same way in two halves, :func:`perceive` and :func:`act`, with
its own ``reference`` between them.
"""

from typing import TypeAlias

import numpy as np

from mitt.core.arm.kinematics import rotate, tip_motion
from mitt.core.ball.filter import doubt, predict, update
from mitt.core.ball.flight import acceleration, doubt_flight
from mitt.core.ball.motion_models import LOOSE
from mitt.core.catcher.settings import (
    BRAKE,
    DECIDE,
    FOLLOW,
    GRASPS,
    LAGS,
    PASSES,
    PATIENCE,
    PONDERS,
    REFUSED,
    REVIEWS,
    SOON,
    STOPPED,
    STOPS,
    WATCH,
)
from mitt.core.catcher.state import CatcherState, Result, flight_begun
from mitt.core.control.closing import LONGEST_INSIDE, close, has_closed, may_begin
from mitt.core.control.easing import ease, easing_time
from mitt.core.control.encoders import (
    BRIDGED,
    BRIDGED_TIME,
    IN_TIME,
    TRIFLE,
    Reading,
    estimate_joints,
    predict_acceleration,
)
from mitt.core.control.health import (
    ABORT,
    DEGRADED,
    FAILED,
    FAILED_TICKS,
    REQUESTED,
    age_of_reading,
    assess,
    pass_time,
)
from mitt.core.control.stop import HARDEST, choose_stop, short_of_room, stop_by
from mitt.core.control.tracking import Tracking, derate, largest_gap, track
from mitt.core.control.viability import BLOCKED, safety_filter
from mitt.core.eyes.head import aim_heads, bearing, lead
from mitt.core.eyes.held import find_held
from mitt.core.eyes.localization import any_shown, guide, localize
from mitt.core.kernels import big_kernel, copy, kernel
from mitt.core.map.mapping import reference
from mitt.core.map.prediction import time_to_catch
from mitt.core.signals import TICK, Array, Image, Sighting
from mitt.core.verdict.feasibility import level

#: Time to the catch from which the hand comes so near the ball's images that its own light and the
#: rim that it hides move their centroids [s], until ``SOON`` after it, and what that adds to a
#: sighting's error [m].
BESIDE = 0.08
TOUCHED = 0.002
#: Time after the catch until which the ball may strike, once the fingers close [s], and multiple of
#: the hardest impact by :mod:`mitt.core.verdict.impact` that is still no fault of an encoder:
#: choices of this project.
STRIKES = 0.03
NO_FAULT = 1.5
#: How far a ball that was refused is from where it was foreseen [m], and how much faster or slower
#: [m/s], beyond so many standard deviations of its estimate, when it flies otherwise: less changes
#: no verdict that is not on the edge.
ANOTHER = 0.1
ANOTHER_SPEED = 0.5
SURELY = 4.0
#: Speed below which a joint counts as commanded to rest [rad/s]; accelerations by that in a tick.
_AT_REST = 1e-3
#: Way of a joint within ``DWELL`` up to which it counts as at rest [rad]: 0.05 rad/s; its encoder's
#: step comes on top.
_STILL = 2.5e-3
#: Gap to the command beyond which the torques of a joint at rest move it on [rad]: ten times what
#: friction leaves.
_OFF = 0.05


Seen: TypeAlias = tuple[tuple[Image, ...], tuple[Image, ...], int, float]
"""Images, one a camera, shape (height, width), empty where there is none; backgrounds as of
:func:`mitt.core.eyes.localization.localize`; images not exposed then, a bit each; instant of the
exposure [s]."""
Read: TypeAlias = tuple[float, float, Array, Array]
"""Time of the tick [s], time of the reading of the encoders [s], q, dq [rad, rad/s], shape (n,)."""


@kernel
def tick(seen: Seen, read: Read, brake: Array, state: CatcherState, result: Result) -> int:
    """See, estimate, generate by the map, close, track.

    Args:
        seen: Images.
        read: Encoders.
        brake: q, dq, ddq while braking, a row each tick, shape (k, 3, n).
        state: All that is known and remembered, overwritten.
        result: That of the tick before, overwritten.

    Returns:
        What is to be thought about: bits.
    """
    perceive(seen, read, state, result)
    refer(state, result)
    return int(act(brake, state, result))


@big_kernel
def perceive(seen: Seen, read: Read, state: CatcherState, result: Result) -> None:
    """Take encoders and images in and carry the estimate to the time of the command."""
    s, out, (images, backgrounds, apart, t_exposed) = state.scalars[0], result.scalars[0], seen
    before = state.health[0].t
    t, s.clock_fault = pass_time(state.health[0], read[0])
    s.passed = state.health[0].passed
    if t < before:  # what was read so far bears another clock's time
        s.t_read = -np.inf
    out.t, out.phase = t, s.phase
    beside = not s.surrogate and -SOON < out.time_to_catch < BESIDE
    out.inside, out.time_to_catch, out.sighted = False, np.inf, False
    out.following = s.phase == FOLLOW
    lag = s.lag
    _read(read, state, result)
    _act_on(state)
    _measure(s.passed + lag - s.lag, state, result)
    if not s.begun:
        _wait_for_encoders(state, result)
    if s.phase in (BRAKE, STOPPED):  # the estimate stays
        if s.phase == BRAKE and before < s.t_rest:
            _see_held(images, apart, t_exposed, state, result)
        return
    if s.heads > 0:
        aim_heads(state.eyes)
    _guide(images, t_exposed, beside, state, result)
    found = localize(images, backgrounds, apart, t_exposed, state.eyes, state.z, state.R)
    t_seen = t_exposed + state.eyes.rig[0].late
    out.sighted, out.t_sighted = found and is_of_now(t_exposed, t, state), t_seen
    if found and not out.sighted:
        state.ball_filter[0].dropped.untimely += 1
    if out.sighted:
        if beside:
            for k in range(3):
                state.R[k, k] += TOUCHED * TOUCHED
        update(state.ball_filter, t_seen, state.z, state.R)
    copy(state.z, result.sighting[0])
    copy(state.R, result.sighting[1:])
    ball = state.ball_filter[0]
    tracked = predict(state.ball_filter, t, result.ball, result.covariance)
    out.tracked, out.t_ball = tracked, t
    out.led = tracked and ball.now.best > 0
    out.drag = ball.drag if tracked else 0.0
    out.lift_x = ball.lift[0] if tracked else 0.0
    out.lift_y = ball.lift[1] if tracked else 0.0
    out.lift_z = ball.lift[2] if tracked else 0.0
    out.t_seen = ball.now.t_seen if tracked else -np.inf
    out.t_first = ball.now.t_first if tracked else -np.inf
    _note_flight(state, result)
    _doubt(state, result)
    if s.heads > 0:
        _turn_heads(images, t_exposed, state, result)


@kernel
def _read(read: Read, state: CatcherState, result: Result) -> None:
    """Keep what the encoders say, and how old it is; an old reading says nothing."""
    s, out, encoders, taken = state.scalars[0], result.scalars[0], result.encoders, state.taken
    told, t_read, q, dq = read
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
    copy(encoders, taken)


@kernel
def _act_on(state: CatcherState) -> None:
    """Let the commands that wait act, each in its turn, for as long as has passed.

    The acceleration that they caused is their mean then: the last goes on until there is another.
    """
    s, waiting, ddq = state.scalars[0], state.waiting, state.monitor.ddq_by_tau
    last = len(waiting) - 1
    if last == 0:
        return
    ticks = min(s.passed, BRIDGED_TIME) / TICK
    count = max(round(ticks), 1)
    if count > 1 and not s.braked:
        ddq[:] = 0.0
        for i in range(count):
            for k in range(len(ddq)):
                ddq[k] += waiting[min(i, last), k] / count
    s.waited += ticks
    moved = int(s.waited + TRIFLE)
    s.waited -= moved
    for i in range(last):
        copy(waiting[min(i + moved, last)], waiting[i])


@kernel
def _measure(dt: float, state: CatcherState, result: Result) -> None:
    """Let the monitor estimate the joints; the ball may strike soon after the fingers close."""
    s, out = state.scalars[0], result.scalars[0]
    fingers, impact_dq = state.fingers[0], state.impact_dq
    may_strike = fingers.t_begun <= out.t <= fingers.t_catch + STRIKES
    for k in range(len(impact_dq)):
        impact_dq[k] = NO_FAULT * abs(state.jump[k]) if may_strike else 0.0
    s.encoder_fault = estimate_joints(
        state.monitor,
        state.taken,
        s.braked,
        impact_dq,
        Reading(s.passed, dt, s.lag),
        state.estimated,
    )


@kernel
def _wait_for_encoders(state: CatcherState, result: Result) -> None:
    """Stay where the arm is, on the brakes until each joint was read once."""
    s, out = state.scalars[0], result.scalars[0]
    copy(state.estimated[:2], state.last[:2])
    copy(state.last, state.before)
    copy(state.estimated[0], state.desired[0])
    s.begun = True
    for k in range(len(state.monitor.joints)):
        s.begun &= not np.isnan(state.monitor.joints[k].q)
    out.brakes = not s.begun or s.phase == STOPPED
    if s.begun and out.brakes:  # stopped before it was known: released by a person alone
        s.t_brakes_on = out.t


@kernel
def _see_held(
    images: tuple[Image, ...], apart: int, t_exposed: float, state: CatcherState, result: Result
) -> None:
    """Find the ball that rides on the braking hand; its flight is over, the filter is not told."""
    s, out, hand = state.scalars[0], result.scalars[0], state.hand
    tip_motion(state.chain, state.estimated[0], state.estimated[1], hand)
    if any_shown(images):
        if s.heads > 0:
            aim_heads(state.eyes)
        for i in range(3):
            hand[2, i] = hand[0, i] + (t_exposed - out.t) * hand[1, i]
        found = find_held(images, apart, state.eyes, hand[2], state.z, state.R)
        out.sighted, out.t_sighted = found and is_of_now(t_exposed, out.t, state), t_exposed
        copy(state.z, result.sighting[0])
        copy(state.R, result.sighting[1:])
    if s.heads > 0:
        for i in range(3):
            hand[0, i] += TICK * hand[1, i]
        for n in range(s.heads):
            bearing(state.eyes.heads[n], hand[0], hand[1], result.gaze[n])


@kernel
def _guide(
    images: tuple[Image, ...], t_exposed: float, beside: bool, state: CatcherState, result: Result
) -> None:
    """Give the eyes the prediction of the ball from the tick before."""
    out = result.scalars[0]
    rig, ball = state.eyes.rig[0], result.ball
    if any_shown(images):
        guide(rig, ball[0], ball[1], t_exposed - out.t_ball, t_exposed, out.sigma, not beside)


@kernel
def _note_flight(state: CatcherState, result: Result) -> None:
    """Note when the ball was let go, or was kicked, last: another flight begins."""
    s, out, kicks = state.scalars[0], result.scalars[0], state.ball_filter[0].now.all_kicks
    if out.tracked and not out.led and (s.was_led or kicks != s.kicks):
        s.t_flight = out.t
    s.was_led, s.kicks = out.led, kicks


@kernel
def _is_another(state: CatcherState, result: Result) -> bool:
    """Carry the refused flight on to the tick; say whether the ball does not fly on as it."""
    s, out, r, P = state.scalars[0], result.scalars[0], state.refused, result.covariance
    ddr, dt = state.bounce, s.passed
    acceleration(r[1], out.drag, ddr)
    off = off_v = sigma = sigma_v = 0.0
    for i in range(3):
        r[0, i] += dt * (r[1, i] + 0.5 * dt * ddr[i])
        r[1, i] += dt * ddr[i]
        off += (result.ball[0, i] - r[0, i]) ** 2
        off_v += (result.ball[1, i] - r[1, i]) ** 2
        sigma += P[i, i]
        sigma_v += P[3 + i, 3 + i]
    if not out.tracked or out.t >= s.t_gone:
        return False
    if out.led or flight_begun(s.t_flight, out.t_first) > s.t_refused:
        return True
    far = np.sqrt(off) > ANOTHER + SURELY * np.sqrt(sigma)
    return bool(far or np.sqrt(off_v) > ANOTHER_SPEED + SURELY * np.sqrt(sigma_v))


@kernel
def _doubt(state: CatcherState, result: Result) -> None:
    """Let the estimate know that the ball may fly no more as it did."""
    s, out, P = state.scalars[0], result.scalars[0], result.covariance
    s.flight_sigma = np.sqrt((P[0, 0] + P[1, 1] + P[2, 2]) / 3.0) if out.tracked else np.inf
    if out.tracked:
        missed = state.eyes.rig[0].missed
        doubt(state.ball_filter, out.t, P)
        doubt_flight(result.ball[1], out.t - out.t_seen, missed, state.bounce, P)


@kernel
def _turn_heads(
    images: tuple[Image, ...], t_exposed: float, state: CatcherState, result: Result
) -> None:
    """Let the heads look where the ball will be when the command acts."""
    s, out, target, ball = state.scalars[0], result.scalars[0], state.look_at, result.ball
    if any_shown(images):
        s.t_exposed = t_exposed
    for i in range(3):
        target[0, i], target[1, i] = ball[0, i] + TICK * ball[1, i], ball[1, i]
    t_seen = out.t_seen if out.tracked else -np.inf
    lead(state.eyes, target, t_seen, s.t_exposed, out.t + TICK, result.gaze)


@big_kernel
def refer(state: CatcherState, result: Result) -> None:
    """Evaluate the map at the ball; while the verdict is pending, at its surrogate target."""
    s, out = state.scalars[0], result.scalars[0]
    if s.phase != FOLLOW:
        return
    target, rows = state.followed, result.reference
    copy(result.ball, target)
    if s.surrogate:
        level(target, s.waiting_height)
    copy(state.map.start, rows[3])
    if reference(state.map, target, rows):
        out.inside = True
        led = out.led or s.surrogate
        out.time_to_catch = time_to_catch(state.map, rows, target, out.drag, led)


@big_kernel
def act(brake: Array, state: CatcherState, result: Result) -> int:
    """Close the hand and track the desired motion, or that of braking."""
    s, out = state.scalars[0], result.scalars[0]
    t, phase, desired, estimated = out.t, s.phase, state.desired, state.estimated
    arm, monitor, tracking, command = (
        state.arm,
        state.monitor,
        state.tracking,
        result.command,
    )
    lags = phase == FOLLOW and _lags(state, result)
    if phase == FOLLOW:
        if lags and not s.lags:  # what is followed starts again from where the arm is: no jump
            copy(state.last, desired)
            _carry(desired, min(s.passed, BRIDGED_TIME) - s.ahead * TICK)
        else:
            _ask(state, result)
    elif phase == BRAKE:
        _brake_at(brake, t - s.t_brake, desired)
    s.lags = lags
    blocked = _go_on(brake, state, result)
    _close(state, result)
    in_time = min(s.passed, IN_TIME)
    derate(
        tracking,
        arm,
        monitor,
        estimated[1],
        state.jump,
        s.torque_lead + max(in_time - TICK, 0.0),
        state.fingers[0].t_begun < np.inf,
    )
    out.saturated = track(
        tracking, arm, state.safety.bounds, s.bandwidth, estimated, command, in_time
    )
    _report(blocked, state, result)
    _engage(state, result)
    _note_rest(state, result)
    predict_acceleration(monitor, arm, estimated, command[3], state.mass)
    copy(monitor.ddq_by_tau, state.waiting[-1])
    copy(state.waiting[0], monitor.ddq_by_tau)
    if s.braked:
        monitor.ddq_by_tau[:] = 0.0
    if s.phase == STOPPED:
        return STOPS if phase != STOPPED else 0
    if phase == WATCH:
        return DECIDE if out.tracked else 0
    if phase == REFUSED:
        return DECIDE if _is_another(state, result) else 0
    return _afterwards(state, result) if phase == FOLLOW else 0


@kernel
def _ask(state: CatcherState, result: Result) -> None:
    """Lead what is desired towards what the generator asks for; where it is nothing, to rest."""
    s, out, asked = state.scalars[0], result.scalars[0], result.command[:3]
    if out.inside:
        copy(result.reference[:3], asked)
    else:
        copy(state.desired, asked)
        asked[1:] = 0.0
    ease(state.desired, asked, min(s.passed, BRIDGED_TIME), easing_time(out.time_to_catch))


@kernel
def _go_on(brake: Array, state: CatcherState, result: Result) -> bool:
    """Let the commanded motion go on to the time of the tick; say whether its way was blocked.

    Whatever time has passed, it goes on in ticks, each within every limit, until it is at the time
    of the tick or less than one ahead. What is commanded then lies between the last two.
    """
    s, last, before = state.scalars[0], state.last, state.before
    wish, blocked = result.command[:3], False
    s.ahead -= min(s.passed, BRIDGED_TIME) / TICK
    while s.ahead < -TRIFLE:
        s.ahead += 1.0
        if abs(s.ahead) < TRIFLE:
            s.ahead = 0.0
        copy(last, before)
        _wish(brake, s.ahead * TICK, state, result.scalars[0].t, wish)
        blocked |= safety_filter(state.safety, last, wish, state.estimated) == BLOCKED
    copy(last, wish)
    if s.ahead > 0.0:
        for i in range(3):
            for k in range(last.shape[1]):
                wish[i, k] -= s.ahead * (last[i, k] - before[i, k])
    return blocked


@kernel
def _wish(brake: Array, later: float, state: CatcherState, t: float, wish: Array) -> None:
    """Write the desired motion of a time later than the tick, or before it [s], shape (3, n)."""
    s, desired = state.scalars[0], state.desired
    if s.phase == STOPPED:
        _slow_down(state)
    elif s.phase == BRAKE:
        _brake_at(brake, t + later - s.t_brake, wish)
        return
    copy(desired, wish)
    if s.phase == FOLLOW and later != 0.0:
        _carry(wish, later)


@kernel
def _brake_at(brake: Array, since: float, motion: Array) -> None:
    """Write q, dq, ddq at a time since braking began [s], shape (3, n)."""
    k = min(max(round(since / TICK), 0), len(brake) - 1)
    copy(brake[k], motion)
    rest = since - k * TICK
    if since > 0.0 and k < len(brake) - 1 and abs(rest) > TRIFLE * TICK:
        _carry(motion, rest)


@kernel
def _carry(motion: Array, dt: float) -> None:
    """Carry q, dq, ddq on by a time [s] with constant accelerations, shape (3, n)."""
    for k in range(motion.shape[1]):
        motion[0, k] += dt * (motion[1, k] + 0.5 * dt * motion[2, k])
        motion[1, k] += dt * motion[2, k]


@kernel
def _slow_down(state: CatcherState) -> None:
    """Brake all joints as hard as the drives can."""
    safety, last = state.safety, state.last
    choose_stop(safety.arm, safety.loaded, safety.bounds, last, HARDEST, safety.stop)
    stop_by(safety.bounds, last, safety.stop.rates, state.desired)


@kernel
def _close(state: CatcherState, result: Result) -> None:
    """Lead the fingers: they begin when the ball will be in the hand by the time they need."""
    s, out, gap, ball, f = (
        state.scalars[0],
        result.scalars[0],
        state.gap,
        result.ball,
        state.fingers[0],
    )
    later = max(s.torque_lead - TICK, 0.0)
    if f.t_begun == np.inf and may_begin(f, out.time_to_catch, later):
        q, dq, q_then = result.command[0], result.command[1], state.pose
        for k in range(len(q)):
            q_then[k] = q[k] + min(max(out.time_to_catch, 0.0), LONGEST_INSIDE) * dq[k]
        R, p = tip_motion(state.chain, q_then, dq, gap), state.palm
        palm = rotate(R, (p[0], p[1], p[2]))
        tip_motion(state.chain, q, dq, gap)
        for k in range(3):
            state.palm_now[k] = palm[k]
            gap[0, k], gap[1, k] = ball[0, k] - gap[0, k], ball[1, k] - gap[1, k]
    out.hand = close(f, out.t, out.time_to_catch, gap, state.palm_now, later)


@kernel
def _report(blocked: bool, state: CatcherState, result: Result) -> None:
    """Write state, reason, age and sigma; from an abort on the arm stops and stays.

    The stop starts from the last command, or from the estimate where that is far from it: the way
    to the command would be one more motion.
    """
    s, out = state.scalars[0], result.scalars[0]
    P, estimated, command = result.covariance, state.estimated, result.command
    out.age = out.t - out.t_seen
    out.sigma = np.sqrt((P[0, 0] + P[1, 1] + P[2, 2]) / 3.0) if out.tracked else np.inf
    if out.health == ABORT:
        return
    R, gap = state.R, largest_gap(command[0], estimated[0])
    near = out.inside and abs(out.time_to_catch) < SOON
    one_camera = R[0, 0] + R[1, 1] + R[2, 2] > LOOSE
    out.health, out.reason = assess(state.health[0], s, out, blocked, near, one_camera, gap)
    if s.failures > 0 and out.health != ABORT:
        out.health = ABORT if s.failures >= FAILED_TICKS else DEGRADED
        out.reason = FAILED
    if s.stop_requested:
        out.health, out.reason = ABORT, REQUESTED
    if out.health == ABORT:
        s.phase = STOPPED
        if gap > s.max_tracking_error and s.encoder_fault <= BRIDGED:
            copy(estimated[:2], state.last[:2])
            state.last[2] = 0.0
            copy(state.last, state.before)


@kernel
def _engage(state: CatcherState, result: Result) -> None:
    """Engage the brakes once a joint is not measured; no torques from when they act.

    Before each joint was read once it is on its brakes, and where it is not known: no torques.
    Torques that take an arm over from its brakes build up at their rates; the brakes hold until
    they have.
    """
    s, out, tau, tracking = state.scalars[0], result.scalars[0], result.command[3], state.tracking
    if s.begun and s.encoder_fault > BRIDGED and not out.brakes:
        out.brakes, s.t_brakes_on = True, out.t
    late = out.brakes and out.t - s.t_brakes_on > s.brake_delay - 0.5 * TICK
    if not s.begun or late:
        s.braked = True
    elif s.braked and s.phase != STOPPED:
        s.braked = out.brakes = _builds_up(tracking, tau)
        copy(tau, tracking.before)
        return
    if s.braked:
        tau[:] = 0.0
    copy(tau, tracking.before)


@kernel
def _builds_up(w: Tracking, tau: Array) -> bool:
    """Say whether a torque changes in this tick as fast as it may."""
    share = 0.0
    for k in range(len(tau)):
        share = max(share, abs(tau[k] - w.before[k]) / w.change[k])
    return bool(share > 1.0 - 1e-9)


@kernel
def _note_rest(state: CatcherState, result: Result) -> None:
    """Note whether the command is at rest for good, and when it or the arm moved last."""
    s, out, command, estimated = (
        state.scalars[0],
        result.scalars[0],
        result.command,
        state.estimated,
    )
    s.halted = s.phase != FOLLOW and not (s.phase == BRAKE and out.t < s.t_rest - 0.5 * TICK)
    moved = False
    for k in range(command.shape[1]):
        fast = max(abs(command[1, k]), TICK * abs(command[2, k]))
        s.halted &= fast < _AT_REST
        step = state.monitor.joints[k].step
        moved |= abs(estimated[0, k] - state.rest[k]) > _STILL + step
        moved |= not s.braked and abs(estimated[0, k] - command[0, k]) > _OFF + step
    if moved or not s.halted or s.t_moved == np.inf:
        s.t_moved = out.t
        copy(estimated[0], state.rest)


@kernel
def _lags(state: CatcherState, result: Result) -> bool:
    """Say whether the reference has left the arm behind, as where the ball was kicked."""
    s, out, reference, estimated = (
        state.scalars[0],
        result.scalars[0],
        result.reference,
        state.estimated,
    )
    if not out.inside or out.time_to_catch < s.adapt_until:
        return False
    return bool(
        largest_gap(reference[0], estimated[0]) >= s.adapt_q
        or largest_gap(reference[1], estimated[1]) >= s.adapt_dq
    )


@kernel
def _afterwards(state: CatcherState, result: Result) -> int:
    """Return what is to be thought about while a ball is followed."""
    s, out = state.scalars[0], result.scalars[0]
    todo = DECIDE if s.surrogate else 0
    if s.ponders:
        todo |= PONDERS
    soon = out.inside and out.time_to_catch < s.adapt_until
    if not soon and out.t - s.t_reviewed >= s.review:
        s.t_reviewed = out.t
        todo |= REVIEWS
    if s.lags:
        todo |= LAGS
    if out.time_to_catch < np.inf or state.fingers[0].t_begun < np.inf:
        s.t_ahead = out.t
    elif out.t - s.t_ahead > PATIENCE:
        todo |= PASSES
    if has_closed(state.fingers[0], out.t + TICK, True) and (
        has_closed(state.fingers[0], out.t + TICK, False)
        or short_of_room(state.arm, state.limits, result.command, state.mass)
    ):
        todo |= GRASPS
    return todo


@kernel
def looks(state: CatcherState, result: Result) -> bool:
    """Say whether the next tick wants to see: not after a stop, nor once a braked arm rests."""
    s = state.scalars[0]
    return bool(result.scalars[0].t < s.t_rest) if s.phase == BRAKE else bool(s.phase != STOPPED)


@kernel
def is_of_now(t_seen: float, t: float, state: CatcherState) -> bool:
    """Say whether a sighting can be of the flight that is followed at ``t`` [s].

    One of the future, or older than the longest gap in a track, bears the stamp of another clock.
    """
    return bool(-state.ball_filter[0].settings.max_gap <= t_seen - t <= TICK)


def take(points: tuple[Sighting, ...], t: float, state: CatcherState) -> None:
    """Take in positions from another source than images, seen about ``t`` [s]."""
    oldest = t - state.ball_filter[0]["settings"]["max_gap"]
    dropped = state.ball_filter[0]["dropped"]
    for point in points:
        if not point.found:
            dropped["unusable"] += 1
        elif point.t > t + TICK or point.t < oldest:
            dropped["untimely"] += 1
        else:
            update(state.ball_filter, point.t, point.r_o, point.covariance)
