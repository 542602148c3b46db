"""The correction of an extended Kalman filter by a sighted position, in Joseph's form.

| here | meaning                                    | unit                 | shape    |
|------|--------------------------------------------|----------------------|----------|
| x    | r_o, dr_o, drag coefficient k, push        | m, m/s, 1/m, m/s^2   | (10,)    |
| P    | covariance of x                            |                      | (10, 10) |
| z    | sighted position                           | m                    | (3,)     |
| R    | its covariance                             | m^2                  | (3, 3)   |
| S    | covariance of the innovation z - r_o       | m^2                  | (3, 3)   |
| K    | gain                                       |                      | (10, 3)  |

An estimate lies in the memory (``memory``) at an index ``at``: x, then P row by row. A sighting
lies there at a ``slot``: its time, z, then R row by row.
"""

import numpy as np

from mitt.flight import STATES, TRACK
from mitt.jit import kernel
from mitt.signals import Array
from mitt.views import view
from mitt.vision.linear import inverse
from mitt.vision.memory import SLOT_R

MAX_DISTANCE = 1000.0
"""Beyond it no ball is sighted [m]."""


@kernel
def is_sane(z: Array, R: Array) -> bool:
    """Return whether a sighting is finite, near enough, and its covariance is one.

    Args:
        z: Position [m], shape (3,).
        R: Covariance [m^2], shape (3, 3).
    """
    for i in range(3):
        if not (abs(z[i]) < MAX_DISTANCE and 0.0 < R[i, i] < MAX_DISTANCE**2):
            return False
        for j in range(i):
            if not R[i, j] * R[i, j] <= R[i, i] * R[j, j]:
                return False
    return True


@kernel
def _joseph(m: Array, at: int, slot: int, work: Array) -> None:
    """Replace P by (I - K H) P (I - K H)' + K R K', H = (I 0), with K in rows 3 to 5 of work."""
    square = (STATES, STATES)
    P, half = view(m, at + STATES, square), view(work, STATES * STATES, square)
    R = slot + SLOT_R
    r0, r1, r2, r3 = m[R], m[R + 1], m[R + 2], m[R + 4]
    r4, r5 = m[R + 5], m[R + 8]
    for i in range(STATES):
        k0, k1, k2 = work[0, 3, i], work[0, 4, i], work[0, 5, i]
        for j in range(STATES):
            half[i, j] = P[i, j] - k0 * P[0, j] - k1 * P[1, j] - k2 * P[2, j]
    for i in range(STATES):
        k0, k1, k2 = work[0, 3, i], work[0, 4, i], work[0, 5, i]
        w0 = k0 * r0 + k1 * r1 + k2 * r2 - half[i, 0]
        w1 = k0 * r1 + k1 * r3 + k2 * r4 - half[i, 1]
        w2 = k0 * r2 + k1 * r4 + k2 * r5 - half[i, 2]
        for j in range(STATES):
            P[i, j] = half[i, j] + w0 * work[0, 3, j] + w1 * work[0, 4, j] + w2 * work[0, 5, j]


@kernel
def correct(m: Array, at: int, slot: int, gate: float, work: Array) -> float:
    """Take a sighting in, in place, if it lies within the gate.

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
    P, R = at + STATES, slot + SLOT_R
    ok, a, b, c, d, e, f = inverse(
        m[P] + m[R],
        m[P + 1] + m[R + 1],
        m[P + 2] + m[R + 2],
        m[P + 11] + m[R + 4],
        m[P + 12] + m[R + 5],
        m[P + 22] + m[R + 8],
    )
    if not ok:
        return float(np.inf)
    e0, e1, e2 = m[slot + 1] - m[at], m[slot + 2] - m[at + 1], m[slot + 3] - m[at + 2]
    u0, u1, u2 = a * e0 + b * e1 + c * e2, b * e0 + d * e1 + e * e2, c * e0 + e * e1 + f * e2
    work[0, 6, 0], work[0, 6, 1], work[0, 6, 2] = u0, u1, u2
    work[0, 7, 0], work[0, 7, 1], work[0, 7, 2] = a, b, c
    work[0, 7, 3], work[0, 7, 4], work[0, 7, 5] = d, e, f
    distance = e0 * u0 + e1 * u1 + e2 * u2
    if not distance <= gate:
        return float(distance) if distance > gate else float(np.inf)
    for i in range(STATES):
        p0, p1, p2 = m[P + i], m[P + 10 + i], m[P + 20 + i]
        work[0, 3, i] = p0 * a + p1 * b + p2 * c
        work[0, 4, i] = p0 * b + p1 * d + p2 * e
        work[0, 5, i] = p0 * c + p1 * e + p2 * f
        m[at + i] += p0 * u0 + p1 * u1 + p2 * u2
    _joseph(m, at, slot, work)
    return float(distance)


@kernel
def settle(m: Array, at: int, slot: int, speed_sigma: float) -> None:
    """Set position and velocity uncertainty afresh; all but the position keep their means.

    Args:
        m: Memory.
        at: Index of the estimate; of its covariance the variances of drag and push stay.
        slot: Index of the sighting that the position comes from.
        speed_sigma: Standard deviation of each velocity component [m/s].
    """
    P = at + STATES
    for i in range(STATES):
        for j in range(STATES):
            if i != j or i < 6:
                m[P + STATES * i + j] = 0.0
    for i in range(3):
        m[at + i] = m[slot + 1 + i]
        m[P + 11 * (3 + i)] = speed_sigma * speed_sigma
        for j in range(3):
            m[P + STATES * i + j] = m[slot + SLOT_R + 3 * i + j]


@kernel
def copy(m: Array, origin: int, into: int) -> None:
    """Copy a track."""
    source, target = view(m, origin, (TRACK,)), view(m, into, (TRACK,))
    for i in range(TRACK):
        target[i] = source[i]
