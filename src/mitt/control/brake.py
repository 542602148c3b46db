"""Braking after the catch: to rest as fast as the torques allow, by Ruckig's velocity interface.

Each joint brakes at its own constant rate, a share of tau_max / M_kk. The shares keep the torque
of the whole arm within its limits at seven instants of the way (between them up to 7 % more was
seen in 300 random states; the tracking saturates) and end as far from any stop as can be. They are
searched for among stops in closed form (:mod:`mitt.control.stop`).

Where the limit set bounds acceleration or jerk, the brake is the stop of the envelope itself,
:func:`mitt.control.envelope.slow_down`: its own decelerations, or a share of them for the torque.
"""

from dataclasses import dataclass
from math import ceil
from typing import final

import numpy as np
from ruckig import ControlInterface, InputParameter, Result, Ruckig, Synchronization, Trajectory

from mitt import checks
from mitt.control.envelope import bounds_of, stop_in_ticks
from mitt.control.rows import DECELERATION
from mitt.control.stop import (
    INSTANTS,
    ONSET,
    SHARE,
    Scratch,
    braking,
    hardest,
    instant,
    room,
    sample,
    scratch_of,
    torque_share,
)
from mitt.errors import InputError
from mitt.fields import brief
from mitt.robot.arm import Arm, trusted_deceleration
from mitt.signals import TICK, Array

#: Shares of their own rate at which the joints brake that have room.
_OTHERS = (0.15, 0.4, 0.8, 1.2)
#: Rooms that differ by less count as the same until Ruckig has had its say [rad].
_SAME = 1e-9
#: Largest number of a motion that can be braked [rad ...].
_FASTEST = 1e6
#: Shares of the envelope's decelerations, and ticks that such a stop may take.
_SHARES, _LONGEST = (1.0, 0.7, 0.5, 0.35), 5000
#: Pieces of a joint's motion: seven of Ruckig's, and rest.
_PIECES = 8


@final
@dataclass(frozen=True, eq=False)
class Brake:
    """A stopping motion: constant-jerk pieces from a state to rest.

    Attributes:
        t: Time at which it starts [s].
        duration: Time to rest [s].
        pieces: Joint by joint, start of each piece after ``t`` [s], and q, dq, ddq and jerk there
            [rad ...], shape (n, k, 5): Ruckig's answer, or ticks.
        torque_share: Largest share of a torque limit on the way.
    """

    t: float
    duration: float
    pieces: Array
    torque_share: float

    __repr__ = brief

    def over(self, t: float) -> bool:
        """Say whether the arm has been commanded to rest for a tick or more at time ``t`` [s]."""
        return checks.number("t", t, finite=True) > self.t + self.duration + TICK

    def at(self, t: float) -> Array:
        """Return q, dq, ddq at time ``t`` [rad ...], shape (3, n); at rest after the end."""
        row: Array = self._sampled(np.array([checks.number("t", t, finite=True)]))[0]
        return row

    def table(self, tick: float) -> Array:
        """Return q, dq, ddq each ``tick`` [s] from the start on, shape (k, 3, n).

        The last row is at rest.
        """
        tick = checks.number("tick", tick, least=1e-6, most=10.0)
        ticks = np.arange(ceil(self.duration / tick) + 2, dtype=np.float64)
        return self._sampled(self.t + tick * ticks)

    @property
    def q_end(self) -> Array:
        """Where the arm comes to rest [rad], shape (n,)."""
        end: Array = self._sampled(np.array([np.inf]))[0, 0]
        return end

    def _sampled(self, t: Array) -> Array:
        """Return q, dq, ddq at some times [s], (k,), shape (k, 3, n)."""
        after = np.minimum(np.maximum(t - self.t, 0.0), self.duration)
        out = np.empty((len(t), 3, len(self.pieces)))
        sample(self.pieces, after, out)
        return out


def plan_brake(arm: Arm, t: float, motion: Array) -> Brake:
    """Return the brake within the torque limits that ends farthest from any joint stop.

    Joints load one another, so the one that is short of room brakes as hard as the others'
    gentleness allows: a few rates of the others are tried, and for each the hardest of that one.

    Args:
        arm: The arm, with what it holds.
        t: Time at which to start [s].
        motion: q, dq, ddq at that time, shape (3, n).

    Raises:
        InputError: An argument is not what it should be.
    """
    arm, t = checks.instance("arm", arm, Arm), checks.number("t", t, finite=True)
    motion = checks.array("motion", motion, (3, arm.n), finite=True)
    if np.abs(motion).max() > _FASTEST:
        raise InputError("motion", f"numbers of at most {_FASTEST:g}", "larger ones",
                         do="give rad, rad/s and rad/s^2")  # fmt: skip
    if arm.limits.smooth:
        return _in_ticks(arm, t, motion, bounds_of(arm))
    rate = trusted_deceleration(arm, motion[0])
    urgent = int(np.argmax(_urgency(arm, motion, rate)))
    ends, w = np.array([arm.q_min, arm.q_max]), scratch_of(arm)
    tried = []
    for others in _OTHERS:
        share = hardest(arm.tables, motion, rate, urgent, others, w)
        tried.append((share <= 1.0, room(ends, w.last[0]), w.rate.copy()))
    fits, most, _ = max(tried, key=lambda x: x[:2])
    best = [x for ok, left, x in tried if ok == fits and left > most - _SAME]
    stops = [_driven(arm, t, motion, x, w) for x in best]
    return max(stops, key=lambda brake: room(ends, brake.q_end))


def _in_ticks(arm: Arm, t: float, motion: Array, bounds: Array) -> Brake:
    """Return the hardest stop of the envelope that the torques bear, or the one with the least."""
    w, tried = scratch_of(arm), list[Brake]()
    for share in _SHARES:
        b, rows = bounds.copy(), np.empty((_LONGEST, 3, arm.n))
        b[DECELERATION] *= share
        ticks = stop_in_ticks(b, motion, rows)
        pieces = np.zeros((arm.n, ticks + 1, 5))
        pieces[:, :, 0] = TICK * np.arange(ticks + 1)
        pieces[:, :, 1:3] = rows[: ticks + 1, :2].transpose(2, 0, 1)
        pieces[:, :-1, 3] = rows[1 : ticks + 1, 2].T
        sample(pieces, np.linspace(0.0, TICK * ticks, INSTANTS), w.rows)
        asked = float(torque_share(arm.tables, w.rows, w.tau, w.scratch))
        tried.append(Brake(t, TICK * ticks, pieces, asked))
        if asked <= SHARE:
            return tried[-1]
    return min(tried, key=lambda brake: brake.torque_share)


def _urgency(arm: Arm, motion: Array, rate: Array) -> Array:
    """Return the share of the way to its stop that each joint needs to stop alone, (n,)."""
    way = motion[1] ** 2 / (2.0 * rate)
    left = np.where(motion[1] > 0.0, arm.q_max - motion[0], motion[0] - arm.q_min)
    out: Array = way / np.maximum(left, 1e-3)
    return out


def _driven(arm: Arm, t: float, motion: Array, rate: Array, w: Scratch) -> Brake:
    """Return Ruckig's stop with given decelerations [rad/s^2], shape (n,), and its torque share."""
    n = len(rate)
    request, trajectory = InputParameter(n), Trajectory(n)
    request.control_interface = ControlInterface.Velocity
    request.synchronization = Synchronization.No
    request.current_position, request.current_velocity = motion[0].tolist(), motion[1].tolist()
    rows = zip(motion[1].tolist(), motion[2].tolist(), rate.tolist(), strict=True)
    request.current_acceleration = [braking(*row) for row in rows]
    request.target_velocity = request.target_acceleration = [0.0] * n
    request.max_acceleration, request.max_jerk = rate.tolist(), (rate / ONSET).tolist()
    try:
        result = Ruckig(n).calculate(request, trajectory)
    except Exception as error:  # Ruckig's own
        raise InputError("motion", "one that can be braked", f"{error}"[:120]) from error
    if result not in (Result.Working, Result.Finished):
        raise InputError("motion", "one that can be braked", f"{motion.tolist()}: {result}")
    end, pieces = trajectory.duration, _pieces(trajectory)
    sample(pieces, np.array([instant(i, end) for i in range(INSTANTS)]), w.rows)
    return Brake(t, end, pieces, float(torque_share(arm.tables, w.rows, w.tau, w.scratch)))


def _pieces(trajectory: Trajectory) -> Array:
    """Return the pieces of a trajectory of one section, as in :mod:`mitt.control.stop`."""
    joints = trajectory.profiles[0]
    pieces = np.zeros((len(joints), _PIECES, 5))
    pieces[:, 1:, 0] = np.cumsum([joint.t for joint in joints], axis=1)
    rows = [(joint.p, joint.v, joint.a) for joint in joints]
    pieces[:, :, 1:4] = np.array(rows).transpose(0, 2, 1)
    pieces[:, :-1, 4] = [joint.j for joint in joints]
    return pieces
