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
from mcap.records import Attachment, Channel, Chunk, Message, Metadata, Schema
from numpy.typing import NDArray

from mitt.errors import FileError, InputError
from mitt.files import messages as of
from mitt.files.about import About, about_of
from mitt.files.messages import Rows
from mitt.files.recording import ABOUT, ENDING, METADATA
from mitt.signals import Array, Frame, Sighting

#: What an MCAP file begins with.
_MAGIC = b"\x89MCAP0\r\n"
#: Largest record, chunk unpacked, text about the catcher, and all that is kept [bytes].
_RECORD, _UNPACKED, _TEXT, _MOST = 64_000_000, 64_000_000, 20_000_000, 4_000_000_000
_WANTED = "a recording of mitt (MCAP)"
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
        self._kinds: dict[int, str] = {}
        self._topics: dict[int, str] = {}
        self._numbers: list[int] = []
        self._data: list[bytes] = []
        self._points: dict[int, list[Sighting]] = {}
        self._frames: dict[int, list[Frame]] = {}
        self._half: Rows | None = None
        self._places: dict[str, list[tuple[int, Array]]] = {}
        self._at, self._kept = 0, 0
        self._rows: Rows | None = None
        self.more()
        if self._about is None:
            raise self._error("one with what makes its catcher", "a file cut before that, or none")

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
        return tuple(self._points.get(number, ()))

    def frames(self, number: int) -> tuple[Frame, ...]:
        """Return the frames that came before a tick: the background's, then its own."""
        return tuple(self._frames.get(number, ()))

    def track(self, topic: str) -> tuple[Array, Array]:
        """Return times [s] and positions [m] of a topic, shapes (k,) and (k, 3)."""
        places = self._places.get(topic, [])
        t = np.array([ns for ns, _ in places], np.float64) * 1e-9
        return t, np.array([r for _, r in places], np.float64).reshape(-1, 3)

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
        if not stat.S_ISREG(os.fstat(handle).st_mode):
            os.close(handle)
            raise self._error("a readable file", "a device, a pipe or a folder")
        return os.fdopen(handle, "rb")

    def _begins(self, file: BinaryIO) -> bool:
        """Say whether the file begins as a recording does; raise where it begins otherwise."""
        begin = file.read(len(_MAGIC))
        if begin != _MAGIC:
            raise self._error(_WANTED, "an empty file" if not begin else "another kind of file")
        self._at = len(_MAGIC)
        return True

    def _records(self, file: BinaryIO) -> Iterator[tuple[int, bytes]]:
        """Yield kind and content of each whole record that was not read yet."""
        size = os.fstat(file.fileno()).st_size
        while not self.whole and self._at + 9 <= size:
            file.seek(self._at)
            opcode, length = struct.unpack("<BQ", file.read(9))
            if length > _RECORD:
                raise self._error(f"records of at most {_RECORD} bytes", f"one of {length}")
            if self._at + 9 + length > size:
                return
            data = file.read(length)
            self._at += 9 + length
            yield opcode, data

    def _take(self, opcode: int, data: bytes) -> None:
        """Take a record of the file."""
        stream = ReadDataStream(BytesIO(data))
        if opcode == Opcode.CHUNK:
            self._unpack(Chunk.read(stream))
        elif opcode == Opcode.ATTACHMENT:
            attachment = Attachment.read(stream)
            if attachment.name == ABOUT and self._about is None:
                text = _unzipped(attachment.data, _TEXT).decode()
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
        if chunk.compression != "zstd":
            raise self._error("chunks packed by zstd", repr(chunk.compression[:20]))
        data = _unzipped(chunk.data, _UNPACKED)
        if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
            raise self._error("chunks that match their checksums", "one that was altered")
        at = 0
        while at + 9 <= len(data):
            opcode, length = struct.unpack_from("<BQ", data, at)
            body = data[at + 9 : at + 9 + length]
            at += 9 + length
            stream = ReadDataStream(BytesIO(body))
            if opcode == Opcode.MESSAGE:
                self._hear(Message.read(stream, len(body)))
            elif opcode == Opcode.SCHEMA:
                schema = Schema.read(stream)
                self._kinds[schema.id] = schema.name
            elif opcode == Opcode.CHANNEL:
                channel = Channel.read(stream)
                self._topics[channel.id] = channel.topic

    def _hear(self, message: Message) -> None:
        """Take a message."""
        topic, data, number = self._topics[message.channel_id], message.data, message.sequence
        if topic == of.TICKS:
            self._keep(len(data))
            self._numbers.append(number)
            self._data.append(data)
        elif topic == of.POINTS:
            self._points.setdefault(number, []).append(_sighting(_row(of.points(), data)))
        elif topic == of.FRAMES and self._images:
            self._half = _row(of.frames(), data)
        elif topic.startswith("/camera_") and self._images and self._half is not None:
            self._keep(len(data))
            self._frames.setdefault(number, []).append(self._frame(self._half, data))
            self._half = None
        elif topic == of.CALLS:
            self.calls.setdefault(number, []).append(of.read_text(data))
        elif topic in (of.TRUTH, of.CATCH_POINT):
            r: Array = _row(of.point_stamped(), data)["r"][0].copy()
            self._places.setdefault(topic, []).append((message.log_time, r))
        elif topic in (of.EVENT, of.PHASE, of.STATE):
            text = of.read_text(data)
            self.notices.append((1e-9 * message.log_time, topic, text))

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

    def _keep(self, size: int) -> None:
        """Count what is kept in memory."""
        self._kept += size
        if self._kept > _MOST:
            raise self._error(f"at most {_MOST} bytes of ticks and images", "more")

    def _error(self, wanted: str, given: str) -> FileError:
        """Return an error of this file."""
        return FileError(str(self.path), wanted, given)


def _unzipped(data: bytes, most: int) -> bytes:
    """Return what zstd has packed, at most so many bytes."""
    out: bytes = zstandard.ZstdDecompressor().stream_reader(BytesIO(data)).read(most + 1)
    if len(out) > most:
        raise ValueError(f"more than {most} bytes in a chunk")
    return out


def _row(blank: Rows, data: bytes) -> Rows:
    """Return a message of fixed length; ValueError where it has another."""
    if len(data) != blank.dtype.itemsize:
        raise ValueError(f"a message of {len(data)} bytes, not {blank.dtype.itemsize}")
    return np.frombuffer(data, blank.dtype)


def _sighting(row: Rows) -> Sighting:
    """Return a sighting from its message."""
    values: dict[str, Any] = {
        "t": float(row["t"][0]), "found": bool(row["found"][0]), "r_o": row["r_o"][0].copy(),
        "covariance": row["covariance"][0].reshape(3, 3).copy(),
    }  # fmt: skip
    return Sighting(**values)
