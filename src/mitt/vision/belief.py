"""What the ball filter does with a sighting, and what it says: kernels on one memory vector.

A sighting is taken in at its own time, whatever the order of arrival: the ring keeps the newest
ones, each with the belief before it; a late one is put in its place and all after it are taken
in again. The result is that of the right order, bit for bit. One too old for the ring is
dropped, one with a stamp that has been seen changes nothing.

A bounce or a kick changes the velocity, not the position: after a few rejections the filter goes
back to before the first of them, forgets the velocity, and takes the sightings since then in
again. If they still do not fit, it goes on from the newest, or begins a new track if that is
farther away than a kick can carry.
"""

from math import isfinite, sqrt

from numba import njit

from mitt.flight import GRAVITY, STATES, acceleration, advance_uncertain
from mitt.signals import Array
from mitt.vision import memory as at
from mitt.vision.kalman import copy, is_sane, settle
from mitt.vision.laws import FLOOR, fall_asleep, fit, forget, is_biased, track_of, wake
from mitt.vision.memory import BALL, GATES, LIMITS, SCRATCH, SLOT_BELIEF

DROPPED, TAKEN, DOUBTED = 0, 1, 2
"""What became of a sighting."""

MAX_DOUBTFUL = 24
"""Sightings that are reconsidered at most when some of them were rejected."""

LOOK_BACK = 16
"""Sightings that are reconsidered when the innovations lean to one side."""

SMALL_KICK = 1.0
"""Standard deviation of a velocity change that passes the gate [m/s]."""

MAX_HORIZON = 2.0
"""Farthest that an estimate is carried [s]; no throw flies longer."""


@njit(cache=True)
def is_tracked(memory: Array, settings: Array) -> bool:
    """Return whether there is an estimate."""
    return bool(memory[at.USED] >= settings[LIMITS, at.SPEAKS_AFTER])


@njit(cache=True)
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


@njit(cache=True)
def _reaches_back(memory: Array, age: int) -> bool:
    """Return whether the ring holds all that a sighting put at ``age`` could change."""
    filled = int(memory[at.FILLED])
    doubtful = memory[at.slot_at(memory, age - 1) + SLOT_BELIEF + at.DOUBTFUL]
    return filled < at.RING or age + doubtful < filled


@njit(cache=True)
def _take(memory: Array, age: int, settings: Array, work: Array) -> int:
    """Take the sighting of a slot in, after keeping the belief before it."""
    slot = at.slot_at(memory, age)
    at.save(memory, slot)
    t = memory[slot]
    if memory[at.USED] == 0.0 or t - memory[at.T_SEEN] > settings[LIMITS, at.MAX_GAP]:
        _begin(memory, slot, settings)
        return TAKEN
    if _fit(memory, slot, settings, work):
        _believe(memory, slot)
        if is_biased(memory, work):
            _reconsider(memory, age, settings, work)
        return TAKEN
    _doubt(memory, age, settings, work)
    return DOUBTED


@njit(cache=True)
def _fit(memory: Array, slot: int, settings: Array, work: Array) -> bool:
    """Carry the estimate to a sighting; take it in, and return true, if it lies in the gate."""
    known = memory[at.USED] >= settings[GATES, at.MIN_SIGHTINGS]
    return bool(
        fit(memory, slot, settings[GATES, at.GATE if known else at.FIRST_GATE], settings, work)
    )


@njit(cache=True)
def _believe(memory: Array, slot: int) -> None:
    """Note a sighting that was taken in; three in a row end a doubt."""
    memory[at.T_SEEN] = memory[slot]
    memory[at.USED] += 1.0
    memory[at.ALL_USED] += 1.0
    if memory[at.DOUBTFUL] > 0.0:
        memory[at.DOUBTFUL] += 1.0
        memory[at.IN_A_ROW] += 1.0
        if memory[at.IN_A_ROW] == 3.0 or memory[at.DOUBTFUL] > MAX_DOUBTFUL:
            memory[at.DOUBTFUL] = 0.0


@njit(cache=True)
def _doubt(memory: Array, age: int, settings: Array, work: Array) -> None:
    """Note a rejected sighting; act when they are too many or last too long."""
    memory[at.ALL_REJECTED] += 1.0
    slot = at.slot_at(memory, age)
    if memory[at.USED] < settings[GATES, at.MIN_SIGHTINGS]:
        _begin(memory, slot, settings)
        return
    if memory[at.DOUBTFUL] == 0.0:
        memory[at.REJECTED] = 0.0
    memory[at.DOUBTFUL] += 1.0
    memory[at.REJECTED] += 1.0
    memory[at.IN_A_ROW] = 0.0
    n, doubtful = memory[at.REJECTED], int(memory[at.DOUBTFUL])
    lasts = memory[slot] - memory[at.slot_at(memory, age + doubtful - 1)]
    stubborn = n == doubtful >= 3 and lasts >= settings[GATES, at.MAX_REJECTION_TIME]
    if n >= settings[GATES, at.MAX_REJECTIONS] or stubborn:
        _reacquire(memory, age, doubtful, settings, work)


@njit(cache=True)
def _begin(memory: Array, slot: int, settings: Array) -> None:
    """Begin a new track at a sighting."""
    if memory[at.USED] > 0.0:
        memory[at.ALL_RESTARTS] += 1.0
    fall_asleep(memory)
    for i in range(3, 6):
        memory[BALL + i] = 0.0
    forget(memory, 0, settings)
    settle(memory, BALL, slot, settings[LIMITS, at.SPEED_SIGMA])
    if settings[LIMITS, at.WATCHFUL] > 0.0:
        wake(memory, settings)
        for law in range(at.LAWS):
            memory[at.WEIGHT + law] = settings[law, at.PRIOR]
    memory[at.T] = memory[at.T_FIRST] = memory[slot]
    memory[at.USED] = memory[at.DOUBTFUL] = 0.0
    _believe(memory, slot)


@njit(cache=True)
def _reacquire(memory: Array, age: int, doubtful: int, settings: Array, work: Array) -> None:
    """Explain the sightings since the doubt began: outliers, a kick, or another ball."""
    newest = at.slot_at(memory, age)
    fitted = doubtful - memory[at.REJECTED]
    leap, reach = _leap(memory, age, doubtful, settings)
    memory[at.DOUBTFUL] = 0.0
    at.save(memory, at.SPARE)
    kick = settings[GATES, at.KICK_SIGMA]
    _go_back(memory, at.slot_at(memory, age + doubtful - 1), kick, settings)
    fitting = 0
    for k in range(age + doubtful - 1, age - 1, -1):
        slot = at.slot_at(memory, k)
        if _fit(memory, slot, settings, work):
            _believe(memory, slot)
            fitting += 1
    if fitting <= fitted + 1 and 4 * fitted >= doubtful:
        at.restore(memory, at.SPARE)
    elif 2 * fitting > doubtful:
        memory[at.ALL_KICKS] += 1.0
    elif leap > reach:
        _begin(memory, newest, settings)
    else:  # go on from the newest, with a velocity as good as unknown
        memory[at.ALL_KICKS] += 1.0
        settle(memory, track_of(int(memory[at.BEST])), newest, kick)
        wake(memory, settings)
        memory[at.T] = memory[newest]
        _believe(memory, newest)


@njit(cache=True)
def _leap(memory: Array, age: int, doubtful: int, settings: Array) -> tuple[float, float]:
    """Return how far a sighting is from the estimate, and how far kicks carry a ball by then [m]."""
    slot, first = at.slot_at(memory, age), at.slot_at(memory, age + doubtful - 1)
    leap, x = 0.0, track_of(int(memory[at.BEST]))
    for i in range(3):
        leap += (memory[x + i] - memory[slot + 1 + i]) ** 2
    lasts = memory[slot] - memory[first + SLOT_BELIEF + at.T]
    return sqrt(leap), 1.5 * settings[GATES, at.KICK_SIGMA] * lasts


@njit(cache=True)
def _reconsider(memory: Array, age: int, settings: Array, work: Array) -> None:
    """Weigh all laws of motion, and a small kick, on the newest sightings."""
    depth = int(min(LOOK_BACK, memory[at.FILLED] - age, memory[at.USED] - 1.0))
    if depth < 1:
        return
    _go_back(memory, at.slot_at(memory, age + depth - 1), SMALL_KICK, settings)
    for k in range(age + depth - 1, age - 1, -1):
        _fit(memory, at.slot_at(memory, k), settings, work)


@njit(cache=True)
def _go_back(memory: Array, first: int, kick: float, settings: Array) -> None:
    """Go back to the belief before a sighting, with a velocity that a kick [m/s] has changed."""
    past = first + SLOT_BELIEF
    best = int(memory[past + at.BEST])
    copy(memory, past + track_of(best), track_of(best))
    memory[at.T], memory[at.BEST], memory[at.AWAKE] = memory[past + at.T], best, 0.0
    if memory[past + at.AWAKE] > 0.0:
        memory[at.AWAKE] = 1.0
        for law in range(at.LAWS):
            memory[at.WEIGHT + law] = memory[past + at.WEIGHT + law]
    # When within the gap the kick came is unknown, and so how far it has carried the ball.
    P, gap = track_of(best) + STATES, memory[first] - memory[at.T]
    for i in range(3):
        memory[P + 11 * i] += (kick * gap) ** 2
        memory[P + 11 * (3 + i)] += kick**2
    wake(memory, settings)


@njit(cache=True)
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


@njit(cache=True)
def _spread(motion: Array, covariance: Array, memory: Array, weight: float, first: bool) -> None:
    """Add a law's part, which is in the scratch, to the second moment about what is said."""
    P = SCRATCH + STATES
    for i in range(6):
        for j in range(i + 1):
            d_i = memory[SCRATCH + i] - motion[i // 3, i % 3]
            d_j = memory[SCRATCH + j] - motion[j // 3, j % 3]
            part = weight * (memory[P + STATES * i + j] + d_i * d_j)
            covariance[i, j] = covariance[j, i] = part if first else covariance[i, j] + part
