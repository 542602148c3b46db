"""Where the ball filter keeps what it knows: one flat vector, and one table of settings.

| part of the memory | numbers     | meaning                                                       |
|--------------------|-------------|---------------------------------------------------------------|
| estimate           | ESTIMATE    | header, and a track (``flight.TRACK``) for each motion model  |
| counts             | 8           | what is counted outside the estimate, and the ring's state    |
| scratch            | TRACK       | a track that is carried to another instant                    |
| ring               | RING x SLOT | the newest sightings, each with the estimate before it        |
| spare              | SLOT        | an estimate that is gone back to where a trial has failed     |
| waiting            | ROW x SEEN  | sightings of another time than the track's                    |
"""

import numpy as np

from mitt.ball.flight import TRACK
from mitt.jit import kernel
from mitt.signals import Array

# The header: times [s], sightings in doubt, counts, the motion models and their weights.
T, T_SEEN, T_FIRST, USED, REJECTED, IN_A_ROW, DOUBTFUL = range(7)
ALL_USED, ALL_REJECTED, ALL_KICKS, ALL_RESTARTS = range(7, 11)
ACTIVE, BEST, CALM, WEIGHT = range(11, 15)
RUN = 17
BIAS, PRECISION = 18, 21
BALL = 28
"""Index of the first track: position, velocity, drag coefficient, push, their covariance."""

MODELS = 3
"""Motion models: flight, steady, driven (``motion_models``)."""

ESTIMATE = BALL + MODELS * TRACK
IGNORED, LATE, FILLED, NEWEST, DRAG, WAITING = range(ESTIMATE, ESTIMATE + 6)
SCRATCH = ESTIMATE + 8

RING = 64
"""Sightings that are remembered: 64 ms at 1 kHz, of which 24 may be doubtful."""

LOOSE = 0.5
"""Variance of a sighting, all directions together, above which it does not tell a position: one
camera made it [m^2]."""

SLOT_Z, SLOT_R, SLOT_TAKEN, SLOT_ESTIMATE = 1, 4, 13, 16
"""Where position, covariance, whether it was accepted, and the estimate lie in a slot."""

SEEN = 13
"""Numbers of a sighting: time, position, covariance."""

ROW = 3
"""Sightings in a row that are believed to be of another time than the track's."""

SLOT = SLOT_ESTIMATE + ESTIMATE
SLOTS = SCRATCH + TRACK
SPARE = SLOTS + RING * SLOT
WAIT = SPARE + SLOT
MEMORY = WAIT + ROW * SEEN
"""Numbers in the memory."""

WORK = (2, 10, 10)
"""Shape of the scratch that the kernels need."""

# Columns of the settings: a row for each motion model, then two of thresholds.
GRAVITY_, ACCEL_DENSITY, DRAG_DENSITY, PUSH_SIGMA, PUSH_TIME, DRAG_MEAN, DRAG_SIGMA, PRIOR = range(
    8
)
GATES, LIMITS = MODELS, MODELS + 1
GATE, FIRST_GATE, MIN_SIGHTINGS, MAX_REJECTIONS, MAX_REJECTION_TIME, KICK_SIGMA = range(6)
DRAG_MAX, SPEED_SIGMA, MAX_GAP, SPEAKS_AFTER, WATCHFUL, SWITCH_TIME = range(6)
SETTINGS = (MODELS + 2, 8)
"""Shape of the settings."""


def fresh() -> Array:
    """Return a memory without a track."""
    memory = np.zeros(MEMORY)
    clear(memory)
    return memory


def clear(memory: Array) -> None:
    """Forget the ball; the counts go on."""
    memory[[T, T_SEEN, T_FIRST]] = -np.inf
    memory[[USED, REJECTED, IN_A_ROW, DOUBTFUL, FILLED, ACTIVE, WAITING]] = 0.0


@kernel
def track_of(model: int) -> int:
    """Return the index of a motion model's track."""
    return BALL + TRACK * model


@kernel
def slot_at(memory: Array, age: int) -> int:
    """Return the index of the slot of the sighting that is ``age`` places before the newest."""
    return SLOTS + SLOT * ((int(memory[NEWEST]) - age) % RING)


@kernel
def save(memory: Array, slot: int) -> None:
    """Keep the estimate in a slot, as the one before its sighting."""
    memory[slot + SLOT_ESTIMATE : slot + SLOT] = memory[:ESTIMATE]


@kernel
def restore(memory: Array, slot: int) -> None:
    """Go back to the estimate before the sighting in a slot."""
    memory[:ESTIMATE] = memory[slot + SLOT_ESTIMATE : slot + SLOT]


@kernel
def tells_position(memory: Array, slot: int) -> bool:
    """Return whether a sighting says where the ball is, not only on which line."""
    R = slot + SLOT_R
    return bool(memory[R] + memory[R + 4] + memory[R + 8] <= LOOSE)


@kernel
def open_slot(memory: Array, age: int) -> int:
    """Make room ``age`` places before the newest sighting; the oldest may go. Return the slot."""
    memory[NEWEST] = (memory[NEWEST] + 1.0) % RING
    memory[FILLED] = min(memory[FILLED] + 1.0, float(RING))
    for k in range(age):
        into, origin = slot_at(memory, k), slot_at(memory, k + 1)
        memory[into : into + SLOT_ESTIMATE] = memory[origin : origin + SLOT_ESTIMATE]
    return int(slot_at(memory, age))
