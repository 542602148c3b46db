"""A session at a cell: wait, ask, catch, stop, ask again; what a person sees and says."""

import json
import signal
import sys
import threading
from collections.abc import Callable, Iterator, MutableSequence
from contextlib import contextmanager
from multiprocessing.sharedctypes import RawArray
from types import FrameType
from typing import Any, TypeAlias, final

from mitt.cell.local import LocalPort, LocalRobot
from mitt.cell.prepare import PreparedCell, balls_of, catchers, scene_of_cell
from mitt.cell.simulated import SimulatedCell
from mitt.generator.mapping import DirectMap
from mitt.interrupts import SIGNALS, notice
from mitt.link.clock import monotonic
from mitt.link.live import LiveLoop
from mitt.link.modes import Mode
from mitt.link.recorder import Recorder
from mitt.link.robot import Robot, RobotLink
from mitt.link.sight import FrameSource

#: Time between two lines on what is waited for [s].
_LINES = 5.0
#: Most ticks of a rehearsal.
_REHEARSED = 8000
#: Cycles between two looks at what is no part of the loop.
_LOOK = 50
#: Numbers of the live table, in this order.
SHOWN = ("mode", "rate", "age_us", "late", "lost", "throws", "caught", "told")
_MODES = tuple(Mode)

Numbers: TypeAlias = MutableSequence[float]


def numbers() -> Numbers:
    """Return shared memory for the numbers of the live table."""
    memory: Numbers = RawArray("d", len(SHOWN))
    return memory


def loop_of(
    prepared: PreparedCell,
    f: DirectMap,
    robot: Robot,
    frames: FrameSource | None,
    recorder: Recorder | None = None,
) -> LiveLoop:
    """Return the live loop of a cell with a robot."""
    cell = prepared.cell
    first, again = catchers(prepared, f)
    unbraked = cell.robot.options.get("unbraked") is True
    return LiveLoop(
        RobotLink(robot, unbraked=unbraked), prepared.arm, first, again,
        ready_speed=cell.motion.ready_speed, silence=cell.robot.watchdog,
        frames=frames, recorder=recorder,
    )  # fmt: skip


def rehearse(prepared: PreparedCell, f: DirectMap) -> None:
    """Catch once in a simulation, so that nothing is compiled or loaded in front of the robot."""
    cell = prepared.cell
    scene = scene_of_cell(cell, None)
    port = LocalPort(cell.source.sigma)
    source = balls_of(prepared, scene, seed=0, count=1)
    simulated = SimulatedCell(
        cell, prepared.arm, scene, source, port, rig=prepared.rig, clock=monotonic
    )
    loop = loop_of(prepared, f, LocalRobot(simulated, port), port)
    loop.healthy()
    loop.begin()
    for _ in range(_REHEARSED):
        loop.cycle()
        if loop.mode is Mode.STOPPED or (simulated.done and loop.mode is Mode.CATCHING):
            return


@final
class Person:
    """Who says when the arm may move: somebody at the keyboard, or --yes once at the start."""

    def __init__(self, *, yes: bool) -> None:
        """Listen to the keyboard, if there is one and nothing was said beforehand."""
        self._yes, self.keyboard = yes, sys.stdin is not None and sys.stdin.isatty()
        self._pressed = threading.Event()
        if self.keyboard:
            threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        """Note each time Enter is pressed."""
        for _ in sys.stdin:
            self._pressed.set()

    @property
    def can_speak(self) -> bool:
        """Whether anybody can say anything from now on."""
        return self.keyboard or self._yes

    def agrees(self) -> bool:
        """Say whether the arm may move; each word counts once."""
        if self._yes:
            self._yes = False
            return True
        if self._pressed.is_set():
            self._pressed.clear()
            return True
        return False

    def forget(self) -> None:
        """Forget what was pressed before it was asked for."""
        self._pressed.clear()


@final
class Session:
    """Runs the live loop of a cell until its throws are made, or it is stopped for good.

    Attributes:
        signal: Number of the signal that ended it; 0 without one.
        verdicts: What a simulated cell said of each throw; empty at a real one.
    """

    def __init__(
        self, loop: LiveLoop, robot: Robot, person: Person, tell: Callable[[str], None],
        *, throws: int | None, shown: Numbers | None = None,
    ) -> None:  # fmt: skip
        """Take the loop, its robot, whom to ask and tell, and where the table reads numbers."""
        self._loop, self._robot, self._person, self._tell = loop, robot, person, tell
        self._throws, self.signal = throws, 0
        self.verdicts: list[dict[str, Any]] = []
        self.shown = numbers() if shown is None else shown
        self._begun = monotonic()

    def run(self) -> bool:
        """Catch; return whether all was done that was to be done."""
        with self._signals():
            while self._waited():
                self._loop.begin()
                self._tell("the arm moves")
                self._begun = monotonic()
                try:
                    if self._caught_all():
                        return True
                finally:
                    if self._loop.mode is not Mode.STOPPED:
                        self._loop.finish()
                self._tell(f"stopped: {self._loop.why}; the brakes are engaged")
                if self.signal or not self._person.keyboard:
                    return False
        return False

    def _waited(self) -> bool:
        """Wait for a healthy robot and for a person's word; say whether both came."""
        spoken, asked = monotonic() - _LINES, False
        agreed, before = False, "nothing heard yet"
        while not self.signal:
            trouble = self._loop.healthy()
            if trouble != before:  # a word said before is no answer to this
                self._person.forget()
                agreed = agreed and not (trouble and self._person.keyboard)
                before = trouble
            self._show()
            own = trouble != "" and trouble == self._robot.trouble()
            if not agreed and (own or not trouble) and self._person.agrees():
                agreed = True
                if own:  # a person has said that a protective stop is acknowledged
                    self._robot.release()
            if agreed and not trouble:
                return True
            if monotonic() - spoken > _LINES or (not trouble and not asked and not agreed):
                spoken, asked = monotonic(), asked or not trouble
                self._tell(f"waiting: {trouble}" if trouble
                           else "press Enter and the arm moves to its ready pose")  # fmt: skip
                if not trouble and not self._person.can_speak:
                    self._tell("nobody can say that the arm may move: say --yes")
                    return False
        return False

    def _caught_all(self) -> bool:
        """Go on until all throws are made, or the arm is stopped; say whether all are."""
        loop, count, wanted = self._loop, 0, self._throws
        while loop.mode is not Mode.STOPPED:
            loop.cycle()
            count += 1
            if self.signal:
                loop.stop(f"interrupted by {signal.Signals(self.signal).name}")
            if count % _LOOK:
                continue
            self.verdicts += [said for raw in self._robot.news() if (said := news_of(raw))]
            self._show()
            made = wanted is not None and loop.counts.throws >= wanted
            told = any(said.get("done") for said in self.verdicts)
            if (made or told) and loop.idle:
                loop.finish()
                return True
        return False

    @contextmanager
    def _signals(self) -> Iterator[None]:
        """Let signals ask for a controlled stop instead of ending the process at once."""

        def heard(number: int, frame: FrameType | None) -> None:  # noqa: ARG001
            self.signal = self.signal or number
            notice()

        before = {n: signal.getsignal(n) for n in SIGNALS if signal.getsignal(n) != signal.SIG_IGN}
        for number in before:
            signal.signal(number, heard)
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)

    def _show(self) -> None:
        """Write the numbers of the live table where another process reads them."""
        loop, counts = self._loop, self._loop.counts
        passed = max(monotonic() - self._begun, 1e-3)
        caught = sum(said.get("status") == "caught" for said in self.verdicts)
        self.shown[:] = [
            _MODES.index(loop.mode), counts.ticks / passed, 1e6 * loop.age, counts.late,
            counts.lost, counts.throws, caught, len(self.verdicts),
        ]  # fmt: skip

    def summary(self) -> dict[str, Any]:
        """Return what happened, as ``mitt.run/1``; without a simulated cell what cannot be known.

        Whether a ball was caught is known of a simulated cell alone, which says so.
        """
        counts, said = self._loop.counts, [str(x.get("status")) for x in self.verdicts]
        last = self.verdicts[-1] if self.verdicts else {}
        throws = max(counts.throws, len(said))
        ended = {name: said.count(name) for name in ("caught", "dropped", "aborted")}
        untouched = said.count("missed")
        refused = min(counts.refused, untouched) if said else counts.refused
        stopped = min(counts.stopped, untouched - refused) if said else counts.stopped
        return {
            "schema": "mitt.run/1",
            "throws": throws,
            "caught": ended["caught"],
            "dropped": ended["dropped"],
            "missed": untouched - refused - stopped if said else 0,
            "unreachable": refused,
            "stopped": stopped,
            "unknown": throws - len(said) if said else throws - refused - stopped,
            "limit_violations": last.get("limit_violations"),
            "command_age_us": last.get("command_age_us"),
            "late_ticks": counts.late,
            "lost_readings": counts.lost,
            "ticks": counts.ticks,
            "stops": counts.stops,
        }


def news_of(raw: str) -> dict[str, Any]:
    """Return what a simulated cell said; nothing where it is no JSON object."""
    try:
        said = json.loads(raw)
    except ValueError:
        return {}
    return said if isinstance(said, dict) else {}
