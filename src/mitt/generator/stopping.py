"""Whether the arm can be stopped after the catch before a joint meets its stop; compiled."""

import numpy as np

from mitt.generator.sqp_step import Buffers
from mitt.generator.utilization import Plant, motion_at
from mitt.jit import kernel
from mitt.robot.description import STOP_GAP
from mitt.robot.dynamics import torque_slopes
from mitt.robot.limits import LEAST, bound_of
from mitt.signals import Array

#: Share of the torque that a brake may use, and shares of their own rate for the other joints.
_BRAKING = 0.95
_OTHERS = (0.15, 0.4, 0.8, 1.2)


@kernel
def spare(p: Plant, alpha: Array, b: Buffers) -> tuple[float, int]:
    """Return how near a stop the arm comes to rest after the catch, as share of the range.

    alpha does not change where and how fast the arm is at the catch; whether it can be stopped
    from there is a matter of the throw. All joints brake at constant rates from the end of the
    course, the one most short of room as hard as the drives allow beside the others.

    Returns:
        The share at the best of a few brakes, and the joint.
    """
    n, w, last = alpha.shape[1], b.work, len(b.course.after) - 1
    motion_at(b.course, last, alpha, w.motion)
    w.motion[2, :] = 0.0
    torque_slopes(p.bodies, w.motion, w.tau, w.slope, w.links)
    urgent, most, rate = 0, 0.0, np.empty(n)
    for j in range(n):
        rate[j] = p.scales[0, j] / w.slope[2, p.joints[j], j]
        v = w.motion[1, j]
        left = p.scales[3, j] - np.sign(v) * (w.motion[0, j] - p.scales[2, j])
        need = v * v / (2.0 * rate[j] * max(left, 1e-3))
        if need > most:
            urgent, most = j, need
    best, joint, braking = np.inf, urgent, np.empty(n)
    for others in _OTHERS:
        for j in range(n):
            braking[j] = others * rate[j]
        braking[urgent] = _hardest(p, b, braking, urgent)
        worst, where = 0.0, urgent
        for j in range(n):
            v, a = w.motion[1, j], max(braking[j], 1e-3)
            end = abs(w.motion[0, j] + v * abs(v) / (2.0 * a) - p.scales[2, j])
            share = end / (p.scales[3, j] - STOP_GAP)
            if share > worst:
                worst, where = share, j
        if worst < best:
            best, joint = worst, where
    return best, joint


@kernel
def _hardest(p: Plant, b: Buffers, braking: Array, urgent: int) -> float:
    """Return the hardest brake of one joint that all drives allow beside the others' [rad/s^2]."""
    w, links, n, high = b.work, len(b.work.tau), len(braking), 1e3
    for d in range(links):
        start, way, omega = 0.0, 0.0, 0.0
        for e in range(links):
            x, y = w.tau[e], 0.0
            for j in range(n):
                sign = -np.sign(w.motion[1, j])
                if j == urgent:
                    y += w.slope[2, e, j] * sign
                else:
                    x += w.slope[2, e, j] * sign * braking[j]
            start += p.drives[d, e] * x
            way += p.drives[d, e] * y
        for j in range(n):
            omega += p.drives[links + d, p.joints[j]] * w.motion[1, j]
        bound = _BRAKING * bound_of(p.drives, d, way, omega, LEAST)
        if abs(way) > 1e-12:
            high = min(high, max((bound - np.sign(way) * start) / abs(way), 0.0))
    return high
