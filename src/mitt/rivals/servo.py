"""Joints follow a moving goal, tick by tick, within bounds.

| here     | meaning                                                   | unit    | shape  |
|----------|-----------------------------------------------------------|---------|--------|
| ``goal`` | q, dq, ddq to be followed                                 | rad ... | (3, n) |
| ``rows`` | q, dq, ddq, carried on by a tick in place                 | rad ... | (3, n) |
| ``most`` | q_min, q_max, largest speed, largest acceleration         | rad ... | (4, n) |
"""

import numpy as np

from mitt.jit import kernel
from mitt.robot.arm import Arm
from mitt.signals import Array

#: Gap to a joint stop that is kept [rad], and share of the speed limits.
_STOP_GAP, _SPEED = 0.06, 0.98


def bounds_of(arm: Arm, *, share: float) -> Array:
    """Return ``most`` of the module's table: a share of the torque on each joint's own inertia."""
    top = share * arm.tau_max / np.diag(arm.mass_matrix(arm.q_ready))
    return np.array([arm.q_min + _STOP_GAP, arm.q_max - _STOP_GAP, _SPEED * arm.dq_max, top])


@kernel
def follow(most: Array, goal: Array, gain: float, dt: float, rows: Array) -> None:
    """Carry ``rows`` on by a tick so that the gap to the goal decays, critically damped.

    ddq = ddq_g + 2 w (dq_g - dq) + w^2 (q_g - q), the goal being that of the end of the tick.

    Args:
        most: Bounds, shape (4, n).
        goal: The goal at the end of the tick, shape (3, n).
        gain: w [rad/s].
        dt: Length of the tick [s].
        rows: q, dq, ddq, shape (3, n).
    """
    for k in range(rows.shape[1]):
        q, dq = rows[0, k] + dt * rows[1, k], rows[1, k]
        lag, slow = goal[0, k] - q, goal[1, k] - dt * goal[2, k] - dq
        ddq = goal[2, k] + 2.0 * gain * slow + gain * gain * lag
        ddq = min(max(ddq, -most[3, k]), most[3, k])
        dq = min(max(dq + dt * ddq, -most[2, k]), most[2, k])
        q = rows[0, k] + 0.5 * dt * (rows[1, k] + dq)
        if q < most[0, k] or q > most[1, k]:
            q, dq = min(max(q, most[0, k]), most[1, k]), 0.0
        rows[2, k] = (dq - rows[1, k]) / max(dt, 1e-9)
        rows[0, k], rows[1, k] = q, dq
