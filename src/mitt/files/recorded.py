"""Reading recordings back: whole, cut short, or still being written; foreign ones are refused.

A file is read record by record, each of a bounded size. What follows the last whole record is
read when it has come, so one reader follows a file that grows.
"""

import os
import stat
import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, final

import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Header, Metadata
from numpy.typing import NDArray

from mitt.errors import FileError, InputError
from mitt.files import messages as of
from mitt.files.about import About, about_of
from mitt.files.messages import Rows
from mitt.files.recording import ABOUT, ENDING, LIBRARY, METADATA
from mitt.signals import Array, Frame, Sighting

#: What an MCAP file begins with.
_MAGIC = b"\x89MCAP0\r\n"
#: Largest record, chunk unpacked, text about the catcher, and all that is kept [bytes].
_RECORD, _UNPACKED, _TEXT, _MOST = 64_000_000, 64_000_000, 8_000_000, 4_000_000_000
#: What a file may come to [bytes]: so much, and so many times its size. Recordings come to 4 to 60
#: times their size; one that was made to swell comes to thousands.
_FREE, _SWELLS = 64_000_000, 100
#: What a message costs beside its bytes, and a text for each of its bytes, once they are objects.
_OBJECT, _OBJECTS = 1000, 16
_WANTED = "a recording of mitt (MCAP)"
_DO = "mitt reads no other recordings; recorded positions of a ball go to mitt track, as CSV"
#: How other recordings begin.
_OTHERS = {b"SQLite format 3": "a SQLite file, as of a ROS 2 bag", b"#ROSBAG": "a ROS 1 bag"}
#: Channel, sequence number and times of a message, before its content.
_MESSAGE = struct.Struct("<HIQQ")
#: Where a chunk states its size, after kind, length and two times of the record.
_STATED = struct.Struct("<Q")
#: Layouts of what there may be much of.
_POINT, _PLACE = of.points().dtype, of.point_stamped().dtype
#: Topics whose messages are kept.
_KEPT = (of.TICKS, of.POINTS, of.CALLS, of.TRUTH, of.CATCH_POINT, of.EVENT, of.PHASE, of.STATE)
_BROKEN = (McapError, struct.error, ValueError, KeyError, IndexError, zstandard.ZstdError)


@final
class Recorded:
    """A recording as read so far; :meth:`more` reads what has been added to its file.

    Attributes:
        path: The file.
        notes: Texts by name.
        whole: Whether the end was reached; a file that is cut or still written has none.
        dropped: Ticks that its recorder had no room for, as said at the end.
        calls: What the catcher was told before a tick, by the number of the tick.
        notices: Time [s], topic and text of what happened.
    """

    def __init__(self, path: Path, *, images: bool = True) -> None:
        """Read a recording.

        Args:
            path: The file.
            images: Whether to keep its images.

        Raises:
            FileError: It cannot be read, or is no recording that can be replayed.
        """
        self.path, self.whole, self.dropped = path, False, 0
        self.notes: dict[str, str] = {}
        self.calls: dict[int, list[str]] = {}
        self.notices: list[tuple[float, str, str]] = []
        self._images = images
        self._about: About | None = None
        self._topics: dict[int, str] = {}
        self._numbers: list[int] = []
        self._data: list[bytes] = []
        self._points: dict[int, list[bytes]] = {}
        self._frames: dict[int, list[Frame]] = {}
        self._half: Rows | None = None
        self._places: dict[str, list[tuple[int, bytes]]] = {}
        self._at, self._kept, self._spent, self._stated, self._counted = 0, 0, 0, 0, 0
        self._size, self._library = 0, ""
        self._rows: Rows | None = None
        self.more()
        if self._about is None:
            raise self._foreign()

    @property
    def about(self) -> About:
        """What makes the catcher."""
        if self._about is None:
            raise self._error("one with what makes its catcher", "none")
        return self._about

    @property
    def ticks(self) -> Rows:
        """All ticks, of the layout :func:`mitt.files.messages.ticks`."""
        if self._rows is None or len(self._rows) != len(self._data):
            self._rows = self._decoded()
        return self._rows

    @property
    def numbers(self) -> NDArray[np.int64]:
        """Numbers of the ticks; one is missing where the recorder had no room."""
        return np.array(self._numbers, np.int64)

    @property
    def has_images(self) -> bool:
        """Whether there are images."""
        return bool(self._frames)

    def points(self, number: int) -> tuple[Sighting, ...]:
        """Return the sightings that a tick was given."""
        try:
            return tuple(_sighting(np.frombuffer(x, _POINT)) for x in self._points.get(number, ()))
        except _BROKEN as error:
            raise self._error(_WANTED, f"a point of tick {number} that is none ({error})") from None

    def frames(self, number: int) -> tuple[Frame, ...]:
        """Return the frames that came before a tick: the background's, then its own."""
        return tuple(self._frames.get(number, ()))

    def track(self, topic: str) -> tuple[Array, Array]:
        """Return times [s] and positions [m] of a topic, shapes (k,) and (k, 3)."""
        places = self._places.get(topic, [])
        t = np.array([ns for ns, _ in places], np.float64) * 1e-9
        rows = np.frombuffer(b"".join(data for _, data in places), _PLACE)
        return t, np.array(rows["r"], np.float64).reshape(-1, 3)

    def more(self) -> int:
        """Read what is there beyond what was read; return how many ticks that is.

        Raises:
            FileError: It cannot be read, or is broken in its middle.
        """
        before = len(self._numbers)
        try:
            with self._opened() as file:
                if self._at == 0 and not self._begins(file):
                    return 0
                self._look_ahead(file)
                for opcode, data in self._records(file):
                    self._take(opcode, data)
        except OSError as error:
            raise self._error("a readable file", error.strerror or "an error") from None
        except _BROKEN as error:
            if isinstance(error, InputError):
                raise
            text = " ".join(f"{type(error).__name__} {error}".split())[:80]
            raise self._error(_WANTED, f"a broken one ({text})") from None
        return len(self._numbers) - before

    def _opened(self) -> BinaryIO:
        """Open the file; a device or a pipe is none."""
        handle = os.open(self.path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        mode = os.fstat(handle).st_mode
        if not stat.S_ISREG(mode):
            os.close(handle)
            if not stat.S_ISDIR(mode):
                raise self._error(_WANTED, "a device or a pipe")
            bag = (self.path / "metadata.yaml").is_file()
            raise self._error(_WANTED, "the folder of a ROS 2 bag" if bag else "a folder", do=_DO)
        return os.fdopen(handle, "rb")

    def _begins(self, file: BinaryIO) -> bool:
        """Say whether the file begins as a recording does; raise where it begins otherwise."""
        begin = file.read(len(_MAGIC))
        if begin != _MAGIC:
            begin += file.read(16)
            known = (name for start, name in _OTHERS.items() if begin.startswith(start))
            given = next(known, "another kind of file" if begin else "an empty file")
            raise self._error(_WANTED, given, do=_DO)
        self._at = len(_MAGIC)
        return True

    def _look_ahead(self, file: BinaryIO) -> None:
        """Add up what the new chunks say they come to, before one of them is unpacked."""
        self._size = os.fstat(file.fileno()).st_size
        at = max(self._at, self._counted)
        while at + 9 <= self._size:
            file.seek(at)
            opcode, length = struct.unpack("<BQ", file.read(9))
            if at + 9 + length > self._size:
                break
            if opcode == Opcode.CHUNK and length >= 24:
                file.seek(16, os.SEEK_CUR)
                self._stated += _STATED.unpack(file.read(8))[0]
            at += 9 + length
        self._counted = at

    def _records(self, file: BinaryIO) -> Iterator[tuple[int, bytes]]:
        """Yield kind and content of each whole record that was not read yet."""
        while not self.whole and self._at + 9 <= self._size:
            file.seek(self._at)
            opcode, length = struct.unpack("<BQ", file.read(9))
            if length > _RECORD:
                raise self._error(f"records of at most {_RECORD} bytes", f"one of {length}")
            if self._at + 9 + length > self._size:
                return
            data = file.read(length)
            self._at += 9 + length
            yield opcode, data

    def _take(self, opcode: int, data: bytes) -> None:
        """Take a record of the file."""
        stream = ReadDataStream(BytesIO(data))
        if opcode == Opcode.CHUNK:
            self._unpack(Chunk.read(stream))
        elif opcode == Opcode.HEADER:
            self._library = Header.read(stream).library
        elif opcode == Opcode.ATTACHMENT:
            attachment = Attachment.read(stream)
            if attachment.name == ABOUT and self._about is None:
                text = _unzipped(attachment.data, _TEXT).decode()
                self._spend(_OBJECTS * len(text))
                self._about = about_of(text, place=str(self.path))
                arm, heads = self._about.arm, len(self._about.rig.heads)
                self._blank = of.ticks(arm.n, heads)
        elif opcode == Opcode.METADATA:
            found = Metadata.read(stream)
            if found.name == METADATA:
                self.notes.update(found.metadata)
            elif found.name == ENDING:
                self.dropped = int(found.metadata.get("dropped_ticks", "0"))
        elif opcode == Opcode.DATA_END:
            self.whole = True

    def _unpack(self, chunk: Chunk) -> None:
        """Take the records of a chunk."""
        if self._about is None:
            raise self._foreign()
        if chunk.compression != "zstd":
            raise self._error("chunks packed by zstd", repr(chunk.compression[:20]))
        if chunk.uncompressed_size > _UNPACKED:
            given = f"one of {chunk.uncompressed_size}"
            raise self._error(f"chunks of at most {_UNPACKED} bytes", given)
        self._spend(0 if self._stated <= self._most else self._stated)
        data = _unzipped(chunk.data, chunk.uncompressed_size)
        if len(data) != chunk.uncompressed_size:
            raise self._error("chunks as long as they say", "a shorter one")
        self._spend(len(data) + _OBJECT)
        if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
            raise self._error("chunks that match their checksums", "one that was altered")
        at = 0
        while at + 9 <= len(data):
            opcode, length = struct.unpack_from("<BQ", data, at)
            body = data[at + 9 : at + 9 + length]
            at += 9 + length
            if opcode == Opcode.MESSAGE:
                channel, number, ns, _ = _MESSAGE.unpack_from(body)
                self._hear(self._topics[channel], number, ns, body[_MESSAGE.size :])
            elif opcode == Opcode.CHANNEL:
                known = Channel.read(ReadDataStream(BytesIO(body)))
                self._topics[known.id] = known.topic

    def _hear(self, topic: str, number: int, ns: int, data: bytes) -> None:
        """Take a message: its topic, the tick that it belongs to, its time [ns] and its content."""
        self._spend(_OBJECT)
        if topic in _KEPT or topic.startswith("/camera_"):
            self._keep(len(data))
        if topic == of.TICKS:
            self._numbers.append(number)
            self._data.append(data)
        elif topic == of.POINTS:
            _whole(data, _POINT)
            self._points.setdefault(number, []).append(data)
        elif topic == of.FRAMES and self._images:
            self._half = _row(of.frames(), data)
        elif topic.startswith("/camera_") and self._images and self._half is not None:
            self._frames.setdefault(number, []).append(self._frame(self._half, data))
            self._half = None
        elif topic == of.CALLS:
            self.calls.setdefault(number, []).append(of.read_text(data))
        elif topic in (of.TRUTH, of.CATCH_POINT):
            _whole(data, _PLACE)
            self._places.setdefault(topic, []).append((ns, data))
        elif topic in (of.EVENT, of.PHASE, of.STATE):
            self.notices.append((1e-9 * ns, topic, of.read_text(data)))

    def _frame(self, row: Rows, data: bytes) -> Frame:
        """Return a frame from what belongs to it and its image."""
        camera = int(row["camera"][0])
        shapes = self.about.shapes
        if not 0 <= camera < len(shapes):
            raise self._error(f"images of {len(shapes)} cameras", f"one of camera {camera}")
        image = _row(of.image(shapes[camera], camera), data)
        return Frame(
            t=float(row["t"][0]), camera=camera, number=int(row["number"][0]),
            pixels=image["data"][0].reshape(shapes[camera]).copy(), pan=float(row["pan"][0]),
            tilt=float(row["tilt"][0]),
        )  # fmt: skip

    def _decoded(self) -> Rows:
        """Return all ticks as rows."""
        if any(len(data) != self._blank.dtype.itemsize for data in self._data):
            raise self._error(f"ticks of {self.about.arm.n} joints", "others")
        rows = np.frombuffer(b"".join(self._data), self._blank.dtype)
        for name in self._blank.dtype.names or ():
            if name.startswith("_") and not np.all(rows[name] == self._blank[name]):
                raise self._error(f"ticks of {self.about.arm.n} joints", "others")
        return rows

    @property
    def _most(self) -> int:
        """What the file may come to [bytes]."""
        return _FREE + _SWELLS * self._size

    def _spend(self, size: int) -> None:
        """Count what the file comes to: all that is unpacked, and what it costs as objects."""
        self._spent += size
        if self._spent > self._most:
            raise self._error(f"a file that comes to at most {_SWELLS} times its size", "more")

    def _keep(self, size: int) -> None:
        """Count what is kept in memory."""
        self._kept += size
        if self._kept > _MOST:
            raise self._error(f"a recording of at most {_MOST} bytes", "a longer one")

    def _foreign(self) -> FileError:
        """Return the error of a file that does not say what makes its catcher."""
        if self._library == LIBRARY:
            return self._error("one with what makes its catcher", "a file cut before that")
        given = f"an MCAP file of {self._library[:40]!r} without it (a ROS 2 bag?)"
        return self._error(f"a recording of mitt, with the attachment {ABOUT}", given, do=_DO)

    def _error(self, wanted: str, given: str, *, do: str = "") -> FileError:
        """Return an error of this file."""
        return FileError(str(self.path), wanted, given, do=do)


def _unzipped(data: bytes, most: int) -> bytes:
    """Return what zstd has packed, at most so many bytes."""
    out: bytes = zstandard.ZstdDecompressor().stream_reader(BytesIO(data)).read(most + 1)
    if len(out) > most:
        raise ValueError(f"more than {most} bytes in a chunk")
    return out


def _row(blank: Rows, data: bytes) -> Rows:
    """Return a message of fixed length; ValueError where it has another."""
    _whole(data, blank.dtype)
    return np.frombuffer(data, blank.dtype)


def _whole(data: bytes, layout: np.dtype[Any]) -> None:
    """Refuse a message that does not have the length of its layout; ValueError."""
    if len(data) != layout.itemsize:
        raise ValueError(f"a message of {len(data)} bytes, not {layout.itemsize}")


def _sighting(row: Rows) -> Sighting:
    """Return a sighting from its message."""
    values: dict[str, Any] = {
        "t": float(row["t"][0]), "found": bool(row["found"][0]), "r_o": row["r_o"][0].copy(),
        "covariance": row["covariance"][0].reshape(3, 3).copy(),
    }  # fmt: skip
    return Sighting(**values)
