"""The last stage before the arm: whatever is asked, what is emitted keeps the limits.

The desired motion is clipped to ranges and speeds; the acceleration that the controller wants is
bounded so that the measured joint neither passes its speed limit nor comes to a stop that it
could not brake for. Inside the limits nothing changes. Torques are cut in
:mod:`mitt.control.tracking`, all joints together.

| here      | meaning                                               | unit    | shape  |
|-----------|-------------------------------------------------------|---------|--------|
| ``wanted``| q_d, dq_d, ddq_d before, q, dq, ddq after             | rad ... | (3, n) |
| ``b``     | q_min, q_max, dq_max, deceleration to be trusted      | rad ... | (4, n) |
"""

import numpy as np
from numba import njit

from mitt.robot.arm import Arm
from mitt.signals import Array

#: Share of a speed limit and gap to a joint stop [rad] that the emitted motion keeps.
_SPEED_SHARE, _STOP_GAP = 0.995, 0.06
#: Time in which a joint may close in on a speed limit [s]; a few ticks.
_APPROACH = 0.006


def bounds_of(arm: Arm) -> Array:
    """Return q_min, q_max, dq_max, brake of the active joints with their gaps, shape (4, n)."""
    inertia = np.diag(arm.mass_matrix(arm.q_ready))
    brake = arm.tau_max / inertia
    return np.array(
        [arm.q_min + _STOP_GAP, arm.q_max - _STOP_GAP, _SPEED_SHARE * arm.dq_max, brake]
    )


@njit(cache=True)
def clip_motion(b: Array, wanted: Array) -> None:
    """Clip positions and speeds in place; at the end of a range, stop."""
    for k in range(wanted.shape[1]):
        q_min, q_max, dq_max = b[0, k], b[1, k], b[2, k]
        q = wanted[0, k]
        dq = min(max(wanted[1, k], -dq_max), dq_max)
        if q >= q_max:
            q, dq = q_max, min(dq, 0.0)
        if q <= q_min:
            q, dq = q_min, max(dq, 0.0)
        if dq != wanted[1, k]:
            wanted[2, k] = 0.0
        wanted[0, k], wanted[1, k] = q, dq


@njit(cache=True)
def bound_acceleration(b: Array, q: Array, dq: Array, ddq: Array) -> None:
    """Bound accelerations in place by the speed limits and by the way left to the stops."""
    for k in range(len(q)):
        q_min, q_max, dq_max, brake = b[0, k], b[1, k], b[2, k], b[3, k]
        up = np.sqrt(2.0 * brake * max(q_max - q[k], 0.0))
        down = np.sqrt(2.0 * brake * max(q[k] - q_min, 0.0))
        highest = (min(dq_max, up) - dq[k]) / _APPROACH
        lowest = (-min(dq_max, down) - dq[k]) / _APPROACH
        ddq[k] = min(max(ddq[k], lowest), highest)
