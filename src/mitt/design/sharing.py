"""How joints share the motion: three virtual joints, each of which turns one or several.

A pose moves by dq = A dp, p the angles of three free joints of the arm, whose rows of A are those
of the identity. Where all other rows are zero, three joints move and the rest is held. Or all
take part, each in proportion to the square of its speed limit: dq = W J' (J W J')^-1 v moves the
hand at v with the least sum of squared shares of the limits, so A spans W J' of the nominal catch.

The catch joint may stand otherwise where balls pass elsewhere: q_alpha goes with the two other free
joints, and the catch joint's row of A holds that slope (:mod:`mitt.generator.tangent`).

| here     | meaning                                                 | unit  | shape     |
|----------|---------------------------------------------------------|-------|-----------|
| ``A``    | dq over the virtual joints, the catch joint last        | 1     | (B, N, 3) |
| ``J``    | dl/dp of the virtual joints, rows as in ``Poses.J``     | m/rad | (B, 3, 3) |
| ``w``    | turning rate of the hand per rate of the catch joint    | 1     | (B, 3)    |
"""

import numpy as np
from numpy.typing import NDArray

from mitt.design.poses import Poses
from mitt.signals import Array

#: Least determinant of the free joints' part, as a share of the product of its rows' lengths, and
#: largest share of a further joint per free one, for which joints share the motion.
_SINGULAR, _MOST = 0.05, 3.0
#: Largest share of a joint that counts as still.
_STILL = 0.02


def alone(free: NDArray[np.int64], n: int) -> Array:
    """Return A where three of n joints move alone, shape (B, n, 3).

    Args:
        free: The three joints of each row, shape (B, 3).
        n: Number of joints.
    """
    A = np.zeros((len(free), n, 3))
    A[np.arange(len(free))[:, None], free, np.arange(3)] = 1.0
    return A


def shared(J: Array, free: NDArray[np.int64], weights: Array) -> tuple[NDArray[np.bool_], Array]:
    """Return where joints can share the motion, shape (B,), and A there, shape (B, N, 3).

    Args:
        J: dl/dq of all joints, shape (B, N, 3).
        free: The three free joints, the catch joint last, shape (B, 3).
        weights: What each joint is to do, 0 for one that is held, shape (B, N).
    """
    rows = np.arange(len(free))[:, None]
    spanned = weights[:, :, None] * J
    own = spanned[rows, free]
    size = np.prod(np.linalg.norm(own, axis=2), axis=1)
    good = np.abs(np.linalg.det(own)) > _SINGULAR * size + 1e-12
    A = spanned @ np.linalg.inv(np.where(good[:, None, None], own, np.eye(3)))
    A[np.abs(A).max(axis=2) < _STILL] = 0.0
    A[rows, free] = np.eye(3)
    sound: NDArray[np.bool_] = good & (np.abs(A).max(axis=(1, 2)) <= _MOST)
    return sound, A


def slope_of(A: Array, free: NDArray[np.int64]) -> Array:
    """Return how the catch angle goes with the two other free joints, shape (B, 2)."""
    slope: Array = A[np.arange(len(A)), free[:, 2], :2]
    return slope


def sloped(A: Array, slope: Array) -> Array:
    """Return A with more slope, shape (B, 2): the same motions by other virtual joints."""
    out = A.copy()
    out[:, :, :2] += A[:, :, 2:] * slope[:, None, :]
    return out


def virtual(poses: Poses, A: Array) -> tuple[Array, Array]:
    """Return J and w of the virtual joints; see the module's table."""
    J = np.einsum("bka,bkc->bac", A, poses.J)
    w = np.einsum("bk,bkc->bc", A[:, :, 2], poses.W)
    return J, w
