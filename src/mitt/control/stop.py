"""Stops in closed form: each joint to rest at its own constant deceleration; compiled.

The deceleration builds up and lets go within ``ONSET``, as Ruckig's velocity interface does it;
Ruckig makes the brake that is driven, these kernels look for it.

| here      | meaning                                                                 | shape     |
|-----------|-------------------------------------------------------------------------|-----------|
| ``ends``  | lower and upper ends of the joints' ranges [rad]                        | (2, n)    |
| ``rows``  | q, dq, ddq at the instants at which the torque is looked at             | (7, 3, n) |
| ``last``  | q, dq, ddq at rest                                                      | (3, n)    |
| ``pieces``| start of a piece of constant jerk [s], q, dq, ddq and jerk there        | (n, p, 5) |
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mitt.jit import kernel
from mitt.robot.arm import Arm, Tables
from mitt.robot.dynamics import bias_and_mass, dynamics_scratch, inverse_dynamics
from mitt.robot.limits import largest_share
from mitt.signals import Array

#: Share of the torque limits that braking may use; feedback needs the rest.
SHARE = 0.98
#: Time in which a deceleration builds up [s].
ONSET = 0.002
#: Instants at which the torque of a stop is looked at.
INSTANTS = 7
#: Gap to the end of its range below which an ideal brake of one joint alone is short of room [rad].
_NEAR = 0.45
#: Halvings of the interval in which the hardest stop lies, and the interval: shares of the rate.
_HALVINGS, _LEAST, _MOST = 5, 0.2, 1.6


class Scratch(NamedTuple):
    """Buffers of the kernels for one arm; see the module's table."""

    rows: Array
    last: Array
    stops: Array  # (n, 5) acceleration at the start, signed jerk, times of its three pieces
    rate: Array  # (n,) deceleration that is tried [rad/s^2]
    tau: Array  # (2, N) torques, and speeds of all links
    scratch: Array  # of the dynamics


def scratch_of(arm: Arm) -> Scratch:
    """Return buffers for an arm."""
    n, links = arm.n, len(arm.bodies)
    return Scratch(
        rows=np.zeros((INSTANTS, 3, n)),
        last=np.zeros((3, n)),
        stops=np.zeros((n, 5)),
        rate=np.zeros(n),
        tau=np.zeros((2, links)),
        scratch=dynamics_scratch(links),
    )


@kernel
def braking(v: float, a: float, rate: float) -> float:
    """Return the acceleration from which a stop goes on: what brakes already, up to its rate."""
    return min(max(a, -rate), rate) if v * a < 0.0 else 0.0


@kernel
def stop_of(v: float, a: float, rate: float, stop: Array) -> float:
    """Write the fastest stop of one joint and return its time [s].

    Args:
        v: Speed at the start [rad/s].
        a: Acceleration then, of :func:`braking` [rad/s^2].
        rate: Largest deceleration [rad/s^2].
        stop: Row of ``Scratch.stops``, shape (5,).
    """
    jerk = rate / ONSET
    sign = -1.0 if v + 0.5 * a * abs(a) / jerk > 0.0 else 1.0
    need, push, hold = -sign * v, sign * a, 0.0
    peak = np.sqrt(max(jerk * need + 0.5 * push * push, 0.0))
    if peak > rate:
        hold = (need - (rate * rate - 0.5 * push * push) / jerk) / rate
        peak = rate
    rise, fall = max((peak - push) / jerk, 0.0), peak / jerk
    stop[0], stop[1], stop[2], stop[3], stop[4] = a, sign * jerk, rise, hold, fall
    return float(rise + hold + fall)


@kernel
def move_along(stop: Array, t: float, row: Array, k: int) -> None:
    """Carry joint k on along its stop for ``t`` [s], in place in ``row``, shape (3, n)."""
    q, v, a = row[0, k], row[1, k], stop[0]
    for i in range(3):
        s, j = min(t, stop[2 + i]), (1 - i) * stop[1]
        q += s * (v + s * (0.5 * a + s * j / 6.0))
        v += s * (a + 0.5 * s * j)
        a += s * j
        t -= s
    row[0, k], row[1, k], row[2, k] = q, v, a


@kernel
def lay(motion: Array, w: Scratch) -> None:
    """Write the stop at the decelerations ``w.rate``: ``w.rows`` and ``w.last``.

    Args:
        motion: q, dq, ddq at the start, shape (3, n).
        w: Scratch and result.
    """
    n, end = len(w.rate), 0.0
    for k in range(n):
        a = braking(motion[1, k], motion[2, k], w.rate[k])
        end = max(end, stop_of(motion[1, k], a, w.rate[k], w.stops[k]))
    for i in range(INSTANTS + 1):
        row = w.last if i == INSTANTS else w.rows[i]
        t = end if i == INSTANTS else instant(i, end)
        for k in range(n):
            row[0, k], row[1, k] = motion[0, k], motion[1, k]
            move_along(w.stops[k], t, row, k)


@kernel
def instant(i: int, duration: float) -> float:
    """Return when the torque of a stop is looked at for the i-th time [s]."""
    return float(min(i * (duration / INSTANTS) + ONSET, duration))


@kernel
def torque_share(arm: Tables, rows: Array, tau: Array, scratch: Array) -> float:
    """Return the largest share of a drive's torque that a motion asks for.

    Args:
        arm: As of ``Arm.tables``.
        rows: q, dq, ddq at K instants, shape (K, 3, n).
        tau: Scratch, zero in its second row where no joint is active, shape (2, N).
        scratch: Scratch of the dynamics, shape (N, 18).
    """
    bodies, drives, index = arm
    largest = 0.0
    for k in range(len(rows)):
        inverse_dynamics(bodies, rows[k, 0], rows[k, 1], rows[k, 2], tau[0], scratch)
        for i in range(len(index)):
            tau[1, index[i]] = rows[k, 1, i]
        largest = max(largest, largest_share(drives, tau[0], tau[1]))
    return largest


@kernel
def hardest(
    arm: Tables, motion: Array, rate: Array, urgent: int, others: float, w: Scratch
) -> float:
    """Find the hardest stop of the urgent joint with the others at a share of their rate.

    Args:
        arm: As of ``Arm.tables``.
        motion: q, dq, ddq at the start, shape (3, n).
        rate: Deceleration of each joint alone [rad/s^2], shape (n,).
        urgent: Index of the joint.
        others: The share.
        w: Scratch; ``w.rate`` and ``w.last`` are the answer.

    Returns:
        Largest share of a drive's torque on the way.
    """
    low, high = _LEAST, _MOST
    for k in range(len(rate)):
        w.rate[k] = others * rate[k]
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        w.rate[urgent] = middle * rate[urgent]
        lay(motion, w)
        if torque_share(arm, w.rows, w.tau, w.scratch) <= SHARE:
            low = middle
        else:
            high = middle
    w.rate[urgent] = low * rate[urgent]
    lay(motion, w)
    return float(torque_share(arm, w.rows, w.tau, w.scratch))


@kernel
def room(ends: Array, q: Array) -> float:
    """Return the smallest gap to the end of a joint's range [rad]; ``ends`` as in the table."""
    least = np.inf
    for k in range(len(q)):
        least = min(least, ends[1, k] - q[k], q[k] - ends[0, k])
    return float(least)


@kernel
def short_of_room(
    bodies: Array, index: NDArray[np.int64], most: Array, motion: Array,
    tau: Array, mass: Array, work: Array,
) -> bool:  # fmt: skip
    """Say whether a joint, braking alone and at once, comes to rest near the end of its range.

    Args:
        bodies: Table of :mod:`mitt.robot.dynamics`, shape (N, 31).
        index: Active joints among the links, shape (n,).
        most: Largest torques, lower and upper ends of the ranges, shape (3, n).
        motion: q, dq, ddq in the first three rows, shape (3 or more, n).
        tau: Scratch, shape (N,).
        mass: Scratch, shape (N, n).
        work: Scratch of :mod:`mitt.robot.dynamics`, shape (N, 46).
    """
    bias_and_mass(bodies, motion, tau, mass, work)
    for k in range(len(index)):
        v = motion[1, k]
        end = motion[0, k] + 0.5 * v * abs(v) * mass[index[k], k] / most[0, k]
        if end > most[2, k] - _NEAR or end < most[1, k] + _NEAR:
            return True
    return False


@kernel
def sample(pieces: Array, after: Array, out: Array) -> None:
    """Write q, dq, ddq, (K, 3, n), some times after the start [s], (K,); see the module's table."""
    for i in range(len(after)):
        for k in range(len(pieces)):
            p = 0
            while p + 1 < pieces.shape[1] and pieces[k, p + 1, 0] <= after[i]:
                p += 1
            t, q, v = after[i] - pieces[k, p, 0], pieces[k, p, 1], pieces[k, p, 2]
            a, j = pieces[k, p, 3], pieces[k, p, 4]
            out[i, 0, k] = q + t * (v + t * (a / 2.0 + t * j / 6.0))
            out[i, 1, k] = v + t * (a + t * j / 2.0)
            out[i, 2, k] = a + t * j
