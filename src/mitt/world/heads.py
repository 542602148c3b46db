"""The pan-tilt heads of the simulated world: servos, limits, encoders.

| here    | meaning                                             | unit       | shape  |
|---------|-----------------------------------------------------|------------|--------|
| state   | pan, tilt and their rates, a head each              | rad, rad/s | (n, 4) |
| desired | the same at the tick's end, by the catcher's command | rad, rad/s | (n, 4) |
"""

from math import sqrt

import numpy as np

from mitt import checks
from mitt.jit import kernel
from mitt.signals import Array
from mitt.structs import Record
from mitt.vision.camera import Rig
from mitt.vision.head import aim_one, pack_heads

#: Bandwidth of the servos [rad/s]; steps of integration in a tick.
BANDWIDTH, STEPS = 300.0, 4


@kernel
def follow(heads: Record, state: Array, desired: Array, bandwidth: float, duration: float) -> None:
    """Let the servos follow for a while, within the limits of speed and acceleration.

    A loop of angle around a loop of rate, critically damped, with the desired rate fed forward.
    A long way is driven no faster than can be braked away, so that it does not overshoot.

    Args:
        heads: As in :mod:`mitt.vision.head`.
        state: Overwritten.
        desired: For the end of the time.
        bandwidth: Of the servos [rad/s].
        duration: Time to pass [s].
    """
    h = duration / STEPS
    for n in range(state.shape[0]):
        top, most = heads[n].max_speed, heads[n].max_accel
        for axis in range(2):
            angle, rate, drift = state[n, axis], state[n, axis + 2], desired[n, axis + 2]
            for k in range(STEPS):
                gap = desired[n, axis] - drift * (duration - k * h) - angle
                reach = sqrt(1.6 * most * abs(gap))
                goal = drift + min(max(0.25 * bandwidth * gap, -reach), reach)
                accel = min(max(bandwidth * (goal - rate), -most), most)
                faster = min(max(rate + h * accel, -top), top)
                angle += 0.5 * h * (rate + faster)
                rate = faster
            state[n, axis], state[n, axis + 2] = angle, rate


@kernel
def open_and_shut(heads: Record, state: Array, half: float, optics: Record, places: Array) -> None:
    """Write how the cameras stand as the shutter opens and as it closes.

    Args:
        heads: As in :mod:`mitt.vision.head`.
        state: In the middle of the exposure.
        half: Half the exposure [s].
        optics: Result, records of ``CAMERA``, shape (n, 2).
        places: Result, pan and tilt in the middle [rad], shape (n, 2).
    """
    for n in range(state.shape[0]):
        pan, tilt, dpan, dtilt = state[n]
        places[n, 0], places[n, 1] = pan, tilt
        aim_one(heads[n], pan - half * dpan, tilt - half * dtilt, optics[n, 0])
        aim_one(heads[n], pan + half * dpan, tilt + half * dtilt, optics[n, 1])


class Heads:
    """The heads of a rig in one trial.

    Attributes:
        packed: The heads as the kernels take them; no rows for a fixed rig.
        state: True angles [rad] and rates [rad/s], shape (n, 4).
    """

    def __init__(self, rig: Rig) -> None:
        """Begin at rest, where the heads wait for a ball."""
        self.packed = pack_heads(rig)
        self.state = np.zeros((len(rig.heads), 4))
        for row, head in zip(self.state, rig.heads, strict=True):
            row[:2] = head.search
        self._steps = [head.encoder_step for head in rig.heads]

    def turn(self, desired: Array | None, duration: float) -> None:
        """Follow ``desired`` for ``duration`` [s]; stay where there is none or it is not finite."""
        if desired is not None:
            desired = checks.array("gaze", desired, self.state.shape)
        if desired is None or not np.all(np.isfinite(desired)):
            desired = self.state * (1.0, 1.0, 0.0, 0.0)
        follow(self.packed, self.state, desired, BANDWIDTH, duration)

    def read(self, n: int) -> tuple[float, float]:
        """Return pan and tilt of a head as its encoders count them [rad]."""
        pan, tilt = float(self.state[n, 0]), float(self.state[n, 1])
        step = self._steps[n]
        if step == 0.0:
            return pan, tilt
        return step * round(pan / step), step * round(tilt / step)
