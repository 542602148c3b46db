"""Braking after the catch: to rest as fast as the torques allow, by Ruckig's velocity interface.

Each joint brakes at its own constant rate, a share of tau_max / M_kk. The shares keep the torque
of the whole arm within its limits at seven instants of the way (between them up to 7 % more was
seen in 300 random states; the tracking saturates) and end as far from any stop as can be.
"""

from dataclasses import dataclass
from math import ceil
from typing import final

import numpy as np
from numba import njit
from numpy.typing import NDArray
from ruckig import ControlInterface, InputParameter, Result, Ruckig, Synchronization, Trajectory

from mitt.robot.arm import Arm
from mitt.robot.dynamics import inverse_dynamics, notes_of
from mitt.robot.limits import largest_share
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

    def table(self, tick: float) -> Array:
        """Return q, dq, ddq each ``tick`` [s] from the start on, shape (k, 3, n).

        The last row is at rest.
        """
        rows = self.t + tick * np.arange(ceil(self.duration / tick) + 2)
        after = np.minimum(np.maximum(rows - self.t, 0.0), self.duration)
        return np.array([self.trajectory.at_time(x) for x in after.tolist()])

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
    stops = _Stops(arm, t, motion)
    tried = [_hardest(stops, rate, urgent=urgent, others=x) for x in _OTHERS]
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


def _hardest(stops: "_Stops", rate: Array, *, urgent: int, others: float) -> Brake:
    """Return the hardest brake of the urgent joint with the others at a share of their rate."""
    share = np.full(len(rate), others)
    low, high = 0.2, 1.6
    share[urgent] = low
    best = stops.at(share * rate)
    for _ in range(_HALVINGS):
        share[urgent] = 0.5 * (low + high)
        candidate = stops.at(share * rate)
        if candidate.torque_share <= _SHARE:
            low, best = share[urgent], candidate
        else:
            high = share[urgent]
    return best


@final
class _Stops:
    """Stops of one arm from one state, to be compared."""

    def __init__(self, arm: Arm, t: float, motion: Array) -> None:
        """Take the arm, the time at which to start [s] and q, dq, ddq then, shape (3, n)."""
        self._t, self._motion, n = t, motion, arm.n
        self._ruckig, self._request = Ruckig(n), InputParameter(n)
        self._request.control_interface = ControlInterface.Velocity
        self._request.synchronization = Synchronization.No
        self._request.current_position = motion[0].tolist()
        self._request.current_velocity = motion[1].tolist()
        self._request.target_velocity = [0.0] * n
        self._request.target_acceleration = [0.0] * n
        self._slowing, links = (motion[1] * motion[2] < 0.0).tolist(), len(arm.bodies)
        self._braking: list[float] = motion[2].tolist()
        self._arm = arm.bodies, arm.limits.packed, np.array(arm.model.active)
        self._work = np.zeros((2, links)), notes_of(links)

    def at(self, rate: Array) -> Brake:
        """Return the stop with given decelerations [rad/s^2], shape (n,), and its torque share."""
        request, trajectory = self._request, Trajectory(len(rate))
        most = rate.tolist()  # plain numbers: three are too few for arrays to pay
        request.current_acceleration = [
            min(max(a, -x), x) if slows else 0.0
            for a, x, slows in zip(self._braking, most, self._slowing, strict=True)
        ]
        request.max_acceleration = most
        request.max_jerk = [x / _ONSET for x in most]
        result = self._ruckig.calculate(request, trajectory)
        if result not in (Result.Working, Result.Finished):
            raise RuntimeError(f"Ruckig refused a stop from {self._motion.tolist()}: {result}")
        end, pace = trajectory.duration, trajectory.duration / _INSTANTS
        after = [min(k * pace + _ONSET, end) for k in range(_INSTANTS)]
        rows = np.array([trajectory.at_time(x) for x in after])
        return Brake(self._t, trajectory, float(_torque_share(*self._arm, rows, *self._work)))


@njit(cache=True)
def _torque_share(
    bodies: Array, drives: Array, index: NDArray[np.int64], rows: Array, work: Array, notes: Array
) -> float:
    """Return the largest share of a drive's torque that a motion asks for.

    Args:
        bodies: Table of :mod:`mitt.robot.dynamics`, shape (N, 31).
        drives: ``Limits.packed``, shape (2 N + 3, N).
        index: Active joints among the links, shape (n,).
        rows: q, dq, ddq at K instants, shape (K, 3, n).
        work: Scratch, zero at entry, shape (2, N).
        notes: Scratch of the dynamics, shape (N, 18).
    """
    largest, tau, speed = 0.0, work[0], work[1]
    for k in range(len(rows)):
        inverse_dynamics(bodies, rows[k, 0], rows[k, 1], rows[k, 2], tau, notes)
        for i in range(len(index)):
            speed[index[i]] = rows[k, 1, i]
        largest = max(largest, largest_share(drives, tau, speed))
    return largest
