"""What is known of the joint encoders, and of the forces that no model knows."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mitt import checks, fields
from mitt.control.rows import DDQ_BY_TAU, TAU
from mitt.errors import InputError
from mitt.fields import brief
from mitt.jit import kernel
from mitt.robot.arm import Arm
from mitt.robot.dynamics import bias_and_mass
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

    __repr__ = brief

    def __post_init__(self) -> None:
        """Refuse what cannot be; InputError names the field."""
        fields.check(self, {"unknown": (0.0, 1e6)})

    def steps(self, own: Array) -> Array:
        """Return the resolution of each joint's encoder [rad], shape (n,).

        Args:
            own: The arm's, shape (n,).

        Raises:
            InputError: Not one number above 0 for each joint.
        """
        given = own
        if self.step is not None:
            scalar = isinstance(self.step, int | float)
            given = checks.array("encoder step", [self.step] if scalar else self.step, (None,))
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
        unknown = np.clip(self.unknown, _LEAST * arm.tau_max, _MOST * arm.tau_max)
        return np.array([self.steps(arm.encoder_step), unknown])


@kernel
def predict_acceleration(
    bodies: Array, index: NDArray[np.int64], estimated: Array, unknown: Array,
    tau: Array, mass: Array, work: Array, solved: Array, command: Array, ddq_unknown: Array,
    coupling: Array,
) -> None:  # fmt: skip
    """Write the acceleration by a tick's torques, and what unknown torques can add to it.

    With M the mass matrix, a torque w_k at joint k that nobody knows, and accelerations a_j of the
    others that are measured, joint k moves by ddq_k = (tau_k - bias_k + w_k - sum M_kj a_j) / M_kk.

    Args:
        bodies: Table of :mod:`mitt.robot.dynamics`, shape (N, 31).
        index: Active joints among the links, shape (n,).
        estimated: q, dq of the joints [rad, rad/s], shape (2, n).
        unknown: Largest unknown torque of each joint [N m], shape (n,).
        tau: Scratch, shape (N,).
        mass: Scratch, shape (N, n).
        work: Scratch of :mod:`mitt.robot.dynamics`, shape (N, 46).
        solved: Scratch, shape (n + 2, 2 n).
        command: Torques in the fourth row [N m]; result in the fifth [rad/s^2], shape (5, n).
        ddq_unknown: Result: acceleration that the unknown torques of all joints can cause, and the
            one that a joint's own can while the others move as they do [rad/s^2], shape (2, n).
        coupling: Result: M_kj / M_kk, shape (n, n).
    """
    n = len(index)
    motion = view(solved, 2 * n * n, (3, n))
    motion[0], motion[1], motion[2] = estimated[0], estimated[1], 0.0
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
        own = max(mass[index[i], i], 1e-9)
        command[DDQ_BY_TAU, i], ddq_unknown[0, i], ddq_unknown[1, i] = 0.0, 0.0, unknown[i] / own
        for j in range(n):
            command[DDQ_BY_TAU, i] += solved[i, n + j] * (command[TAU, j] - tau[index[j]])
            ddq_unknown[0, i] += abs(solved[i, n + j]) * unknown[j]
            coupling[i, j] = mass[index[i], j] / own
