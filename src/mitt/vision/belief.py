"""What the ball filter does with a sighting, and what it says: kernels on one memory vector.

A sighting is taken in at its own time, whatever the order of arrival: the ring keeps the newest
ones, each with the belief before it; a late one is put in its place and all after it are taken
in again. The result is that of the right order, bit for bit. One too old for the ring is
dropped, one with a stamp that has been seen changes nothing.
"""

from math import isfinite

from mitt.flight import GRAVITY, STATES, acceleration, advance_uncertain
from mitt.jit import kernel
from mitt.signals import Array
from mitt.views import lent
from mitt.vision import memory as at
from mitt.vision.kalman import copy, is_sane
from mitt.vision.laws import FLOOR, is_biased, track_of
from mitt.vision.memory import LIMITS, SCRATCH, SLOT_BELIEF
from mitt.vision.recovery import begin, believe, doubt, reconsider, take_in

DROPPED, TAKEN, DOUBTED = 0, 1, 2
"""What became of a sighting."""

MAX_HORIZON = 2.0
"""Farthest that an estimate is carried [s]; no throw flies longer."""


@kernel
def is_tracked(memory: Array, settings: Array) -> bool:
    """Return whether there is an estimate."""
    return bool(memory[at.USED] >= settings[LIMITS, at.SPEAKS_AFTER])


@kernel
def absorb(memory: Array, t: float, z: Array, R: Array, settings: Array, work: Array) -> int:
    """Take a sighting in.

    Args:
        memory: The filter's memory, shape (MEMORY,).
        t: Time of the exposure [s].
        z: Position [m], shape (3,).
        R: Its covariance [m^2], shape (3, 3).
        settings: Settings, shape SETTINGS.
        work: Scratch, shape WORK.

    Returns:
        ``TAKEN``, ``DOUBTED``, or ``DROPPED``: not finite, absurd, a repetition or too old.
    """
    if not (isfinite(t) and is_sane(z, R)):
        memory[at.IGNORED] += 1.0
        return DROPPED
    if t < memory[at.T_SEEN] - settings[LIMITS, at.MAX_GAP]:
        memory[at.FILLED] = memory[at.USED] = memory[at.DOUBTFUL] = 0.0  # the clock was set back
        memory[at.ALL_RESTARTS] += 1.0
    age, filled = 0, int(memory[at.FILLED])
    while age < filled and memory[at.slot_at(memory, age)] > t:
        age += 1
    if age < filled and memory[at.slot_at(memory, age)] == t:
        memory[at.IGNORED] += 1.0
        return DROPPED
    if age > 0 and not _reaches_back(memory, age):
        memory[at.LATE] += 1.0
        return DROPPED
    if age > 0:
        at.restore(memory, at.slot_at(memory, age - 1))
    at.open_slot(memory, age)
    at.write(memory, at.slot_at(memory, age), t, z, R)
    became: int = _take(memory, age, settings, work)
    for later in range(age - 1, -1, -1):
        _take(memory, later, settings, work)
    return became


@kernel
def _reaches_back(memory: Array, age: int) -> bool:
    """Return whether the ring holds all that a sighting put at ``age`` could change."""
    filled = int(memory[at.FILLED])
    doubtful = memory[at.slot_at(memory, age - 1) + SLOT_BELIEF + at.DOUBTFUL]
    return filled < at.RING or age + doubtful < filled


@kernel
def _take(memory: Array, age: int, settings: Array, work: Array) -> int:
    """Take the sighting of a slot in, after keeping the belief before it."""
    slot = at.slot_at(memory, age)
    at.save(memory, slot)
    t = memory[slot]
    if memory[at.USED] == 0.0 or t - memory[at.T_SEEN] > settings[LIMITS, at.MAX_GAP]:
        if not at.gives_place(memory, slot):
            return DOUBTED
        begin(memory, slot, settings)
        return TAKEN
    if take_in(memory, slot, settings, work):
        believe(memory, slot)
        if is_biased(memory):
            reconsider(memory, age, settings, work)
        return TAKEN
    doubt(memory, age, settings, work)
    return DOUBTED


@kernel
def speak(
    memory: Array, t: float, settings: Array, motion: Array, covariance: Array, work: Array
) -> bool:
    """Carry the estimate to an instant, without changing it.

    Args:
        memory: The filter's memory, shape (MEMORY,); what is known is left as it is.
        t: Instant to speak of [s].
        settings: Settings, shape SETTINGS.
        motion: Result: position, velocity, acceleration [m, m/s, m/s^2], shape (3, 3).
        covariance: Result, covariance of position and velocity, shape (6, 6).
        work: Scratch, shape WORK.

    Returns:
        Whether the ball is tracked; if not, or further than ``MAX_HORIZON`` from the last
        sighting, the results are zero. The drag coefficient is in ``memory[DRAG]``.
    """
    memory, settings, work = lent((memory, settings, work))
    dt = t - memory[at.T]
    if not (is_tracked(memory, settings) and abs(dt) <= MAX_HORIZON):
        motion[:, :] = 0.0
        covariance[:, :] = 0.0
        return False
    best = int(memory[at.BEST])
    copy(memory, track_of(best), SCRATCH)
    advance_uncertain(memory, SCRATCH, dt, settings, best, work)
    for i in range(3):
        motion[0, i], motion[1, i] = memory[SCRATCH + i], memory[SCRATCH + 3 + i]
    memory[at.DRAG] = memory[SCRATCH + 6]
    acceleration(motion[1], memory[at.DRAG], motion[2])
    for i in range(3):
        motion[2, i] += memory[SCRATCH + 7 + i]
    motion[2, 2] += GRAVITY - settings[best, at.GRAVITY_]
    awake = memory[at.AWAKE] > 0.0
    _spread(motion, covariance, memory, memory[at.WEIGHT + best] if awake else 1.0, True)
    if awake:
        for law in range(at.LAWS):
            if law != best and memory[at.WEIGHT + law] > FLOOR:
                copy(memory, track_of(law), SCRATCH)
                advance_uncertain(memory, SCRATCH, dt, settings, law, work)
                _spread(motion, covariance, memory, memory[at.WEIGHT + law], False)
    return True


@kernel
def _spread(motion: Array, covariance: Array, memory: Array, weight: float, first: bool) -> None:
    """Add a law's part, which is in the scratch, to the second moment about what is said."""
    P = SCRATCH + STATES
    for i in range(6):
        for j in range(i + 1):
            d_i = memory[SCRATCH + i] - motion[i // 3, i % 3]
            d_j = memory[SCRATCH + j] - motion[j // 3, j % 3]
            part = weight * (memory[P + STATES * i + j] + d_i * d_j)
            covariance[i, j] = covariance[j, i] = part if first else covariance[i, j] + part
