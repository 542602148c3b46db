"""How hand and ball meet, in closed form: least relative velocity that the joint speeds allow.

Three joints j, k and the catch joint i carry the hand at J x, x their speeds. The map's line is
T = kappa J_i + inward (w_i x J_i) (:mod:`mitt.generator.tangent`), and v = x_j J_j + x_k J_k +
x_i T. So the ball comes to the hand with v - J x = (T - J_i) x_i, in the plane of J_i and
w_i x J_i; any direction d of that plane will do, and its size s is as small as the joint speeds
allow:

    x = J^-1 (v - s d) = x_0 - s J^-1 d,   |A x| <= fastest.

The three may be virtual joints, each of which turns several (:mod:`mitt.design.sharing`).

| here        | meaning                                              | unit  | shape     |
|-------------|------------------------------------------------------|-------|-----------|
| ``J``       | columns dl/dq of the three joints, the catch joint last | m/rad | (B, 3, 3) |
| ``w``       | axis of the catch joint                              | 1     | (B, 3)    |
| ``A``       | dq of all joints over the three                      | 1     | (B, N, 3) |
| ``d``       | direction of the relative velocity                   | 1     | (B, 3)    |
| ``s``       | its size                                             | m/s   | (B,)      |
| ``x``       | joint speeds, the catch joint last                   | rad/s | (B, 3)    |
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mitt.signals import Array

#: |det J| below this share of the product of its columns' lengths counts as singular.
_SINGULAR = 0.05
#: Least speed of the catch joint [rad/s]: a slower one makes no way along the ball's line.
_SLOWEST = 0.3
#: Largest kappa and inward that are looked at.
MOST = 12.0
#: Sweeps of coordinate descent over all joints.
_SWEEPS = 60


class Interception(NamedTuple):
    """How they meet; ``sound`` where they can, all else means nothing where they cannot."""

    sound: NDArray[np.bool_]  # (B,)
    s: Array
    x: Array
    kappa: Array  # (B,)
    inward: Array  # (B,)

    def take(self, rows: NDArray[np.int64]) -> "Interception":
        """Return some of them, by index."""
        return Interception(
            self.sound[rows], self.s[rows], self.x[rows], self.kappa[rows], self.inward[rows]
        )


def least_relative_velocity(
    J: Array, w: Array, v: Array, d: Array, fastest: Array, A: Array
) -> Interception:
    """Return the least relative velocity along d; see the module's table.

    Args:
        J: Columns as J[:, c], joint c's dl/dq, the catch joint last, shape (B, 3, 3).
        w: Axis of the catch joint, shape (B, 3).
        v: Velocity of the ball [m/s], shape (3,) or (B, 3).
        d: Direction in the plane of J_i and w x J_i, shape (B, 3).
        fastest: Speeds that may be asked of all joints [rad/s], shape (B, N).
        A: dq of all joints over the three, shape (B, N, 3).
    """
    size = np.linalg.norm(J, axis=2)
    det = np.linalg.det(J)
    sound = np.abs(det) > _SINGULAR * np.prod(size, axis=1) + 1e-12
    columns = np.where(sound[:, None, None], np.swapaxes(J, 1, 2), np.eye(3))
    both = np.stack([np.broadcast_to(v, d.shape), d], axis=2)
    x_0, slope = np.moveaxis(np.asarray(np.linalg.solve(columns, both), np.float64), 2, 0)
    least, most = _interval(_all(A, x_0), _all(A, slope), fastest)
    s = np.maximum(least, 0.0)
    x = x_0 - s[:, None] * slope
    J_i, lever = J[:, 2], np.cross(w, J[:, 2])
    sound &= (s <= most) & (np.abs(x[:, 2]) > _SLOWEST)
    scale = np.where(sound, s, 0.0) / np.where(sound, x[:, 2], 1.0)
    kappa = 1.0 + scale * np.sum(d * J_i, axis=1) / np.maximum(size[:, 2] ** 2, 1e-12)
    inward = scale * np.sum(d * lever, axis=1) / np.maximum(np.sum(lever**2, axis=1), 1e-12)
    sound &= (kappa > 1.0 - 1e-9) & (kappa < MOST) & (np.abs(inward) < MOST)
    return Interception(sound=sound, s=s, x=x, kappa=np.maximum(kappa, 1.0), inward=inward)


def _all(A: Array, x: Array) -> Array:
    """Return the speeds of all joints from those of the three, shape (B, N)."""
    return np.asarray(np.einsum("bka,ba->bk", A, x))


def _interval(x_0: Array, slope: Array, fastest: Array) -> tuple[Array, Array]:
    """Return the range of s in which |x_0 - s slope| <= fastest in all joints, (B,) each."""
    steep = np.where(np.abs(slope) > 1e-12, slope, np.copysign(1e-12, slope))
    ends = np.sort(np.array([(x_0 - fastest) / steep, (x_0 + fastest) / steep]), axis=0)
    return ends[0].max(axis=1), ends[1].min(axis=1)


def line_rates(J: Array, w: Array, v: Array, kappa: Array, inward: Array) -> Array:
    """Return the rates of the three joints when a ball moves along given lines, shape (B, 3).

    Infinite where a line gives none.

    Args:
        J: As in :func:`least_relative_velocity`.
        w: As in :func:`least_relative_velocity`.
        v: As in :func:`least_relative_velocity`.
        kappa: Velocity-match ratios, shape (B,).
        inward: Shares of the line towards the axis, shape (B,).
    """
    J_i = J[:, 2]
    T = kappa[:, None] * J_i + inward[:, None] * np.cross(w, J_i)
    A = np.stack([J[:, 0], J[:, 1], T], axis=2)
    flat = np.abs(np.linalg.det(A)) < 1e-9
    A = np.where(flat[:, None, None], np.eye(3), A)
    solved = np.linalg.solve(A, np.broadcast_to(v, T.shape)[..., None])[..., 0]
    x: Array = np.where(flat[:, None], np.inf, solved)
    return x


def bounded(J: Array, v: Array, low: Array, high: Array) -> Array:
    """Return joint speeds within bounds that move the hand as nearly as possible at a velocity.

    |v - J dq| is least for low <= dq <= high: by coordinate descent, which comes to the minimum of
    a convex quadratic in a box.

    Args:
        J: dl/dq of all joints, shape (B, N, 3).
        v: Velocity that is wanted [m/s], shape (B, 3).
        low: Least speeds [rad/s], shape (B, N).
        high: Largest speeds [rad/s], shape (B, N).
    """
    dq: Array = np.clip(np.zeros_like(low), low, high)
    rest = v - np.einsum("bkc,bk->bc", J, dq)
    size = np.maximum(np.sum(J**2, axis=2), 1e-9)
    for _ in range(_SWEEPS):
        for k in range(J.shape[1]):
            better = dq[:, k] + np.sum(J[:, k] * rest, axis=1) / size[:, k]
            better = np.clip(better, low[:, k], high[:, k])
            rest -= (better - dq[:, k])[:, None] * J[:, k]
            dq[:, k] = better
    return dq
