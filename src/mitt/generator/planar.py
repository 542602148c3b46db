"""Arms whose l_c has a closed-form inverse: yaw, pitch and an elbow in one plane.

Joint 0 turns about the vertical through the shoulder, joint 1 about a horizontal axis through
the shoulder, and with both at zero the catch point and its tangent lie in the plane y = 0.
The Barrett WAM with joint 3 at zero is such an arm; the test looks at geometry, not at names.
"""

import numpy as np

from mitt.robot.arm import Arm
from mitt.robot.kinematics import motion_of, sweep
from mitt.signals import Array

#: Largest deviation from that geometry [m or 1].
_TOLERANCE = 1e-12


def plane_of(
    arm: Arm, catch_joint: int, *, q_catch: float, kappa: float, inward: float = 0.0
) -> Array | None:
    """Return p_x, p_z, t_x, t_z, shoulder height [m], signs of yaw and pitch, shape (7,).

    None where the arm is of another kind.
    """
    if arm.n != 3 or catch_joint != 2 or bool(np.any(arm.chain.prismatic)):
        return None
    q = np.array([0.0, 0.0, q_catch])
    m = motion_of(3)
    sweep(arm.chain, q, np.zeros(3), m)
    yaw, pitch = m.W[0], m.W[1]
    base, shoulder = m.origin[0, 0], m.origin[0, 1]
    flat = (yaw[0], yaw[1], pitch[0], pitch[2], base[0], base[1], shoulder[0], shoulder[1])
    p, t = m.tip[0], kappa * m.J[2] + inward * np.cross(m.W[2], m.J[2])
    off = max(abs(x) for x in (*flat, p[1], t[1]))
    height = shoulder[2]
    if off > _TOLERANCE or abs(p[0] * t[0] + (p[2] - height) * t[2]) < _TOLERANCE:
        return None
    return np.array([p[0], p[2] - height, t[0], t[2], height, yaw[2], pitch[1]])
