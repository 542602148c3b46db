"""Computed torque with feedback: the arm follows the desired joint motion.

tau = M(q) (ddq_d + K_d (dq_d - dq) + K_p (q_d - q)) + H(q, dq) dq + g(q), eq. (14) inverted: with
an exact model the error of each joint obeys e'' + 2 w e' + w^2 e = 0 with w = ``bandwidth``.

A joint with a jerk limit closes in on its motion as :mod:`mitt.core.control.envelope` says.

Where drives, or the rates of the torques that a limit set may have, do not allow that, what is left
of them beyond the commanded accelerations goes to the feedback of one joint after the other, from
the base outwards: a joint that asks for too much takes nothing from the motion that was certified.
Where the commanded accelerations are not to be had either, all joints are cut by the same share, so
that no joint's limit pushes another.

Near its no-load speed a motor's torque falls off to nothing, so what it may give depends on a speed
that nobody knows yet: the joints go on speeding up until the torque acts, their speeds are
estimated, and the ball strikes them. The torque-speed line is therefore taken at the largest speed
that a drive can have by then,

    w + max(w', 0) T + sum_k |T_k| (3 sigma_k + a_k T) + max(w_ball, 0),

all in the direction in which the drive turns (:func:`derate`): T is the time from the reading of
the joints until the command has acted, sigma_k the error of joint k's estimated speed, a_k the
acceleration that unknown torques can add. A line that is lower by a margin w_m is the line of a
drive whose stall torque and no-load speed are both smaller by the share w_m / w_0. While a joint is
not measured, the torques that hold what it moves are worked out from a place and a speed that are
not quite its own: every drive then keeps a share of its peak back.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mitt.core.arm.arm import Arm, Tables
from mitt.core.arm.dynamics import dynamics_scratch, inverse_dynamics
from mitt.core.arm.limits import LEAST, bound_of, drive_asked, drives_of, largest_share, saturate
from mitt.core.control.encoders import FINE, SIGMAS, Monitor
from mitt.core.control.envelope import bound_acceleration, closing_speed, releasable
from mitt.core.kernels import Record, copy, kernel
from mitt.core.signals import TICK, Array, Command

#: Share of its peak that a drive may give while a joint is not measured; the rest is for what a
#: wrong pose makes of the torques. The plant of a trial may exceed a limit by as much.
_UNMEASURED = 0.99
#: Torques that differ by less are one [N m].
_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tracked:
    """A command, and whether a torque limit was met on the way to it."""

    command: Command
    saturated: bool


class Tracking(NamedTuple):
    """What the tracking remembers of the torques, and its scratch.

    Attributes:
        drives: ``Limits.packed`` as it is to be kept now, shape (2 N + 3, N).
        change: Largest changes of the torques in a tick [N m]; infinite where the limit set has no
            torque rates, shape (n,).
        before: Torques of the tick before [N m]; infinite before the first command, shape (n,).
        push, coast: Accelerations, shape (n,).
        tau_desired, speed, kept, given, level: Torques and speeds of all links, shape (N,).
        dynamics: Of :func:`mitt.core.arm.dynamics.inverse_dynamics`.
    """

    drives: Array
    change: Array
    before: Array
    push: Array
    coast: Array
    tau_desired: Array
    speed: Array
    kept: Array
    given: Array
    level: Array
    dynamics: Record


def tracking_of(arm: Arm) -> Tracking:
    """Return what the tracking knows before the first command of an arm."""
    n, links, rate = arm.n, len(arm.bodies), arm.limits.torque_rate
    change = np.full(n, np.inf) if rate is None else arm.active(rate) * TICK
    return Tracking(
        drives=arm.limits.packed.copy(),
        change=change,
        before=np.full(n, np.inf),
        push=np.zeros(n),
        coast=np.zeros(n),
        tau_desired=np.zeros(links),
        speed=np.zeros(links),
        kept=np.zeros(links),
        given=np.zeros(links),
        level=np.zeros(links),
        dynamics=dynamics_scratch(links),
    )


@kernel
def derate(
    w: Tracking, arm: Tables, monitor: Monitor, dq: Array, jump: Array, lead: float, struck: bool
) -> None:
    """Write the drives with what is left of their torque-speed lines: ``w.drives``.

    Args:
        w: Result.
        arm: As of ``Arm.tables``.
        monitor: Of the encoders.
        dq: Estimated joint speeds [rad/s], shape (n,).
        jump: Change of the joint speeds by the ball, where it may come [rad/s], shape (n,).
        lead: T, from the reading of the joints until the command has acted [s].
        struck: Whether the ball may come before the command ceases to act.
    """
    index, joints, measured = arm.active, monitor.joints, True
    copy(arm.drives, w.drives)
    own, now = drives_of(arm.drives), drives_of(w.drives)
    for k in range(len(index)):
        measured &= joints[k].fault == FINE and joints[k].gone == 0.0
    for m in range(len(own.tau_peak)):
        now.tau_peak[m] *= 1.0 if measured else _UNMEASURED
        stall, top = own.tau_stall[m], own.dq_max[m]
        if not np.isfinite(stall):
            continue
        speed, rate, impact_dq, margin = 0.0, 0.0, 0.0, 0.0
        for k in range(len(index)):
            ratio = own.transmission[m, index[k]]
            speed += ratio * dq[k]
            rate += ratio * monitor.ddq_by_tau[k]
            impact_dq += ratio * jump[k]
            sigma = np.sqrt(max(joints[k].variance_dq, 0.0))
            margin += abs(ratio) * (SIGMAS * sigma + lead * joints[k].ddq_unknown)
        way = 1.0 if speed >= 0.0 else -1.0
        margin += lead * max(way * rate, 0.0) + (max(way * impact_dq, 0.0) if struck else 0.0)
        left = max(1.0 - margin / top, LEAST)
        now.tau_stall[m], now.dq_max[m] = left * stall, left * top


@kernel
def track(
    w: Tracking,
    arm: Tables,
    bounds: Record,
    bandwidth: float,
    estimated: Array,
    command: Array,
    passed: float,
) -> bool:
    """Write the torques that follow a motion within every limit.

    Args:
        w: Drives, torques before, scratch.
        arm: As of ``Arm.tables``.
        bounds: As of :func:`mitt.core.control.envelope.bounds_of`, shape (n,).
        bandwidth: Bandwidth w of the error [rad/s].
        estimated: q, dq of the joints [rad, rad/s], shape (2, n).
        command: q, dq, ddq as the envelope let them pass; result: tau of the active joints in the
            fourth row, shape (4, n).
        passed: Time since the torques before [s].

    Returns:
        Whether a torque limit was met.
    """
    bodies, index, q, dq, push = arm.bodies, arm.active, estimated[0], estimated[1], w.push
    links, n = len(bodies), len(index)
    for k in range(n):
        lag, slow = command[0, k] - q[k], command[1, k] - dq[k]
        push[k] = command[2, k] + 2.0 * bandwidth * slow + bandwidth * bandwidth * lag
        if np.isfinite(bounds[k].jerk):
            ddq_max, jerk = bounds[k].ddq_max, bounds[k].jerk
            gap = slow + closing_speed(lag, 0.5 * bandwidth, ddq_max, jerk)
            most = releasable(gap, jerk)
            push[k] = command[2, k] + min(max(2.0 * bandwidth * gap, -most), most)
    bound_acceleration(bounds, q, dq, push)
    inverse_dynamics(bodies, q, dq, push, w.tau_desired, w.dynamics)
    w.speed[:] = 0.0
    for k in range(n):
        w.speed[index[k]] = dq[k]
    saturate(w.drives, w.tau_desired, w.speed, w.kept)
    met, ticks = False, passed / TICK
    for k in range(links):
        met |= abs(w.kept[k] - w.tau_desired[k]) > _ROUNDING
    met |= not _slow_enough(w, index, w.kept, ticks)
    if met:
        found = _give_way(w, arm, bounds, estimated, command[2], ticks)
        if not found and not _give_way(w, arm, bounds, estimated, command[2], np.inf):
            _keep_speed(w, arm, q, dq)
    for k in range(n):
        command[3, k] = w.kept[index[k]]
    _change_slowly(w, command[3], ticks)
    return met


@kernel
def _slow_enough(w: Tracking, index: Array, tau: Array, ticks: float) -> bool:
    """Say whether torques of all links change by no more than their rates allow in so many ticks.

    ``index`` are the active joints, shape (n,).
    """
    for k in range(len(index)):
        change = abs(tau[index[k]] - w.before[k])
        if change > ticks * w.change[k] and np.isfinite(w.before[k]):
            return False
    return True


@kernel
def _change_slowly(w: Tracking, tau: Array, ticks: float) -> None:
    """Cut the changes of all torques in so many ticks by one share, to what their rates allow."""
    share = 1.0
    for k in range(len(tau)):
        change, most = abs(tau[k] - w.before[k]), ticks * w.change[k]
        if change > most and np.isfinite(w.before[k]):
            share = min(share, most / change)
    if share < 1.0:
        for k in range(len(tau)):
            tau[k] = w.before[k] + share * (tau[k] - w.before[k])


@kernel
def _give_way(
    w: Tracking, arm: Tables, bounds: Record, estimated: Array, ddq: Array, ticks: float
) -> bool:
    """Cut torques towards those of the commanded accelerations, else of what the arm does alone.

    So a joint that lags behind, and asks for more than its drive has, takes nothing from the
    braking that was certified; and from the feedback of the others no more than it has to.
    ``w.kept`` are those of which each drive gives what it can, and which change in so many ticks
    as slowly as their rates ask.

    Returns:
        Whether the drives have either; else nothing has changed.
    """
    coast, q, dq = w.coast, estimated[0], estimated[1]
    for way in range(2):
        for k in range(len(coast)):
            coast[k] = ddq[k] if way == 0 else 0.0
        bound_acceleration(bounds, q, dq, coast)
        inverse_dynamics(arm.bodies, q, dq, coast, w.given, w.dynamics)
        within = largest_share(w.drives, w.given, w.speed) <= 1.0
        if within and _slow_enough(w, arm.active, w.given, ticks):
            share = _cut(w, arm.active, w.given, w.tau_desired, ticks)
            for k in range(len(coast)):
                coast[k] += share * (w.push[k] - coast[k])
            _lead_each(w, arm, q, dq, ticks)
            return True
    return False


@kernel
def _lead_each(w: Tracking, arm: Tables, q: Array, dq: Array, ticks: float) -> None:
    """Lead joint after joint from ``w.coast`` to its desired acceleration, as far as drives allow.

    From the base outwards. ``w.tau_desired`` are the torques on the way, from those of ``w.coast``
    on.
    """
    coast, tau = w.coast, w.tau_desired
    for k in range(len(coast)):
        before, coast[k] = coast[k], w.push[k]
        inverse_dynamics(arm.bodies, q, dq, coast, w.level, w.dynamics)
        share = _cut(w, arm.active, tau, w.level, ticks)
        coast[k] = before + share * (w.push[k] - before)
        copy(w.level, tau)
    saturate(w.drives, tau, w.speed, w.kept)


@kernel
def _keep_speed(w: Tracking, arm: Tables, q: Array, dq: Array) -> None:
    """Lead from constant speed towards the torques of coasting, which the drives do not have.

    Those stay of which each drive gives what it can where the drives cannot even keep the speeds:
    beyond its no-load speed a drive that is to hold something gives nothing, and cut by one share
    the others would not brake either.
    """
    w.coast[:] = 0.0
    inverse_dynamics(arm.bodies, q, dq, w.coast, w.level, w.dynamics)
    if largest_share(w.drives, w.level, w.speed) <= 1.0:
        _cut(w, arm.active, w.level, w.given, np.inf)
        saturate(w.drives, w.given, w.speed, w.kept)


@kernel
def _cut(w: Tracking, index: Array, rest: Array, tau_desired: Array, ticks: float) -> float:
    """Lead torques within every limit as far to the desired ones as they can; return the share.

    Torques are cut along the line from ``rest`` to the desired ones, all joints by the same share:
    then each acceleration stays between these, which both respect the speed limits and the stops.
    Cutting torques joint by joint would let one joint's limit push another beyond its own.
    """
    n, share, packed = len(rest), 1.0, w.drives
    for m in range(n):
        start, way = 0.0, 0.0
        for k in range(n):
            start += packed[m, k] * rest[k]
            way += packed[m, k] * (tau_desired[k] - rest[k])
        goal = start + way
        bound = bound_of(packed, m, goal, drive_asked(packed, m, tau_desired, w.speed)[1], 0.0)
        share = min(share, _share(start, goal, bound))
    for k in range(len(index)):
        if np.isfinite(w.before[k]):
            start, goal = rest[index[k]] - w.before[k], tau_desired[index[k]] - w.before[k]
            share = min(share, _share(start, goal, ticks * w.change[k]))
    for k in range(n):
        tau_desired[k] = rest[k] + share * (tau_desired[k] - rest[k])
    return share


@kernel
def _share(start: float, goal: float, bound: float) -> float:
    """Return how much of the way from ``start`` to ``goal`` is within a bound on the size."""
    way = goal - start
    if not abs(goal) > bound + _ROUNDING:
        return 1.0
    return max((np.copysign(bound, goal) - start) / way, 0.0) if way * goal > 0.0 else 0.0


@kernel
def largest_gap(a: Array, b: Array) -> float:
    """Return the largest difference of two vectors' entries."""
    gap = 0.0
    for k in range(len(a)):
        gap = max(gap, abs(a[k] - b[k]))
    return gap
