"""Where the ball filter keeps what it knows: one flat vector, and one table of settings.

| part of the memory | numbers  | meaning                                                          |
|--------------------|----------|------------------------------------------------------------------|
| belief             | BELIEF   | header, and a track (``flight.TRACK``) for each law of motion    |
| ledger             | 8        | what is counted outside the belief, and the state of the ring    |
| scratch            | TRACK    | a track on its way to another instant                            |
| ring               | RING x SLOT | the newest sightings, each with the belief before it          |
"""

import numpy as np

from mitt.flight import TRACK
from mitt.jit import kernel
from mitt.signals import Array
from mitt.views import view

# The header: times [s], the doubt, and what became of the sightings.
T, T_SEEN, T_FIRST, USED, REJECTED, IN_A_ROW, DOUBTFUL = range(7)
ALL_USED, ALL_REJECTED, ALL_KICKS, ALL_RESTARTS = range(7, 11)
AWAKE, BEST, CALM, WEIGHT = range(11, 15)
RUN = 17
BIAS, PRECISION = 18, 21
BALL = 28
"""Index of the first track: position, velocity, drag coefficient, push, their covariance."""

LAWS = 3
"""Laws of motion that are weighed against each other: flight, steady, driven (``laws``)."""

BELIEF = BALL + LAWS * TRACK
IGNORED, LATE, FILLED, NEWEST, DRAG = range(BELIEF, BELIEF + 5)
SCRATCH = BELIEF + 8

RING = 64
"""Sightings that are remembered: 64 ms at 1 kHz, of which 24 may be doubtful."""

LOOSE = 0.5
"""Variance of a sighting, all directions together, above which it gives no place: one camera
made it [m^2]."""

SLOT_R, SLOT_BELIEF = 4, 16
SLOT = SLOT_BELIEF + BELIEF
SLOTS = SCRATCH + TRACK
SPARE = SLOTS + RING * SLOT
MEMORY = SPARE + SLOT
"""Numbers in the memory."""

WORK = (2, 10, 10)
"""Shape of the scratch that the kernels need."""

# Columns of the settings: a row for each law of motion, then two of thresholds.
GRAVITY_, ACCEL_DENSITY, DRAG_DENSITY, PUSH_SIGMA, PUSH_TIME, DRAG_MEAN, DRAG_SIGMA, PRIOR = range(
    8
)
GATES, LIMITS = LAWS, LAWS + 1
GATE, FIRST_GATE, MIN_SIGHTINGS, MAX_REJECTIONS, MAX_REJECTION_TIME, KICK_SIGMA = range(6)
DRAG_MAX, SPEED_SIGMA, MAX_GAP, SPEAKS_AFTER, WATCHFUL, SWITCH_TIME = range(6)
SETTINGS = (LAWS + 2, 8)
"""Shape of the settings."""


def fresh() -> Array:
    """Return a memory without a track."""
    memory = np.zeros(MEMORY)
    clear(memory)
    return memory


@kernel
def clear(memory: Array) -> None:
    """Forget the ball; the counts go on."""
    memory[T] = memory[T_SEEN] = memory[T_FIRST] = -np.inf
    memory[USED] = memory[REJECTED] = memory[IN_A_ROW] = memory[DOUBTFUL] = 0.0
    memory[FILLED] = memory[AWAKE] = 0.0


@kernel
def slot_at(memory: Array, age: int) -> int:
    """Return the index of the slot of the sighting that is ``age`` places before the newest."""
    return SLOTS + SLOT * ((int(memory[NEWEST]) - age) % RING)


@kernel
def save(memory: Array, slot: int) -> None:
    """Keep the belief in a slot, as the one before its sighting."""
    n = BELIEF if memory[AWAKE] > 0.0 else BALL + TRACK
    belief, kept = view(memory, 0, (n,)), view(memory, slot + SLOT_BELIEF, (n,))
    for i in range(n):
        kept[i] = belief[i]


@kernel
def restore(memory: Array, slot: int) -> None:
    """Go back to the belief before the sighting in a slot."""
    awake = memory[slot + SLOT_BELIEF + AWAKE] > 0.0
    for i in range(BELIEF if awake else BALL + TRACK):
        memory[i] = memory[slot + SLOT_BELIEF + i]


@kernel
def write(memory: Array, slot: int, t: float, z: Array, R: Array) -> None:
    """Write a sighting into a slot."""
    memory[slot] = t
    for i in range(3):
        memory[slot + 1 + i] = z[i]
        for j in range(3):
            memory[slot + SLOT_R + 3 * i + j] = R[i, j]


@kernel
def gives_place(memory: Array, slot: int) -> bool:
    """Return whether a sighting says where the ball is, not only on which line."""
    R = slot + SLOT_R
    return bool(memory[R] + memory[R + 4] + memory[R + 8] <= LOOSE)


@kernel
def open_slot(memory: Array, age: int) -> None:
    """Make room for a sighting ``age`` places before the newest; the oldest may go."""
    memory[NEWEST] = (memory[NEWEST] + 1.0) % RING
    memory[FILLED] = min(memory[FILLED] + 1.0, float(RING))
    for k in range(age):
        into, origin = slot_at(memory, k), slot_at(memory, k + 1)
        for i in range(SLOT_BELIEF):
            memory[into + i] = memory[origin + i]
