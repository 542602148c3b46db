"""A tick of the plant in which the ball is led; one compiled call."""

from mitt.jit import kernel
from mitt.signals import Array
from mitt.views import lent
from mitt.world.contacts import BALL_ANY
from mitt.world.motion import STATE, STEPS, TICK, TICKS, Plant, arrive, begin, leave, note


@kernel
def lead(plant: Plant, tau: Array, hand: float, rows: Array, way: Array) -> bool:
    """Let the motors follow a command for one tick; see :func:`mitt.world.motion.move`.

    Args:
        plant: As there.
        tau: As there.
        hand: As there.
        rows: As there.
        way: Where the ball is led to and how fast, step by step [m, m/s], shape (steps, 2, 3).

    Returns:
        Whether it is still led; from its first touch on it flies freely.
    """
    plant, tau, rows, way = lent((plant, tau, rows, way))
    qpos, qvel, ball, state = plant[4], plant[5], plant[6].shape[0], plant[STATE]
    start, steps, is_led = state[TICKS] * TICK, int(state[STEPS]), True
    begin(plant, tau, hand)
    for step in range(1, steps + 1):
        leave(plant)
        if is_led:
            for i in range(3):
                qpos[ball + i], qvel[ball + i] = way[step - 1, 0, i], way[step - 1, 1, i]
        if arrive(plant, start + step * (TICK / steps)) & BALL_ANY:
            is_led = False
    state[TICKS] += 1.0
    note(plant, rows)
    return is_led
