"""Whether the drives can stop the arm from a motion, and at which decelerations.

All joints brake at once, each at a constant rate. The torque that this takes is that of the model,
gravity, coupling and Coriolis forces included, at ``INSTANTS`` of the way to standstill. A joint
that has room brakes gently, one that is short of it as hard as it must: the least that any stop
within the ranges takes. So the deceleration that a joint is trusted with follows from the torque
that is left for it where the arm is, and is never a number of the arm alone.

Constant rates keep their promise by themselves: a tick further along such a stop, what is left of
it is the stop that is found there.
"""

import numpy as np
from numpy.typing import NDArray

from mitt.control.envelope import brake_joint, masses_of, poses_of, slow_down
from mitt.control.rows import DECELERATION, DQ_MAX, GENTLE, JERK, Q_MAX, Q_MIN
from mitt.jit import kernel
from mitt.robot.arm import Arm
from mitt.robot.dynamics import dynamics_scratch, inverse_dynamics
from mitt.robot.limits import largest_share
from mitt.signals import Array
from mitt.views import view

#: Share of the drives' torques that a stop may take; feedback needs the rest.
SHARE = 0.98
#: Instants of a stop at which its torque is looked at, its end included.
INSTANTS = 5

#: Kinds of stops that are tried: shares of the largest deceleration, then of the gentle one.
_HARD, _MILD = (1.0, 0.7, 0.5, 0.35), (1.0, 0.5, 0.25)
#: Where trying begins: the hardest stop first, or the gentlest kinds, which mostly are possible.
HARDEST, EASIEST = 0, len(_HARD)
#: Share of the largest deceleration that gentle rates are at least, in whatever pose.
_LEAST = 0.02


def gentle_rates(arm: Arm, most: Array) -> Array:
    """Return decelerations that the torques bear in any of many poses, all joints at once, (n,).

    Args:
        arm: The arm.
        most: Largest decelerations, in whose ratio they are [rad/s^2], shape (n,).
    """
    still, share = np.zeros(arm.n), 1.0
    for q, mass in zip(poses_of(arm), masses_of(arm), strict=True):
        left = SHARE * arm.tau_max - np.abs(arm.inverse_dynamics(q, still, still))
        share = min(share, float(np.min(left / (np.abs(mass) @ most))))
    out: Array = max(share, _LEAST) * most
    return out


def reserve_work(arm: Arm) -> Array:
    """Return scratch for :func:`choose_stop`."""
    links = len(arm.bodies)
    return np.zeros(4 * arm.n + 2 * links + dynamics_scratch(links).size)


#: How far before and after a joint's rest its torque is looked at, in times of its way there.
_BESIDE = 1e-9


@kernel
def _rates(b: Array, motion: Array, kind: int, rates: Array) -> None:
    """Write the decelerations of one kind of stop; see :func:`choose_stop`.

    A joint that is beyond its speed, or short of room ahead, brakes at its largest.
    """
    for k in range(len(rates)):
        q, dq, most = motion[0, k], motion[1, k], b[DECELERATION, k]
        base = _HARD[kind] * most if kind < EASIEST else _MILD[kind - EASIEST] * b[GENTLE, k]
        room = b[Q_MAX, k] - q if dq > 0.0 else q - b[Q_MIN, k]
        if abs(dq) > b[DQ_MAX, k] or 2.0 * room * most <= dq * dq:
            rates[k] = most
        else:
            rates[k] = min(max(base, 0.5 * dq * dq / max(room, 1e-12)), most)


@kernel
def _share_of_stop(
    bodies: Array, drives: Array, index: NDArray[np.int64], motion: Array, rates: Array, work: Array
) -> float:
    """Return the largest share of a drive's torque on the way to standstill.

    It jumps when a joint comes to rest: just before and just after are looked at for each joint,
    besides instants in equal steps.
    """
    n, links = len(rates), len(bodies)
    row, tau = view(work, n, (3, n)), view(work, 4 * n, (links,))
    speed = view(work, 4 * n + links, (links,))
    scratch = view(work, 4 * n + 2 * links, (links, 18))
    end, largest = 0.0, 0.0
    for k in range(n):
        end = max(end, abs(motion[1, k]) / rates[k])
    speed[:] = 0.0
    for i in range(INSTANTS + 2 * n):
        if i < INSTANTS:
            t = end * i / (INSTANTS - 1)
        else:
            k, before = (i - INSTANTS) // 2, (i - INSTANTS) % 2 == 0
            t = abs(motion[1, k]) / rates[k] * (1.0 - _BESIDE if before else 1.0 + _BESIDE)
        for k in range(n):
            fast = abs(motion[1, k])
            passed = min(t, fast / rates[k])
            row[0, k] = motion[0, k] + np.copysign(
                passed * (fast - 0.5 * rates[k] * passed), motion[1, k]
            )
            row[1, k] = np.copysign(max(fast - rates[k] * t, 0.0), motion[1, k])
            brakes = fast > 0.0 and rates[k] * t <= fast
            row[2, k] = -np.copysign(rates[k], motion[1, k]) if brakes else 0.0
            speed[index[k]] = row[1, k]
        inverse_dynamics(bodies, row[0], row[1], row[2], tau, scratch)
        largest = max(largest, largest_share(drives, tau, speed))
    return largest


@kernel
def choose_stop(
    bodies: Array,
    drives: Array,
    index: NDArray[np.int64],
    b: Array,
    motion: Array,
    first: int,
    work: Array,
) -> float:
    """Find a stop that the drives can make; its decelerations are the first n numbers of ``work``.

    Args:
        bodies: Table of :mod:`mitt.robot.dynamics`, shape (N, 31).
        drives: ``Limits.packed``, shape (2 N + 3, N).
        index: Active joints among the links, shape (n,).
        b: Limits, as of :mod:`mitt.control.viability`, shape (8, n).
        motion: q, dq in the first two rows, shape (2 or more, n).
        first: Kind of stop that is tried first: ``HARDEST`` or ``EASIEST``.
        work: Of :func:`reserve_work`.

    Returns:
        The largest share of a drive's torque that it takes: of the first stop with at most
        ``SHARE``, or else of the one with the least.
    """
    n, kinds = motion.shape[1], len(_HARD) + len(_MILD)
    rates, least, best = view(work, 0, (n,)), np.inf, 0
    for i in range(kinds):
        kind = (i + first) % kinds
        _rates(b, motion, kind, rates)
        share = _share_of_stop(bodies, drives, index, motion, rates, work)
        if share <= SHARE:
            return float(share)
        if share < least:
            least, best = share, kind
    _rates(b, motion, best, rates)
    return float(least)


@kernel
def stop_by(b: Array, last: Array, rates: Array, desired: Array) -> None:
    """Let every joint brake at its own rate; as :func:`mitt.control.envelope.slow_down`.

    Joints that have a jerk limit brake at the largest deceleration, which their range rests on.
    """
    slow_down(b, last, desired)
    for k in range(desired.shape[1]):
        if np.isinf(b[JERK, k]):
            q, dq, ddq = brake_joint(rates[k], last[0, k], last[1, k])
            desired[0, k], desired[1, k], desired[2, k] = q, dq, ddq


@kernel
def clamp_to_reserve(
    bodies: Array,
    drives: Array,
    index: NDArray[np.int64],
    b: Array,
    last: Array,
    desired: Array,
    work: Array,
) -> bool:
    """Replace a motion that the drives could not stop any more by braking; say whether it was.

    One that takes no more torque to stop than the last motion does may pass in any case: it leads
    out of a state in which the arm should not have been.

    Args:
        bodies: As for :func:`choose_stop`.
        drives: As for :func:`choose_stop`.
        index: As for :func:`choose_stop`.
        b: As for :func:`choose_stop`.
        last: q, dq, ddq emitted in the tick before, shape (3, n).
        desired: q, dq, ddq, shape (3, n).
        work: Scratch.
    """
    moves = False
    for k in range(desired.shape[1]):
        moves |= desired[1, k] != 0.0
    if not moves:
        return False
    share = choose_stop(bodies, drives, index, b, desired, EASIEST, work)
    if share <= SHARE or share <= choose_stop(bodies, drives, index, b, last, EASIEST, work):
        return False
    stop_by(b, last, view(work, 0, (desired.shape[1],)), desired)
    return True
