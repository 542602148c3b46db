"""What the arm will make of a motion that asks for more than a limit: envelope, tracking, model.

A share of a limit says little of what becomes of the catch: a motion that asks for 2 % too much
of a motor makes the arm a few millimetres late, or not at all, if it has the time to make up for
it. So a motion that is beyond a limit is run, tick by tick, through envelope and controller on the
model of the arm; what counts is how far the hand is from its place at the catch.

| here     | meaning                                              | unit  | shape     |
|----------|------------------------------------------------------|-------|-----------|
| ``rows`` | q_d, dq_d, ddq_d at each tick                        | rad.. | (K, 3, n) |
| ``b``    | limits, as of :func:`mitt.control.envelope.bounds_of`| rad.. | (6, n)    |
"""

import numpy as np
from numpy.typing import NDArray

from mitt.control.envelope import bounds_of, clamp
from mitt.control.rows import DQ_MAX, ROWS, TAU
from mitt.control.tracking import SCRATCH, slew_of, track
from mitt.generator.feasibility import Approach
from mitt.jit import kernel
from mitt.robot.arm import Arm
from mitt.robot.dynamics import bias_and_mass, slopes_work
from mitt.signals import TICK, Array


def gap_at_catch(arm: Arm, approach: Approach, caps: Array, bandwidth: float) -> float:
    """Return how far the hand will be from its place at the catch [m].

    Args:
        arm: The arm.
        approach: The motion that is asked for.
        caps: Largest joint speeds that are emitted [rad/s], shape (n,).
        bandwidth: Of the tracking error [rad/s].
    """
    rows, b = _each_tick(approach), bounds_of(arm)
    b[DQ_MAX] = np.minimum(b[DQ_MAX], caps)
    state = rows[0, :2].copy()
    bodies, drives, index = arm.tables
    scratch, work = np.zeros((len(bodies), SCRATCH)), slopes_work(len(bodies))
    rehearse(b, bandwidth, drives, bodies, index, rows, state, slew_of(arm), scratch, work)
    there, desired = arm.position(state[0]), arm.position(rows[-1, 0])
    return float(np.linalg.norm(there - desired))


def _each_tick(approach: Approach) -> Array:
    """Return the motion at every tick, by cubics between its instants, shape (K, 3, n)."""
    known, h = approach.motion, approach.step
    t = np.linspace(0.0, h * (len(known) - 1), max(round(h * (len(known) - 1) / TICK), 1) + 1)
    k = np.minimum((t / h).astype(np.int64), len(known) - 2)
    x = (t / h - k)[:, None]
    p, v, q, w = known[k, 0], h * known[k, 1], known[k + 1, 0], h * known[k + 1, 1]
    c, d = 3.0 * (q - p) - 2.0 * v - w, 2.0 * (p - q) + v + w
    place = p + x * (v + x * (c + x * d))
    speed = (v + x * (2.0 * c + 3.0 * x * d)) / h
    rate = (1.0 - x) * known[k, 2] + x * known[k + 1, 2]
    return np.ascontiguousarray(np.stack([place, speed, rate], axis=1))


@kernel
def rehearse(
    b: Array, bandwidth: float, drives: Array, bodies: Array, index: NDArray[np.int64],
    rows: Array, state: Array, slew: Array, scratch: Array, work: Array,
) -> None:  # fmt: skip
    """Carry q, dq on along a motion within all limits, on the model of the arm.

    Args:
        b: As in the module's table.
        bandwidth: Of the tracking error [rad/s].
        drives: ``Limits.packed``.
        bodies: Table of :mod:`mitt.robot.dynamics`.
        index: Active joints among the links.
        rows: As in the module's table; the last is where the motion ends.
        state: q, dq, overwritten [rad, rad/s], shape (2, n).
        slew: As of :func:`mitt.control.tracking.slew_of`, overwritten.
        scratch: Scratch of the tracking.
        work: Scratch of :mod:`mitt.robot.dynamics`.
    """
    n = state.shape[1]
    command, last = np.zeros((ROWS, n)), np.zeros((3, n))
    last[:2] = state
    motion, tau, push = np.zeros((3, n)), np.zeros(len(bodies)), np.zeros(n)
    mass, system = np.zeros((len(bodies), n)), np.zeros((n, n))
    for k in range(len(rows) - 1):
        command[:3] = rows[k]
        clamp(b, last, command[:3])
        last[:] = command[:3]
        track(b, bandwidth, drives, bodies, index, state[0], state[1], command, slew, scratch)
        slew[1] = command[TAU]
        motion[:2] = state
        bias_and_mass(bodies, motion, tau, mass, work)
        for i in range(n):
            for j in range(n):
                system[i, j] = mass[index[i], j]
            push[i] = command[TAU, i] - tau[index[i]]
        ddq = np.linalg.solve(system, push)
        for j in range(n):
            state[0, j] += TICK * (state[1, j] + 0.5 * TICK * ddq[j])
            state[1, j] += TICK * ddq[j]
