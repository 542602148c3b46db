"""Resolved acceleration: joints follow a moving point, tick by tick (Luh, Walker and Paul 1980).

| here     | meaning                                                   | unit       | shape  |
|----------|-----------------------------------------------------------|------------|--------|
| ``goal`` | position, velocity, acceleration for the catch point      | m, m/s ... | (3, 3) |
| ``rows`` | q, dq, ddq, carried on by a tick in place                 | rad ...    | (3, n) |
| ``most`` | q_min, q_max, largest speed, largest acceleration         | rad ...    | (4, n) |
"""

import numpy as np
from numba import njit

from mitt.generator.packing import unfold, unpack
from mitt.rivals.meeting import resolve
from mitt.robot.arm import Arm
from mitt.robot.chain import sweep
from mitt.signals import Array

#: Gap to a joint stop that is kept [rad].
_STOP_GAP = 0.06


def bounds_of(arm: Arm, *, share: float) -> Array:
    """Return ``most`` of the module's table: a share of the torque on each joint's own inertia."""
    top = share * arm.tau_max / np.diag(arm.mass_matrix(arm.q_ready))
    return np.array([arm.q_min + _STOP_GAP, arm.q_max - _STOP_GAP, 0.98 * arm.dq_max, top])


@njit(cache=True)
def servo(
    packed: Array, most: Array, goal: Array, gain: float, dt: float, rows: Array, work: Array
) -> None:
    """Carry ``rows`` on by a tick so that the catch point nears the goal.

    ddq = J^# (ddp + 2 w (dp - dl) + w^2 (p - l) - J-dot dq) with damped least squares, bounded
    joint by joint; the gap to the goal decays as e'' + 2 w e' + w^2 e = 0.

    Args:
        packed: The arm.
        most: Bounds, shape (4, n).
        goal: The goal at the end of the tick, shape (3, 3).
        gain: w [rad/s].
        dt: Length of the tick [s].
        rows: q, dq, ddq, shape (3, n).
        work: Workspace.
    """
    n = rows.shape[1]
    g = unpack(packed)
    w = unfold(work, n)
    m = w.motion
    sweep(g.chain, rows[0], rows[1], m)
    x, y, z = 0.0, 0.0, 0.0
    wish = (x, y, z)
    for c in range(3):
        wanted = goal[2, c] + 2.0 * gain * (goal[1, c] - m.tip[1, c])
        wanted += gain * gain * (goal[0, c] - m.tip[0, c] - dt * m.tip[1, c]) - m.tip[2, c]
        if c == 0:
            x = wanted
        elif c == 1:
            y = wanted
        else:
            z = wanted
    wish = (x, y, z)
    resolve(m.J, wish, w.step)
    for k in range(n):
        ddq = min(max(w.step[k], -most[3, k]), most[3, k])
        dq = min(max(rows[1, k] + dt * ddq, -most[2, k]), most[2, k])
        q = rows[0, k] + 0.5 * dt * (rows[1, k] + dq)
        if q < most[0, k] or q > most[1, k]:
            q, dq = min(max(q, most[0, k]), most[1, k]), 0.0
        rows[2, k] = (dq - rows[1, k]) / max(dt, 1e-9)
        rows[0, k], rows[1, k] = q, dq
