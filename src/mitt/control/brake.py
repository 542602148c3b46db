"""Braking after the catch: to rest as fast as the torques allow, by Ruckig's velocity interface.

Each joint brakes at its own constant rate. The rates are the share of tau_max / M_kk that keeps
the torque of the whole arm within its limits along the whole way, found by halving intervals.
"""

from dataclasses import dataclass
from typing import final

import numpy as np
from ruckig import ControlInterface, InputParameter, Result, Ruckig, Synchronization, Trajectory

from mitt.robot.arm import Arm
from mitt.signals import Array

#: Share of the torque limits that braking may use; feedback needs the rest.
_SHARE = 0.9
#: Time in which a deceleration builds up [s].
_ONSET = 0.004
#: Instants at which the torque of a candidate is checked, and halvings of the interval.
_INSTANTS, _HALVINGS = 8, 5
#: Speed below which a joint counts as resting already [rad/s].
_REST = 1e-6


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
    """Return the fastest brake within the torque limits.

    Args:
        arm: The arm, with what it holds.
        t: Time at which to start [s].
        motion: q, dq, ddq at that time, shape (3, n).
    """
    rate = arm.tau_max / np.diag(arm.mass_matrix(motion[0]))
    low, high = 0.1, 2.0
    best = _stop(arm, t, motion, low * rate)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        candidate = _stop(arm, t, motion, middle * rate)
        if candidate.torque_share <= _SHARE:
            low, best = middle, candidate
        else:
            high = middle
    return best


def _stop(arm: Arm, t: float, motion: Array, rate: Array) -> Brake:
    """Return the stop with given decelerations [rad/s^2], shape (n,), and its torque share."""
    request = InputParameter(arm.n)
    request.control_interface = ControlInterface.Velocity
    request.synchronization = Synchronization.No
    request.current_position = list(motion[0])
    request.current_velocity = list(motion[1])
    request.current_acceleration = list(np.clip(motion[2], -rate, rate))
    request.target_velocity = [0.0] * arm.n
    request.target_acceleration = [0.0] * arm.n
    request.max_acceleration = list(rate)
    request.max_jerk = list(rate / _ONSET)
    trajectory = Trajectory(arm.n)
    result = Ruckig(arm.n).calculate(request, trajectory)
    if result not in (Result.Working, Result.Finished):
        raise RuntimeError(f"Ruckig refused a stop from {motion.tolist()}: {result}")
    share = 0.0
    for after in np.linspace(0.0, trajectory.duration, _INSTANTS, endpoint=False) + _ONSET:
        row = np.array(trajectory.at_time(min(float(after), trajectory.duration)))
        asked = arm.limits.torque_ratio(arm.torque(*row), arm.all_joints(row[1]))
        share = max(share, float(asked.max()))
    return Brake(t, trajectory, share)
