"""A simulated cell in this process with a live loop, and faults of the link between them."""

from collections.abc import Callable, Sequence
from pathlib import Path

from mitt.core.signals import ArmState, Command, Sighting
from mitt.io.cell import read_cell
from mitt.robot.cell.drivers import LocalRobot, local_robot
from mitt.robot.cell.excitation import NotedRobot, excitation
from mitt.robot.cell.live import LiveLoop, Mode
from mitt.robot.cell.prepare import (
    PreparedCell,
    catchers,
    cell_about,
    cell_map,
    period_of,
    prepare,
    setpoints_of,
)
from mitt.robot.cell.recorder import Recorder
from mitt.robot.cell.robot import Robot, RobotLink

Readings = Sequence[ArmState]


class FaultyRobot:
    """Passes everything on, but what a test changes on the way."""

    brakes = True

    def __init__(self, inner: Robot) -> None:
        """Change nothing yet."""
        self._inner = inner
        self.on_read: Callable[[Readings], Readings] = lambda x: x
        self.on_points: Callable[[Sequence[Sighting]], Sequence[Sighting]] = lambda x: x
        self.on_write: Callable[[Command], bool] = lambda _: True
        self.braked: list[bool] = []
        self.said = self.kept = self.meddled = ""

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

    def waits(self) -> str:
        """Return what the test says keeps it from being commanded."""
        return self.kept

    def conflict(self) -> str:
        """Return what the test says that a person has to see to."""
        return self.meddled

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
        noted: That robot, with notes of what passes to and from it while it is measured.
        loop: The live loop.
        recorder: What records its catches, if anything does.
    """

    def __init__(
        self,
        *,
        throws: int,
        seed: int = 5,
        record: Path | None = None,
        name: str = "wam-sim",
        prepared: PreparedCell | None = None,
        plant: PreparedCell | None = None,
        measured: bool = False,
        driver: Callable[[LocalRobot, PreparedCell], Robot] = lambda local, _: local,
    ) -> None:
        """Set both up; nothing moves yet.

        The loop takes the cell to be as ``prepared`` says; it is as ``plant`` does, where given. An
        arm that is ``measured`` swings about its ready pose first.
        """
        self.prepared = prepared = prepared or prepare(read_cell(name))
        cell, arm = prepared.cell, prepared.arm
        local = local_robot(plant or prepared, seed=seed, count=throws, started=1.7e9)
        self.simulated, port = local.simulated, local.port
        self.robot = FaultyRobot(driver(local, prepared))
        f = cell_map(prepared)
        first, again = catchers(prepared, f)
        self.recorder = None if record is None else Recorder(record, cell_about(prepared, f))
        frames = port if cell.source.kind == "images" else None
        self.noted = NotedRobot(self.robot, cell.robot.takes)
        robot = self.noted if measured else self.robot
        self.loop = LiveLoop(
            RobotLink(robot, setpoints=setpoints_of(prepared)),
            arm,
            first,
            again,
            ready_speed=cell.motion.ready_speed,
            silence=cell.robot.watchdog,
            frames=frames,
            lenses=prepared.lenses,
            recorder=self.recorder,
            clock=lambda: self.simulated.t,
            period=period_of(cell),
            placing=prepared.placing,
            measures=excitation if measured else None,
        )

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
