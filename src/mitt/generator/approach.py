"""The ball's last way into the open hand, as rows of a programme; compiled.

At kappa = 1, and into a basket, the ball stays within a cone about the palm's normal over the last
40 ms. At kappa > 1 it crosses a palm with fingers along the relative velocity, whose direction in
the hand alpha cannot change: there it stays in the corridor between the fingers, whose middle plane
holds the palm's normal and that direction.

| here       | meaning                                                          | unit | shape |
|------------|------------------------------------------------------------------|------|-------|
| ``palm``   | in the last joint's frame: the normal, and the normal of the     | 1    | (3, 3)|
|            | corridor's middle plane; then kappa > 1, corridor's half width   |      |       |
| ``excess`` | distance by which the ball is outside, over ``_SCALE``           | 1    |       |
"""

import numpy as np

from mitt.generator.horizon import LATE, Course
from mitt.generator.mapping import DirectMap
from mitt.generator.qp import Programme, spread
from mitt.generator.tangent import Scratch, Tangent
from mitt.generator.utilization import Work, motion_at
from mitt.jit import kernel
from mitt.robot.basket import Basket
from mitt.robot.kinematics import (
    IDENTITY,
    Chain,
    Vec,
    compose,
    cross,
    dot,
    matrix,
    minus,
    place,
    rotate,
    row,
    times,
    turn,
)
from mitt.signals import Array

#: Time before the catch in which the approach matters [s], the cone's half angle, and the radius
#: by which it is widened at its apex [m].
_LAST, _TANGENT, _APEX = 0.040, np.tan(np.deg2rad(25.0)), 0.005
#: Distance outside that weighs as much as a limit exceeded by all of it [m], and distance from
#: the border at which a row begins to count [m].
_SCALE, _NEAR = 0.05, 0.03


def palm_of(f: DirectMap, *, ball_radius: float) -> Array:
    """Return normal, side and corridor of the hand of a map's arm; see the module's table."""
    q = f.start
    to_last = np.array(last_frame(f.tangent.chain, q)).reshape(3, 3).T
    normal = f.arm.orientation(q)[:, 2]
    way = f.arm.jacobian(q) @ f.tangent.A[:, f.tangent.catch]
    side = np.cross(normal, way)
    side /= max(float(np.linalg.norm(side)), 1e-9)
    crosses = f.design.kappa > 1.0 and not isinstance(f.arm.model.hand, Basket)
    last = np.array([float(crosses), _free_width(f, side, ball_radius), 0.0])
    return np.array([to_last @ normal, to_last @ side, last])


def _free_width(f: DirectMap, side: Array, ball_radius: float) -> float:
    """Return by how much a ball may be off the corridor's middle before it meets a finger [m]."""
    hand = f.arm.model.hand
    if hand is None or isinstance(hand, Basket):
        return ball_radius
    across = f.arm.orientation(f.start)[:, :2].T @ side
    bases = hand.yaw + 2.0 * np.pi * np.arange(hand.fingers) / hand.fingers
    out = hand.finger.base_radius * np.column_stack([np.cos(bases), np.sin(bases)]) @ across
    gap = float(np.abs(out)[np.abs(out) > ball_radius].min(initial=2.0 * ball_radius))
    return max(gap - hand.finger.thickness - ball_radius, 0.0)


@kernel
def approach(
    g: Tangent, c: Course, alpha: Array, palm: Array, out: Programme, w: Work, s: Scratch, at: int
) -> tuple[int, float]:
    """Write the rows of the approach after the first ``at`` rows, where ``at`` is not negative.

    Returns:
        How many rows there are now, and the sum of the squared excesses.
    """
    total, end = 0.0, len(c.after) - 1 - LATE
    for k in range(end):
        if c.after[end] - c.after[k] > _LAST:
            continue
        motion_at(c, k, alpha, w.motion)
        for j in range(len(s.q)):
            s.q[j] = w.motion[0, j]
        place(g.chain, s.q, s.motion)
        excess = _excess(g.chain, row(c.path[k], 0), palm, w, s)
        total += max(excess, 0.0) ** 2
        if at >= 0 and excess > -_NEAR / _SCALE:
            spread(c.phi, k, w.drive, out.A, at)
            out.room[at] = -excess
            at += 1
    return at, total


@kernel
def _excess(chain: Chain, r_o: Vec, palm: Array, w: Work, s: Scratch) -> float:
    """Return how far the ball is outside cone or corridor; write its slope in q to ``w.drive``."""
    frame = last_frame(chain, s.q)
    n, b = rotate(frame, row(palm, 0)), rotate(frame, row(palm, 1))
    x = minus(r_o, row(s.motion.tip, 0))
    crossing = palm[2, 0] > 0.0
    w.drive[:] = 0.0
    height = dot(n, x)
    side = minus(x, times(height, n))
    off = np.sqrt(dot(side, side)) + 1e-9
    e = times(1.0 / off, side)
    across = dot(b, x)
    for j in range(len(s.q)):
        turning, dx = row(s.motion.W, j), times(-1.0, row(s.motion.J, j))
        dn = cross(turning, n)
        if crossing:
            change = np.copysign(1.0, across) * (dot(b, dx) + dot(x, cross(turning, b)))
        else:
            change = dot(e, minus(dx, times(height, dn)))
            change -= _TANGENT * (dot(n, dx) + dot(x, dn))
        w.drive[0, j] = change / _SCALE
    if crossing:
        return float((abs(across) - palm[2, 1]) / _SCALE)
    return float((off - _TANGENT * height - _APEX) / _SCALE)


@kernel
def last_frame(chain: Chain, q: Array) -> tuple[
    float, float, float, float, float, float, float, float, float
]:  # fmt: skip
    """Return the rotation of the frame after the last joint's motion."""
    frame = IDENTITY
    for k in range(len(q)):
        frame = compose(frame, matrix(chain.R, k))
        if not chain.prismatic[k] > 0.0:
            frame = compose(frame, turn(row(chain.axis, k), q[k]))
    return frame
