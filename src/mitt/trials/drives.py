"""What the drives of a trial gave, those that hold a still joint included; compiled.

A held joint stands still because its drives balance what the moving ones do to it. Where motors
share joints, as in the WAM's differential, the holding torque of joint 3 loads the motors of
joint 2: a torque limit is one of motors, and this is what they are held to.

| here      | meaning                                                        | unit   | shape    |
|-----------|----------------------------------------------------------------|--------|----------|
| ``told``  | q, dq, tau commanded, tick by tick                             | rad ...| (3, k, n)|
| ``q``     | true positions, at release and after each tick                 | rad    | (k+1, n) |
| ``dq``    | true speeds then                                               | rad/s  | (k+1, n) |
| ``tau``   | torques of the active joints in the tick before                | N m    | (k+1, n) |
| ``seen``  | contacts in the tick before, :mod:`mitt.world.contacts`        |        | (k+1,)   |
| ``most``  | lower and upper ends of the ranges, largest speeds             | rad ...| (3, n)   |
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mitt.jit import kernel
from mitt.robot.arm import Arm, Tables
from mitt.robot.limits import bound_of, drive_asked, torque_share
from mitt.robot.slopes import bias_and_mass, slopes_work
from mitt.signals import Array
from mitt.world.contacts import ARM_FLOOR, SELF

#: Limit violations: commanded beyond a limit by more than this, and the plant beyond by a share.
COMMANDED, MEASURED = 1e-9, 0.01


class Tally(NamedTuple):
    """Sums over a trial, and scratch of the kernels."""

    torque: Array  # (N,) largest share of each drive's torque bound
    speed: Array  # (n,) largest share of each joint's speed limit
    square: Array  # (N,) sum of the squares of each drive's torque [N^2 m^2]
    tau: Array  # (3, N) torques of all links given and told, and their speeds
    motion: Array  # (3, n) q, dq, and no acceleration
    mass: Array  # (N, n) and the rest of :mod:`mitt.robot.slopes`
    work: Array
    system: Array  # (n, n + 1) of the active joints' accelerations


def fresh_tally(arm: Arm) -> Tally:
    """Return the sums over no tick."""
    n, links = arm.n, len(arm.bodies)
    return Tally(
        torque=np.zeros(links),
        speed=np.zeros(n),
        square=np.zeros(links),
        tau=np.zeros((3, links)),
        motion=np.zeros((3, n)),
        mass=np.zeros((links, n)),
        work=slopes_work(links),
        system=np.zeros((n, n + 1)),
    )


@kernel
def hold(arm: Tables, q: Array, dq: Array, tau: Array, t: int, out: Array, s: Tally) -> None:
    """Write the torques of all links while the active ones are driven [N m], shape (N,).

    Eq. (14) is linear in the acceleration: tau = bias + M ddq. The active rows give ddq, the
    others are what it takes to hold the rest. Contact with a ball is not in the model.

    Args:
        arm: As of ``Arm.tables``.
        q: Joint positions when the torques were given [rad], shape (k or more, n).
        dq: Joint speeds then [rad/s], shape (k or more, n).
        tau: Torques of the active joints [N m], shape (k, n).
        t: Row of the three.
        out: Result, shape (N,).
        s: Scratch.
    """
    bodies, _, index = arm
    n, links, motion, mass, system = len(index), len(bodies), s.motion, s.mass, s.system
    if n < links:
        for j in range(n):
            motion[0, j], motion[1, j] = q[t, j], dq[t, j]
        bias_and_mass(bodies, motion, out, mass, s.work)
        for i in range(n):
            for j in range(n):
                system[i, j] = mass[index[i], j]
            system[i, n] = tau[t, i] - out[index[i]]
        _solve(system)
        for k in range(links):
            for j in range(n):
                out[k] += mass[k, j] * system[j, n]
    for i in range(n):
        out[index[i]] = tau[t, i]


@kernel
def _solve(system: Array) -> None:
    """Solve A x = b for [A b], A positive definite, shape (n, n + 1); b becomes x."""
    n = len(system)
    for c in range(n):
        for r in range(c + 1, n):
            share = system[r, c] / system[c, c]
            for k in range(c + 1, n + 1):
                system[r, k] -= share * system[c, k]
    for c in range(n - 1, -1, -1):
        for k in range(c + 1, n):
            system[c, n] -= system[c, k] * system[k, n]
        system[c, n] /= system[c, c]


@kernel
def tally(
    arm: Tables, most: Array, told: Array, q: Array, dq: Array, tau: Array,
    seen: NDArray[np.int64], s: Tally,
) -> int:  # fmt: skip
    """Add up a trial, arrays as in the module's table, and return its ticks with a violation.

    That is a limit exceeded by a command or by the plant, or the arm touching itself or the
    floor: its range is where it can be.
    """
    _, drives, index = arm
    told_q, told_dq, told_tau, given_tau = told[0], told[1], told[2], tau[1:]
    count, given, asked, speed = 0, s.tau[0], s.tau[1], s.tau[2]
    _note_speeds(most, dq, 0, s.speed)
    for t in range(len(told_q)):
        hold(arm, q, dq, given_tau, t, given, s)
        for i in range(len(index)):
            speed[index[i]] = dq[t, i]
        _note_speeds(most, dq, t + 1, s.speed)
        same = _same(told_tau, given_tau, t)
        bad = _note_drives(drives, given, speed, COMMANDED if same else MEASURED, s)
        if not same:
            hold(arm, q, dq, told_tau, t, asked, s)
            bad |= _overloaded(drives, asked, speed)
        bad |= _beyond(most, q, dq, t + 1, MEASURED) or _beyond(most, told_q, told_dq, t, COMMANDED)
        count += bad or seen[t + 1] & (SELF | ARM_FLOOR) != 0
    return count


@kernel
def _same(a: Array, b: Array, t: int) -> bool:
    """Say whether two arrays are equal in row ``t``."""
    others = 0
    for k in range(a.shape[1]):
        others += a[t, k] != b[t, k]
    return others == 0


@kernel
def _beyond(most: Array, q: Array, dq: Array, t: int, slack: float) -> bool:
    """Say whether positions or speeds in row ``t`` exceed their limits by a share."""
    for k in range(q.shape[1]):
        span = slack * (most[1, k] - most[0, k])
        if q[t, k] < most[0, k] - span or q[t, k] > most[1, k] + span:
            return True
        if abs(dq[t, k]) > most[2, k] * (1.0 + slack):
            return True
    return False


@kernel
def _overloaded(drives: Array, tau: Array, speed: Array) -> bool:
    """Say whether commanded torques of all links at their speeds, (N,), exceed a drive's bound."""
    for m in range(len(tau)):
        drive, rate = drive_asked(drives, m, tau, speed)
        bound, _ = bound_of(drives, m, drive, rate, 0.0)
        if abs(drive) > bound * (1.0 + COMMANDED) + COMMANDED:
            return True
    return False


@kernel
def _note_drives(drives: Array, tau: Array, speed: Array, slack: float, s: Tally) -> bool:
    """Add what the drives gave for torques of all links at their speeds, shapes (N,).

    Returns:
        Whether one exceeds its bound by a share ``slack``.
    """
    strong, torque, square = False, s.torque, s.square
    for m in range(len(tau)):
        drive, rate = drive_asked(drives, m, tau, speed)
        bound, _ = bound_of(drives, m, drive, rate, 0.0)
        torque[m] = _larger(torque[m], torque_share(drives, m, drive, rate))
        square[m] += drive * drive
        strong |= abs(drive) > bound * (1.0 + slack) + COMMANDED
    return strong


@kernel
def _note_speeds(most: Array, dq: Array, t: int, largest: Array) -> None:
    """Raise the largest shares of the speed limits, shape (n,), to those of row ``t``."""
    for k in range(dq.shape[1]):
        largest[k] = _larger(largest[k], abs(dq[t, k]) / most[2, k])


@kernel
def _larger(a: float, b: float) -> float:
    """Return the larger of two numbers, or the first that is none."""
    return b if b > a or b != b else a
