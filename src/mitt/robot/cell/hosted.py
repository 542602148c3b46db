"""What runs in a process of its own, so that no maker's client can hang mitt: a robot's driver.

A tracker (:mod:`mitt.robot.cell.trackers`) is hosted in the same way. Every call of
:class:`mitt.robot.cell.robot.Robot` but ``release`` returns at once, or after its time: what was
said is in shared memory, what is to be said is put there (:mod:`mitt.robot.cell.exchange`). A
driver that hangs is asked to stop the robot beside the call that has not returned. Where it does
not begin to within 8 ms it is killed: Linux closes its connections, and a controller stops an arm
whose client is gone.
"""

import atexit
import os
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection
from signal import SIGXCPU, Signals
from subprocess import DEVNULL, Popen, TimeoutExpired
from typing import final

from mitt.clock import monotonic
from mitt.core.arm.arm import Arm
from mitt.core.errors import MittError
from mitt.core.signals import ArmState, Command, Sighting
from mitt.interrupts import asked_to_end, safe_path
from mitt.io.cell import Cell
from mitt.robot.cell.exchange import Call, Mark, exchange_pair, reading_of, sighting_of

#: Time in which a driver has to be made and to connect; in which it has to release the brakes,
#: which recovers a robot from a stop as well [s].
_MADE = 60.0
_RELEASED = 20.0
#: Time in which the driver has to ask for the brakes beside a call that does not return, or else,
#: and in which they have to answer [s].
_BEGUN = 0.008
_BUSY = 0.025
_BRAKED = 0.3
#: Time in which a driver has to close before it is killed, and in which a killed one is gone [s].
_CLOSED = 0.5
_GONE = 0.2
#: Time in which one that has given its link up is seen to have ended by itself [s].
_ENDS = 0.005
#: Time after which a call of a driver is said not to return [s].
_SLOW = 0.05
#: What holds until something else is said.
_STATUS = (Call.WAITS, Call.CONFLICT, Call.TROUBLE, Call.WATCHDOG)


class DriverError(MittError):
    """A driver or a tracker, which another package may add, failed, or does not answer."""


@final
class HostedProcess:
    """A process that runs what a maker's client can hang or crash.

    Attributes:
        name: What it runs, in words.
        exchange: Goes between it and this one.
        over: How it ended, in words; nothing while it runs.
    """

    def __init__(self, name: str, module: str, n: int, *sent: object) -> None:
        """Start it.

        Args:
            name: What it runs, in words.
            module: What it is: it takes the numbers of bell and memory.
            n: Number of joints that the exchange is for.
            sent: What it is sent first.
        """
        self.name, self.over = name, ""
        self._said = dict[Call, tuple[bool, str]]()
        self._raised, self._news = dict[Call, str](), list[str]()
        self.exchange, there = exchange_pair(n)
        fds = (there.fileno(), self.exchange.memory)
        with safe_path():
            self._process = Popen(  # noqa: S603  # nosec B603
                [sys.executable, "-P", "-m", module, *map(str, fds)],
                pass_fds=fds,
                stdin=DEVNULL,
                start_new_session=True,  # the keyboard's signals are for mitt
            )
        there.close()
        atexit.register(self.kill)
        try:
            self.exchange.bell.setblocking(True)
            with Connection(os.dup(self.exchange.bell.fileno())) as link:
                link.send((os.getpid(), sys.path, n, sent))
            self.exchange.bell.setblocking(False)
        except BaseException:
            self.close()
            raise

    def await_made(self, longest: float) -> None:
        """Wait until what it runs is made and connected, for a time [s].

        Raises:
            DriverError: It cannot be made, or is not in time.
        """
        end = monotonic() + longest
        while Call.MAKE not in self._said:
            self.hear()
            if Call.MAKE in self._raised:
                raise DriverError(self._raised[Call.MAKE])
            if Call.MAKE in self._said:
                return
            self.check_there()
            if monotonic() > end:
                raise DriverError(f"{self.name} has not connected in {longest:.0f} s")
            self.wait(0.1)

    def order(self, call: Call) -> int:
        """Order something; return its number."""
        number = self.exchange.orders.put(float(call))
        self.exchange.ring()
        return number

    def came(
        self, what: Mark, number: int, within: float, *, until: Callable[[], bool] = lambda: False
    ) -> bool:
        """Wait until an order is begun, or done; say whether it was in time."""
        end = monotonic() + within
        while int(self.exchange.state[what]) < number:
            left = end - monotonic()
            if left <= 0.0 or self.over or until():
                return False
            self.wait(min(left, 0.05 if what is Mark.DONE else 0.001))
        return True

    def wait(self, timeout: float) -> None:
        """Wait for its bell; note where it is gone."""
        if not self.exchange.wait(timeout) and not self.over:
            with suppress(TimeoutExpired):
                self._process.wait(_ENDS)
            self.over = self._ended()
            self.kill()

    def _ended(self) -> str:
        """Say how it has ended."""
        status = self._process.poll()
        if status is None:
            return f"{self.name} has given its link up"
        if status == -SIGXCPU:
            return f"{self.name} has computed too long without a pause: Linux has ended its process"
        if status < 0:
            return f"{self.name} has crashed: its process was ended by {Signals(-status).name}"
        return f"{self.name} has ended its process, with status {status}"

    def hangs(self, longest: float = _SLOW) -> str:
        """Say which call has not returned for a time [s]; nothing where none is late."""
        since = self.exchange.state[Mark.SINCE]
        passed = monotonic() - since
        if since == 0.0 or passed < longest:
            return ""
        call = Call(int(self.exchange.state[Mark.CALL])).name.lower()
        return f"{self.name} does not answer: {call} has not returned for {1e3 * passed:.0f} ms"

    def put_down(self) -> str:
        """Kill it where it does not answer, and say why."""
        if not self.over:
            why = self.hangs(0.0) or f"{self.name} does not answer"
            self.over = f"{why}; its process was killed, which closes its link to the robot"
            self.kill()
        return self.over

    def kill(self) -> None:
        """Kill it; it may be stopped."""
        self._process.kill()
        with suppress(TimeoutExpired):
            self._process.wait(_GONE)

    def close(self) -> None:
        """Let what it runs close, and end it."""
        if self._process.poll() is None and not self.over:
            self.order(Call.CLOSE)
            with suppress(TimeoutExpired):
                self._process.wait(_CLOSED)
        self.kill()
        atexit.unregister(self.kill)
        if self.exchange.bell.fileno() >= 0:
            self.exchange.close()

    def check_there(self) -> None:
        """Refuse to go on without it."""
        if self.over:
            raise DriverError(self.over)

    def hear(self) -> None:
        """Take in what was said there."""
        for call, raised, text in self.exchange.words():
            if call is Call.NEWS and not raised:
                self._news.append(text)
            elif raised and call not in _STATUS:
                self._raised[call] = text
            else:
                self._said[call] = raised, text

    def news(self) -> list[str]:
        """Return the news since the last call."""
        said, self._news = self._news, []
        return said

    def said(self, call: Call) -> str:
        """Return what was said last of a call that was ordered; DriverError where it raised."""
        self.hear()
        if call in self._raised:
            raise DriverError(self._raised.pop(call))
        return self._said[call][1]

    def raise_of(self, call: Call) -> None:
        """Raise what a call raised there, once; always where it is gone."""
        self.hear()
        self.check_there()
        if call in self._raised:
            raise DriverError(self._raised.pop(call))

    def status(self, call: Call) -> str:
        """Return what was said last of how things are, or raise it."""
        self.hear()
        self.check_there()
        raised, text = self._said.get(call, (False, ""))
        if raised:
            raise DriverError(text)
        return text


@final
class HostedRobot:
    """The robot of a driver of a maker; see :class:`mitt.robot.cell.robot.Robot`.

    Attributes:
        brakes: Whether the arm has brakes that a command can engage.
    """

    def __init__(self, cell: Cell, arm: Arm) -> None:
        """Start the process and wait until the driver has made its robot.

        Raises:
            DriverError: It cannot, or does not.
        """
        self._silence, self._braked, self._released = cell.robot.watchdog, False, False
        self._n, name = arm.n, f"driver {cell.robot.driver!r}"
        self._process = HostedProcess(name, "mitt.robot.cell.driver_host", arm.n, cell, arm)
        try:
            self._process.await_made(_MADE)
        except BaseException:
            self.close()
            raise
        self.brakes = bool(self._process.exchange.state[Mark.BRAKES])

    def read(self, timeout: float) -> Sequence[ArmState]:
        """Return all encoder readings since the last call.

        Raises:
            DriverError: Reading failed, or the driver of an arm that moves does not answer.
        """
        process, end = self._process, monotonic() + timeout
        while True:
            found = [reading_of(x, self._n) for x in process.exchange.readings.take()]
            if found:
                return found
            process.raise_of(Call.READ)
            if self._released and (why := process.hangs(self._silence)):
                raise DriverError(why)
            left = end - monotonic()
            if left <= 0.0:
                return ()
            process.wait(left)

    def points(self) -> Sequence[Sighting]:
        """Return all positions of the ball since the last call."""
        self._process.raise_of(Call.POINTS)
        return [sighting_of(x) for x in self._process.exchange.points.take()]

    def write(self, command: Command, answers: float) -> None:
        """Leave a command for the driver; DriverError where the last one failed."""
        exchange = self._process.exchange
        self._process.raise_of(Call.WRITE)
        exchange.commands.put(
            answers, command.t, command.hand, float(command.brakes), command.joints
        )
        exchange.ring()

    def engage_brakes(self) -> str:
        """Let the driver stop the robot, beside a call that does not return; else kill it."""
        process = self._process
        if process.over or self._braked:  # gone, or told already, and it answered
            return process.over
        self._released, number = False, process.order(Call.ENGAGE_BRAKES)
        hangs = process.hangs(self._silence) != ""
        begun = process.came(Mark.BEGUN, number, _BEGUN if hangs else _BUSY)
        if not begun or not process.came(Mark.DONE, number, _BRAKED):
            return process.put_down()
        unheard = process.said(Call.ENGAGE_BRAKES)
        self._braked = not unheard
        return unheard

    def release(self) -> None:
        """Let the driver release the brakes, and wait for that; DriverError where it fails."""
        process = self._process
        process.check_there()
        self._braked = False
        number = process.order(Call.RELEASE)
        if not process.came(Mark.DONE, number, _RELEASED, until=asked_to_end):
            process.check_there()
            raise DriverError(process.hangs() or f"{process.name} does not release the brakes")
        process.exchange.readings.take()  # of before
        process.raise_of(Call.RELEASE)
        self._released = True

    def waits(self) -> str:
        """Return who is not there yet; the driver itself where it does not answer."""
        return self._process.status(Call.WAITS) or self._process.hangs()

    def conflict(self) -> str:
        """Return what a person has to see to before the arm may move, beside trouble."""
        return self._process.status(Call.CONFLICT)

    def trouble(self) -> str:
        """Return why the robot takes no commands, or why its driver has stopped it."""
        return self._process.status(Call.TROUBLE) or self._process.status(Call.WATCHDOG)

    def news(self) -> Sequence[str]:
        """Return how throws ended since the last call."""
        self._process.raise_of(Call.NEWS)
        return self._process.news()

    def close(self) -> None:
        """Let the driver close, and end its process."""
        self._process.close()
