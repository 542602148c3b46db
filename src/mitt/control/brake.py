"""Braking after the catch: to rest as fast as the torques allow, by Ruckig's velocity interface.

Each joint brakes at its own constant rate, a share of tau_max / M_kk. The shares keep the torque
of the whole arm within its limits at seven instants of the way (between them up to 7 % more was
seen in 300 random states; the tracking saturates) and end as far from any stop as can be.
"""

from dataclasses import dataclass
from typing import final

import numpy as np
from ruckig import ControlInterface, InputParameter, Result, Ruckig, Synchronization, Trajectory

from mitt.robot.arm import Arm
from mitt.signals import Array

#: Share of the torque limits that braking may use; feedback needs the rest.
_SHARE = 0.98
#: Time in which a deceleration builds up [s].
_ONSET = 0.002
#: Instants at which the torque of a candidate is checked, and halvings of the interval.
_INSTANTS, _HALVINGS = 7, 5
#: Control tick [s].
_TICK = 0.001
#: Gap to a joint stop below which an ideal brake of one joint alone counts as short of room [rad].
_NEAR = 0.45
#: Shares of their own rate at which the joints brake that have room.
_OTHERS = (0.15, 0.4, 0.8, 1.2)


@final
@dataclass(frozen=True, eq=False)
class Brake:
    """A stopping motion: constant-jerk pieces from a state to rest.

    Attributes:
        t: Time at which it starts [s].
        trajectory: Ruckig's answer.
        torque_share: Largest share of a torque limit on the way.
    """

    t: float
    trajectory: Trajectory
    torque_share: float

    @property
    def duration(self) -> float:
        """Time to rest [s]."""
        return float(self.trajectory.duration)

    def over(self, t: float) -> bool:
        """Say whether the arm has been wanted at rest for a tick or more at time ``t`` [s]."""
        return t > self.t + self.duration + _TICK

    def at(self, t: float) -> Array:
        """Return q, dq, ddq at time ``t`` [rad ...], shape (3, n); at rest after the end."""
        after = min(max(t - self.t, 0.0), self.duration)
        return np.array(self.trajectory.at_time(after))

    @property
    def q_end(self) -> Array:
        """Where the arm comes to rest [rad], shape (n,)."""
        end: Array = self.at(np.inf)[0]
        return end


def plan_brake(arm: Arm, t: float, motion: Array) -> Brake:
    """Return the brake within the torque limits that ends farthest from any joint stop.

    Joints load one another, so the one that is short of room brakes as hard as the others'
    gentleness allows: a few rates of the others are tried, and for each the hardest of that one.

    Args:
        arm: The arm, with what it holds.
        t: Time at which to start [s].
        motion: q, dq, ddq at that time, shape (3, n).
    """
    rate = arm.tau_max / np.diag(arm.mass_matrix(motion[0]))
    urgent = int(np.argmax(_urgency(arm, motion, rate)))
    tried = [_hardest(arm, t, motion, rate=rate, urgent=urgent, others=x) for x in _OTHERS]
    return max(tried, key=lambda brake: (brake.torque_share <= 1.0, _room(arm, brake)))


def short_of_room(arm: Arm, motion: Array) -> bool:
    """Say whether a joint that moves so, q and dq in rows, stops close to the end of its range."""
    rate = arm.tau_max / np.diag(arm.mass_matrix(motion[0]))
    way = 0.5 * motion[1] * np.abs(motion[1]) / rate
    end = motion[0] + way
    return bool(np.any((end > arm.q_max - _NEAR) | (end < arm.q_min + _NEAR)))


def _urgency(arm: Arm, motion: Array, rate: Array) -> Array:
    """Return the share of the way to its stop that each joint needs to stop alone, (n,)."""
    way = motion[1] ** 2 / (2.0 * rate)
    left = np.where(motion[1] > 0.0, arm.q_max - motion[0], motion[0] - arm.q_min)
    out: Array = way / np.maximum(left, 1e-3)
    return out


def _room(arm: Arm, brake: Brake) -> float:
    """Return the smallest gap to a joint stop where the brake ends [rad]."""
    q = brake.q_end
    return float(np.min(np.minimum(arm.q_max - q, q - arm.q_min)))


def _hardest(
    arm: Arm, t: float, motion: Array, *, rate: Array, urgent: int, others: float
) -> Brake:
    """Return the hardest brake of the urgent joint with the others at a share of their rate."""
    share = np.full(arm.n, others)
    low, high = 0.2, 1.6
    share[urgent] = low
    best = _stop(arm, t, motion, share * rate)
    for _ in range(_HALVINGS):
        share[urgent] = 0.5 * (low + high)
        candidate = _stop(arm, t, motion, share * rate)
        if candidate.torque_share <= _SHARE:
            low, best = share[urgent], candidate
        else:
            high = share[urgent]
    return best


def _stop(arm: Arm, t: float, motion: Array, rate: Array) -> Brake:
    """Return the stop with given decelerations [rad/s^2], shape (n,), and its torque share."""
    braking = np.clip(motion[2], -rate, rate)
    request = InputParameter(arm.n)
    request.control_interface = ControlInterface.Velocity
    request.synchronization = Synchronization.No
    request.current_position = list(motion[0])
    request.current_velocity = list(motion[1])
    request.current_acceleration = list(np.where(motion[1] * motion[2] < 0.0, braking, 0.0))
    request.target_velocity = [0.0] * arm.n
    request.target_acceleration = [0.0] * arm.n
    request.max_acceleration = list(rate)
    request.max_jerk = list(rate / _ONSET)
    trajectory = Trajectory(arm.n)
    result = Ruckig(arm.n).calculate(request, trajectory)
    if result not in (Result.Working, Result.Finished):
        raise RuntimeError(f"Ruckig refused a stop from {motion.tolist()}: {result}")
    after = np.linspace(0.0, trajectory.duration, _INSTANTS, endpoint=False) + _ONSET
    rows = np.array([trajectory.at_time(min(x, trajectory.duration)) for x in after.tolist()])
    dq = np.zeros((_INSTANTS, len(arm.bodies)))
    dq[:, arm.model.active] = rows[:, 1]
    tau = arm.torques(rows)
    return Brake(t, trajectory, float(arm.limits.torque_ratio(tau, dq).max()))
