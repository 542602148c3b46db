"""The rubber of a paddle: what it gives back along its normal, and along its face; compiled.

Along the normal the contact is a spring and a damper in MuJoCo's direct form. Its damping is set as
the ball comes, by the speed along the normal at which it comes: the restitution falls with that
speed. Along the face the rubber is a spring, too: it is bent by the ball's slip, and bends back.
Its stiffness is such that after the time of a contact the slip has turned round, by the tangential
restitution, as long as friction holds. That is a rigid body's impact: force and torque act on the
ball at its radius, the same force on the arm.

| here   | meaning                                                     | unit | shape |
|--------|-------------------------------------------------------------|------|-------|
| ``n``  | normal out of the face: the z axis of the tool              | 1    | (3,)  |
| ``slip``| velocity of the ball's surface against the face, across n  | m/s  | (3,)  |
| ``bend``| how far the rubber is bent along the face                  | m    | (3,)  |
"""

from typing import Final, NamedTuple

import numpy as np

from mitt.core.arm.kinematics import Vec
from mitt.core.kernels import Record, kernel, record_of
from mitt.core.signals import Array

#: A ball that comes slower than this counts as coming at it [m/s].
_SLOWEST = 0.1


class Rubber(NamedTuple):
    """A rubber as compiled code reads it.

    Attributes:
        of: Own: single numbers, shape (1,):
            acts: Whether there is one.
            restitution: At ``usual`` [m/s].
            fall: By how much it is less for each m/s more [s/m].
            usual: See ``restitution``.
            stiffness: Of the spring along the face, for each kg of the ball [1/s^2].
            friction: Of ball and rubber.
            face: Index of the face's geom.
        contact: In MuJoCo's memory: spring and damper of face and ball, shape (2,).
        table: Restitution, and spring and damper that give it, shape (k, 3).
        facing: In MuJoCo's memory: axes of the tool, row by row, shape (9,).
        bend: Own, as in the module's table.
    """

    of: Record
    contact: Array
    table: Array
    facing: Array
    bend: Array


RUBBER: Final[dict[str, bool | float]] = {
    "acts": False,
    "restitution": 0.0,
    "fall": 0.0,
    "usual": 0.0,
    "stiffness": 0.0,
    "friction": 0.0,
    "face": 0,
}
"""Numbers of a :class:`Rubber`, before there is one."""


def no_rubber(facing: Array) -> Rubber:
    """Return what stands for a rubber where there is none."""
    return Rubber(record_of(RUBBER, RUBBER), np.zeros(2), np.zeros((1, 3)), facing, np.zeros(3))


@kernel
def set_damping(rubber: Rubber, speed: float) -> None:
    """Let a ball that comes at a speed along the normal [m/s] keep what the rubber gives back."""
    of, table = rubber.of[0], rubber.table
    e = of.restitution - of.fall * (max(speed, _SLOWEST) - of.usual)
    k, last = 0, len(table) - 2
    while k < last and table[k + 1, 0] < e:
        k += 1
    share = (e - table[k, 0]) / (table[k + 1, 0] - table[k, 0])
    share = min(max(share, 0.0), 1.0)
    for i in range(2):
        low, high = table[k, 1 + i], table[k + 1, 1 + i]
        rubber.contact[i] = low + share * (high - low)


@kernel
def bend_on(rubber: Rubber, slip: Vec, mass: float, pressing: float, h: float) -> Vec:
    """Bend the rubber on by a slip [m/s] for ``h`` [s]; return the force on the ball [N].

    Args:
        rubber: The rubber; its bend is overwritten.
        slip: As in the module's table.
        mass: Of the ball [kg].
        pressing: Force along the normal [N], of which friction holds its share.
        h: Length of the step [s].
    """
    of, bend, n = rubber.of[0], rubber.bend, face_normal(rubber)
    for i in range(3):
        bend[i] += h * slip[i]
    into = bend[0] * n[0] + bend[1] * n[1] + bend[2] * n[2]
    for i in range(3):
        bend[i] -= into * n[i]
    size = np.sqrt(bend[0] ** 2 + bend[1] ** 2 + bend[2] ** 2)
    k = mass * of.stiffness
    most = of.friction * pressing / k
    if size > most:  # it slides
        for i in range(3):
            bend[i] *= most / size
    return -k * bend[0], -k * bend[1], -k * bend[2]


@kernel
def face_normal(rubber: Rubber) -> Vec:
    """Return the normal out of the face."""
    return rubber.facing[2], rubber.facing[5], rubber.facing[8]
