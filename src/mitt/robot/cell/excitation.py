"""One short motion that shows how a robot follows, and what was sent and read while it was made.

Each joint swings about its ready pose by sines: slow ones turn what the arm carries, fast ones show
lag and delay. The frequencies differ from joint to joint, so that each can be told from the others.
"""

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple, final

import numpy as np

from mitt.core.arm.arm import Arm, trusted_deceleration
from mitt.core.control.envelope import bounds_of
from mitt.core.control.setpoints import ROWS
from mitt.core.signals import TICK, ArmState, Array, Command
from mitt.io.cell import Takes
from mitt.robot.cell.robot import Robot, RobotProxy

LASTS = 8.0
"""Length of the motion [s]."""
#: Frequencies of a joint's sines [Hz], and the speed of each [rad/s].
_FREQUENCIES = np.array([0.3, 2.0, 5.5, 8.5])
_SPEEDS = np.array([0.5, 0.15, 0.06, 0.04])
#: By how much the frequencies of a joint are above those of the joint before it, and the angle from
#: phase to phase [rad]: the golden one repeats latest.
_APART = 0.06
_PHASE = 2.399963
#: Time in which the sines swell, and die away [s].
_SWELLS = 1.0
#: Share of the way to the nearer end of a joint's range that it swings to, and of its limits of
#: speed, acceleration and jerk, and of the torques, that are used.
_WAY = 0.5
_SPEED = 0.5
_GENTLE = 0.3
_TORQUE = 0.7
#: Readings, and commands, that are kept.
_KEPT = 40_000


def excitation(arm: Arm, q: Array) -> Array:
    """Return q, dq, ddq each tick about a pose, from rest to rest, shape (k, 3, n).

    Args:
        arm: The arm.
        q: The pose [rad], shape (n,).
    """
    t = TICK * np.arange(round(LASTS / TICK) + 1, dtype=np.float64)
    way = np.stack([_swing(t, k) for k in range(arm.n)], axis=2)
    b = bounds_of(arm)
    gentle = _GENTLE * np.minimum(trusted_deceleration(arm, q), b["ddq_max"])
    room = np.minimum(q - b["q_min"], b["q_max"] - q)
    jerk = np.abs(np.diff(way[:, 2], axis=0)).max(axis=0) / TICK
    within = [
        _WAY * np.maximum(room, 0.0) / np.abs(way[:, 0]).max(axis=0),
        _SPEED * b["dq_max"] / np.abs(way[:, 1]).max(axis=0),
        gentle / np.abs(way[:, 2]).max(axis=0),
        _GENTLE * b["jerk"] / jerk,
    ]
    way *= np.minimum(np.min(within, axis=0), 1.0)
    still = np.array([q, np.zeros(arm.n), np.zeros(arm.n)])
    free = arm.tau_max - np.abs(arm.inverse_dynamics(*still))
    while True:
        asked = np.array([arm.inverse_dynamics(*row) for row in (still + way)[::10]])
        more = np.abs(asked - arm.inverse_dynamics(*still)).max(axis=0)
        if np.all(more <= _TORQUE * free) or np.abs(way).max() < 1e-3:
            break
        way *= 0.5
    out: Array = still + way
    return out


def _swing(t: Array, joint: int) -> Array:
    """Return the sines of a joint, their first and second derivative, shape (k, 3)."""
    x = np.clip(np.minimum(t, LASTS - t) / _SWELLS, 0.0, 1.0)
    rises = np.where(t < 0.5 * LASTS, 1.0, -1.0) / _SWELLS
    swell = x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
    d_swell = rises * 30.0 * x**2 * (1.0 - x) ** 2
    dd_swell = 60.0 * x * (1.0 - 3.0 * x + 2.0 * x**2) / _SWELLS**2
    w = 2.0 * np.pi * _FREQUENCIES * (1.0 + _APART * joint)
    angle = t[:, None] * w + _PHASE * (joint + np.arange(len(w)))
    y = np.sin(angle) @ (_SPEEDS / w)
    dy = np.cos(angle) @ _SPEEDS
    ddy = -np.sin(angle) @ (_SPEEDS * w)
    rows = (
        swell * y,
        d_swell * y + swell * dy,
        dd_swell * y + 2.0 * d_swell * dy + swell * ddy,
    )
    return np.stack(rows, axis=1)


class MotionLog(NamedTuple):
    """What a robot read and was sent, oldest first.

    Attributes:
        read: Stamps of the readings [s], shape (k,).
        q: Joint positions [rad], shape (k, n).
        sent: Stamps of the readings that the commands answer [s], shape (m,).
        told: What the drives were sent: torques [N m], speeds [rad/s] or positions [rad], (m, n).
    """

    read: Array
    q: Array
    sent: Array
    told: Array


@final
class NotedRobot(RobotProxy):
    """A robot of which readings and commands are noted as they pass."""

    def __init__(self, robot: Robot, takes: Takes) -> None:
        """Take the robot, and what its drives are commanded."""
        super().__init__(robot)
        self._row = ROWS[takes]
        self._read = deque[tuple[float, Array]](maxlen=_KEPT)
        self._sent = deque[tuple[float, Array]](maxlen=_KEPT)

    def log(self, begin: float, end: float) -> MotionLog:
        """Return what was noted between two stamps [s]."""
        read = [x for x in self._read if begin <= x[0] <= end and np.all(np.isfinite(x[1]))]
        sent = [x for x in self._sent if begin <= x[0] <= end]
        times = [np.array([x[0] for x in rows]) for rows in (read, sent)]
        values = [np.array([x[1] for x in rows]) for rows in (read, sent)]
        order = [np.unique(t, return_index=True)[1] for t in times]
        r, s = order
        return MotionLog(times[0][r], values[0][r], times[1][s], values[1][s])

    def read(self, timeout: float) -> Sequence[ArmState]:
        """Return the readings since the last call, and note them."""
        readings = self._robot.read(timeout)
        self._read.extend((x.t, np.array(x.q)) for x in readings or ())
        return readings

    def write(self, command: Command, answers: float) -> None:
        """Pass a command on, and note it."""
        self._robot.write(command, answers)
        self._sent.append((answers, np.array(command.joints[self._row])))
