"""The kernels of the ball filter: a sighting in, an estimate out; all is kept in one vector.

A sighting counts at its own time, whatever the order of arrival: the ring keeps the newest
sightings, each with the estimate before it; a late one is put in its place, and all after it are
processed again. The result is that of the right order, bit for bit. A sighting too old for the
ring is dropped; one whose time was seen before changes nothing.

No single sighting decides. One whose time is more than ``max_gap`` from the track's waits: where
``ROW`` of them come in a row, the clock was set or another throw has begun, and a new track begins
with them; one alone is dropped when the next sighting fits the time. And a point that comes back to
the last digit while the ball is elsewhere, as the origin that trackers send for a ball that they do
not see, is no ball; that is judged when it arrives.
"""

from math import isfinite

from mitt.ball import memory as at
from mitt.ball.flight import TRACK, acceleration, advance_uncertain, track_at
from mitt.ball.kalman import LEAST_VARIANCE, is_sane
from mitt.ball.linear import inverse
from mitt.ball.memory import (
    GATES,
    LIMITS,
    ROW,
    SCRATCH,
    SEEN,
    SLOT_ESTIMATE,
    SLOT_R,
    SLOT_TAKEN,
    SLOT_Z,
    WAIT,
    track_of,
)
from mitt.ball.motion_models import FLOOR, is_biased
from mitt.ball.reacquisition import begin, on_accepted, on_rejected, reconsider, try_sighting
from mitt.jit import kernel
from mitt.signals import GRAVITY, Array
from mitt.views import view

MAX_HORIZON = 2.0
"""Farthest that an estimate is carried [s]; no throw flies longer."""

_REMEMBERED, _ELSEWHERE = 16, 0.05
"""Sightings among which a point that comes back is looked for, and distance from it, along an axis,
at which another one lies elsewhere [m]: far beyond noise and steps of digits."""


@kernel
def is_tracked(memory: Array, settings: Array) -> bool:
    """Return whether there is an estimate."""
    return bool(memory[at.USED] >= settings[LIMITS, at.SPEAKS_AFTER])


@kernel
def update(memory: Array, t: float, z: Array, R: Array, settings: Array, work: Array) -> None:
    """Process a sighting; one that is not finite, absurd, repeated or too old is dropped.

    One of another time than the track's waits; see above.

    Args:
        memory: The filter's memory, shape (MEMORY,).
        t: Time of the exposure [s].
        z: Position [m], shape (3,).
        R: Its covariance [m^2], shape (3, 3).
        settings: Settings, shape SETTINGS.
        work: Scratch, shape WORK.
    """
    if not (isfinite(t) and is_sane(z, R)):
        memory[at.IGNORED] += 1.0
        return
    gap = settings[LIMITS, at.MAX_GAP]
    if memory[at.USED] > 0.0 and abs(t - memory[at.T_SEEN]) > gap:
        if not _waited(memory, t, z, R, gap):
            return
        memory[at.ALL_RESTARTS] += 1.0
        for number in (at.FILLED, at.USED, at.DOUBTFUL, at.RUN):
            memory[number] = 0.0
        for k in range(ROW):
            seen = WAIT + SEEN * k
            z_k = view(memory, seen + SLOT_Z, (3,))
            R_k = view(memory, seen + SLOT_R, (3, 3))
            _take(memory, memory[seen], z_k, R_k, settings, work)
    else:
        _take(memory, t, z, R, settings, work)
    memory[at.WAITING] = 0.0


@kernel
def _waited(memory: Array, t: float, z: Array, R: Array, gap: float) -> bool:
    """Let a sighting of another time wait; return whether it ends a row of them."""
    count = int(memory[at.WAITING])
    for k in range(count):
        apart = abs(t - memory[WAIT + SEEN * k])
        if apart == 0.0:
            memory[at.IGNORED] += 1.0
            return False
        if apart > gap:
            count = 0  # those before were single ones
            break
    seen = WAIT + SEEN * count
    memory[seen] = t
    for i in range(3):
        memory[seen + SLOT_Z + i] = z[i]
        for j in range(3):
            memory[seen + SLOT_R + 3 * i + j] = R[i, j]
    memory[at.WAITING] = count + 1.0
    return count + 1 == ROW


@kernel
def _take(memory: Array, t: float, z: Array, R: Array, settings: Array, work: Array) -> None:
    """Put a sighting in its place, and process it and all after it; see :func:`update`."""
    age, filled = 0, int(memory[at.FILLED])
    while age < filled and memory[at.slot_at(memory, age)] > t:
        age += 1
    if age < filled and memory[at.slot_at(memory, age)] == t:
        memory[at.IGNORED] += 1.0
        return
    if _comes_back(memory, age, z, settings):
        memory[at.IGNORED] += 1.0
        return
    if age > 0:
        after = at.slot_at(memory, age - 1)
        doubtful = memory[after + SLOT_ESTIMATE + at.DOUBTFUL]
        if filled == at.RING and age + doubtful >= filled:  # the ring lacks what could change
            memory[at.LATE] += 1.0
            return
        at.restore(memory, after)
    slot = at.open_slot(memory, age)
    definite = inverse(R[0, 0], R[0, 1], R[0, 2], R[1, 1], R[1, 2], R[2, 2])[0]
    exact = 0.0 if definite else LEAST_VARIANCE
    memory[slot] = t
    for i in range(3):
        memory[slot + SLOT_Z + i] = z[i]
        for j in range(3):
            memory[slot + SLOT_R + 3 * i + j] = R[i, j]
        memory[slot + SLOT_R + 4 * i] = max(R[i, i] + exact, LEAST_VARIANCE)
    for k in range(age, -1, -1):
        _process(memory, k, settings, work)


@kernel
def _comes_back(memory: Array, age: int, z: Array, settings: Array) -> bool:
    """Say whether a point was seen before, to the last digit, and the ball elsewhere.

    That is: a known track has rejected it, or a sighting since then lies elsewhere.
    """
    known = memory[at.USED] >= settings[GATES, at.MIN_SIGHTINGS]
    elsewhere = False
    for k in range(age, min(int(memory[at.FILLED]), age + _REMEMBERED)):
        slot, apart = at.slot_at(memory, k), 0.0
        for i in range(3):
            apart = max(apart, abs(memory[slot + SLOT_Z + i] - z[i]))
        if apart == 0.0 and (elsewhere or (known and memory[slot + SLOT_TAKEN] == 0.0)):
            return True
        elsewhere |= apart > _ELSEWHERE
    return False


@kernel
def _process(memory: Array, age: int, settings: Array, work: Array) -> None:
    """Process the sighting of a slot, after keeping the estimate before it."""
    slot = at.slot_at(memory, age)
    at.save(memory, slot)
    memory[slot + SLOT_TAKEN] = 0.0
    if memory[at.USED] == 0.0:
        if at.tells_position(memory, slot):
            begin(memory, slot, settings)
    elif try_sighting(memory, slot, settings, work):
        on_accepted(memory, slot)
        if is_biased(memory):
            reconsider(memory, age, settings, work)
    else:
        on_rejected(memory, age, settings, work)


@kernel
def predict(
    memory: Array, t: float, settings: Array, motion: Array, covariance: Array, work: Array
) -> bool:
    """Carry the estimate to an instant, without changing it.

    Args:
        memory: The filter's memory, shape (MEMORY,); only its scratch is changed.
        t: The instant [s].
        settings: Settings, shape SETTINGS.
        motion: Result: position, velocity, acceleration [m, m/s, m/s^2], shape (3, 3).
        covariance: Result, covariance of position and velocity, shape (6, 6).
        work: Scratch, shape WORK.

    Returns:
        Whether the ball is tracked; if not, or further than ``MAX_HORIZON`` from the last
        sighting, or beyond sightings that wait, the results are zero. The drag coefficient is in
        ``memory[DRAG]``.
    """
    origin = _speaks_of(memory, t)
    dt = t - memory[origin + at.T]
    motion[:, :] = 0.0
    covariance[:, :] = 0.0
    if not (is_tracked(memory, settings) and abs(dt) <= MAX_HORIZON) or _is_of_others(memory, t):
        return False
    best, active = int(memory[origin + at.BEST]), memory[origin + at.ACTIVE] > 0.0
    x, P = track_at(memory, SCRATCH)
    _carry(memory, origin, best, dt, settings, work)
    motion[0], motion[1] = x[:3], x[3:6]
    memory[at.DRAG] = x[6]
    acceleration(motion[1], x[6], motion[2])
    for i in range(3):
        motion[2, i] += x[7 + i]
    motion[2, 2] += GRAVITY - settings[best, at.GRAVITY_]
    weight = origin + at.WEIGHT
    _add_moment(motion, x, P, memory[weight + best] if active else 1.0, covariance)
    for model in range(at.MODELS):
        if active and model != best and memory[weight + model] > FLOOR:
            _carry(memory, origin, model, dt, settings, work)
            _add_moment(motion, x, P, memory[weight + model], covariance)
    return True


@kernel
def doubt(memory: Array, t: float, settings: Array, covariance: Array) -> None:
    """Add to the covariance of :func:`predict` what sightings say that were rejected last.

    They are outliers, or the ball was kicked at any instant since the last one that fits; the more
    of them in a row, the likelier. Either shows within ``max_rejection_time``.

    Args:
        memory: The filter's memory, shape (MEMORY,).
        t: The instant [s].
        settings: Settings, shape SETTINGS.
        covariance: Of position and velocity at that instant, overwritten, shape (6, 6).
    """
    origin = _speaks_of(memory, t)
    run, since = memory[origin + at.RUN], t - memory[origin + at.T_SEEN]
    if not (run > 0.0 and since > 0.0):
        return
    kick = run / (run + 1.0) * settings[GATES, at.KICK_SIGMA] ** 2
    for i in range(3):
        covariance[i, i] += kick * since * since
        covariance[i, 3 + i] += kick * since
        covariance[3 + i, i] += kick * since
        covariance[3 + i, 3 + i] += kick


@kernel
def _speaks_of(memory: Array, t: float) -> int:
    """Return where the estimate lies that speaks of an instant [s].

    That is the newest, but before a rejected sighting the one before it: nothing is carried
    forth to a wrong stamp, and back.
    """
    slot = at.slot_at(memory, 0)
    if memory[at.FILLED] > 0.0 and t < memory[at.T] == memory[slot] > memory[at.T_SEEN]:
        return int(slot + SLOT_ESTIMATE)
    return 0


@kernel
def _is_of_others(memory: Array, t: float) -> bool:
    """Say whether an instant lies at or beyond sightings that wait, seen from the track."""
    waiting = int(memory[at.WAITING])
    if waiting == 0:
        return False
    if memory[WAIT] > memory[at.T_SEEN]:
        return bool(t >= memory[WAIT])
    return bool(t <= memory[WAIT + SEEN * (waiting - 1)])


@kernel
def _carry(memory: Array, origin: int, model: int, dt: float, settings: Array, work: Array) -> None:
    """Carry a copy of a model's track, in the scratch, from an estimate on by ``dt`` [s]."""
    track = origin + track_of(model)
    memory[SCRATCH : SCRATCH + TRACK] = memory[track : track + TRACK]
    advance_uncertain(memory, SCRATCH, dt, settings, model, work)


@kernel
def _add_moment(motion: Array, x: Array, P: Array, weight: float, covariance: Array) -> None:
    """Add the second moment of one model's estimate about ``motion``, weighted."""
    for i in range(6):
        for j in range(i + 1):
            d_i, d_j = x[i] - motion[i // 3, i % 3], x[j] - motion[j // 3, j % 3]
            covariance[i, j] += weight * (P[i, j] + d_i * d_j)
            covariance[j, i] = covariance[i, j]
