"""Computed torque with feedback: the arm follows the desired joint motion.

tau = M(q) (ddq_d + K_d (dq_d - dq) + K_p (q_d - q)) + H(q, dq) dq + g(q), eq. (14) inverted: with
an exact model the error of each joint obeys e'' + 2 w e' + w^2 e = 0 with w = ``bandwidth``.
"""

from dataclasses import dataclass, replace
from typing import final

import numpy as np
from numba import njit

from mitt.control.envelope import bound_acceleration, bounds_of, clip_motion
from mitt.robot.arm import Arm
from mitt.robot.limits import saturate
from mitt.signals import ArmState, Array, Command

#: Change of a torque that counts as meeting a limit [N m].
_TOUCH = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tracked:
    """A command, and whether a torque limit was met on the way to it."""

    command: Command
    saturated: bool


@final
class Tracker:
    """Tracking controller of one arm.

    Encoder readings that are not finite are replaced by the last that were.
    """

    def __init__(self, arm: Arm, *, bandwidth: float) -> None:
        """Take the arm and the bandwidth w of the error [rad/s]."""
        self.arm, self.bandwidth = arm, bandwidth
        self._bounds = bounds_of(arm)
        self._index = np.array(arm.model.active)
        self._speed = np.zeros(len(arm.model.links))
        self._known = ArmState(t=0.0, q=arm.q_ready, dq=np.zeros(arm.n))

    def believed(self, state: ArmState) -> ArmState:
        """Return the encoder readings, or the last that were finite in their place."""
        if not (all_finite(state.q) and all_finite(state.dq)):
            return replace(self._known, t=state.t)
        self._known = state
        return state

    def step(self, state: ArmState, wanted: Array, *, hand: float) -> Tracked:
        """Return the command for one tick.

        Args:
            state: Encoders.
            wanted: q_d, dq_d, ddq_d [rad, rad/s, rad/s^2], shape (3, n).
            hand: Closing angle of the fingers [rad].
        """
        state = self.believed(state)
        motion = np.empty((4, self.arm.n))
        _wish(self._bounds, self.bandwidth, state.q, state.dq, wanted, motion)
        asked = self.arm.torque(state.q, state.dq, motion[3])
        tau = np.empty(self.arm.n)
        packed = self.arm.limits.packed
        saturated = _allowed(packed, self._index, asked, state.dq, self._speed, tau)
        if saturated:
            tau = self._within(state, asked)
        command = Command(t=state.t, q=motion[0], dq=motion[1], ddq=motion[2], tau=tau, hand=hand)
        return Tracked(command=command, saturated=saturated)

    def _within(self, state: ArmState, asked: Array) -> Array:
        """Return torques within every limit that lead as far towards the wish as they can.

        Torques are cut along the line from those of coasting to those asked for, all joints by
        the same share: then each acceleration stays between coasting and the wish, which both
        respect the speed limits and the stops. Cutting joint by joint would let one joint's
        limit push another beyond its own.
        """
        arm, limits = self.arm, self.arm.limits
        coasting = np.zeros(arm.n)
        bound_acceleration(self._bounds, state.q, state.dq, coasting)
        rest = arm.torque(state.q, state.dq, coasting)
        share = _share(limits.packed, rest, asked, self._speed)
        return arm.active(limits.saturate(rest + share * (asked - rest), self._speed))


@njit(cache=True)
def _wish(b: Array, w: float, q: Array, dq: Array, wanted: Array, motion: Array) -> None:
    """Write the clipped motion, and in row 3 the acceleration to be realised.

    A joint of which anything wanted is not finite is wanted to stay where it is.
    """
    motion[:3] = wanted
    for k in range(len(q)):
        if not np.isfinite(wanted[0, k] + wanted[1, k] + wanted[2, k]):
            motion[0, k], motion[1, k], motion[2, k] = q[k], 0.0, 0.0
    clip_motion(b, motion)
    for k in range(len(q)):
        lag, slow = motion[0, k] - q[k], motion[1, k] - dq[k]
        motion[3, k] = motion[2, k] + 2.0 * w * slow + w * w * lag
    bound_acceleration(b, q, dq, motion[3])


@njit(cache=True)
def _allowed(
    packed: Array, index: Array, asked: Array, dq: Array, speed: Array, tau: Array
) -> bool:
    """Write the active joints' torques within every limit; say whether a limit was met."""
    for k in range(len(index)):
        speed[index[k]] = dq[k]
    kept = np.empty(len(asked))
    saturate(packed, asked, speed, kept)
    met = False
    for k in range(len(asked)):
        met |= abs(kept[k] - asked[k]) > _TOUCH
    for k in range(len(index)):
        tau[k] = kept[index[k]]
    return met


@njit(cache=True)
def all_finite(x: Array) -> bool:
    """Say whether every entry of a vector is a finite number."""
    for k in range(len(x)):  # noqa: SIM110 (compiled: a loop is the fast form)
        if not np.isfinite(x[k]):
            return False
    return True


@njit(cache=True)
def largest_gap(a: Array, b: Array) -> float:
    """Return the largest difference of two vectors' entries."""
    gap = 0.0
    for k in range(len(a)):
        gap = max(gap, abs(a[k] - b[k]))
    return gap


@njit(cache=True)
def _share(packed: Array, rest: Array, asked: Array, speed: Array) -> float:
    """Return the largest share of the way from ``rest`` to ``asked`` within every drive's peak."""
    n, share = len(rest), 1.0
    for m in range(n):
        start, way, dq = 0.0, 0.0, 0.0
        for k in range(n):
            start += packed[m, k] * rest[k]
            way += packed[m, k] * (asked[k] - rest[k])
            dq += packed[n + m, k] * speed[k]
        goal = start + way
        bound, stall = packed[2 * n, m], packed[2 * n + 1, m]
        if goal * dq > 0.0 and np.isfinite(stall):
            bound = min(bound, stall * max(1.0 - abs(dq) / packed[2 * n + 2, m], 0.0))
        if abs(goal) > bound:
            edge = np.copysign(bound, goal)
            share = min(share, max((edge - start) / way, 0.0)) if way * goal > 0.0 else 0.0
    return share
