"""Stops: of the safety filter in each tick, and the brake after the catch.

**In each tick**, whether the drives can stop the arm from a motion, and at which decelerations
(:func:`choose_stop`). All joints brake at once, each at a constant rate. The torque that this takes
is that of the model, gravity, coupling and Coriolis forces included, looked at so often on the way
to standstill that no joint turns by more than 0.2 rad in between. Where joints have a jerk limit,
the stop is that of :func:`mitt.core.control.envelope.slow_down`, looked at likewise
(:func:`share_of_smooth_stop`). A joint that has room brakes
gently, one that is short of it as hard as it must: the least that any stop within the ranges takes.
The torque is that of the arm with its load and without it: in between it is no larger, as it is
linear in the mass. So the deceleration that a joint is trusted with follows from the torque that is
left for it where the arm is, and is never a number of the arm alone. Constant rates keep their
promise by themselves: a tick further along such a stop, what is left of it is the stop that is
found there.

**After the catch** (:func:`plan_brake`), each joint brakes at its own rate, a share of
tau_max / M_kk, which builds up and lets go within ``ONSET``. The rates keep the torque of the whole
arm within its limits, looked at as above and where an acceleration begins or ends to change, and
end as far from any stop as can be. Where the limit set bounds acceleration or jerk, the brake is
the stop of the envelope itself, :func:`mitt.core.control.envelope.slow_down`: its own
decelerations, or a share of them for the torque.

| here      | meaning                                                                  | shape     |
|-----------|--------------------------------------------------------------------------|-----------|
| ``ends``  | lower and upper ends of the joints' ranges [rad]                         | (2, n)    |
| ``pieces``| start of a piece of constant jerk [s], q, dq, ddq and jerk there         | (n, p, 5) |
"""

from dataclasses import dataclass
from math import ceil
from typing import NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from mitt.core import checks
from mitt.core.arm.arm import Arm, Tables, trusted_deceleration
from mitt.core.arm.dynamics import bias_and_mass, dynamics_scratch, inverse_dynamics, slopes_work
from mitt.core.arm.limits import largest_share
from mitt.core.control.envelope import (
    LONGEST,
    bounds_of,
    brake_joint,
    masses_of,
    sampled_poses,
    slow_down,
    stop_in_ticks,
)
from mitt.core.errors import InputError
from mitt.core.fields import brief
from mitt.core.kernels import Record, copy, kernel
from mitt.core.signals import TICK, Array

#: Share of the torque limits that a stop may use; feedback needs the rest.
SHARE = 0.98

#: Kinds of stops that are tried: shares of the largest deceleration, then of the gentle one.
_HARD = (1.0, 0.7, 0.5, 0.35)
_MILD = (1.0, 0.5, 0.25)
#: Where trying begins: the hardest stop first, or the gentlest kinds, which mostly are possible.
HARDEST = 0
EASIEST = len(_HARD)
#: How many kinds there are.
_KINDS = len(_HARD) + len(_MILD)
#: Largest turn of a joint between two instants of a stop at which its torque is looked at [rad].
_TURN = 0.2
#: How far an acceleration may be from a straight line in between, where there is jerk; a share of
#: the deceleration.
_STRAIGHT = 0.02
#: How far before and after a joint's rest a stop at constant rates is looked at, in times of its
#: way there.
_BESIDE = 1e-9
#: Speed up to which a joint rests [rad/s]: the way there of a slower one is no time that counts.
_AT_REST = 1e-12
#: Most looks; a stop that takes more is not made.
_LOOKS = 100

#: Time in which a deceleration builds up [s].
ONSET = 0.002
#: Gap to the end of its range below which an ideal brake of one joint alone is short of room [rad].
_NEAR = 0.45
#: Halvings of the interval in which the hardest stop lies, and the interval: shares of the rate.
_HALVINGS = 5
_LEAST = 0.2
_MOST = 1.6
#: Shares of their own rate at which the other joints are tried.
_OTHERS = (0.05, 0.15, 0.4, 0.8, 1.2)


class StopWork(NamedTuple):
    """Scratch and result of :func:`choose_stop`."""

    rates: Array  # (n,) the decelerations that are found [rad/s^2]
    row: Array  # (3, n) q, dq, ddq at an instant
    after: Array  # (3, n) a tick later
    since: Array  # (3, n) of the last look: the turn since [rad], ddq, its change in a tick
    tau: Array  # (N,) torques
    speed: Array  # (N,) speeds of all links
    dynamics: Record


def stop_work(arm: Arm) -> StopWork:
    """Return scratch for :func:`choose_stop`."""
    n, links = arm.n, len(arm.bodies)
    return StopWork(
        rates=np.zeros(n),
        row=np.zeros((3, n)),
        after=np.zeros((3, n)),
        since=np.zeros((3, n)),
        tau=np.zeros(links),
        speed=np.zeros(links),
        dynamics=dynamics_scratch(links),
    )


def gentle_rates(arm: Arm, most: Array) -> Array:
    """Return decelerations that the torques bear in any of many poses, all joints at once, (n,).

    At least 2 % of the largest ones.

    Args:
        arm: The arm.
        most: Largest decelerations, in whose ratio they are [rad/s^2], shape (n,).
    """
    still, share = np.zeros(arm.n), 1.0
    for q, mass in zip(sampled_poses(arm), masses_of(arm), strict=True):
        left = SHARE * arm.tau_max - np.abs(arm.inverse_dynamics(q, still, still))
        share = min(share, float(np.min(left / (np.abs(mass) @ most))))
    out: Array = max(share, 0.02) * most
    return out


@kernel
def fit_rates(b: Record, motion: Array, rates: Array) -> None:
    """Raise decelerations to what the ranges take, and cut them to the trusted ones.

    A joint that is short of room ahead, or beyond its speed, brakes at its largest.
    """
    for k in range(len(rates)):
        q, dq, most = motion[0, k], motion[1, k], b[k].deceleration
        room = b[k].q_max - q if dq > 0.0 else q - b[k].q_min
        if 2.0 * room * most <= dq * dq or abs(dq) > b[k].dq_max:
            rates[k] = most
        else:
            rates[k] = min(max(rates[k], 0.5 * dq * dq / max(room, 1e-12)), most)


@kernel
def _write_rates(b: Record, motion: Array, kind: int, rates: Array) -> None:
    """Write the decelerations of one kind of stop; see :func:`choose_stop`."""
    for k in range(len(rates)):
        if kind < EASIEST:
            rates[k] = _HARD[kind] * b[k].deceleration
        else:
            rates[k] = _MILD[kind - EASIEST] * b[k].gentle
    fit_rates(b, motion, rates)


@kernel
def share_of_stop(arm: Tables, loaded: Record, motion: Array, w: StopWork) -> float:
    """Return the largest share of a drive's torque on the way to standstill at ``w.rates``.

    Of the arm with its load and without it, whichever takes more. It is looked at so often that no
    joint turns by more than ``_TURN`` in between, and just before and after each joint comes to
    rest, where it jumps. Infinite if that takes too many looks.
    """
    rates, t = w.rates, 0.0
    largest = _share_at(arm, loaded, motion, t, w)
    for _ in range(_LOOKS):
        fastest, rest = 0.0, np.inf
        for k in range(motion.shape[1]):
            speed = abs(motion[1, k]) - rates[k] * t
            if speed > _AT_REST:
                fastest, rest = max(fastest, speed), min(rest, abs(motion[1, k]) / rates[k])
        if fastest == 0.0:
            return float(largest)
        t += _TURN / fastest
        if t >= rest * (1.0 - _BESIDE):
            largest = max(largest, _share_at(arm, loaded, motion, rest * (1.0 - _BESIDE), w))
            t = rest * (1.0 + _BESIDE)
        largest = max(largest, _share_at(arm, loaded, motion, t, w))
    return np.inf


@kernel
def _share_at(arm: Tables, loaded: Record, motion: Array, t: float, w: StopWork) -> float:
    """Return the same of an instant of the stop, a time after its start [s]."""
    rates, row = w.rates, w.row
    for k in range(motion.shape[1]):
        fast = abs(motion[1, k])
        passed = min(t, fast / rates[k])
        row[0, k] = motion[0, k] + np.copysign(
            passed * (fast - 0.5 * rates[k] * passed), motion[1, k]
        )
        row[1, k] = np.copysign(max(fast - rates[k] * t, 0.0), motion[1, k])
        brakes = fast > 0.0 and rates[k] * t <= fast
        row[2, k] = -np.copysign(rates[k], motion[1, k]) if brakes else 0.0
    return float(_share_of(arm, loaded, row, w))


@kernel
def _share_of(arm: Tables, loaded: Record, row: Array, w: StopWork) -> float:
    """Return the same of a motion q, dq, ddq, shape (3, n)."""
    w.speed[:] = 0.0
    for k in range(row.shape[1]):
        w.speed[arm.active[k]] = row[1, k]
    inverse_dynamics(arm.bodies, row[0], row[1], row[2], w.tau, w.dynamics)
    alone = largest_share(arm.drives, w.tau, w.speed)
    inverse_dynamics(loaded, row[0], row[1], row[2], w.tau, w.dynamics)
    return float(max(alone, largest_share(arm.drives, w.tau, w.speed)))


@kernel
def share_of_smooth_stop(
    arm: Tables, loaded: Record, b: Record, motion: Array, w: StopWork
) -> float:
    """Return the largest share of a drive's torque on the way to standstill with a jerk limit.

    It is walked tick by tick, as :func:`mitt.core.control.envelope.slow_down` makes it, and looked
    at so often that in between no joint turns by more than ``_TURN``, and no acceleration is off a
    straight line by more than ``_STRAIGHT`` of its deceleration: the torque is linear in it.
    Infinite if it does not end.

    Args:
        arm: As of ``Arm.tables``, without a load.
        loaded: Its links with the load, as of ``Arm.bodies``, shape (N,).
        b: Limits, as of :mod:`mitt.core.control.viability`, shape (n,).
        motion: q, dq, ddq, shape (3, n).
        w: Scratch.
    """
    row, after, turned, largest, ticks = w.row, w.after, w.since[0], 0.0, 0
    copy(motion, row)
    turned[:] = np.inf  # the first tick is looked at
    for _ in range(LONGEST):
        if not np.any(row[1:]):
            return float(largest)
        slow_down(b, row, after)
        looks, ticks = False, ticks + 1
        for k in range(motion.shape[1]):
            turned[k] += abs(after[0, k] - row[0, k])
            off = abs(after[2, k] - w.since[1, k] - ticks * w.since[2, k])
            looks |= turned[k] > _TURN or off > _STRAIGHT * b[k].deceleration
        if looks:
            largest, ticks = max(largest, _share_of(arm, loaded, after, w)), 0
            for k in range(motion.shape[1]):
                turned[k], w.since[1, k], w.since[2, k] = 0.0, after[2, k], after[2, k] - row[2, k]
        copy(after, row)
    return np.inf


@kernel
def choose_stop(
    arm: Tables, loaded: Record, b: Record, motion: Array, first: int, w: StopWork
) -> float:
    """Find a stop that the drives can make; its decelerations are ``w.rates``.

    Args:
        arm: As of ``Arm.tables``, without a load.
        loaded: Its links with the load, as of ``Arm.bodies``, shape (N,).
        b: Limits, as of :mod:`mitt.core.control.viability`, shape (n,).
        motion: q, dq in the first two rows, shape (2 or more, n).
        first: Kind of stop that is tried first: ``HARDEST`` or ``EASIEST``.
        w: Scratch and result.

    Returns:
        The largest share of a drive's torque that it takes: of the first stop with at most
        ``SHARE``, or else of the one with the least.
    """
    least, best = np.inf, 0
    for i in range(_KINDS):
        kind = (i + first) % _KINDS
        _write_rates(b, motion, kind, w.rates)
        share = share_of_stop(arm, loaded, motion, w)
        if share <= SHARE:
            return float(share)
        if share < least:
            least, best = share, kind
    _write_rates(b, motion, best, w.rates)
    return float(least)


@kernel
def stop_by(b: Record, last: Array, rates: Array, desired: Array) -> None:
    """Let every joint brake at its own rate; as :func:`mitt.core.control.envelope.slow_down`.

    Joints that have a jerk limit brake at the largest deceleration, which their range rests on.
    """
    slow_down(b, last, desired)
    for k in range(desired.shape[1]):
        if np.isinf(b[k].jerk):
            q, dq, ddq = brake_joint(rates[k], last[0, k], last[1, k])
            desired[0, k], desired[1, k], desired[2, k] = q, dq, ddq


class MassWork(NamedTuple):
    """Scratch for the arm's mass matrix and bias."""

    tau: Array  # (N,)
    mass: Array  # (N, n)
    work: Record


def mass_work(arm: Arm) -> MassWork:
    """Return scratch for the mass matrix of an arm."""
    links = len(arm.bodies)
    return MassWork(np.zeros(links), np.zeros((links, arm.n)), slopes_work(links))


@kernel
def short_of_room(arm: Tables, limits: Array, motion: Array, w: MassWork) -> bool:
    """Say whether a joint, braking alone and at once, comes to rest near the end of its range.

    Args:
        arm: As of ``Arm.tables``.
        limits: Largest torques, lower and upper ends of the ranges, shape (3, n).
        motion: q, dq, ddq in the first three rows, shape (3 or more, n).
        w: Scratch.
    """
    index, (tau_max, q_min, q_max) = arm.active, (limits[0], limits[1], limits[2])
    bias_and_mass(arm.bodies, motion, w.tau, w.mass, w.work)
    for k in range(len(index)):
        v = motion[1, k]
        end = motion[0, k] + 0.5 * v * abs(v) * w.mass[index[k], k] / tau_max[k]
        if end > q_max[k] - _NEAR or end < q_min[k] + _NEAR:
            return True
    return False


@final
@dataclass(frozen=True, eq=False)
class Brake:
    """A stopping motion: constant-jerk pieces from a state to rest.

    Attributes:
        t: Time at which it starts [s].
        duration: Time to rest [s].
        pieces: Joint by joint, start of each piece after ``t`` [s], and q, dq, ddq and jerk there
            [rad ...], shape (n, k, 5): three and rest, or ticks.
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
        row: Array = rows_of(self, np.array([checks.number("t", t, finite=True)]))[0]
        return row

    def table(self, tick: float) -> Array:
        """Return q, dq, ddq each ``tick`` [s] from the start on, shape (k, 3, n).

        The last row is at rest.
        """
        tick = checks.number("tick", tick, least=1e-6, most=10.0)
        ticks = np.arange(ceil(self.duration / tick) + 2, dtype=np.float64)
        return rows_of(self, self.t + tick * ticks)

    @property
    def q_end(self) -> Array:
        """Where the arm comes to rest [rad], shape (n,)."""
        end: Array = rows_of(self, np.array([np.inf]))[0, 0]
        return end


def rows_of(brake: Brake, t: Array) -> Array:
    """Return q, dq, ddq of a brake at some times [s], (k,), shape (k, 3, n)."""
    after = np.minimum(np.maximum(t - brake.t, 0.0), brake.duration)
    out = np.empty((len(t), 3, len(brake.pieces)))
    sample(brake.pieces, after, out)
    return out


def plan_brake(arm: Arm, t: float, motion: Array) -> Brake:
    """Return the brake within the torque limits that ends farthest from any joint stop.

    Where none of those that are tried is within them, it is the one that takes the least torque.

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
    if np.abs(motion).max() > 1e6:
        raise InputError(
            "motion", "numbers of at most 1e+06", "larger ones", do="give rad, rad/s and rad/s^2"
        )
    if arm.limits.smooth:
        return _in_ticks(arm, t, motion, bounds_of(arm))
    rate = trusted_deceleration(arm, motion[0])
    urgent = int(np.argmax(_urgency(arm, motion, rate)))
    ends, w, tried = np.array([arm.q_min, arm.q_max]), stop_scratch(arm), []
    for others in _OTHERS:
        share = hardest(arm.tables, motion, rate, urgent, others, w)
        stop = Brake(t, lay(motion, w), w.pieces.copy(), float(share))
        tried.append((min(SHARE - share, 0.0), room(ends, stop.q_end), stop))
    return max(tried, key=lambda x: x[:2])[2]


def _urgency(arm: Arm, motion: Array, rate: Array) -> Array:
    """Return the share of the way to its stop that each joint needs to stop alone, (n,)."""
    way = motion[1] ** 2 / (2.0 * rate)
    left = np.where(motion[1] > 0.0, arm.q_max - motion[0], motion[0] - arm.q_min)
    out: Array = way / np.maximum(left, 1e-3)
    return out


class StopScratch(NamedTuple):
    """Buffers of the kernels for one arm; see the module's table."""

    pieces: Array
    at: NDArray[np.int64]  # (n,) the piece that each joint is in
    row: Array  # (3, n) q, dq, ddq at an instant
    rate: Array  # (n,) deceleration that is tried [rad/s^2]
    tau: Array  # (2, N) torques, and speeds of all links
    scratch: Record  # of the dynamics


def stop_scratch(arm: Arm) -> StopScratch:
    """Return buffers for an arm."""
    n, links = arm.n, len(arm.bodies)
    return StopScratch(
        pieces=np.zeros((n, 4, 5)),
        at=np.zeros(n, dtype=np.int64),
        row=np.zeros((3, n)),
        rate=np.zeros(n),
        tau=np.zeros((2, links)),
        scratch=dynamics_scratch(links),
    )


@kernel
def braking(v: float, a: float, rate: float) -> float:
    """Return the acceleration from which a stop goes on: what brakes already, up to its rate."""
    return min(max(a, -rate), rate) if v * a < 0.0 else 0.0


@kernel
def stop_of(q: float, v: float, a: float, rate: float, pieces: Array) -> float:
    """Write the fastest stop of one joint and return its time [s].

    Args:
        q: Angle at the start [rad].
        v: Speed there [rad/s].
        a: Acceleration there, of :func:`braking` [rad/s^2].
        rate: Largest deceleration [rad/s^2].
        pieces: Result, a joint's row of ``Scratch.pieces``, shape (4, 5).
    """
    jerk = rate / ONSET
    sign = -1.0 if v + 0.5 * a * abs(a) / jerk > 0.0 else 1.0
    need, push, hold = -sign * v, sign * a, 0.0
    peak = np.sqrt(max(jerk * need + 0.5 * push * push, 0.0))
    if peak > rate:
        hold = (need - (rate * rate - 0.5 * push * push) / jerk) / rate
        peak = rate
    times, t = (max((peak - push) / jerk, 0.0), hold, peak / jerk), 0.0
    for i in range(3):
        s, j = times[i], (1 - i) * sign * jerk
        p = pieces[i]
        p[0], p[1], p[2], p[3], p[4] = t, q, v, a, j
        q += s * (v + s * (0.5 * a + s * j / 6.0))
        v += s * (a + 0.5 * s * j)
        a += s * j
        t += s
    rest = pieces[3]
    rest[0], rest[1], rest[2], rest[3], rest[4] = t, q, 0.0, 0.0, 0.0
    return t


@kernel
def lay(motion: Array, w: StopScratch) -> float:
    """Write the stop at the decelerations ``w.rate``, and return its time [s].

    Args:
        motion: q, dq, ddq at the start, shape (3, n).
        w: Scratch and result: ``w.pieces``.
    """
    end = 0.0
    for k in range(len(w.rate)):
        q, v = motion[0, k], motion[1, k]
        a = braking(v, motion[2, k], w.rate[k])
        end = max(end, stop_of(q, v, a, w.rate[k], w.pieces[k]))
    return end


@kernel
def share_of_brake(arm: Tables, w: StopScratch, most: float) -> float:
    """Return the largest share of a drive's torque that the brake ``w.pieces`` asks for.

    It is looked at where a piece of any joint begins, and so often in between that no joint turns
    by more than ``_TURN``. Infinite if that takes too many looks.

    Args:
        arm: As of ``Arm.tables``, with what it holds.
        w: Scratch.
        most: A share above which the next ones do not matter.
    """
    pieces, row, tau, index, t, largest = w.pieces, w.row, w.tau, arm.active, 0.0, 0.0
    w.at[:] = 0
    for _ in range(_LOOKS + pieces.shape[0] * pieces.shape[1]):
        ahead, fastest = np.inf, 0.0
        for k in range(len(pieces)):
            while w.at[k] + 1 < pieces.shape[1] and pieces[k, w.at[k] + 1, 0] <= t:
                w.at[k] += 1
            row[0, k], row[1, k], row[2, k] = _along(pieces[k, w.at[k]], t)
            tau[1, index[k]] = row[1, k]
            fastest = max(fastest, abs(row[1, k]))
            if w.at[k] + 1 < pieces.shape[1]:
                ahead = min(ahead, pieces[k, w.at[k] + 1, 0])
        inverse_dynamics(arm.bodies, row[0], row[1], row[2], tau[0], w.scratch)
        largest = max(largest, largest_share(arm.drives, tau[0], tau[1]))
        if largest > most or np.isinf(ahead):
            return float(largest)
        t = ahead if fastest * (ahead - t) <= _TURN else t + _TURN / fastest
    return np.inf


@kernel
def hardest(
    arm: Tables, motion: Array, rate: Array, urgent: int, others: float, w: StopScratch
) -> float:
    """Find the hardest stop of the urgent joint with the others at a share of their rate.

    Args:
        arm: As of ``Arm.tables``.
        motion: q, dq, ddq at the start, shape (3, n).
        rate: Deceleration of each joint alone [rad/s^2], shape (n,).
        urgent: Index of the joint.
        others: The share.
        w: Scratch; ``w.rate`` and ``w.pieces`` are the answer.

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
        if share_of_brake(arm, w, SHARE) <= SHARE:
            low = middle
        else:
            high = middle
    w.rate[urgent] = low * rate[urgent]
    lay(motion, w)
    return float(share_of_brake(arm, w, np.inf))


@kernel
def room(ends: Array, q: Array) -> float:
    """Return the smallest gap to the end of a joint's range [rad]; ``ends`` as in the table."""
    least = np.inf
    for k in range(len(q)):
        least = min(least, ends[1, k] - q[k], q[k] - ends[0, k])
    return float(least)


def _in_ticks(arm: Arm, t: float, motion: Array, bounds: Record) -> Brake:
    """Return the hardest stop of the envelope that the torques bear, or the one with the least."""
    w, tried = stop_work(arm), list[Brake]()
    for share in _HARD:
        b, rows = bounds.copy(), np.empty((LONGEST, 3, arm.n))
        b["deceleration"] *= share
        ticks = stop_in_ticks(b, motion, rows)
        pieces = np.zeros((arm.n, ticks + 1, 5))
        pieces[:, :, 0] = TICK * np.arange(ticks + 1)
        pieces[:, :, 1:3] = rows[: ticks + 1, :2].transpose(2, 0, 1)
        pieces[:, :-1, 3] = rows[1 : ticks + 1, 2].T
        asked = float(share_of_smooth_stop(arm.tables, arm.bodies, b, motion, w))
        tried.append(Brake(t, TICK * ticks, pieces, asked))
        if asked <= SHARE:
            return tried[-1]
    return min(tried, key=lambda brake: brake.torque_share)


@kernel
def sample(pieces: Array, after: Array, out: Array) -> None:
    """Write q, dq, ddq, (K, 3, n), some times after the start [s], (K,); see the module's table."""
    for i in range(len(after)):
        for k in range(len(pieces)):
            p = 0
            while p + 1 < pieces.shape[1] and pieces[k, p + 1, 0] <= after[i]:
                p += 1
            out[i, 0, k], out[i, 1, k], out[i, 2, k] = _along(pieces[k, p], after[i])


@kernel
def _along(piece: Array, at: float) -> tuple[float, float, float]:
    """Return q, dq, ddq of a piece of constant jerk, (5,), a time after the brake's start [s]."""
    t, q, v, a, j = at - piece[0], piece[1], piece[2], piece[3], piece[4]
    return (
        q + t * (v + t * (a / 2.0 + t * j / 6.0)),
        v + t * (a + t * j / 2.0),
        a + t * j,
    )
