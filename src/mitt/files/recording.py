"""Recordings that are read again, and that Foxglove and ROS 2 tools open: MCAP with ROS 2 messages.

| topic               | type                           | what                                     |
|---------------------|--------------------------------|------------------------------------------|
| `/joint_states`     | sensor_msgs/msg/JointState     | encoders                                 |
| `/joint_commands`   | sensor_msgs/msg/JointState     | commanded position, speed, torque        |
| `/brakes`           | std_msgs/msg/Bool              | whether the brakes are to engage         |
| `/ball/estimate`    | geometry_msgs/msg/PointStamped | the ball, as the catcher estimates it    |
| any, one a track    | geometry_msgs/msg/PointStamped | positions in the frame `world`           |
| `/camera_K/image`   | sensor_msgs/msg/Image          | images, where they were asked for        |
| `/phase`, `/state`  | std_msgs/msg/String            | of the catcher, when it changed          |
| any, one a notice   | std_msgs/msg/String            | what happened                            |
| `/mitt/ticks`       | mitt_msgs/msg/Tick             | all that a tick took and gave, to the bit |
| `/mitt/points`      | mitt_msgs/msg/Point            | sightings that were given to the catcher |
| `/mitt/frames`      | mitt_msgs/msg/Frame            | what belongs to an image                 |
| `/mitt/calls`       | std_msgs/msg/String            | what else the catcher was told to do     |

Names and units by REP 103: metres, radians, seconds. The sequence number of a message is that of
its tick. Stamps are whole nanoseconds; the numbers of `/mitt/...` have every digit. The attachment
`about.json.zst` says what makes the catcher (:mod:`mitt.files.about`).
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, final

import numpy as np
import zstandard
from mcap.writer import Writer

from mitt.catcher.settings import PHASES
from mitt.catcher.state import REASONS, STATES
from mitt.errors import ShapeError
from mitt.files import messages as of
from mitt.files.about import About
from mitt.files.files import write_atomically
from mitt.files.messages import ESTIMATE, PHASE, STATE, Rows
from mitt.files.recording_rows import (
    FLAG,
    JOINTS,
    STAMPED,
    TEXT,
    TICK,
    Said,
    call_message,
    filled,
    frame_messages,
    frame_row,
    ns_of,
    point_message,
    point_rows,
)
from mitt.signals import Array, Frame, Sighting

#: Name of the metadata record, of what is said at the end, and of the attachment.
METADATA, ENDING, ABOUT = "mitt", "mitt.end", "about.json.zst"
#: What the file says of the program that wrote it.
LIBRARY = "mitt"
#: Ticks in a chunk: a file that is cut loses at most so many.
_CHUNK_TICKS = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class Heading:
    """What a file says before its first tick.

    Attributes:
        joints: Names of the active joints.
        heads: Number of cameras that turn.
        shapes: Height and width of the images of each camera [px].
        about: What makes the catcher, as ``About.text``.
        metadata: Texts by name for other readers.
    """

    joints: tuple[str, ...]
    heads: int
    shapes: tuple[tuple[int, int], ...]
    about: str
    metadata: Mapping[str, str] = field(default_factory=dict)


def heading_of(about: About, metadata: Mapping[str, str] | None = None) -> Heading:
    """Return the heading of a recording; the notes of ``about`` are part of its metadata."""
    said = {"version": about.version, "arm": about.arm.model.name,
            "limits": about.arm.limits.name, "generator": about.generator}  # fmt: skip
    return Heading(
        joints=about.arm.names, heads=len(about.rig.heads), shapes=about.shapes, about=about.text,
        metadata={**said, **about.notes, **(metadata or {})},
    )  # fmt: skip


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
        self._states = of.joint_states(heading.joints, efforts=False)
        self._commands = of.joint_states(heading.joints, efforts=True)
        self._last = {PHASE: "", STATE: ""}
        self._ns = 0

    def ticks(self, first: int, rows: Rows, before: Mapping[int, Sequence[Said]] | None = None
              ) -> None:  # fmt: skip
        """Write ticks one after another.

        Args:
            first: Number of the first.
            rows: Of the layout :func:`mitt.files.messages.ticks`.
            before: What else is said before a tick, by its number.
        """
        ns, n, before = ns_of(rows["t"]), rows["q"].shape[1], before or {}
        told = rows["command"].reshape(len(rows), 4, n)
        q, dq = rows["q"], rows["dq"]
        columns = [
            (of.STATES, JOINTS, filled(self._states, ns, position=q, velocity=dq)),
            (of.COMMANDS, JOINTS, filled(self._commands, ns, position=told[:, 0],
                                           velocity=told[:, 1], effort=told[:, 3])),
            (of.BRAKES, FLAG, filled(of.flag(), None, data=rows["brakes"])),
            (ESTIMATE, STAMPED, filled(of.point_stamped(), ns, r=rows["ball"][:, :3])),
            (of.TICKS, TICK, rows),
        ]  # fmt: skip
        tracked = rows["out_tracked"]
        for k in range(len(rows)):
            self._ns, sequence = int(ns[k]), first + k
            self.say(before.get(sequence, ()), sequence)
            for topic, kind, column in columns:
                if topic is not ESTIMATE or tracked[k]:
                    self._add(topic, kind, column[k].tobytes(), self._ns, sequence)
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

    def _changes(self, row: np.void, sequence: int) -> None:
        """Write phase and state where they have changed."""
        phase = PHASES[row["out_phase"] % len(PHASES)].value
        state = STATES[row["out_health"] % len(STATES)].value
        reason = REASONS[row["out_reason"] % len(REASONS)].value
        for topic, text in ((PHASE, phase), (STATE, f"{state}: {reason}")):
            if text != self._last[topic]:
                self._last[topic] = text
                self._add(topic, TEXT, of.text(text), self._ns, sequence)

    def _add(self, topic: str, kind: str, data: bytes, ns: int, sequence: int) -> None:
        """Add a message; its topic is made known by the first."""
        channel = self._channels.get(topic)
        if channel is None:
            if kind not in self._schemas:
                text = of.SCHEMAS[kind].encode()
                self._schemas[kind] = self._writer.register_schema(kind, "ros2msg", text)
            channel = self._writer.register_channel(topic, "cdr", self._schemas[kind])
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
        ticks: Of the layout :func:`mitt.files.messages.ticks`, shape (k,).
        points: Sightings that were given to the catcher, by tick.
        frames: Frames that were, by tick; those of tick -1 showed the background.
        calls: What else the catcher was told to do before a tick, by tick.
        tracks: Points over time.
        notices: What happened.
    """

    heading: Heading
    ticks: Rows
    points: Mapping[int, tuple[Sighting, ...]] = field(default_factory=dict)
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
    ns, shapes = ns_of(recording.ticks["t"]), recording.heading.shapes
    before: dict[int, list[Said]] = {k: [] for k in range(len(ns))}
    texts = [(x.topic, TEXT, of.text(x.text), int(ns_of(x.t))) for x in recording.notices]
    for track in recording.tracks:
        rows = filled(of.point_stamped(), ns_of(track.t), r=track.r)
        times = ns_of(track.t).tolist()
        texts += [(track.topic, STAMPED, row.tobytes(), t)
                  for row, t in zip(rows, times, strict=True)]  # fmt: skip
    texts.sort(key=lambda said: said[3] or 0)
    places = np.searchsorted(np.maximum.accumulate(ns), [said[3] for said in texts])
    after: list[Said] = []
    for k, said in zip(places.tolist(), texts, strict=True):
        (before[k] if k < len(ns) else after).append(said)
    for k, calls in recording.calls.items():
        before[k] += [call_message(name) for name in calls]
    for k, sightings in recording.points.items():
        before[k] += [point_message(row) for row in point_rows(sightings)]
    for k, frames in recording.frames.items():
        for frame in frames:
            row, pixels = frame_row(frame)
            before[k] += frame_messages(row, pixels, shapes)
    return before, after
