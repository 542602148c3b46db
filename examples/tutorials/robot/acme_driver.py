"""A driver of mitt for the controller of an invented make."""

from collections.abc import Sequence

import numpy as np
from acme_client import AcmeClient, State

from mitt.core.arm.arm import Arm
from mitt.core.errors import InputError
from mitt.core.signals import ArmState, Command, Sighting
from mitt.io.cell import Cell
from mitt.robot.cell.drivers import local_robot
from mitt.robot.cell.prepare import cell_map, prepare
from mitt.robot.cell.session import rehearse

#: The controller's joints in its own order, and which way each turns in the arm's description.
JOINTS = ("elbow", "lift", "yaw")
SENSE = np.array([1.0, -1.0, 1.0])
#: Closing angle of the hand at 100 percent [rad].
CLOSED = 0.5 * np.pi


def acme(cell: Cell, arm: Arm) -> "AcmeRobot":
    """Return the robot of a cell: the entry point."""
    address = cell.robot.options.get("address")
    if address != "simulated":  # here the vendor's library connects to the address
        raise InputError("robot.options.address", "simulated: no other is there", repr(address))
    prepared = prepare(cell)
    rehearse(prepared, cell_map(prepared))  # a simulated arm is loaded before it keeps time
    simulated = local_robot(prepared, seed=5, count=cell.throws or 1000)
    return AcmeRobot(AcmeClient(simulated, in_time=True), cell, arm)


class AcmeRobot:
    """One arm; what each method owes is said in ``mitt.robot.cell.robot.Robot``."""

    brakes = True

    def __init__(self, client: AcmeClient, cell: Cell, arm: Arm) -> None:
        """Take a connection; the names of the cell's joints say in which order they are needed."""
        names = tuple(cell.robot.joints or arm.names)
        if sorted(names) != sorted(JOINTS) or cell.robot.takes != "torque":
            wanted = f"{', '.join(JOINTS)} in the arm's order, takes = torque"
            raise InputError("robot.joints", wanted, f"{', '.join(names)}, {cell.robot.takes}")
        self._client = client
        self._index = np.array([JOINTS.index(name) for name in names])
        self._noise = cell.source.sigma**2 * np.eye(3)

    def read(self, timeout: float) -> Sequence[ArmState]:
        """Return all readings since the last call, oldest first; wait for one if there is none."""
        return [self._reading(state) for state in self._client.states(1e3 * timeout)]

    def _reading(self, state: State) -> ArmState:
        """Return a reading in seconds and radians, in the arm's order and sense."""
        q, dq = (np.radians(SENSE * x)[self._index] for x in (state.angles, state.speeds))
        return ArmState(t=1e-3 * state.time, q=q, dq=dq)

    def points(self) -> Sequence[Sighting]:
        """Return where the ball was seen [m], in the time of the readings."""
        return [
            Sighting(t=1e-3 * time, found=True, r_o=1e-3 * np.array(r), covariance=self._noise)
            for time, r in self._client.balls()
        ]

    def write(self, command: Command, answers: float) -> None:  # noqa: ARG002 (the newest reading)
        """Send torques in the controller's order and sense, and the hand's angle."""
        torques = np.zeros(len(JOINTS))
        torques[self._index] = command.tau
        self._client.torques(list(SENSE * torques), 100.0 * command.hand / CLOSED)

    def engage_brakes(self) -> None:
        """Engage the brakes; it may be called again."""
        self._client.disable()

    def release(self) -> None:
        """Take torques from now on: a person has said so."""
        self._client.enable()

    def waits(self) -> str:
        """Return what keeps it from being commanded: nothing does."""
        return ""

    def conflict(self) -> str:
        """Return who else commands it: nobody can."""
        return ""

    def trouble(self) -> str:
        """Return why the controller takes no torques."""
        return self._client.fault()

    def news(self) -> Sequence[str]:
        """Return none: this controller does not know what became of a ball."""
        return ()

    def close(self) -> None:
        """Leave the arm on its brakes."""
        self._client.disable()
