"""Safety filter and tracking of an arm as objects, for tests of their kernels."""

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.arm.shapes import Surroundings
from mitt.core.control.tracking import Tracked, track, tracking_of
from mitt.core.control.viability import safety_filter, safety_of
from mitt.core.kernels import Record
from mitt.core.signals import TICK, ArmState, Array, Command


class SafetyFilter:
    """The envelope of one arm, which is taken to rest in its ready pose."""

    def __init__(self, arm: Arm, around: Surroundings, load: float = 0.0) -> None:
        """Take the arm, what stands around it, and what it may take up [kg]."""
        self.safety = safety_of(arm, around, load)
        self.last = np.array([arm.q_ready, np.zeros(arm.n), np.zeros(arm.n)])

    @property
    def bounds(self) -> Record:
        """Limits of the joints."""
        return self.safety.bounds

    def begin(self, q: Array, dq: Array) -> None:
        """Start from where the arm is."""
        self.last[0], self.last[1], self.last[2] = q, dq, 0.0

    def step(self, desired: Array, estimated: Array | None = None) -> int:
        """Replace a desired motion, shape (3, n), by what is emitted.

        The arm is where it was commanded to be, or as estimated, shape (2, n).
        """
        at = self.last[:2].copy() if estimated is None else estimated
        return int(safety_filter(self.safety, self.last, desired, at))


class Tracker:
    """Tracking controller of one arm, with the envelope before it."""

    def __init__(
        self, arm: Arm, *, bandwidth: float, around: Surroundings | None = None, load: float = 0.0
    ) -> None:
        """Take the arm, the bandwidth of the error [rad/s], what is around, what it may take up."""
        self.arm, self.bandwidth = arm, bandwidth
        self.safety_filter = SafetyFilter(arm, around or Surroundings(), load)
        self._tracking = tracking_of(arm)

    def step(self, state: ArmState, desired: Array, *, hand: float) -> Tracked:
        """Return the command for one tick that is to follow a motion, shape (3, n)."""
        rows = np.zeros((4, self.arm.n))
        rows[:3] = desired
        estimated = np.array([state.q, state.dq])
        self.safety_filter.step(rows[:3], estimated)
        saturated = track(
            self._tracking,
            self.arm.tables,
            self.safety_filter.bounds,
            self.bandwidth,
            estimated,
            rows,
            TICK,
        )
        self._tracking.before[:] = rows[3]
        command = Command(t=state.t, joints=rows, hand=hand)
        return Tracked(command=command, saturated=saturated)
