"""A simulated cell in this process with a live loop, and faults of the link between them."""

from collections.abc import Callable, Sequence
from pathlib import Path

from mitt.cell.local import LocalPort, LocalRobot
from mitt.cell.prepare import about_of, balls_of, catchers, map_of, prepare, scene_of_cell
from mitt.cell.simulated import SimulatedCell
from mitt.files.cell import read_cell
from mitt.link.clock import monotonic
from mitt.link.live import LiveLoop
from mitt.link.modes import Mode
from mitt.link.recorder import Recorder
from mitt.link.robot import RobotLink
from mitt.signals import ArmState, Command, Sighting

Readings = Sequence[ArmState]


class FaultyRobot:
    """Passes everything on, but what a test changes on the way."""

    brakes = True

    def __init__(self, inner: LocalRobot) -> None:
        """Change nothing yet."""
        self._inner = inner
        self.on_read: Callable[[Readings], Readings] = lambda x: x
        self.on_points: Callable[[Sequence[Sighting]], Sequence[Sighting]] = lambda x: x
        self.on_write: Callable[[Command], bool] = lambda _: True
        self.braked: list[bool] = []
        self.said = ""

    def read(self, timeout: float) -> Readings:
        """Return readings."""
        return self.on_read(self._inner.read(timeout))

    def points(self) -> Sequence[Sighting]:
        """Return positions of the ball."""
        return self.on_points(self._inner.points())

    def write(self, command: Command, answers: float) -> None:
        """Pass a command on, or lose it."""
        if self.on_write(command):
            self._inner.write(command, answers)

    def engage_brakes(self) -> None:
        """Note and pass on."""
        self.braked.append(True)
        self._inner.engage_brakes()

    def release(self) -> None:
        """Note and pass on."""
        self.braked.append(False)
        self._inner.release()

    def trouble(self) -> str:
        """Return what the robot or the test says."""
        return self.said or self._inner.trouble()

    def news(self) -> Sequence[str]:
        """Return how throws ended."""
        return self._inner.news()

    def close(self) -> None:
        """Nothing is to be given up."""


class LocalCell:
    """The shipped cell, simulated here, and a live loop at it.

    Attributes:
        simulated: The cell.
        robot: Its robot, with faults.
        loop: The live loop.
        recorder: What records its catches, if anything does.
    """

    def __init__(
        self, *, throws: int, seed: int = 5, record: Path | None = None,
        name: str = "wam-sim",
    ) -> None:  # fmt: skip
        """Set both up; nothing moves yet."""
        self.prepared = prepared = prepare(read_cell(name))
        cell, arm = prepared.cell, prepared.arm
        scene, port = scene_of_cell(cell, None), LocalPort(cell.source.sigma)
        source = balls_of(prepared, scene, seed=seed, count=throws)
        self.simulated = SimulatedCell(
            cell, arm, scene, source, port, rig=prepared.rig, clock=monotonic, started=1.7e9
        )
        self.robot = FaultyRobot(LocalRobot(self.simulated, port))
        f = map_of(prepared)
        first, again = catchers(prepared, f)
        self.recorder = None if record is None else Recorder(record, about_of(prepared, f))
        self.loop = LiveLoop(
            RobotLink(self.robot), arm, first, again, ready_speed=cell.motion.ready_speed,
            silence=cell.robot.watchdog, frames=port, recorder=self.recorder,
        )  # fmt: skip

    def until(self, over: Callable[[], bool], *, ticks: int = 12_000) -> None:
        """Go on until something is so; fail if it never is."""
        for _ in range(ticks):
            if over():
                return
            self.loop.cycle()
        raise AssertionError(f"not so after {ticks} ticks: {self.loop.mode}, {self.loop.why}")

    def begin(self) -> None:
        """Say that the arm may move, and let it get ready."""
        assert self.loop.healthy() == ""
        self.loop.begin()
        self.until(lambda: self.loop.mode is Mode.CATCHING)

    @property
    def fastest(self) -> float:
        """Largest true speed of a joint now [rad/s]."""
        return float(abs(self.simulated.truth.dq).max())
