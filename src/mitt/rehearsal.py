"""What the arm will make of a motion that asks for more than a limit: envelope, tracking, model.

A share of a limit says little of what becomes of the catch: a motion that asks for 2 % too much
of a motor makes the arm a few millimetres late, or not at all, if it has the time to make up for
it. So a motion that is beyond a limit is run, tick by tick, through envelope and controller on the
model of the arm; what counts is how far the hand is from its place at the catch.

| here     | meaning                                              | unit  | shape     |
|----------|------------------------------------------------------|-------|-----------|
| ``rows`` | q_d, dq_d, ddq_d at each tick                        | rad.. | (K, 3, n) |
| ``b``    | limits, as of :func:`mitt.control.envelope.bounds_of`| rad.. | (n,)      |
"""

import numpy as np

from mitt.control.envelope import bounds_of, clamp
from mitt.control.stop import MassWork, mass_work
from mitt.control.tracking import Tracking, track, tracking_of
from mitt.generator.feasibility import Approach
from mitt.jit import kernel
from mitt.robot.arm import Arm, Tables
from mitt.robot.dynamics import bias_and_mass
from mitt.signals import TICK, Array
from mitt.structs import Record


def gap_at_catch(arm: Arm, approach: Approach, caps: Array, bandwidth: float) -> float:
    """Return how far the hand will be from its place at the catch [m].

    Args:
        arm: The arm.
        approach: The motion that is asked for.
        caps: Largest joint speeds that are emitted [rad/s], shape (n,).
        bandwidth: Of the tracking error [rad/s].
    """
    rows, b = _each_tick(approach), bounds_of(arm)
    b["dq_max"] = np.minimum(b["dq_max"], caps)
    state = rows[0, :2].copy()
    rehearse(arm.tables, b, bandwidth, rows, state, tracking_of(arm), mass_work(arm))
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
    arm: Tables, b: Record, bandwidth: float, rows: Array, state: Array, w: Tracking, m: MassWork
) -> None:
    """Carry q, dq on along a motion within all limits, on the model of the arm.

    Args:
        arm: As of ``Arm.tables``.
        b: As in the module's table.
        bandwidth: Of the tracking error [rad/s].
        rows: As in the module's table; the last is where the motion ends.
        state: q, dq, overwritten [rad, rad/s], shape (2, n).
        w: Of the tracking, before the first torques.
        m: Scratch.
    """
    (bodies, _, index), n = arm, state.shape[1]
    command, last = np.zeros((4, n)), np.zeros((3, n))
    last[:2] = state
    motion, push, system = np.zeros((3, n)), np.zeros(n), np.zeros((n, n))
    for k in range(len(rows) - 1):
        command[:3] = rows[k]
        clamp(b, last, command[:3])
        last[:] = command[:3]
        track(w, arm, b, bandwidth, state, command, TICK)
        w.before[:] = command[3]
        motion[:2] = state
        bias_and_mass(bodies, motion, m.tau, m.mass, m.work)
        for i in range(n):
            for j in range(n):
                system[i, j] = m.mass[index[i], j]
            push[i] = command[3, i] - m.tau[index[i]]
        ddq = np.linalg.solve(system, push)
        for j in range(n):
            state[0, j] += TICK * (state[1, j] + 0.5 * TICK * ddq[j])
            state[1, j] += TICK * ddq[j]
