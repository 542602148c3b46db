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
    links, rows = len(arm.model.links), [np.ascontiguousarray(x, np.float64) for x in (q, dq)]
    bias, M = np.empty((len(tau), links)), np.zeros((len(tau), links, arm.n))
    _ask(arm.bodies, *rows, bias, M, np.zeros((3, arm.n)), slopes_work(links))
    ddq = np.linalg.solve(M[:, index], (tau - bias[:, index])[..., None])
    out: Array = bias + (M @ ddq)[..., 0]
    out[:, index] = tau
    return out


@njit(cache=True)
def _ask(
    bodies: Array, q: Array, dq: Array, bias: Array, M: Array, motion: Array, work: Array
) -> None:
    """Write how the torques answer to accelerations, tick by tick; see :func:`with_held`.

    Args:
        bodies: Table of :mod:`mitt.robot.dynamics`, shape (N, 31).
        q: As for ``with_held``.
        dq: As for ``with_held``.
        bias: Result, torques at no acceleration [N m], shape (k, N).
        M: Result, torques per acceleration [kg m^2], shape (k, N, n).
        motion: Scratch, zero in its last row, shape (3, n).
        work: Scratch of :mod:`mitt.robot.slopes`, shape (N, 46).
    """
    for t in range(len(q)):
        motion[0], motion[1] = q[t], dq[t]
        bias_and_mass(bodies, motion, bias[t], M[t], work)


def rms_ratio(arm: Arm, tau: Array) -> list[float]:
    """Return root mean square torque over continuous torque, drive by drive, for (k, N) [N m]."""
    rms = np.sqrt(np.mean(arm.limits.drive_torque(tau) ** 2, axis=0))
    return [float(x) for x in rms / arm.limits.tau_rms]
