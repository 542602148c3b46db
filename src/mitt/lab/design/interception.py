"""How hand and ball meet, in closed form: least relative velocity that the joint speeds allow.

A pose moves by dq = A dp, p the angles of three free joints of the arm, whose rows of A are those
of the identity. Where all other rows are zero, three joints move and the rest is held. Or all
take part, each in proportion to the square of its speed limit: dq = W J' (J W J')^-1 v moves the
hand at v with the least sum of squared shares of the limits, so A spans W J' of the nominal catch.
The catch joint may stand otherwise where balls pass elsewhere: q_alpha goes with the two other free
joints, and the catch joint's row of A holds that slope (:mod:`mitt.core.map.tangent`).

So three virtual joints j, k and the catch joint i carry the hand at J x, x their speeds. The map's
line is T = kappa J_i + inward (w_i x J_i), and v = x_j J_j + x_k J_k + x_i T. The ball comes to the
hand with v - J x = (T - J_i) x_i, in the plane of J_i and w_i x J_i; any direction d of that plane
will do, and its size s is as small as the joint speeds allow:

    x = J^-1 (v - s d) = x_0 - s J^-1 d,   |A x| <= fastest.

| here        | meaning                                              | unit  | shape     |
|-------------|------------------------------------------------------|-------|-----------|
| ``A``       | dq of all joints over the three, the catch joint last | 1    | (B, N, 3) |
| ``J``       | columns dl/dp of the three, the catch joint last     | m/rad | (B, 3, 3) |
| ``w``       | turning rate of the hand per rate of the catch joint | 1     | (B, 3)    |
| ``d``       | direction of the relative velocity                   | 1     | (B, 3)    |
| ``s``       | its size                                             | m/s   | (B,)      |
| ``x``       | joint speeds, the catch joint last                   | rad/s | (B, 3)    |
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mitt.core.arm.arm import Arm
from mitt.core.signals import Array
from mitt.lab.design.candidate import Candidate
from mitt.lab.design.poses import Poses, poses_of
from mitt.lab.design.task import Balls

#: Least determinant of the free joints' part, as a share of the product of its rows' lengths, and
#: largest share of a further joint per free one, for which joints share the motion.
_SHARED_SINGULAR = 0.05
_LARGEST_SHARE = 3.0
#: Largest share of a joint that counts as still.
_STILL_SHARE = 0.02


def alone(free: NDArray[np.int64], n: int) -> Array:
    """Return A where three of n joints move alone, shape (B, n, 3).

    ``free`` are the three joints of each row, shape (B, 3).
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
    good = np.abs(np.linalg.det(own)) > _SHARED_SINGULAR * size + 1e-12
    A = spanned @ np.linalg.inv(np.where(good[:, None, None], own, np.eye(3)))
    A[np.abs(A).max(axis=2) < _STILL_SHARE] = 0.0
    A[rows, free] = np.eye(3)
    sound: NDArray[np.bool_] = good & (np.abs(A).max(axis=(1, 2)) <= _LARGEST_SHARE)
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


def virtual_jacobian(poses: Poses, A: Array) -> tuple[Array, Array]:
    """Return J and w of the virtual joints; see the module's table."""
    J = np.einsum("bka,bkc->bac", A, poses.J)
    w = np.einsum("bk,bkc->bc", A[:, :, 2], poses.W)
    return J, w


#: |det J| below this share of the product of its columns' lengths counts as singular.
_SINGULAR = 0.05
#: Least speed of the catch joint [rad/s]: a slower one makes no way along the ball's line.
_SLOWEST = 0.3
#: Largest kappa and inward that are looked at.
MOST_OFF_LINE = 12.0
#: Share of joint speeds that may be asked.
ASKED_SHARE = 0.9


class Interception(NamedTuple):
    """How they meet; ``sound`` where they can, all else means nothing where they cannot."""

    sound: NDArray[np.bool_]  # (B,)
    s: Array
    x: Array
    kappa: Array  # (B,)
    inward: Array  # (B,)

    def take(self, rows: NDArray[np.int64]) -> "Interception":
        """Return some of them, by index."""
        return Interception._make(x[rows] for x in self)


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
    sound &= (kappa > 1.0 - 1e-9) & (kappa < MOST_OFF_LINE) & (np.abs(inward) < MOST_OFF_LINE)
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
    J, w and v are as in :func:`least_relative_velocity`; kappa and inward have shape (B,).
    """
    J_i = J[:, 2]
    T = kappa[:, None] * J_i + inward[:, None] * np.cross(w, J_i)
    A = np.stack([J[:, 0], J[:, 1], T], axis=2)
    flat = np.abs(np.linalg.det(A)) < 1e-9
    A = np.where(flat[:, None, None], np.eye(3), A)
    solved = np.linalg.solve(A, np.broadcast_to(v, T.shape)[..., None])[..., 0]
    x: Array = np.where(flat[:, None], np.inf, solved)
    return x


def bounded_speeds(J: Array, v: Array, low: Array, high: Array) -> Array:
    """Return joint speeds within bounds that move the hand as nearly as possible at a velocity.

    |v - J dq| is least for low <= dq <= high: by 60 sweeps of coordinate descent, which comes to
    the minimum of a convex quadratic in a box.

    Args:
        J: dl/dq of all joints, shape (B, N, 3).
        v: Velocity that is wanted [m/s], shape (B, 3).
        low: Least speeds [rad/s], shape (B, N).
        high: Largest speeds [rad/s], shape (B, N).
    """
    dq: Array = np.clip(np.zeros_like(low), low, high)
    rest = v - np.einsum("bkc,bk->bc", J, dq)
    size = np.maximum(np.sum(J**2, axis=2), 1e-9)
    for _ in range(60):
        for k in range(J.shape[1]):
            better = dq[:, k] + np.sum(J[:, k] * rest, axis=1) / size[:, k]
            better = np.clip(better, low[:, k], high[:, k])
            rest -= (better - dq[:, k])[:, None] * J[:, k]
            dq[:, k] = better
    return dq


#: By what a joint is made quicker, and all links longer.
QUICKER = 1.5
LONGER = 1.2


@dataclass(frozen=True, slots=True, kw_only=True)
class FasterJoint:
    """What one joint's speed is worth.

    Attributes:
        joint: Its name.
        share: Share of its speed limit that this takes.
        relative_m_s: Least relative speed there, by joint speeds alone.
        quicker_m_s: The same, were the joint 50 % faster.
    """

    joint: str
    share: float
    relative_m_s: float
    quicker_m_s: float


@dataclass(frozen=True, slots=True, eq=False)
class _Catch:
    """The nominal catch of a candidate: what its joint speeds allow there."""

    J: Array  # (1, N, 3)
    v: Array  # (1, 3)
    allowed: Array  # (N,) speeds that may be asked, 0 of held joints [rad/s]

    def speeds(self, allowed: Array, *, longer: float = 1.0) -> Array:
        """Return the joint speeds that leave the least relative velocity [rad/s], shape (N,).

        Those that may be asked are ``allowed``, shape (N,); the arm is ``longer`` by a factor, its
        pose the same.
        """
        return np.array(bounded_speeds(longer * self.J, self.v, -allowed[None], allowed[None])[0])

    def least(self, allowed: Array, *, longer: float = 1.0) -> float:
        """Return that least relative speed [m/s]; arguments as of :meth:`speeds`."""
        dq = self.speeds(allowed, longer=longer)
        return float(np.linalg.norm(self.v[0] - longer * dq @ self.J[0]))


def _catch_of(whole: Arm, c: Candidate, balls: Balls) -> _Catch:
    """Return the nominal catch of a candidate."""
    allowed = np.zeros(whole.n)
    allowed[list(c.active)] = ASKED_SHARE * whole.dq_max[list(c.active)]
    return _Catch(J=poses_of(whole.model, c.q[None]).J, v=balls.velocity()[None], allowed=allowed)


def faster_joints(whole: Arm, c: Candidate, balls: Balls) -> list[FasterJoint]:
    """Return what each active joint's speed is worth at a candidate's nominal catch.

    In that pose and for a ball in the middle of those thrown. A map may use less of the joints than
    they allow.
    """
    catch, out = _catch_of(whole, c, balls), []
    share, now = np.abs(catch.speeds(catch.allowed)) / whole.dq_max, catch.least(catch.allowed)
    for k in c.active:
        quicker = catch.allowed.copy()
        quicker[k] *= QUICKER
        out.append(
            FasterJoint(
                joint=whole.names[k],
                share=float(share[k]),
                relative_m_s=now,
                quicker_m_s=min(catch.least(quicker), now),
            )
        )
    return out


def longer_arm(whole: Arm, c: Candidate, balls: Balls) -> float:
    """Return the least relative speed there, were all links longer by :data:`LONGER` [m/s].

    The pose stays, and the hand is faster by as much; by joint speeds alone, as above.
    """
    catch = _catch_of(whole, c, balls)
    return min(catch.least(catch.allowed, longer=LONGER), catch.least(catch.allowed))
