"""Maps that catch elsewhere than the learned one: a family with its coefficients and metric.

A map catches where its catch joint is at q_alpha: on one surface. A ball that never crosses it, as
one that falls short, flies through the reach of the arm all the same, and another q_alpha catches
it. Eq. (3) holds for any coefficients (:mod:`mitt.core.map.mapping`), so those that were learned do
for another q_alpha as well: what they begin with is moved by eq. (12) to where the arm is, in the
metric that was learned. Nothing is learned anew.

The surfaces are those through the flight of the ball that the map was made for, on its way to the
catch. A map that matches the ball's velocity needs a faster arm where that is more stretched, so
the ball's line is turned inwards there until the speeds suffice, and farther for faster balls.
"""

from dataclasses import replace

import numpy as np

from mitt.core.map.foresight import foresee
from mitt.core.map.mapping import DirectMap, basis_of, coordinates
from mitt.core.map.prediction import flown
from mitt.core.signals import Array, BallState

#: Where the surfaces are, as shares of the way on which the ball is within reach before its catch.
_EARLIER = (0.4, 0.8, 1.0)
#: How far beyond where the learned map caught, besides the move, a moved one is trusted [rad].
_WIDER = 0.5
#: Ratios ``inward`` that are tried, and share of the speeds up to which one will do.
_INWARD = (0.0, 0.15, 0.3, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0)
_SPARE = 0.85
#: How much farther the line is turned for faster balls.
_FASTER = 4.0
#: Newton: largest step of a coordinate [rad], residual [m], steps; stride along the flight [s].
_STEP = 0.3
_RESIDUAL = 1e-9
_STEPS = 30
_STRIDE = 0.002
#: Longest way before the catch that is looked at [s].
_LONGEST = 0.2


def moved(f: DirectMap, q_catch: float, inward: float) -> DirectMap:
    """Return a learned map with another catch angle [rad], and another inward line.

    Its coefficients are the learned ones: adapted to a throw it starts where the arm is.
    """
    design = replace(f.design, q_catch=q_catch, inward=inward)
    centre, region = f.basis.centre.copy(), f.region + np.array([[-_WIDER], [_WIDER]])
    centre[f.basis.catch_joint] = q_catch
    region[:, design.catch_joint] += q_catch - f.design.q_catch
    basis = basis_of(design, centre, f.basis.scale.copy())
    return replace(f, design=design, basis=basis, region=region)


def family_of(f: DirectMap, ball: BallState) -> tuple[DirectMap, ...]:
    """Return maps that catch earlier than a learned one, those nearest to it first.

    Args:
        f: The learned map.
        ball: A ball as it was learned for, on its way to its catch.
    """
    poses = _way_of(f, ball)
    out: list[DirectMap] = []
    for share in _EARLIER if len(poses) > 1 else ():
        after, q = poses[round(share * (len(poses) - 1))]
        angle = float(coordinates(f.tangent, q)[f.tangent.catch])
        motion = flown(ball, np.array([after]))[0]
        out += [moved(f, angle, inward) for inward in _lines(f, angle, motion)]
    return tuple(out)


def _way_of(f: DirectMap, ball: BallState) -> list[tuple[float, Array]]:
    """Return times, from the catch of a map on backwards [s], and poses with the hand at the ball.

    As far as the ball is within reach.
    """
    arm, seen, out = f.arm, foresee(f, ball), list[tuple[float, Array]]()
    if not np.isfinite(seen.after):
        return out
    q = seen.q_o
    for after in np.arange(seen.after, max(seen.after - _LONGEST, 0.0), -_STRIDE):
        pose = _at(f, flown(ball, np.array([after]))[0, 0], q)
        if pose is None or np.any(pose < arm.q_min) or np.any(pose > arm.q_max):
            break
        q = pose
        out.append((float(after), pose))
    return out


def _at(f: DirectMap, r: Array, q: Array) -> Array | None:
    """Return the pose with the hand at a place [m] that the map's joints have, from a pose on."""
    q, A = q.copy(), f.tangent.A
    for _ in range(_STEPS):
        gap = r - f.arm.position(q)
        if np.linalg.norm(gap) < _RESIDUAL:
            return q
        J = f.arm.jacobian(q) @ A
        if np.linalg.cond(J) > 1e4:
            return None
        step = np.linalg.solve(J, gap)
        q += A @ (step * min(1.0, _STEP / float(np.abs(step).max())))
    return None


def _lines(f: DirectMap, angle: float, motion: Array) -> tuple[float, ...]:
    """Return how far the ball's line is turned inwards at a catch angle [rad].

    A map that weighs its match keeps its line: its hand is as fast as it has learned.

    Args:
        f: The learned map.
        angle: The catch angle.
        motion: r_o, dr_o, ddr_o of the ball at that catch, shape (3, 3).
    """
    if f.design.match_weight > 0.0:
        return (f.design.inward,)
    for inward in (x for x in (f.design.inward, *_INWARD) if x >= f.design.inward):
        inside, rows = moved(f, angle, inward).virtual(motion)
        if inside and np.all(np.abs(rows[1]) <= _SPARE * f.arm.dq_max):
            return (inward, _FASTER * inward) if inward > 0.0 else (inward,)
    return ()
