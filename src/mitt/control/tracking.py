"""Computed torque with feedback: the arm follows the desired joint motion.

tau = M(q) (ddq_d + K_d (dq_d - dq) + K_p (q_d - q)) + H(q, dq) dq + g(q), eq. (14) inverted: with
an exact model the error of each joint obeys e'' + 2 w e' + w^2 e = 0 with w = ``bandwidth``.
"""

from dataclasses import dataclass, replace
from typing import final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mitt.control.envelope import bound_acceleration, bounds_of, clip_motion
from mitt.robot.arm import Arm
from mitt.robot.dynamics import inverse_dynamics
from mitt.robot.limits import saturate
from mitt.signals import ArmState, Array, Command

#: Change of a torque that counts as meeting a limit [N m].
_TOUCH = 1e-9
#: Numbers that the tracking notes of each link: four of its own, the rest of its dynamics.
NOTES = 22


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
        self._bounds, self._index = bounds_of(arm), np.array(arm.model.active)
        self._notes = np.zeros((len(arm.model.links), NOTES))
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
        told = np.empty((4, self.arm.n))
        saturated = track(
            self._bounds,
            self.bandwidth,
            self.arm.limits.packed,
            self.arm.bodies,
            self._index,
            state.q,
            state.dq,
            wanted,
            told,
            self._notes,
        )
        command = Command(
            t=state.t, q=told[0], dq=told[1], ddq=told[2], tau=told[3], hand=hand
        )
        return Tracked(command=command, saturated=saturated)


@njit(cache=True)
def track(
    bounds: Array,
    bandwidth: float,
    drives: Array,
    bodies: Array,
    index: NDArray[np.int64],
    q: Array,
    dq: Array,
    wanted: Array,
    told: Array,
    notes: Array,
) -> bool:
    """Write the command that follows a desired motion within every limit.

    Args:
        bounds: As of :func:`mitt.control.envelope.bounds_of`, shape (4, n).
        bandwidth: Bandwidth w of the error [rad/s].
        drives: ``Limits.packed``, shape (2 N + 3, N).
        bodies: Table of :mod:`mitt.robot.dynamics`, shape (N, 31).
        index: Active joints among the links, shape (n,).
        q: Encoders [rad], shape (n,).
        dq: Encoders [rad/s], shape (n,).
        wanted: q_d, dq_d, ddq_d, shape (3, n).
        told: Result: q, dq, ddq, tau of the active joints, shape (4, n).
        notes: Scratch, shape (N, NOTES).

    Returns:
        Whether a torque limit was met.
    """
    links = len(bodies)
    rows = notes.reshape(NOTES, links)
    asked, speed, kept, rest, more = rows[0], rows[1], rows[2], rows[3], rows[4:]
    motion, ddq = told[:3], told[3]
    _wish(bounds, bandwidth, q, dq, wanted, motion, ddq)
    scratch = more.reshape(links, NOTES - 4)
    inverse_dynamics(bodies, q, dq, ddq, asked, scratch)
    speed[:] = 0.0
    for k in range(len(index)):
        speed[index[k]] = dq[k]
    saturate(drives, asked, speed, kept)
    met = False
    for k in range(links):
        met |= abs(kept[k] - asked[k]) > _TOUCH
    if met:
        # Torques are cut along the line from those of coasting to those asked for, all joints by
        # the same share: then each acceleration stays between coasting and the wish, which both
        # respect the speed limits and the stops. Cutting joint by joint would let one joint's
        # limit push another beyond its own.
        ddq[:] = 0.0
        bound_acceleration(bounds, q, dq, ddq)
        inverse_dynamics(bodies, q, dq, ddq, rest, scratch)
        share = _share(drives, rest, asked, speed)
        for k in range(links):
            asked[k] = rest[k] + share * (asked[k] - rest[k])
        saturate(drives, asked, speed, kept)
    for k in range(len(index)):
        told[3, k] = kept[index[k]]
    return met


@njit(cache=True)
def _wish(
    b: Array, w: float, q: Array, dq: Array, wanted: Array, motion: Array, ddq: Array
) -> None:
    """Write the clipped motion, and the acceleration to be realised.

    A joint of which anything wanted is not finite is wanted to stay where it is.
    """
    for k in range(len(q)):
        if np.isfinite(wanted[0, k] + wanted[1, k] + wanted[2, k]):
            motion[0, k], motion[1, k], motion[2, k] = wanted[0, k], wanted[1, k], wanted[2, k]
        else:
            motion[0, k], motion[1, k], motion[2, k] = q[k], 0.0, 0.0
    clip_motion(b, motion)
    for k in range(len(q)):
        lag, slow = motion[0, k] - q[k], motion[1, k] - dq[k]
        ddq[k] = motion[2, k] + 2.0 * w * slow + w * w * lag
    bound_acceleration(b, q, dq, ddq)


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
