"""Whether the arm can come to standstill without touching itself or what stands around it.

From q, dq every joint brakes at a constant rate of its own. The way to standstill is walked by
conservative advancement, for each pair of shapes by itself: where their gap is d, they get no
closer than d minus what the joints between the two can still change it by, and so far the arm can
be moved on without looking. Nothing thin is stepped over, in open space one look is enough, and a
wrist that is always near the forearm does not hold up the look at the shoulder. Where joints have a
jerk limit, the way is that of :func:`mitt.core.control.envelope.slow_down`, tick by tick.

**Certified, and why it lasts.** With each emitted motion x = (q, dq, ddq) a stop is remembered: the
decelerations B of all joints, with which it stays in the ranges, keeps ``STOP_CLEARANCE`` from
everything, and takes at most the drives' torques, with the load and without it; where joints have
a jerk limit, B are the trusted ones, and the stop is that of
:func:`mitt.core.control.envelope.slow_down`. By induction: an x
is emitted if such a stop is found for it; where none is found, the arm is led along the stop of the
tick before, and what is left of that is a stop again. That rests on decelerations, jerk, ranges,
torques and shapes: none of them changes during a throw. The ball does, so the decelerations, the
largest accelerations and the jerk are the least of the arm with it and without it, from the first
tick on, and the torque of a stop is that of both. What takes up the ball or lets it go changes the
model that the torques are computed with (``CatcherState.arm``), and nothing in :class:`Safety`. A
new start, as by ``recover``, certifies a motion at rest. A stop far from the command begins at the
estimate, which nothing has certified. The one thing that changes is ``dq_max``, kept lower where a
ball will drive a joint on: a stop does not depend on it. A joint that is faster than a new
``dq_max`` brakes, and where that is blocked it is led along its stop like any other.

**The arm itself.** As the drives can make the stop, the arm stays beside its command while it
stops. Before, it may lag: after a jump of the ball's estimate a command may turn faster than any
drive. So the same decelerations have to bring it to rest clear from where it is, too, at its own
speed and at that of the command, to which it is driven. That is looked at in each tick, and is no
proof: what the model does not know, as an impact or friction, moves the arm otherwise. The ranges
of the measured joints are guarded besides (:func:`mitt.core.control.envelope.bound_acceleration`).
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mitt.core.arm.arm import Arm, Tables
from mitt.core.arm.shapes import (
    MARGIN,
    Shapes,
    Surroundings,
    clearance,
    gap,
    place_shapes,
    shapes_of,
)
from mitt.core.control.envelope import LONGEST, bounds_of, braked, clamp, slow_down
from mitt.core.control.stop import (
    EASIEST,
    HARDEST,
    SHARE,
    StopWork,
    choose_stop,
    fit_rates,
    gentle_rates,
    share_of_smooth_stop,
    share_of_stop,
    stop_by,
    stop_work,
)
from mitt.core.kernels import Record, copy, kernel
from mitt.core.signals import Array

STOP_CLEARANCE = MARGIN + 0.002
"""Gap that a stop keeps [m]. The arm is to keep ``MARGIN``, and strays from its stop by up to
1.8 mm after a wish that jumps; seldom by more (docs/safety.md, Figures)."""
#: Room of a pair that counts as none [m] unless it suffices: with less, every look would lead the
#: next one hardly on.
_SLIVER = 0.0005
#: Looks along the way; if they do not suffice it counts as blocked.
_LOOKS = 40
#: What the sums of a bound on the room may be off by: rounding [m].
_TRIFLE = 1e-12

#: Kinds of stops that are tried: that of the tick before, the gentle one, all joints at their
#: trusted decelerations, and all in the ratio of their speeds.
_BEFORE = 0
_GENTLE = 1
_TRUSTED = 2
_TOGETHER = 3
#: Scalings of a stop, the share of torque that they aim at, and the least that needs no other.
_SCALINGS = 3
_AIM = 0.93
_SLACK = 0.85

#: What became of a desired motion: passed as it was, kept within the limits, replaced by braking.
PASSED = 0
KEPT = 1
BLOCKED = 2


class Walk(NamedTuple):
    """Scratch for the way to standstill."""

    row: Array  # (3, n) q, dq, ddq where it is looked at
    after: Array  # (3, n) a tick later
    left: Array  # (n,) way of each joint from there on [rad]
    pairs: NDArray[np.int64]  # (p,) those that are not known to stay apart, first
    room: Array  # (p,) of these at least [m]


class Safety(NamedTuple):
    """What the safety filter knows of an arm and of what stands around it.

    Attributes:
        arm: As of ``Arm.tables``, without a load.
        loaded: Its links with the load that it may take up, as of ``Arm.bodies``, shape (N,).
        bounds: Limits of type :data:`mitt.core.control.envelope.BOUNDS`, of which ``deceleration``,
            ``gentle`` and ``jerk`` are those that hold with the load and without it, shape (n,).
        shapes: ``Shapes.table``, shape (m,).
        pairs: Those to be kept apart, shape (p, 2).
        slopes: ``Shapes.slopes``, shape (p, n).
        measured: Where the commanded arm was last looked at [rad], and how much room each pair had
            there at least, beyond ``STOP_CLEARANCE`` [m], shape (n + p,).
        near: The same of the arm itself.
        certified: q, dq, ddq emitted last, and the decelerations of a stop from there that is clear
            and that the drives can make; zero where none is known, shape (4, n).
        ends, walk, led, stop: Scratch.
    """

    arm: Tables
    loaded: Record
    bounds: Record
    shapes: Record
    pairs: NDArray[np.int64]
    slopes: Array
    measured: Array
    near: Array
    certified: Array
    ends: Record
    walk: Walk
    led: Array
    stop: StopWork


def safety_of(arm: Arm, around: Surroundings, load: float = 0.0) -> Safety:
    """Return what the safety filter knows of an arm; nothing was measured yet.

    Args:
        arm: The arm, without a load.
        around: What stands around it.
        load: Mass that it may take up at its catch point, at any time [kg].
    """
    (shapes, bounds), n = _shapes_and_bounds(arm, around, load), arm.n
    p = len(shapes.pairs)
    unknown = np.concatenate([np.zeros(n), np.full(p, -np.inf)])
    return Safety(
        arm.tables,
        arm.holding(load).bodies,
        bounds.copy(),
        shapes.table,
        shapes.pairs,
        shapes.slopes,
        unknown,
        unknown.copy(),
        np.zeros((4, n)),
        shapes.ends,
        Walk(
            np.zeros((3, n)),
            np.zeros((3, n)),
            np.zeros(n),
            np.zeros(p, dtype=np.int64),
            np.zeros(p),
        ),
        np.zeros((3, n)),
        stop_work(arm),
    )


@lru_cache(maxsize=32)
def _shapes_and_bounds(arm: Arm, around: Surroundings, load: float) -> tuple[Shapes, Record]:
    """Return shapes and limits; they are worked out once, not each throw."""
    shapes, bounds, loaded = shapes_of(arm, around), bounds_of(arm), arm.holding(load)
    for name in ("deceleration", "jerk", "ddq_max"):
        bounds[name] = np.minimum(bounds[name], bounds_of(loaded)[name])
    most = bounds["deceleration"]
    bounds["gentle"] = np.minimum(gentle_rates(arm, most), gentle_rates(loaded, most))
    return shapes, bounds


@kernel
def safety_filter(s: Safety, last: Array, desired: Array, estimated: Array) -> int:
    """Replace a desired motion by what is emitted, and remember it with its stop.

    A motion from which no stop is found is not emitted: the joints brake from where they are
    instead, along the stop that was found in the tick before. Motion from which there was none from
    the start may only lead out.

    Args:
        s: What is known.
        last: q, dq, ddq emitted in the tick before, overwritten, shape (3, n).
        desired: q_d, dq_d, ddq_d; q, dq, ddq afterwards, shape (3, n).
        estimated: q, dq of the arm itself, shape (2, n).

    Returns:
        ``PASSED``, ``KEPT`` or ``BLOCKED``.
    """
    result, rates = KEPT if clamp(s.bounds, last, desired) else PASSED, s.stop.rates
    known = find_stop(s, desired, estimated)
    if not known:
        known = _is_certified(s, last)
        if known:
            copy(s.certified[3], rates)
        if known or not _leads_out(s, last, desired):
            result = BLOCKED
            stop_by(s.bounds, last, rates, desired)
    copy(desired, last)
    copy(desired, s.certified[:3])
    copy(rates, s.certified[3])
    if not known:
        s.certified[3] = 0.0
    return result


@kernel
def _is_certified(s: Safety, motion: Array) -> bool:
    """Say whether a motion is the one that was emitted last, and a stop from it is known."""
    same = s.certified[3, 0] > 0.0
    for i in range(3):
        for k in range(motion.shape[1]):
            same &= motion[i, k] == s.certified[i, k]
    return bool(same)


@kernel
def _moves(motion: Array) -> bool:
    """Say whether a joint moves."""
    moves = False
    for k in range(motion.shape[1]):
        moves |= motion[1, k] != 0.0
    return bool(moves)


@kernel
def _has_jerk_limit(b: Record) -> bool:
    """Say whether a joint has a jerk limit."""
    limited = False
    for k in range(len(b)):
        limited |= not np.isinf(b[k].jerk)
    return bool(limited)


@kernel
def find_stop(s: Safety, motion: Array, estimated: Array) -> bool:
    """Say whether a stop is found that the drives can make and that is clear: ``s.stop.rates``.

    Clear from the motion, and at the same decelerations from where the arm is. The stop of the tick
    before is tried first, and the gentle one. Then, as hard as the drives can make them: that of
    the tick before, all joints in the ratio of their trusted decelerations, and all in the ratio of
    their speeds, so that they come to rest together.

    Where joints have a jerk limit, there is one stop alone, that of
    :func:`mitt.core.control.envelope.slow_down`.
    """
    moves = _moves(motion)
    if _has_jerk_limit(s.bounds):
        _write_rates(s, motion, _TRUSTED)
        return bool(
            _both_stop_clear(s, motion, estimated) and _least_share(s, motion, HARDEST) <= SHARE
        )
    for kind in (_BEFORE, _GENTLE):
        _write_rates(s, motion, kind)
        if not _both_stop_clear(s, motion, estimated):
            continue
        if not moves or share_of_stop(s.arm, s.loaded, motion, s.stop) <= SHARE:
            return True
    _write_rates(s, motion, _TRUSTED)
    if not _both_stop_clear(s, motion, estimated):  # not even the shortest stop of all
        return False
    for kind in (_BEFORE, _TRUSTED, _TOGETHER):
        _write_rates(s, motion, kind)
        if _harden(s, motion) and _both_stop_clear(s, motion, estimated):
            return True
    return False


@kernel
def _write_rates(s: Safety, motion: Array, kind: int) -> None:
    """Write ``s.stop.rates`` of a kind of stop, as the ranges take it; see :func:`find_stop`."""
    b, rates, longest, n = s.bounds, s.stop.rates, 0.0, motion.shape[1]
    for k in range(n):
        longest = max(longest, abs(motion[1, k]) / b[k].deceleration)
    for k in range(n):
        rates[k] = b[k].deceleration
        if kind == _BEFORE and s.certified[3, k] > 0.0:
            rates[k] = s.certified[3, k]
        elif kind in (_BEFORE, _GENTLE):
            rates[k] = b[k].gentle
        elif kind == _TOGETHER:
            rates[k] = max(abs(motion[1, k]) / max(longest, 1e-9), 0.02 * b[k].deceleration)
    fit_rates(b, motion, rates)


@kernel
def _harden(s: Safety, motion: Array) -> bool:
    """Scale ``s.stop.rates`` to what the drives can make; say whether they can."""
    rates = s.stop.rates
    for _ in range(_SCALINGS):
        share = share_of_stop(s.arm, s.loaded, motion, s.stop)
        if _SLACK <= share <= SHARE:
            return True
        for k in range(len(rates)):
            rates[k] *= _AIM / share
        fit_rates(s.bounds, motion, rates)
    return bool(share_of_stop(s.arm, s.loaded, motion, s.stop) <= SHARE)


@kernel
def _both_stop_clear(s: Safety, motion: Array, estimated: Array) -> bool:
    """Say whether the stop at ``s.stop.rates`` is clear, of a motion and of the arm itself.

    The arm begins it where it is, and as fast as it is or as the motion, to which it is driven. One
    that stands too close already is led by the command alone, which is clear.
    """
    led, n = s.led, motion.shape[1]
    if not _stops_clear(s, motion, s.measured):
        return False
    copy(motion, led)
    copy(estimated[0], led[0])
    clear = bool(_stops_clear(s, led, s.near))
    copy(estimated[1], led[1])
    clear = clear and bool(_stops_clear(s, led, s.near))
    if clear or not _moves(motion):
        return True
    nearest = np.inf
    for i in range(len(s.pairs)):
        nearest = min(nearest, s.near[n + i])
    return bool(nearest < 0.0)


@kernel
def _stops_clear(s: Safety, motion: Array, known: Array) -> bool:
    """Say whether the stop from a motion keeps ``STOP_CLEARANCE``, at ``s.stop.rates`` or smoothly.

    Args:
        s: What is known.
        motion: q, dq, ddq, shape (3, n).
        known: As ``Safety.measured``, overwritten.
    """
    if _has_jerk_limit(s.bounds):
        return bool(_stops_clear_smoothly(s, motion, known))
    return bool(_stops_clear_at(s, motion, s.stop.rates, known))


@kernel
def _leads_out(s: Safety, last: Array, desired: Array) -> bool:
    """Say whether motion from which no stop is known may go on; else ``s.stop.rates`` stop it.

    It may where that takes no more torque to stop, and the arm stands too close already and gets no
    closer, or stops clear.
    """
    share = _least_share(s, desired, EASIEST)
    out = bool(_stops_clear(s, desired, s.measured))
    if not out:
        before = clearance(s.arm.bodies, last[0], s.shapes, s.pairs, s.ends)
        after = clearance(s.arm.bodies, desired[0], s.shapes, s.pairs, s.ends)
        out = before < STOP_CLEARANCE and after > before
    least = _least_share(s, last, HARDEST)
    return bool(out and share <= max(least, SHARE))


@kernel
def _least_share(s: Safety, motion: Array, first: int) -> float:
    """Return the share of torque of a stop, as of :func:`mitt.core.control.stop.choose_stop`."""
    if _has_jerk_limit(s.bounds):
        return float(share_of_smooth_stop(s.arm, s.loaded, s.bounds, motion, s.stop))
    return float(choose_stop(s.arm, s.loaded, s.bounds, motion, first, s.stop))


@kernel
def _stops_clear_at(s: Safety, motion: Array, rates: Array, known: Array) -> bool:
    """Say the same of joints that brake at constant rates.

    Args:
        s: What is known.
        motion: q, dq in the first two rows, shape (2 or more, n).
        rates: Decelerations [rad/s^2], shape (n,).
        known: As ``Safety.measured``, overwritten.
    """
    row, left, t, count = s.walk.row, s.walk.left, 0.0, 0
    for look in range(_LOOKS):
        for k in range(len(rates)):
            speed = abs(motion[1, k])
            passed = min(t, speed / rates[k])
            gone = passed * (speed - 0.5 * rates[k] * passed)
            row[0, k] = motion[0, k] + np.copysign(gone, motion[1, k])
            row[1, k] = max(speed - rates[k] * t, 0.0)
            left[k] = 0.5 * speed * speed / rates[k] - gone
        if look == 0:
            count = _look_first(s, known)
        else:
            _measure(s, count)
        count, step = _keep_open(s, count, _SLIVER)
        if count <= 0:
            return bool(count == 0)
        t += step
    return False


@kernel
def _stops_clear_smoothly(s: Safety, motion: Array, known: Array) -> bool:
    """Say the same where joints have a jerk limit: the way to standstill is walked tick by tick."""
    b, row, after, left = s.bounds, s.walk.row, s.walk.after, s.walk.left
    for k in range(motion.shape[1]):
        dq, ddq, jerk = motion[1, k], motion[2, k], b[k].jerk
        whole, _ = braked(dq, ddq, b[k].deceleration, jerk, np.inf)
        turns = 0.5 * ddq * ddq / jerk > abs(dq)  # there and back
        left[k] = 2.0 * whole if turns else whole
    copy(motion, row)
    count = _look_first(s, known)
    for _ in range(LONGEST):
        count, _ = _keep_open(s, count, 0.0)
        if count <= 0 or not np.any(row[1:]):
            return bool(count >= 0)
        slow_down(b, row, after)
        least = np.inf
        for i in range(count):
            for k in range(motion.shape[1]):
                s.walk.room[i] -= s.slopes[s.walk.pairs[i], k] * abs(after[0, k] - row[0, k])
            least = min(least, s.walk.room[i])
        for k in range(motion.shape[1]):
            left[k] -= abs(after[0, k] - row[0, k])
        copy(after, row)
        if least < 0.0:
            _measure(s, count)
    return False


@kernel
def _look_first(s: Safety, known: Array) -> int:
    """Write the pairs that may meet on the way, and their room at its start; return how many.

    The room that is remembered, less what the arm has moved since, settles the others: they are not
    measured.

    Args:
        s: What is known; the way is at its start.
        known: As ``Safety.measured``, overwritten.
    """
    row, left, w, n, count = s.walk.row, s.walk.left, s.walk, len(s.bounds), 0
    for i in range(len(s.pairs)):
        moved, may = 0.0, 0.0
        for k in range(n):
            moved += s.slopes[i, k] * abs(row[0, k] - known[k])
            may += s.slopes[i, k] * left[k]
        if moved > 0.0:
            known[n + i] -= moved + _TRIFLE
        if known[n + i] <= may:
            w.pairs[count] = i
            count += 1
    copy(row[0], known[:n])
    _measure(s, count)
    for i in range(count):
        known[n + w.pairs[i]] = w.room[i]
    return count


@kernel
def _measure(s: Safety, count: int) -> None:
    """Measure the room of the first so many of ``s.walk.pairs``, where the way is."""
    if count == 0:
        return
    place_shapes(s.arm.bodies, s.walk.row[0], s.shapes, s.ends)
    for i in range(count):
        pair = s.pairs[s.walk.pairs[i]]
        s.walk.room[i] = gap(s.shapes, s.ends, pair[0], pair[1]) - STOP_CLEARANCE


@kernel
def _keep_open(s: Safety, count: int, least: float) -> tuple[int, float]:
    """Drop pairs whose room suffices for the way that is left.

    Args:
        s: What is known.
        count: How many pairs there are, with their room.
        least: Room that the others need [m].

    Returns:
        How many are left, -1 if one of them has less room; and how long they stay apart if no joint
        gets faster [s].
    """
    row, left, w, kept, step = s.walk.row, s.walk.left, s.walk, 0, np.inf
    for i in range(count):
        pair, room, may, pace = w.pairs[i], w.room[i], 0.0, 0.0
        for k in range(len(left)):
            may += s.slopes[pair, k] * left[k]
            pace += s.slopes[pair, k] * abs(row[1, k])
        if may <= room and room >= 0.0:
            continue
        if room < least:
            return -1, 0.0
        w.pairs[kept], w.room[kept] = pair, room
        kept += 1
        step = min(step, room / max(pace, _TRIFLE))
    return kept, step
