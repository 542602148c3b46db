"""What would help an arm: the relative speed at the catch, with a quicker joint or longer links."""

from dataclasses import dataclass

import numpy as np

from mitt.design.balls import Balls
from mitt.design.candidate import Candidate
from mitt.design.interception import least_relative_velocity, map_velocities
from mitt.design.poses import poses_of
from mitt.design.sharing import virtual
from mitt.robot.arm import Arm
from mitt.signals import Array

#: By what a joint is made quicker, and all links longer; relative speed below which nothing has to
#: be [m/s].
QUICKER, LONGER, _GENTLE = 1.5, 1.2, 0.3


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


@dataclass(frozen=True, slots=True, eq=False)
class _Catch:
    """The nominal catch of a candidate: what its joint speeds allow there."""

    J: Array
    w: Array
    v: Array
    A: Array
    relative: Array
    share: Array
    allowed: Array

    @property
    def speed(self) -> float:
        """Relative speed that the map asks for [m/s]."""
        return float(np.linalg.norm(self.relative))

    def least(self, speeds: Array, *, longer: float = 1.0) -> float:
        """Return the least relative speed along the present direction, if there is one [m/s].

        Args:
            speeds: Of all joints, which may be asked [rad/s], shape (N,).
            longer: By what factor the arm is longer, its pose and the speeds being the same.
        """
        if not self.speed > _GENTLE:
            return self.speed
        d = self.relative / self.speed
        found = least_relative_velocity(longer * self.J, self.w, self.v, d, speeds[None], self.A)
        return min(float(found.s[0]), self.speed) if found.sound[0] else self.speed


def _catch_of(whole: Arm, c: Candidate, balls: Balls) -> _Catch:
    """Return the nominal catch of a candidate."""
    order = [k for k in range(3) if k != c.catch] + [c.catch]
    A, v = c.A[None][:, :, order], balls.velocity()
    J, w = virtual(poses_of(whole.model, c.q[None]), A)
    x, relative = map_velocities(J, w, v, np.array([c.kappa]), np.array([c.inward]))
    share = np.abs(A[0] @ x[0]) / whole.dq_max
    allowed = float(share[list(c.active)].max()) * whole.dq_max
    return _Catch(J=J, w=w, v=v, A=A, relative=relative, share=share, allowed=allowed)


def faster_joints(whole: Arm, c: Candidate, balls: Balls) -> list[FasterJoint]:
    """Return what each active joint's speed is worth at a candidate's nominal catch.

    The direction of the relative velocity stays, and the joints may be as near to their limits as
    the quickest of them is now.
    """
    catch, out = _catch_of(whole, c, balls), []
    now = catch.least(catch.allowed)
    for k in c.active:
        quicker = catch.allowed.copy()
        quicker[k] *= QUICKER
        out.append(_row(whole, k, float(catch.share[k]), now, min(catch.least(quicker), now)))
    return out


def longer_arm(whole: Arm, c: Candidate, balls: Balls) -> float:
    """Return the least relative speed there, were all links longer by :data:`LONGER` [m/s].

    Pose and joint speeds stay, so that the hand is faster; by joint speeds alone, as above.
    """
    catch = _catch_of(whole, c, balls)
    return min(catch.least(catch.allowed, longer=LONGER), catch.least(catch.allowed))


def _row(whole: Arm, k: int, share: float, speed: float, quicker: float) -> FasterJoint:
    """Return one row."""
    return FasterJoint(
        joint=whole.names[k], share=float(share), relative_m_s=speed, quicker_m_s=quicker
    )
