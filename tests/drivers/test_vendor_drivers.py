"""The worked examples of drivers, each at a fake of its vendor's client, through the live loop."""

import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from drivers.fakes import FRANKA, FakeFranka, FakeUr, Torques
from franka_design import panda_file
from local_cell import LocalCell

from mitt.cell.drivers import LocalRobot
from mitt.cell.live import Mode
from mitt.cell.prepare import PreparedCell, prepare
from mitt.cell.readings import Lag
from mitt.cell.robot import Robot
from mitt.errors import InputError
from mitt.files.arm_file import read_arm_file
from mitt.files.cell import ArmPart, Cell, read_cell

FOLDER = Path(__file__).parents[2] / "examples" / "drivers"
STARTED = 1.7e9
FRANKA_JOINTS = ["panda_joint1", "panda_joint2", "panda_joint4"]
UR_JOINTS = ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint"]


@pytest.fixture(autouse=True)
def importable(monkeypatch: pytest.MonkeyPatch) -> None:
    """The folder of the drivers among those that are searched."""
    monkeypatch.syspath_prepend(str(FOLDER))


def cell_of(names: list[str], **robot: object) -> Cell:
    """Return the shipped cell with the vendor's names of joints."""
    cell = read_cell("wam-sim")
    return cell.model_copy(
        update={"robot": cell.robot.model_copy(update={"joints": names, **robot})}
    )


def franka_at(cell: Cell, seen: list[FakeFranka], *, rate: float = 1.0) -> LocalCell:
    """Return a live loop with the Franka driver; the fake is put into ``seen``."""
    from mitt_franka import FrankaRobot  # type: ignore[import-not-found] # noqa: PLC0415
    from robot_clock import RobotClock  # type: ignore[import-not-found] # noqa: PLC0415

    def driver(local: LocalRobot, prepared: PreparedCell) -> Robot:
        fake = FakeFranka(local, prepared.arm, STARTED)
        seen.append(fake)
        vendor = SimpleNamespace(Robot=lambda _: fake, Torques=Torques)
        robot: Robot = FrankaRobot(
            vendor,
            "there",
            prepared.cell,
            prepared.arm,
            clock=RobotClock(lambda: local.t),
            ball=local.points,
            hand=fake.grip,
            rate=rate,
        )
        return robot

    return LocalCell(throws=2, prepared=prepare(cell), driver=driver)


def ur_at(cell: Cell, seen: list[FakeUr], *, acceleration: float) -> LocalCell:
    """Return a live loop with the UR driver; the fake is put into ``seen``."""
    from mitt_ur import UrRobot  # type: ignore[import-not-found] # noqa: PLC0415
    from robot_clock import RobotClock  # noqa: PLC0415

    def driver(local: LocalRobot, prepared: PreparedCell) -> Robot:
        fake = FakeUr(local, STARTED)
        seen.append(fake)
        robot: Robot = UrRobot(
            fake,
            fake,
            fake.unlock,
            prepared.cell,
            prepared.arm,
            clock=RobotClock(lambda: local.t),
            ball=local.points,
            hand=fake.grip,
            acceleration=acceleration,
        )
        return robot

    return LocalCell(throws=2, prepared=prepare(cell), driver=driver)


def test_the_franka_driver_catches_at_its_fake() -> None:
    """Each millisecond a torque; the weight is taken off, other joints are held.

    Torques change by up to 4 N m in a millisecond, four times what a Franka takes.
    """
    seen: list[FakeFranka] = []
    cell = franka_at(cell_of(FRANKA_JOINTS), seen, rate=4.0)
    cell.begin()
    cell.until(lambda: cell.simulated.done)
    assert cell.simulated.statuses == ["caught", "caught"]
    torques = np.array(seen[0].torques)
    assert np.max(np.abs(np.diff(torques, axis=0))) <= 4.0 + 1e-9
    assert np.all(np.delete(torques, FRANKA, axis=1) == 0.0)
    cell.loop.finish()
    assert not seen[0].controlled


def test_with_the_torque_rate_of_a_franka_the_arm_of_the_example_stops() -> None:
    """1 N m in a millisecond is too little for its catch: the loop stops it, and says why."""
    seen: list[FakeFranka] = []
    cell = franka_at(cell_of(FRANKA_JOINTS), seen)
    cell.begin()
    cell.until(lambda: cell.loop.mode is Mode.STOPPED)
    assert cell.loop.why
    assert np.max(np.abs(np.diff(np.array(seen[0].torques), axis=0))) <= 1.0 + 1e-9
    assert not seen[0].controlled


def test_a_panda_catches_with_the_torque_rate_of_a_franka(tmp_path: Path) -> None:
    """What `mitt design --limits franka-panda` found, through the driver: 1 N m a millisecond."""
    arm, seen = panda_file(tmp_path), list[FakeFranka]()
    names = read_arm_file(arm).joints
    assert names is not None
    cell = cell_of(list(names)).model_copy(update={"arm": ArmPart(file=str(arm))})
    local = franka_at(cell, seen)
    local.begin()
    local.until(lambda: local.simulated.done)
    assert local.simulated.statuses == ["caught", "caught"]
    assert np.max(np.abs(np.diff(np.array(seen[0].torques), axis=0))) <= 1.0 + 1e-9
    assert local.loop.mode is not Mode.STOPPED


def test_the_franka_driver_recovers_once_a_person_says_so() -> None:
    """A reflex stops the loop with its reason; after it the arm goes on."""
    seen: list[FakeFranka] = []
    cell = franka_at(cell_of(FRANKA_JOINTS), seen, rate=4.0)
    cell.begin()
    cell.until(lambda: cell.fastest > 1.5)
    cell.robot.on_write = lambda _: False
    cell.until(lambda: cell.loop.mode is Mode.STOPPED)
    assert "Reflex [communication_constraints_violation]" in cell.loop.why
    cell.robot.on_write = lambda _: True
    cell.robot.release()  # a person has acknowledged it
    for _ in range(20):
        if cell.loop.healthy() == "":
            break
    cell.begin()
    assert cell.loop.mode is Mode.CATCHING


def test_the_ur_driver_catches_at_its_fake() -> None:
    """With 500 readings a second and an acceleration that no UR has; see the driver's text."""
    seen: list[FakeUr] = []
    cell = ur_at(cell_of(UR_JOINTS, takes="velocity"), seen, acceleration=200.0)
    cell.begin()
    cell.until(lambda: cell.simulated.done)
    assert cell.simulated.statuses == ["caught", "caught"]
    assert cell.loop.counts.lost == 0
    assert seen[0].least == pytest.approx(50.0)
    assert seen[0].kicks > 500


def test_the_ur_driver_goes_on_once_a_person_says_so() -> None:
    """After a stop that ended the program on the robot, which starts anew."""
    seen: list[FakeUr] = []
    cell = ur_at(cell_of(UR_JOINTS, takes="velocity"), seen, acceleration=200.0)
    cell.begin()
    cell.until(lambda: cell.fastest > 1.5)
    seen[0].runs = False
    cell.until(lambda: cell.loop.mode is Mode.STOPPED)
    assert "its program does not run" in cell.loop.why
    assert "its program does not run" in cell.loop.healthy()
    cell.robot.release()  # a person has acknowledged it
    for _ in range(200):
        if cell.loop.healthy() == "":
            break
    assert seen[0].runs
    cell.begin()
    assert cell.loop.mode is Mode.CATCHING


def test_the_clock_of_a_robot_may_drift_but_not_jump() -> None:
    """By 50 ppm either way for 5 min, each reading up to 3 ms on its way: within 1 ms."""
    from robot_clock import RobotClock  # noqa: PLC0415

    rng = np.random.default_rng(2)
    for drift in (5e-5, -5e-5):
        now = [0.0]
        clock, before = RobotClock(lambda now=now: now[0]), -np.inf
        for k in range(300_000):
            true = STARTED + 1e-3 * k
            now[0] = true + rng.uniform(0.0, 3e-3)
            stamp = (1.0 + drift) * 1e-3 * k
            if k == 100:
                clock.fix()
            at = clock.at(stamp)
            assert at > before
            before = at
            if k > 100:
                assert abs(at - true) < 1e-3
        now[0] += 10.0
        assert clock.at(stamp + 1e-3) < before + 2e-3


def test_the_clock_of_a_robot_hides_no_readings_that_are_late() -> None:
    """By 20 ms from one to the next, for 5 min: the live loop goes on to find them late."""
    from robot_clock import RobotClock  # noqa: PLC0415

    now, lag, found = [0.0], Lag(), list[bool]()
    clock = RobotClock(lambda: now[0])
    for k in range(300_000):
        now[0] = STARTED + 1e-3 * k + (0.02 if k > 10_000 else 0.0)
        if k == 100:
            clock.fix()
        found.append(bool(lag.fault(clock.at(1e-3 * k), now[0])))
    assert not any(found[:10_000])
    assert all(found[10_030:])


def test_with_the_acceleration_of_a_ur_the_arm_of_the_example_stops() -> None:
    """40 rad/s^2 is too little to follow its commands: the loop stops it, and says why.

    The monitor takes a joint that does not do as it was told for one whose encoder lies.
    """
    seen: list[FakeUr] = []
    cell = ur_at(cell_of(UR_JOINTS, takes="velocity"), seen, acceleration=40.0)
    cell.begin()
    cell.until(lambda: cell.loop.mode is Mode.STOPPED)
    why = cell.loop.why
    assert why == "far from the told motion" or why.startswith("encoder stuck j")


def test_the_package_names_what_there_is() -> None:
    """Its entry points are functions of its modules; what is missing is one line."""
    told = tomllib.loads((FOLDER / "pyproject.toml").read_text())["project"]
    for name, place in told["entry-points"]["mitt.robots"].items():
        module, _, function = place.partition(":")
        __import__(module)
        assert callable(getattr(sys.modules[module], function))
        assert "UNTESTED ON HARDWARE" in (sys.modules[module].__doc__ or ""), name
    cell = cell_of(["panda_joint1", "panda_joint2", "panda_joint9"])
    with pytest.raises(InputError, match=r"robot\.joints"):
        franka_at(cell, [])
