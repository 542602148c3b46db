"""Universal Robots by ur_rtde, the client in Python that most use. No real arm was used yet.

Options of ``[robot.options]``:

| option      | what                                                                           |
|-------------|--------------------------------------------------------------------------------|
| address     | of the robot                                                                   |
| lookahead   | of ``servoj``, for positions: 0.03 to 0.2 [s]                                  |
| gain        | of ``servoj``, for positions: 100 to 2000                                      |
| hand_output | standard digital output that closes the hand, 0 to 7; none if left out         |

A UR reads its joints and takes commands 500 times a second: ``robot.rate = 500``. It takes

- speeds by ``speedj``: its leading axis accelerates by 40 rad/s^2 at most, the others in step;
- positions by ``servoj``: users measure 34 ms of lag with a lookahead of 0.03 s;
- torques by ``direct_torque``, which the script of ur_rtde 1.6.5 has from PolyScope 5.26 on. The
  controller adds those against the weight of arm and payload, so that mitt's are sent without, but
  for the weight of a load that the cell adds (``arm.load``): that the robot knows nothing of.

``robot.delay`` and ``robot.servo`` say how it follows: ``mitt measure`` finds both.

A command is written into the input registers, which the controller looks at each 2 ms: nothing else
is sent between two commands, or it would see that instead. Each command also feeds the watchdog.

There is no call that engages the brakes of an arm in operation: ``engage_brakes`` lets it stop, and
its drives hold it.

The hand is closed and opened by a digital output, over a connection of its own (RTDE takes inputs
of several clients): it is set where the hand is commanded beyond half its closing angle. The robot
says how its outputs are; one that has not followed for 0.2 s is a fault.
"""

from collections.abc import Callable, Sequence
from math import inf
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from mitt.clock import monotonic, pause
from mitt.core.arm.arm import Arm
from mitt.core.errors import InputError, check_package
from mitt.core.signals import TICK, ArmState, Array, Command, Sighting
from mitt.io.cell import Cell, bare_arm
from mitt.robot.cell.device_clock import DeviceClock
from mitt.robot.cell.plugins import given_options

NAMES: Final = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
)
#: Time from one cycle of the controller to the next [s].
PERIOD: Final = 0.002
#: Acceleration of speedj, the largest that ur_rtde takes, and of a stop [rad/s^2].
_FASTEST: Final = 40.0
_STOP: Final = 10.0
#: Spring [N m/rad] and damper [N m s/rad] of the joints that are held, under torques.
_SPRING: Final = 200.0
_DAMPER: Final = 8.0
#: Time between two looks for a reading [s].
_LOOK: Final = 1e-4
#: Time in which the robot says that an output is as it was set [s].
_FOLLOWS: Final = 0.2
#: Digital outputs that a user may set, and what stands for none of them.
_OUTPUTS: Final = range(8)
_NONE: Final = -1.0
_OPTIONS: Final = {"address": "", "lookahead": 0.03, "gain": 300.0, "hand_output": _NONE}


def check_ur(cell: Cell, arm: Arm) -> list[str]:
    """Refuse a cell that this driver cannot be for; connects to nothing: the entry point."""
    ur_index(cell, arm)
    of = given_options("robot.options", cell.robot.options, _OPTIONS)
    if not of["address"]:
        raise InputError("robot.options.address", "the address of the robot", "none")
    for name, low, high in (("lookahead", 0.03, 0.2), ("gain", 100.0, 2000.0)):
        if not low <= of[name] <= high:
            raise InputError(f"robot.options.{name}", f"{low:g} to {high:g}", of[name])
    if of["hand_output"] not in (_NONE, *_OUTPUTS):
        raise InputError("robot.options.hand_output", "an output, 0 to 7", of["hand_output"])
    if round(PERIOD / TICK) != cell.robot.ticks:
        raise InputError("robot.rate", "500 Hz, as the controller has it", cell.robot.rate)
    for library in ("dashboard_client", "rtde_control", "rtde_io", "rtde_receive"):
        check_package("driver 'ur'", library, "ur_rtde", "ur")
    return []


def ur_index(cell: Cell, arm: Arm) -> NDArray[np.int64]:
    """Return which of the robot's joints the arm's are."""
    names = tuple(cell.robot.joints or arm.names)
    if not set(names) <= set(NAMES):
        raise InputError("robot.joints", f"some of {', '.join(NAMES)}", ", ".join(names))
    return np.array([NAMES.index(x) for x in names])


def ur_driver(cell: Cell, arm: Arm) -> "UrRobot":
    """Return the robot of a cell: the entry point."""
    check_ur(cell, arm)
    import dashboard_client  # noqa: PLC0415 (of ur_rtde)
    import rtde_control  # noqa: PLC0415
    import rtde_io  # noqa: PLC0415
    import rtde_receive  # noqa: PLC0415

    of = given_options("robot.options", cell.robot.options, _OPTIONS)
    address, rate = str(of["address"]), 1.0 / PERIOD
    dashboard = dashboard_client.DashboardClient(address)
    dashboard.connect()
    return UrRobot(
        rtde_control.RTDEControlInterface(address, rate),
        rtde_receive.RTDEReceiveInterface(address, rate),
        dashboard.unlockProtectiveStop,
        cell,
        arm,
        outputs=None if of["hand_output"] == _NONE else rtde_io.RTDEIOInterface(address),
    )


@final
class UrRobot:
    """One arm; see :class:`mitt.robot.cell.robot.Robot`.

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
        outputs: Any = None,  # noqa: ANN401 (ur_rtde)
        clock: DeviceClock | None = None,
        acceleration: float = _FASTEST,
    ) -> None:
        """Take what is connected.

        Args:
            control: ``rtde_control.RTDEControlInterface``.
            receive: ``rtde_receive.RTDEReceiveInterface``.
            unlock: Acknowledges a protective stop.
            cell: What its file says.
            arm: The arm.
            outputs: ``rtde_io.RTDEIOInterface``; None where no hand is driven.
            clock: Turns the robot's stamps into times of day.
            acceleration: Of ``speedj`` [rad/s^2].
        """
        of = given_options("robot.options", cell.robot.options, _OPTIONS)
        self._index, self._takes = ur_index(cell, arm), cell.robot.takes
        self._known = bare_arm(cell, arm)
        self._control, self._receive, self._unlock = control, receive, unlock
        self._clock, self._acceleration = clock or DeviceClock(), acceleration
        self._lookahead, self._gain = of["lookahead"], of["gain"]
        hand = arm.model.hand
        self._outputs, self._output = outputs, int(of["hand_output"])
        self._closes = inf if hand is None else 0.5 * hand.closed  # [rad]
        self._closed: bool | None = None
        self._set = 0.0
        self._watchdog, self._stamp, self._moves = cell.robot.watchdog, -np.inf, False
        self._q = self._dq = self._held = np.zeros(len(NAMES))
        self._weight(arm.q_ready)  # loaded before it is needed

    def read(self, timeout: float) -> Sequence[ArmState]:
        """Return the next reading."""
        end = monotonic() + timeout
        while (stamp := self._receive.getTimestamp()) == self._stamp:
            if monotonic() >= end:
                return ()
            pause(_LOOK)
        self._stamp, at = stamp, self._clock.at(stamp)
        self._q, self._dq = (
            np.array(x) for x in (self._receive.getActualQ(), self._receive.getActualQd())
        )
        return (ArmState(t=at, q=self._q[self._index], dq=self._dq[self._index]),)

    def points(self) -> Sequence[Sighting]:
        """Return none: the arm sees no ball."""
        return ()

    def write(self, command: Command, answers: float) -> None:  # noqa: ARG002 (it answers the last)
        """Send what the drives take."""
        if not self._moves:
            return
        self._drive_hand(closed=command.hand > self._closes)
        if self._takes == "velocity":
            speeds = np.zeros(len(NAMES))
            speeds[self._index] = command.dq  # corrected by mitt for angles that are off
            self._control.speedJ(speeds.tolist(), self._acceleration, PERIOD)
        elif self._takes == "position":
            angles = self._held.copy()
            angles[self._index] = command.q
            times = PERIOD, self._lookahead
            self._control.servoJ(angles.tolist(), 0.0, 0.0, *times, self._gain)
        else:
            torques = _SPRING * (self._held - self._q) - _DAMPER * self._dq
            torques[self._index] = command.tau - self._weight(self._q[self._index])
            self._control.directTorque(torques.tolist())

    def _drive_hand(self, *, closed: bool) -> None:
        """Set the hand's output where that is new."""
        if self._outputs is not None and closed is not self._closed:
            self._closed, self._set = closed, monotonic()
            self._outputs.setStandardDigitalOut(self._output, closed)

    def _hand_trouble(self) -> str:
        """Return that the hand's output is not as it was set; nothing if it is, or may be yet."""
        if self._closed is None or monotonic() - self._set < _FOLLOWS:
            return ""
        if bool(self._receive.getDigitalOutState(self._output)) is self._closed:
            return ""
        return f"digital output {self._output}, the hand's, is not as it was set"

    def _weight(self, q: Array) -> Array:
        """Return the torques against the arm's weight that the robot itself adds [N m]."""
        still = np.zeros(len(q))
        return self._known.inverse_dynamics(q, still, still)

    def engage_brakes(self) -> None:
        """Let the arm stop; its drives hold it then."""
        if self._moves:
            self._moves = False
            stop = self._control.servoStop if self._takes == "position" else self._control.speedStop
            stop(_STOP)

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
            self._held, self._moves = np.array(self._receive.getActualQ()), True

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
        if not self._control.isProgramRunning():
            return "its program does not run"
        return self._hand_trouble()

    def news(self) -> Sequence[str]:
        """Return none: nobody knows what became of a ball."""
        return ()

    def close(self) -> None:
        """Stop, and end the program on the robot."""
        self.engage_brakes()
        self._control.stopScript()
