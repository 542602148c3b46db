"""One tick, from images to torque, in one compiled call.

    images -> localize -> update, predict -> reference -> close, track -> torques, fingers

The kernels are those of the stages, composed; none is written a second time. All that they know
and remember lies in one record, ``state``; what a tick brings about lies in another, ``result``
(:mod:`mitt.catcher.state`).

A generator that is no map takes the same way in two halves, :func:`perceive` and :func:`act`, with
its own ``reference`` between them.
"""

import numpy as np

from mitt.ball import memory as at
from mitt.ball.estimator import predict, update
from mitt.catcher.state import BRAKE, FOLLOW, STOPPED, WATCH, Record
from mitt.control.encoders import bring
from mitt.control.envelope import TICK
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
from mitt.signals import Array, Image
from mitt.views import lent
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
    state: Record,
    result: Record,
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
        result: What the tick brings about.

    Returns:
        What is to be thought about: bits.
    """
    images, backgrounds, q, dq = lent((images, backgrounds, q, dq))
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
    state: Record,
    result: Record,
) -> None:
    """Take encoders and images in and carry the estimate to the time of the command; see tick."""
    s, out = lent(state)[0], lent(result)[0]
    t, s["clock"] = pass_time(s["condition"], t)
    out["t"], out["phase"] = t, s["phase"]
    beside = not s["open"] and -SOON < out["time_to_catch"] < BESIDE
    out["inside"], out["time_to_catch"] = False, np.inf
    out["following"] = s["phase"] == FOLLOW
    encoders = out["encoders"]
    for k in range(len(q)):
        encoders[0, k], encoders[1, k] = q[k], dq[k]
    _measure(state, result)
    if not s["begun"]:  # nothing is wanted yet but to stay
        s["last"][0], s["last"][1] = s["believed"][0], s["believed"][1]
        s["wanted"][0] = s["believed"][0]
        s["begun"] = True
    if s["phase"] in (BRAKE, STOPPED):  # the estimate stays
        return
    if s["heads"] > 0:
        aim(s["eyes_heads"], s["eyes_angles"], s["eyes_cameras"])
    _guide(images, t_exposed, beside, state, result)
    if (
        localize(
            images,
            backgrounds,
            apart,
            s["eyes_memory"],
            s["eyes_settings"],
            s["eyes_boxes"],
            s["eyes_cameras"],
            s["eyes_ball"],
            s["eyes_work"],
            s["z"],
            s["R"],
        )
        and t_exposed <= t + TICK
    ):  # a sighting of the future is one of a clock that was set
        if beside:
            for k in range(3):
                s["R"][k, k] += TOUCHED * TOUCHED
        update(s["ball_memory"], t_exposed, s["z"], s["R"], s["ball_settings"], s["ball_work"])
    memory = s["ball_memory"]
    tracked = predict(memory, t, s["ball_settings"], out["ball"], out["covariance"], s["ball_work"])
    out["tracked"], out["t_ball"] = tracked, t
    out["led"] = tracked and memory[at.BEST] > 0.0
    out["drag"] = memory[at.DRAG] if tracked else 0.0
    out["t_seen"] = memory[at.T_SEEN] if tracked else -np.inf
    out["t_first"] = memory[at.T_FIRST] if tracked else -np.inf
    if s["heads"] > 0:
        _turn_heads(images, t_exposed, state, result)


@kernel
def _guide(
    images: tuple[Image, ...], t_exposed: float, beside: bool, state: Record, result: Record
) -> None:
    """Tell the eyes what the estimate of the tick before says of the ball; see :func:`tick`."""
    s, out = state[0], result[0]
    memory, ball = s["eyes_memory"], out["ball"]
    rig, shown = memory[len(memory) - 1], False
    for n in range(len(images)):
        shown |= images[n].size > 0
    if shown:
        guide(rig, ball[0], ball[1], t_exposed - out["t_ball"], TICK, out["sigma"], not beside)


@kernel
def _measure(state: Record, result: Record) -> None:
    """Let the monitor estimate the joints; the ball may strike soon after the fingers close."""
    s, out = state[0], result[0]
    may_strike, blow = s["closing"][0] <= out["t"] <= s["closing"][0] + STRIKES, s["blow"]
    for k in range(len(blow)):
        blow[k] = NO_FAULT * abs(s["jump"][k]) if may_strike else 0.0
    s["encoders"] = believe(
        s["encoder_memory"], s["encoder_bounds"], s["encoder_table"][0], s["encoder_doubt"],
        s["encoder_coupling"], out["encoders"], out["told"], s["braked"], blow, s["believed"],
    )  # fmt: skip


@kernel
def _turn_heads(images: tuple[Image, ...], t_exposed: float, state: Record, result: Record) -> None:
    """Let the heads look where the ball will be when the command acts; see :func:`tick`."""
    s, out = state[0], result[0]
    for n in range(len(images)):
        if images[n].size > 0:
            s["t_exposed"] = t_exposed
    motion, ball = s["target"], out["ball"]
    for i in range(3):
        motion[0, i], motion[1, i] = ball[0, i] + TICK * ball[1, i], ball[1, i]
    lead(
        s["eyes_heads"],
        s["eyes_cameras"],
        s["eyes_memory"],
        s["eyes_gaze"],
        motion,
        out["tracked"] and out["t"] - out["t_seen"] < LET_GO,
        s["t_exposed"],
        out["t"] + TICK,
        s["eyes_gaze_work"],
        out["gaze"],
    )


@kernel
def refer(state: Record, result: Record) -> None:
    """Ask the map for the desired motion; while the verdict is open, for the ball's stand-in."""
    s, out = lent(state)[0], lent(result)[0]
    if s["phase"] != FOLLOW:
        return
    target, rows = s["target"], out["asked"]
    target[:] = out["ball"]
    if s["open"]:
        level(target, s["waiting_height"])
    rows[3] = s["start"]
    if reference(s["packed"], s["powers"], s["window"], s["alpha"], target, rows, s["map_work"]):
        out["inside"] = True
        out["time_to_catch"] = time_to_catch(s["packed"], rows)


@kernel
def act(brake: Array, state: Record, result: Record) -> int:
    """Close the hand and track what was asked, or what braking takes; see :func:`tick`."""
    s, out, brake = lent(state)[0], lent(result)[0], lent(brake)
    t, phase, wanted, believed = out["t"], s["phase"], s["wanted"], s["believed"]
    if phase == FOLLOW:
        if out["inside"]:
            wanted[:] = out["asked"][:3]
        else:
            wanted[1:] = 0.0
    elif phase == BRAKE:
        wanted[:] = brake[min(max(round((t - s["t_brake"]) / TICK), 0), len(brake) - 1)]
    elif phase == STOPPED:
        _slow_down(state)
    out["told"][:3] = wanted
    passed = guard(
        s["bodies"],
        s["shapes"],
        s["pairs"],
        s["bounds"],
        s["drives"],
        s["index"],
        s["last"],
        out["told"][:3],
        s["guard_known"],
        s["guard_work"],
        s["guard_reserve"],
    )
    out["hand"] = close(s["closing"], s["grip"], t, out["time_to_catch"])
    derate(
        s["drives"], s["index"], s["encoder_memory"], believed[1], out["told"], s["encoder_doubt"],
        s["jump"], s["torque_lead"], s["closing"][0] < np.inf, s["drives_now"],
    )  # fmt: skip
    out["saturated"] = track(
        s["bounds"],
        s["bandwidth"],
        s["drives_now"],
        s["bodies"],
        s["index"],
        believed[0],
        believed[1],
        out["told"],
        s["track_notes"],
    )
    _report(passed == BLOCKED, state, result)
    _engage(state, result)
    bring(
        s["bodies"], s["index"], believed, s["encoder_table"][1], s["room_tau"], s["room_mass"],
        s["room_work"], s["encoder_work"], out["told"], s["encoder_doubt"], s["encoder_coupling"],
    )  # fmt: skip
    if s["braked"]:
        out["told"][4] = 0.0
    if s["phase"] == STOPPED:
        return STOPS if phase != STOPPED else 0
    if phase == WATCH:
        return DECIDE if out["tracked"] else 0
    return _afterwards(state, result) if phase == FOLLOW else 0


@kernel
def _slow_down(state: Record) -> None:
    """Want of the joints to brake as hard as the drives can, all at once."""
    s = state[0]
    choose_stop(
        s["bodies"], s["drives"], s["index"], s["bounds"], s["last"], HARDEST, s["guard_reserve"]
    )
    stop_by(s["bounds"], s["last"], s["guard_reserve"], s["wanted"])


@kernel
def _engage(state: Record, result: Record) -> None:
    """Engage the brakes once a joint is not measured; no torques from when they act."""
    s, out = state[0], result[0]
    if s["encoders"] > BRIDGED and not out["brakes"]:
        out["brakes"], s["t_brakes"] = True, out["t"]
    if out["brakes"] and out["t"] - s["t_brakes"] > s["brake_delay"] - 0.5 * TICK:
        s["braked"] = True
        out["told"][3] = 0.0


@kernel
def _report(blocked: bool, state: Record, result: Record) -> None:
    """Write state, reason, age and sigma; from an abort on the arm stops and stays.

    The stop starts from the last command, or from the estimate where that is far from it: the way
    to the command would be one more motion.
    """
    s, out = lent(state)[0], lent(result)[0]
    P, believed, told = out["covariance"], s["believed"], out["told"]
    out["age"] = out["t"] - out["t_seen"]
    out["sigma"] = np.sqrt((P[0, 0] + P[1, 1] + P[2, 2]) / 3.0) if out["tracked"] else np.inf
    if out["state"] == ABORT:
        return
    R, gap = s["R"], largest_gap(told[0], believed[0])
    out["state"], out["reason"] = assess(
        s["condition"],
        s["clock"],
        s["encoders"],
        blocked,
        s["phase"] == FOLLOW,
        out["inside"] and abs(out["time_to_catch"]) < SOON,
        out["age"],
        out["sigma"],
        s["tolerance"],
        R[0, 0] + R[1, 1] + R[2, 2] > at.LOOSE,
        gap,
        s["stray"],
    )
    if s["asked_to_stop"]:
        out["state"], out["reason"] = ABORT, ASKED
    if out["state"] == ABORT:
        s["phase"] = STOPPED
        if gap > s["stray"] and s["encoders"] <= BRIDGED:
            s["last"][0], s["last"][1], s["last"][2] = believed[0], believed[1], 0.0


@kernel
def _afterwards(state: Record, result: Record) -> int:
    """Return what is to be thought about while a ball is followed."""
    s, out = lent(state)[0], lent(result)[0]
    todo = DECIDE if s["open"] else 0
    soon = out["inside"] and out["time_to_catch"] < s["adapt_until"]
    if s["several"] and not soon and out["t"] - s["t_reviewed"] >= s["review"]:
        s["t_reviewed"] = out["t"]
        todo |= REVIEWS
    if out["inside"] and not soon:
        asked, believed = out["asked"], s["believed"]
        gap = largest_gap(asked[0], believed[0]) / s["adapt_q"]
        lag = largest_gap(asked[1], believed[1]) / s["adapt_dq"]
        if max(gap, lag) >= 1.0:
            todo |= LAGS
    if has_closed(s["closing"], s["grip"], out["t"] + TICK, True) and (
        has_closed(s["closing"], s["grip"], out["t"] + TICK, False)
        or short_of_room(
            s["bodies"], s["index"], s["room"], out["told"], s["room_tau"], s["room_mass"],
            s["room_work"],
        )
    ):  # fmt: skip
        todo |= GRASPS
    return todo


@kernel
def undecided(todo: int, state: Record, result: Record) -> bool:
    """Say that all there is to be thought about is a verdict that cannot be given yet.

    The ball is not known well enough at its catch, and the verdict is not due; or the ball was
    far, and it is too soon to look again. Saves a compiled loop the way
    through ``Catcher.think``, which finds the same.

    Args:
        todo: What a tick returned.
        state: As for :func:`tick`.
        result: As for :func:`tick`.
    """
    s, out = state[0], result[0]
    if todo != DECIDE or s["phase"] != WATCH:
        return False
    if out["t_ball"] < s["t_look"]:
        return True
    if s["sigma_ready"] == np.inf:
        return False
    if out["t_ball"] - out["t_first"] >= s["watch"]:
        return False
    motion, q_o, within = np.empty(10), s["start"].copy(), s["trusted"]
    lay_state(out["ball"], out["drag"], out["led"], motion)
    sigma = sigma_at_catch(
        s["packed"], motion, out["drag"], out["covariance"], within[0], within[1], q_o,
        s["map_work"],
    )  # fmt: skip
    return bool(sigma > s["sigma_ready"])
