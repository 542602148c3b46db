"""Several motion models at once, each a Kalman filter, weighted by how well they predict sightings.

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

Each model is corrected as an extended Kalman filter by a sighted position, in Joseph's form:

| here | meaning                                    | unit                 | shape    |
|------|--------------------------------------------|----------------------|----------|
| x    | r_o, dr_o, drag coefficient k, push        | m, m/s, 1/m, m/s^2   | (10,)    |
| P    | covariance of x                            |                      | (10, 10) |
| z    | sighted position                           | m                    | (3,)     |
| R    | its covariance                             | m^2                  | (3, 3)   |
| S    | covariance of the innovation z - r_o       | m^2                  | (3, 3)   |
| K    | gain, transposed                           |                      | (3, 10)  |

All that a filter knows is one record, ``FILTER``; its kernels take it as ``b``.
"""

from math import exp, sqrt

import numpy as np

from mitt.core.ball.flight import STATES, MotionModel, advance_uncertain
from mitt.core.kernels import Fields, copy, kernel
from mitt.core.signals import Array

MODELS = 3
"""Motion models: flight, steady, driven."""
RING = 64
"""Sightings that are remembered: 64 ms at 1 kHz, of which 24 may be doubtful."""
ROW = 3
"""Sightings in a row that are believed: of another time than the track's, where the ball is after a
doubt, or rejected for long enough, that it was kicked."""
UNLIKELY = 25.0
"""Squared Mahalanobis distance beyond which three numbers are in 1.5e-5 of cases, if all is as it
is taken to be (chi-squared, 3 degrees of freedom)."""

ESTIMATE = np.dtype(
    [
        ("t", float),  # time for which it holds [s]
        ("t_seen", float),  # of the last sighting that was accepted [s]
        ("t_first", float),  # of the first one of the track [s]
        ("used", int),  # sightings of the track that were accepted
        ("rejected", int),  # sightings rejected in this doubt
        ("in_a_row", int),  # accepted in a row in this doubt
        ("doubtful", int),  # sightings since the doubt began; 0 without one
        ("run", int),  # rejected in a row
        ("taken", int),  # bit k: whether the sighting k places before the newest was accepted
        ("reachable", int),  # the same: rejected, and a kick can have carried the ball there
        ("all_used", int),  # counts over all tracks
        ("all_rejected", int),
        ("all_vague", int),  # where a track was to begin, without a position
        ("all_kicks", int),
        ("all_restarts", int),
        ("active", bool),  # whether the other models are weighted, too
        ("best", int),  # model of the largest weight
        ("calm", int),  # sightings in a row with all weight on flight
        ("weight", float, (MODELS,)),
        ("bias", float, (3,)),  # mean of S^-1 e, e the innovations while flight is alone
        ("precision", float, (6,)),  # covariance of that mean
        ("x", float, (MODELS, STATES)),
        ("P", float, (MODELS, STATES, STATES)),
    ],
    align=True,
)
SIGHTING = np.dtype(
    [
        ("t", float),  # exposure [s]
        ("z", float, (3,)),  # position [m]
        ("R", float, (3, 3)),  # its covariance [m^2]
    ],
    align=True,
)
SLOT = np.dtype(
    [
        ("seen", SIGHTING),
        ("before", ESTIMATE),  # the estimate before it
    ],
    align=True,
)
DROPPED = np.dtype(
    [(name, int) for name in ("unusable", "untimely", "duplicate", "repeated", "isolated", "late")]
)
#: Sightings that no estimate has to do with; see :class:`mitt.core.ball.filter.FilterCounts`.
MODEL = np.dtype(
    [(name, float) for name in (*MotionModel._fields, "drag_mean", "drag_sigma", "prior")]
)
#: As of :class:`mitt.core.ball.filter.FilterConfig`.
SETTINGS = np.dtype(
    [
        ("gate", float),
        ("first_gate", float),
        ("min_sightings", int),
        ("max_rejections", int),
        ("max_rejection_time", float),
        ("kick_sigma", float),
        ("drag_max", float),
        ("speed_sigma", float),
        ("max_gap", float),
        ("speaks_after", int),
        ("watchful", bool),
        ("switch_time", float),
    ],
    align=True,
)
WORK = np.dtype(
    [
        ("A", float, (6, 4)),
        ("FP", float, (STATES, STATES)),
        ("K", float, (3, STATES)),
        ("weighted", float, (3,)),  # S^-1 e of the newest innovation e
        ("precision", float, (6,)),  # S^-1, its upper triangle row by row
        ("x", float, (STATES,)),  # an estimate that is carried to another instant
        ("P", float, (STATES, STATES)),
    ],
    align=True,
)
FILTER = np.dtype(
    [
        ("settings", SETTINGS),
        ("models", MODEL, (MODELS,)),
        ("now", ESTIMATE),
        ("spare", ESTIMATE),  # gone back to where a trial has failed
        ("ring", SLOT, (RING,)),  # the newest sightings, each with the estimate before it
        ("filled", int),  # how many there are, and where the newest lies
        ("newest", int),
        ("given", SIGHTING),  # the one that is processed
        ("waiting", SIGHTING, (ROW,)),  # sightings of another time than the track's
        ("waits", int),  # how many there are
        ("dropped", DROPPED),
        ("drag", float),  # drag coefficient of the last prediction [1/m]
        ("lift", float, (3,)),  # its w [1/s]; zero where the ball is not one that may spin
        ("work", WORK),
    ],
    align=True,
)

MAX_DISTANCE = 1000.0
"""Beyond it no ball is sighted [m]."""
LEAST_VARIANCE = 1e-10
"""Least variance of a sighting [m^2]: a place that is known exactly counts as known to 10 um."""
LOOSE = 0.5
"""Variance of a sighting, all directions together, above which it does not tell a position: one
camera made it [m^2]."""
_ROUNDED = 1.0 + 1e-9
"""By what the rounding of a covariance of full correlation may exceed it."""

FLOOR = 1e-3
"""Weight at which a model starts again from the best one."""
NEW_SHARE = 1.0 / 16.0
"""Share of the newest innovation in the mean that tells whether flight still fits: not if the mean
is ``UNLIKELY`` far from zero."""
CALM_LIMIT = 8
"""Sightings in a row with all weight on flight after which the other models are deactivated."""


@kernel
def symmetric_inverse(
    a: float, b: float, c: float, d: float, e: float, f: float
) -> tuple[bool, float, float, float, float, float, float]:
    """Return whether [[a, b, c], [b, d, e], [c, e, f]] can be inverted, and its inverse likewise.

    It can if it is positive definite with a condition that leaves digits. By elimination: where one
    direction is known a million times worse than the others, cofactors leave no digit.
    """
    p, q = b / a if a > 0.0 else 0.0, c / a if a > 0.0 else 0.0
    d1, e1 = d - b * p, e - b * q
    w = e1 / d1 if d1 > 0.0 else 0.0
    f1 = f - c * q - e1 * w
    if not (a > 0.0 and d1 > 1e-13 * d and f1 > 1e-13 * f):
        return False, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    v = p * w - q
    F = 1.0 / f1
    E, D = -w * F, 1.0 / d1 + w * w * F
    return True, 1.0 / a + p * p / d1 + v * v * F, -p / d1 - v * w * F, v * F, D, E, F


@kernel
def invert_positive(S: Array, out: Array) -> bool:
    """Write the inverse of a symmetric matrix, shape (3, 3); return whether there is one.

    That is as for :func:`symmetric_inverse`; if there is none, ``out`` is unchanged.
    """
    ok, a, b, c, d, e, f = symmetric_inverse(S[0, 0], S[0, 1], S[0, 2], S[1, 1], S[1, 2], S[2, 2])
    if ok:
        out[0, 0], out[0, 1], out[0, 2] = a, b, c
        out[1, 0], out[1, 1], out[1, 2] = b, d, e
        out[2, 0], out[2, 1], out[2, 2] = c, e, f
    return bool(ok)


@kernel
def is_sane(z: Array, R: Array) -> bool:
    """Return whether a sighting is finite, near enough, and its covariance is one."""
    for i in range(3):
        if not (abs(z[i]) < MAX_DISTANCE and 0.0 <= R[i, i] < MAX_DISTANCE**2):
            return False
        for j in range(i):
            if not R[i, j] * R[i, j] <= R[i, i] * R[j, j] * _ROUNDED:
                return False
    return True


@kernel
def is_set(bits: int, k: int) -> bool:
    """Say whether bit ``k`` is set."""
    return bool((bits >> k) & 1)


@kernel
def tells_position(seen: Fields) -> bool:
    """Return whether a sighting says where the ball is, not only on which line."""
    return bool(seen.R[0, 0] + seen.R[1, 1] + seen.R[2, 2] <= LOOSE)


@kernel
def _joseph(P: Array, K: Array, R: Array, half: Array) -> None:
    """Replace P by (I - K' H) P (I - K' H)' + K' R K, H = (I 0); ``half`` is scratch."""
    for i in range(STATES):
        a, b, c = K[0, i], K[1, i], K[2, i]
        for j in range(STATES):
            half[i, j] = P[i, j] - a * P[0, j] - b * P[1, j] - c * P[2, j]
    for i in range(STATES):
        a, b, c = K[0, i], K[1, i], K[2, i]
        u = a * R[0, 0] + b * R[0, 1] + c * R[0, 2] - half[i, 0]
        v = a * R[0, 1] + b * R[1, 1] + c * R[1, 2] - half[i, 1]
        w = a * R[0, 2] + b * R[1, 2] + c * R[2, 2] - half[i, 2]
        for j in range(STATES):
            P[i, j] = half[i, j] + u * K[0, j] + v * K[1, j] + w * K[2, j]


@kernel
def _correct(x: Array, P: Array, seen: Fields, gate: float, work: Fields) -> float:
    """Correct an estimate by a sighting of its time, in place, if that lies within the gate.

    Returns:
        The squared Mahalanobis distance; infinite if it has none. Beyond the gate nothing
        has changed. ``work`` holds S^-1 e and S^-1 afterwards.
    """
    z, R = seen.z, seen.R
    ok, a, b, c, d, e, f = symmetric_inverse(
        P[0, 0] + R[0, 0],
        P[0, 1] + R[0, 1],
        P[0, 2] + R[0, 2],
        P[1, 1] + R[1, 1],
        P[1, 2] + R[1, 2],
        P[2, 2] + R[2, 2],
    )
    if not ok:
        return float(np.inf)
    e0, e1, e2 = z[0] - x[0], z[1] - x[1], z[2] - x[2]
    u0, u1, u2 = a * e0 + b * e1 + c * e2, b * e0 + d * e1 + e * e2, c * e0 + e * e1 + f * e2
    for k, value in enumerate((u0, u1, u2)):
        work.weighted[k] = value
    for k, value in enumerate((a, b, c, d, e, f)):
        work.precision[k] = value
    distance = e0 * u0 + e1 * u1 + e2 * u2
    if not distance <= gate:
        return float(distance) if distance > gate else float(np.inf)
    K = work.K
    for i in range(STATES):
        p0, p1, p2 = P[0, i], P[1, i], P[2, i]
        K[0, i] = p0 * a + p1 * b + p2 * c
        K[1, i] = p0 * b + p1 * d + p2 * e
        K[2, i] = p0 * c + p1 * e + p2 * f
        x[i] += p0 * u0 + p1 * u1 + p2 * u2
    _joseph(P, K, R, work.FP)
    return float(distance)


@kernel
def reset_motion(x: Array, P: Array, seen: Fields, speed_sigma: float) -> None:
    """Set position and velocity uncertainty afresh; all but the position keep their means.

    Args:
        x: Estimate, shape (10,).
        P: Its covariance, of which the variances of drag and push stay, shape (10, 10).
        seen: The sighting that the position comes from.
        speed_sigma: Standard deviation of each velocity component [m/s].
    """
    for i in range(STATES):
        for j in range(STATES):
            if i != j or i < 6:
                P[i, j] = 0.0
    copy(seen.z, x[:3])
    copy(seen.R, P[:3, :3])
    for i in range(3, 6):
        P[i, i] = speed_sigma * speed_sigma


@kernel
def reset_drag_and_push(b: Fields, model: int) -> None:
    """Give a model's drag and push their priors, independent of all else."""
    x, P, prior = b.now.x[model], b.now.P[model], b.models[model]
    P[6:] = 0.0
    P[:, 6:] = 0.0
    x[6:] = 0.0
    for i in range(7, STATES):
        P[i, i] = prior.push_sigma**2
    x[6] = prior.drag_mean
    P[6, 6] = prior.drag_sigma**2


@kernel
def _restart(b: Fields, model: int, origin: int) -> None:
    """Start a model again from the position and velocity of another."""
    copy(b.now.x[origin, :6], b.now.x[model, :6])
    copy(b.now.P[origin, :6, :6], b.now.P[model, :6, :6])
    reset_drag_and_push(b, model)


@kernel
def activate(b: Fields) -> None:
    """Start all other models from the best; the prior counts as much as the weights so far."""
    now = b.now
    for model in range(MODELS):
        so_far = 1.0 if model == now.best else 0.0
        if now.active:
            so_far = now.weight[model]
        now.weight[model] = 0.5 * (so_far + b.models[model].prior)
        if model != now.best:
            _restart(b, model, now.best)
    now.active, now.calm = True, 0


@kernel
def deactivate(b: Fields) -> None:
    """Go on with flight alone."""
    now = b.now
    now.active, now.best, now.calm = False, 0, 0
    now.weight[:] = 0.0
    now.bias[:] = 0.0
    now.precision[:] = 0.0


@kernel
def correct_within_gate(b: Fields, seen: Fields, gate: float) -> bool:
    """Carry the estimate to a sighting; correct it, and return true, if that lies in the gate."""
    now, dt = b.now, seen.t - b.now.t
    now.t = seen.t
    if now.active:
        return bool(_fit_all(b, seen, dt, gate))
    if _fit_one(b, 0, seen, dt, gate) > gate:
        return False
    # The newest innovation e, of covariance S, enters the means of S^-1 e and its covariance.
    old, new = 1.0 - NEW_SHARE, NEW_SHARE
    for i in range(3):
        now.bias[i] = old * now.bias[i] + new * b.work.weighted[i]
    for i in range(6):
        now.precision[i] = old * old * now.precision[i] + new * new * b.work.precision[i]
    return True


@kernel
def is_biased(now: Fields) -> bool:
    """Return whether the innovations lean to one side more than flight explains."""
    if now.active:
        return False
    p, (x, y, z) = now.precision, (now.bias[0], now.bias[1], now.bias[2])
    ok, a, b, c, d, e, f = symmetric_inverse(p[0], p[1], p[2], p[3], p[4], p[5])
    distance = a * x * x + d * y * y + f * z * z + 2.0 * (b * x * y + c * x * z + e * y * z)
    return bool(ok and distance > UNLIKELY)


@kernel
def _fit_one(b: Fields, model: int, seen: Fields, dt: float, gate: float) -> float:
    """Carry one model's estimate to a sighting and correct it; return the squared distance."""
    x, P, work = b.now.x[model], b.now.P[model], b.work
    advance_uncertain(x, P, dt, b.models[model], work.A, work.FP)
    distance = _correct(x, P, seen, gate, work)
    x[6] = min(max(x[6], 0.0), b.settings.drag_max)
    return float(distance)


@kernel
def _fit_all(b: Fields, seen: Fields, dt: float, gate: float) -> bool:
    """Correct every model by the sighting, and weight them; false if none accepts it."""
    weight, p = b.now.weight, b.work.precision
    stay = exp(-abs(dt) / b.settings.switch_time)
    total, before = 0.0, (weight[0], weight[1], weight[2])
    for model in range(MODELS):
        distance = _fit_one(b, model, seen, dt, gate)
        likelihood = 0.0
        if distance <= gate:
            precision = p[0] * (p[3] * p[5] - p[4] * p[4]) - p[1] * (p[1] * p[5] - p[2] * p[4])
            precision += p[2] * (p[1] * p[4] - p[2] * p[3])
            likelihood = sqrt(max(precision, 0.0)) * exp(-0.5 * distance)
        prior = stay * before[model] + (1.0 - stay) * b.models[model].prior
        weight[model] = prior * likelihood
        total += prior * likelihood
    if not total > 0.0:
        for model in range(MODELS):
            weight[model] = before[model]
        return False
    _compare(b, total)
    return True


@kernel
def _compare(b: Fields, total: float) -> None:
    """Normalise the weights, find the best model, restart the worst, deactivate when calm."""
    now, weight, best = b.now, b.now.weight, 0
    for model in range(MODELS):
        weight[model] /= total
        if weight[model] > weight[best]:
            best = model
    now.best = best
    others = 1.0 - weight[0]
    for model in range(MODELS):
        if weight[model] < FLOOR:
            weight[model] = FLOOR
            _restart(b, model, best)
    now.calm = now.calm + 1 if others < MODELS * FLOOR else 0
    if now.calm >= CALM_LIMIT:
        deactivate(b)
