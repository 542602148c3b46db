"""However a session ends, the arm has come to rest if it could, and its brakes are engaged.

Any call of a driver may raise anything, or give what is of no use: once, or from then on.
"""

import json
import os
import signal
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

import numpy as np
import pytest
from local_cell import LocalCell
from support import thorough

from mitt.core.signals import ArmState, Command, Sighting
from mitt.robot.cell.live import Mode
from mitt.robot.cell.robot import Robot
from mitt.robot.cell.session import Person, Session, news_of

#: Speed below which an arm rests [rad/s].
STILL = 0.1
#: Speed of a joint in a catch [rad/s].
FAST = 1.5


class Failing:
    """Passes calls on but one, or all of a method from one on.

    Attributes:
        calls: How many calls of each method there were.
        told: What the brakes were told, and how fast the arm was then [rad/s].
        failed: How fast it was at the first call that failed; None before.
    """

    brakes = True

    def __init__(
        self,
        inner: Robot,
        method: str,
        first: int | None,
        fault: Callable[[], Any],
        *,
        forever: bool,
    ) -> None:
        """Take what fails, from which call on (None: from a fast joint on), and how."""
        self._inner, self._method, self._first = inner, method, first
        self._fault, self._forever = fault, forever
        self.calls, self.told = Counter[str](), list[tuple[bool, float]]()
        self.speed: Callable[[], float] = lambda: 0.0
        self.failed: float | None = None

    def _call(self, name: str, *given: Any) -> Any:  # noqa: ANN401
        """Make a call, or fail instead."""
        self.calls[name] += 1
        if name == self._method and (self.failed is None or self._forever) and self._due(name):
            self.failed = self.speed() if self.failed is None else self.failed
            return self._fault()
        found = getattr(self._inner, name)(*given)
        if name in ("engage_brakes", "release"):
            self.told.append((name == "engage_brakes", self.speed()))
        return found

    def _due(self, name: str) -> bool:
        """Say whether the call that fails has come."""
        if self._first is None:
            return self.failed is not None or self.speed() > FAST
        return self.calls[name] >= self._first

    def read(self, timeout: float) -> Sequence[ArmState]:
        """Read."""
        return self._call("read", timeout)  # type: ignore[no-any-return]

    def points(self) -> Sequence[Sighting]:
        """Return positions of the ball."""
        return self._call("points")  # type: ignore[no-any-return]

    def write(self, command: Command, answers: float) -> None:
        """Write."""
        self._call("write", command, answers)

    def engage_brakes(self) -> None:
        """Engage the brakes."""
        self._call("engage_brakes")

    def release(self) -> None:
        """Release them."""
        self._call("release")

    def waits(self) -> str:
        """Say what it waits for."""
        return self._call("waits")  # type: ignore[no-any-return]

    def conflict(self) -> str:
        """Say what a person has to see to."""
        return self._call("conflict")  # type: ignore[no-any-return]

    def trouble(self) -> str:
        """Say what is wrong."""
        return self._call("trouble")  # type: ignore[no-any-return]

    def news(self) -> Sequence[str]:
        """Say what became of throws."""
        return self._call("news")  # type: ignore[no-any-return]

    def close(self) -> None:
        """Give the link up."""
        self._call("close")


def raises(error: BaseException) -> Callable[[], Any]:
    """Return what raises an error."""

    def fault() -> Any:  # noqa: ANN401
        raise error

    return fault


FAULTS: dict[str, Callable[[], Any]] = {
    "its cable": raises(OSError("cable out")),
    "an interrupt": raises(KeyboardInterrupt()),
    "an exit": raises(SystemExit(3)),
    "nothing": lambda: None,
    "a number": lambda: 7,
    "wrong things": lambda: [None, "x"],
    "another arm's reading": lambda: [ArmState(t=0.0, q=np.zeros(9), dq=np.zeros(9))],
    "no place": lambda: [Sighting(t=0.0, found=True, r_o=np.zeros(2), covariance=np.eye(3))],
}


def ended(
    method: str,
    first: int | None,
    fault: Callable[[], Any],
    *,
    forever: bool,
    tell: Callable[[str], None] = lambda _: None,
) -> tuple[LocalCell, Failing, Session]:
    """Run a session of one throw in which something fails; return what was left."""
    made = list[Failing]()

    def driver(local: Robot, _: object) -> Robot:
        made.append(Failing(local, method, first, fault, forever=forever))
        return made[0]

    cell = LocalCell(throws=1, driver=driver)
    made[0].speed = lambda: cell.fastest
    cell.robot.waits = made[0].waits  # type: ignore[method-assign]
    session = Session(cell.loop, cell.robot, Person(yes=True), tell, throws=1)
    with suppress(Exception, KeyboardInterrupt, SystemExit):
        session.run()
    return cell, made[0], session


#: Method, first call that fails (None: in a catch), fault, and whether all fail from then on.
CASES = [
    ("read", None, "its cable", False),
    ("read", None, "its cable", True),
    ("read", None, "another arm's reading", False),
    ("read", None, "an interrupt", False),
    ("read", None, "nothing", True),
    ("read", 40, "wrong things", True),
    ("read", 700, "an exit", True),
    ("points", None, "no place", False),
    ("points", 200, "nothing", True),
    ("points", 30, "an interrupt", False),
    ("write", None, "its cable", True),
    ("write", 1, "an exit", False),
    ("engage_brakes", 1, "its cable", False),
    ("engage_brakes", 1, "an exit", True),
    ("release", 1, "its cable", False),
    ("release", 1, "an interrupt", False),
    ("waits", None, "its cable", True),
    ("waits", None, "a number", False),
    ("trouble", None, "an exit", False),
    ("trouble", 900, "wrong things", False),
    ("news", None, "an interrupt", False),
]


@pytest.mark.parametrize(("method", "first", "fault", "forever"), thorough(CASES[::2], CASES[1::2]))
def test_whatever_fails_the_brakes_are_told_last(
    method: str, first: int | None, fault: str, *, forever: bool
) -> None:
    """And the arm was at rest then, unless it could not be read or told any more."""
    cell, robot, _ = ended(method, first, FAULTS[fault], forever=forever)
    assert robot.failed is not None
    assert first is not None or robot.failed > FAST
    assert cell.loop.mode in (Mode.STOPPED, Mode.WAITING)
    if method == "engage_brakes" and forever:
        assert robot.calls[method] > 1
        assert "the brakes do not answer" in cell.loop.why
        return
    assert robot.told[-1][0] if robot.told else method == "read"
    if method != "write" and not (method == "read" and (forever or fault == "nothing")):
        assert all(speed < STILL for engaged, speed in robot.told if engaged), cell.loop.why


def test_news_that_fails_is_told_and_the_ball_is_caught() -> None:
    """It serves a summary alone."""
    cell, robot, session = ended("news", 3, FAULTS["its cable"], forever=True)
    assert cell.simulated.statuses == ["caught"]
    assert cell.loop.counts.stops == []
    assert robot.told[-1][0]
    assert "what became of throws is not told" in session.summary()["notes"][0]
    for odd in (7, [None, "x"]):
        cell.robot.news = lambda odd=odd: odd  # type: ignore[method-assign, misc]
        session._hear()


def test_a_screen_that_fails_keeps_no_brakes_off() -> None:
    """As one that was closed."""

    def broken(_: str) -> None:
        raise ValueError("I/O operation on closed file")

    cell, robot, _ = ended("none", 0, lambda: None, forever=False, tell=broken)
    assert cell.simulated.statuses == ["caught"]
    assert robot.told[-1][0]


@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGTERM])
def test_a_terminal_that_is_closed_ends_in_a_controlled_stop(number: signal.Signals) -> None:
    """In a catch; the line on it goes nowhere."""
    cell = LocalCell(throws=1)
    said = list[str]()
    session = Session(cell.loop, cell.robot, Person(yes=True), said.append, throws=1)

    def closed(_: Command) -> bool:
        if cell.fastest > 1.5 and not session.signal:
            os.kill(os.getpid(), number)
        return True

    cell.robot.on_write = closed
    assert not session.run()
    assert session.signal == number
    assert cell.fastest < STILL
    assert cell.robot.braked[-1]
    assert cell.simulated.violations == 0


@pytest.mark.parametrize("wrong", ["raises", "degrees", "names"])
def test_a_stop_that_was_acknowledged_is_no_release_for_good(wrong: str) -> None:
    """What comes after a person's word, before the arm moves, ends with the brakes engaged."""
    cell = LocalCell(throws=1)
    cell.robot.said = "protective stop: no command for 20 ms"

    def released(got: Sequence[ArmState]) -> Sequence[ArmState]:
        if cell.robot.braked != [False]:
            return got
        if wrong == "raises":
            raise OSError("cable out")
        return [
            ArmState(t=x.t, q=np.full(9 if wrong == "names" else 3, 100.0), dq=x.dq) for x in got
        ]

    cell.robot.on_read = released
    person = Person(yes=False)
    person.keyboard = person._listens = True
    session = Session(cell.loop, cell.robot, person, lambda _: person._pressed.set(), throws=1)
    with pytest.raises((OSError, ValueError)):
        session.run()
    assert cell.robot.braked == [False, True]


def test_what_others_say_of_throws_is_counted_only_where_it_is_that() -> None:
    """Any node of the network may publish there; a summary is JSON whatever it says."""
    good = {"status": "caught", "limit_violations": 0, "command_age_us": None, "done": False}
    assert news_of(json.dumps(good)) == good
    for raw in (
        "",
        "x",
        "[" * 100_000,
        "7",
        "null",
        '{"status": 7}',
        '{"status": "caught", "x": NaN}',
        '{"status": "caught", "limit_violations": "many"}',
        None,
        7,
        b"\xff",
    ):
        assert news_of(raw) == {}  # type: ignore[arg-type]
