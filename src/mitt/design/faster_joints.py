"""What would help an arm: the relative speed at the catch, with a quicker joint or longer links."""

from dataclasses import dataclass

import numpy as np

from mitt.design.balls import Balls
from mitt.design.candidate import Candidate
from mitt.design.interception import bounded
from mitt.design.poses import poses_of
from mitt.robot.arm import Arm
from mitt.signals import Array

#: By what a joint is made quicker, and all links longer; share of joint speeds that may be asked.
QUICKER, LONGER, _FASTEST = 1.5, 1.2, 0.9


@dataclass(frozen=True, slots=True, kw_only=True)
class FasterJoint:
    """What one joint's speed is worth.

    Attributes:
        joint: Its name.
        share: Share of its speed limit that this takes.
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

    J: Array  # (1, N, 3)
    v: Array  # (1, 3)
    allowed: Array  # (N,) speeds that may be asked, 0 of held joints [rad/s]

    def speeds(self, allowed: Array, *, longer: float = 1.0) -> Array:
        """Return the joint speeds that leave the least relative velocity [rad/s], shape (N,).

        Args:
            allowed: Speeds that may be asked [rad/s], shape (N,).
            longer: By what factor the arm is longer, its pose being the same.
        """
        return np.array(bounded(longer * self.J, self.v, -allowed[None], allowed[None])[0])

    def least(self, allowed: Array, *, longer: float = 1.0) -> float:
        """Return that least relative speed [m/s]; arguments as of :meth:`speeds`."""
        dq = self.speeds(allowed, longer=longer)
        return float(np.linalg.norm(self.v[0] - longer * dq @ self.J[0]))


def _catch_of(whole: Arm, c: Candidate, balls: Balls) -> _Catch:
    """Return the nominal catch of a candidate."""
    allowed = np.zeros(whole.n)
    allowed[list(c.active)] = _FASTEST * whole.dq_max[list(c.active)]
    return _Catch(J=poses_of(whole.model, c.q[None]).J, v=balls.velocity()[None], allowed=allowed)


def faster_joints(whole: Arm, c: Candidate, balls: Balls) -> list[FasterJoint]:
    """Return what each active joint's speed is worth at a candidate's nominal catch.

    In that pose and for a ball in the middle of those thrown. A map may use less of the joints than
    they allow.
    """
    catch, out = _catch_of(whole, c, balls), []
    share, now = np.abs(catch.speeds(catch.allowed)) / whole.dq_max, catch.least(catch.allowed)
    for k in c.active:
        quicker = catch.allowed.copy()
        quicker[k] *= QUICKER
        out.append(_row(whole, k, float(share[k]), now, min(catch.least(quicker), now)))
    return out


def longer_arm(whole: Arm, c: Candidate, balls: Balls) -> float:
    """Return the least relative speed there, were all links longer by :data:`LONGER` [m/s].

    The pose stays, and the hand is faster by as much; by joint speeds alone, as above.
    """
    catch = _catch_of(whole, c, balls)
    return min(catch.least(catch.allowed, longer=LONGER), catch.least(catch.allowed))


def _row(whole: Arm, k: int, share: float, speed: float, quicker: float) -> FasterJoint:
    """Return one row."""
    return FasterJoint(
        joint=whole.names[k], share=float(share), relative_m_s=speed, quicker_m_s=quicker
    )
