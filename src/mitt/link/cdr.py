"""Messages as ROS 2 sends them: plain CDR (OMG CDR version 1), read and written field by field.

A reading and a command each millisecond are worth their own few lines: the general way of Cyclone's
Python package takes a tenth of a millisecond a message, this one a tenth of that.
"""

import struct
from typing import final

import numpy as np

from mitt.errors import InputError
from mitt.signals import Array

#: Encapsulation of plain CDR, little endian.
_HEAD = b"\x00\x01\x00\x00"
#: Longest string or sequence that is read.
_MOST = 4096


@final
class Writer:
    """Builds a message; aligned as CDR wants it, little endian."""

    def __init__(self, head: bytes = _HEAD) -> None:
        """Begin a message, or go on with one whose first part is always the same."""
        self._out = bytearray(head)

    def _align(self, side: int) -> None:
        """Fill up to a multiple of ``side`` bytes after the encapsulation."""
        self._out += bytes((4 - len(self._out)) % side)

    def whole(self, x: int) -> "Writer":
        """Append an integer of 32 bits."""
        self._align(4)
        self._out += struct.pack("<I", x & 0xFFFFFFFF)
        return self

    def small(self, x: int) -> "Writer":
        """Append a byte."""
        self._out.append(x)
        return self

    def text(self, x: str) -> "Writer":
        """Append a string."""
        raw = x.encode() + b"\0"
        self.whole(len(raw))
        self._out += raw
        return self

    def texts(self, xs: tuple[str, ...]) -> "Writer":
        """Append a sequence of strings."""
        self.whole(len(xs))
        for x in xs:
            self.text(x)
        return self

    def numbers(self, x: Array) -> "Writer":
        """Append numbers without their count."""
        self._align(8)
        self._out += x.astype("<f8", copy=False).tobytes()
        return self

    def row(self, x: Array) -> "Writer":
        """Append a sequence of numbers."""
        self.whole(len(x))
        return self.numbers(x) if len(x) else self

    def stamp(self, t: float) -> "Writer":
        """Append a time [s]."""
        seconds = int(t // 1.0)
        return self.whole(seconds).whole(min(round(1e9 * (t - seconds)), 999_999_999))

    def header(self, t: float, frame: str) -> "Writer":
        """Append a std_msgs/Header."""
        return self.stamp(t).text(frame)

    def done(self) -> bytes:
        """Return the message, its length a multiple of four."""
        self._align(4)
        return bytes(self._out)


@final
class Reader:
    """Reads a message in its order; what is cut short or too long raises an InputError."""

    def __init__(self, raw: bytes) -> None:
        """Take a message of plain CDR."""
        if len(raw) < 4 or raw[0] != 0 or raw[1] not in (0, 1):
            raise InputError("a message", "plain CDR", raw[:4].hex())
        self._raw, self._at, self._order = raw, 4, "<" if raw[1] else ">"

    def _take(self, side: int, count: int) -> int:
        """Return where the next ``count`` values of ``side`` bytes begin, and pass them."""
        at = self._at + (4 - self._at) % side
        self._at = at + side * count
        if self._at > len(self._raw) or count > _MOST:
            raise InputError("a message", f"{self._at} bytes or more", len(self._raw))
        return at

    def whole(self) -> int:
        """Return an unsigned integer of 32 bits."""
        at = self._take(4, 1)
        return int(struct.unpack_from(f"{self._order}I", self._raw, at)[0])

    def signed(self) -> int:
        """Return a signed integer of 32 bits."""
        x = self.whole()
        return x - (1 << 32) if x >= 1 << 31 else x

    def small(self) -> int:
        """Return a byte."""
        return self._raw[self._take(1, 1)]

    def text(self) -> str:
        """Return a string."""
        count = self.whole()
        at = self._take(1, count)
        return self._raw[at : at + max(count - 1, 0)].decode("utf-8", "replace")

    def texts(self) -> tuple[str, ...]:
        """Return a sequence of strings."""
        return tuple(self.text() for _ in range(self.count()))

    def count(self) -> int:
        """Return the length of a sequence."""
        count = self.whole()
        if count > _MOST:
            raise InputError("a message", f"sequences of up to {_MOST}", count)
        return count

    def numbers(self, count: int) -> Array:
        """Return so many numbers."""
        if count == 0:
            return np.zeros(0)
        at = self._take(8, count)
        return np.frombuffer(self._raw, f"{self._order}f8", count, at).astype(np.float64)

    def row(self) -> Array:
        """Return a sequence of numbers."""
        return self.numbers(self.count())

    def stamp(self) -> float:
        """Return a time [s]."""
        return self.signed() + 1e-9 * self.whole()

    def header(self) -> tuple[float, str]:
        """Return time [s] and frame of a std_msgs/Header."""
        return self.stamp(), self.text()
