"""What a joint motion demands of the arm: cost of eq. (22), and shares of its limits.

| here            | paper                                   | unit | shape   |
|-----------------|-----------------------------------------|------|---------|
| ``cost_torque`` | tau' K_tau tau, K_tau = 1/tau_max^2     | 1    | (K,)    |
| ``cost_speed``  | omega' K_omega omega, 1/omega_max^2     | 1    | (K,)    |
| ``torque``      | tau over its bound, drive by drive, (18)| 1    | (K, N)  |
| ``speed``       | omega over its bound, (20)              | 1    | (K, N)  |
| ``excess``      | joint angle beyond its range            | rad  | (K, n)  |
"""

from dataclasses import dataclass

import numpy as np

from mitt.robot.arm import Arm
from mitt.signals import Array

#: Time after the catch in which the hand closes and the arm still follows [s].
_GRASP = 0.012


@dataclass(frozen=True, slots=True, kw_only=True)
class Tolerance:
    """Share of each limit at which a throw is refused.

    By default more than 1: the envelope keeps the limits whatever is asked, and asking for too
    much for a short time costs some tracking error, mostly long before the catch, not the ball. Of
    24 wide throws 7 were refused at 1.25 and 1, and the same arm caught them all. The rivals refuse
    at the same share.

    Attributes:
        torque: Of a drive's bound.
        speed: Of a drive's largest speed.
        strength: Share of its torque with which each joint, after the catch, shall come to rest
            before the end of its range; None where that is not looked at.
    """

    torque: float = 1.6
    speed: float = 1.6
    strength: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Demand:
    """Demand of a motion at K instants; see the module's table."""

    cost_torque: Array
    cost_speed: Array
    torque: Array
    speed: Array
    excess: Array

    @property
    def cost(self) -> float:
        """Mean of the two costs over the instants, eq. (22)."""
        return float(np.mean(self.cost_torque + self.cost_speed))


def demand(arm: Arm, motion: Array) -> Demand:
    """Return the demand of q, dq, ddq at K instants, shape (K, 3, n).

    The torque is eq. (14) at q = q_d, which is eq. (16) with M~, H~ and g~ of eq. (17); the
    speed is eq. (19); their shares of the limits are those of eqs. (18) and (20).
    """
    tau = arm.torques(motion)
    dq = np.zeros((len(motion), len(arm.model.links)))
    dq[:, arm.model.active] = motion[:, 1]
    q = motion[:, 0]
    return Demand(
        cost_torque=np.sum((arm.active(tau) / arm.tau_max) ** 2, axis=1),
        cost_speed=np.sum((motion[:, 1] / arm.dq_max) ** 2, axis=1),
        torque=arm.limits.torque_ratio(tau, dq),
        speed=arm.limits.speed_ratio(dq),
        excess=np.maximum(np.maximum(arm.q_min - q, q - arm.q_max), 0.0),
    )


def shares_of(arm: Arm, motion: Array, tolerance: Tolerance) -> dict[str, float]:
    """Return the largest share of every limit of the active joints, in units of its tolerance.

    Args:
        arm: The arm.
        motion: q, dq, ddq at K instants, the last one at the catch, shape (K, 3, n).
        tolerance: Shares of torque and speed that count as 1, and what the brake may use.

    Returns:
        ``torque:NAME``, ``speed:NAME``, ``range:NAME`` and, where the tolerance asks for room to
        brake, ``brake:NAME`` for each joint.
    """
    asked = demand(arm, motion)
    half, middle = 0.5 * (arm.q_max - arm.q_min), 0.5 * (arm.q_max + arm.q_min)
    kinds = {
        "torque": arm.by_joint(asked.torque).max(axis=0) / tolerance.torque,
        "speed": arm.by_joint(asked.speed).max(axis=0) / tolerance.speed,
        "range": (np.abs(motion[:, 0] - middle) / half).max(axis=0),
    }
    if tolerance.strength is not None:
        kinds["brake"] = np.abs(_rest(arm, motion[-1], tolerance.strength) - middle) / half
    return {
        f"{kind}:{name}": float(share)
        for kind, values in kinds.items()
        for name, share in zip(arm.names, values, strict=True)
    }


def _rest(arm: Arm, motion: Array, strength: float) -> Array:
    """Return where each joint, braking alone from q, dq at the catch, comes to rest [rad], (n,)."""
    rate = strength * arm.tau_max / np.diag(arm.mass_matrix(motion[0]))
    way: Array = motion[0] + motion[1] * (_GRASP + 0.5 * np.abs(motion[1]) / rate)
    return way
