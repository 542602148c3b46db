"""Candidates of the geometry as rows of arrays: the best of them, and what each is in full."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mitt.design.balls import BOX, FAR, Balls
from mitt.design.candidate import Candidate
from mitt.design.poses import Which, poses_of
from mitt.robot.arm import Arm
from mitt.signals import Array

#: What each further candidate of the same choice of joints costs, in m/s of relative speed.
_REPEATED = 0.08
#: The ready pose is the pose at the catch less this time [s] times the joint speeds there: 0.13 to
#: 0.2 in the softest motions of the WAM (``benchmarks/softest.py``). Range of a factor on it, drawn
#: for each joint.
_SWING, _EACH = (0.04, 0.22), (0.7, 1.3)
#: Farthest that the two other joints stand off their angles at the catch [rad]. From farther away
#: l_c^-1 may find another branch; what does so is left out on paper.
_ASIDE = 1.0
#: Room that the ready pose keeps to the ends of the ranges [rad].
_ROOM = 0.05
#: How often a relative velocity at the catch costs something in learning, and how much [(m/s)^-2].
_WEIGHED, _WEIGHTS = 0.7, (0.3, 100.0)


class Rows(NamedTuple):
    """Candidates as arrays, one a row."""

    q: Array  # (B, N)
    free: NDArray[np.int64]  # (B, 3) catch joint last
    kappa: Array  # (B,)
    inward: Array  # (B,)
    A: Array  # (B, N, 3) how joints share the motion, catch joint last (mitt.design.sharing)
    x: Array  # (B, 3) rates of p at the nominal catch, catch joint last; of weighed matches, means
    tip: Array  # (B, 3)
    score: Array  # (B,) relative speed [m/s] and what else is bad; smaller is better
    weight: Array  # (B,) match weight, 0 where the map matches by its line alone [(m/s)^-2]

    @property
    def moving(self) -> NDArray[np.int64]:
        """How many joints move, shape (B,)."""
        return np.asarray(np.any(self.A != 0.0, axis=2).sum(axis=1), dtype=np.int64)

    def take(self, rows: Which) -> "Rows":
        """Return some of them, by index or by mask."""
        return Rows(
            self.q[rows], self.free[rows], self.kappa[rows], self.inward[rows], self.A[rows],
            self.x[rows], self.tip[rows], self.score[rows], self.weight[rows],
        )  # fmt: skip


def joined(parts: Sequence[Rows]) -> Rows:
    """Return candidates of several parts as one."""
    return Rows(*(np.concatenate(x) for x in zip(*parts, strict=True)))


def boxes_of(whole: Arm, balls: Balls, rows: Rows) -> Array:
    """Return centre and half-widths of the box of each candidate [m], shape (B, 2, 3)."""
    if balls.aim is not None:
        return np.broadcast_to(balls.aim, (len(rows.q), 2, 3))
    if balls.around is not None:
        return np.stack([rows.tip, np.broadcast_to(balls.around, rows.tip.shape)], axis=1)
    at = poses_of(whole.model, rows.q).at[:, 1]
    reach = np.minimum(np.linalg.norm(rows.tip - at, axis=1), FAR)
    return np.stack([rows.tip, reach[:, None] * np.array(BOX)], axis=1)


def best_of(rows: Rows, *, count: int, each: int) -> Rows:
    """Return the best, at most so many of each choice of joints, and of places much alike.

    The more of a choice are taken already, the better its next one has to be: what looks best by
    geometry need not have a domain, or the torque.
    """
    order, moving = np.argsort(rows.score, kind="stable"), rows.moving
    taken, cost = list[int](), list[float]()
    seen, near = dict[tuple[int, ...], int](), dict[tuple[int, ...], int]()
    for k in order.tolist():
        key = (*rows.free[k].tolist(), int(moving[k]), int(rows.weight[k] > 0.0))
        place = (*key, *np.round(rows.tip[k] / 0.15).astype(int).tolist())
        if seen.get(key, 0) >= each or near.get(place, 0) >= max(1, each // 8):
            continue
        cost.append(float(rows.score[k]) + _REPEATED * seen.get(key, 0))
        seen[key], near[place] = seen.get(key, 0) + 1, near.get(place, 0) + 1
        taken.append(k)
    ranked = np.argsort(cost, kind="stable")[:count]
    return rows.take(np.array(taken, dtype=np.int64)[ranked])


def drawn_weights(count: int, rng: np.random.Generator) -> Array:
    """Draw match weights: 0, or one of any size [(m/s)^-2], shape (count,)."""
    low, high = np.log(_WEIGHTS).tolist()
    size = np.exp(rng.uniform(low, high, count))
    out: Array = np.where(rng.random(count) < _WEIGHED, size, 0.0)
    return out


def candidates_of(
    whole: Arm, balls: Balls, rows: Rows, rng: np.random.Generator
) -> list[Candidate]:
    """Return rows as candidates, each with a ready pose on the far side of its swing."""
    boxes, out = boxes_of(whole, balls, rows), []
    for k in range(len(rows.q)):
        order = np.argsort(rows.free[k])
        free = rows.free[k][order]
        swing = rng.uniform(*_SWING) * rng.uniform(*_EACH, 3) * rows.x[k]
        swing[:2] = np.clip(swing[:2], -_ASIDE, _ASIDE)
        A = rows.A[k][:, order]
        low, high = whole.q_min + _ROOM, whole.q_max - _ROOM
        ready = np.clip(rows.q[k, free] - A[free] @ swing[order], low[free], high[free])
        swing = A @ np.linalg.solve(A[free], ready - rows.q[k, free])
        room = np.where(swing > 0.0, high - rows.q[k], rows.q[k] - low) / np.maximum(
            np.abs(swing), 1e-9
        )
        ready = rows.q[k, free] + np.clip(room.min(), 0.0, 1.0) * (ready - rows.q[k, free])
        out.append(Candidate(
            q=rows.q[k].copy(),
            free=(int(free[0]), int(free[1]), int(free[2])),
            catch=int(np.argmax(order == 2)),
            kappa=float(rows.kappa[k]),
            inward=float(rows.inward[k]),
            A=A,
            ready=ready,
            aim=boxes[k].copy(),
            match_weight=float(rows.weight[k]),
        ))  # fmt: skip
    return out
