"""The ROS 2 messages that a cell speaks, to and from CDR bytes, with the fields of ROS 2.

| message                             | for                                    |
|-------------------------------------|----------------------------------------|
| ``sensor_msgs/JointState``          | encoders                               |
| ``geometry_msgs/PointStamped``      | the ball                               |
| ``geometry_msgs/PoseStamped``       | the ball, from motion capture          |
| ``trajectory_msgs/JointTrajectory`` | commands, one point                    |
| ``std_msgs/Float64MultiArray``      | commands, what the drives take         |
| ``std_msgs/Bool``                   | brakes                                 |
| ``diagnostic_msgs/DiagnosticArray`` | state of the robot                     |
| ``std_msgs/String``                 | what a simulated cell says of a throw  |

Plain CDR (OMG CDR version 1) is read and written here field by field: in half the time that
Cyclone's own Python classes take, with a bound on every length, and a diagnostic message as slowly
as a live loop likes.
"""

import struct
from collections.abc import Iterator
from typing import NamedTuple, final

import numpy as np

from mitt.errors import InputError
from mitt.signals import Array

#: Encapsulation of plain CDR, little endian.
_HEAD = b"\x00\x01\x00\x00"
#: Longest string or sequence that is read.
_MOST = 4096
#: Time that a trajectory's point is given to be reached [ns]: two updates at 500 Hz.
_REACH_NS = 4_000_000


@final
class Writer:
    """Builds a message; aligned as CDR wants it, little endian."""

    def __init__(self) -> None:
        """Begin a message."""
        self._out = bytearray(_HEAD)

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


@final
class JointReading(NamedTuple):
    """A JointState: stamp [s], names, positions [rad], velocities [rad/s] (empty where none)."""

    t: float
    names: tuple[str, ...]
    q: Array
    dq: Array


def read_joint_state(raw: bytes) -> JointReading:
    """Return what a JointState says; velocities of another length than the names are left out."""
    r = Reader(raw)
    t, _ = r.header()
    names, q, dq = r.strings(), r.sequence(), r.sequence()
    if len(q) != len(names):
        raise InputError("joint states", f"{len(names)} positions, one a name", len(q))
    return JointReading(t, names, q, dq if len(dq) == len(names) else np.zeros(0))


def joint_state(t: float, names: tuple[str, ...], q: Array, dq: Array) -> bytes:
    """Return a JointState without efforts."""
    return Writer().header(t, "").strings(names).sequence(q).sequence(dq).uint32(0).done()


def read_point(raw: bytes) -> tuple[float, str, Array]:
    """Return stamp [s], frame and position [m] of a PointStamped or a PoseStamped."""
    r = Reader(raw)
    t, frame = r.header()
    return t, frame, r.doubles(3)


def point(t: float, frame: str, r_o: Array) -> bytes:
    """Return a PointStamped."""
    return Writer().header(t, frame).doubles(r_o).done()


def pose(t: float, frame: str, r_o: Array) -> bytes:
    """Return a PoseStamped without turn."""
    return point(t, frame, np.append(r_o, [0.0, 0.0, 0.0, 1.0]))


def trajectory(answers: float, names: tuple[str, ...], rows: Array) -> bytes:
    """Return a JointTrajectory of one point that begins when it is taken: its stamp is 0.

    Its frame, of which a controller makes nothing, names the reading that it answers.

    Args:
        answers: Stamp of that reading [s].
        names: Joints.
        rows: Positions, velocities, accelerations and efforts, or the first of them, shape
            (k, names); those after them are left empty.
    """
    w = Writer().header(0.0, repr(float(answers))).strings(names).uint32(1)
    for row in (*rows, *[np.zeros(0)] * (4 - len(rows))):
        w.sequence(row)
    return w.uint32(0).uint32(_REACH_NS).done()


def read_trajectory(raw: bytes) -> tuple[float, tuple[str, ...], Array]:
    """Return which reading a JointTrajectory answers, its names and its last point's rows.

    The rows have shape (4, names), NaN where one is left out; so is the stamp of the reading where
    the frame names none.
    """
    r = Reader(raw)
    _, frame = r.header()
    names, count = r.strings(), r.count()
    if count == 0:
        raise InputError("a trajectory", "at least one point", "none")
    rows = np.zeros((4, len(names)))
    for _ in range(count):
        for k in range(4):
            row = r.sequence()
            if len(row) not in (0, len(names)):
                raise InputError("a trajectory", f"{len(names)} numbers a row", len(row))
            rows[k] = row if len(row) else np.nan
        r.uint32()
        r.uint32()
    try:
        return float(frame), names, rows
    except ValueError:
        return np.nan, names, rows


def array(x: Array) -> bytes:
    """Return a Float64MultiArray without a layout."""
    return Writer().uint32(0).uint32(0).sequence(x).done()


def read_array(raw: bytes) -> Array:
    """Return the numbers of a Float64MultiArray."""
    r = Reader(raw)
    for _ in range(r.count()):  # labels, sizes and strides of its layout
        r.string()
        r.uint32()
        r.uint32()
    r.uint32()
    return r.sequence()


def flag(x: bool) -> bytes:
    """Return a Bool."""
    return Writer().byte(int(x)).done()


def read_flag(raw: bytes) -> bool:
    """Return what a Bool says."""
    return Reader(raw).byte() != 0


def text(x: str) -> bytes:
    """Return a String."""
    return Writer().string(x).done()


def read_text(raw: bytes) -> str:
    """Return what a String says."""
    return Reader(raw).string()


def diagnostics(t: float, name: str, level: int, message: str) -> bytes:
    """Return a DiagnosticArray of one entry; levels are 0 fine, 1 warning, 2 error, 3 stale."""
    w = Writer().header(t, "").uint32(1).byte(level)
    return w.string(name).string(message).string("").uint32(0).done()


def search_diagnostics(raw: bytes, name: str) -> Iterator[tuple[int, str] | None]:
    """Look for an entry of a DiagnosticArray, a field at a time: others write what they like there.

    Yields:
        None as long as it was not found; then its level and message, and no more.
    """
    if name.encode() + b"\0" not in raw:
        return
    r = Reader(raw)
    r.header()
    for _ in range(r.count()):
        level, found, message = r.byte(), r.string(), r.string()
        if found == name:
            yield level, message
            return
        r.string()
        yield None
        for _ in range(r.count()):
            r.string()
            r.string()
            yield None
