"""Recordings that are read again, and that Foxglove and ROS 2 tools open: MCAP with ROS 2 messages.

| topic               | type                           | what                                     |
|---------------------|--------------------------------|------------------------------------------|
| `/joint_states`     | sensor_msgs/msg/JointState     | encoders                                 |
| `/joint_commands`   | sensor_msgs/msg/JointState     | commanded position, speed, torque        |
| `/brakes`           | std_msgs/msg/Bool              | whether the brakes are to engage         |
| `/ball/estimate`    | geometry_msgs/msg/PointStamped | the ball, as the catcher estimates it    |
| `/robot_description` | std_msgs/msg/String          | a URDF of the arm as it is driven        |
| `/tf`, `/tf_static` | tf2_msgs/msg/TFMessage         | frames of arm, hand, ball, each 10 ms    |
| `/ball/marker`      | visualization_msgs/msg/Marker  | the ball in the frame `ball`             |
| any, one a track    | geometry_msgs/msg/PointStamped | positions in the frame `world`           |
| `/camera_K/image`   | sensor_msgs/msg/Image          | images, where they were asked for        |
| `/phase`, `/state`  | std_msgs/msg/String            | of the catcher, when it changed          |
| any, one a notice   | std_msgs/msg/String            | what happened                            |
| `/mitt/ticks`       | mitt_msgs/msg/Tick             | all that a tick took and gave, to the bit |
| `/mitt/points`      | mitt_msgs/msg/Point            | sightings that were given to the catcher |
| `/mitt/belt`        | mitt_msgs/msg/Travel           | readings of a belt's encoder             |
| `/mitt/frames`      | mitt_msgs/msg/Frame            | what belongs to an image                 |
| `/mitt/calls`       | std_msgs/msg/String            | what else the catcher was told to do     |

Names and units by REP 103: metres, radians, seconds. The sequence number of a message is that of
its tick. Stamps are whole nanoseconds; the numbers of `/mitt/...` have every digit. The attachment
`about.json.zst` says what makes the catcher (:mod:`mitt.io.about`).

A file is read record by record, each of a bounded size, and foreign ones are refused. What follows
the last whole record is read when it has come, so one reader follows a file that grows.
"""

import json
import os
import stat
import struct
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import IO, Any, BinaryIO, final

import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Header, Metadata
from mcap.writer import Writer
from numpy.typing import NDArray

from mitt.core.catcher.settings import PHASES
from mitt.core.catcher.state import REASONS, STATES
from mitt.core.errors import FileError, InputError, ShapeError
from mitt.core.signals import Array, BeltReading, Frame, Sighting
from mitt.io import cdr
from mitt.io import messages as of
from mitt.io.about import About, about_of
from mitt.io.cdr import Rows
from mitt.io.messages import Said
from mitt.io.robot_description import LinkFrame as Drawn
from mitt.io.robot_description import frames_of, urdf_of
from mitt.io.writing import write_atomically

#: Name of the metadata record, of what is said at the end, and of the attachment.
METADATA = "mitt"
ENDING = "mitt.end"
ABOUT = "about.json.zst"
#: What the file says of the program that wrote it.
LIBRARY = "mitt"
#: Ticks in a chunk: a file that is cut loses at most so many.
_CHUNK_TICKS = 100
#: Frames are written each so many ticks; what is said once is kept for those who come later.
_DRAWN = 10
_KEPT_BY_ROS = (of.DESCRIPTION, of.FIXED, of.MARKER)
_NO_TIME = {"sec": 0, "nsec": 0}
_LATCHED = {
    "offered_qos_profiles": json.dumps(
        [
            {
                "history": 1,
                "depth": 1,
                "reliability": 1,
                "durability": 1,
                "deadline": _NO_TIME,
                "lifespan": _NO_TIME,
                "liveliness": 1,
                "liveliness_lease_duration": _NO_TIME,
                "avoid_ros_namespace_conventions": False,
            }
        ]
    )
}
"""Keep the last, reliable, transient local; as rosbag2 writes it."""
_BALL = Drawn(name=of.BALL, parent=of.WORLD, place=(0.0,) * 3, turn=(0.0, 0.0, 0.0, 1.0))
#: What an MCAP file begins with.
_MAGIC = b"\x89MCAP0\r\n"
#: Largest record, and chunk unpacked, and all that is kept [bytes].
_RECORD = 64_000_000
_MOST = 4_000_000_000
#: What a file may come to [bytes]: so much, and so many times its size. Recordings come to 4 to 60
#: times their size; one that was made to swell comes to thousands.
_FREE = 64_000_000
_SWELLS = 100
#: What a message costs beside its bytes, and a text for each of its bytes, once they are objects.
_OBJECT = 1000
_OBJECTS = 16
_WANTED = "a recording of mitt (MCAP)"
_DO = "mitt reads no other recordings; recorded positions of a ball go to mitt track, as CSV"
#: How other recordings begin.
_OTHERS = {b"SQLite format 3": "a SQLite file, as of a ROS 2 bag", b"#ROSBAG": "a ROS 1 bag"}
#: Channel, sequence number and times of a message, before its content.
_MESSAGE = struct.Struct("<HIQQ")
#: Where a chunk states its size, after kind, length and two times of the record.
_STATED = struct.Struct("<Q")
#: Layouts of what there may be much of.
_POINT = of.points().dtype
_TRAVEL = of.travels().dtype
_PLACE = of.point_stamped().dtype
#: Topics whose messages are kept.
_KEPT = (
    of.TICKS,
    of.POINTS,
    of.BELT,
    of.CALLS,
    of.TRUTH,
    of.CATCH_POINT,
    of.EVENT,
    of.PHASE,
    of.STATE,
)
_BROKEN = (McapError, struct.error, ValueError, KeyError, IndexError, zstandard.ZstdError)


@dataclass(frozen=True, slots=True, kw_only=True)
class Heading:
    """What a file says before its first tick.

    Attributes:
        joints: Names of the active joints.
        heads: Number of cameras that turn.
        shapes: Height and width of the images of each camera [px].
        about: What makes the catcher, as ``About.text``.
        description: A URDF of the arm.
        frames: Frames of arm and hand, as of :mod:`mitt.io.robot_description`.
        radius: Radius of the ball [m].
        metadata: Texts by name for other readers.
    """

    joints: tuple[str, ...]
    heads: int
    shapes: tuple[tuple[int, int], ...]
    about: str
    description: str
    frames: tuple[Drawn, ...]
    radius: float
    metadata: Mapping[str, str] = field(default_factory=dict)


def heading_of(about: About, metadata: Mapping[str, str] | None = None) -> Heading:
    """Return the heading of a recording; the notes of ``about`` are part of its metadata."""
    said = {
        "version": about.version,
        "arm": about.arm.model.name,
        "limits": about.arm.limits.name,
        "generator": about.generator,
    }
    return Heading(
        joints=about.arm.names,
        heads=len(about.rig.heads),
        shapes=about.shapes,
        about=about.text,
        description=urdf_of(about.arm),
        frames=frames_of(about.arm),
        radius=about.settings.ball_radius,
        metadata={**said, **about.notes, **(metadata or {})},
    )


@final
class RecordingWriter:
    """Writes a recording as it comes, chunk by chunk."""

    def __init__(self, stream: IO[bytes], heading: Heading) -> None:
        """Begin the file."""
        size = of.ticks(len(heading.joints), heading.heads).dtype.itemsize
        self._writer = Writer(stream, chunk_size=_CHUNK_TICKS * (size + 600))
        self._writer.start(profile="ros2", library=LIBRARY)
        compressed = zstandard.ZstdCompressor(level=9).compress(heading.about.encode())
        self._writer.add_attachment(0, 0, ABOUT, "application/zstd", compressed)
        self._writer.add_metadata(METADATA, dict(heading.metadata))
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._heading = heading
        self._states = of.joint_states(heading.joints, efforts=False)
        self._commands = of.joint_states(heading.joints, efforts=True)
        self._last = {of.PHASE: "", of.STATE: ""}
        self._ns = 0

    def ticks(
        self, first: int, rows: Rows, before: Mapping[int, Sequence[Said]] | None = None
    ) -> None:
        """Write ticks one after another.

        Args:
            first: Number of the first.
            rows: Of the layout :func:`mitt.io.messages.ticks`.
            before: What else is said before a tick, by its number.
        """
        ns, n, before = of.ns_of(rows["t"]), rows["q"].shape[1], before or {}
        told = rows["command"].reshape(len(rows), 4, n)
        q, dq = rows["q"], rows["dq"]
        columns = [
            (of.STATES, of.JOINTS, of.filled(self._states, ns, position=q, velocity=dq)),
            (
                of.COMMANDS,
                of.JOINTS,
                of.filled(
                    self._commands, ns, position=told[:, 0], velocity=told[:, 1], effort=told[:, 3]
                ),
            ),
            (of.BRAKES, of.FLAG, of.filled(of.bool_type(), None, data=rows["brakes"])),
            (of.ESTIMATE, of.STAMPED, of.filled(of.point_stamped(), ns, r=rows["ball"][:, :3])),
            (of.TICKS, of.TICK, rows),
        ]
        tracked = rows["out_tracked"]
        drawn = self._draw(first, rows, ns)
        for k in range(len(rows)):
            self._ns, sequence = int(ns[k]), first + k
            if of.DESCRIPTION not in self._channels:
                self._introduce(sequence)
            self.say(before.get(sequence, ()), sequence)
            for topic, kind, column in columns:
                if topic is not of.ESTIMATE or tracked[k]:
                    self._add(topic, kind, column[k].tobytes(), self._ns, sequence)
            self.say(drawn.get(k, ()), sequence)
            self._changes(rows[k], sequence)

    def say(self, messages: Iterable[Said], sequence: int = 0) -> None:
        """Write other messages, now or at their own time."""
        for topic, kind, data, ns in messages:
            self._add(topic, kind, data, self._ns if ns is None else ns, sequence)

    def flush(self) -> None:
        """End the chunk and hand all to the system."""
        self._writer.flush()

    def finish(self, *, dropped: int = 0) -> None:
        """End the file; what has no such end was cut."""
        self._writer.flush()
        self._writer.add_metadata(ENDING, {"dropped_ticks": str(dropped)})
        self._writer.finish()

    def _draw(self, first: int, rows: Rows, ns: NDArray[np.int64]) -> dict[int, list[Said]]:
        """Return where arm and ball are drawn, by row: each tenth tick, the ball if tracked."""
        at = np.arange(-first % _DRAWN, len(rows), _DRAWN)
        values = np.column_stack((rows["q"][at], rows["hand"][at]))
        good = np.all(np.isfinite(values), axis=1)
        at, values = at[good], values[good]
        frames = [frame for frame in self._heading.frames if frame.moves]
        arm = of.transforms(frames, ns[at], [x.poses(values[:, x.follows]) for x in frames])
        out: dict[int, list[Said]] = {
            k: [(of.MOVING, of.TRANSFORMS, row.tobytes(), None)]
            for k, row in zip(at.tolist(), arm, strict=True)
        }
        at = at[rows["out_tracked"][at]]
        ball = of.transforms([_BALL], ns[at], [_BALL.poses(np.zeros(len(at)))])
        ball["pose_0"][:, :3] = rows["ball"][at, :3]
        for k, row in zip(at.tolist(), ball, strict=True):
            out[k].append((of.MOVING, of.TRANSFORMS, row.tobytes(), None))
        if len(at) and of.MARKER not in self._channels:
            marker = of.ball_marker(int(ns[at[0]]), self._heading.radius)
            out[int(at[0])].append((of.MARKER, of.SHAPE, marker, None))
        return out

    def _introduce(self, sequence: int) -> None:
        """Write once what does not change: the arm's description, and the frames that stand."""
        frames, now = [x for x in self._heading.frames if not x.moves], np.array([self._ns])
        rows = of.transforms(frames, now, [frame.poses(np.zeros(1)) for frame in frames])
        self.say(
            (
                (of.DESCRIPTION, of.TEXT, cdr.encode_text(self._heading.description), None),
                (of.FIXED, of.TRANSFORMS, rows[0].tobytes(), None),
            ),
            sequence,
        )

    def _changes(self, row: np.void, sequence: int) -> None:
        """Write phase and state where they have changed."""
        phase = PHASES[row["out_phase"] % len(PHASES)].value
        state = STATES[row["out_health"] % len(STATES)].value
        reason = REASONS[row["out_reason"] % len(REASONS)].value
        for topic, text in ((of.PHASE, phase), (of.STATE, f"{state}: {reason}")):
            if text != self._last[topic]:
                self._last[topic] = text
                self._add(topic, of.TEXT, cdr.encode_text(text), self._ns, sequence)

    def _add(self, topic: str, kind: str, data: bytes, ns: int, sequence: int) -> None:
        """Add a message; its topic is made known by the first."""
        channel = self._channels.get(topic)
        if channel is None:
            if kind not in self._schemas:
                text = of.SCHEMAS[kind].encode()
                self._schemas[kind] = self._writer.register_schema(kind, "ros2msg", text)
            kept = _LATCHED if topic in _KEPT_BY_ROS else {}
            channel = self._writer.register_channel(topic, "cdr", self._schemas[kind], kept)
            self._channels[topic] = channel
        self._writer.add_message(channel, ns, data, ns, sequence)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Track:
    """A point over time.

    Attributes:
        topic: Topic to publish it on.
        t: Times [s], shape (k,).
        r: Positions [m], shape (k, 3).
    """

    topic: str
    t: Array
    r: Array

    def __post_init__(self) -> None:
        """Refuse positions that do not go with the times."""
        if self.r.shape != (len(self.t), 3):
            raise ShapeError(f"points of {self.topic}", f"({len(self.t)}, 3)", self.r.shape)


@dataclass(frozen=True, slots=True, kw_only=True)
class Notice:
    """Something that happened."""

    topic: str
    t: float
    text: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Recording:
    """A recording as a whole: k ticks.

    Attributes:
        heading: What it says first.
        ticks: Of the layout :func:`mitt.io.messages.ticks`, shape (k,).
        points: Sightings that were given to the catcher, by tick.
        belt: Readings of a belt's encoder, by tick.
        frames: Frames that were, by tick; those of tick -1 showed the background.
        calls: What else the catcher was told to do before a tick, by tick.
        tracks: Points over time.
        notices: What happened.
    """

    heading: Heading
    ticks: Rows
    points: Mapping[int, tuple[Sighting, ...]] = field(default_factory=dict)
    belt: Mapping[int, tuple[BeltReading, ...]] = field(default_factory=dict)
    frames: Mapping[int, tuple[Frame, ...]] = field(default_factory=dict)
    calls: Mapping[int, tuple[str, ...]] = field(default_factory=dict)
    tracks: tuple[Track, ...] = ()
    notices: tuple[Notice, ...] = ()


def write_recording(path: Path, recording: Recording) -> None:
    """Write a recording whole or not at all; the same recording gives the same bytes.

    Raises:
        FileError: The file cannot be written; what stood there before is untouched.
    """
    write_atomically(path, lambda temporary: _fill(temporary, recording))


def _fill(path: Path, recording: Recording) -> None:
    """Write ticks in their order, and what else there is when its time has come."""
    with path.open("wb") as stream:
        writer = RecordingWriter(stream, recording.heading)
        before, after = _others(recording)
        writer.ticks(0, recording.ticks, before)
        writer.say(after, len(recording.ticks))
        writer.finish()


def _others(recording: Recording) -> tuple[dict[int, list[Said]], list[Said]]:
    """Return what is said before each tick, and after the last."""
    ns, shapes = of.ns_of(recording.ticks["t"]), recording.heading.shapes
    before: dict[int, list[Said]] = {k: [] for k in range(len(ns))}
    texts = [
        (x.topic, of.TEXT, cdr.encode_text(x.text), int(of.ns_of(x.t))) for x in recording.notices
    ]
    for track in recording.tracks:
        rows = of.filled(of.point_stamped(), of.ns_of(track.t), r=track.r)
        times = of.ns_of(track.t).tolist()
        texts += [
            (track.topic, of.STAMPED, row.tobytes(), t) for row, t in zip(rows, times, strict=True)
        ]
    texts.sort(key=lambda said: said[3] or 0)
    places = np.searchsorted(np.maximum.accumulate(ns), [said[3] for said in texts])
    after: list[Said] = []
    for k, said in zip(places.tolist(), texts, strict=True):
        (before[k] if k < len(ns) else after).append(said)
    for k, calls in recording.calls.items():
        before[k] += [of.call_message(name) for name in calls]
    for k, sightings in recording.points.items():
        before[k] += [of.point_message(row) for row in of.point_rows(sightings)]
    for k, readings in recording.belt.items():
        before[k] += of.travel_messages(readings)
    for k, frames in recording.frames.items():
        for frame in frames:
            row, pixels = of.frame_row(frame)
            before[k] += of.frame_messages(row, pixels, shapes)
    return before, after


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
        self._belt: dict[int, list[bytes]] = {}
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
        """All ticks, of the layout :func:`mitt.io.messages.ticks`."""
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

    def belt(self, number: int) -> tuple[BeltReading, ...]:
        """Return the readings of a belt's encoder that a tick was given."""
        rows = [np.frombuffer(x, _TRAVEL)[0] for x in self._belt.get(number, ())]
        return tuple(BeltReading(t=float(x["t"]), travel=float(x["travel"])) for x in rows)

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
                text = _unzipped(attachment.data, 8_000_000).decode()
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
        if chunk.uncompressed_size > _RECORD:
            given = f"one of {chunk.uncompressed_size}"
            raise self._error(f"chunks of at most {_RECORD} bytes", given)
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
        elif topic == of.BELT:
            _whole(data, _TRAVEL)
            self._belt.setdefault(number, []).append(data)
        elif topic == of.FRAMES and self._images:
            self._half = _row(of.frame_type(), data)
        elif topic.startswith("/camera_") and self._images and self._half is not None:
            self._frames.setdefault(number, []).append(self._frame(self._half, data))
            self._half = None
        elif topic == of.CALLS:
            self.calls.setdefault(number, []).append(cdr.decode_text(data))
        elif topic in (of.TRUTH, of.CATCH_POINT):
            _whole(data, _PLACE)
            self._places.setdefault(topic, []).append((ns, data))
        elif topic in (of.EVENT, of.PHASE, of.STATE):
            self.notices.append((1e-9 * ns, topic, cdr.decode_text(data)))

    def _frame(self, row: Rows, data: bytes) -> Frame:
        """Return a frame from what belongs to it and its image."""
        camera = int(row["camera"][0])
        shapes = self.about.shapes
        if not 0 <= camera < len(shapes):
            raise self._error(f"images of {len(shapes)} cameras", f"one of camera {camera}")
        image = _row(of.image_type(shapes[camera], camera), data)
        return Frame(
            t=float(row["t"][0]),
            camera=camera,
            number=int(row["number"][0]),
            pixels=image["data"][0].reshape(shapes[camera]).copy(),
            pan=float(row["pan"][0]),
            tilt=float(row["tilt"][0]),
        )

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
    return Sighting(
        t=float(row["t"][0]),
        found=bool(row["found"][0]),
        r_o=row["r_o"][0].copy(),
        covariance=row["covariance"][0].reshape(3, 3).copy(),
    )
