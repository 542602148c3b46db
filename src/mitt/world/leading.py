"""A tick of the plant in which the ball is led; one compiled call."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mitt.signals import Array
from mitt.world.contacts import BALL_ANY
from mitt.world.engine import Views
from mitt.world.motion import STEPS, TICK, TICKS, arrive, begin, leave, note


@njit(cache=True)
def lead(
    views: Views,
    kinds: NDArray[np.int32],
    touching: NDArray[np.bool_],
    plant: Array,
    tau: Array,
    hand: float,
    rows: Array,
    way: Array,
) -> bool:
    """Let the motors follow a command for one tick; see :func:`mitt.world.motion.move`.

    Args:
        views: As there.
        kinds: As there.
        touching: As there.
        plant: As there.
        tau: As there.
        hand: As there.
        rows: As there.
        way: Where the ball is led to and how fast, step by step [m, m/s], shape (steps, 2, 3).

    Returns:
        Whether it is still led; from its first touch on it flies freely.
    """
    start, steps, is_led = plant[TICKS] * TICK, int(plant[STEPS]), True
    qpos, qvel, ball = views[4], views[5], views[6].shape[0]
    begin(plant)
    for step in range(1, steps + 1):
        leave(views, kinds, touching, plant, tau, hand)
        if is_led:
            for i in range(3):
                qpos[ball + i], qvel[ball + i] = way[step - 1, 0, i], way[step - 1, 1, i]
        if arrive(views, kinds, touching, plant, start + step * (TICK / steps)) & BALL_ANY:
            is_led = False
    plant[TICKS] += 1.0
    note(views, plant, tau, rows)
    return is_led
