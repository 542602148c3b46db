"""Shared memory and bell between the live loop and the process of a robot's driver.

Readings, positions, commands and words go through rings in one memory. A writer notes an entry's
count before and after it writes; a reader takes an entry whose two counts are those that it looked
for, before and after it has copied it, as with frames (:mod:`mitt.robot.cell.frames`). So neither
side ever waits for the other, whatever that does. The bell is a socket, rung by a byte: it ends a
wait, and it ends itself with the process at its other end.
"""

import os
from enum import IntEnum
from mmap import mmap
from select import select
from socket import AF_UNIX, SOCK_STREAM, socket, socketpair
from typing import NamedTuple, final

import numpy as np
from numpy.typing import ArrayLike

from mitt.core.signals import ArmState, Array, Sighting

CORE = -1
"""Core of the live loop and of its driver among those allowed, the last: they take turns."""
#: Entries of the rings: a reader may be late by so many.
_READINGS = 64
_POINTS = 256
_COMMANDS = 8
_WORDS = 64
_ORDERS = 8
#: Longest text of a word [bytes], a multiple of 8.
_LENGTH = 1000
#: Numbers of a position: time, whether it was found, place, covariance.
_POINT = 2 + 3 + 9


class Call(IntEnum):
    """What a driver is asked, each a method of :class:`mitt.robot.cell.robot.Robot`."""

    NONE = 0
    MAKE = 1
    READ = 2
    POINTS = 3
    WRITE = 4
    ENGAGE_BRAKES = 5
    RELEASE = 6
    WAITS = 7
    CONFLICT = 8
    TROUBLE = 9
    NEWS = 10
    CLOSE = 11
    WATCHDOG = 12
    """Nothing that a driver is asked: what the watchdog of its process has done."""


class Mark(IntEnum):
    """Places of single numbers in the memory."""

    BRAKES = 0
    """Whether there are brakes."""
    CALL = 1
    """What the driver is asked now."""
    SINCE = 2
    """Since when, by the steady clock [s]; 0 where it is asked nothing."""
    BEGUN = 3
    """Number of the newest order that was begun."""
    DONE = 4
    """Number of the newest order that was done."""


@final
class EntryRing:
    """Entries of numbers that one process writes and another reads."""

    def __init__(self, memory: "memoryview[float]", size: int, width: int) -> None:
        """Take the memory of ``size`` entries of ``width`` numbers."""
        self._size, self._count = size, 0
        self._before, self._after = memory[:size], memory[size : 2 * size]
        self._values = np.asarray(memory[2 * size :]).reshape(size, width)

    def put(self, *parts: ArrayLike) -> int:
        """Write an entry, its numbers in parts; return its count."""
        self._count = count = self._count + 1
        k, row, at = count % self._size, self._values[count % self._size], 0
        self._before[k] = count
        for part in parts:
            if isinstance(part, np.ndarray):
                row[at : at + part.size] = part.ravel()
                at += part.size
            else:
                row[at] = part
                at += 1
        self._after[k] = count
        return count

    def take(self) -> list[Array]:
        """Return all entries since the last call, oldest first; those that were lost are left."""
        found = list[Array]()
        while True:
            k = (self._count + 1) % self._size
            count = int(self._after[k])
            if count <= self._count:
                return found
            row = self._values[k].copy()
            self._count = count
            if self._before[k] == count == self._after[k]:
                found.append(row)


@final
class Word(NamedTuple):
    """What a driver said: on being asked what, whether it raised, and its text."""

    call: Call
    raised: bool
    text: str


@final
class Exchange:
    """The memory and one end of the bell.

    Attributes:
        state: Single numbers, at the places of :class:`Mark`.
        readings: From the driver: time, angles, speeds.
        points: From the driver: positions of the ball.
        commands: To the driver: stamp answered, time, hand, brakes, rows of the joints.
        orders: To the driver: brakes, release, close, each a :class:`Call`.
    """

    def __init__(self, memory: int, bell: socket, n: int) -> None:
        """Take the file of the memory, an end of the bell, and the number of joints."""
        widths = (
            (_READINGS, 1 + 2 * n),
            (_POINTS, _POINT),
            (_WORDS, 3 + _LENGTH // 8),
            (_COMMANDS, 4 + 4 * n),
            (_ORDERS, 1),
        )
        whole = len(Mark) + sum(size * (2 + width) for size, width in widths)
        os.truncate(memory, 8 * whole)
        self.memory, self.bell = memory, bell
        numbers = memoryview(mmap(memory, 8 * whole)).cast("B").cast("d")
        self.state, rings, at = numbers[: len(Mark)], list[EntryRing](), len(Mark)
        for size, width in widths:
            rings.append(EntryRing(numbers[at : at + size * (2 + width)], size, width))
            at += size * (2 + width)
        self.readings, self.points, self._words, self.commands, self.orders = rings
        bell.setblocking(False)

    def say(self, call: Call, text: str, *, raised: bool = False) -> None:
        """Write a word."""
        said = text.encode()[:_LENGTH]
        letters = np.frombuffer(said.ljust(_LENGTH, b"\0"), float)
        self._words.put(float(call), float(raised), float(len(said)), letters)

    def words(self) -> list[Word]:
        """Return what was said since the last call."""
        return [
            Word(
                Call(int(row[0])),
                bool(row[1]),
                row[3:].tobytes()[: int(row[2])].decode(errors="replace"),
            )
            for row in self._words.take()
        ]

    def ring(self) -> None:
        """End a wait at the other end; a bell that rings already, or whose end is gone, stays."""
        try:
            self.bell.send(b"!")
        except OSError:
            return

    def wait(self, timeout: float) -> bool:
        """Wait until the bell rings, for a time [s]; say whether the other end is still there."""
        if not select([self.bell], [], [], max(timeout, 0.0))[0]:
            return True
        try:
            return self.bell.recv(4096) != b""
        except BlockingIOError:
            return True
        except OSError:
            return False

    def close(self) -> None:
        """Give memory and bell up."""
        self.bell.close()
        os.close(self.memory)


def exchange_pair(n: int) -> tuple[Exchange, socket]:
    """Return one end of a new exchange for ``n`` joints, and the bell's other end."""
    here, there = socketpair(AF_UNIX, SOCK_STREAM)
    return Exchange(os.memfd_create("mitt-driver"), here, n), there


def reading_of(row: Array, n: int) -> ArmState:
    """Return a reading of ``n`` joints."""
    return ArmState(t=float(row[0]), q=row[1 : 1 + n], dq=row[1 + n :])


def sighting_of(row: Array) -> Sighting:
    """Return a position."""
    return Sighting(
        t=float(row[0]), found=row[1] > 0.0, r_o=row[2:5], covariance=row[5:].reshape(3, 3)
    )
