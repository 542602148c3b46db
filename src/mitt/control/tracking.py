"""Computed torque with feedback: the arm follows the desired joint motion.

tau = M(q) (ddq_d + K_d (dq_d - dq) + K_p (q_d - q)) + H(q, dq) dq + g(q), eq. (14) inverted: with
an exact model the error of each joint obeys e'' + 2 w e' + w^2 e = 0 with w = ``bandwidth``.

A joint with a jerk limit closes in on its motion as :mod:`mitt.control.jerk` does. Where the limit
set has torque rates, the changes of all torques are cut by the same share, so that no joint's limit
pushes another.
"""

from dataclasses import dataclass, replace
from typing import final

import numpy as np
from numpy.typing import NDArray

from mitt import checks
from mitt.control.envelope import bound_acceleration
from mitt.control.jerk import closing_speed, releasable
from mitt.control.rows import DDQ, DDQ_BY_TAU, DDQ_MAX, DQ, JERK, ROWS, TAU, Q
from mitt.control.viability import SafetyFilter
from mitt.jit import kernel
from mitt.robot.arm import Arm
from mitt.robot.dynamics import inverse_dynamics
from mitt.robot.limits import bound_of, drive_asked, largest_share, saturate
from mitt.robot.shapes import Surroundings
from mitt.signals import TICK, ArmState, Array, Command
from mitt.views import view

#: Change of a torque that counts as meeting a limit [N m].
_TOUCH = 1e-9
#: Scratch numbers of each link: five of its own, the rest of its dynamics.
SCRATCH = 23


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tracked:
    """A command, and whether a torque limit was met on the way to it."""

    command: Command
    saturated: bool


@final
class Tracker:
    """Tracking controller of one arm, with the envelope before it.

    Encoder readings that are not finite are replaced by the last that were.
    """

    def __init__(self, arm: Arm, *, bandwidth: float, around: Surroundings | None = None) -> None:
        """Take the arm, the bandwidth w of the error [rad/s] and what stands around the arm."""
        self.arm = checks.instance("arm", arm, Arm)
        self.bandwidth = checks.number("bandwidth", bandwidth, least=1e-3, most=1e5)
        self.safety_filter = SafetyFilter(arm, around or Surroundings())
        self._index, self._slew = np.array(arm.model.active), slew_of(arm)
        self._scratch = np.zeros((len(arm.model.links), SCRATCH))
        self._known = ArmState(t=0.0, q=arm.q_ready, dq=np.zeros(arm.n))

    def last_finite(self, state: ArmState) -> ArmState:
        """Return the encoder readings, or the last that were finite in their place."""
        if not (all_finite(state.q) and all_finite(state.dq)):
            return replace(self._known, t=state.t)
        self._known = state
        return state

    def step(self, state: ArmState, desired: Array, *, hand: float) -> Tracked:
        """Return the command for one tick.

        Args:
            state: Encoders.
            desired: q_d, dq_d, ddq_d [rad, rad/s, rad/s^2], shape (3, n).
            hand: Closing angle of the fingers [rad].
        """
        n, state = self.arm.n, checks.instance("state", state, ArmState)
        checks.vector("state.q", state.q, n)
        hand = checks.number("hand", hand, finite=True)
        state = self.last_finite(state)
        rows = np.zeros((ROWS, n))
        rows[:3] = checks.array("desired", desired, (3, n))
        self.safety_filter.step(rows[:3])
        saturated = track(
            self.safety_filter.bounds,
            self.bandwidth,
            self.arm.limits.packed,
            self.arm.bodies,
            self._index,
            state.q,
            state.dq,
            rows,
            self._slew,
            self._scratch,
        )
        self._slew[1] = rows[TAU]
        command = Command(t=state.t, joints=rows[:4], hand=hand)
        return Tracked(command=command, saturated=saturated)


@kernel
def track(
    bounds: Array,
    bandwidth: float,
    drives: Array,
    bodies: Array,
    index: NDArray[np.int64],
    q: Array,
    dq: Array,
    command: Array,
    slew: Array,
    scratch: Array,
    passed: float = TICK,
) -> bool:
    """Write the torques that follow a motion within every limit.

    Args:
        bounds: As of :func:`mitt.control.envelope.bounds_of`, shape (>= 4, n).
        bandwidth: Bandwidth w of the error [rad/s].
        drives: ``Limits.packed``, shape (2 N + 3, N).
        bodies: Table of :mod:`mitt.robot.dynamics`, shape (N, 31).
        index: Active joints among the links, shape (n,).
        q: Encoders [rad], shape (n,).
        dq: Encoders [rad/s], shape (n,).
        command: q, dq, ddq as the envelope let them pass; result: tau of the active joints in the
            fourth row; the fifth is scratch, shape (ROWS, n).
        slew: As of :func:`slew_of`.
        scratch: Scratch, shape (N, SCRATCH).
        passed: Time since the torques before [s].

    Returns:
        Whether a torque limit was met.
    """
    links, n = len(bodies), len(index)
    tau_desired, speed = view(scratch, 0, (links,)), view(scratch, links, (links,))
    kept, push = view(scratch, 2 * links, (links,)), view(command, DDQ_BY_TAU * n, (n,))
    dynamics = view(scratch, 5 * links, (links, SCRATCH - 5))
    for k in range(n):
        lag, slow = command[Q, k] - q[k], command[DQ, k] - dq[k]
        push[k] = command[DDQ, k] + 2.0 * bandwidth * slow + bandwidth * bandwidth * lag
        if np.isfinite(bounds[JERK, k]):
            ddq_max, jerk = bounds[DDQ_MAX, k], bounds[JERK, k]
            gap = slow + closing_speed(lag, 0.5 * bandwidth, ddq_max, jerk)
            most = releasable(gap, jerk)
            push[k] = command[DDQ, k] + min(max(2.0 * bandwidth * gap, -most), most)
    bound_acceleration(bounds, q, dq, push)
    inverse_dynamics(bodies, q, dq, push, tau_desired, dynamics)
    speed[:] = 0.0
    for k in range(n):
        speed[index[k]] = dq[k]
    saturate(drives, tau_desired, speed, kept)
    met = False
    for k in range(links):
        met |= abs(kept[k] - tau_desired[k]) > _TOUCH
    if met:
        _give_way(bounds, drives, bodies, q, dq, command, scratch)
    for k in range(n):
        command[TAU, k] = kept[index[k]]
    return _change_slowly(slew, command[TAU], passed / TICK) or met


@kernel
def _change_slowly(slew: Array, tau: Array, ticks: float) -> bool:
    """Cut the changes of all torques by one share to what they may be; say whether it cut.

    Args:
        slew: As of :func:`slew_of`.
        tau: Torques of the active joints, overwritten [N m], shape (n,).
        ticks: Time since the torques before, in ticks.
    """
    share = 1.0
    for k in range(len(tau)):
        change, most = abs(tau[k] - slew[1, k]), ticks * slew[0, k]
        if change > most and np.isfinite(slew[1, k]):
            share = min(share, most / change)
    if share < 1.0:
        for k in range(len(tau)):
            tau[k] = slew[1, k] + share * (tau[k] - slew[1, k])
    return share < 1.0


def slew_of(arm: Arm) -> Array:
    """Return the largest changes of torques in a tick and the torques of the tick before [N m].

    The first are infinite where the limit set has no torque rates, the second before the first
    command.

    Args:
        arm: The arm, of n active joints.

    Returns:
        Shape (2, n).
    """
    slew, rate = np.full((2, arm.n), np.inf), arm.limits.torque_rate
    if rate is not None:
        slew[0] = arm.active(rate) * TICK
    return slew


@kernel
def _give_way(
    bounds: Array, drives: Array, bodies: Array, q: Array, dq: Array, command: Array, scratch: Array
) -> None:
    """Cut the torques of all joints by one share, towards what the arm does by itself at most.

    ``kept`` are those of which each drive gives what it can. They stay where the drives cannot even
    keep the speeds: beyond its no-load speed a drive that is to hold something gives nothing, and
    cut by one share the others would not brake either.
    """
    links, n = len(bodies), len(q)
    tau_desired, speed = view(scratch, 0, (links,)), view(scratch, links, (links,))
    kept, given = view(scratch, 2 * links, (links,)), view(scratch, 3 * links, (links,))
    dynamics, coast = view(scratch, 5 * links, (links, SCRATCH - 5)), view(command, TAU * n, (n,))
    coast[:] = 0.0
    bound_acceleration(bounds, q, dq, coast)
    inverse_dynamics(bodies, q, dq, coast, given, dynamics)
    if largest_share(drives, given, speed) <= 1.0:
        _cut(drives, given, tau_desired, speed, kept)
        return
    level = view(scratch, 4 * links, (links,))
    coast[:] = 0.0
    inverse_dynamics(bodies, q, dq, coast, level, dynamics)
    if largest_share(drives, level, speed) <= 1.0:
        _cut(drives, level, given, speed, kept)


@kernel
def _cut(drives: Array, rest: Array, tau_desired: Array, speed: Array, kept: Array) -> None:
    """Write torques within every limit that lead as far towards the desired ones as they can.

    Torques are cut along the line from those of coasting to the desired ones, all joints by the
    same share: then each acceleration stays between coasting and the desired one, which both
    respect the speed limits and the stops. Cutting joint by joint would let one joint's limit push
    another beyond its own. Where the torques cannot even keep coasting within the limits, the line
    leads there from constant speed.
    """
    share = _share(drives, rest, tau_desired, speed)
    for k in range(len(tau_desired)):
        tau_desired[k] = rest[k] + share * (tau_desired[k] - rest[k])
    saturate(drives, tau_desired, speed, kept)


def all_finite(x: Array) -> bool:
    """Say whether every entry of a vector is a finite number."""
    return bool(np.isfinite(x).all())


@kernel
def largest_gap(a: Array, b: Array) -> float:
    """Return the largest difference of two vectors' entries."""
    gap = 0.0
    for k in range(len(a)):
        gap = max(gap, abs(a[k] - b[k]))
    return gap


@kernel
def _share(packed: Array, rest: Array, tau_desired: Array, speed: Array) -> float:
    """Return how much of the way from ``rest`` to ``tau_desired`` is within all drives' peaks."""
    n, share = len(rest), 1.0
    for m in range(n):
        start, way = 0.0, 0.0
        for k in range(n):
            start += packed[m, k] * rest[k]
            way += packed[m, k] * (tau_desired[k] - rest[k])
        goal = start + way
        bound = bound_of(packed, m, goal, drive_asked(packed, m, tau_desired, speed)[1], 0.0)
        if abs(goal) > bound:
            edge = np.copysign(bound, goal)
            share = min(share, max((edge - start) / way, 0.0)) if way * goal > 0.0 else 0.0
    return share
