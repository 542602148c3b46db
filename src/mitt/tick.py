"""One tick, from images to torque, in one compiled call.

    images -> look -> absorb, speak -> reference -> close, track -> torques, fingers

The kernels are those of the stages, composed; none is written a second time. All that they know
and remember lies in one record, ``state``; what a tick brings about lies in another, ``result``
(:mod:`mitt.records`).

A generator that is no map takes the same way in two halves, :func:`perceive` and :func:`act`, with
its own ``reference`` between them.
"""

import numpy as np
from numba import njit

from mitt.control.hand import close, has_closed
from mitt.control.tracking import all_finite, largest_gap, track
from mitt.generator.certificate import level
from mitt.generator.mapping import reference, time_to_catch
from mitt.records import BRAKE, FOLLOW, WATCH, Record
from mitt.signals import Array, Image
from mitt.vision import memory as at
from mitt.vision.belief import absorb, speak
from mitt.vision.eyes import look

#: What is to be thought about after a tick, as bits of its result: the verdict is open, the ball
#: has left the arm behind, the fingers are about to have closed.
DECIDE, LAGS, GRASPS = 1, 2, 4

#: Time between two ticks [s].
TICK = 0.001


@njit(cache=True)
def tick(
    images: tuple[Image, ...],
    together: tuple[bool, ...],
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
        together: Whether each was exposed at ``t_exposed``.
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
    perceive(images, together, t_exposed, t, q, dq, state, result)
    refer(state, result)
    return int(act(brake, state, result))


@njit(cache=True)
def perceive(
    images: tuple[Image, ...],
    together: tuple[bool, ...],
    t_exposed: float,
    t: float,
    q: Array,
    dq: Array,
    state: Record,
    result: Record,
) -> None:
    """Take encoders and images in and carry the estimate to the time of the command; see tick."""
    s, out = state[0], result[0]
    out["t"], out["phase"] = t, s["phase"]
    out["inside"], out["time_to_catch"] = False, np.inf
    out["following"] = s["phase"] == FOLLOW
    encoders = out["encoders"]
    for k in range(len(q)):
        encoders[0, k], encoders[1, k] = q[k], dq[k]
    if all_finite(q) and all_finite(dq):
        s["believed"][:] = encoders
    if s["phase"] == BRAKE:  # the ball is where the hand is, and the estimate stays
        return
    if look(
        images,
        together,
        s["eyes_memory"],
        s["eyes_settings"],
        s["eyes_boxes"],
        s["eyes_cameras"],
        s["eyes_belief"],
        s["eyes_work"],
        s["z"],
        s["R"],
    ):
        absorb(s["ball_memory"], t_exposed, s["z"], s["R"], s["ball_settings"], s["ball_work"])
    memory = s["ball_memory"]
    tracked = speak(memory, t, s["ball_settings"], out["ball"], out["covariance"], s["ball_work"])
    out["tracked"], out["t_ball"] = tracked, t
    out["drag"] = memory[at.BALL + 6] if tracked else 0.0
    out["t_seen"] = memory[at.T_SEEN] if tracked else -np.inf
    out["t_first"] = memory[at.T_FIRST] if tracked else -np.inf


@njit(cache=True)
def refer(state: Record, result: Record) -> None:
    """Ask the map for the desired motion; while the verdict is open, for the ball's stand-in."""
    s, out = state[0], result[0]
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


@njit(cache=True)
def act(brake: Array, state: Record, result: Record) -> int:
    """Close the hand and track what was asked, or what braking takes; see :func:`tick`."""
    s, out = state[0], result[0]
    t, phase, wanted, believed = out["t"], s["phase"], s["wanted"], s["believed"]
    if phase == FOLLOW:
        if out["inside"]:
            wanted[:] = out["asked"][:3]
        else:
            wanted[1:] = 0.0
    elif phase == BRAKE:
        wanted[:] = brake[min(max(round((t - s["t_brake"]) / TICK), 0), len(brake) - 1)]
    out["hand"] = close(s["closing"], s["grip"], t, out["time_to_catch"])
    out["saturated"] = track(
        s["bounds"],
        s["bandwidth"],
        s["drives"],
        s["bodies"],
        s["index"],
        believed[0],
        believed[1],
        wanted,
        out["told"],
        s["track_notes"],
    )
    if phase == WATCH:
        return DECIDE if out["tracked"] else 0
    return _afterwards(state, result) if phase == FOLLOW else 0


@njit(cache=True)
def _afterwards(state: Record, result: Record) -> int:
    """Return what is to be thought about while a ball is followed."""
    s, out = state[0], result[0]
    todo = DECIDE if s["open"] else 0
    if out["inside"] and out["time_to_catch"] >= s["adapt_until"]:
        asked, believed = out["asked"], s["believed"]
        gap = largest_gap(asked[0], believed[0]) / s["adapt_q"]
        lag = largest_gap(asked[1], believed[1]) / s["adapt_dq"]
        if max(gap, lag) >= 1.0:
            todo |= LAGS
    if has_closed(s["closing"], s["grip"], out["t"] + TICK, True):
        todo |= GRASPS
    return todo
