"""The correction of an extended Kalman filter by a sighted position, in Joseph's form.

| here | meaning                                    | unit                 | shape    |
|------|--------------------------------------------|----------------------|----------|
| x    | r_o, dr_o, drag coefficient k, push        | m, m/s, 1/m, m/s^2   | (10,)    |
| P    | covariance of x                            |                      | (10, 10) |
| z    | sighted position                           | m                    | (3,)     |
| R    | its covariance                             | m^2                  | (3, 3)   |
| S    | covariance of the innovation z - r_o       | m^2                  | (3, 3)   |
| K    | gain, transposed                           |                      | (3, 10)  |

An estimate lies in the memory (``memory``) at an index ``at``: x, then P row by row. A sighting
lies there at a ``slot``: its time, z, then R row by row.
"""

import numpy as np

from mitt.ball.flight import STATES, track_at
from mitt.ball.linear import inverse
from mitt.ball.memory import SLOT_R, SLOT_Z
from mitt.jit import kernel
from mitt.signals import Array
from mitt.views import view

MAX_DISTANCE = 1000.0
"""Beyond it no ball is sighted [m]."""

LEAST_VARIANCE = 1e-10
"""Least variance of a sighting [m^2]: a place that is known exactly counts as known to 10 um."""

_ROUNDED = 1.0 + 1e-9
"""By what the rounding of a covariance of full correlation may exceed it."""


@kernel
def is_sane(z: Array, R: Array) -> bool:
    """Return whether a sighting is finite, near enough, and its covariance is one.

    Args:
        z: Position [m], shape (3,).
        R: Covariance [m^2], shape (3, 3).
    """
    for i in range(3):
        if not (abs(z[i]) < MAX_DISTANCE and 0.0 <= R[i, i] < MAX_DISTANCE**2):
            return False
        for j in range(i):
            if not R[i, j] * R[i, j] <= R[i, i] * R[j, j] * _ROUNDED:
                return False
    return True


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
def correct(m: Array, at: int, slot: int, gate: float, work: Array) -> float:
    """Correct an estimate by a sighting, in place, if the sighting lies within the gate.

    Args:
        m: Memory.
        at: Index of the estimate, valid at the sighting's time.
        slot: Index of the sighting.
        gate: Largest squared Mahalanobis distance of the innovation [1].
        work: Scratch, shape (2, 10, 10); S^-1 e is left in its row 6, S^-1 in row 7 (its upper
            triangle, row by row).

    Returns:
        The squared Mahalanobis distance; infinite if it has none. Beyond the gate nothing
        has changed.
    """
    x, P = track_at(m, at)
    z, R = view(m, slot + SLOT_Z, (3,)), view(m, slot + SLOT_R, (3, 3))
    ok, a, b, c, d, e, f = inverse(
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
        work[0, 6, k] = value
    for k, value in enumerate((a, b, c, d, e, f)):
        work[0, 7, k] = value
    distance = e0 * u0 + e1 * u1 + e2 * u2
    if not distance <= gate:
        return float(distance) if distance > gate else float(np.inf)
    K, half = view(work, 3 * STATES, (3, STATES)), view(work, STATES * STATES, (STATES, STATES))
    for i in range(STATES):
        p0, p1, p2 = P[0, i], P[1, i], P[2, i]
        K[0, i] = p0 * a + p1 * b + p2 * c
        K[1, i] = p0 * b + p1 * d + p2 * e
        K[2, i] = p0 * c + p1 * e + p2 * f
        x[i] += p0 * u0 + p1 * u1 + p2 * u2
    _joseph(P, K, R, half)
    return float(distance)


@kernel
def reset_motion(m: Array, at: int, slot: int, speed_sigma: float) -> None:
    """Set position and velocity uncertainty afresh; all but the position keep their means.

    Args:
        m: Memory.
        at: Index of the estimate; of its covariance the variances of drag and push stay.
        slot: Index of the sighting that the position comes from.
        speed_sigma: Standard deviation of each velocity component [m/s].
    """
    x, P = track_at(m, at)
    for i in range(STATES):
        for j in range(STATES):
            if i != j or i < 6:
                P[i, j] = 0.0
    x[:3] = view(m, slot + SLOT_Z, (3,))
    P[:3, :3] = view(m, slot + SLOT_R, (3, 3))
    for i in range(3, 6):
        P[i, i] = speed_sigma * speed_sigma
