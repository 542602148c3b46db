"""From a command to what acts on the joints: delay, drives, finger servos, friction, and drag.

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
from mitt.robot.hands import FingerDrive
from mitt.signals import Array
from mitt.world.scene import Actuation

SETTING, NOW, MEAN, WAY = range(4)

#: Speed at which dry friction is three quarters of its full size [rad/s]; a sharp step would
#: chatter at 0.5 ms.
STICTION_SPEED = 0.05


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


@kernel
def finger_torque(
    angle: float,
    speed: float,
    command: float,
    tau_max: float,
    braking: float,
    settling: float,
    gain: float,
) -> float:
    """Torque of one finger's servo [N m]; the numbers are those of :class:`FingerDrive`."""
    error = command - angle
    wish = min(abs(error) / settling, np.sqrt(2.0 * braking * abs(error)))
    if error < 0.0:
        wish = -wish
    return float(min(max(gain * (wish - speed), -tau_max), tau_max))


def servo_numbers(drive: FingerDrive) -> tuple[float, float, float, float]:
    """Return the numbers of a drive in the order in which :func:`finger_torque` takes them."""
    return drive.tau_max, drive.braking, drive.settling, drive.gain


@kernel
def actuate(
    qpos: Array,
    qvel: Array,
    ctrl: Array,
    passive: Array,
    tau: Array,
    hand: float,
    servo: Array,
    friction: Array,
    drag: float,
) -> bool:
    """Write what acts in the next simulation step.

    Degrees of freedom come in the order arm (n), fingers (f), ball (6).

    Args:
        qpos: Positions of the plant, shape (n + f + 7,).
        qvel: Velocities of the plant, shape (n + f + 6,).
        ctrl: Result, motor torques [N m], shape (n + f,).
        passive: Result, friction and drag [N m, N], shape (n + f + 6,).
        tau: Commanded torques of the arm [N m], shape (n,).
        hand: Commanded closing angle [rad].
        servo: Numbers of the finger servo, shape (4,).
        friction: Viscous friction [N m s/rad] of each joint, then dry [N m], shape (2 n,).
        drag: Force per squared speed of the ball [N s^2/m^2].

    Returns:
        Whether the command was finite; where it is not, that motor gives nothing.
    """
    finite, n, count = True, tau.shape[0], ctrl.shape[0]
    for i in range(n):
        if not np.isfinite(tau[i]):
            finite = False
        ctrl[i] = tau[i] if np.isfinite(tau[i]) else 0.0
        slip = np.tanh(qvel[i] / STICTION_SPEED)
        passive[i] = -friction[i] * qvel[i] - friction[n + i] * slip
    if not np.isfinite(hand):
        finite, hand = False, 0.0
    for i in range(n, count):
        ctrl[i] = finger_torque(qpos[i], qvel[i], hand, servo[0], servo[1], servo[2], servo[3])
    x, y, z = qvel[count], qvel[count + 1], qvel[count + 2]
    force = -drag * np.sqrt(x * x + y * y + z * z)
    passive[count] = force * x
    passive[count + 1] = force * y
    passive[count + 2] = force * z
    return finite
