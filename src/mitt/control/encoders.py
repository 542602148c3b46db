"""What is known of the joint encoders, and of the forces that no model knows."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mitt.errors import InputError
from mitt.jit import kernel
from mitt.robot.arm import Arm
from mitt.robot.slopes import bias_and_mass
from mitt.signals import Array
from mitt.views import view

#: Share of a joint's largest torque that friction and contact may always take, and the largest.
_LEAST, _MOST = 0.1, 0.3


@dataclass(frozen=True, slots=True, kw_only=True)
class Encoders:
    """What is known of the encoders.

    Attributes:
        step: Resolution of each joint's encoder [rad], one number for all or one a joint; None:
            the arm's own.
        unknown: Torque by friction, payload or contact that no model knows and that must raise no
            alarm [N m]; of each joint at least a tenth and at most three tenths of its largest
            torque. The default is a choice of this project.
    """

    step: float | tuple[float, ...] | None = None
    unknown: float = 2.0

    def steps(self, own: Array) -> Array:
        """Return the resolution of each joint's encoder [rad], shape (n,).

        Args:
            own: The arm's, shape (n,).

        Raises:
            InputError: Not one number above 0 for each joint.
        """
        given = own if self.step is None else np.atleast_1d(np.asarray(self.step, np.float64))
        if given.shape not in ((1,), own.shape) or not np.all((given > 0.0) & (given < 0.1)):
            wanted = f"one number or {len(own)}, above 0 and below 0.1 rad"
            raise InputError("encoder step", wanted, self.step)
        return np.array(np.broadcast_to(given, own.shape))

    def table(self, arm: Arm) -> Array:
        """Return what the monitor knows of each joint: resolution [rad], unknown torque [N m].

        Args:
            arm: The arm.

        Returns:
            Rows, shape (2, n).

        Raises:
            InputError: A number that cannot be used.
        """
        if not 0.0 <= self.unknown < np.inf:
            raise InputError("unknown torque", "a number of at least 0 N m", self.unknown)
        unknown = np.clip(self.unknown, _LEAST * arm.tau_max, _MOST * arm.tau_max)
        return np.array([self.steps(arm.encoder_step), unknown])


@kernel
def bring(
    bodies: Array, index: NDArray[np.int64], believed: Array, unknown: Array,
    tau: Array, mass: Array, work: Array, solved: Array, told: Array, doubt: Array,
) -> None:  # fmt: skip
    """Write the acceleration that a tick's torques bring, and what unknown torques can add to it.

    Args:
        bodies: Table of :mod:`mitt.robot.dynamics`, shape (N, 31).
        index: Active joints among the links, shape (n,).
        believed: q, dq of the joints [rad, rad/s], shape (2, n).
        unknown: Largest unknown torque of each joint [N m], shape (n,).
        tau: Scratch, shape (N,).
        mass: Scratch, shape (N, n).
        work: Scratch of :mod:`mitt.robot.slopes`, shape (N, 46).
        solved: Scratch, shape (n + 2, 2 n).
        told: Torques in the fourth row [N m]; result in the fifth [rad/s^2], shape (5, n).
        doubt: Result: acceleration that unknown torques can bring [rad/s^2], shape (n,).
    """
    n = len(index)
    motion = view(solved, 2 * n * n, (3, n))
    motion[0], motion[1], motion[2] = believed[0], believed[1], 0.0
    bias_and_mass(bodies, motion, tau, mass, work)
    for i in range(n):
        for j in range(n):
            solved[i, j], solved[i, n + j] = mass[index[i], j], 1.0 if i == j else 0.0
    for i in range(n):  # Gauss-Jordan; a mass matrix is positive definite and needs no pivots
        scale = 1.0 / max(solved[i, i], 1e-9)
        for c in range(2 * n):
            solved[i, c] *= scale
        for j in range(n):
            factor = solved[j, i]
            if j != i:
                for c in range(2 * n):
                    solved[j, c] -= factor * solved[i, c]
    for i in range(n):
        told[4, i], doubt[i] = 0.0, 0.0
        for j in range(n):
            told[4, i] += solved[i, n + j] * (told[3, j] - tau[index[j]])
            doubt[i] += abs(solved[i, n + j]) * unknown[j]
