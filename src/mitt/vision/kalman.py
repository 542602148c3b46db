"""The correction of an extended Kalman filter by a sighted position, in Joseph's form.

| here | meaning                                  | unit        | shape  |
|------|------------------------------------------|-------------|--------|
| ``x``| r_o, dr_o, drag coefficient k            | m, m/s, 1/m | (7,)   |
| ``P``| covariance of ``x``                      |             | (7, 7) |
| ``z``| sighted position                         | m           | (3,)   |
| ``R``| its covariance                           | m^2         | (3, 3) |
| ``K``| gain                                     |             | (7, 3) |
"""

import numpy as np
from numba import njit

from mitt.flight import acceleration, advance_uncertain
from mitt.signals import Array
from mitt.vision.linear import invert_positive

MAX_DISTANCE = 1000.0
"""Beyond it no ball is sighted [m]."""


@njit(cache=True)
def _joseph(P: Array, K: Array, R: Array, work: Array) -> None:
    """Replace ``P`` by (I - K H) P (I - K H)' + K R K' with H = (I 0), shapes (7, 7), (7, 3)."""
    half = work[0]
    for i in range(7):
        for j in range(7):
            total = P[i, j]
            for m in range(3):
                total -= K[i, m] * P[m, j]
            half[i, j] = total
    for i in range(7):
        for j in range(i + 1):
            total = half[i, j]
            for m in range(3):
                total -= half[i, m] * K[j, m]
                for n in range(3):
                    total += K[i, m] * R[m, n] * K[j, n]
            P[i, j] = total
            P[j, i] = total


@njit(cache=True)
def correct(x: Array, P: Array, z: Array, R: Array, gate: float, work: Array) -> float:
    """Take a sighting in, in place, if it lies within the gate.

    Args:
        x: Estimate at the sighting's time, shape (7,).
        P: Its covariance, shape (7, 7).
        z: Sighted position [m], shape (3,).
        R: Its covariance [m^2], shape (3, 3).
        gate: Largest squared Mahalanobis distance of the innovation [1].
        work: Scratch, shape (2, 7, 7).

    Returns:
        The squared Mahalanobis distance; infinite if it has none. Beyond the gate nothing
        has changed.
    """
    S, inverse, K = work[0, 0:3, 0:3], work[0, 3:6, 0:3], work[1, :, 0:3]
    for i in range(3):
        for j in range(3):
            S[i, j] = P[i, j] + R[i, j]
    if not invert_positive(S, inverse):
        return float(np.inf)
    distance = 0.0
    for i in range(3):
        for j in range(3):
            distance += (z[i] - x[i]) * inverse[i, j] * (z[j] - x[j])
    if not distance <= gate:
        return distance if distance > gate else float(np.inf)
    for i in range(7):
        for j in range(3):
            K[i, j] = P[i, 0] * inverse[0, j] + P[i, 1] * inverse[1, j] + P[i, 2] * inverse[2, j]
    e0, e1, e2 = z[0] - x[0], z[1] - x[1], z[2] - x[2]
    for i in range(7):
        x[i] += K[i, 0] * e0 + K[i, 1] * e1 + K[i, 2] * e2
    _joseph(P, K, R, work)
    return float(distance)


@njit(cache=True)
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


@njit(cache=True)
def follow(
    x: Array, P: Array, dt: float, z: Array, R: Array, gate: float, settings: Array, work: Array
) -> float:
    """Carry the estimate to a sighting and take it in; see ``advance_uncertain``, ``correct``.

    Args:
        x: Estimate, overwritten, shape (7,).
        P: Its covariance, overwritten, shape (7, 7).
        dt: Time from the estimate to the sighting [s].
        z: Sighted position [m], shape (3,).
        R: Its covariance [m^2], shape (3, 3).
        gate: Largest squared Mahalanobis distance of the innovation [1].
        settings: Densities of acceleration and drag, largest drag, shape (3,).
        work: Scratch, shape (2, 7, 7).
    """
    advance_uncertain(x, P, dt, settings[0], settings[1], work)
    distance = correct(x, P, z, R, gate, work)
    x[6] = min(max(x[6], 0.0), settings[2])
    return float(distance)


@njit(cache=True)
def take(
    tracks: Array,
    dt: float,
    z: Array,
    R: Array,
    gate: float,
    keep: bool,
    settings: Array,
    work: Array,
) -> float:
    """Take a sighting into the first of two tracks; see :func:`follow`.

    Args:
        tracks: Estimate and the one last believed, each ``x`` in row 0 and ``P`` in the rows
            below, shape (>= 2, 8, 7).
        dt: Time from the estimate to the sighting [s].
        z: Sighted position [m], shape (3,).
        R: Its covariance [m^2], shape (3, 3).
        gate: Largest squared Mahalanobis distance of the innovation [1].
        keep: Whether to copy the estimate into the second track first.
        settings: Densities of acceleration and drag, largest drag, shape (3,).
        work: Scratch, shape (2, 7, 7).

    Returns:
        The squared Mahalanobis distance; negative for a sighting that cannot be, and then
        nothing has changed.
    """
    if not is_sane(z, R):
        return -1.0
    if keep:
        copy(tracks[0], tracks[1])
    return float(follow(tracks[0, 0], tracks[0, 1:], dt, z, R, gate, settings, work))


@njit(cache=True)
def settle(x: Array, P: Array, z: Array, R: Array, speed_sigma: float) -> None:
    """Set position and velocity uncertainty afresh; velocity and drag keep their means.

    Args:
        x: Estimate, its position overwritten, shape (7,).
        P: Its covariance, overwritten but for the variance of the drag, shape (7, 7).
        z: Position [m], shape (3,).
        R: Its covariance [m^2], shape (3, 3).
        speed_sigma: Standard deviation of each velocity component [m/s].
    """
    drag_variance = P[6, 6]
    P[:, :] = 0.0
    P[6, 6] = drag_variance
    for i in range(3):
        x[i] = z[i]
        P[3 + i, 3 + i] = speed_sigma * speed_sigma
        for j in range(3):
            P[i, j] = R[i, j]


@njit(cache=True)
def copy(track: Array, saved: Array) -> None:
    """Copy a track, shape (8, 7)."""
    for i in range(8):
        for j in range(7):
            saved[i, j] = track[i, j]


@njit(cache=True)
def carry(
    tracks: Array, dt: float, settings: Array, motion: Array, covariance: Array, work: Array
) -> float:
    """Carry the first track to another time, without changing it.

    Args:
        tracks: Estimate, another one, and scratch, shape (3, 8, 7).
        dt: Time from the estimate [s].
        settings: Densities of acceleration and drag, largest drag, shape (3,).
        motion: Result: position, velocity, acceleration, shape (3, 3).
        covariance: Result, covariance of position and velocity, shape (6, 6).
        work: Scratch, shape (2, 7, 7).

    Returns:
        The drag coefficient [1/m].
    """
    copy(tracks[0], tracks[2])
    x, P = tracks[2, 0], tracks[2, 1:]
    advance_uncertain(x, P, dt, settings[0], settings[1], work)
    for i in range(3):
        motion[0, i], motion[1, i] = x[i], x[3 + i]
    acceleration(motion[1], x[6], motion[2])
    for i in range(6):
        for j in range(6):
            covariance[i, j] = P[i, j]
    return float(x[6])
