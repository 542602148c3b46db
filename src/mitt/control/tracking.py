"""Computed torque with feedback: the arm follows the desired joint motion.

tau = M(q) (ddq_d + K_d (dq_d - dq) + K_p (q_d - q)) + H(q, dq) dq + g(q), eq. (14) inverted: with
an exact model the error of each joint obeys e'' + 2 w e' + w^2 e = 0 with w = ``bandwidth``.
"""

from dataclasses import dataclass
from typing import final

import numpy as np
from numba import njit

from mitt.control.envelope import Bounds, bound_acceleration, bounds_of, clip_motion
from mitt.robot.arm import Arm
from mitt.signals import ArmState, Array, Command


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tracked:
    """A command and where its torque comes from.

    Attributes:
        command: What the arm is told.
        feedforward: Torque that the desired motion alone would take [N m], shape (n,).
        saturated: Whether a torque limit was met.
    """

    command: Command
    feedforward: Array
    saturated: bool


@final
class Tracker:
    """Tracking controller of one arm."""

    def __init__(self, arm: Arm, *, bandwidth: float) -> None:
        """Take the arm and the bandwidth w of the error [rad/s]."""
        self.arm, self.bandwidth = arm, bandwidth
        self._bounds = bounds_of(arm)

    def step(self, state: ArmState, wanted: Array, *, hand: float) -> Tracked:
        """Return the command for one tick.

        Args:
            state: Encoders.
            wanted: q_d, dq_d, ddq_d [rad, rad/s, rad/s^2], shape (3, n).
            hand: Closing angle of the fingers [rad].
        """
        motion = wanted.copy()
        ddq = np.empty(self.arm.n)
        _wish(self._bounds, self.bandwidth, state.q, state.dq, motion, ddq)
        asked = self.arm.torque(state.q, state.dq, ddq)
        allowed = self.arm.limits.saturate(asked, self.arm.all_joints(state.dq))
        command = Command(
            t=state.t,
            q=motion[0],
            dq=motion[1],
            ddq=motion[2],
            tau=self.arm.active(allowed),
            hand=hand,
        )
        return Tracked(
            command=command,
            feedforward=self.arm.inverse_dynamics(motion[0], motion[1], motion[2]),
            saturated=bool(np.any(np.abs(asked - allowed) > 1e-9)),
        )


@njit(cache=True)
def _wish(b: Bounds, w: float, q: Array, dq: Array, motion: Array, ddq: Array) -> None:
    """Clip the desired motion in place and write the acceleration to be realised."""
    clip_motion(b, motion)
    for k in range(len(q)):
        ddq[k] = motion[2, k] + 2.0 * w * (motion[1, k] - dq[k]) + w * w * (motion[0, k] - q[k])
    bound_acceleration(b, q, dq, ddq)
