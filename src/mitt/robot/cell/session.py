"""A session at a cell: wait, ask, catch, stop, ask again; what a person sees and says.

At the end the other side: a simulated cell served in real time, a tick each millisecond by the
steady clock.
"""

import json
import os
import select
import signal
import sys
import threading
from collections import Counter
from collections.abc import Callable, Iterator, MutableSequence
from contextlib import contextmanager, suppress
from multiprocessing.sharedctypes import RawArray
from types import FrameType
from typing import Any, TypeAlias, final

from mitt.clock import hurried, monotonic, pinned, sleep_until, time_of_day, uncollected
from mitt.core.arm.arm import Arm
from mitt.core.catcher.loading import load_decisions
from mitt.core.signals import TICK, Array
from mitt.interrupts import SIGNALS, ask_to_end, notice
from mitt.lab.trials.score import STATUSES as THROWN
from mitt.lab.trials.statistics import spread_of
from mitt.lab.world.scene import Scene
from mitt.robot.cell.drivers import Connection, local_connection, local_robot
from mitt.robot.cell.feeds import Feed
from mitt.robot.cell.live import LiveLoop, Mode
from mitt.robot.cell.prepare import (
    CellMap,
    PreparedCell,
    catchers,
    cell_about,
    cell_generator,
    cell_map,
    period_of,
    setpoints_of,
)
from mitt.robot.cell.recorder import Recorder
from mitt.robot.cell.robot import Robot, RobotLink
from mitt.robot.cell.simulated import Port, SimulatedCell

#: Time between two lines on what is waited for [s].
_LINES = 5.0
#: Time within which a protective stop has to end that was acknowledged [s].
_ENDS_IN = 2.0
#: Numbers of the live table, in this order.
SHOWN = ("mode", "rate", "age_us", "late", "lost", "throws", "taken", "told", "placed")
STATES = tuple(mode.value for mode in Mode)
"""What the first of them counts, in words."""
#: Room for the line of the live table on what is odd [bytes].
_WORDS = 240
#: How a simulated cell says that throws and parts ended.
_ENDS = (*THROWN, "met", "slipped")
CORE = 0
"""Core of the simulated cell among those allowed: the first; ``mitt run`` takes the last."""

Numbers: TypeAlias = MutableSequence[float]


def shared_numbers() -> Numbers:
    """Return shared memory for the numbers of the live table."""
    memory: Numbers = RawArray("d", len(SHOWN))
    return memory


def words() -> Any:  # noqa: ANN401 (shared memory)
    """Return shared memory for what the live table says in words."""
    return RawArray("c", _WORDS)


def loop_of(
    prepared: PreparedCell,
    f: CellMap,
    connection: Connection,
    recorder: Recorder | None = None,
    *,
    measures: Callable[[Arm, Array], Array] | None = None,
) -> LiveLoop:
    """Return the live loop of a cell with a robot, and what moves its arm to measure it, if any."""
    cell = prepared.cell
    unbraked = cell.robot.options.get("unbraked") is True
    return LiveLoop(
        RobotLink(connection.robot, unbraked=unbraked, setpoints=setpoints_of(prepared)),
        prepared.arm,
        *catchers(prepared, f),
        ready_speed=cell.motion.ready_speed,
        silence=cell.robot.watchdog,
        frames=connection.frames,
        lenses=prepared.lenses,
        recorder=recorder,
        clock=connection.clock,
        period=period_of(cell),
        placing=prepared.placing,
        measures=measures,
    )


def made_ready(prepared: PreparedCell, tell: Callable[[str], None]) -> CellMap:
    """Return the map of a cell, all loaded that its loop needs; say first what takes some time."""
    tell(f"{prepared.cell.name}: loading its map, or learning it, which takes a minute")
    f = cell_map(prepared)
    tell(f"{prepared.cell.name}: rehearsing in simulation, so that nothing is loaded later")
    rehearse(prepared, f)
    return f


def rehearse(prepared: PreparedCell, f: CellMap) -> None:
    """Catch, or meet, once in a simulation: nothing is compiled or loaded in front of the robot."""
    load_decisions(prepared.arm, cell_generator(prepared, f), cell_about(prepared, f).settings)
    local = local_robot(prepared, seed=0, count=1)
    loop = loop_of(prepared, f, local_connection(prepared.cell, local))
    loop.healthy()
    loop.begin()
    for _ in range(8000 if prepared.placing is None else 20_000):  # 8 s, 20 s
        loop.cycle()
        if loop.mode is Mode.STOPPED or (local.simulated.done and loop.mode is Mode.CATCHING):
            return


@final
class Person:
    """Who says when the arm may move: somebody at the keyboard, or --yes once at the start.

    --yes is said before anybody knows how the arm is found. It holds for an arm at rest in its
    ranges that is in no protective stop and that nobody else commands, or is met for the first time
    so; from the first sight of another state on a person has to say it.
    """

    def __init__(self, *, yes: bool) -> None:
        """Listen to the keyboard, if there is one, from when a person is asked."""
        self._yes, self.keyboard = yes, sys.stdin is not None and sys.stdin.isatty()
        self._pressed, self._listens = threading.Event(), False

    def _listen(self) -> None:
        """Note each time Enter is pressed, until the keyboard is gone.

        It is read in the foreground alone: a process in the background that reads is stopped.
        """
        with suppress(OSError, ValueError):
            key = sys.stdin.fileno()
            while True:
                select.select([key], [], [])
                if os.tcgetpgrp(key) != os.getpgrp():
                    select.select([], [], [], 0.2)
                    continue
                typed = os.read(key, 4096)
                if not typed:
                    break
                if b"\n" in typed:
                    self._pressed.set()
        self.keyboard = False

    @property
    def can_speak(self) -> bool:
        """Whether anybody can say anything from now on."""
        return self.keyboard or self._yes

    def agrees(self) -> bool:
        """Say whether the arm may move; what was pressed counts once, --yes for one start."""
        if self._yes:
            return True
        self.listen()
        pressed = self._pressed.is_set()
        if pressed:
            self._pressed.clear()
        return pressed

    def listen(self) -> None:
        """Listen to the keyboard from now on."""
        if self.keyboard and not self._listens:
            self._listens = True
            threading.Thread(target=self._listen, daemon=True).start()

    def forget(self) -> None:
        """Forget what was pressed before it was asked for."""
        self._pressed.clear()

    def spend(self) -> bool:
        """Let --yes hold no more: the arm moves, or is not as it was thought; say if it did."""
        held, self._yes = self._yes, False
        return held


@final
class Session:
    """Runs the live loop of a cell until its throws are made, or it is stopped for good.

    Attributes:
        signal: Number of the signal that ended it; 0 without one.
    """

    def __init__(
        self,
        loop: LiveLoop,
        robot: Robot,
        person: Person,
        tell: Callable[[str], None],
        *,
        throws: int | None,
        shown: Numbers | None = None,
        said: Any = None,  # noqa: ANN401
        recorder: Recorder | None = None,
    ) -> None:
        """Take the loop, its robot, whom to ask, and what takes lines for a person.

        ``throws`` are to be made, None without an end; the live table reads ``shown`` and ``said``;
        ``recorder`` records the catches.
        """
        self._loop, self._robot, self._person, self._teller = loop, robot, person, tell
        self._throws, self._recorder, self.signal = throws, recorder, 0
        self._told, self._last, self._done = Counter[str](), dict[str, Any](), False
        self._forces, self._begun = list[float | None](), monotonic()
        self.shown = shared_numbers() if shown is None else shown
        self.words = words() if said is None else said
        self._lost = False

    def run(self) -> bool:
        """Catch; return whether all was done that was to be done.

        However it ends, the arm has come to rest if it could and its brakes are engaged.
        """
        with self._signals():
            try:
                return self._caught()
            finally:
                self._loop.leave("the session ends")

    def _caught(self) -> bool:
        """Wait, catch, stop, and wait again; say whether all was done that was to be done."""
        loop = self._loop
        while self._waited():
            self._hear()
            if not loop.counts.ticks:  # of throws before this session
                self._told, self._last, self._forces = Counter(), {}, []
            self._done = False
            self._tell("the arm moves")  # before it does: to tell may take time
            loop.begin()
            self._begun = monotonic()
            if self._caught_all():
                if loop.why:  # brakes that do not answer
                    self._tell(f"done{loop.why}")
                return True
            self._tell("; ".join(x for x in (f"stopped: {loop.why}", loop.brakes) if x))
            if self.signal or not self._person.keyboard:
                return False
        return False

    def _tell(self, text: str) -> None:
        """Say a line; whoever cannot hear it does not keep the arm from being stopped."""
        with suppress(Exception):
            self._teller(text)

    def _waited(self) -> bool:
        """Wait for a healthy robot and for a person's word; say whether both came."""
        spoken, asked, told = monotonic() - _LINES, False, ""
        agreed, until, before = False, 0.0, "nothing heard yet"
        while not self.signal:
            trouble = self._loop.healthy()
            if self._loop.disturbed and self._person.spend():
                self._tell(f"--yes holds no more: {trouble}")
            if trouble != before:  # a word said before is no answer to this
                self._person.forget()
            over = agreed and trouble and (trouble != before or monotonic() > until)
            before = trouble
            if over:  # the stop that was acknowledged has not ended, or another has come
                agreed = False
                self._loop.finish()
            self._show()
            own = trouble != "" and trouble == self._robot.trouble()
            if not agreed and (own or not trouble) and self._person.agrees():
                agreed, until = True, monotonic() + _ENDS_IN
                if own and (failed := self._loop.acknowledge()):
                    agreed = False
                    self._tell(failed)
            if agreed and not trouble:
                self._person.spend()
                return True
            passed = monotonic() - spoken
            other = trouble != told and passed > 0.5
            if passed > _LINES or other or (not trouble and not asked and not agreed):
                spoken, asked, told = monotonic(), asked or not trouble, trouble
                self._tell(
                    f"waiting: {trouble}"
                    if trouble
                    else "press Enter and the arm moves to its ready pose"
                )
            if not self._person.can_speak and (not trouble or self._loop.disturbed):
                self._tell(
                    "nobody can say that the arm may move: say --yes"
                    if not trouble
                    else "nobody can say that the arm may move then: see to it, start again"
                )
                break
        return False

    def _caught_all(self) -> bool:
        """Go on until all throws are made, or the arm is stopped; say whether all are."""
        loop, count, wanted = self._loop, 0, self._throws
        while loop.mode is not Mode.STOPPED:
            loop.cycle()
            count += 1
            if self.signal:
                loop.stop(f"interrupted by {signal.Signals(self.signal).name}")
            if count % 50:  # what follows is no part of the loop
                continue
            self._hear()
            self._show()
            made = wanted is not None and loop.counts.throws >= wanted
            if (made or self._done) and loop.idle:
                loop.finish()
                return True
        return False

    def _hear(self) -> None:
        """Count what a simulated cell says of its throws; tell once of what fails beside the loop.

        What fails here serves a summary alone: the catch goes on.
        """
        failed = "" if self._recorder is None or self._lost else self._recorder.trouble
        if failed and self._loop.idle:  # to tell may take time
            self._lost = True
            self._tell(f"the recording is not whole: {failed}; the catch goes on")
        heard, failed = list[dict[str, Any]](), ""
        try:
            heard = [news_of(raw) for raw in self._robot.news()]
        except Exception as error:  # a driver's own
            failed = f"what became of throws is not told: {error}"[:_WORDS]
        self._loop.note("news", failed)
        for said in heard:
            if said.get("status") in _ENDS:
                self._told[said["status"]] += 1
                self._told["placed"] += said.get("placed") is True
                self._forces.append(said.get("peak_contact_force_n"))
                self._last, self._done = said, said.get("done") is True

    @contextmanager
    def _signals(self) -> Iterator[None]:
        """Let signals ask for a controlled stop instead of ending the process at once."""

        def heard(number: int, frame: FrameType | None) -> None:  # noqa: ARG001
            self.signal = self.signal or number
            ask_to_end()
            notice()

        before = {n: signal.getsignal(n) for n in SIGNALS if signal.getsignal(n) != signal.SIG_IGN}
        for number in before:
            signal.signal(number, heard)
        try:
            yield
        finally:
            ask_to_end(asked=False)
            for number, handler in before.items():
                signal.signal(number, handler)

    def _show(self) -> None:
        """Write the numbers of the live table where another process reads them."""
        loop, counts = self._loop, self._loop.counts
        passed = max(monotonic() - self._begun, 1e-3)
        self.shown[:] = [
            STATES.index(loop.mode.value),
            counts.ticks / passed,
            1e6 * loop.age,
            counts.late,
            counts.lost,
            counts.throws,
            self._told["caught"] + self._told["met"],
            sum(self._told[end] for end in _ENDS),
            self._told["placed"],
        ]
        self.words.value = self._odd.encode()[: _WORDS - 1]

    @property
    def _odd(self) -> str:
        """What is odd in what the robot and the ball's source send; nothing if nothing is."""
        counts, notes = self._loop.counts, self._loop.notes
        stray = (
            f"{counts.stray} positions or images so far with impossible stamps"
            if counts.stray
            else ""
        )
        return "; ".join(x for x in (*notes.values(), stray) if x)

    @property
    def clock(self) -> str:
        """What the catches so far say of the eyes' clock, in words."""
        return self._loop.clock.words

    def summary(self) -> dict[str, Any]:
        """Return what happened, as ``mitt.run/1``; without a simulated cell what cannot be known.

        Whether a ball was caught, or a part met, and how hard it pressed, is known of a simulated
        cell alone, which says so.
        """
        counts, last = self._loop.counts, self._last
        said = sum(self._told[end] for end in _ENDS)
        ends = ("met", "placed", "slipped") if self._loop.meets else ("caught", "dropped")
        throws, untouched = max(counts.throws, said), self._told["missed"]
        refused = min(counts.refused, untouched) if said else counts.refused
        stopped = min(counts.stopped, untouched - refused) if said else counts.stopped
        return {
            "schema": "mitt.run/1",
            "throws": throws,
            **{end: self._told[end] for end in ends},
            "missed": untouched - refused - stopped if said else 0,
            "unreachable": refused,
            "stopped": stopped,
            "unknown": throws - said if said else throws - refused - stopped,
            "force_n": spread_of(self._forces),
            "limit_violations": last.get("limit_violations"),
            "command_age_us": last.get("command_age_us"),
            "late_ticks": counts.late,
            "lost_readings": counts.lost,
            **({"not_taken": counts.empty} if self._loop.meets else {}),
            "repeated": counts.repeated,
            "stray": counts.stray,
            "ticks": counts.ticks,
            "stops": counts.stops,
            "notes": list(self._loop.notes.values()),
            "clock": self._loop.clock.figures,
        }


def news_of(raw: str) -> dict[str, Any]:
    """Return what a simulated cell said; nothing where that is not what one says."""
    try:
        said = json.loads(raw)
        json.dumps(said, allow_nan=False)
    except (ValueError, TypeError, RecursionError):
        return {}
    if not isinstance(said, dict) or not isinstance(said.get("status"), str):
        return {}
    number, ages = said.get("limit_violations"), said.get("command_age_us")
    fits = isinstance(number, int | None) and isinstance(ages, dict | None)
    fits &= isinstance(said.get("peak_contact_force_n"), int | float | None)
    return said if fits else {}


@final
class Server:
    """A simulated cell that is served in real time."""

    def __init__(
        self,
        prepared: PreparedCell,
        scene: Scene,
        feed: Feed,
        tell: Callable[[str], None],
        port: Callable[[], Port],
    ) -> None:
        """Take the cell; ``port`` joins the network when the loop begins."""
        self._prepared, self._scene, self._feed = prepared, scene, feed
        self._tell, self._port = tell, port
        self._cell: SimulatedCell | None = None
        self.late = self.slipped = 0

    def run(self) -> None:
        """Serve until all throws are made and judged, and the robot is at rest."""
        prepared = self._prepared
        made_ready(prepared, self._tell)
        with uncollected():
            port = self._port()
            self._cell = cell = SimulatedCell(
                prepared, self._scene, self._feed, port, clock=monotonic, started=time_of_day()
            )
            try:
                with hurried() as granted, pinned(CORE):
                    self._tell(f"{prepared.cell.name} is there; {granted}")
                    self._go_on(cell)
            finally:
                port.close()

    def _go_on(self, cell: SimulatedCell) -> None:
        """Make tick after tick, each at its time; 3 ms late, a quarter faster until in time.

        After its last throw the cell waits for 10 s at most until its brakes are engaged.
        """
        due, end, behind = monotonic(), float("inf"), 0.0
        while monotonic() < end:
            cell.tick()
            made_up = min(behind, 0.25 * TICK)
            due, behind = due + TICK - made_up, behind - made_up
            late = sleep_until(due)
            if late > 0.003:
                self.slipped += 1
                due, behind = due + late, behind + late
            self.late += late > TICK
            cell.act()
            if cell.done:
                end = min(end, monotonic() + 10.0) if cell.released else monotonic()

    def summary(self) -> dict[str, Any]:
        """Return what was thrown and what became of it."""
        cell = self._cell
        if cell is None:
            return {"throws": 0}
        said = cell.statuses
        return {
            "throws": len(said),
            **{name: said.count(name) for name in cell.ends},
            **({"placed": cell.placed} if "met" in cell.ends else {}),
            "force_n": spread_of(cell.forces),
            "limit_violations": cell.violations,
            "command_age_us": cell.ages.percentiles_us(),
            "late_ticks": self.late,
            "slipped_ticks": self.slipped,
        }


def serve(prepared: PreparedCell, scene: Scene, feed: Feed, tell: Callable[[str], None]) -> Server:
    """Return a simulated cell that is to be served over ROS 2."""
    from mitt.robot.cell.ros2 import Ros2Cell  # noqa: PLC0415 (needs the extra ros2)

    return Server(prepared, scene, feed, tell, lambda: Ros2Cell(prepared.cell, prepared.arm))
