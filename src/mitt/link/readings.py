"""What the first readings of a robot say: whether they can be those of the arm, at rest."""

import numpy as np

from mitt.errors import InputError
from mitt.robot.arm import Arm
from mitt.signals import ArmState

#: How far outside its range a joint may be read before a unit is doubted [rad].
_OUTSIDE = 0.5
#: Speed of a joint from which an arm is not at rest [rad/s]: more than a count of an encoder.
_MOVES = 0.5


def wrong_with(arm: Arm, reading: ArmState) -> str:
    """Return why an arm cannot be moved from here, nothing if it can.

    Raises:
        InputError: A position is far outside its joint's range.
    """
    q = reading.q
    outside = np.flatnonzero((q < arm.q_min - _OUTSIDE) | (q > arm.q_max + _OUTSIDE))
    if len(outside):
        k = int(outside[0])
        wanted = f"{arm.q_min[k]:.2f} to {arm.q_max[k]:.2f} rad"
        do = "joint states are in radians (REP 103); is it in degrees, or another joint?"
        raise InputError(f"position of {arm.names[k]}", wanted, f"{q[k]:.4g}", do=do)
    if not np.all(np.isfinite(q)):
        return "joint positions that are no numbers"
    if np.any(np.abs(reading.dq) > _MOVES):
        return "the arm moves already"
    return ""
