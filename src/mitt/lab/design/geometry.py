"""Candidates by geometry alone, by the hundred thousand, as rows of arrays.

Poses are drawn over all joints, the first turned so that the palm looks towards the thrower. For
each, some choices of three joints meet a typical ball (:mod:`mitt.lab.design.interception`). All
are scored by balls from the corners of the box of throws, and by whether these are in the domain of
l_c^-1 (:mod:`mitt.core.map.tangent`) from where the arm starts.

The hand meets a ball as the map's line says. Where learning weighs the match, b has terms of first
order: they add c ds to the joint speeds, s the catch joint's way to go. c may differ from place to
place, but not from ball to ball: q_d depends on the position alone.

| here   | meaning                                                   | unit  | shape     |
|--------|-----------------------------------------------------------|-------|-----------|
| ``dq`` | joint speeds at the catch, for each ball at one place      | rad/s | (K, B, N) |
| ``ds`` | rate of the catch joint's way to go                        | rad/s | (K, B)    |
| ``v``  | velocity of each ball                                      | m/s   | (K, 3)    |
"""

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mitt.core.arm.arm import Arm
from mitt.core.ball.flight import advance
from mitt.core.map.neighbourhood import FASTEST_SHARE
from mitt.core.map.tangent import Tangent, invert, scratch_of
from mitt.core.signals import Array
from mitt.lab.design.candidate import Candidate, within
from mitt.lab.design.driven_arm import movable
from mitt.lab.design.interception import (
    ASKED_SHARE,
    MOST_OFF_LINE,
    Interception,
    alone,
    bounded_speeds,
    least_relative_velocity,
    line_rates,
    shared,
    slope_of,
    sloped,
    virtual_jacobian,
)
from mitt.lab.design.poses import Poses, Touch, Which, clear, facing, led, off_line, poses_of
from mitt.lab.design.task import BOX, FAR, Balls


class _Draw(NamedTuple):
    """How poses, choices of joints and maps are drawn; found by trial."""

    margin: float = 0.12  # joint range left free at the catch [rad]
    shares: tuple[float, float] = (0.3, 0.9)  # of joint speeds for a typical ball: others ask more
    alone: int = 24  # choices of three joints that move alone, of each pose
    shared: int = 8  # choices of three that all others follow, of each pose
    held: float = 0.25  # how often a further joint is held nevertheless
    sloped: float = 0.6  # how often the catch angle goes with the other joints
    slope: float = 1.0  # standard deviation of its slope [1]
    facing: float = 0.1  # least cosine of the palm's normal and the way the ball comes from
    tilt: float = float(np.deg2rad(35.0))  # of the relative velocity off that normal [rad]
    often: float = 0.6  # how often each joint is changed
    weighed: float = 0.7  # how often a relative velocity at the catch costs something in learning
    weights: tuple[float, float] = (0.3, 100.0)  # range of what it costs [(m/s)^-2]
    # The ready pose is the pose at the catch less this time [s] times the joint speeds there: 0.13
    # to 0.2 in the softest motions of the WAM (``benchmarks/softest.py``).
    swing: tuple[float, float] = (0.04, 0.22)
    swing_each: tuple[float, float] = (0.7, 1.3)  # factor on it, drawn for each joint [1]
    aside: float = 1.0  # farthest of the two other joints from the catch [rad]: the same branch
    ready_room: float = 0.05  # of the ready pose to the ends of the ranges [rad]


class _Cost(NamedTuple):
    """What a candidate's score has besides the relative speed, in m/s of it; found by trial."""

    repeated: float = 0.08  # for each further candidate of the same choice of joints
    effort: float = 0.3  # for using all of a joint's speed
    too_fast: float = 5.0  # for asking all of a joint's speed more than may be asked
    aslant: float = 1.0  # for a ball that comes in aslant
    no_brake: float = 1.0  # for a ball after which the arm cannot brake
    outside: float = 2.0  # where all balls are outside the domain early on their way


_DRAW = _Draw()
_COST = _Cost()


class CandidateRows(NamedTuple):
    """Candidates as arrays, one a row."""

    q: Array  # (B, N)
    free: NDArray[np.int64]  # (B, 3) catch joint last
    kappa: Array  # (B,)
    inward: Array  # (B,)
    A: Array  # (B, N, 3) how joints share the motion, catch joint last
    x: Array  # (B, 3) rates of p at the nominal catch, catch joint last; of weighed matches, means
    tip: Array  # (B, 3)
    score: Array  # (B,) relative speed [m/s] and what else is bad; smaller is better
    weight: Array  # (B,) match weight, 0 where the map matches by its line alone [(m/s)^-2]

    @property
    def moving(self) -> NDArray[np.int64]:
        """How many joints move, shape (B,)."""
        return np.asarray(np.any(self.A != 0.0, axis=2).sum(axis=1), dtype=np.int64)

    def take(self, rows: Which) -> "CandidateRows":
        """Return some of them, by index or by mask."""
        return CandidateRows._make(x[rows] for x in self)


def joined(parts: Sequence[CandidateRows]) -> CandidateRows:
    """Return candidates of several parts as one."""
    return CandidateRows(*(np.concatenate(x) for x in zip(*parts, strict=True)))


def boxes_of(whole: Arm, balls: Balls, rows: CandidateRows) -> Array:
    """Return centre and half-widths of the box of each candidate [m], shape (B, 2, 3)."""
    if balls.aim is not None:
        return np.broadcast_to(balls.aim, (len(rows.q), 2, 3))
    if balls.around is not None:
        return np.stack([rows.tip, np.broadcast_to(balls.around, rows.tip.shape)], axis=1)
    at = poses_of(whole.model, rows.q).at[:, 1]
    reach = np.minimum(np.linalg.norm(rows.tip - at, axis=1), FAR)
    return np.stack([rows.tip, reach[:, None] * np.array(BOX)], axis=1)


def best_of(rows: CandidateRows, *, count: int, each: int) -> CandidateRows:
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
        cost.append(float(rows.score[k]) + _COST.repeated * seen.get(key, 0))
        seen[key], near[place] = seen.get(key, 0) + 1, near.get(place, 0) + 1
        taken.append(k)
    ranked = np.argsort(cost, kind="stable")[:count]
    return rows.take(np.array(taken, dtype=np.int64)[ranked])


def drawn_weights(count: int, rng: np.random.Generator) -> Array:
    """Draw match weights: 0, or one of any size [(m/s)^-2], shape (count,)."""
    low, high = np.log(_DRAW.weights).tolist()
    size = np.exp(rng.uniform(low, high, count))
    out: Array = np.where(rng.random(count) < _DRAW.weighed, size, 0.0)
    return out


def candidates_of(
    whole: Arm, balls: Balls, rows: CandidateRows, rng: np.random.Generator
) -> list[Candidate]:
    """Return rows as candidates, each with a ready pose on the far side of its swing."""
    boxes, out = boxes_of(whole, balls, rows), []
    for k in range(len(rows.q)):
        order = np.argsort(rows.free[k])
        free = rows.free[k][order]
        swing = rng.uniform(*_DRAW.swing) * rng.uniform(*_DRAW.swing_each, 3) * rows.x[k]
        swing[:2] = np.clip(swing[:2], -_DRAW.aside, _DRAW.aside)
        A = rows.A[k][:, order]
        low, high = whole.q_min + _DRAW.ready_room, whole.q_max - _DRAW.ready_room
        ready = np.clip(rows.q[k, free] - A[free] @ swing[order], low[free], high[free])
        swing = A @ np.linalg.solve(A[free], ready - rows.q[k, free])
        room = np.where(swing > 0.0, high - rows.q[k], rows.q[k] - low) / np.maximum(
            np.abs(swing), 1e-9
        )
        ready = rows.q[k, free] + np.clip(room.min(), 0.0, 1.0) * (ready - rows.q[k, free])
        out.append(
            Candidate(
                q=rows.q[k].copy(),
                free=(int(free[0]), int(free[1]), int(free[2])),
                catch=int(np.argmax(order == 2)),
                kappa=float(rows.kappa[k]),
                inward=float(rows.inward[k]),
                A=A,
                ready=ready,
                aim=boxes[k].copy(),
                match_weight=float(rows.weight[k]),
            )
        )
    return out


#: The balls that are looked at early: speed and descent from the least (-1) to the most (1), as in
#: ``Balls.velocity``.
_EARLY_BALLS = ((-1.0, 1.0), (1.0, -1.0))


def share_inside(whole: Arm, balls: Balls, rows: CandidateRows) -> Array:
    """Return which share of some balls is in the domain early on its way, shape (B,)."""
    ways = [_before(balls.velocity(faster, 0.0, steeper)) for faster, steeper in _EARLY_BALLS]
    scratch, inside = scratch_of(whole.n), np.zeros(len(rows.q))
    for k in range(len(rows.q)):
        tangent = _tangent(whole, rows, k)
        inside[k] = np.mean(
            [invert(tangent, rows.tip[k] + x, rows.q[k].copy(), scratch) for x in ways]
        )
    return inside


def _before(v: Array) -> Array:
    """Return where a ball was early on its way, seen from where it is now [m], shape (3,).

    0.42 s before: arms start about then. Its drag matters little in that time.
    """
    r, dr = np.zeros(3), v.copy()
    advance(r, dr, 0.04, -0.42)
    return r


def _tangent(whole: Arm, rows: CandidateRows, k: int) -> Tangent:
    """Return the map l_c of a candidate, over all joints of the arm."""
    q, A, free = rows.q[k], rows.A[k], rows.free[k]
    order = np.argsort(free)
    a, b, c = free[order].tolist()
    i = int(free[2])
    return Tangent(
        chain=whole.chain,
        free=(a, b, c),
        catch_joint=i,
        catch=int(np.argmax(order == 2)),
        q_catch=float(q[i] - A[i, :2] @ q[free[:2]]),
        kappa=float(rows.kappa[k]),
        inward=float(rows.inward[k]),
        q_rest=q,
        A=np.ascontiguousarray(A[:, order]),
        planar=False,
        plane=np.zeros(7),
    )


#: Time for which the joints go on at their speeds after the catch, until the arm has braked [s].
BRAKED = 0.1
#: Largest angle at which a ball may come in off the palm's normal [rad], and speed below which it
#: does not matter [m/s].
STRAIGHT = np.deg2rad(45.0)
SOFT = 1.0
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
#: Largest share of joint speeds that a candidate may ask for: its learned map may do better.
_BEYOND = 1.5
#: Least rate of the catch joint's way [rad/s].
_STILL = 0.05


class _Meeting(NamedTuple):
    """How the balls at one place are met."""

    dq: Array  # (K, B, N)
    relative: Array  # (K, B, 3) velocity of the ball relative to the hand [m/s]
    line: Array  # (B,) largest share of a joint's speed that the line alone asks for


def score_candidates(whole: Arm, balls: Balls, rows: CandidateRows, touch: Touch) -> CandidateRows:
    """Score candidates by how they meet balls all over the box.

    Those that cannot, or that touch themselves at the nominal catch, are left out.
    Scores are replaced, and rates where learning weighs the match.
    """
    half, rates = boxes_of(whole, balls, rows)[:, 1], np.zeros_like(rows.x)
    total = np.zeros(len(rows.q))
    for across, up, azimuth in _PLACES:
        offset = np.array([0.0, across, up]) * half
        q = _moved(whole, rows, balls.velocity(0.0, azimuth), offset)
        poses = poses_of(whole.model, q)
        v = np.array([balls.velocity(x, azimuth, y) for x, y in _BALLS])
        met = _meeting(whole, rows, poses, v)
        share = np.abs(met.dq / whole.dq_max).max(axis=2)
        good = within(whole, q, 0.05) & (share.max(axis=0) < _BEYOND) & (met.line < FASTEST_SHARE)
        braked = within(whole, q + BRAKED * met.dq, 0.0)
        cost = (
            _COST.effort * share
            + _COST.too_fast * np.maximum(share - ASKED_SHARE, 0.0)
            + _COST.no_brake * ~braked
        )
        total += np.mean(cost + _hardness(met.relative, poses.palm), axis=0) / len(_PLACES)
        rates += _rates(rows, met.dq.mean(axis=0)) / len(_PLACES)
        rows, half, total, rates = rows.take(good), half[good], total[good], rates[good]
    x = np.where(rows.weight[:, None] > 0.0, rates, rows.x)
    kept = rows._replace(score=total, x=x).take(touch.clear(rows.q))
    outside = 1.0 - share_inside(whole, balls, kept)
    return kept._replace(score=kept.score + _COST.outside * outside)


def _meeting(whole: Arm, rows: CandidateRows, poses: Poses, v: Array) -> _Meeting:
    """Return how balls are met in some poses."""
    J, w = virtual_jacobian(poses, rows.A)
    x = np.array([line_rates(J, w, y, rows.kappa, rows.inward) for y in v])
    x = np.where(np.isfinite(x), x, 1e6)  # too fast for any joint
    dq = np.einsum("bna,kba->kbn", rows.A, x)
    line, some = np.abs(dq / whole.dq_max).max(axis=(0, 2)), np.flatnonzero(rows.weight > 0.0)
    dq[:, some] += _first_order(whole, poses.J[some], dq[:, some], x[:, some, 2], v)
    return _Meeting(dq, v[:, None] - np.einsum("bnc,kbn->kbc", poses.J, dq), line)


def _first_order(whole: Arm, J: Array, dq: Array, ds: Array, v: Array) -> Array:
    """Return c ds, shape (K, B, N): what first-order terms add to joint speeds.

    c is the same for all balls: the sum of their squared relative velocities is least, within the
    joint speeds. Where no c keeps them for all balls, it is the middle of what comes nearest.
    """
    ds = np.where(np.abs(ds) > _STILL, ds, np.copysign(_STILL, ds))
    fastest = np.where(np.any(dq != 0.0, axis=0), ASKED_SHARE * whole.dq_max, 0.0)
    ends = np.sort(np.array([(x - dq) / ds[:, :, None] for x in (-fastest, fastest)]), axis=0)
    low, high = ends[0].max(axis=0), ends[1].min(axis=0)
    middle = 0.5 * (low + high)
    left = v[:, None] - np.einsum("bnc,kbn->kbc", J, dq)
    wanted = np.sum(ds[:, :, None] * left, axis=0) / np.sum(ds**2, axis=0)[:, None]
    c = bounded_speeds(J, wanted, np.minimum(low, middle), np.maximum(high, middle))
    return np.asarray(c * ds[:, :, None])


def _hardness(relative: Array, palm: Array) -> Array:
    """Return the relative speed, and more of it where a ball comes in aslant [m/s], (K, B)."""
    s = np.linalg.norm(relative, axis=2)
    cosine = -np.sum(relative * palm, axis=2) / np.maximum(s, 1e-9)
    hardness: Array = s + _COST.aslant * ((cosine < np.cos(STRAIGHT)) & (s > SOFT))
    return hardness


def _rates(rows: CandidateRows, dq: Array) -> Array:
    """Return the rates of the coordinates p that turn the free joints at dq [rad/s], (B, 3)."""
    own = np.take_along_axis(rows.A, rows.free[:, :, None], axis=1)
    turned = np.take_along_axis(dq, rows.free, axis=1)
    rates = np.linalg.solve(own, turned[..., None])[..., 0]
    return np.asarray(rates, np.float64)


def _moved(whole: Arm, rows: CandidateRows, v: Array, offset: Array) -> Array:
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
        C = np.swapaxes(virtual_jacobian(poses, rows.A)[0][:, :2] @ across.T, 1, 2)
        flat = np.abs(np.linalg.det(C)) < 1e-4
        C = np.where(flat[:, None, None], np.eye(2), C)
        step = np.linalg.solve(C, (goal - poses.tip @ across.T)[..., None])[..., 0]
        q += np.einsum("bka,ba->bk", rows.A[:, :, :2], np.clip(step, -0.8, 0.8))
        lost |= flat
    q[lost] = whole.q_max + 1.0  # in no range
    return q


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
) -> CandidateRows:
    """Draw poses and choices of joints, and return those that meet the typical ball.

    ``triples`` are choices of three joints, the catch joint last, shape (T, 3).
    """
    q = facing(whole, rng.uniform(whole.q_min, whole.q_max, (count, whole.n)), rng)
    q, poses, _ = _able(whole, balls, q, touch)
    parts = [_of_three(whole, balls, (q, poses), triples, rng)]
    if len(np.unique(triples)) > 3:
        parts.append(_of_all(whole, balls, (q, poses), triples, rng))
    return joined(parts)


def _of_three(
    whole: Arm,
    balls: Balls,
    of: tuple[Array, Poses],
    triples: NDArray[np.int64],
    rng: np.random.Generator,
) -> CandidateRows:
    """Return poses in which three joints meet the typical ball, the others held."""
    chosen, row = _choices(len(of[0]), triples, _DRAW.alone, rng)
    A = sloped(alone(chosen, whole.n), _slopes(len(row), rng))
    return _met(whole, balls.velocity(), of, (chosen, A), row, rng)


def _of_all(
    whole: Arm,
    balls: Balls,
    of: tuple[Array, Poses],
    triples: NDArray[np.int64],
    rng: np.random.Generator,
) -> CandidateRows:
    """Return poses in which further joints follow the three."""
    chosen, row = _choices(len(of[0]), triples, _DRAW.shared, rng)
    weights = np.where(rng.random((len(row), whole.n)) < _DRAW.held, 0.0, whole.dq_max**2)
    named = np.isin(np.arange(whole.n), triples)
    weights[:, ~(named & movable(whole))] = 0.0
    weights[np.arange(len(row))[:, None], chosen] = whole.dq_max[chosen] ** 2
    good, A = shared(of[1].J[row], chosen, weights)
    A = sloped(A, _slopes(len(row), rng))
    return _met(whole, balls.velocity(), of, (chosen[good], A[good]), row[good], rng)


def _slopes(count: int, rng: np.random.Generator) -> Array:
    """Draw how catch angles go with the two other joints, shape (count, 2)."""
    slope: Array = (
        _DRAW.slope * rng.standard_normal((count, 2)) * (rng.random((count, 1)) < _DRAW.sloped)
    )
    return slope


def _choices(
    count: int, triples: NDArray[np.int64], each: int, rng: np.random.Generator
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return choices of three joints for each of so many poses, and the pose of each."""
    each = min(len(triples), each)
    chosen = triples[rng.integers(len(triples), size=(count, each))].reshape(-1, 3)
    return chosen, np.repeat(np.arange(count), each)


def improved(
    whole: Arm,
    balls: Balls,
    rows: CandidateRows,
    rng: np.random.Generator,
    *,
    size: float,
    touch: Touch,
) -> CandidateRows:
    """Return candidates and small changes of them, scored by :func:`score_candidates`.

    ``size`` is the standard deviation of the changes [rad].
    """
    change = size * rng.standard_normal((len(rows.q), whole.n))
    change *= (rng.random(change.shape) < _DRAW.often) & movable(whole)
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
    return joined([rows, score_candidates(whole, balls, joined([found, near]), touch)])


def _same_line(rows: CandidateRows, rng: np.random.Generator, *, size: float) -> CandidateRows:
    """Return candidates with kappa and inward a little different.

    Their line need not match the ball's velocity: terms of first order in b do, as far as joint
    speeds allow (:mod:`mitt.lab.design.geometry`).
    """
    count, kappa, inward = len(rows.q), rows.kappa, rows.inward
    harder = (kappa - 1.0 + 0.02) * np.exp(2.0 * size * rng.standard_normal(count))
    aside = size * (kappa - 1.0 + np.abs(inward) + 0.1) * rng.standard_normal(count)
    return rows._replace(
        kappa=np.minimum(1.0 + harder, MOST_OFF_LINE),
        inward=np.clip(inward + aside, -MOST_OFF_LINE, MOST_OFF_LINE),
    )


def _able(
    whole: Arm, balls: Balls, q: Array, touch: Touch
) -> tuple[Array, Poses, NDArray[np.int64]]:
    """Return the poses clear of floor and arm with the palm towards the ball, and their indices."""
    if balls.aim is not None:
        q = led(whole, q, balls)
    poses, v = poses_of(whole.model, q), balls.velocity()
    good = clear(poses, touch.floor) & within(whole, q, _DRAW.margin)
    good &= -(poses.palm @ v) > _DRAW.facing * np.linalg.norm(v)
    if balls.aim is not None:
        good &= off_line(poses.tip, balls) < 0.05
    return q[good], poses.take(good), np.flatnonzero(good)


def _met(
    whole: Arm,
    v: Array,
    of: tuple[Array, Poses],
    moving: tuple[NDArray[np.int64], Array],
    row: NDArray[np.int64],
    rng: np.random.Generator,
) -> CandidateRows:
    """Return the rows whose joints meet a ball of velocity v within their speeds.

    ``moving`` has the free joints and how all share the motion, ``row`` which pose each row has.
    """
    poses, A = of[1].take(row), moving[1]
    J, w = virtual_jacobian(poses, A)
    d = _into(poses.palm, J[:, 2], w, rng)
    share = rng.uniform(*_DRAW.shares, (len(row), 1))
    found = least_relative_velocity(J, w, v, d, share * whole.dq_max, A)
    good = np.flatnonzero(found.sound & (found.s < np.linalg.norm(v)))
    moving = moving[0][good], A[good]
    return _rows(whole, of, moving, row[good], d[good], found.take(good), rng)


def _rows(
    whole: Arm,
    of: tuple[Array, Poses],
    moving: tuple[NDArray[np.int64], Array],
    row: NDArray[np.int64],
    d: Array,
    found: Interception,
    rng: np.random.Generator,
) -> CandidateRows:
    """Return what meets the ball so that it comes into the palm and the joints can brake after."""
    (q, poses), (chosen, A) = of, moving
    speeds = np.einsum("bka,ba->bk", A, found.x)
    straight: NDArray[np.bool_] = -np.sum(d * poses.palm[row], axis=1) > np.cos(STRAIGHT)
    good = within(whole, q[row] + BRAKED * speeds, 0.0) & (straight | (found.s < SOFT))
    effort = np.abs(speeds / whole.dq_max).max(axis=1)
    return CandidateRows(
        q=q[row],
        free=chosen,
        kappa=found.kappa,
        inward=found.inward,
        A=A,
        x=found.x,
        tip=poses.tip[row],
        score=found.s + 0.3 * effort,
        weight=drawn_weights(len(chosen), rng),
    ).take(good)


def _into(palm: Array, J: Array, w: Array, rng: np.random.Generator) -> Array:
    """Return unit vectors in the plane of J and w x J, about into the palm, shape (B, 3)."""
    across = np.cross(J, np.cross(w, J))
    across /= np.maximum(np.linalg.norm(across, axis=1), 1e-12)[:, None]
    flat = -palm + np.sum(palm * across, axis=1)[:, None] * across
    flat /= np.maximum(np.linalg.norm(flat, axis=1), 1e-9)[:, None]
    tilt = rng.uniform(-_DRAW.tilt, _DRAW.tilt, len(palm))[:, None]
    d: Array = np.cos(tilt) * flat + np.sin(tilt) * np.cross(across, flat)
    return d
