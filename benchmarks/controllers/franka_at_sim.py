"""mitt's Franka driver at franka-sim: what that server has otherwise than a robot, and a ball.

Its millisecond is timed by sleeps, so that its clock runs slower than ours; its states have no
gravity vector, so that libfranka's model of the arm has no weight. The ball is thrown as by a
simulated cell, 4 s after each release of the brakes and each 6 s from then on.
"""

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mitt.clock import processor_time, time_of_day
from mitt.core.arm.arm import Arm
from mitt.core.signals import Array, Command, Sighting
from mitt.io.cell import Cell
from mitt.lab.world.throws import fly
from mitt.robot.cell import device_clock
from mitt.robot.cell.prepare import feed_of, prepare, scene_of_cell
from mitt.robot.drivers.franka import FrankaRobot, franka_index

#: By how much the server's clock may run slower than ours [s/s], and the window of the least late
#: states [s].
_DRIFT = 0.5
_WINDOW = 0.005
#: Throws that are drawn; times of a throw [s].
_THROWS = 30
_FIRST = 4.0
_EACH = 6.0
_SEEN = 0.62
_TICK = 0.001


class Thrower:
    """Balls as a simulated cell throws them, seen a thousand times a second."""

    def __init__(self, cell: Cell) -> None:
        """Take the cell; SEED in the environment is that of the throws."""
        prepared = prepare(cell.model_copy(update={"robot": cell.robot}))
        scene = scene_of_cell(prepared.cell, None)
        feed = feed_of(prepared, scene, seed=int(os.environ.get("SEED", "40")), count=_THROWS)
        self._throws = [feed.bring(k) for k in range(_THROWS)]  # to draw one takes some ms
        self._drag, self._sigma = cell.ball.drag, cell.source.sigma
        self._rng, self._next, self._number = np.random.default_rng(1), np.inf, 0
        self._path: Any = None
        self._begun = self._last = 0.0

    def start(self) -> None:
        """Throw from now on."""
        self._next = time_of_day() + _FIRST

    def points(self) -> Sequence[Sighting]:
        """Return where the ball was seen since the last call."""
        now, found = time_of_day(), []
        if now >= self._next:
            self._path, self._begun, self._last = self._throws[self._number % _THROWS], now, now
            self._number, self._next = self._number + 1, now + _EACH
        while self._path is not None and self._last + _TICK <= min(now, self._begun + _SEEN):
            self._last += _TICK
            r = self.place(self._last) + self._rng.normal(0.0, self._sigma, 3)
            covariance = self._sigma**2 * np.eye(3)
            found.append(Sighting(t=self._last, found=True, r_o=r, covariance=covariance))
        return found

    def place(self, t: float) -> Array:
        """Return where the ball is [m]."""
        r, dr = self._path.r, self._path.dr
        return fly(r, dr, drag=self._drag, duration=t - self._begun)[0]

    @property
    def flying(self) -> bool:
        """Whether a ball was thrown and has not come down."""
        return self._path is not None and time_of_day() - self._begun < 1.0


class AtSim:
    """The driver, with a ball beside it, and a log of what the robot said of itself."""

    brakes = True

    def __init__(self, cell: Cell, arm: Arm) -> None:
        """Connect."""
        import pylibfranka  # noqa: PLC0415

        self._ball, self._arm, self._index = Thrower(cell), arm, franka_index(cell, arm)
        self._inner = FrankaRobot(_Weighing(pylibfranka, arm, self._index), cell, arm)
        self._log = Path(os.environ["CONTROLLER_LOG"]).open("a")  # noqa: SIM115 (to the end)
        self._nearest, self._success, self._was = np.inf, 1.0, False
        arm.position(arm.q_ready)  # what is compiled is loaded before it is needed
        arm.inverse_dynamics(arm.q_ready, 0.0 * arm.q_ready, 0.0 * arm.q_ready)
        fly(np.zeros(3), np.ones(3), drag=cell.ball.drag, duration=0.1)
        for name in ("engage_brakes", "waits", "conflict", "trouble", "news", "close"):
            setattr(self, name, getattr(self._inner, name))

    def _say(self, **what: object) -> None:
        """Log something."""
        said = {"t": time_of_day(), "processor_s": processor_time(), **what}
        self._log.write(json.dumps(said) + "\n")
        self._log.flush()

    def read(self, timeout: float) -> Any:  # noqa: ANN401
        """Return the next reading; note how near the hand comes to the ball."""
        readings, reflex = self._inner.read(timeout), self._inner.trouble()
        if self._ball.flying and readings:
            reach = self._arm.position(readings[-1].q) - self._ball.place(readings[-1].t)
            self._nearest = min(self._nearest, float(np.linalg.norm(reach)))
        elif self._was:
            self._say(nearest_m=self._nearest, success_rate=self._success)
            self._nearest, self._success = np.inf, 1.0
        if reflex and not self._reflex:
            self._say(reflex=reflex)
        self._reflex, self._was = reflex, self._ball.flying
        return readings

    _reflex = ""

    def points(self) -> Sequence[Sighting]:
        """Return where the ball was seen."""
        return self._ball.points()

    def write(self, command: Command, answers: float) -> None:
        """Pass torques on."""
        self._inner.write(command, answers)
        if self._was:
            self._success = min(self._success, self._inner.state.control_command_success_rate)

    def release(self) -> None:
        """Release, and let balls be thrown."""
        self._inner.release()
        self._say(released=True)
        self._ball.start()


class _Weighing:
    """pylibfranka, whose model has the arm's weight; all else is its own."""

    def __init__(self, vendor: Any, arm: Arm, index: Any) -> None:  # noqa: ANN401
        """Take it."""
        self._vendor, self._arm, self._index = vendor, arm, index

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401
        """Return what the library has."""
        return getattr(self._vendor, name)

    def Robot(self, address: str, kind: Any) -> Any:  # noqa: ANN401, N802 (the maker's)
        """Connect."""
        return _WeighingRobot(self._vendor.Robot(address, kind), self._arm, self._index)


class _WeighingRobot:
    """A robot that is its own model."""

    def __init__(self, robot: Any, arm: Arm, index: Any) -> None:  # noqa: ANN401
        """Take it."""
        self._robot, self._arm, self._index = robot, arm, index

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401
        """Return what the library's has."""
        return getattr(self._robot, name)

    def load_model(self) -> "_WeighingRobot":
        """Return itself."""
        return self

    def gravity(self, state: Any) -> list[float]:  # noqa: ANN401
        """Return the torques against the arm's weight [N m]."""
        torques, q = np.zeros(7), np.array(state.q)[self._index]
        still = np.zeros(len(q))
        torques[self._index] = self._arm.inverse_dynamics(q, still, still)
        return torques.tolist()


def at_sim(cell: Cell, arm: Arm) -> AtSim:
    """Return the robot of a cell: the entry point."""
    device_clock._DRIFT = _DRIFT
    device_clock._WINDOW = _WINDOW
    device_clock._MOST = np.inf
    return AtSim(cell, arm)
