"""The last stage before the arm: whatever is asked, what is emitted keeps the limits.

The desired motion is clipped to ranges and speeds; the acceleration that the controller wants is
bounded so that the measured joint neither passes its speed limit nor comes to a stop that it
could not brake for; the torque is saturated drive by drive. Inside the limits nothing changes.

| here      | meaning                                               | unit    | shape  |
|-----------|-------------------------------------------------------|---------|--------|
| ``wanted``| q_d, dq_d, ddq_d before, q, dq, ddq after             | rad ... | (3, n) |
| ``brake`` | deceleration the torque limits can be trusted to give | rad/s^2 | (n,)   |
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from mitt.robot.arm import Arm
from mitt.signals import Array

#: Share of a speed limit and gap to a joint stop [rad] that the emitted motion keeps.
_SPEED_SHARE, _STOP_GAP = 0.995, 0.02
#: Time in which a joint may close in on a speed limit [s]; a few ticks.
_APPROACH = 0.006
#: Share of the torque-limited deceleration that braking for a joint stop may rely on.
_BRAKE_SHARE = 0.5


class Bounds(NamedTuple):
    """Limits of the active joints as arrays."""

    q_min: Array  # (n,) [rad]
    q_max: Array  # (n,) [rad]
    dq_max: Array  # (n,) [rad/s]
    brake: Array  # (n,) [rad/s^2]


def bounds_of(arm: Arm) -> Bounds:
    """Return the bounds of an arm, with gaps to its stops and its speed limits."""
    inertia = np.diag(arm.mass_matrix(arm.q_ready))
    return Bounds(
        q_min=arm.q_min + _STOP_GAP,
        q_max=arm.q_max - _STOP_GAP,
        dq_max=_SPEED_SHARE * arm.dq_max,
        brake=_BRAKE_SHARE * arm.tau_max / inertia,
    )


@njit(cache=True)
def clip_motion(b: Bounds, wanted: Array) -> None:
    """Clip positions and speeds in place; at the end of a range, stop."""
    for k in range(wanted.shape[1]):
        q = wanted[0, k]
        dq = min(max(wanted[1, k], -b.dq_max[k]), b.dq_max[k])
        if q >= b.q_max[k]:
            q, dq = b.q_max[k], min(dq, 0.0)
        if q <= b.q_min[k]:
            q, dq = b.q_min[k], max(dq, 0.0)
        if dq != wanted[1, k]:
            wanted[2, k] = 0.0
        wanted[0, k], wanted[1, k] = q, dq


@njit(cache=True)
def bound_acceleration(b: Bounds, q: Array, dq: Array, ddq: Array) -> None:
    """Bound accelerations in place by the speed limits and by the way left to the stops."""
    for k in range(len(q)):
        up = np.sqrt(2.0 * b.brake[k] * max(b.q_max[k] - q[k], 0.0))
        down = np.sqrt(2.0 * b.brake[k] * max(q[k] - b.q_min[k], 0.0))
        highest = (min(b.dq_max[k], up) - dq[k]) / _APPROACH
        lowest = (-min(b.dq_max[k], down) - dq[k]) / _APPROACH
        ddq[k] = min(max(ddq[k], lowest), highest)
