"""What the ball filter does when a sighting does not fit, and how a track begins.

A bounce or a kick changes the velocity, not the position: after a few rejections the filter goes
back to before the first of them, forgets the velocity, and processes the sightings since then
again. If that fits no better, they were outliers, unless the rejections follow one another and the
newest of them agree: then the filter goes on from the newest sighting, or begins a new track with
them if that is farther away than a kick can carry; but not from sightings that tell no position, as
when one camera alone sees the ball. A track that does not speak yet gives way to sightings in a row
that are as many as its own, and two at least. A small kick passes the gate; it shows in innovations
that lean to one side (``motion_models.is_biased``), and the newest sightings are then processed
again with some freedom of velocity.
"""

from math import sqrt

from mitt.ball import memory as at
from mitt.ball.flight import TRACK, track_at
from mitt.ball.kalman import reset_motion
from mitt.ball.memory import BALL, GATES, LIMITS, SLOT_ESTIMATE, SLOT_TAKEN, SLOT_Z, track_of
from mitt.ball.motion_models import activate, deactivate, fit, reset_drag_and_push
from mitt.jit import kernel
from mitt.signals import Array

MAX_DOUBTFUL = 24
"""Sightings that are reconsidered at most when some of them were rejected."""

LOOK_BACK = 16
"""Sightings that are reconsidered when the innovations lean to one side."""

SMALL_KICK = 1.0
"""Standard deviation of a velocity change that passes the gate [m/s]."""


@kernel
def try_sighting(memory: Array, slot: int, settings: Array, work: Array) -> bool:
    """Carry the estimate to a sighting; correct it, and return true, if that lies in the gate."""
    known = memory[at.USED] >= settings[GATES, at.MIN_SIGHTINGS]
    gate = settings[GATES, at.GATE if known else at.FIRST_GATE]
    return bool(fit(memory, slot, gate, settings, work))


@kernel
def on_accepted(memory: Array, slot: int) -> None:
    """Count a sighting that fits; three in a row end a doubt."""
    memory[slot + SLOT_TAKEN] = 1.0
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
def on_rejected(memory: Array, age: int, settings: Array, work: Array) -> None:
    """Count a rejected sighting; act when they are too many or last too long."""
    memory[at.ALL_REJECTED] += 1.0
    slot, most = at.slot_at(memory, age), min(int(memory[at.FILLED]) - age, MAX_DOUBTFUL)
    if memory[at.DOUBTFUL] == 0.0:
        memory[at.REJECTED] = 0.0
    memory[at.DOUBTFUL] += 1.0
    memory[at.REJECTED] += 1.0
    memory[at.RUN] += 1.0
    memory[at.IN_A_ROW] = 0.0
    run, doubtful = min(int(memory[at.RUN]), most), min(int(memory[at.DOUBTFUL]), most)
    lasts = memory[slot] - memory[at.slot_at(memory, age + run - 1)]
    enough = settings[GATES, at.MAX_REJECTIONS]
    if memory[at.USED] < settings[GATES, at.MIN_SIGHTINGS]:
        depth = _telling(memory, age, run)
        if run >= min(max(memory[at.USED], 2.0), enough) and depth > 0:
            _begin_with(memory, age, depth, settings, work)
    elif run >= 3 and lasts >= settings[GATES, at.MAX_REJECTION_TIME]:
        _reacquire(memory, age, run, run, settings, work)
    elif memory[at.REJECTED] >= enough:
        _reacquire(memory, age, doubtful, run, settings, work)


@kernel
def begin(memory: Array, slot: int, settings: Array) -> None:
    """Begin a new track at a sighting."""
    if memory[at.USED] > 0.0:
        memory[at.ALL_RESTARTS] += 1.0
    deactivate(memory)
    memory[BALL + 3 : BALL + 6] = 0.0
    reset_drag_and_push(memory, 0, settings)
    reset_motion(memory, BALL, slot, settings[LIMITS, at.SPEED_SIGMA])
    if settings[LIMITS, at.WATCHFUL] > 0.0:
        activate(memory, settings)
        for model in range(at.MODELS):
            memory[at.WEIGHT + model] = settings[model, at.PRIOR]
    memory[at.T] = memory[at.T_FIRST] = memory[slot]
    memory[at.USED] = memory[at.DOUBTFUL] = 0.0
    on_accepted(memory, slot)


@kernel
def _telling(memory: Array, age: int, depth: int) -> int:
    """Return how many of the newest ``depth`` sightings there are from one on that tells where."""
    while depth > 0 and not at.tells_position(memory, at.slot_at(memory, age + depth - 1)):
        depth -= 1
    return depth


@kernel
def _begin_with(memory: Array, age: int, depth: int, settings: Array, work: Array) -> int:
    """Begin a new track at the oldest of ``depth`` sightings; return how many of them fit it."""
    begin(memory, at.slot_at(memory, age + depth - 1), settings)
    return 1 + int(_fit_again(memory, age, depth - 1, settings, work))


@kernel
def _fit_again(memory: Array, age: int, depth: int, settings: Array, work: Array) -> int:
    """Process the newest ``depth`` sightings again; return how many of them fit."""
    fitting = 0
    for k in range(age + depth - 1, age - 1, -1):
        slot = at.slot_at(memory, k)
        memory[slot + SLOT_TAKEN] = 0.0
        if try_sighting(memory, slot, settings, work):
            on_accepted(memory, slot)
            fitting += 1
    return fitting


@kernel
def _reacquire(memory: Array, age: int, depth: int, run: int, settings: Array, work: Array) -> None:
    """Explain the newest ``depth`` sightings: outliers, a kick, or another ball.

    The depth is the ``run`` of rejections, or reaches back to where the doubt began.
    """
    newest, first = at.slot_at(memory, age), at.slot_at(memory, age + depth - 1)
    kick, most = settings[GATES, at.KICK_SIGMA], int(settings[GATES, at.MAX_REJECTIONS])
    fitted = 0.0 if depth == run else depth - memory[at.REJECTED]
    leap, x = 0.0, track_of(int(memory[at.BEST]))
    for i in range(3):
        leap += (memory[x + i] - memory[newest + SLOT_Z + i]) ** 2
    reach = 1.5 * kick * (memory[newest] - memory[at.T_SEEN])
    at.save(memory, at.SPARE)
    memory[at.DOUBTFUL] = 0.0
    _go_back(memory, first, kick, settings)
    fitting = _fit_again(memory, age, depth, settings, work)
    if 2 * fitting > depth and fitting > fitted + 1:
        memory[at.ALL_KICKS] += 1.0
        return
    at.restore(memory, at.SPARE)
    if run >= most and at.tells_position(memory, newest):
        far, size = sqrt(leap) > reach, _telling(memory, age, most)
        agreeing = _begin_with(memory, age, size, settings, work)
        if far and 2 * agreeing > most:
            return
        at.restore(memory, at.SPARE)
        if far or 2 * agreeing <= size:
            return
        memory[at.ALL_KICKS] += 1.0  # go on from the newest, with a velocity as good as unknown
        reset_motion(memory, track_of(int(memory[at.BEST])), newest, kick)
        activate(memory, settings)
        memory[at.DOUBTFUL] = 0.0
        on_accepted(memory, newest)
    elif depth != run:
        memory[at.DOUBTFUL] = 0.0


@kernel
def reconsider(memory: Array, age: int, settings: Array, work: Array) -> None:
    """Weight all motion models, and a small kick, on the newest sightings."""
    depth = int(min(LOOK_BACK, memory[at.FILLED] - age, memory[at.USED] - 1.0))
    if depth < 1:
        return
    _go_back(memory, at.slot_at(memory, age + depth - 1), SMALL_KICK, settings)
    for k in range(age + depth - 1, age - 1, -1):
        try_sighting(memory, at.slot_at(memory, k), settings, work)


@kernel
def _go_back(memory: Array, first: int, kick: float, settings: Array) -> None:
    """Go back to the estimate before a sighting, its velocity changed by a kick [m/s]."""
    past = first + SLOT_ESTIMATE
    best = int(memory[past + at.BEST])
    track = track_of(best)
    memory[track : track + TRACK] = memory[past + track : past + track + TRACK]
    memory[at.T], memory[at.BEST] = memory[past + at.T], best
    memory[at.ACTIVE] = memory[past + at.ACTIVE]
    if memory[at.ACTIVE] > 0.0:
        for k in range(at.WEIGHT, at.WEIGHT + at.MODELS):
            memory[k] = memory[past + k]
    # When within the gap the kick came is unknown, and so how far it has carried the ball.
    P, gap = track_at(memory, track)[1], memory[first] - memory[at.T]
    for i in range(3):
        P[i, i] += (kick * gap) ** 2
        P[3 + i, 3 + i] += kick**2
    activate(memory, settings)
