"""The second half of a tick: the desired motion to commands for joints, brakes and fingers."""

import numpy as np

from mitt.ball import memory as at
from mitt.catcher.result import Result
from mitt.catcher.settings import (
    BRAKE,
    DECIDE,
    FOLLOW,
    GRASPS,
    LAGS,
    PASSES,
    PATIENCE,
    REVIEWS,
    SOON,
    STOPPED,
    STOPS,
    WATCH,
)
from mitt.catcher.state import CatcherState
from mitt.control.encoder_faults import TRIFLE
from mitt.control.encoder_memory import BRIDGED
from mitt.control.encoders import predict_acceleration
from mitt.control.hand import LONGEST_INSIDE, close, has_closed, may_begin
from mitt.control.health import (
    ABORT,
    BRIDGED_TIME,
    DEGRADED,
    FAILED,
    FAILED_TICKS,
    IN_TIME,
    REQUESTED,
    assess,
)
from mitt.control.margin import derate
from mitt.control.reserve import HARDEST, choose_stop, stop_by
from mitt.control.rows import DDQ_BY_TAU, TAU, Q
from mitt.control.stop import short_of_room
from mitt.control.tracking import largest_gap, track
from mitt.control.viability import BLOCKED, safety_filter
from mitt.jit import kernel
from mitt.robot.kinematics import rotate, tip_motion
from mitt.signals import TICK, Array


@kernel
def act(brake: Array, state: CatcherState, result: Result) -> int:
    """Close the hand and track the desired motion, or that of braking; see :func:`tick`."""
    s, out = state.scalars[0], result.scalars[0]
    t, phase, desired, estimated = out.t, s.phase, state.desired, state.estimated
    if phase == FOLLOW:
        if out.inside:
            desired[:] = result.reference[:3]
        else:
            desired[1:] = 0.0
    elif phase == BRAKE:
        _brake_at(brake, t - s.t_brake, desired)
    blocked = _go_on(brake, state, result)
    _close(state, result)
    derate(
        state.drives, state.active, state.encoder_memory, estimated[1], result.command,
        state.encoder_ddq_unknown, state.jump,
        s.torque_lead + max(min(s.passed, IN_TIME) - TICK, 0.0), state.closing[0] < np.inf,
        state.drives_now,
    )  # fmt: skip
    out.saturated = track(
        state.bounds,
        s.bandwidth,
        state.drives_now,
        state.bodies,
        state.active,
        estimated[0],
        estimated[1],
        result.command,
        state.slew,
        state.track_scratch,
        min(s.passed, IN_TIME),
    )
    _report(blocked, state, result)
    _engage(state, result)
    predict_acceleration(
        state.bodies, state.active, estimated, state.encoder_table[1], state.room_tau,
        state.room_mass, state.room_work, state.encoder_work, result.command,
        state.encoder_ddq_unknown, state.encoder_coupling,
    )  # fmt: skip
    state.encoder_waiting[-1] = result.command[DDQ_BY_TAU]
    result.command[DDQ_BY_TAU] = state.encoder_waiting[0]
    if s.braked:
        result.command[DDQ_BY_TAU] = 0.0
    if s.phase == STOPPED:
        return STOPS if phase != STOPPED else 0
    if phase == WATCH:
        return DECIDE if out.tracked else 0
    return _afterwards(state, result) if phase == FOLLOW else 0


@kernel
def _close(state: CatcherState, result: Result) -> None:
    """Lead the fingers: they begin when the ball will be in the hand by the time they need."""
    s, out, gap, ball = state.scalars[0], result.scalars[0], state.gap, result.ball
    later = max(s.torque_lead - TICK, 0.0)
    if state.closing[0] == np.inf and may_begin(state.grip, out.time_to_catch, later):
        q, dq = result.command[0], result.command[1]
        q_then = state.encoder_work[0, : len(q)]
        for k in range(len(q)):
            q_then[k] = q[k] + min(max(out.time_to_catch, 0.0), LONGEST_INSIDE) * dq[k]
        R, p = tip_motion(state.chain, q_then, dq, gap), state.palm
        palm = rotate(R, (p[0], p[1], p[2]))
        tip_motion(state.chain, q, dq, gap)
        for k in range(3):
            state.palm_now[k] = palm[k]
            gap[0, k], gap[1, k] = ball[0, k] - gap[0, k], ball[1, k] - gap[1, k]
    out.hand = close(
        state.closing, state.grip, out.t, out.time_to_catch, gap, state.palm_now, later
    )


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
        before[:] = last
        _wish(brake, s.ahead * TICK, state, result.scalars[0].t, wish)
        passed = safety_filter(
            state.bodies, state.shapes, state.pairs, state.bounds, state.drives, state.active, last,
            wish, state.filter_known, state.filter_work, state.filter_reserve,
        )  # fmt: skip
        blocked |= passed == BLOCKED
    wish[:] = last
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
    wish[:] = desired
    if s.phase == FOLLOW and later != 0.0:
        _carry(wish, later)


@kernel
def _brake_at(brake: Array, since: float, motion: Array) -> None:
    """Write q, dq, ddq at a time since braking began [s], shape (3, n)."""
    k = min(max(round(since / TICK), 0), len(brake) - 1)
    motion[:] = brake[k]
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
    choose_stop(
        state.bodies,
        state.drives,
        state.active,
        state.bounds,
        state.last,
        HARDEST,
        state.filter_reserve,
    )
    stop_by(state.bounds, state.last, state.filter_reserve, state.desired)


@kernel
def _engage(state: CatcherState, result: Result) -> None:
    """Engage the brakes once a joint is not measured; no torques from when they act.

    Before each joint was read once it is on its brakes, and where it is not known: no torques.
    Torques that take an arm over from its brakes build up at their rates; the brakes hold until
    they have.
    """
    s, out = state.scalars[0], result.scalars[0]
    if s.begun and s.encoder_fault > BRIDGED and not out.brakes:
        out.brakes, s.t_brakes_on = True, out.t
    late = out.brakes and out.t - s.t_brakes_on > s.brake_delay - 0.5 * TICK
    if not s.begun or late:
        s.braked = True
    elif s.braked and s.phase != STOPPED:
        s.braked = out.brakes = _builds_up(state.slew, result.command[TAU])
        state.slew[1] = result.command[TAU]
        return
    if s.braked:
        result.command[TAU] = 0.0
    state.slew[1] = result.command[TAU]


@kernel
def _builds_up(slew: Array, tau: Array) -> bool:
    """Say whether a torque changes in this tick as fast as it may."""
    share = 0.0
    for k in range(len(tau)):
        share = max(share, abs(tau[k] - slew[1, k]) / slew[0, k])
    return bool(share > 1.0 - 1e-9)


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
    R, gap = state.R, largest_gap(command[Q], estimated[0])
    out.health, out.reason = assess(
        state.health_memory,
        s.clock_fault,
        s.encoder_fault,
        blocked,
        s.phase == FOLLOW,
        out.inside and abs(out.time_to_catch) < SOON,
        out.age,
        s.flight_sigma,
        s.tolerance,
        R[0, 0] + R[1, 1] + R[2, 2] > at.LOOSE,
        gap,
        s.max_tracking_error,
        s.passed,
    )
    if s.failures > 0 and out.health != ABORT:
        out.health = ABORT if s.failures >= FAILED_TICKS else DEGRADED
        out.reason = FAILED
    if s.stop_requested:
        out.health, out.reason = ABORT, REQUESTED
    if out.health == ABORT:
        s.phase = STOPPED
        if gap > s.max_tracking_error and s.encoder_fault <= BRIDGED:
            state.last[0], state.last[1], state.last[2] = estimated[0], estimated[1], 0.0
            state.before[:] = state.last


@kernel
def _afterwards(state: CatcherState, result: Result) -> int:
    """Return what is to be thought about while a ball is followed."""
    s, out = state.scalars[0], result.scalars[0]
    todo = DECIDE if s.surrogate else 0
    soon = out.inside and out.time_to_catch < s.adapt_until
    if s.several and not soon and out.t - s.t_reviewed >= s.review:
        s.t_reviewed = out.t
        todo |= REVIEWS
    if out.inside and not soon:
        reference, estimated = result.reference, state.estimated
        if (
            largest_gap(reference[0], estimated[0]) >= s.adapt_q
            or largest_gap(reference[1], estimated[1]) >= s.adapt_dq
        ):
            todo |= LAGS
    if out.time_to_catch < np.inf or state.closing[0] < np.inf:
        s.t_ahead = out.t
    elif out.t - s.t_ahead > PATIENCE:
        todo |= PASSES
    if has_closed(state.closing, out.t + TICK, True) and (
        has_closed(state.closing, out.t + TICK, False)
        or short_of_room(
            state.bodies, state.active, state.room, result.command, state.room_tau, state.room_mass,
            state.room_work,
        )
    ):  # fmt: skip
        todo |= GRASPS
    return todo
