"""Franka arms (FR3, Panda) by the maker's client, pylibfranka. No real arm was used yet.

Options of ``[robot.options]``:

| option           | what                                                                          |
|------------------|-------------------------------------------------------------------------------|
| address          | of the robot                                                                  |
| realtime         | false where mitt runs without a real-time kernel, which libfranka refuses     |
| collision_force  | force of a contact at which the robot stops, if the touch of a ball is beyond |
|                  | what it was set to [N]                                                        |
| collision_torque | torque of a joint at which it does [N m]; both or none                        |
| load             | mass at the flange that the robot does not know of, as that of a basket [kg]  |
| load_height      | height of its centre over the flange [m]                                      |

The robot wants a torque each millisecond, as mitt gives it; 20 in a row that it does not get stop
it. It adds the torque against its own weight itself, so that of its model is taken off. What mitt
does not move is held here by a spring and a damper. A torque may change by 1 N m in a millisecond,
with libfranka's own margin, from the one that the robot took last. Which that was is known of a
state that is a millisecond old: what was sent since may have been taken, or lost, or may be on its
way. So more is cut off here than lies within a step of each of these. Which catch a Franka can do
within all its limits says ``mitt design --limits franka-panda`` or ``franka-fr3``.

A reflex of the robot is no failure of the driver: it is told by :meth:`FrankaRobot.trouble`, in
libfranka's words, until a person acknowledges it. libfranka throws it once, and waits for ever
where it is asked again.

There is no call that engages the brakes: ``engage_brakes`` ends the control, and the robot's own
controller holds the arm. The gripper of Franka closes in some tenths of a second, a ball rests on a
finger for some hundredths: the hand is not driven here.
"""

from collections import deque
from collections.abc import Sequence
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from mitt.core.arm.arm import Arm
from mitt.core.errors import InputError, check_package
from mitt.core.signals import ArmState, Array, Command, Sighting
from mitt.io.cell import Cell
from mitt.robot.cell.device_clock import DeviceClock
from mitt.robot.cell.plugins import given_options

#: Names of the joints in the vendor's descriptions of the arms that the library drives.
NAMES: Final = {kind: tuple(f"{kind}_joint{k}" for k in range(1, 8)) for kind in ("panda", "fr3")}
#: Largest change of a torque in a millisecond [N m]: 1 N m less the 1e-3 N m/s of libfranka's
#: rate_limiting.h (kMaxTorqueRate, kLimitEps).
RATE: Final = 1.0 - 1e-6
#: Torques that an FR3 or a Panda takes, those against its weight left out [N m] (control_parameters
#: of Franka's documents).
_MOST: Final = np.array([87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0])
#: What the torques of a state may differ by from those that were sent [N m], and of how many that
#: were sent it is remembered: the robot stops where 20 in a row do not come.
_SAME: Final = 1e-6
_ON_THE_WAY: Final = 20
#: Spring [N m/rad] and damper [N m s/rad] of the joints that are held.
SPRING: Final = 600.0
DAMPER: Final = 40.0
#: Radius of gyration of a load whose inertia nobody knows [m].
_GYRATION: Final = 0.05
#: Modes in which the robot takes commands, or will.
_FINE: Final = ("Idle", "Move", "Other")
_OPTIONS: Final = {
    "address": "",
    "realtime": True,
    "collision_force": 0.0,
    "collision_torque": 0.0,
    "load": 0.0,
    "load_height": 0.0,
}


def check_franka(cell: Cell, arm: Arm) -> list[str]:
    """Refuse a cell that this driver cannot be for; connects to nothing: the entry point."""
    franka_index(cell, arm)
    of = given_options("robot.options", cell.robot.options, _OPTIONS)
    if not of["address"]:
        raise InputError("robot.options.address", "the address of the robot", "none")
    if (of["collision_force"] > 0.0) != (of["collision_torque"] > 0.0):
        given = (
            f"collision_force {of['collision_force']}, collision_torque {of['collision_torque']}"
        )
        raise InputError("robot.options", "both collision_force and collision_torque", given)
    check_package("driver 'franka'", "pylibfranka", "pylibfranka", "franka")
    return []


def franka_index(cell: Cell, arm: Arm) -> NDArray[np.int64]:
    """Return which of the robot's joints the arm's are, by the names of a Panda or of an FR3."""
    names, takes = tuple(cell.robot.joints or arm.names), cell.robot.takes
    known = next((x for x in NAMES.values() if set(names) <= set(x)), None)
    if known is None or takes != "torque":
        wanted = " or of ".join(", ".join(x) for x in NAMES.values())
        raise InputError(
            "robot.joints", f"some of {wanted}; takes = torque", f"{', '.join(names)}; {takes}"
        )
    return np.array([known.index(x) for x in names])


def franka_driver(cell: Cell, arm: Arm) -> "FrankaRobot":
    """Return the robot of a cell: the entry point."""
    check_franka(cell, arm)
    import pylibfranka  # noqa: PLC0415 (the maker's)

    return FrankaRobot(pylibfranka, cell, arm)


@final
class FrankaRobot:
    """One arm; see :class:`mitt.robot.cell.robot.Robot`.

    Attributes:
        brakes: Whether it holds the arm once the control has ended.
        state: The newest state of the robot, as libfranka gives it.
    """

    brakes = True

    def __init__(
        self,
        vendor: Any,  # noqa: ANN401 (pylibfranka)
        cell: Cell,
        arm: Arm,
        *,
        clock: DeviceClock | None = None,
    ) -> None:
        """Connect.

        Args:
            vendor: The module ``pylibfranka``.
            cell: What its file says.
            arm: The arm.
            clock: Turns the robot's stamps into times of day.
        """
        of = given_options("robot.options", cell.robot.options, _OPTIONS)
        self._index, self._vendor = franka_index(cell, arm), vendor
        kind = vendor.RealtimeConfig
        self._robot = vendor.Robot(of["address"], kind.kEnforce if of["realtime"] else kind.kIgnore)
        if of["collision_force"] > 0.0:
            torques, forces = [of["collision_torque"]] * 7, [of["collision_force"]] * 6
            self._robot.set_collision_behavior(torques, torques, forces, forces)
        if of["load"] > 0.0:
            inertia = np.diag([of["load"] * _GYRATION**2] * 3).ravel().tolist()
            self._robot.set_load(of["load"], [0.0, 0.0, of["load_height"]], inertia)
        self._model, self._control = self._robot.load_model(), None
        self._clock, self._reflex = clock or DeviceClock(), ""
        self.state = self._robot.read_once()
        self._held, self._sent = np.array(self.state.q), deque[Array](maxlen=_ON_THE_WAY)

    def read(self, timeout: float) -> Sequence[ArmState]:
        """Return the next reading; the maker's library waits for it as long as it likes."""
        if timeout <= 0.0:
            return ()
        try:
            control = self._control
            self.state = self._robot.read_once() if control is None else control.readOnce()[0]
        except self._vendor.ControlException as error:
            self._end(error)
            self.state = self._robot.read_once()
        q, dq = np.array(self.state.q), np.array(self.state.dq)
        t = self._clock.at(self.state.time.to_sec())
        return (ArmState(t=t, q=q[self._index], dq=dq[self._index]),)

    def points(self) -> Sequence[Sighting]:
        """Return none: the arm sees no ball."""
        return ()

    def write(self, command: Command, answers: float) -> None:  # noqa: ARG002 (it answers the last)
        """Send the torques that answer the last reading."""
        if self._control is None:
            return
        q, dq = np.array(self.state.q), np.array(self.state.dq)
        tau = SPRING * (self._held - q) - DAMPER * dq
        weight = np.array(self._model.gravity(self.state))
        tau[self._index] = command.tau - weight[self._index]
        tau = self._within_a_step(tau)
        try:
            self._control.writeOnce(self._vendor.Torques(tau.tolist()))
        except self._vendor.ControlException as error:
            self._end(error)

    def _within_a_step(self, tau: Array) -> Array:
        """Return torques that differ by a step at most from any that the robot may have now."""
        took = np.array(self.state.tau_J_d)
        for k in range(len(self._sent) - 1, -1, -1):
            if np.allclose(self._sent[k], took, rtol=0.0, atol=_SAME):
                for _ in range(k):  # those before it have been taken, or lost
                    self._sent.popleft()
                break
        may = np.array([took, *self._sent])
        low, high = may.max(axis=0) - RATE, may.min(axis=0) + RATE
        tau = np.clip(tau, -_MOST, _MOST)
        tau = np.where(low > high, 0.5 * (low + high), np.clip(tau, low, high))
        self._sent.append(tau)
        return tau

    def _end(self, error: Exception) -> None:
        """Note that the robot has ended the control, and in which words."""
        self._control, self._reflex = None, str(error)

    def engage_brakes(self) -> None:
        """End the control: the robot's own controller holds the arm."""
        if self._control is not None:
            self._control = None
            self._robot.stop()

    def release(self) -> None:
        """Recover from a reflex; or take control where there is none, as commands follow then."""
        if self.trouble():
            self._control, self._reflex = None, ""
            self._robot.automatic_error_recovery()
            self.state = self._robot.read_once()
        elif self._control is None:
            self._held = np.array(self.state.q)
            self._sent.clear()
            self._clock.fix()
            self._control = self._robot.start_torque_control()

    def waits(self) -> str:
        """Return what keeps it from being commanded: nothing does."""
        return ""

    def conflict(self) -> str:
        """Return who else commands it: nobody can."""
        return ""

    def trouble(self) -> str:
        """Return the robot's mode where it takes no commands, and why, in libfranka's words."""
        mode = str(self.state.robot_mode).rpartition(".")[2]
        if mode in _FINE and not self._reflex:
            return ""
        return f"{mode} {self._reflex or self.state.current_errors}".strip()

    def news(self) -> Sequence[str]:
        """Return none: nobody knows what became of a ball."""
        return ()

    def close(self) -> None:
        """End the control."""
        self.engage_brakes()
