"""Several laws of motion at once, weighed by how well each foretells the sightings.

| law    | motion                                              | for                          |
|--------|-----------------------------------------------------|------------------------------|
| flight | gravity, drag, a small push that varies slowly      | a ball in the air            |
| steady | constant velocity, hardly disturbed                 | what rests, rolls or is led  |
| driven | a strong push that varies within tenths of a second | a hand, a spring, a machine  |

The bank is an interacting multiple-model filter (Blom and Bar-Shalom, IEEE Trans. Automatic
Control 33(8), 1988) with two departures. There the estimates are mixed at every step; here a law
whose weight has sunk to the floor starts again from the best law's position and velocity, which
is the mixing where it matters and leaves drag and push, whose meanings differ, to each law. And
while only flight has weight the other laws sleep, because mixed from flight at every step they
would know nothing of their own: a ball in the air costs one law, not three. They wake when
flight's mean squared innovation grows, and when its velocity is forgotten.
"""

from math import exp, sqrt

from mitt.flight import STATES, TRACK, advance_uncertain
from mitt.jit import kernel
from mitt.signals import Array
from mitt.vision import memory as at
from mitt.vision.kalman import correct
from mitt.vision.linear import inverse
from mitt.vision.memory import BALL, LIMITS

FLOOR = 1e-3
"""Weight at which a law starts again from the best one."""

MEMORY_OF_FIT = 1.0 / 16.0
"""Share of the newest innovation in the mean that tells whether flight still fits."""

BIAS_WAKES = 25.0
"""Squared Mahalanobis distance of that mean from zero at which it does not: beyond it in 1.5e-5
of cases if flight is right (chi-squared, 3 degrees of freedom)."""

CALM_SLEEPS = 8.0
"""Sightings in a row with all weight on flight after which the other laws sleep."""


@kernel
def track_of(law: int) -> int:
    """Return the index of a law's track."""
    return BALL + TRACK * law


@kernel
def forget(memory: Array, law: int, settings: Array) -> None:
    """Give a law's drag and push their priors, independent of all else."""
    x, P = track_of(law), track_of(law) + STATES
    for i in range(6, STATES):
        for j in range(STATES):
            memory[P + STATES * i + j] = memory[P + STATES * j + i] = 0.0
        memory[x + i] = 0.0
        memory[P + 11 * i] = settings[law, at.PUSH_SIGMA] ** 2
    memory[x + 6] = settings[law, at.DRAG_MEAN]
    memory[P + 66] = settings[law, at.DRAG_SIGMA] ** 2


@kernel
def seed(memory: Array, law: int, origin: int, settings: Array) -> None:
    """Start a law again from the position and velocity of another."""
    into, source = track_of(law), track_of(origin)
    for i in range(6):
        memory[into + i] = memory[source + i]
        for j in range(6):
            k = STATES + STATES * i + j
            memory[into + k] = memory[source + k]
    forget(memory, law, settings)


@kernel
def wake(memory: Array, settings: Array) -> None:
    """Start all other laws from the best one; the prior counts as much as the weights so far."""
    best = int(memory[at.BEST])
    for law in range(at.LAWS):
        so_far = 1.0 if law == best else 0.0
        if memory[at.AWAKE] > 0.0:
            so_far = memory[at.WEIGHT + law]
        memory[at.WEIGHT + law] = 0.5 * (so_far + settings[law, at.PRIOR])
        if law != best:
            seed(memory, law, best, settings)
    memory[at.AWAKE], memory[at.CALM] = 1.0, 0.0


@kernel
def fall_asleep(memory: Array) -> None:
    """Leave flight alone."""
    for i in range(at.AWAKE, at.RUN):
        memory[i] = 0.0
    for i in range(at.BIAS, BALL):
        memory[i] = 0.0


@kernel
def fit(memory: Array, slot: int, gate: float, settings: Array, work: Array) -> bool:
    """Carry the estimate to a sighting; take it in, and return true, if it lies in the gate."""
    dt = memory[slot] - memory[at.T]
    memory[at.T] = memory[slot]
    if memory[at.AWAKE] > 0.0:
        return bool(_fit_all(memory, slot, dt, gate, settings, work))
    distance = _fit_one(memory, 0, slot, dt, gate, settings, work)
    if distance > gate:
        return False
    _note_bias(memory, work)
    return True


@kernel
def _note_bias(memory: Array, work: Array) -> None:
    """Let the newest innovation e, of covariance S, enter the mean of S^-1 e and its covariance.

    ``correct`` has left both in rows 6 and 7 of the scratch.
    """
    old, new = 1.0 - MEMORY_OF_FIT, MEMORY_OF_FIT
    for i in range(3):
        memory[at.BIAS + i] = old * memory[at.BIAS + i] + new * work[0, 6, i]
    for k in range(6):
        i = at.PRECISION + k
        memory[i] = old * old * memory[i] + new * new * work[0, 7, k]


@kernel
def is_biased(memory: Array) -> bool:
    """Return whether the innovations lean to one side more than flight explains."""
    if memory[at.AWAKE] > 0.0:
        return False
    k = at.PRECISION
    ok, a, b, c, d, e, f = inverse(
        memory[k], memory[k + 1], memory[k + 2], memory[k + 3], memory[k + 4], memory[k + 5]
    )
    x, y, z = memory[at.BIAS], memory[at.BIAS + 1], memory[at.BIAS + 2]
    distance = a * x * x + d * y * y + f * z * z + 2.0 * (b * x * y + c * x * z + e * y * z)
    return bool(ok and distance > BIAS_WAKES)


@kernel
def _fit_one(
    memory: Array, law: int, slot: int, dt: float, gate: float, settings: Array, work: Array
) -> float:
    """Carry one law's estimate to a sighting and correct it; return the squared distance."""
    x = track_of(law)
    advance_uncertain(memory, x, dt, settings, law, work)
    distance = correct(memory, x, slot, gate, work)
    memory[x + 6] = min(max(memory[x + 6], 0.0), settings[LIMITS, at.DRAG_MAX])
    return float(distance)


@kernel
def _fit_all(
    memory: Array, slot: int, dt: float, gate: float, settings: Array, work: Array
) -> bool:
    """Let every law take the sighting in, and weigh them; false if none accepts it."""
    stay = exp(-abs(dt) / settings[LIMITS, at.SWITCH_TIME])
    total, before = 0.0, (memory[at.WEIGHT], memory[at.WEIGHT + 1], memory[at.WEIGHT + 2])
    for law in range(at.LAWS):
        distance = _fit_one(memory, law, slot, dt, gate, settings, work)
        likelihood = 0.0
        if distance <= gate:
            likelihood = sqrt(_determinant(work)) * exp(-0.5 * distance)
        prior = stay * before[law] + (1.0 - stay) * settings[law, at.PRIOR]
        memory[at.WEIGHT + law] = prior * likelihood
        total += prior * likelihood
    if not total > 0.0:
        for law in range(at.LAWS):
            memory[at.WEIGHT + law] = before[law]
        return False
    _settle(memory, total, settings)
    return True


@kernel
def _determinant(work: Array) -> float:
    """Return the determinant of the inverse that ``correct`` leaves in its scratch."""
    a, b, c, d, e, f = (
        work[0, 7, 0], work[0, 7, 1], work[0, 7, 2], work[0, 7, 3], work[0, 7, 4], work[0, 7, 5]
    )  # fmt: skip
    return float(max(a * (d * f - e * e) - b * (b * f - c * e) + c * (b * e - c * d), 0.0))


@kernel
def _settle(memory: Array, total: float, settings: Array) -> None:
    """Normalise the weights, name the best law, restart the hopeless, sleep when all is calm."""
    best = 0
    for law in range(at.LAWS):
        memory[at.WEIGHT + law] /= total
        if memory[at.WEIGHT + law] > memory[at.WEIGHT + best]:
            best = law
    memory[at.BEST] = float(best)
    others = 1.0 - memory[at.WEIGHT]
    for law in range(at.LAWS):
        if memory[at.WEIGHT + law] < FLOOR:
            memory[at.WEIGHT + law] = FLOOR
            seed(memory, law, best, settings)
    memory[at.CALM] = memory[at.CALM] + 1.0 if others < at.LAWS * FLOOR else 0.0
    if memory[at.CALM] >= CALM_SLEEPS:
        fall_asleep(memory)
