"""Where default throws are aimed at an arm: one half of the table in docs/throws.md."""

import numpy as np

from mitt.generator.design import nominal_catch
from mitt.robot.arm import Arm
from mitt.world.throws import Aim

#: Half-widths of the box of joint angles that is aimed at, first and second joint [rad].
_HALF = (0.3, 0.22)


def aim_of(arm: Arm) -> Aim:
    """Return where default throws are aimed: q1 +-0.3, q2 pi/4 +-0.22, q4 = q_alpha for the WAM.

    The ready pose gives the centre of the box, so other arms have theirs.
    """
    middle, half = nominal_catch(arm), np.zeros(arm.n)
    half[: len(_HALF)] = _HALF
    return Aim(position=arm.position, q_low=middle - half, q_high=middle + half)
