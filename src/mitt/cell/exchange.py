"""Shared memory and bell between the live loop and the process of a robot's driver.

Readings, positions, commands and words go through rings in one memory. A writer notes an entry's
count before and after it writes; a reader takes an entry whose two counts are those that it looked
for, before and after it has copied it, as with frames (:mod:`mitt.cell.frames`). So neither side
ever waits for the other, whatever that does. The bell is a socket, rung by a byte: it ends a wait,
and it ends itself with the process at its other end.
"""

import os
from enum import IntEnum
from mmap import mmap
from select import select
from socket import AF_UNIX, SOCK_STREAM, socket, socketpair
from typing import Any, TypeAlias, final

import numpy as np

from mitt.signals import ArmState, Sighting

Entry: TypeAlias = Any
"""An entry, a record of NumPy, or a field of one."""

#: Entries of the rings: a reader may be late by so many.
_READINGS = 64
_POINTS = 256
_COMMANDS = 8
_WORDS = 64
_ORDERS = 8
#: Longest text of a word [bytes].
_LENGTH = 1000


class Call(IntEnum):
    """What a driver is asked, each a method of :class:`mitt.cell.robot.Robot`."""

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


def _ring(*fields: Entry) -> np.dtype[Any]:
    """Return an entry with its counts."""
    return np.dtype([("before", np.int64), *fields, ("after", np.int64)])


def _layout(n: int) -> np.dtype[Any]:
    """Return what the memory holds for an arm of ``n`` joints."""
    reading = _ring(("t", float), ("q", float, (n,)), ("dq", float, (n,)))
    point = _ring(("t", float), ("found", bool), ("r_o", float, (3,)), ("covariance", float, (9,)))
    command = _ring(
        ("answers", float),
        ("t", float),
        ("joints", float, (4, n)),
        ("hand", float),
        ("brakes", bool),
    )
    word = _ring(("call", np.int64), ("raised", bool), ("text", f"S{_LENGTH}"))
    return np.dtype(
        [
            ("brakes", np.int64),
            ("call", np.int64),
            ("since", float),
            ("begun", np.int64),
            ("done", np.int64),
            ("readings", reading, (_READINGS,)),
            ("points", point, (_POINTS,)),
            ("words", word, (_WORDS,)),
            ("commands", command, (_COMMANDS,)),
            ("orders", _ring(("call", np.int64)), (_ORDERS,)),
        ],
        align=True,
    )


@final
class EntryRing:
    """Entries that one process writes and another reads."""

    def __init__(self, slots: Entry) -> None:
        """Take the memory of the entries."""
        self._slots, self._size, self._count = slots, len(slots), 0

    def put(self, **fields: object) -> int:
        """Write an entry; return its count."""
        self._count = count = self._count + 1
        slot = self._slots[count % self._size]
        slot["before"] = count
        for name, value in fields.items():
            slot[name] = value
        slot["after"] = count
        return count

    def take(self) -> list[Entry]:
        """Return copies of all entries since the last call, oldest first; lost ones are left."""
        found = list[Entry]()
        while True:
            slot = self._slots[(self._count + 1) % self._size]
            count = int(slot["after"])
            if count <= self._count:
                return found
            copy = slot.copy()
            self._count = count
            if copy["before"] == count == slot["before"]:
                found.append(copy)


@final
class Exchange:
    """The memory and one end of the bell.

    Attributes:
        state: Single numbers: ``brakes`` (whether there are any), what the driver is asked now
            (``call``) and since when (``since`` [s], 0 where it is asked nothing), counts of the
            newest order that was ``begun`` and ``done``.
        readings: From the driver.
        points: From the driver.
        words: From the driver: what it was asked, whether it raised, and what it said.
        commands: To the driver.
        orders: To the driver: brakes, release, close.
    """

    def __init__(self, memory: int, bell: socket, n: int) -> None:
        """Take the file of the memory, an end of the bell, and the number of joints."""
        layout = _layout(n)
        os.truncate(memory, layout.itemsize)
        self.memory, self.bell = memory, bell
        self.state: Entry = np.frombuffer(mmap(memory, layout.itemsize), layout, 1)[0]
        self.readings, self.points = (
            EntryRing(self.state["readings"]),
            EntryRing(self.state["points"]),
        )
        self.words, self.commands = (
            EntryRing(self.state["words"]),
            EntryRing(self.state["commands"]),
        )
        self.orders = EntryRing(self.state["orders"])
        bell.setblocking(False)

    def say(self, call: Call, text: str, *, raised: bool = False) -> None:
        """Write a word."""
        said = text.encode()[:_LENGTH]
        self.words.put(call=int(call), raised=raised, text=said)

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


def reading_of(entry: Entry) -> ArmState:
    """Return a reading."""
    return ArmState(t=float(entry["t"]), q=entry["q"], dq=entry["dq"])


def sighting_of(entry: Entry) -> Sighting:
    """Return a position."""
    return Sighting(
        t=float(entry["t"]),
        found=bool(entry["found"]),
        r_o=entry["r_o"],
        covariance=entry["covariance"].reshape(3, 3),
    )
