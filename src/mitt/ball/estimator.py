"""The kernels of the ball filter: a sighting in, an estimate out; all is kept in one vector.

A sighting counts at its own time, whatever the order of arrival: the ring keeps the newest
sightings, each with the estimate before it; a late one is put in its place, and all after it are
processed again. The result is that of the right order, bit for bit. A sighting too old for the
ring is dropped; one whose time was seen before changes nothing.
"""

from math import isfinite

from mitt.ball import memory as at
from mitt.ball.flight import TRACK, acceleration, advance_uncertain, track_at
from mitt.ball.kalman import is_sane
from mitt.ball.memory import LIMITS, SCRATCH, SLOT_ESTIMATE, SLOT_R, SLOT_Z, track_of
from mitt.ball.motion_models import FLOOR, is_biased
from mitt.ball.reacquisition import begin, on_accepted, on_rejected, reconsider, try_sighting
from mitt.jit import kernel
from mitt.signals import GRAVITY, Array

MAX_HORIZON = 2.0
"""Farthest that an estimate is carried [s]; no throw flies longer."""


@kernel
def is_tracked(memory: Array, settings: Array) -> bool:
    """Return whether there is an estimate."""
    return bool(memory[at.USED] >= settings[LIMITS, at.SPEAKS_AFTER])


@kernel
def update(memory: Array, t: float, z: Array, R: Array, settings: Array, work: Array) -> None:
    """Process a sighting; one that is not finite, absurd, repeated or too old is dropped.

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
    if t < memory[at.T_SEEN] - settings[LIMITS, at.MAX_GAP]:
        memory[at.FILLED] = memory[at.USED] = memory[at.DOUBTFUL] = 0.0  # the clock was set back
        memory[at.ALL_RESTARTS] += 1.0
    age, filled = 0, int(memory[at.FILLED])
    while age < filled and memory[at.slot_at(memory, age)] > t:
        age += 1
    if age < filled and memory[at.slot_at(memory, age)] == t:
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
    memory[slot] = t
    for i in range(3):
        memory[slot + SLOT_Z + i] = z[i]
        for j in range(3):
            memory[slot + SLOT_R + 3 * i + j] = R[i, j]
    for k in range(age, -1, -1):
        _process(memory, k, settings, work)


@kernel
def _process(memory: Array, age: int, settings: Array, work: Array) -> None:
    """Process the sighting of a slot, after keeping the estimate before it."""
    slot = at.slot_at(memory, age)
    at.save(memory, slot)
    t = memory[slot]
    if memory[at.USED] == 0.0 or t - memory[at.T_SEEN] > settings[LIMITS, at.MAX_GAP]:
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
        sighting, the results are zero. The drag coefficient is in ``memory[DRAG]``.
    """
    dt = t - memory[at.T]
    motion[:, :] = 0.0
    covariance[:, :] = 0.0
    if not (is_tracked(memory, settings) and abs(dt) <= MAX_HORIZON):
        return False
    best, active = int(memory[at.BEST]), memory[at.ACTIVE] > 0.0
    x, P = track_at(memory, SCRATCH)
    _carry(memory, best, dt, settings, work)
    motion[0], motion[1] = x[:3], x[3:6]
    memory[at.DRAG] = x[6]
    acceleration(motion[1], x[6], motion[2])
    for i in range(3):
        motion[2, i] += x[7 + i]
    motion[2, 2] += GRAVITY - settings[best, at.GRAVITY_]
    _add_moment(motion, x, P, memory[at.WEIGHT + best] if active else 1.0, covariance)
    for model in range(at.MODELS):
        if active and model != best and memory[at.WEIGHT + model] > FLOOR:
            _carry(memory, model, dt, settings, work)
            _add_moment(motion, x, P, memory[at.WEIGHT + model], covariance)
    return True


@kernel
def _carry(memory: Array, model: int, dt: float, settings: Array, work: Array) -> None:
    """Carry a copy of a model's track, in the scratch, by ``dt`` [s]."""
    track = track_of(model)
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
