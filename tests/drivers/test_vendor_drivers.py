"""The drivers of mitt, each at a fake of its vendor's client, through the live loop."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from drivers.fakes import ControlException, FakeFranka, FakeUr, Torques
from franka_design import panda_file
from local_cell import LocalCell

from mitt.core.signals import Command
from mitt.io.arm_file import read_arm_file
from mitt.io.cell import ArmPart, Cell, read_cell
from mitt.robot.cell.device_clock import DeviceClock
from mitt.robot.cell.drivers import LocalRobot, local_robot
from mitt.robot.cell.live import Mode
from mitt.robot.cell.prepare import PreparedCell, prepare
from mitt.robot.cell.readings import Lag
from mitt.robot.cell.robot import Robot
from mitt.robot.drivers import ur
from mitt.robot.drivers.franka import FrankaRobot

STARTED = 1.7e9
FRANKA_JOINTS = ["panda_joint1", "panda_joint2", "panda_joint4"]
UR_JOINTS = ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint"]
HERE: dict[str, str | float | bool] = {"address": "there"}


class Beside:
    """A driver, and beside it what it does not do: see the ball, drive the hand."""

    brakes = True

    def __init__(self, inner: Any, local: LocalRobot, fake: FakeFranka | FakeUr) -> None:  # noqa: ANN401
        """Take the driver, the simulated arm, and the fake."""
        self._inner, self._fake, self.points = inner, fake, local.points

    def write(self, command: Command, answers: float) -> None:
        """Drive the hand, too."""
        self._fake.grip(command.hand)
        self._inner.write(command, answers)

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401
        """Return a method of the driver."""
        return getattr(self._inner, name)


def cell_of(names: list[str], **robot: object) -> Cell:
    """Return the shipped cell with the vendor's names of joints."""
    cell = read_cell("wam-sim")
    return cell.model_copy(
        update={"robot": cell.robot.model_copy(update={"joints": names, "options": HERE, **robot})}
    )


def franka_at(cell: Cell, seen: list[FakeFranka]) -> LocalCell:
    """Return a live loop with the Franka driver; the fake is put into ``seen``."""

    def driver(local: LocalRobot, prepared: PreparedCell) -> Robot:
        fake = FakeFranka(local, prepared.arm, STARTED)
        seen.append(fake)
        vendor = SimpleNamespace(
            Robot=lambda _, kind, fake=fake: fake.at(kind),
            Torques=Torques,
            ControlException=ControlException,
            RealtimeConfig=SimpleNamespace(kEnforce="enforced", kIgnore="ignored"),
        )
        robot = FrankaRobot(vendor, prepared.cell, prepared.arm, clock=DeviceClock(lambda: local.t))
        return Beside(robot, local, fake)

    return LocalCell(throws=2, prepared=prepare(cell), driver=driver)


def panda_cell(folder: Path, **robot: object) -> Cell:
    """Return a cell of what ``mitt design --limits franka-panda`` found."""
    arm = panda_file(folder)
    names = read_arm_file(arm).joints
    assert names is not None
    return cell_of(list(names), **robot).model_copy(update={"arm": ArmPart(file=str(arm))})


def ur_at(cell: Cell, seen: list[FakeUr], *, acceleration: float) -> LocalCell:
    """Return a live loop with the UR driver; the fake is put into ``seen``."""

    def driver(local: LocalRobot, prepared: PreparedCell) -> Robot:
        fake = FakeUr(local, STARTED)
        seen.append(fake)
        robot = ur.UrRobot(
            fake,
            fake,
            fake.unlock,
            prepared.cell,
            prepared.arm,
            clock=DeviceClock(lambda: local.t),
            acceleration=acceleration,
        )
        return Beside(robot, local, fake)

    return LocalCell(throws=2, prepared=prepare(cell), driver=driver)


def test_with_the_torque_rate_of_a_franka_the_arm_of_the_example_stops() -> None:
    """1 N m in a millisecond is too little for its catch: the loop stops it, and says why."""
    seen: list[FakeFranka] = []
    cell = franka_at(cell_of(FRANKA_JOINTS), seen)
    cell.begin()
    cell.until(lambda: cell.loop.mode is Mode.STOPPED)
    assert cell.loop.why
    assert np.max(np.abs(np.diff(np.array(seen[0].torques), axis=0))) <= 1.0 + 1e-9
    assert not seen[0].controlled


@pytest.mark.thorough
def test_a_panda_catches_with_the_torque_rate_of_a_franka(tmp_path: Path) -> None:
    """1 N m a millisecond from what the robot took, the weight taken off, other joints held."""
    seen = list[FakeFranka]()
    options = HERE | {"realtime": False, "collision_force": 100.0, "collision_torque": 80.0}
    local = franka_at(panda_cell(tmp_path, options=options | {"load": 0.3}), seen)
    assert seen[0].set["kind"] == "ignored"
    assert seen[0].set["collision"][3] == [100.0] * 6
    assert seen[0].set["load"] == 0.3
    local.begin()
    local.until(lambda: local.simulated.done)
    assert local.simulated.statuses == ["caught", "caught"]
    torques = np.array(seen[0].torques)
    assert np.max(np.abs(np.diff(torques, axis=0))) < 1.0
    places = [int(name[-1]) - 1 for name in local.prepared.cell.robot.joints or ()]
    assert np.all(np.delete(torques, places, axis=1) == 0.0)
    assert local.loop.mode is not Mode.STOPPED
    local.loop.finish()
    assert not seen[0].controlled


def test_a_reflex_is_told_in_the_words_of_libfranka(tmp_path: Path) -> None:
    """It is thrown once; nobody asks again. The arm goes on once a person says so."""
    seen: list[FakeFranka] = []
    cell = franka_at(panda_cell(tmp_path), seen)
    assert seen[0].set["kind"] == "enforced"
    cell.begin()
    cell.until(lambda: cell.fastest > 0.5)
    cell.robot.on_write = lambda _: False
    cell.until(lambda: cell.loop.mode is Mode.STOPPED)
    assert 'motion aborted by reflex! ["communication_constraints_violation"]' in cell.loop.why
    cell.robot.on_write = lambda _: True
    cell.robot.release()  # a person has acknowledged it
    for _ in range(20):
        if cell.loop.healthy() == "":
            break
    cell.begin()
    assert cell.loop.mode is Mode.CATCHING


@pytest.mark.parametrize("lost", [(), (3, 4), (0, 2, 5)])
def test_a_torque_is_within_a_step_of_whatever_the_robot_has(
    tmp_path: Path, lost: tuple[int, ...]
) -> None:
    """Whichever commands were lost, and with states that are two commands old."""
    seen = list[FakeFranka]()
    local = franka_at(panda_cell(tmp_path), seen)
    driver: FrankaRobot = local.robot._inner._inner  # type: ignore[attr-defined]
    rng, has, told = np.random.default_rng(4), [np.zeros(7)] * 3, list[np.ndarray]()
    for k in range(300):
        driver.state = SimpleNamespace(tau_J_d=has[-3].tolist())
        tau = driver._within_a_step(rng.uniform(-20.0, 20.0, 7))
        assert np.max(np.abs(tau - has[-1])) < 1.0
        told.append(tau)
        has.append(has[-1] if k % 7 in lost else tau)
    assert np.max(np.abs(told)) < 90.0


def test_the_ur_driver_catches_at_its_fake() -> None:
    """With an acceleration that no UR has; nothing is sent between two speeds."""
    seen: list[FakeUr] = []
    cell = ur_at(cell_of(UR_JOINTS, takes="velocity", rate=500.0), seen, acceleration=200.0)
    cell.begin()
    cell.until(lambda: cell.simulated.done)
    assert cell.simulated.statuses == ["caught", "caught"]
    assert cell.loop.counts.lost == 0
    assert seen[0].least == pytest.approx(50.0)


def test_the_output_of_a_ur_closes_the_hand_and_is_looked_at(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Set beyond half the closing angle and only when new; one that does not follow is told."""
    cell = prepare(cell_of(UR_JOINTS, takes="velocity", rate=500.0))
    options = HERE | {"hand_output": 3.0}
    part = cell.cell.robot.model_copy(update={"options": options})
    local = local_robot(cell, seed=0, count=1)
    fake, now, told = FakeUr(local, 0.0), [100.0], list[tuple[int, bool]]()
    monkeypatch.setattr(ur, "monotonic", lambda: now[0])
    took = fake.setStandardDigitalOut

    def noted(output: int, level: bool) -> bool:
        told.append((output, level))
        return took(output, level)

    monkeypatch.setattr(fake, "setStandardDigitalOut", noted)
    given = cell.cell.model_copy(update={"robot": part})
    robot = ur.UrRobot(fake, fake, fake.unlock, given, cell.arm, outputs=fake)
    robot.read(0.02)
    robot.release()
    hand = cell.arm.model.hand
    assert hand is not None
    rows = np.array([cell.arm.q_ready, *np.zeros((3, cell.arm.n))])
    for share in (0.0, 0.0, 0.4, 0.6, 1.0, 0.6, 0.0):
        robot.write(Command(t=0.0, joints=rows, hand=share * hand.closed), 0.0)
    assert told == [(3, False), (3, True), (3, False)]
    fake.follows = False
    robot.write(Command(t=0.0, joints=rows, hand=hand.closed), 0.0)
    assert robot.trouble() == ""
    now[0] += 0.3
    assert robot.trouble() == "digital output 3, the hand's, is not as it was set"
    fake.outputs[3] = True
    assert robot.trouble() == ""


def test_the_ur_driver_goes_on_once_a_person_says_so() -> None:
    """After a stop that ended the program on the robot, which starts anew."""
    seen: list[FakeUr] = []
    cell = ur_at(cell_of(UR_JOINTS, takes="velocity", rate=500.0), seen, acceleration=200.0)
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


def test_a_clock_that_is_fixed_before_its_first_stamp_learns_it_then() -> None:
    """As where a device sends nothing for a while: its stamps become times all the same."""
    now = [100.0]
    clock = clock_of(now)
    clock.fix()
    assert clock.at(7.0) == 100.0
    clock.fix()
    now[0] = 100.5
    assert clock.at(7.5) == 100.5


def clock_of(now: list[float]) -> DeviceClock:
    """Return the clock of a robot where it is ``now`` [s], a list of one number."""
    return DeviceClock(lambda: now[0])


def test_the_clock_of_a_robot_may_drift_but_not_jump() -> None:
    """By 50 ppm either way for 5 min, each reading up to 3 ms on its way: within 1 ms."""
    rng = np.random.default_rng(2)
    for drift in (5e-5, -5e-5):
        now = [0.0]
        clock, before = clock_of(now), -np.inf
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
    now, lag, found = [0.0], Lag(), list[bool]()
    clock = clock_of(now)
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
    cell = ur_at(cell_of(UR_JOINTS, takes="velocity", rate=500.0), seen, acceleration=40.0)
    cell.begin()
    cell.until(lambda: cell.loop.mode is Mode.STOPPED)
    why = cell.loop.why
    assert why == "far from the told motion" or why.startswith("encoder stuck j")
