"""What the drives of a trial gave, locked joints included.

A locked joint stands still because its drives balance what the moving ones do to it. Where motors
share joints, as in the WAM's differential, the holding torque of joint 3 loads the motors of
joint 2: a torque limit is one of motors, so the holding torques count.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mitt.jit import kernel
from mitt.robot.arm import Arm, Tables
from mitt.robot.dynamics import bias_and_mass, slopes_work
from mitt.signals import Array

#: Limit violations: commanded beyond a limit by more than this, and the plant beyond by a share.
COMMANDED, MEASURED = 1e-9, 0.01


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DriveLoads:
    """Loads of N drives at k instants, shape (k, N) each.

    Attributes:
        torque: Torque of each drive [N m].
        bound: Largest torque of the drive in that direction at its speed [N m].
        share: How much of the drive is asked for (:mod:`mitt.robot.limits`); 1 is the limit.
    """

    torque: Array
    bound: Array
    share: Array

    def over(self, slack: Array | float) -> NDArray[np.bool_]:
        """Say of each instant whether a drive exceeds its bound by a share, shape (k,) or ()."""
        most = self.bound * (1.0 + np.reshape(slack, (-1, 1))) + COMMANDED
        return np.asarray(np.any(np.abs(self.torque) > most, axis=1))


def drive_loads(arm: Arm, q: Array, dq: Array, tau: Array) -> DriveLoads:
    """Return the loads of all drives, eq. (14) solved for those of locked joints.

    Args:
        arm: The arm.
        q: Positions of the active joints [rad], shape (k, n).
        dq: Their speeds [rad/s], shape (k, n).
        tau: Their torques [N m], shape (k, n).
    """
    links, limits = link_torques(arm, q, dq, tau), arm.limits
    speeds = np.zeros_like(links)
    speeds[:, arm.model.active] = dq
    torque = limits.drive_torque(links)
    bound = limits.torque_bound(torque, limits.drive_speed(speeds))
    return DriveLoads(torque=torque, bound=bound, share=limits.torque_ratio(links, speeds))


def link_torques(arm: Arm, q: Array, dq: Array, tau: Array) -> Array:
    """Return the torques of all links while the active ones are driven [N m], shape (k, N).

    Args as of :func:`drive_loads`.
    """
    out = np.zeros((len(tau), len(arm.bodies)))
    rows = (np.ascontiguousarray(x) for x in (q, dq, tau))
    _hold(arm.tables, *rows, slopes_work(len(arm.bodies)), out)
    return out


@kernel
def _hold(arm: Tables, q: Array, dq: Array, tau: Array, work: Array, out: Array) -> None:
    """Write what :func:`link_torques` returns.

    Eq. (14) is linear in the acceleration: tau = bias + M ddq. The active rows give ddq, the
    others are what it takes to hold the rest. Contact with a ball is not in the model.
    """
    bodies, _, index = arm
    n, links = len(index), len(bodies)
    motion, mass, system = np.zeros((3, n)), np.zeros((links, n)), np.zeros((n, n + 1))
    for t in range(len(tau)):
        if n < links:
            motion[0], motion[1] = q[t], dq[t]
            bias_and_mass(bodies, motion, out[t], mass, work)
            for i in range(n):
                for j in range(n):
                    system[i, j] = mass[index[i], j]
                system[i, n] = tau[t, i] - out[t, index[i]]
            _solve(system)
            for k in range(links):
                for j in range(n):
                    out[t, k] += mass[k, j] * system[j, n]
        for i in range(n):
            out[t, index[i]] = tau[t, i]


@kernel
def _solve(system: Array) -> None:
    """Solve A x = b for [A b], A positive definite, shape (n, n + 1); b becomes x."""
    n = len(system)
    for c in range(n):
        for r in range(c + 1, n):
            factor = system[r, c] / system[c, c]
            for k in range(c + 1, n + 1):
                system[r, k] -= factor * system[c, k]
    for c in range(n - 1, -1, -1):
        for k in range(c + 1, n):
            system[c, n] -= system[c, k] * system[k, n]
        system[c, n] /= system[c, c]
