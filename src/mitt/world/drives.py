"""What lies between a command and the torques of the motors: a delay, and drives that follow.

A drive's torque follows its command like a filter of first order. Within a step the mean of that
torque acts, so that what it brings about does not depend on the length of the steps.

A table has a column each joint of the arm and a last one for the hand's closing angle [rad].

| row     | meaning                                                                        | unit |
|---------|--------------------------------------------------------------------------------|------|
| SETTING | bandwidth of the torque in the first column; 0 follows at once                 | 1/s  |
| NOW     | torques at the end of the last step                                            | N m  |
| MEAN    | mean torques over the last step                                                | N m  |
| WAY     | this row and those below: commands on their way, the tick modulo their number  | N m  |
"""

import numpy as np

from mitt.jit import kernel
from mitt.signals import Array
from mitt.views import lent
from mitt.world.scene import Actuation

SETTING, NOW, MEAN, WAY = range(4)


def fresh_drives(actuation: Actuation, holding: Array) -> Array:
    """Return the table of drives that hold the arm still, and a hand that is open.

    Args:
        actuation: Settings.
        holding: Torques that hold the arm [N m], shape (n,).
    """
    table = np.zeros((WAY + actuation.delay + 1, len(holding) + 1))
    table[NOW:, :-1] = holding
    table[SETTING, 0] = 2.0 * np.pi * actuation.bandwidth
    return table


@kernel
def command(table: Array, tick: int, tau: Array, hand: float) -> None:
    """Send a command on its way.

    Args:
        table: As in the module's text, overwritten.
        tick: Number of the tick.
        tau: Torques [N m], shape (n,).
        hand: Closing angle [rad].
    """
    table, tau = lent(table), lent(tau)
    row = WAY + tick % (len(table) - WAY)
    for i in range(len(tau)):
        table[row, i] = tau[i]
    table[row, len(tau)] = hand


@kernel
def follow(table: Array, tick: int, h: float) -> float:
    """Let the drives follow what has arrived for a step, and return the closing angle [rad].

    Args:
        table: As in the module's text, overwritten.
        tick: Number of the tick.
        h: Length of the step [s].
    """
    table = lent(table)
    rate, row, n = table[SETTING, 0], WAY + (tick + 1) % (len(table) - WAY), table.shape[1] - 1
    keep = np.exp(-rate * h)
    for i in range(n):
        target = table[row, i]
        if rate == 0.0:
            table[NOW, i] = table[MEAN, i] = target
        else:
            gap = table[NOW, i] - target
            table[MEAN, i] = target + gap * (1.0 - keep) / (rate * h)
            table[NOW, i] = target + gap * keep
    return float(table[row, n])
