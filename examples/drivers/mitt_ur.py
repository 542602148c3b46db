"""A driver of Universal Robots by ur_rtde. UNTESTED ON HARDWARE.

It was run against a fake of ur_rtde alone (tests/drivers). ur_rtde is not the vendor's own but the
client in Python that most use; written after its reference.

    [robot]
    driver = "ur"
    takes = "velocity"
    delay = 0.006                 # measure both: a step of one joint, and how it follows
    servo = 8.0
    joints = ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint"]
    [robot.options]
    address = "192.168.56.101"

A UR reads its joints and takes commands 500 times a second, the catcher makes a tick each
millisecond. So each reading comes here with one in the middle between it and the last, and every
second tick is answered. What this costs is 2 ms more of delay, which ``robot.delay`` has to say.

What cannot be had: ``speedJ`` accelerates by 40 rad/s^2 at most and the joints turn at 3.14 rad/s
(ur_rtde, UR_JOINT_ACCELERATION_MAX, UR_JOINT_VELOCITY_MAX). The catch of the simulated WAM, at up
to 20 rad/s, follows its commands with 200 rad/s^2 and is stopped with 40. Which throws a UR can
catch within its own limits says ``mitt design``. There is no call that engages the brakes of an arm
in operation: ``engage_brakes`` lets it stop and be held by its drives.
"""

from collections.abc import Callable, Sequence
from typing import Any, final

import numpy as np
from numpy.typing import NDArray
from robot_clock import RobotClock, wait  # type: ignore[import-not-found]
from robot_options import address_of, check_library  # type: ignore[import-not-found]

from mitt.arm.arm import Arm
from mitt.clock import monotonic
from mitt.errors import InputError
from mitt.files.cell import Cell
from mitt.signals import ArmState, Command, Sighting

NAMES = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
)
#: Acceleration of speedJ and of a stop [rad/s^2], time for which a speed counts [s].
FASTEST = 40.0
STOP = 10.0
PERIOD = 0.002
#: Time between two looks for a reading [s].
_LOOK = 1e-4


def check(cell: Cell, arm: Arm) -> list[str]:
    """Refuse a cell that this driver cannot be for; connects to nothing: the entry point."""
    index_of(cell, arm)
    address_of(cell)
    for library in ("dashboard_client", "rtde_control", "rtde_receive"):
        check_library("ur", library, "ur_rtde")
    return []


def index_of(cell: Cell, arm: Arm) -> NDArray[np.int64]:
    """Return which of the robot's joints the arm's are."""
    names, takes = tuple(cell.robot.joints or arm.names), cell.robot.takes
    if not set(names) <= set(NAMES) or takes != "velocity":
        wanted = f"some of {', '.join(NAMES)}; takes = velocity"
        raise InputError("robot.joints", wanted, f"{', '.join(names)}; {takes}")
    return np.array([NAMES.index(x) for x in names])


def ur(cell: Cell, arm: Arm) -> "UrRobot":
    """Return the robot of a cell: the entry point."""
    check(cell, arm)
    import dashboard_client  # type: ignore[import-not-found]  # noqa: PLC0415 (of ur_rtde)
    import rtde_control  # type: ignore[import-not-found]  # noqa: PLC0415
    import rtde_receive  # type: ignore[import-not-found]  # noqa: PLC0415

    address = address_of(cell)
    dashboard = dashboard_client.DashboardClient(address)
    dashboard.connect()
    return UrRobot(
        rtde_control.RTDEControlInterface(address),
        rtde_receive.RTDEReceiveInterface(address),
        dashboard.unlockProtectiveStop,
        cell,
        arm,
    )


@final
class UrRobot:
    """One arm; see :class:`mitt.cell.robot.Robot`.

    Attributes:
        brakes: Whether its drives hold the arm once it has stopped.
    """

    brakes = True

    def __init__(
        self,
        control: Any,  # noqa: ANN401 (ur_rtde)
        receive: Any,  # noqa: ANN401 (ur_rtde)
        unlock: Callable[[], object],
        cell: Cell,
        arm: Arm,
        *,
        clock: RobotClock | None = None,
        ball: Callable[[], Sequence[Sighting]] = tuple,
        hand: Callable[[float], None] = lambda _: None,
        acceleration: float = FASTEST,
    ) -> None:
        """Take what is connected.

        Args:
            control: ``rtde_control.RTDEControlInterface``.
            receive: ``rtde_receive.RTDEReceiveInterface``.
            unlock: Acknowledges a protective stop.
            cell: What its file says.
            arm: The arm.
            clock: Turns the robot's stamps into times of day.
            ball: Positions of the ball since the last call, where no camera sees it.
            hand: Takes the closing angle [rad].
            acceleration: Of ``speedJ`` [rad/s^2].
        """
        self._index = index_of(cell, arm)
        self._control, self._receive, self._unlock = control, receive, unlock
        self._clock, self._ball, self._hand = clock or RobotClock(), ball, hand
        self._acceleration, self._watchdog = acceleration, cell.robot.watchdog
        self._stamp, self._moves = -np.inf, False
        self._last: ArmState | None = None

    def read(self, timeout: float) -> Sequence[ArmState]:
        """Return the next reading, after one in the middle between it and the last."""
        end = monotonic() + timeout
        while (stamp := self._receive.getTimestamp()) == self._stamp:
            if monotonic() >= end:
                return ()
            wait(_LOOK)
        q, dq = self._receive.getActualQ(), self._receive.getActualQd()
        self._stamp = stamp
        at = self._clock.at(stamp)
        new = ArmState(t=at, q=np.array(q)[self._index], dq=np.array(dq)[self._index])
        last, self._last = self._last, new
        if last is None or not 0.0 < new.t - last.t < 1.5 * PERIOD:
            return (new,)
        middle = ArmState(
            t=0.5 * (last.t + at), q=0.5 * (last.q + new.q), dq=0.5 * (last.dq + new.dq)
        )
        return (middle, new)

    def points(self) -> Sequence[Sighting]:
        """Return what else sees the ball."""
        return self._ball()

    def write(self, command: Command, answers: float) -> None:  # noqa: ARG002 (it answers the last)
        """Send the speeds."""
        if not self._moves:
            return
        speeds = np.zeros(len(NAMES))
        speeds[self._index] = command.dq  # corrected by mitt for angles that are off
        self._control.speedJ(speeds.tolist(), self._acceleration, PERIOD)
        self._control.kickWatchdog()
        self._hand(command.hand)

    def engage_brakes(self) -> None:
        """Let the arm stop; its drives hold it then."""
        if self._moves:
            self._moves = False
            self._control.speedStop(STOP)

    def release(self) -> None:
        """Acknowledge a stop and start the program anew; without one, commands count from now."""
        if self.trouble():
            self._moves = False
            if self._receive.isProtectiveStopped():
                self._unlock()
            if not self._receive.isEmergencyStopped():
                self._control.reuploadScript()  # its program ended with the stop
        else:
            self._clock.fix()
            self._control.setWatchdog(1.0 / self._watchdog)
            self._moves = True

    def waits(self) -> str:
        """Return what keeps it from being commanded: nothing does."""
        return ""

    def conflict(self) -> str:
        """Return who else commands it: nobody can."""
        return ""

    def trouble(self) -> str:
        """Return why the robot takes no commands."""
        if self._receive.isEmergencyStopped():
            return "emergency stop"
        if self._receive.isProtectiveStopped():
            return "protective stop"
        return "" if self._control.isProgramRunning() else "its program does not run"

    def news(self) -> Sequence[str]:
        """Return none: nobody knows what became of a ball."""
        return ()

    def close(self) -> None:
        """Stop, and end the program on the robot."""
        self.engage_brakes()
        self._control.stopScript()
