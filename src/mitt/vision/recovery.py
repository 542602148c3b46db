"""What the ball filter does when a sighting does not fit, and how a track begins.

A bounce or a kick changes the velocity, not the position: after a few rejections the filter goes
back to before the first of them, forgets the velocity, and takes the sightings since then in
again. What fits no better then was outliers, unless the rejections form a run: then the filter
goes on from the newest, or begins a new track if that is farther away than a kick can carry; but
not from one that gives no place, as when one camera alone sees the ball.
A small kick passes the gate; it shows in innovations that lean to one side (``laws.is_biased``),
and the newest sightings are then taken in again with some freedom of velocity.
"""

from math import sqrt

from mitt.flight import STATES
from mitt.jit import kernel
from mitt.signals import Array
from mitt.vision import memory as at
from mitt.vision.kalman import copy, settle
from mitt.vision.laws import fall_asleep, fit, forget, track_of, wake
from mitt.vision.memory import BALL, GATES, LIMITS, SLOT_BELIEF

MAX_DOUBTFUL = 24
"""Sightings that are reconsidered at most when some of them were rejected."""

LOOK_BACK = 16
"""Sightings that are reconsidered when the innovations lean to one side."""

SMALL_KICK = 1.0
"""Standard deviation of a velocity change that passes the gate [m/s]."""


@kernel
def take_in(memory: Array, slot: int, settings: Array, work: Array) -> bool:
    """Carry the estimate to a sighting; take it in, and return true, if it lies in the gate."""
    known = memory[at.USED] >= settings[GATES, at.MIN_SIGHTINGS]
    return bool(
        fit(memory, slot, settings[GATES, at.GATE if known else at.FIRST_GATE], settings, work)
    )


@kernel
def believe(memory: Array, slot: int) -> None:
    """Note a sighting that was taken in; three in a row end a doubt."""
    memory[at.T_SEEN] = memory[slot]
    memory[at.RUN] = 0.0
    memory[at.USED] += 1.0
    memory[at.ALL_USED] += 1.0
    if memory[at.DOUBTFUL] > 0.0:
        memory[at.DOUBTFUL] += 1.0
        memory[at.IN_A_ROW] += 1.0
        if memory[at.IN_A_ROW] == 3.0 or memory[at.DOUBTFUL] > MAX_DOUBTFUL:
            memory[at.DOUBTFUL] = 0.0


@kernel
def doubt(memory: Array, age: int, settings: Array, work: Array) -> None:
    """Note a rejected sighting; act when they are too many or last too long."""
    memory[at.ALL_REJECTED] += 1.0
    slot = at.slot_at(memory, age)
    if memory[at.USED] < settings[GATES, at.MIN_SIGHTINGS] and at.gives_place(memory, slot):
        begin(memory, slot, settings)
        return
    if memory[at.DOUBTFUL] == 0.0:
        memory[at.REJECTED] = 0.0
    memory[at.DOUBTFUL] += 1.0
    memory[at.REJECTED] += 1.0
    memory[at.RUN] += 1.0
    memory[at.IN_A_ROW] = 0.0
    run, doubtful = int(memory[at.RUN]), int(memory[at.DOUBTFUL])
    lasts = memory[slot] - memory[at.slot_at(memory, age + run - 1)]
    if run >= 3 and lasts >= settings[GATES, at.MAX_REJECTION_TIME]:
        _reacquire(memory, age, run, settings, work)
    elif memory[at.REJECTED] >= settings[GATES, at.MAX_REJECTIONS]:
        _reacquire(memory, age, doubtful, settings, work)


@kernel
def begin(memory: Array, slot: int, settings: Array) -> None:
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
    believe(memory, slot)


@kernel
def _reacquire(memory: Array, age: int, depth: int, settings: Array, work: Array) -> None:
    """Explain the newest ``depth`` sightings: outliers, a kick, or another ball.

    The depth is the run of rejections, or reaches back to where the doubt began.
    """
    newest, run = at.slot_at(memory, age), int(memory[at.RUN])
    fitted = 0 if depth == run else depth - memory[at.REJECTED]
    leap, reach = _leap(memory, age, depth, settings)
    at.save(memory, at.SPARE)
    memory[at.DOUBTFUL] = 0.0
    kick = settings[GATES, at.KICK_SIGMA]
    _go_back(memory, at.slot_at(memory, age + depth - 1), kick, settings)
    fitting = 0
    for k in range(age + depth - 1, age - 1, -1):
        slot = at.slot_at(memory, k)
        if take_in(memory, slot, settings, work):
            believe(memory, slot)
            fitting += 1
    if 2 * fitting > depth and fitting > fitted + 1:
        memory[at.ALL_KICKS] += 1.0
        return
    at.restore(memory, at.SPARE)
    if run >= settings[GATES, at.MAX_REJECTIONS] and at.gives_place(memory, newest):
        if leap > reach:
            begin(memory, newest, settings)
            return
        memory[at.ALL_KICKS] += 1.0  # go on from the newest, with a velocity as good as unknown
        settle(memory, track_of(int(memory[at.BEST])), newest, kick)
        wake(memory, settings)
        memory[at.DOUBTFUL] = 0.0
        believe(memory, newest)
    elif depth != run:
        memory[at.DOUBTFUL] = 0.0


@kernel
def _leap(memory: Array, age: int, doubtful: int, settings: Array) -> tuple[float, float]:
    """Return how far a sighting is from the estimate, and how far kicks may carry [m]."""
    slot, first = at.slot_at(memory, age), at.slot_at(memory, age + doubtful - 1)
    leap, x = 0.0, track_of(int(memory[at.BEST]))
    for i in range(3):
        leap += (memory[x + i] - memory[slot + 1 + i]) ** 2
    lasts = memory[slot] - memory[first + SLOT_BELIEF + at.T]
    return sqrt(leap), 1.5 * settings[GATES, at.KICK_SIGMA] * lasts


@kernel
def reconsider(memory: Array, age: int, settings: Array, work: Array) -> None:
    """Weigh all laws of motion, and a small kick, on the newest sightings."""
    depth = int(min(LOOK_BACK, memory[at.FILLED] - age, memory[at.USED] - 1.0))
    if depth < 1:
        return
    _go_back(memory, at.slot_at(memory, age + depth - 1), SMALL_KICK, settings)
    for k in range(age + depth - 1, age - 1, -1):
        take_in(memory, at.slot_at(memory, k), settings, work)


@kernel
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
