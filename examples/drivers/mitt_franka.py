"""A driver of Franka arms (FR3, Panda) by the vendor's pylibfranka. UNTESTED ON HARDWARE.

It was run against a fake of pylibfranka alone (tests/drivers). Written after pylibfranka's own
example ``joint_impedance_example.py`` and the reference of libfranka.

    [robot]
    driver = "franka"
    takes = "torque"
    joints = ["panda_joint1", "panda_joint2", "panda_joint4"]
    [robot.options]
    address = "172.16.0.2"

The robot wants a torque each millisecond, as mitt gives it; 20 in a row that it does not get stop
it. It adds the torque against its own weight itself, so that of its model is taken off. What mitt
does not move is held here by a spring and a damper. A torque may change by 1 N m in a millisecond
(libfranka, rate_limiting.h): more is cut off here. The catch of the simulated WAM needs between 2
and 4; with 1 the live loop stops it, as its joints do not do what they should. Which catch a Franka
can do within all its own limits says ``mitt design --limits franka-panda`` or ``franka-fr3``.

What it does not do: the gripper of Franka closes in some tenths of a second, a ball rests on a
finger for some hundredths. So a hand of one's own is needed, and is driven where ``_hand`` is
called. There is no call that engages the brakes: ``engage_brakes`` ends the control, and the
robot's own controller holds the arm.
"""

from collections.abc import Callable, Sequence
from typing import Any, final

import numpy as np
from numpy.typing import NDArray
from robot_clock import RobotClock  # type: ignore[import-not-found]
from robot_options import address_of, check_library  # type: ignore[import-not-found]

from mitt.arm.arm import Arm
from mitt.errors import InputError
from mitt.files.cell import Cell
from mitt.signals import ArmState, Command, Sighting

#: Names of the joints in the vendor's descriptions of the arms that the library drives.
NAMES = {kind: tuple(f"{kind}_joint{k}" for k in range(1, 8)) for kind in ("panda", "fr3")}
#: Largest change of a torque in a millisecond [N m]; spring [N m/rad] and damper [N m s/rad] of
#: the joints that are held.
RATE = 1.0
SPRING = 600.0
DAMPER = 40.0
#: Modes in which the robot takes commands, or will.
_FINE = ("Idle", "Move", "Other")


def check(cell: Cell, arm: Arm) -> list[str]:
    """Refuse a cell that this driver cannot be for; connects to nothing: the entry point."""
    index_of(cell, arm)
    address_of(cell)
    check_library("franka", "pylibfranka", "pylibfranka")
    return []


def index_of(cell: Cell, arm: Arm) -> NDArray[np.int64]:
    """Return which of the robot's joints the arm's are, by the names of a Panda or of an FR3."""
    names, takes = tuple(cell.robot.joints or arm.names), cell.robot.takes
    known = next((x for x in NAMES.values() if set(names) <= set(x)), None)
    if known is None or takes != "torque":
        wanted = " or of ".join(", ".join(x) for x in NAMES.values())
        raise InputError(
            "robot.joints", f"some of {wanted}; takes = torque", f"{', '.join(names)}; {takes}"
        )
    return np.array([known.index(x) for x in names])


def franka(cell: Cell, arm: Arm) -> "FrankaRobot":
    """Return the robot of a cell: the entry point."""
    check(cell, arm)
    import pylibfranka  # type: ignore[import-not-found]  # noqa: PLC0415 (the vendor's)

    return FrankaRobot(pylibfranka, address_of(cell), cell, arm)


@final
class FrankaRobot:
    """One arm; see :class:`mitt.cell.robot.Robot`.

    Attributes:
        brakes: Whether it holds the arm once the control has ended.
    """

    brakes = True

    def __init__(
        self,
        vendor: Any,  # noqa: ANN401 (pylibfranka)
        address: str,
        cell: Cell,
        arm: Arm,
        *,
        clock: RobotClock | None = None,
        ball: Callable[[], Sequence[Sighting]] = tuple,
        hand: Callable[[float], None] = lambda _: None,
        rate: float = RATE,
    ) -> None:
        """Connect.

        Args:
            vendor: The module ``pylibfranka``.
            address: Of the robot.
            cell: What its file says.
            arm: The arm.
            clock: Turns the robot's stamps into times of day.
            ball: Positions of the ball since the last call, where no camera sees it.
            hand: Takes the closing angle [rad].
            rate: Largest change of a torque in a millisecond [N m].
        """
        self._index = index_of(cell, arm)
        self._torques, self._robot = vendor.Torques, vendor.Robot(address)
        self._model, self._control = self._robot.load_model(), None
        self._state = self._robot.read_once()
        self._clock, self._ball, self._hand, self._rate = clock or RobotClock(), ball, hand, rate
        self._held, self._sent = np.array(self._state.q), np.zeros(7)

    def read(self, timeout: float) -> Sequence[ArmState]:
        """Return the next reading; the vendor's library waits for it as long as it likes."""
        if timeout <= 0.0:
            return ()
        control = self._control
        self._state = self._robot.read_once() if control is None else control.readOnce()[0]
        q, dq = np.array(self._state.q), np.array(self._state.dq)
        t = self._clock.at(self._state.time.to_sec())
        return (ArmState(t=t, q=q[self._index], dq=dq[self._index]),)

    def points(self) -> Sequence[Sighting]:
        """Return what else sees the ball."""
        return self._ball()

    def write(self, command: Command, answers: float) -> None:  # noqa: ARG002 (it answers the last)
        """Send the torques that answer the last reading."""
        if self._control is None:
            return
        q, dq = np.array(self._state.q), np.array(self._state.dq)
        tau = SPRING * (self._held - q) - DAMPER * dq
        weight = np.array(self._model.gravity(self._state))
        tau[self._index] = command.tau - weight[self._index]
        self._sent = np.clip(tau, self._sent - self._rate, self._sent + self._rate)
        self._control.writeOnce(self._torques(self._sent.tolist()))
        self._hand(command.hand)

    def engage_brakes(self) -> None:
        """End the control: the robot's own controller holds the arm."""
        if self._control is not None:
            self._control = None
            self._robot.stop()

    def release(self) -> None:
        """Recover from a reflex; or take control where there is none, as commands follow then."""
        if self.trouble():
            self._control = None
            self._robot.automatic_error_recovery()
            self._state = self._robot.read_once()
        elif self._control is None:
            self._held, self._sent = np.array(self._state.q), np.zeros(7)
            self._clock.fix()
            self._control = self._robot.start_torque_control()

    def waits(self) -> str:
        """Return what keeps it from being commanded: nothing does."""
        return ""

    def conflict(self) -> str:
        """Return who else commands it: nobody can."""
        return ""

    def trouble(self) -> str:
        """Return the robot's mode where it takes no commands, and its errors."""
        mode = str(self._state.robot_mode).rpartition(".")[2]
        return "" if mode in _FINE else f"{mode} {self._state.current_errors}".strip()

    def news(self) -> Sequence[str]:
        """Return none: nobody knows what became of a ball."""
        return ()

    def close(self) -> None:
        """End the control."""
        self.engage_brakes()
