"""What the drives of a trial gave, those that hold a still joint included.

A held joint stands still because its drives balance what the moving ones do to it. Where motors
share joints, as in the WAM's differential, the holding torque of joint 3 loads the motors of
joint 2: a torque limit is one of motors, and this is what they are held to.

| here    | meaning                                                  | unit | shape  |
|---------|----------------------------------------------------------|------|--------|
| ``tau`` | torques of the active joints, tick by tick               | N m  | (k, n) |
| ``all`` | torques of all links, held ones as the model reckons them| N m  | (k, N) |
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mitt.robot.arm import Arm
from mitt.robot.slopes import bias_and_mass, slopes_work
from mitt.signals import Array


def with_held(arm: Arm, q: Array, dq: Array, tau: Array) -> Array:
    """Return the torques of all links while the active ones are driven [N m], shape (k, N).

    Eq. (14) is linear in the acceleration: tau = bias + M ddq. The active rows give ddq, the
    others are what it takes to hold the rest. Contact with a ball is not in the model.

    Args:
        arm: The arm.
        q: Joint positions when the torques were given [rad], shape (k, n).
        dq: Joint speeds then [rad/s], shape (k, n).
        tau: Torques of the active joints [N m], shape (k, n).
    """
    index = np.array(arm.model.active)
    if len(index) == len(arm.model.links):
        return tau
    n, links = arm.n, len(arm.model.links)
    out = np.empty((len(tau), links))
    rows = (np.ascontiguousarray(x, dtype=np.float64) for x in (q, dq, tau))
    scratch = np.zeros((3, n)), np.zeros((links, n)), slopes_work(links), np.zeros((n, n + 1))
    _hold(arm.bodies, index, *rows, out, *scratch)
    return out


@njit(cache=True)
def _hold(
    bodies: Array,
    index: NDArray[np.int64],
    q: Array,
    dq: Array,
    tau: Array,
    out: Array,
    motion: Array,
    M: Array,
    work: Array,
    rows: Array,
) -> None:
    """Write the torques of all links tick by tick; see :func:`with_held`.

    Args:
        bodies: Table of :mod:`mitt.robot.dynamics`, shape (N, 31).
        index: Active joints among the links, shape (n,).
        q: As for ``with_held``.
        dq: As for ``with_held``.
        tau: As for ``with_held``.
        out: Result [N m], shape (k, N).
        motion: Scratch, zero in its last row, shape (3, n).
        M: Scratch, shape (N, n).
        work: Scratch of :mod:`mitt.robot.slopes`, shape (N, 46).
        rows: Scratch, shape (n, n + 1).
    """
    n = len(index)
    for t in range(len(q)):
        motion[0], motion[1] = q[t], dq[t]
        bias_and_mass(bodies, motion, out[t], M, work)
        for i in range(n):
            rows[i, :n] = M[index[i]]
            rows[i, n] = tau[t, i] - out[t, index[i]]
        _solve(rows)
        for j in range(len(bodies)):
            for i in range(n):
                out[t, j] += M[j, i] * rows[i, n]
        for i in range(n):
            out[t, index[i]] = tau[t, i]


@njit(cache=True)
def _solve(rows: Array) -> None:
    """Solve A x = b for a positive definite A by elimination; x takes the place of b.

    Args:
        rows: A and b side by side, overwritten, shape (n, n + 1).
    """
    n = len(rows)
    for k in range(n):
        for i in range(k + 1, n):
            share = rows[i, k] / rows[k, k]
            for j in range(k, n + 1):
                rows[i, j] -= share * rows[k, j]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            rows[k, n] -= rows[k, j] * rows[j, n]
        rows[k, n] /= rows[k, k]


def rms_ratio(arm: Arm, tau: Array) -> list[float]:
    """Return root mean square torque over continuous torque, drive by drive, for (k, N) [N m]."""
    rms = np.sqrt(np.mean(arm.limits.drive_torque(tau) ** 2, axis=0))
    return [float(x) for x in rms / arm.limits.tau_rms]
