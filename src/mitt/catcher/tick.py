"""One tick, from images to torque, in one compiled call.

    perceive   encoders -> believe -> joints, shape (2, n)
               images -> localize -> position, shape (3,) -> update, predict -> ball, shape (3, 3)
    refer      ball -> reference -> desired motion of the joints, shape (6, n)
    act        desired motion -> guard -> close, derate, track -> command, shape (5, n)
               assess -> health of the catcher;  bring -> acceleration that the command brings

The kernels are those of the stages, composed; none is written a second time. All that they know
and remember lies in ``state`` and in the ``result`` of the tick before, both as handles
(:mod:`mitt.catcher.state`, :mod:`mitt.catcher.result`).

A generator that is no map takes the same way in two halves, :func:`perceive` and :func:`act`, with
its own ``reference`` between them.
"""

import numpy as np

from mitt.ball import memory as at
from mitt.ball.estimator import predict, update
from mitt.catcher.result import Result
from mitt.catcher.settings import BRAKE, FOLLOW, STOPPED, WATCH
from mitt.catcher.state import State
from mitt.control.encoders import bring
from mitt.control.hand import close, has_closed
from mitt.control.health import ABORT, ASKED, assess, pass_time
from mitt.control.margin import derate
from mitt.control.monitor import BRIDGED, believe
from mitt.control.reserve import HARDEST, choose_stop, stop_by
from mitt.control.stop import short_of_room
from mitt.control.tracking import largest_gap, track
from mitt.control.viability import BLOCKED, guard
from mitt.generator.evaluation import reference, time_to_catch
from mitt.generator.feasibility import level
from mitt.generator.prediction import lay_state, sigma_at_catch
from mitt.jit import kernel
from mitt.signals import TICK, Array, Image
from mitt.vision.eyes import LET_GO
from mitt.vision.gaze import lead
from mitt.vision.head import aim
from mitt.vision.localization import guide, localize

#: What is to be thought about after a tick, as bits of its result: the verdict is open, the ball
#: has left the arm behind, the fingers have closed as far as there is time for, the catcher has
#: stopped, the choice of the map is to be reviewed.
DECIDE, LAGS, GRASPS, STOPS, REVIEWS = 1, 2, 4, 8, 16

#: Time to the catch within which the hand may hide the ball, and it is not taken for lost [s].
SOON = 0.1

#: Time to the catch from which the hand comes so near the ball's images that its own light and the
#: rim that it hides move their centroids [s], until ``SOON`` after it, and what that adds to a
#: sighting's error [m].
BESIDE, TOUCHED = 0.08, 0.002

#: Time from the start of the closing in which the ball may strike [s]: it comes 20 to 29 ms after.
#: Multiple of the hardest impact by :mod:`mitt.impact` that is still no fault of an encoder. Both
#: are choices of this project.
STRIKES, NO_FAULT = 0.05, 1.5


@kernel
def tick(
    images: tuple[Image, ...],
    backgrounds: tuple[Image, ...],
    apart: int,
    t_exposed: float,
    t: float,
    q: Array,
    dq: Array,
    brake: Array,
    state: State,
    result: Result,
) -> int:
    """See, estimate, generate by the map, close, track.

    Args:
        images: One a camera, shape (height, width); empty where there is none.
        backgrounds: As of :func:`mitt.vision.localization.localize`.
        apart: Those not exposed at ``t_exposed``, a bit each.
        t_exposed: Instant of the exposure [s].
        t: Time of the tick [s].
        q: Encoders [rad], shape (n,).
        dq: Encoders [rad/s], shape (n,).
        brake: q, dq, ddq while braking, a row each tick, shape (k, 3, n).
        state: All that is known and remembered, overwritten.
        result: That of the tick before, overwritten.

    Returns:
        What is to be thought about: bits.
    """
    perceive(images, backgrounds, apart, t_exposed, t, q, dq, state, result)
    refer(state, result)
    return int(act(brake, state, result))


@kernel
def perceive(
    images: tuple[Image, ...],
    backgrounds: tuple[Image, ...],
    apart: int,
    t_exposed: float,
    t: float,
    q: Array,
    dq: Array,
    state: State,
    result: Result,
) -> None:
    """Take encoders and images in and carry the estimate to the time of the command; see tick."""
    s, out = state.scalars[0], result.scalars[0]
    t, s.clock_fault = pass_time(state.health_memory, t)
    out.t, out.phase = t, s.phase
    beside = not s.surrogate and -SOON < out.time_to_catch < BESIDE
    out.inside, out.time_to_catch, out.sighted = False, np.inf, False
    out.following = s.phase == FOLLOW
    encoders = result.encoders
    for k in range(len(q)):
        encoders[0, k], encoders[1, k] = q[k], dq[k]
    _measure(state, result)
    if not s.begun:  # stay
        state.last[0], state.last[1] = state.estimated[0], state.estimated[1]
        state.desired[0] = state.estimated[0]
        s.begun = True
    if s.phase in (BRAKE, STOPPED):  # the estimate stays
        return
    if s.heads > 0:
        aim(state.eyes_heads, state.eyes_angles, state.eyes_cameras)
    _guide(images, t_exposed, beside, state, result)
    found = localize(
        images, backgrounds, apart, state.eyes_memory, state.eyes_settings, state.eyes_boxes,
        state.eyes_cameras, state.eyes_ball, state.eyes_work, state.z, state.R,
    )  # fmt: skip
    out.sighted, out.t_sighted = found and t_exposed <= t + TICK, t_exposed
    if out.sighted:  # a sighting of the future is one of a clock that was set
        if beside:
            for k in range(3):
                state.R[k, k] += TOUCHED * TOUCHED
        update(state.ball_memory, t_exposed, state.z, state.R, state.ball_settings, state.ball_work)
    for k in range(3):
        result.sighting[0, k] = state.z[k]
        for j in range(3):
            result.sighting[1 + k, j] = state.R[k, j]
    memory = state.ball_memory
    tracked = predict(
        memory, t, state.ball_settings, result.ball, result.covariance, state.ball_work
    )
    out.tracked, out.t_ball = tracked, t
    out.led = tracked and memory[at.BEST] > 0.0
    out.drag = memory[at.DRAG] if tracked else 0.0
    out.t_seen = memory[at.T_SEEN] if tracked else -np.inf
    out.t_first = memory[at.T_FIRST] if tracked else -np.inf
    if s.heads > 0:
        _turn_heads(images, t_exposed, state, result)


@kernel
def _guide(
    images: tuple[Image, ...], t_exposed: float, beside: bool, state: State, result: Result
) -> None:
    """Tell the eyes what the estimate of the tick before says of the ball; see :func:`tick`."""
    out = result.scalars[0]
    memory, ball = state.eyes_memory, result.ball
    rig, shown = memory[len(memory) - 1], False
    for n in range(len(images)):
        shown |= images[n].size > 0
    if shown:
        guide(rig, ball[0], ball[1], t_exposed - out.t_ball, TICK, out.sigma, not beside)


@kernel
def _measure(state: State, result: Result) -> None:
    """Let the monitor estimate the joints; the ball may strike soon after the fingers close."""
    s, out = state.scalars[0], result.scalars[0]
    may_strike, blow = state.closing[0] <= out.t <= state.closing[0] + STRIKES, state.blow
    for k in range(len(blow)):
        blow[k] = NO_FAULT * abs(state.jump[k]) if may_strike else 0.0
    s.encoder_fault = believe(
        state.encoder_memory, state.encoder_bounds, state.encoder_table[0], state.encoder_doubt,
        state.encoder_coupling, result.encoders, result.command, s.braked, blow, state.estimated,
    )  # fmt: skip


@kernel
def _turn_heads(images: tuple[Image, ...], t_exposed: float, state: State, result: Result) -> None:
    """Let the heads look where the ball will be when the command acts; see :func:`tick`."""
    s, out = state.scalars[0], result.scalars[0]
    for n in range(len(images)):
        if images[n].size > 0:
            s.t_exposed = t_exposed
    motion, ball = state.target, result.ball
    for i in range(3):
        motion[0, i], motion[1, i] = ball[0, i] + TICK * ball[1, i], ball[1, i]
    lead(
        state.eyes_heads,
        state.eyes_cameras,
        state.eyes_memory,
        state.eyes_gaze,
        motion,
        out.tracked and out.t - out.t_seen < LET_GO,
        s.t_exposed,
        out.t + TICK,
        state.eyes_gaze_work,
        result.gaze,
    )


@kernel
def refer(state: State, result: Result) -> None:
    """Ask the map for the desired motion; while the verdict is open, for the ball's stand-in."""
    s, out = state.scalars[0], result.scalars[0]
    if s.phase != FOLLOW:
        return
    target, rows = state.target, result.reference
    target[:] = result.ball
    if s.surrogate:
        level(target, s.waiting_height)
    rows[3] = state.start
    if reference(
        state.packed, state.powers, state.window, state.alpha, target, rows, state.map_work
    ):
        out.inside = True
        out.time_to_catch = time_to_catch(state.packed, rows)


@kernel
def act(brake: Array, state: State, result: Result) -> int:
    """Close the hand and track what was asked, or what braking takes; see :func:`tick`."""
    s, out = state.scalars[0], result.scalars[0]
    t, phase, desired, estimated = out.t, s.phase, state.desired, state.estimated
    if phase == FOLLOW:
        if out.inside:
            desired[:] = result.reference[:3]
        else:
            desired[1:] = 0.0
    elif phase == BRAKE:
        desired[:] = brake[min(max(round((t - s.t_brake) / TICK), 0), len(brake) - 1)]
    elif phase == STOPPED:
        _slow_down(state)
    result.command[:3] = desired
    passed = guard(
        state.bodies,
        state.shapes,
        state.pairs,
        state.bounds,
        state.drives,
        state.active,
        state.last,
        result.command[:3],
        state.guard_known,
        state.guard_work,
        state.guard_reserve,
    )
    out.hand = close(state.closing, state.grip, t, out.time_to_catch)
    derate(
        state.drives, state.active, state.encoder_memory, estimated[1], result.command,
        state.encoder_doubt, state.jump, s.torque_lead, state.closing[0] < np.inf,
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
        state.track_notes,
    )
    _report(passed == BLOCKED, state, result)
    _engage(state, result)
    bring(
        state.bodies, state.active, estimated, state.encoder_table[1], state.room_tau,
        state.room_mass, state.room_work, state.encoder_work, result.command,
        state.encoder_doubt, state.encoder_coupling,
    )  # fmt: skip
    if s.braked:
        result.command[4] = 0.0
    if s.phase == STOPPED:
        return STOPS if phase != STOPPED else 0
    if phase == WATCH:
        return DECIDE if out.tracked else 0
    return _afterwards(state, result) if phase == FOLLOW else 0


@kernel
def _slow_down(state: State) -> None:
    """Want of the joints to brake as hard as the drives can, all at once."""
    choose_stop(
        state.bodies,
        state.drives,
        state.active,
        state.bounds,
        state.last,
        HARDEST,
        state.guard_reserve,
    )
    stop_by(state.bounds, state.last, state.guard_reserve, state.desired)


@kernel
def _engage(state: State, result: Result) -> None:
    """Engage the brakes once a joint is not measured; no torques from when they act."""
    s, out = state.scalars[0], result.scalars[0]
    if s.encoder_fault > BRIDGED and not out.brakes:
        out.brakes, s.t_brakes_on = True, out.t
    if out.brakes and out.t - s.t_brakes_on > s.brake_delay - 0.5 * TICK:
        s.braked = True
        result.command[3] = 0.0


@kernel
def _report(blocked: bool, state: State, result: Result) -> None:
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
    out.health, out.reason = assess(
        state.health_memory,
        s.clock_fault,
        s.encoder_fault,
        blocked,
        s.phase == FOLLOW,
        out.inside and abs(out.time_to_catch) < SOON,
        out.age,
        out.sigma,
        s.tolerance,
        R[0, 0] + R[1, 1] + R[2, 2] > at.LOOSE,
        gap,
        s.stray,
    )
    if s.stop_requested:
        out.health, out.reason = ABORT, ASKED
    if out.health == ABORT:
        s.phase = STOPPED
        if gap > s.stray and s.encoder_fault <= BRIDGED:
            state.last[0], state.last[1], state.last[2] = estimated[0], estimated[1], 0.0


@kernel
def _afterwards(state: State, result: Result) -> int:
    """Return what is to be thought about while a ball is followed."""
    s, out = state.scalars[0], result.scalars[0]
    todo = DECIDE if s.surrogate else 0
    soon = out.inside and out.time_to_catch < s.adapt_until
    if s.several and not soon and out.t - s.t_reviewed >= s.review:
        s.t_reviewed = out.t
        todo |= REVIEWS
    if out.inside and not soon:
        reference, estimated = result.reference, state.estimated
        gap = largest_gap(reference[0], estimated[0]) / s.adapt_q
        lag = largest_gap(reference[1], estimated[1]) / s.adapt_dq
        if max(gap, lag) >= 1.0:
            todo |= LAGS
    if has_closed(state.closing, state.grip, out.t + TICK, True) and (
        has_closed(state.closing, state.grip, out.t + TICK, False)
        or short_of_room(
            state.bodies, state.active, state.room, result.command, state.room_tau, state.room_mass,
            state.room_work,
        )
    ):  # fmt: skip
        todo |= GRASPS
    return todo


@kernel
def undecided(todo: int, state: State, result: Result) -> bool:
    """Say that all there is to be thought about is a verdict that cannot be given yet.

    The ball is not known well enough at its catch, and the verdict is not due; or the ball was
    far, and it is too soon to look again. Saves a compiled loop the way
    through ``Catcher.think``, which finds the same.

    Args:
        todo: What a tick returned.
        state: As for :func:`tick`.
        result: As for :func:`tick`.
    """
    s, out = state.scalars[0], result.scalars[0]
    if todo != DECIDE or s.phase != WATCH:
        return False
    if out.t_ball < s.t_look:
        return True
    if s.sigma_ready == np.inf:
        return False
    if out.t_ball - out.t_first >= s.watch:
        return False
    motion, q_o, within = np.empty(10), state.start.copy(), state.trusted
    lay_state(result.ball, out.drag, out.led, motion)
    sigma = sigma_at_catch(
        state.packed, motion, out.drag, result.covariance, within[0], within[1], q_o,
        state.map_work,
    )  # fmt: skip
    return bool(sigma > s.sigma_ready)
