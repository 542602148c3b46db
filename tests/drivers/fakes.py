"""Fakes of two vendors' clients in Python: their calls, and a simulated arm behind them.

They do what their authors believe of the real ones; what is believed says docs/cell.md.
"""

from types import SimpleNamespace
from typing import Any

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.signals import ArmState, Array, Command
from mitt.robot.cell.drivers import LocalRobot

#: Places of the WAM's three joints among those of the vendor's arm.
FRANKA = [0, 1, 3]
UR = [0, 1, 2]


class Torques:
    """``pylibfranka.Torques``: seven numbers."""

    def __init__(self, tau_J: list[float]) -> None:
        """Take exactly seven."""
        assert len(tau_J) == 7
        self.tau_J = tau_J


class ControlException(Exception):  # noqa: N818 (the vendor's)
    """``pylibfranka.ControlException``: a reflex, thrown once."""


class FakeFranka:
    """``pylibfranka.Robot``, and what its ``start_torque_control`` returns.

    Attributes:
        mode: Its mode, as text.
        torques: All that were written.
    """

    def __init__(self, local: LocalRobot, arm: Arm, started: float) -> None:
        """Take the simulated arm."""
        self._local, self._arm, self._started = local, arm, started
        self._places, self._still = [int(name[-1]) - 1 for name in arm.names], np.zeros(arm.n)
        self._reading: ArmState | None = None
        self.mode, self.hand, self.torques = "Idle", 0.0, list[Array]()
        self.controlled, self.set = False, dict[str, Any]()

    def at(self, kind: str) -> "FakeFranka":
        """Connect."""
        self.set["kind"] = kind
        return self

    def set_collision_behavior(self, *thresholds: list[float]) -> None:
        """Note it."""
        assert [len(x) for x in thresholds] == [7, 7, 6, 6]
        self.set["collision"] = thresholds

    def set_load(self, mass: float, centre: list[float], inertia: list[float]) -> None:
        """Note it."""
        assert (len(centre), len(inertia)) == (3, 9)
        self.set["load"] = mass

    def load_model(self) -> "FakeFranka":
        """Return a model; it is this object."""
        return self

    def gravity(self, state: Any) -> list[float]:  # noqa: ANN401
        """Return the torques of the weight."""
        weight, q = np.full(7, 3.0), np.array(state.q)[self._places]
        weight[self._places] = self._arm.inverse_dynamics(q, self._still, self._still)
        return weight.tolist()

    def read_once(self) -> Any:  # noqa: ANN401
        """Return the next state."""
        (self._reading,) = self._local.read(0.02)
        q, dq = np.array([0.0, 0.0, 0.1, 0.0, 0.2, 0.3, 0.4]), np.zeros(7)
        q[self._places], dq[self._places] = self._reading.q, self._reading.dq
        if self._local.trouble():
            self.mode, self.controlled = "Reflex", False
        return SimpleNamespace(
            q=q.tolist(),
            dq=dq.tolist(),
            robot_mode=f"RobotMode.{self.mode}",
            current_errors="[communication_constraints_violation]" if self.mode == "Reflex" else "",
            tau_J_d=self.torques[-1].tolist() if self.torques else [0.0] * 7,
            time=SimpleNamespace(to_sec=lambda t=self._reading.t: t - self._started),
        )

    def start_torque_control(self) -> "FakeFranka":
        """Take torques from now on."""
        assert self.mode == "Idle"
        self._local.release()
        self.mode, self.controlled = "Move", True
        return self

    def readOnce(self) -> tuple[Any, Any]:  # noqa: N802 (the vendor's)
        """Return the next state, and the time since the last."""
        assert self.controlled  # libfranka waits for ever where it is asked again
        state = self.read_once()
        if self.mode == "Reflex":
            raise ControlException(
                'libfranka: motion aborted by reflex! ["communication_constraints_violation"]'
            )
        return state, SimpleNamespace(to_sec=lambda: 0.001)

    def writeOnce(self, command: Torques) -> None:  # noqa: N802 (the vendor's)
        """Let torques act, with those against the weight."""
        assert self.controlled
        assert self._reading is not None
        tau, (q, dq) = np.array(command.tau_J), (self._reading.q, self._reading.dq)
        self.torques.append(tau)
        tau_arm = tau[self._places] + self._arm.inverse_dynamics(q, self._still, self._still)
        rows = np.array([q, dq, self._still, tau_arm])
        self._local.write(Command(t=0.0, joints=rows, hand=self.hand), self._reading.t)

    def stop(self) -> None:
        """Hold the arm."""
        self._local.engage_brakes()
        self.mode, self.controlled = "Idle", False

    def automatic_error_recovery(self) -> None:
        """Be idle again."""
        self._local.release()
        self._local.read(0.02)
        self._local.engage_brakes()
        self.mode = "Idle"

    def grip(self, angle: float) -> None:
        """Take the hand's angle with the next torques."""
        self.hand = angle


class FakeUr:
    """``RTDEControlInterface`` and ``RTDEReceiveInterface`` in one: a state each 2 ms.

    Attributes:
        least: What frequency the watchdog wants [Hz].
        runs: Whether the program on the robot runs.
        follows: Whether its outputs do.
        outputs: How its digital outputs are.
    """

    def __init__(self, local: LocalRobot, started: float) -> None:
        """Take the simulated arm, whose drives take speeds."""
        self._local, self._started, self._taken = local, started, True
        self._speeds, self._wanted, self._limit = np.zeros(3), np.zeros(3), 1.0
        self._reading: ArmState | None = None
        self._moves, self.hand, self.least = False, 0.0, 0.0
        self.runs, self.follows, self.outputs = True, True, [False] * 8

    def getTimestamp(self) -> float:  # noqa: N802 (the vendor's, as all below)
        """Return the time of the newest state [s]; the next one comes once this was read."""
        if self._taken:
            self._taken = False
            self._tick()
        assert self._reading is not None
        return self._reading.t - self._started

    def _tick(self) -> None:
        """Accelerate for a cycle."""
        (self._reading,) = self._local.read(0.02)
        step = self._limit * 2e-3
        self._speeds += np.clip(self._wanted - self._speeds, -step, step)
        if self._moves:
            rows = np.full((4, 3), np.nan)
            rows[1] = self._speeds
            self._local.write(Command(t=0.0, joints=rows, hand=self.hand), self._reading.t)

    def getActualQ(self) -> list[float]:  # noqa: N802
        """Return joint angles [rad]."""
        return self._all("q")

    def getActualQd(self) -> list[float]:  # noqa: N802
        """Return joint speeds [rad/s]; the state was taken."""
        self._taken = True
        return self._all("dq")

    def _all(self, name: str) -> list[float]:
        """Return six numbers."""
        assert self._reading is not None
        row = np.zeros(6)
        row[UR] = self._reading.q if name == "q" else self._reading.dq
        return row.tolist()

    def speedJ(self, qd: list[float], acceleration: float, time: float) -> bool:  # noqa: N802
        """Take speeds [rad/s]."""
        assert len(qd) == 6
        assert time == 0.002
        if not self._moves:
            self._local.release()
        self._wanted, self._limit, self._moves = np.array(qd)[UR], acceleration, True
        return True

    def speedStop(self, a: float) -> bool:  # noqa: N802
        """Stop; the drives hold the arm."""
        self._wanted, self._limit, self._moves = np.zeros(3), a, False
        self._local.engage_brakes()
        return True

    def setStandardDigitalOut(self, output: int, level: bool) -> bool:  # noqa: N802
        """Set an output."""
        if self.follows:
            self.outputs[output] = level
        return True

    def getDigitalOutState(self, output: int) -> bool:  # noqa: N802
        """Return how an output is."""
        return self.outputs[output]

    def setWatchdog(self, min_frequency: float) -> bool:  # noqa: N802
        """Expect kicks."""
        self.least = min_frequency
        return True

    def isProtectiveStopped(self) -> bool:  # noqa: N802
        """Say whether its watchdog has braked."""
        return bool(self._local.trouble())

    def isEmergencyStopped(self) -> bool:  # noqa: N802
        """Say no."""
        return False

    def isProgramRunning(self) -> bool:  # noqa: N802
        """Say whether it does."""
        return self.runs

    def unlock(self) -> None:
        """Acknowledge a protective stop."""
        self._local.release()
        self._local.read(0.02)
        self._local.engage_brakes()
        self._moves = False

    def reuploadScript(self) -> bool:  # noqa: N802
        """Start it anew."""
        self.runs = True
        return True

    def stopScript(self) -> None:  # noqa: N802
        """Do nothing more."""

    def grip(self, angle: float) -> None:
        """Take the hand's angle."""
        self.hand = angle
