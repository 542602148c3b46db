"""CDR, the encoding of ROS 2 messages: plain (version 1), written little endian.

Numbers are aligned to their size, counted from behind the 4 bytes that say how they are encoded
(OMG DDSI-RTPS 2.5, 10.2; OMG CORBA 3.3 part 2, 9.3). Messages are written and read field by field,
in half the time that Cyclone's own Python classes take, with a bound on every length.

A message whose sequences have known lengths is as long each time, and has every number at the same
place. So many of them are one structured array (:func:`layout`): a column is written at once, and a
message is the bytes of a row.
"""

import struct
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, TypeAlias, final

import numpy as np
from numpy.typing import NDArray

from mitt.core.errors import InputError
from mitt.core.signals import Array

Rows: TypeAlias = NDArray[np.void]
"""Messages of one kind, one a row."""
Field: TypeAlias = tuple[str, str, Any]
"""Name, type of ROS 2, and the length of a sequence or the text of a string; None elsewhere."""

HEAD = b"\x00\x01\x00\x00"
"""What stands before a message: plain CDR, little endian."""
#: Longest string or sequence that is read field by field: a robot's joints are far fewer.
_MOST = 4096
_KINDS = {
    "bool": "?",
    "uint8": "u1",
    "int32": "<i4",
    "uint32": "<u4",
    "int64": "<i8",
    "float32": "<f4",
    "float64": "<f8",
}


@final
class Writer:
    """Builds a message; aligned as CDR wants it, little endian."""

    def __init__(self) -> None:
        """Begin a message."""
        self._out = bytearray(HEAD)

    def _align(self, side: int) -> None:
        """Fill up to a multiple of ``side`` bytes after the encapsulation."""
        self._out += bytes((4 - len(self._out)) % side)

    def uint32(self, x: int) -> "Writer":
        """Append an integer of 32 bits."""
        self._align(4)
        self._out += struct.pack("<I", x & 0xFFFFFFFF)
        return self

    def byte(self, x: int) -> "Writer":
        """Append a byte."""
        self._out.append(x)
        return self

    def string(self, x: str) -> "Writer":
        """Append a string."""
        raw = x.encode() + b"\0"
        self.uint32(len(raw))
        self._out += raw
        return self

    def strings(self, xs: tuple[str, ...]) -> "Writer":
        """Append a sequence of strings."""
        self.uint32(len(xs))
        for x in xs:
            self.string(x)
        return self

    def doubles(self, x: Array) -> "Writer":
        """Append numbers without their count."""
        self._align(8)
        self._out += x.astype("<f8", copy=False).tobytes()
        return self

    def sequence(self, x: Array) -> "Writer":
        """Append a sequence of numbers."""
        self.uint32(len(x))
        return self.doubles(x) if len(x) else self

    def header(self, t: float, frame: str) -> "Writer":
        """Append a std_msgs/Header: time [s] and frame."""
        seconds = int(t // 1.0)
        self.uint32(seconds).uint32(min(round(1e9 * (t - seconds)), 999_999_999))
        return self.string(frame)

    def constant(self, x: int | str | tuple[str, ...]) -> tuple[int, int]:
        """Append a count, a string or strings; return where they begin and end."""
        self._align(4)
        start = len(self._out)
        if isinstance(x, int):
            self.uint32(x)
        elif isinstance(x, str):
            self.string(x)
        else:
            self.strings(x)
        return start, len(self._out)

    def room(self, dtype: np.dtype[Any], count: int) -> int:
        """Append zeros for so many numbers, aligned if there are any; return where they begin."""
        self._align(dtype.itemsize if count else 1)
        start = len(self._out)
        self._out += bytes(count * dtype.itemsize)
        return start

    def written(self) -> bytes:
        """Return what was written so far."""
        return bytes(self._out)

    def done(self) -> bytes:
        """Return the message, its length a multiple of four."""
        self._align(4)
        return self.written()


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

    def uint32(self) -> int:
        """Return an unsigned integer of 32 bits."""
        at = self._take(4, 1)
        return int(struct.unpack_from(f"{self._order}I", self._raw, at)[0])

    def byte(self) -> int:
        """Return a byte."""
        return self._raw[self._take(1, 1)]

    def string(self) -> str:
        """Return a string."""
        count = self.uint32()
        at = self._take(1, count)
        return self._raw[at : at + max(count - 1, 0)].decode("utf-8", "replace")

    def count(self) -> int:
        """Return the length of a sequence."""
        count = self.uint32()
        if count > _MOST:
            raise InputError("a message", f"sequences of up to {_MOST}", count)
        return count

    def strings(self) -> tuple[str, ...]:
        """Return a sequence of strings."""
        return tuple(self.string() for _ in range(self.count()))

    def doubles(self, count: int) -> Array:
        """Return so many numbers."""
        if count == 0:
            return np.zeros(0)
        at = self._take(8, count)
        return np.frombuffer(self._raw, f"{self._order}f8", count, at).astype(np.float64)

    def sequence(self) -> Array:
        """Return a sequence of numbers."""
        return self.doubles(self.count())

    def header(self) -> tuple[float, str]:
        """Return time [s] and frame of a std_msgs/Header."""
        at = self._take(4, 2)
        seconds, nanoseconds = struct.unpack_from(f"{self._order}iI", self._raw, at)
        return seconds + 1e-9 * nanoseconds, self.string()


def layout(fields: Sequence[Field], count: int = 1) -> Rows:
    """Return so many messages with these fields, all numbers zero, as an array, shape (count,).

    Strings and the lengths of sequences are filled in, and are not to be written to; the names of
    these columns begin with an underscore.
    """
    raw, dtype = _laid_out(tuple(fields))
    return np.frombuffer(bytearray(raw * count), dtype)


@lru_cache(maxsize=256)
def _laid_out(fields: tuple[Field, ...]) -> tuple[bytes, np.dtype[np.void]]:
    """Return a message with these fields, and where each of them is."""
    w, columns = Writer(), {"_head": ("V4", 0)}
    for name, kind, given in fields:
        base, bracket, inside = kind.partition("[")
        if base == "string" or inside == "]":
            start, end = w.constant(given)
            columns[f"_{name}"] = (f"V{end - start}", start)
        if base != "string":
            count = None if not bracket else given if inside == "]" else int(inside[:-1])
            start = w.room(np.dtype(_KINDS[base]), 1 if count is None else count)
            columns[name] = (_KINDS[base] if count is None else f"({count},){_KINDS[base]}", start)
    raw, (formats, offsets) = w.written(), zip(*columns.values(), strict=True)
    dtype = np.dtype(
        {
            "names": list(columns),
            "formats": list(formats),
            "offsets": list(offsets),
            "itemsize": len(raw),
        }
    )
    return raw, dtype


def encode_text(content: str) -> bytes:
    """Return a ``std_msgs/msg/String``."""
    return Writer().string(content).written()


def decode_text(message: bytes) -> str:
    """Return the text of a ``std_msgs/msg/String`` of any length; ValueError where it is none."""
    size = int.from_bytes(message[4:8], "little")
    if message[:4] != HEAD or size < 1 or len(message) < 8 + size:
        raise ValueError("no std_msgs/msg/String")
    return message[8 : 7 + size].decode()
