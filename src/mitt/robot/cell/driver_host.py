"""The process of a robot's driver: the maker's client, and a watchdog over it and over mitt.

A client may wait for ever, hold Python's lock, or crash; here it can do so to itself alone. In turn
the driver is asked for readings and positions, given the command that answers them, and asked how
the robot is. A thread watches. It tells the robot to stop by ``engage_brakes``

- where a call does not return: beside it, from this thread, once the loop asks for the brakes;
- where no command has come for ``robot.watchdog``: the loop was stopped, or hangs;
- where mitt is gone: then the driver is closed and the process ends.

A client that holds Python's lock keeps the thread from running: the loop, which sees no answer,
kills this process, and Linux closes its connections. If mitt is gone too an alarm of Linux, which
the thread puts off as long as it runs, kills it. Linux also ends a client that computes for 15 ms
without a pause, where it has the priority of real time.
"""

import gc
import os
import resource
import signal
import sys
import threading
from collections.abc import Callable
from multiprocessing.connection import Connection
from socket import socket
from typing import Any, final

from mitt.clock import hurried, monotonic, pause, pinned, uncollected
from mitt.core.arm.arm import Arm
from mitt.core.errors import MittError
from mitt.core.signals import TICK, Array, Command
from mitt.io.cell import Cell
from mitt.robot.cell.exchange import CORE, Call, Exchange, Mark
from mitt.robot.cell.readings import check_reading
from mitt.robot.cell.robot import Robot, driver_named

#: Longest for which the driver is let wait for a reading, before orders are looked at [s].
_READS = 0.002
#: Time between two looks of the watchdog, and that which a call may take while the brakes are
#: asked for, before it asks for them beside that call [s].
_LOOKS = 0.002
_BESIDE = 0.004
#: Time after which Linux ends a process whose watchdog does not run, and that in which a robot
#: connects, recovers or is closed, by clients that hold Python's lock meanwhile [s].
_ALARM = 1.0
_SLOWLY = 60.0
#: Time in which a driver has to brake, and then to close, once mitt is gone [s].
_CLOSES = 0.4
#: Share of a period for which the command that answers a reading is waited for.
_ANSWERS = 0.8
#: Above that of the loop, on whose core it is: what comes and goes does so at once, while the loop
#: waits. A client that computes for so long without a pause is ended by Linux, once the brakes are
#: released [us].
_PRIORITY = 60
_COMPUTES_US = 25_000
_STATUS = (Call.CONFLICT, Call.WAITS, Call.TROUBLE)


@final
class Host:
    """Asks a driver and answers for it."""

    def __init__(self, exchange: Exchange, cell: Cell, arm: Arm, parent: int) -> None:
        """Take the exchange, the cell and its arm, and the number of the loop's process."""
        self._exchange, self._cell, self._arm, self._parent = exchange, cell, arm, parent
        self._silence, self._answers = cell.robot.watchdog, _ANSWERS * cell.robot.ticks * TICK
        self._released, self._heard, self._slow, self._over = False, 0.0, True, False
        self._braking, self._ordering = threading.Lock(), threading.Lock()
        self._ordered = 0
        self._orders, self._said = list[tuple[int, Call]](), dict[Call, tuple[bool, str]]()
        self._robot: Robot

    def run(self) -> None:
        """Make the robot and serve it until told to close, or until mitt is gone."""
        signal.setitimer(signal.ITIMER_REAL, _SLOWLY)
        made = self._ask(
            Call.MAKE, lambda: driver_named(self._cell.robot.driver)(self._cell, self._arm)
        )
        if made is None:
            self._exchange.ring()
            return
        self._robot = made
        self._exchange.state[Mark.BRAKES] = float(made.brakes)
        self._exchange.say(Call.MAKE, "")
        self._exchange.ring()
        with hurried(_PRIORITY), pinned(CORE), uncollected():
            threading.Thread(target=self._watch, daemon=True).start()
            self._be_slow(slow=False)
            while not self._over:
                self._cycle()
        self._be_slow(slow=True)
        self._ask(Call.CLOSE, made.close)

    def _be_slow(self, *, slow: bool) -> None:
        """Say whether a call may take long."""
        self._slow = slow
        signal.setitimer(signal.ITIMER_REAL, _SLOWLY if slow else _ALARM)
        _, most = resource.getrlimit(resource.RLIMIT_RTTIME)
        bound = most if slow or not self._released else _COMPUTES_US
        resource.setrlimit(resource.RLIMIT_RTTIME, (bound, most))

    def _ask(self, call: Call, asked: Callable[[], Any]) -> Any:  # noqa: ANN401
        """Return what the driver answers; None where it raises, which is said."""
        raised, answer = self._answered(call, asked)
        if raised:
            self._exchange.say(call, answer, raised=True)
            return None
        return answer

    def _answered(self, call: Call, asked: Callable[[], Any]) -> tuple[bool, Any]:
        """Return whether the driver raised, and its answer, or in words what it raised."""
        state = self._exchange.state
        state[Mark.CALL], state[Mark.SINCE] = float(call), monotonic()
        try:
            return False, asked()
        except BaseException as error:  # SystemExit too
            return True, self._named(error)
        finally:
            state[Mark.SINCE] = 0.0

    def _named(self, error: BaseException) -> str:
        """Return what the driver has raised, in words."""
        return said_of(f"driver {self._cell.robot.driver!r}", error)

    def _cycle(self) -> None:
        """Do what was ordered; read, publish, write what answers it; say how the robot is."""
        self._obey()
        if self._over:
            return
        exchange, robot, begun = self._exchange, self._robot, monotonic()
        readings = self._ask(Call.READ, self._read)
        if not readings and monotonic() - begun < 0.5 * _READS:  # one that does not wait, or fails
            exchange.wait(0.5 * _READS)
        self._ask(Call.POINTS, self._publish_points)
        for reading in readings or ():
            exchange.readings.put(reading.t, reading.q, reading.dq)
        exchange.ring()
        command = self._answer(readings[-1].t if readings else None)
        if command is not None:
            given = self._command_of(command)
            self._ask(Call.WRITE, lambda: robot.write(given, float(command[0])))
        self._ask(Call.NEWS, self._publish_news)
        for call in _STATUS:
            self._say_status(call)

    def _read(self) -> Any:  # noqa: ANN401
        """Return the readings of the driver, checked."""
        readings = self._robot.read(_READS)
        for reading in readings or ():
            check_reading(reading, self._arm.n)
        return readings

    def _publish_points(self) -> None:
        """Publish positions of the ball."""
        for p in self._robot.points():
            self._exchange.points.put(p.t, float(p.found), p.r_o, p.covariance)

    def _publish_news(self) -> None:
        """Pass on how throws ended."""
        for text in self._robot.news():
            self._exchange.say(Call.NEWS, text)

    def _say_status(self, call: Call) -> None:
        """Say how the robot is where that is new."""
        robot = self._robot
        asked = {
            Call.CONFLICT: robot.conflict,
            Call.WAITS: robot.waits,
            Call.TROUBLE: robot.trouble,
        }
        said = self._answered(call, asked[call])
        if self._said.get(call, (False, "")) != said:
            self._said[call] = said
            self._exchange.say(call, said[1], raised=said[0])

    def _answer(self, stamp: float | None) -> Array | None:
        """Return the newest command; wait for the one that answers a reading with this stamp."""
        end, newest = monotonic() + self._answers, None
        while True:
            if taken := self._exchange.commands.take():
                newest, self._heard = taken[-1], monotonic()
            answered = newest is not None and (stamp is None or newest[0] >= stamp)
            left = end - monotonic()
            if answered or stamp is None or not self._released or left <= 0.0 or self._orders:
                return newest
            if not self._exchange.wait(left):  # mitt is gone
                self._brake(0)
                self._over = True
                return None
            self._take_orders()

    def _command_of(self, row: Array) -> Command:
        """Return a command from its entry."""
        joints = row[4:].reshape(4, self._arm.n)
        return Command(t=float(row[1]), joints=joints, hand=float(row[2]), brakes=row[3] > 0.0)

    def _take_orders(self) -> None:
        """Take what was ordered."""
        with self._ordering:
            for order in self._exchange.orders.take():
                self._ordered += 1
                self._orders.append((self._ordered, Call(int(order[0]))))

    def _obey(self) -> None:
        """Do what was ordered."""
        self._take_orders()
        while self._orders:
            number, call = self._orders.pop(0)
            if call is Call.ENGAGE_BRAKES:
                self._brake(number)
            elif call is Call.RELEASE:
                self._release(number)
            else:
                self._over = True

    def _release(self, number: int) -> None:
        """Release the brakes; it may take long."""
        state = self._exchange.state
        state[Mark.BEGUN] = number
        self._be_slow(slow=True)
        self._exchange.commands.take()
        with self._braking:
            self._ask(Call.RELEASE, self._robot.release)
        self._exchange.say(Call.WATCHDOG, "")
        self._heard, self._released = monotonic(), True
        self._be_slow(slow=False)
        state[Mark.DONE] = number
        self._exchange.ring()

    def _brake(self, number: int) -> None:
        """Tell the robot to stop, from whichever thread; the other one leaves it at that."""
        if not self._braking.acquire(blocking=False):
            return
        try:
            state = self._exchange.state
            if 0 < number <= int(state[Mark.DONE]):
                return
            self._released, state[Mark.BEGUN] = False, max(number, int(state[Mark.BEGUN]))
            try:
                said, raised = self._robot.engage_brakes() or "", False
            except BaseException as error:
                said, raised = self._named(error), True
            self._exchange.say(Call.ENGAGE_BRAKES, said, raised=raised)
            state[Mark.DONE] = max(number, int(state[Mark.DONE]))
            self._exchange.ring()
        finally:
            self._braking.release()

    def _watch(self) -> None:
        """Watch the calls, the loop and its process."""
        while os.getppid() == self._parent:
            signal.setitimer(signal.ITIMER_REAL, _SLOWLY if self._slow else _ALARM)
            pause(_LOOKS)
            now, since = monotonic(), self._exchange.state[Mark.SINCE]
            if self._released and not self._slow and now - self._heard > self._silence:
                passed = 1e3 * (now - self._heard)
                self._exchange.say(Call.WATCHDOG, f"no command for {passed:.0f} ms")
                self._brake(0)
            if since > 0.0 and now - since > _BESIDE:
                self._brake_beside()
        braking = threading.Thread(target=self._brake, args=(0,), daemon=True)
        braking.start()
        braking.join(_CLOSES)
        self._over = True  # the driver is closed, unless it hangs
        pause(_CLOSES)
        os._exit(1)

    def _brake_beside(self) -> None:
        """Brake beside a call that has not returned, where that was ordered."""
        self._take_orders()
        asked = [number for number, call in self._orders if call is Call.ENGAGE_BRAKES]
        if asked:
            self._brake(asked[-1])


def said_of(name: str, error: BaseException) -> str:
    """Return what a maker's client has raised, in words."""
    kind = "" if isinstance(error, MittError) else f"{type(error).__name__}: "
    return f"{name}: {kind}{error}".removesuffix(": ")


def join_exchange(bell: int, memory: int) -> tuple[Exchange, int, tuple[Any, ...]]:
    """Join the exchange of the loop's process, from one that it has started.

    Returns:
        The exchange, the number of the loop's process, and what that has sent.
    """
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):  # mitt sees to these
        signal.signal(number, signal.SIG_IGN)
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    os.dup2(2, 1)  # what a client prints is no result of mitt
    sys.setswitchinterval(0.0005)
    with Connection(os.dup(bell)) as link:
        parent, path, n, sent = link.recv()
    sys.path[:] = path
    return Exchange(memory, socket(fileno=bell), n), parent, sent


def serve_driver(bell: int, memory: int) -> None:
    """Be the process of a driver: the loop's is the parent, and sends cell and arm."""
    exchange, parent, sent = join_exchange(bell, memory)
    Host(exchange, sent[0], sent[1], parent).run()
    exchange.ring()
    gc.enable()
    os._exit(0)


if __name__ == "__main__":
    serve_driver(*map(int, sys.argv[1:]))
