"""Scores of candidates: how they meet balls from all over the box of throws, by geometry alone.

The hand meets a ball as the map's line says (:mod:`mitt.design.interception`). Where learning
weighs the match, b has terms of first order: they add c ds to the joint speeds, s the catch joint's
way to go. c may differ from place to place, but not from ball to ball: q_d depends on the position
alone.

| here   | meaning                                                   | unit  | shape     |
|--------|-----------------------------------------------------------|-------|-----------|
| ``dq`` | joint speeds at the catch, for each ball at one place      | rad/s | (K, B, N) |
| ``ds`` | rate of the catch joint's way to go                        | rad/s | (K, B)    |
| ``v``  | velocity of each ball                                      | m/s   | (K, 3)    |
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mitt.design.balls import Balls
from mitt.design.candidate import within
from mitt.design.contact import Touch
from mitt.design.domain import share_inside
from mitt.design.interception import bounded, line_rates
from mitt.design.poses import Poses, poses_of
from mitt.design.rows import Rows, boxes_of
from mitt.design.sharing import virtual
from mitt.robot.arm import Arm
from mitt.signals import Array
from mitt.trials.learning import FASTEST_SHARE

#: Time for which the joints go on at their speeds after the catch, until the arm has braked [s].
BRAKED = 0.1
#: Largest angle at which a ball may come in off the palm's normal [rad], and speed below which it
#: does not matter [m/s].
STRAIGHT, SOFT = np.deg2rad(45.0), 1.0
#: Places in the box (across, up) and azimuth there [rad], and the balls that come to each: speed
#: and descent from the least (-1) to the most (1).
_PLACES = (
    (0.0, 0.0, 0.0),
    (0.9, 0.5, 0.1),
    (-0.9, -0.5, -0.1),
    (0.5, -0.9, -0.1),
    (-0.5, 0.9, 0.1),
)
_BALLS = ((0.0, 0.0), (1.0, -1.0), (-1.0, 1.0))
#: Share of joint speeds that may be asked, and largest share that a candidate may ask for: its
#: learned map may do better.
_FASTEST, _BEYOND = 0.9, 1.5
#: In m/s of relative speed: what it costs to ask for all of a joint's speed beyond that share, and
#: to use all of a joint's speed.
_TOO_FAST, _EFFORT = 5.0, 0.3
#: The same: for a ball that comes in aslant, for one after which the arm cannot brake, and where
#: all balls are outside the domain early on their way.
_ASLANT, _NO_BRAKE, _OUTSIDE = 1.0, 1.0, 2.0
#: Stands for a speed that is not finite, and the least rate of the catch joint's way [rad/s].
_NEVER, _STILL = 1e6, 0.05


class _Meeting(NamedTuple):
    """How the balls at one place are met."""

    dq: Array  # (K, B, N)
    relative: Array  # (K, B, 3) velocity of the ball relative to the hand [m/s]
    line: Array  # (B,) largest share of a joint's speed that the line alone asks for


def spread(whole: Arm, balls: Balls, rows: Rows, touch: Touch) -> Rows:
    """Score candidates by how they meet balls all over the box.

    Those that cannot, or that touch themselves at the nominal catch, are left out.

    Args:
        whole: The arm with all joints active.
        balls: What is to be caught.
        rows: Candidates; scores are replaced, and rates where learning weighs the match.
        touch: Finds what touches.
    """
    box, rates = boxes_of(whole, balls, rows), np.zeros_like(rows.x)
    good: NDArray[np.bool_] = np.ones(len(rows.q), dtype=bool)
    total = np.zeros(len(rows.q))
    for across, up, azimuth in _PLACES:
        offset = np.array([0.0, across, up]) * box[:, 1]
        q = _moved(whole, rows, balls.velocity(0.0, azimuth), offset)
        poses = poses_of(whole.model, q)
        v = np.array([balls.velocity(x, azimuth, y) for x, y in _BALLS])
        met = _met(whole, rows, poses, v)
        share = np.abs(met.dq / whole.dq_max).max(axis=2)
        good &= within(whole, q, 0.05) & (share.max(axis=0) < _BEYOND) & (met.line < FASTEST_SHARE)
        braked = within(whole, q + BRAKED * met.dq, 0.0)
        cost = _EFFORT * share + _TOO_FAST * np.maximum(share - _FASTEST, 0.0) + _NO_BRAKE * ~braked
        total += np.mean(cost + _hardness(met.relative, poses.palm), axis=0) / len(_PLACES)
        rates += _rates(rows, met.dq.mean(axis=0)) / len(_PLACES)
    x = np.where(rows.weight[:, None] > 0.0, rates, rows.x)
    kept = rows._replace(score=total, x=x).take(good)
    kept = kept.take(touch.clear(kept.q))
    outside = 1.0 - share_inside(whole, balls, kept)
    return kept._replace(score=kept.score + _OUTSIDE * outside)


def _met(whole: Arm, rows: Rows, poses: Poses, v: Array) -> _Meeting:
    """Return how balls are met in some poses."""
    J, w = virtual(poses, rows.A)
    x = np.array([line_rates(J, w, y, rows.kappa, rows.inward) for y in v])
    x = np.where(np.isfinite(x), x, _NEVER)
    dq = np.einsum("bna,kba->kbn", rows.A, x)
    line = np.abs(dq / whole.dq_max).max(axis=(0, 2))
    dq += np.where(rows.weight[:, None] > 0.0, _first_order(whole, poses.J, dq, x[:, :, 2], v), 0.0)
    return _Meeting(dq, v[:, None] - np.einsum("bnc,kbn->kbc", poses.J, dq), line)


def _first_order(whole: Arm, J: Array, dq: Array, ds: Array, v: Array) -> Array:
    """Return c ds, shape (K, B, N): what first-order terms add to joint speeds.

    c is the same for all balls: the sum of their squared relative velocities is least, within the
    joint speeds. Where no c keeps them for all balls, it is the middle of what comes nearest.
    """
    ds = np.where(np.abs(ds) > _STILL, ds, np.copysign(_STILL, ds))
    fastest = np.where(np.any(dq != 0.0, axis=0), _FASTEST * whole.dq_max, 0.0)
    ends = np.sort(np.array([(x - dq) / ds[:, :, None] for x in (-fastest, fastest)]), axis=0)
    low, high = ends[0].max(axis=0), ends[1].min(axis=0)
    middle = 0.5 * (low + high)
    left = v[:, None] - np.einsum("bnc,kbn->kbc", J, dq)
    wanted = np.sum(ds[:, :, None] * left, axis=0) / np.sum(ds**2, axis=0)[:, None]
    c = bounded(J, wanted, np.minimum(low, middle), np.maximum(high, middle))
    return np.asarray(c * ds[:, :, None])


def _hardness(relative: Array, palm: Array) -> Array:
    """Return the relative speed, and more of it where a ball comes in aslant [m/s], (K, B)."""
    s = np.linalg.norm(relative, axis=2)
    cosine = -np.sum(relative * palm, axis=2) / np.maximum(s, 1e-9)
    hardness: Array = s + _ASLANT * ((cosine < np.cos(STRAIGHT)) & (s > SOFT))
    return hardness


def _rates(rows: Rows, dq: Array) -> Array:
    """Return the rates of the coordinates p that turn the free joints at dq [rad/s], (B, 3)."""
    own = np.take_along_axis(rows.A, rows.free[:, :, None], axis=1)
    turned = np.take_along_axis(dq, rows.free, axis=1)
    rates = np.linalg.solve(own, turned[..., None])[..., 0]
    return np.asarray(rates, np.float64)


def _moved(whole: Arm, rows: Rows, v: Array, offset: Array) -> Array:
    """Move the other free joints so that the catch point lies elsewhere, seen along the ball's way.

    Two steps of Newton's method across v.
    """
    n = v / np.linalg.norm(v)
    across = np.array([np.cross(n, [0.0, 0.0, 1.0]), np.zeros(3)])
    across[0] /= np.linalg.norm(across[0])
    across[1] = np.cross(across[0], n)
    q, goal = rows.q.copy(), (rows.tip + offset) @ across.T
    lost = np.zeros(len(q), dtype=bool)
    for _ in range(2):
        poses = poses_of(whole.model, q)
        C = np.swapaxes(virtual(poses, rows.A)[0][:, :2] @ across.T, 1, 2)
        flat = np.abs(np.linalg.det(C)) < 1e-4
        C = np.where(flat[:, None, None], np.eye(2), C)
        step = np.linalg.solve(C, (goal - poses.tip @ across.T)[..., None])[..., 0]
        q += np.einsum("bka,ba->bk", rows.A[:, :, :2], np.clip(step, -0.8, 0.8))
        lost |= flat
    q[lost] = whole.q_max + 1.0  # in no range
    return q
