"""A robot whose driver runs in a process of its own, so that no maker's client can hang mitt.

Every call of :class:`mitt.robot.cell.robot.Robot` but ``release`` returns at once, or after its
time: what was said is in shared memory, what is to be said is put there
(:mod:`mitt.robot.cell.exchange`). A driver that hangs is asked to stop the robot beside the call
that has not returned. Where it does not begin to within 8 ms it is killed: Linux closes its
connections, and a controller stops an arm whose client is gone.
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
    """A robot's driver, which another package may add, failed, or does not answer."""


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
        self._name, self._over, self._silence = (
            f"driver {cell.robot.driver!r}",
            "",
            cell.robot.watchdog,
        )
        self._braked = self._released = False
        self._said = dict[Call, tuple[bool, str]]()
        self._raised, self._news = dict[Call, str](), list[str]()
        self._n = arm.n
        self._exchange, there = exchange_pair(arm.n)
        fds = (there.fileno(), self._exchange.memory)
        with safe_path():
            self._process = Popen(  # noqa: S603  # nosec B603
                [sys.executable, "-P", "-m", "mitt.robot.cell.driver_host", *map(str, fds)],
                pass_fds=fds,
                stdin=DEVNULL,
                start_new_session=True,  # the keyboard's signals are for mitt
            )
        there.close()
        atexit.register(self._kill)
        try:
            self._exchange.bell.setblocking(True)
            with Connection(os.dup(self._exchange.bell.fileno())) as link:
                link.send((os.getpid(), sys.path, cell, arm))
            self._exchange.bell.setblocking(False)
            self._await_made()
        except BaseException:
            self.close()
            raise
        self.brakes = bool(self._exchange.state[Mark.BRAKES])

    def _await_made(self) -> None:
        """Wait until the driver has made its robot."""
        end = monotonic() + _MADE
        while Call.MAKE not in self._said:
            self._hear()
            if Call.MAKE in self._raised:
                raise DriverError(self._raised[Call.MAKE])
            if Call.MAKE in self._said:
                return
            self._check_there()
            if monotonic() > end:
                raise DriverError(f"{self._name} has not connected to the robot in {_MADE:.0f} s")
            self._wait(0.1)

    def read(self, timeout: float) -> Sequence[ArmState]:
        """Return all encoder readings since the last call.

        Raises:
            DriverError: Reading failed, or the driver of an arm that moves does not answer.
        """
        end = monotonic() + timeout
        while True:
            found = [reading_of(x, self._n) for x in self._exchange.readings.take()]
            if found:
                return found
            self._raise_of(Call.READ)
            if self._released and (why := self._hangs(self._silence)):
                raise DriverError(why)
            left = end - monotonic()
            if left <= 0.0:
                return ()
            self._wait(left)

    def points(self) -> Sequence[Sighting]:
        """Return all positions of the ball since the last call."""
        self._raise_of(Call.POINTS)
        return [sighting_of(x) for x in self._exchange.points.take()]

    def write(self, command: Command, answers: float) -> None:
        """Leave a command for the driver; DriverError where the last one failed."""
        self._raise_of(Call.WRITE)
        self._exchange.commands.put(
            answers, command.t, command.hand, float(command.brakes), command.joints
        )
        self._exchange.ring()

    def engage_brakes(self) -> str:
        """Let the driver stop the robot, beside a call that does not return; else kill it."""
        if self._over or self._braked:  # gone, or told already, and it answered
            return self._over
        self._released, number = False, self._order(Call.ENGAGE_BRAKES)
        hangs = self._hangs(self._silence) != ""
        begun = self._came(Mark.BEGUN, number, _BEGUN if hangs else _BUSY)
        if not begun or not self._came(Mark.DONE, number, _BRAKED):
            return self._killed()
        self._hear()
        if Call.ENGAGE_BRAKES in self._raised:
            raise DriverError(self._raised.pop(Call.ENGAGE_BRAKES))
        _, unheard = self._said[Call.ENGAGE_BRAKES]
        self._braked = not unheard
        return unheard

    def release(self) -> None:
        """Let the driver release the brakes, and wait for that; DriverError where it fails."""
        self._check_there()
        self._braked = False
        number = self._order(Call.RELEASE)
        if not self._came(Mark.DONE, number, _RELEASED, until=asked_to_end):
            self._check_there()
            raise DriverError(self._hangs() or f"{self._name} does not release the brakes")
        self._exchange.readings.take()  # of before
        self._raise_of(Call.RELEASE)
        self._released = True

    def waits(self) -> str:
        """Return who is not there yet; the driver itself where it does not answer."""
        return self._status(Call.WAITS) or self._hangs()

    def conflict(self) -> str:
        """Return what a person has to see to before the arm may move, beside trouble."""
        return self._status(Call.CONFLICT)

    def trouble(self) -> str:
        """Return why the robot takes no commands, or why its driver has stopped it."""
        return self._status(Call.TROUBLE) or self._status(Call.WATCHDOG)

    def news(self) -> Sequence[str]:
        """Return how throws ended since the last call."""
        self._raise_of(Call.NEWS)
        said, self._news = self._news, []
        return said

    def close(self) -> None:
        """Let the driver close, and end its process."""
        if self._process.poll() is None and not self._over:
            self._order(Call.CLOSE)
            with suppress(TimeoutExpired):
                self._process.wait(_CLOSED)
        self._kill()
        atexit.unregister(self._kill)
        if self._exchange.bell.fileno() >= 0:
            self._exchange.close()

    def _order(self, call: Call) -> int:
        """Order something; return its number."""
        number = self._exchange.orders.put(float(call))
        self._exchange.ring()
        return number

    def _came(
        self, what: Mark, number: int, within: float, *, until: Callable[[], bool] = lambda: False
    ) -> bool:
        """Wait until an order is begun, or done; say whether it was in time."""
        end = monotonic() + within
        while int(self._exchange.state[what]) < number:
            left = end - monotonic()
            if left <= 0.0 or self._over or until():
                return False
            self._wait(min(left, 0.05 if what is Mark.DONE else 0.001))
        return True

    def _wait(self, timeout: float) -> None:
        """Wait for the driver's bell; note where its process is gone."""
        if not self._exchange.wait(timeout) and not self._over:
            with suppress(TimeoutExpired):
                self._process.wait(_ENDS)
            self._over = self._ended()
            self._kill()

    def _ended(self) -> str:
        """Say how the process has ended."""
        status = self._process.poll()
        if status is None:
            return f"{self._name} has given its link up"
        if status == -SIGXCPU:
            return (
                f"{self._name} has computed too long without a pause: Linux has ended its process"
            )
        if status < 0:
            return f"{self._name} has crashed: its process was ended by {Signals(-status).name}"
        return f"{self._name} has ended its process, with status {status}"

    def _hangs(self, longest: float = _SLOW) -> str:
        """Say which call has not returned for a time [s]; nothing where none is late."""
        since = self._exchange.state[Mark.SINCE]
        passed = monotonic() - since
        if since == 0.0 or passed < longest:
            return ""
        call = Call(int(self._exchange.state[Mark.CALL])).name.lower()
        return f"{self._name} does not answer: {call} has not returned for {1e3 * passed:.0f} ms"

    def _killed(self) -> str:
        """Kill the process, and say why."""
        if not self._over:
            why = self._hangs(0.0) or f"{self._name} does not answer"
            self._over = f"{why}; its process was killed, which closes its link to the robot"
            self._kill()
        return self._over

    def _kill(self) -> None:
        """Kill the process, which may be stopped."""
        self._process.kill()
        with suppress(TimeoutExpired):
            self._process.wait(_GONE)

    def _check_there(self) -> None:
        """Refuse to go on without the process."""
        if self._over:
            raise DriverError(self._over)

    def _hear(self) -> None:
        """Take in what the driver has said."""
        for call, raised, text in self._exchange.words():
            if call is Call.NEWS and not raised:
                self._news.append(text)
            elif raised and call not in _STATUS:
                self._raised[call] = text
            else:
                self._said[call] = raised, text

    def _raise_of(self, call: Call) -> None:
        """Raise what a call raised in the driver, once; always where that is gone."""
        self._hear()
        self._check_there()
        if call in self._raised:
            raise DriverError(self._raised.pop(call))

    def _status(self, call: Call) -> str:
        """Return what the driver said last of how the robot is, or raise it."""
        self._hear()
        self._check_there()
        raised, text = self._said.get(call, (False, ""))
        if raised:
            raise DriverError(text)
        return text
