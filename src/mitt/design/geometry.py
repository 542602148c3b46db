"""Candidates by geometry alone, by the hundred thousand.

Poses are drawn over all joints, the first turned so that the palm looks towards the thrower. For
each, some choices of three joints meet a typical ball (:mod:`mitt.design.interception`). All are
scored by balls from the corners of the box of throws (:mod:`mitt.design.corners`).
"""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from mitt.design.balls import Balls
from mitt.design.candidate import within
from mitt.design.contact import Touch
from mitt.design.corners import BRAKED, SOFT, STRAIGHT, spread
from mitt.design.interception import MOST, Interception, least_relative_velocity
from mitt.design.placing import clear, facing, led, off_line
from mitt.design.poses import Poses, poses_of
from mitt.design.rows import Rows, drawn_weights, joined
from mitt.design.sharing import alone, shared, slope_of, sloped, virtual
from mitt.design.whole import movable
from mitt.robot.arm import Arm
from mitt.signals import Array

#: Joint range left free at the catch [rad], and share of joint speeds that is drawn for a typical
#: ball: balls elsewhere ask for more of the same map.
_MARGIN, _SHARES = 0.12, (0.3, 0.9)
#: How often each joint is changed.
_OFTEN = 0.6
#: Choices of three joints that move alone, and of those that all others follow, of each pose; how
#: often a further joint is held nevertheless.
_ALONE, _SHARED, _HELD = 24, 8, 0.25
#: How often the catch angle goes with the other joints, and standard deviation of its slope.
_SLOPED, _SLOPE = 0.6, 1.0
#: Least cosine of the palm's normal and the direction from which the ball comes.
_FACING = 0.1
#: Tilt of the relative velocity off the palm's normal that is tried [rad].
_TILT = np.deg2rad(35.0)


def triples_of(whole: Arm, joints: Sequence[str] | None) -> NDArray[np.int64]:
    """Return the choices of three joints, the catch joint last, shape (T, 3)."""
    names = list(whole.names) if not joints else [x for x in whole.names if x in joints]
    index = [whole.names.index(x) for x in names]
    chosen = [
        [*(k for k in three if k != i), i]
        for three in combinations(index, 3)
        for i in three
        if whole.chain.prismatic[i] == 0.0
    ]
    return np.array(chosen, dtype=np.int64).reshape(len(chosen), 3)


def drawn(
    whole: Arm,
    balls: Balls,
    triples: NDArray[np.int64],
    rng: np.random.Generator,
    *,
    count: int,
    touch: Touch,
) -> Rows:
    """Draw poses and choices of joints, and return those that meet the typical ball.

    Args:
        whole: The arm with all joints active.
        balls: What is to be caught.
        triples: Choices of three joints, the catch joint last, shape (T, 3).
        rng: Source of randomness.
        count: Poses drawn.
        touch: Finds what touches.
    """
    q = facing(whole, rng.uniform(whole.q_min, whole.q_max, (count, whole.n)), rng)
    q, poses, _ = _able(whole, balls, q, touch)
    parts = [_of_three(whole, balls, (q, poses), triples, rng)]
    if len(np.unique(triples)) > 3:
        parts.append(_of_all(whole, balls, (q, poses), triples, rng))
    return joined(parts)


def _of_three(
    whole: Arm, balls: Balls, of: tuple[Array, Poses], triples: NDArray[np.int64],
    rng: np.random.Generator,
) -> Rows:  # fmt: skip
    """Return poses in which three joints meet the typical ball, the others held."""
    chosen, row = _choices(len(of[0]), triples, _ALONE, rng)
    slope = _slopes(len(row), rng)
    A = sloped(np.broadcast_to(np.eye(3), (len(row), 3, 3)), slope)
    J, w = of[1].J[row[:, None], chosen], of[1].W[row, chosen[:, 2]]
    J[:, :2] += slope[:, :, None] * J[:, 2:]
    d, v = _into(of[1].palm[row], J[:, 2], w, rng), balls.velocity()
    share = rng.uniform(*_SHARES, (len(row), 1))
    found = least_relative_velocity(J, w, v, d, share * whole.dq_max[chosen], A)
    good = np.flatnonzero(found.sound & (found.s < balls.speed))
    moving = chosen[good], sloped(alone(chosen[good], whole.n), slope[good])
    return _rows(whole, of, moving, row[good], d[good], found.take(good), rng)


def _of_all(
    whole: Arm, balls: Balls, of: tuple[Array, Poses], triples: NDArray[np.int64],
    rng: np.random.Generator,
) -> Rows:  # fmt: skip
    """Return poses in which further joints follow the three."""
    chosen, row = _choices(len(of[0]), triples, _SHARED, rng)
    weights = np.where(rng.random((len(row), whole.n)) < _HELD, 0.0, whole.dq_max**2)
    named = np.isin(np.arange(whole.n), triples)
    weights[:, ~(named & movable(whole))] = 0.0
    weights[np.arange(len(row))[:, None], chosen] = whole.dq_max[chosen] ** 2
    good, A = shared(of[1].J[row], chosen, weights)
    A = sloped(A, _slopes(len(row), rng))
    return _met(whole, balls.velocity(), of, (chosen[good], A[good]), row[good], rng)


def _slopes(count: int, rng: np.random.Generator) -> Array:
    """Draw how catch angles go with the two other joints, shape (count, 2)."""
    slope: Array = _SLOPE * rng.standard_normal((count, 2)) * (rng.random((count, 1)) < _SLOPED)
    return slope


def _choices(
    count: int, triples: NDArray[np.int64], each: int, rng: np.random.Generator
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return choices of three joints for each of so many poses, and the pose of each."""
    each = min(len(triples), each)
    chosen = triples[rng.integers(len(triples), size=(count, each))].reshape(-1, 3)
    return chosen, np.repeat(np.arange(count), each)


def improved(
    whole: Arm, balls: Balls, rows: Rows, rng: np.random.Generator, *, size: float, touch: Touch
) -> Rows:
    """Return candidates and small changes of them, scored by :func:`spread`.

    Args:
        whole: The arm with all joints active.
        balls: What is to be caught.
        rows: Candidates with their scores.
        rng: Source of randomness.
        size: Standard deviation of the changes [rad].
        touch: Finds what touches.
    """
    change = size * rng.standard_normal((len(rows.q), whole.n))
    change *= (rng.random(change.shape) < _OFTEN) & movable(whole)
    q, poses, kept = _able(whole, balls, rows.q + change, touch)
    chosen, A = rows.free[kept], rows.A[kept]
    takes_part, slope = np.any(A != 0.0, axis=2), slope_of(A, chosen)
    good, again = shared(poses.J, chosen, np.where(takes_part, whole.dq_max**2, 0.0))
    further = takes_part.sum(axis=1) > 3
    A = np.where((further & good)[:, None, None], again, sloped(A, -slope))
    slope = slope + size * _slopes(len(A), rng)
    A = sloped(A, slope)
    found = _met(whole, balls.velocity(), (q, poses), (chosen, A), np.arange(len(q)), rng)
    same = rows.take(kept)._replace(q=q, A=A, tip=poses.tip)
    near = _same_line(same.take(same.weight > 0.0), rng, size=size)
    return joined([rows, spread(whole, balls, joined([found, near]), touch)])


def _same_line(rows: Rows, rng: np.random.Generator, *, size: float) -> Rows:
    """Return candidates with kappa and inward a little different.

    Their line need not match the ball's velocity: terms of first order in b do, as far as joint
    speeds allow (:mod:`mitt.design.corners`).
    """
    count, kappa, inward = len(rows.q), rows.kappa, rows.inward
    harder = (kappa - 1.0 + 0.02) * np.exp(2.0 * size * rng.standard_normal(count))
    aside = size * (kappa - 1.0 + np.abs(inward) + 0.1) * rng.standard_normal(count)
    return rows._replace(
        kappa=np.minimum(1.0 + harder, MOST), inward=np.clip(inward + aside, -MOST, MOST)
    )


def _able(whole: Arm, balls: Balls, q: Array, touch: Touch) -> (
    tuple[Array, Poses, NDArray[np.int64]]
):  # fmt: skip
    """Return the poses clear of floor and arm with the palm towards the ball, and their indices."""
    if balls.aim is not None:
        q = led(whole, q, balls)
    poses, v = poses_of(whole.model, q), balls.velocity()
    good = clear(poses, touch.floor) & within(whole, q, _MARGIN)
    good &= -(poses.palm @ v) > _FACING * np.linalg.norm(v)
    if balls.aim is not None:
        good &= off_line(poses.tip, balls) < 0.05
    return q[good], poses.take(good), np.flatnonzero(good)


def _met(
    whole: Arm, v: Array, of: tuple[Array, Poses], moving: tuple[NDArray[np.int64], Array],
    row: NDArray[np.int64], rng: np.random.Generator,
) -> Rows:  # fmt: skip
    """Return the rows whose joints meet a ball of velocity v within their speeds.

    Args:
        whole: The arm with all joints active.
        v: Velocity of the ball [m/s], shape (3,).
        of: Poses.
        moving: The free joints, and how all share the motion, a row each.
        row: Which pose each row has.
        rng: Source of randomness.
    """
    poses, A = of[1].take(row), moving[1]
    J, w = virtual(poses, A)
    d = _into(poses.palm, J[:, 2], w, rng)
    share = rng.uniform(*_SHARES, (len(row), 1))
    found = least_relative_velocity(J, w, v, d, share * whole.dq_max, A)
    good = np.flatnonzero(found.sound & (found.s < np.linalg.norm(v)))
    moving = moving[0][good], A[good]
    return _rows(whole, of, moving, row[good], d[good], found.take(good), rng)


def _rows(
    whole: Arm, of: tuple[Array, Poses], moving: tuple[NDArray[np.int64], Array],
    row: NDArray[np.int64], d: Array, found: Interception, rng: np.random.Generator,
) -> Rows:  # fmt: skip
    """Return what meets the ball so that it comes into the palm and the joints can brake after."""
    (q, poses), (chosen, A) = of, moving
    speeds = np.einsum("bka,ba->bk", A, found.x)
    straight: NDArray[np.bool_] = -np.sum(d * poses.palm[row], axis=1) > np.cos(STRAIGHT)
    good = within(whole, q[row] + BRAKED * speeds, 0.0) & (straight | (found.s < SOFT))
    effort = np.abs(speeds / whole.dq_max).max(axis=1)
    return Rows(
        q=q[row], free=chosen, kappa=found.kappa, inward=found.inward, A=A, x=found.x,
        tip=poses.tip[row], score=found.s + 0.3 * effort, weight=drawn_weights(len(chosen), rng),
    ).take(good)  # fmt: skip


def _into(palm: Array, J: Array, w: Array, rng: np.random.Generator) -> Array:
    """Return unit vectors in the plane of J and w x J, about into the palm, shape (B, 3)."""
    across = np.cross(J, np.cross(w, J))
    across /= np.maximum(np.linalg.norm(across, axis=1), 1e-12)[:, None]
    flat = -palm + np.sum(palm * across, axis=1)[:, None] * across
    flat /= np.maximum(np.linalg.norm(flat, axis=1), 1e-9)[:, None]
    tilt = rng.uniform(-_TILT, _TILT, len(palm))[:, None]
    d: Array = np.cos(tilt) * flat + np.sin(tilt) * np.cross(across, flat)
    return d
