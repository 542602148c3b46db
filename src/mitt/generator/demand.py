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
