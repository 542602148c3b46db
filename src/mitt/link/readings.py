"""What the first readings of a robot say: whether they can be those of the arm, at rest."""

from collections import deque
from collections.abc import Callable, Sequence
from typing import final

import numpy as np

from mitt.errors import InputError
from mitt.link.positions import Positions
from mitt.link.robot import Robot
from mitt.link.stamps import Lag
from mitt.robot.arm import Arm
from mitt.signals import ArmState, Array

#: How far outside its range a joint may be read before a unit is doubted [rad], and how far an arm
#: may rest there that is to be moved [rad].
_OUTSIDE, _BESIDE = 0.5, 0.02
#: Speed of a joint from which an arm is not at rest [rad/s]: more than a count of an encoder.
_MOVES = 0.5
#: For how long readings are looked at [s], and the least time that their stamps have to span.
WATCHED, _SPAN = 0.05, 0.02
#: Time without a look after which what was read before says nothing [s].
_FORGETS = 0.1


def wrong_with(arm: Arm, readings: Sequence[ArmState]) -> str:
    """Return why an arm cannot be moved from the newest reading, nothing if it can.

    It moves where its speeds or its positions say so: not every robot sends speeds.

    Args:
        arm: The arm.
        readings: Those of the last 50 to 100 ms, oldest first, one at least.

    Raises:
        InputError: A position is far outside its joint's range.
    """
    rows = np.array([x.q for x in readings])
    _check_range(arm, rows[-1])
    if not np.all(np.isfinite(rows)):
        return "joint positions that are no numbers"
    beyond = np.maximum(arm.q_min - rows[-1], rows[-1] - arm.q_max)
    if np.any(beyond > _BESIDE):
        k = int(np.argmax(beyond))
        return f"{arm.names[k]} is {beyond[k]:.2f} rad outside its range: move it back by hand"
    span = readings[-1].t - readings[0].t
    if not span >= _SPAN:
        return f"joint states whose stamps go on by {1e3 * span:.3g} ms in {1e3 * WATCHED:.0f}"
    by_position = np.ptp(rows, axis=0) > _MOVES * span
    if np.any(by_position) or np.any(np.abs(readings[-1].dq) > _MOVES):
        return "the arm moves already"
    return ""


def _check_range(arm: Arm, q: Array) -> None:
    """Refuse a position that cannot be one of this joint [rad], shape (n,)."""
    outside = np.flatnonzero((q < arm.q_min - _OUTSIDE) | (q > arm.q_max + _OUTSIDE))
    if len(outside):
        k = int(outside[0])
        wanted = f"{arm.q_min[k]:.2f} to {arm.q_max[k]:.2f} rad"
        do = "joint states are in radians (REP 103); is it in degrees, or another joint?"
        raise InputError(f"position of {arm.names[k]}", wanted, f"{q[k]:.4g}", do=do)


def check_reading(reading: ArmState, n: int) -> None:
    """Refuse a reading of another shape; what is no number is the catcher's matter.

    Raises:
        InputError: It is none of an arm with ``n`` joints.
    """
    if not isinstance(reading, ArmState) or not isinstance(reading.t, float | int):
        raise InputError("a reading", "an ArmState with its stamp [s]", repr(reading)[:80])
    if np.shape(reading.q) != (n,) or np.shape(reading.dq) != (n,):
        raise InputError("a reading", f"{n} angles and {n} speeds", repr(reading)[:80])


@final
class Watch:
    """Reads a robot that waits, and says why its arm cannot be moved."""

    def __init__(
        self, arm: Arm, robot: Robot, lag: Lag, positions: Positions, *,
        clock: Callable[[], float], silence: float,
    ) -> None:  # fmt: skip
        """Take the arm, its robot, what knows how late readings come, and the steady clock.

        Args:
            arm: The arm.
            robot: Its driver.
            lag: How late readings come.
            positions: What knows whether positions of the ball can be used.
            clock: The steady clock by which readings arrive [s].
            silence: Time without a reading after which the robot is lost [s].
        """
        self._arm, self._robot, self._lag, self._positions = arm, robot, lag, positions
        self._clock, self._silence = clock, silence
        self._seen, self._looked = deque[tuple[float, ArmState]](), -np.inf

    def look(self) -> str:
        """Read, at first for 50 ms; return what is wrong, nothing if all is well.

        Raises:
            InputError: What the robot says does not fit the arm: names, units, two publishers.
        """
        if self._clock() > self._looked + _FORGETS:
            self._seen.clear()
        late, full = "", False
        while not full:
            new = self._robot.read(self._silence)
            self._looked = now = self._clock()
            if not new:
                self._seen.clear()
                return "; ".join(x for x in ("no joint states", self._robot.waits()) if x)
            for reading in new:
                check_reading(reading, self._arm.n)
                self._seen.append((now, reading))
            late = self._lag.fault(new[-1].t, now)
            full = now - self._seen[0][0] >= WATCHED
        while now - self._seen[0][0] > 2.0 * WATCHED:
            self._seen.popleft()
        newest = self._seen[-1][1].t + self._lag.later
        self._positions.take(self._robot.points(), newest)
        self._positions.upto(np.inf)
        wrong = wrong_with(self._arm, [x for _, x in self._seen])
        found = (wrong, self._robot.waits(), self._robot.trouble(), late, self._positions.fault)
        return "; ".join(x for x in found if x)
