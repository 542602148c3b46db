"""What a joint motion demands of the arm: cost of eq. (22), and shares of its limits.

| here            | paper                                   | unit | shape   |
|-----------------|-----------------------------------------|------|---------|
| ``cost_torque`` | tau' K_tau tau, K_tau = 1/tau_max^2     | 1    | (K,)    |
| ``cost_speed``  | omega' K_omega omega, 1/omega_max^2     | 1    | (K,)    |
| ``torque``      | of each drive, :mod:`mitt.robot.limits`, (18) | 1 | (K, N) |
| ``speed``       | omega over its bound, (20)              | 1    | (K, N)  |
| ``excess``      | joint angle beyond its range            | rad  | (K, n)  |
| ``acceleration``| joint acceleration over its bound, if any| 1   | (K, n)  |
"""

from dataclasses import dataclass

import numpy as np

from mitt import fields
from mitt.jit import kernel
from mitt.robot.arm import Arm, Tables, trusted_deceleration
from mitt.robot.dynamics import dynamics_scratch, inverse_dynamics
from mitt.robot.limits import drive_asked, torque_share
from mitt.signals import Array

#: Time after the catch in which the hand closes and the arm still follows [s].
_GRASP = 0.012
#: Least and largest share that may be tolerated; an infinite one refuses nothing.
_TOLERANCES = {"torque": (1e-6, np.inf), "speed": (1e-6, np.inf), "acceleration": (1e-6, np.inf),
               "strength": (1e-6, 1e3)}  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Tolerance:
    """Share of each limit at which a throw is refused.

    By default more than 1: the envelope keeps the limits whatever is asked, and asking for too
    much for a short time costs some tracking error, mostly long before the catch, not the ball. Of
    24 wide throws 7 were refused at 1.25 and 1, and the same arm caught them all. The rivals refuse
    at the same share.

    Attributes:
        torque: Of what a drive can give.
        speed: Of a drive's largest speed.
        acceleration: Of a joint's largest acceleration, where the limit set has one.
        strength: Share of its torque with which each joint, after the catch, shall come to rest
            before the end of its range; None where that is not looked at.
    """

    torque: float = 1.6
    speed: float = 1.6
    acceleration: float = 1.6
    strength: float | None = None

    def __post_init__(self) -> None:
        """Refuse what cannot be; InputError names the field."""
        fields.check(self, _TOLERANCES)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Demand:
    """Demand of a motion at K instants; see the module's table."""

    cost_torque: Array
    cost_speed: Array
    torque: Array
    speed: Array
    excess: Array
    acceleration: Array

    @property
    def cost(self) -> float:
        """Mean of the two costs over the instants, eq. (22)."""
        return float(np.mean(self.cost_torque + self.cost_speed))


def demand(arm: Arm, motion: Array) -> Demand:
    """Return the demand of q, dq, ddq at K instants, shape (K, 3, n).

    The torque is eq. (14) at q = q_d, which is eq. (16) with M~, H~ and g~ of eq. (17); the
    speed is eq. (19); their shares of the limits are those of eqs. (18) and (20).
    """
    links, shape = len(arm.bodies), (len(motion), arm.n)
    cost, excess = np.empty((2, len(motion))), np.empty(shape)
    share = np.empty((2, len(motion), links))
    most = np.array([arm.q_min, arm.q_max, arm.dq_max, arm.tau_max])
    rows = np.ascontiguousarray(motion, dtype=np.float64)
    _reckon(
        arm.tables, most, rows, cost, share, excess, np.zeros((2, links)), dynamics_scratch(links)
    )
    return Demand(
        cost_torque=cost[0],
        cost_speed=cost[1],
        torque=share[0],
        speed=share[1],
        excess=excess,
        acceleration=acceleration_share(arm, motion[:, 2]),
    )


def acceleration_share(arm: Arm, ddq: Array) -> Array:
    """Return shares of the largest accelerations; 0 where the limit set has none.

    Args:
        arm: The arm.
        ddq: Accelerations of the active joints [rad/s^2], shape (..., n).
    """
    most = arm.limits.acceleration
    share: Array = np.zeros_like(ddq) if most is None else np.abs(ddq) / arm.active(most)
    return share


@kernel
def _reckon(
    arm: Tables, most: Array, motion: Array, cost: Array, share: Array, excess: Array,
    tau: Array, notes: Array,
) -> None:  # fmt: skip
    """Write the demand of a motion, the columns of the module's table.

    Args:
        arm: As of ``Arm.tables``.
        most: Ends of the ranges, largest speeds and torques of the joints, shape (4, n).
        motion: q, dq, ddq, shape (K, 3, n).
        cost: Of torque and of speed, shape (2, K).
        share: Of torque and of speed, shape (2, K, N).
        excess: Shape (K, n).
        tau: Scratch, zero, shape (2, N).
        notes: Scratch of the dynamics.
    """
    bodies, drives, index = arm
    top = drives[len(drives) - 1]
    for t in range(len(motion)):
        q, dq = motion[t, 0], motion[t, 1]
        inverse_dynamics(bodies, q, dq, motion[t, 2], tau[0], notes)
        cost[0, t], cost[1, t] = 0.0, 0.0
        for k in range(len(index)):
            tau[1, index[k]] = dq[k]
            cost[0, t] += (tau[0, index[k]] / most[3, k]) ** 2
            cost[1, t] += (dq[k] / most[2, k]) ** 2
            excess[t, k] = max(most[0, k] - q[k], q[k] - most[1, k], 0.0)
        for m in range(len(top)):
            drive, speed = drive_asked(drives, m, tau[0], tau[1])
            share[0, t, m] = torque_share(drives, m, drive, speed)
            share[1, t, m] = abs(speed) / top[m]


def shares_of(arm: Arm, motion: Array, tolerance: Tolerance) -> dict[str, float]:
    """Return the largest share of every limit of the active joints, in units of its tolerance.

    Args:
        arm: The arm.
        motion: q, dq, ddq at K instants, the last one at the catch, shape (K, 3, n).
        tolerance: Shares of torque, speed and acceleration that count as 1, and what the brake may
            use.

    Returns:
        ``torque:NAME``, ``speed:NAME``, ``range:NAME``, ``acceleration:NAME`` where the limit set
        bounds it and, where the tolerance asks for room to brake, ``brake:NAME`` for each joint.
    """
    demanded = demand(arm, motion)
    half, middle = 0.5 * (arm.q_max - arm.q_min), 0.5 * (arm.q_max + arm.q_min)
    torque, speed = arm.by_joint(
        np.array([demanded.torque.max(axis=0), demanded.speed.max(axis=0)])
    )
    kinds = {
        "torque": torque / tolerance.torque,
        "speed": speed / tolerance.speed,
        "range": (np.abs(motion[:, 0] - middle) / half).max(axis=0),
    }
    if arm.limits.acceleration is not None:
        kinds["acceleration"] = demanded.acceleration.max(axis=0) / tolerance.acceleration
    if tolerance.strength is not None:
        kinds["brake"] = np.abs(_rest(arm, motion[-1], tolerance.strength) - middle) / half
    return {
        f"{kind}:{name}": share
        for kind, values in kinds.items()
        for name, share in zip(arm.names, values.tolist(), strict=True)
    }


def _rest(arm: Arm, motion: Array, strength: float) -> Array:
    """Return where each joint, braking alone from q, dq at the catch, comes to rest [rad], (n,)."""
    rate = trusted_deceleration(arm, motion[0], strength)
    way: Array = motion[0] + motion[1] * (_GRASP + 0.5 * np.abs(motion[1]) / rate)
    return way
