"""A link passes the command to the brakes on, and refuses a robot that has none."""

from importlib.metadata import EntryPoint

import numpy as np
import pytest

from mitt.errors import InputError
from mitt.link.robot import GROUP, RobotLink, driver_named
from mitt.signals import ArmState, Command, Sighting


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
        link.write(command(brakes=brakes), 0.0)
        assert link.braked == brakes
    assert driver.said == ["[0.0, 0.0]", "brakes", "[0.0, 0.0]", "brakes", "[0.0, 0.0]"]
    link.release()
    assert not link.braked
    assert driver.said[-1] == "released"


def test_drives_that_do_not_answer_do_not_keep_the_brakes_off() -> None:
    """The brakes are engaged before the drives are told."""
    driver = Driver(brakes=True, fails=True)
    with pytest.raises(OSError, match="no answer"):
        RobotLink(driver).write(command(brakes=True), 0.0)
    assert driver.said == ["brakes"]


def test_a_robot_without_brakes_says_so_when_the_link_is_made() -> None:
    """Refused in one line, unless the caller accepts an arm that is only de-energised."""
    with pytest.raises(InputError, match="wanted brakes"):
        RobotLink(Driver(brakes=False))
    driver = Driver(brakes=False)
    RobotLink(driver, unbraked=True).write(command(brakes=True), 0.0)
    assert driver.said == ["[0.0, 0.0]"]


def test_drivers_of_other_packages_are_found_by_name(monkeypatch: pytest.MonkeyPatch) -> None:
    """An unknown name lists those that there are; one that does not load says so."""
    entry = EntryPoint("mine", "nowhere.at_all:driver", GROUP)
    monkeypatch.setattr("mitt.link.robot.entry_points", lambda **_: [entry])
    with pytest.raises(InputError, match="one of ros2, sim, mine"):
        driver_named("yours")
    with pytest.raises(InputError, match="repair that package"):
        driver_named("mine")


def test_what_is_no_driver_is_refused() -> None:
    """In one line, before any command."""
    with pytest.raises(InputError, match="robot"):
        RobotLink(object())  # type: ignore[arg-type]
