"""Several motion models at once, weighted by how well each predicts the sightings.

| model  | motion                                              | for                           |
|--------|-----------------------------------------------------|-------------------------------|
| flight | gravity, drag, a small push that varies slowly      | a ball in the air             |
| steady | constant velocity, hardly disturbed                 | what rests, rolls or is moved |
| driven | a strong push that varies within tenths of a second | a hand, a spring, a machine   |

An interacting multiple-model filter (Blom and Bar-Shalom, IEEE Trans. Automatic Control 33(8),
1988) with two departures. There the estimates are mixed at every step; here a model whose weight
has sunk to the floor starts again from the best model's position and velocity: that mixes where
it matters, and leaves drag and push, whose meanings differ, to each model. And while only flight
has weight the other models are inactive, because mixed from flight at every step they would know
nothing of their own. They are activated when flight's mean innovation grows, and when its
velocity is forgotten.
"""

from math import exp, sqrt

from mitt.ball import memory as at
from mitt.ball.flight import STATES, advance_uncertain, track_at
from mitt.ball.kalman import correct
from mitt.ball.linear import inverse
from mitt.ball.memory import BALL, LIMITS, track_of
from mitt.jit import kernel
from mitt.signals import Array

FLOOR = 1e-3
"""Weight at which a model starts again from the best one."""

NEW_SHARE = 1.0 / 16.0
"""Share of the newest innovation in the mean that tells whether flight still fits."""

BIAS_LIMIT = 25.0
"""Squared Mahalanobis distance of that mean from zero at which it does not: beyond it in 1.5e-5
of cases if flight is right (chi-squared, 3 degrees of freedom)."""

CALM_LIMIT = 8.0
"""Sightings in a row with all weight on flight after which the other models are deactivated."""


@kernel
def reset_drag_and_push(memory: Array, model: int, settings: Array) -> None:
    """Give a model's drag and push their priors, independent of all else."""
    x, P = track_at(memory, track_of(model))
    P[6:] = 0.0
    P[:, 6:] = 0.0
    x[6:] = 0.0
    for i in range(7, STATES):
        P[i, i] = settings[model, at.PUSH_SIGMA] ** 2
    x[6] = settings[model, at.DRAG_MEAN]
    P[6, 6] = settings[model, at.DRAG_SIGMA] ** 2


@kernel
def _restart(memory: Array, model: int, origin: int, settings: Array) -> None:
    """Start a model again from the position and velocity of another."""
    x, P = track_at(memory, track_of(model))
    x_from, P_from = track_at(memory, track_of(origin))
    x[:6] = x_from[:6]
    P[:6, :6] = P_from[:6, :6]
    reset_drag_and_push(memory, model, settings)


@kernel
def activate(memory: Array, settings: Array) -> None:
    """Start all other models from the best; the prior counts as much as the weights so far."""
    best = int(memory[at.BEST])
    for model in range(at.MODELS):
        so_far = 1.0 if model == best else 0.0
        if memory[at.ACTIVE] > 0.0:
            so_far = memory[at.WEIGHT + model]
        memory[at.WEIGHT + model] = 0.5 * (so_far + settings[model, at.PRIOR])
        if model != best:
            _restart(memory, model, best, settings)
    memory[at.ACTIVE], memory[at.CALM] = 1.0, 0.0


@kernel
def deactivate(memory: Array) -> None:
    """Go on with flight alone."""
    memory[at.ACTIVE : at.RUN] = 0.0
    memory[at.BIAS : BALL] = 0.0


@kernel
def fit(memory: Array, slot: int, gate: float, settings: Array, work: Array) -> bool:
    """Carry the estimate to a sighting; correct it, and return true, if that lies in the gate."""
    dt = memory[slot] - memory[at.T]
    memory[at.T] = memory[slot]
    if memory[at.ACTIVE] > 0.0:
        return bool(_fit_all(memory, slot, dt, gate, settings, work))
    distance = _fit_one(memory, 0, slot, dt, gate, settings, work)
    if distance > gate:
        return False
    # The newest innovation e, of covariance S, enters the means of S^-1 e and its covariance;
    # `correct` has left both in rows 6 and 7 of the scratch.
    old, new = 1.0 - NEW_SHARE, NEW_SHARE
    for i in range(3):
        memory[at.BIAS + i] = old * memory[at.BIAS + i] + new * work[0, 6, i]
    for i in range(6):
        k = at.PRECISION + i
        memory[k] = old * old * memory[k] + new * new * work[0, 7, i]
    return True


@kernel
def is_biased(memory: Array) -> bool:
    """Return whether the innovations lean to one side more than flight explains."""
    if memory[at.ACTIVE] > 0.0:
        return False
    k = at.PRECISION
    ok, a, b, c, d, e, f = inverse(
        memory[k], memory[k + 1], memory[k + 2], memory[k + 3], memory[k + 4], memory[k + 5]
    )
    x, y, z = memory[at.BIAS], memory[at.BIAS + 1], memory[at.BIAS + 2]
    distance = a * x * x + d * y * y + f * z * z + 2.0 * (b * x * y + c * x * z + e * y * z)
    return bool(ok and distance > BIAS_LIMIT)


@kernel
def _fit_one(
    memory: Array, model: int, slot: int, dt: float, gate: float, settings: Array, work: Array
) -> float:
    """Carry one model's estimate to a sighting and correct it; return the squared distance."""
    x = track_of(model)
    advance_uncertain(memory, x, dt, settings, model, work)
    distance = correct(memory, x, slot, gate, work)
    memory[x + 6] = min(max(memory[x + 6], 0.0), settings[LIMITS, at.DRAG_MAX])
    return float(distance)


@kernel
def _fit_all(
    memory: Array, slot: int, dt: float, gate: float, settings: Array, work: Array
) -> bool:
    """Correct every model by the sighting, and weight them; false if none accepts it."""
    stay = exp(-abs(dt) / settings[LIMITS, at.SWITCH_TIME])
    total, before = 0.0, (memory[at.WEIGHT], memory[at.WEIGHT + 1], memory[at.WEIGHT + 2])
    for model in range(at.MODELS):
        distance = _fit_one(memory, model, slot, dt, gate, settings, work)
        likelihood = 0.0
        if distance <= gate:
            a, b, c = work[0, 7, 0], work[0, 7, 1], work[0, 7, 2]
            d, e, f = work[0, 7, 3], work[0, 7, 4], work[0, 7, 5]
            precision = a * (d * f - e * e) - b * (b * f - c * e) + c * (b * e - c * d)
            likelihood = sqrt(max(precision, 0.0)) * exp(-0.5 * distance)
        prior = stay * before[model] + (1.0 - stay) * settings[model, at.PRIOR]
        memory[at.WEIGHT + model] = prior * likelihood
        total += prior * likelihood
    if not total > 0.0:
        for model in range(at.MODELS):
            memory[at.WEIGHT + model] = before[model]
        return False
    _compare(memory, total, settings)
    return True


@kernel
def _compare(memory: Array, total: float, settings: Array) -> None:
    """Normalise the weights, find the best model, restart the worst, deactivate when calm."""
    best = 0
    for model in range(at.MODELS):
        memory[at.WEIGHT + model] /= total
        if memory[at.WEIGHT + model] > memory[at.WEIGHT + best]:
            best = model
    memory[at.BEST] = float(best)
    others = 1.0 - memory[at.WEIGHT]
    for model in range(at.MODELS):
        if memory[at.WEIGHT + model] < FLOOR:
            memory[at.WEIGHT + model] = FLOOR
            _restart(memory, model, best, settings)
    memory[at.CALM] = memory[at.CALM] + 1.0 if others < at.MODELS * FLOOR else 0.0
    if memory[at.CALM] >= CALM_LIMIT:
        deactivate(memory)
