"""A link passes the command to the brakes on, and refuses a robot that has none."""

import sys
from importlib.metadata import EntryPoint
from types import ModuleType

import numpy as np
import pytest

from mitt.core.arm.arm import Arm
from mitt.core.errors import InputError
from mitt.core.signals import ArmState, Command, Sighting
from mitt.io.cell import read_cell
from mitt.robot.cell.robot import DRIVERS, RobotLink, driver_named


class Driver:
    """Notes what it is told."""

    def __init__(self, *, brakes: bool, fails: bool = False) -> None:
        """Say whether there are brakes, and whether the drives answer."""
        self.brakes, self._fails, self.said = brakes, fails, list[str]()

    def read(self, timeout: float) -> list[ArmState]:
        """Return an arm at rest."""
        return [ArmState(t=timeout, q=np.zeros(2), dq=np.zeros(2))]

    def points(self) -> list[Sighting]:
        """Return none."""
        return []

    def write(self, command: Command, answers: float) -> None:  # noqa: ARG002
        """Note a command to the drives."""
        if self._fails:
            raise OSError("no answer")
        self.said.append(f"{command.tau.tolist()}")

    def engage_brakes(self) -> None:
        """Note a command to the brakes."""
        self.said.append("brakes")

    def release(self) -> None:
        """Note that a person lets it go on."""
        self.said.append("released")

    def waits(self) -> str:
        """Return what keeps it from being commanded: nothing does."""
        return ""

    def conflict(self) -> str:
        """Return who else commands it: nobody can."""
        return ""

    def trouble(self) -> str:
        """Return none."""
        return ""

    def news(self) -> list[str]:
        """Return none."""
        return []

    def close(self) -> None:
        """Nothing is to be given up."""


def command(*, brakes: bool) -> Command:
    """Return a command of zero torque."""
    return Command(t=0.0, joints=np.zeros((4, 2)), hand=0.0, brakes=brakes)


def test_a_command_to_the_brakes_reaches_the_robot() -> None:
    """Nothing engages them before, and each command with them does, before the torques."""
    driver = Driver(brakes=True)
    link = RobotLink(driver)
    for brakes in (False, True, True):
        link.write(command(brakes=brakes), 0.0, np.zeros(3))
        assert link.braked == brakes
    assert driver.said == ["[0.0, 0.0]", "brakes", "[0.0, 0.0]", "brakes", "[0.0, 0.0]"]
    link.release()
    assert not link.braked
    assert driver.said[-1] == "released"


def test_drives_that_do_not_answer_do_not_keep_the_brakes_off() -> None:
    """The brakes are engaged before the drives are told."""
    driver = Driver(brakes=True, fails=True)
    with pytest.raises(OSError, match="no answer"):
        RobotLink(driver).write(command(brakes=True), 0.0, np.zeros(3))
    assert driver.said == ["brakes"]


def test_a_robot_without_brakes_says_so_when_the_link_is_made() -> None:
    """Refused in one line, unless the caller accepts an arm that is only de-energised."""
    with pytest.raises(InputError, match="wanted brakes"):
        RobotLink(Driver(brakes=False))
    driver = Driver(brakes=False)
    RobotLink(driver, unbraked=True).write(command(brakes=True), 0.0, np.zeros(3))
    assert driver.said == ["[0.0, 0.0]"]


def test_drivers_of_other_packages_are_found_by_name(monkeypatch: pytest.MonkeyPatch) -> None:
    """An unknown name lists those that there are; one that does not load says so."""
    entry = EntryPoint("mine", "nowhere.at_all:driver", DRIVERS.group)
    monkeypatch.setattr("mitt.robot.cell.plugins.entry_points", lambda **_: [entry])
    with pytest.raises(InputError, match="one of ros2, sim, franka, mine, ur"):
        driver_named("yours")
    with pytest.raises(InputError, match="repair that package"):
        driver_named("mine")


def test_what_is_no_driver_is_refused() -> None:
    """In one line, before any command."""
    with pytest.raises(InputError, match="robot"):
        RobotLink(object())  # type: ignore[arg-type]


def test_what_a_driver_makes_has_to_be_a_robot(monkeypatch: pytest.MonkeyPatch, arm: Arm) -> None:
    """One line; a driver of mitt is no other package's."""
    package = ModuleType("of_a_vendor")
    vars(package)["none"] = lambda _cell, _arm: object()
    monkeypatch.setitem(sys.modules, "of_a_vendor", package)
    points = [EntryPoint(name, "of_a_vendor:none", DRIVERS.group) for name in ("none", "franka")]
    monkeypatch.setattr("mitt.robot.cell.plugins.entry_points", lambda **_: points)
    with pytest.raises(InputError, match=r"robot: wanted .*Robot"):
        driver_named("none")(read_cell("wam-sim"), arm)
    with pytest.raises(InputError, match=r"robot\.joints: wanted some of panda_joint1"):
        driver_named("franka")(read_cell("wam-sim"), arm)
