"""Rigid transforms as calibration moves them: small turns and shifts of a pose."""

import numpy as np
import pinocchio

from mitt.signals import Array


def turned(T: Array, step: Array) -> Array:
    """Return a pose moved by a step: R becomes exp(w) R, t becomes t + v.

    Args:
        T: Pose, shape (4, 4).
        step: w [rad] and v [m], shape (6,).
    """
    out = np.array(T)
    out[:3, :3] = pinocchio.exp3(np.asarray(step[:3])) @ T[:3, :3]
    out[:3, 3] += step[3:]
    return out


def inverse(T: Array) -> Array:
    """Return the inverse of a rigid transform, shape (4, 4)."""
    out = np.eye(4)
    out[:3, :3] = T[:3, :3].T
    out[:3, 3] = -T[:3, :3].T @ T[:3, 3]
    return out


def applied(T: Array, p: Array) -> Array:
    """Return points, shape (n, 3), moved by a pose."""
    return np.asarray(p @ T[:3, :3].T + T[:3, 3])


def by_pose(p_turned: Array) -> Array:
    """Return the derivative of R p + t with respect to a step of ``turned``, shape (n, 3, 6).

    Args:
        p_turned: R p [m], shape (n, 3).
    """
    out = np.empty((len(p_turned), 3, 6))
    out[:, :, :3] = np.cross(np.eye(3), p_turned[:, None]).swapaxes(1, 2)
    out[:, :, 3:] = np.eye(3)
    return out


def laid(a: Array, b: Array, weights: Array) -> Array:
    """Return the pose that lays points ``a`` on points ``b`` with the least weighted squares.

    W. Kabsch, A solution for the best rotation to relate two sets of vectors, Acta
    Crystallographica A 32 (1976) 922-923.

    Args:
        a: Points [m], shape (n, 3), n >= 3 and not on one line.
        b: The same points elsewhere [m], shape (n, 3).
        weights: Weight of each, shape (n,).
    """
    w = weights / weights.sum()
    mean_a, mean_b = w @ a, w @ b
    U, _, Vt = np.linalg.svd((a - mean_a).T @ ((b - mean_b) * w[:, None]))
    flip = np.diag((1.0, 1.0, np.linalg.det(U @ Vt)))
    T = np.eye(4)
    T[:3, :3] = (U @ flip @ Vt).T
    T[:3, 3] = mean_b - T[:3, :3] @ mean_a
    return T
