"""What would help an arm: the relative velocity at the catch, were one joint quicker."""

from dataclasses import dataclass

import numpy as np

from mitt.design.balls import Balls
from mitt.design.candidate import Candidate
from mitt.design.interception import least_relative_velocity, map_velocities
from mitt.design.poses import poses_of
from mitt.design.sharing import virtual
from mitt.robot.arm import Arm
from mitt.signals import Array

#: By what a joint is made quicker, and relative speed below which nothing has to be [m/s].
QUICKER, _GENTLE = 1.5, 0.3


@dataclass(frozen=True, slots=True, kw_only=True)
class FasterJoint:
    """What one joint's speed is worth.

    Attributes:
        joint: Its name.
        share: Share of its speed limit at the nominal catch.
        relative_m_s: Least relative speed there, by joint speeds alone.
        quicker_m_s: The same, were the joint 50 % faster.
    """

    joint: str
    share: float
    relative_m_s: float
    quicker_m_s: float


def faster_joints(whole: Arm, c: Candidate, balls: Balls) -> list[FasterJoint]:
    """Return what each active joint's speed is worth at a candidate's nominal catch.

    The direction of the relative velocity stays, and the joints may be as near to their limits as
    the quickest of them is now.
    """
    order = [k for k in range(3) if k != c.catch] + [c.catch]
    index, A = np.array(c.active), c.A[None][:, :, order]
    v, most = balls.velocity(), whole.dq_max
    J, w = virtual(poses_of(whole.model, c.q[None]), A)
    x, relative = map_velocities(J, w, v, np.array([c.kappa]), np.array([c.inward]))
    speed = float(np.linalg.norm(relative))
    share = (np.abs(A[0] @ x[0]) / most)[index]
    if not speed > _GENTLE:
        return [_row(whole, k, s, speed, speed) for k, s in zip(index, share, strict=True)]
    allowed, out = float(share.max()) * most, []

    def least(speeds: Array) -> float:
        """Return the least relative speed along the present direction, if there is one [m/s]."""
        found = least_relative_velocity(J, w, v, relative / speed, speeds[None], A)
        return min(float(found.s[0]), speed) if found.sound[0] else speed

    now = least(allowed)
    for at, k in enumerate(index):
        quicker = allowed.copy()
        quicker[k] *= QUICKER
        out.append(_row(whole, int(k), float(share[at]), now, min(least(quicker), now)))
    return out


def _row(whole: Arm, k: int, share: float, speed: float, quicker: float) -> FasterJoint:
    """Return one row."""
    return FasterJoint(
        joint=whole.names[k], share=float(share), relative_m_s=speed, quicker_m_s=quicker
    )
