"""Recordings that Foxglove and ROS 2 tools open: MCAP with ROS 2 messages.

| topic               | type                           | what                              |
|---------------------|--------------------------------|-----------------------------------|
| `/joint_states`     | sensor_msgs/msg/JointState     | encoders                          |
| `/joint_commands`   | sensor_msgs/msg/JointState     | commanded position, speed, torque |
| any, one a track    | geometry_msgs/msg/PointStamped | positions in the frame `world`    |
| `/brakes`           | std_msgs/msg/Bool              | whether the brakes are to engage  |
| any, one a notice   | std_msgs/msg/String            | what changed, when it changed     |

Names and units by REP 103: metres, radians, seconds. Time is the trial's own, 0 at release.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from mcap_ros2.writer import Writer
from numpy.typing import NDArray

from mitt.errors import ShapeError
from mitt.files.files import write_atomically
from mitt.signals import Array

#: Frame in which all points are given (REP 105 has no better name for a fixed shoulder frame).
FRAME = "world"
#: Topics of the points and notices of a trial.
ESTIMATE, TRUTH, CATCH_POINT = "/ball/estimate", "/ball/truth", "/hand/catch_point"
PHASE, EVENT = "/phase", "/events"
#: Topic of the command to the brakes.
BRAKES = "/brakes"
#: Name of the metadata record.
METADATA = "mitt"

_TIME = "int32 sec\nuint32 nanosec\n"
_HEADER = "builtin_interfaces/Time stamp\nstring frame_id\n"
_POINT = "float64 x\nfloat64 y\nfloat64 z\n"
_BREAK = "=" * 80 + "\n"


def _definition(own: str, **parts: str) -> str:
    """Return a message definition with those of its parts, as a ``ros2msg`` schema has it."""
    parts |= {"std_msgs/Header": _HEADER, "builtin_interfaces/Time": _TIME}
    return _BREAK.join((own, *(f"MSG: {name}\n{text}" for name, text in parts.items())))


# Definitions as in ROS 2's common_interfaces and rcl_interfaces, without their comments.
STATE, STAMPED = "sensor_msgs/msg/JointState", "geometry_msgs/msg/PointStamped"
TEXT, FLAG = "std_msgs/msg/String", "std_msgs/msg/Bool"
SCHEMAS = {
    STATE: _definition(
        "std_msgs/Header header\nstring[] name\n"
        "float64[] position\nfloat64[] velocity\nfloat64[] effort\n"
    ),
    STAMPED: _definition(
        "std_msgs/Header header\ngeometry_msgs/Point point\n", **{"geometry_msgs/Point": _POINT}
    ),
    TEXT: "string data\n",
    FLAG: "bool data\n",
}


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
    """Something that changed."""

    topic: str
    t: float
    text: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Recording:
    """What goes into one file: k ticks, n joints.

    Attributes:
        joints: Names of the joints.
        t: Times [s], shape (k,).
        encoders: q, dq as read [rad, rad/s], shape (k, 2, n).
        command: q, dq commanded [rad, rad/s], shape (k, 2, n).
        tau: Torque commanded [N m], shape (k, n).
        brakes: Whether the joints' brakes are commanded to engage, shape (k,).
        tracks: Points over time.
        notices: What changed.
        metadata: Text by name, written as one record.
    """

    joints: tuple[str, ...]
    t: Array
    encoders: Array
    command: Array
    tau: Array
    brakes: NDArray[np.bool_]
    tracks: tuple[Track, ...] = ()
    notices: tuple[Notice, ...] = ()
    metadata: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse columns of different lengths."""
        k, n = len(self.t), len(self.joints)
        shapes = {"encoders": (k, 2, n), "command": (k, 2, n), "tau": (k, n), "brakes": (k,)}
        given = (self.encoders, self.command, self.tau, self.brakes)
        for (name, wanted), x in zip(shapes.items(), given, strict=True):
            if x.shape != wanted:
                raise ShapeError(name, str(wanted), x.shape)


def write_recording(path: Path, recording: Recording) -> None:
    """Write a recording whole or not at all; the same recording gives the same bytes.

    Raises:
        FileError: The file cannot be written; what stood there before is untouched.
    """
    write_atomically(path, lambda temporary: _fill(temporary, recording))


def _fill(path: Path, recording: Recording) -> None:
    """Write all messages in the order of their times."""
    messages = _messages(recording)
    order = np.argsort([ns for ns, *_ in messages], kind="stable")
    with path.open("wb") as stream, Writer(stream) as writer:
        known = {name: writer.register_msgdef(name, text) for name, text in SCHEMAS.items()}
        writer.add_metadata(METADATA, dict(recording.metadata))
        for k in order:
            ns, topic, kind, message = messages[k]
            writer.write_message(topic, known[kind], message, log_time=ns)


_Message = tuple[int, str, str, dict[str, Any]]


def _messages(recording: Recording) -> list[_Message]:
    """Return time [ns], topic, type and content of every message."""
    out: list[_Message] = []
    times, names = _ns(recording.t), list(recording.joints)
    nothing = np.zeros((len(times), 0))  # efforts that are unknown
    for topic, motion, tau in (
        ("/joint_states", recording.encoders, nothing),
        ("/joint_commands", recording.command, recording.tau),
    ):
        for ns, (q, dq), effort in zip(times, motion.tolist(), tau.tolist(), strict=True):
            state = {"header": _header(ns, ""), "name": names, "position": q, "velocity": dq,
                     "effort": effort}  # fmt: skip
            out.append((ns, topic, STATE, state))
    for ns, engaged in zip(times, recording.brakes.tolist(), strict=True):
        out.append((ns, BRAKES, FLAG, {"data": engaged}))
    for track in recording.tracks:
        for ns, r in zip(_ns(track.t), track.r.tolist(), strict=True):
            point = {"header": _header(ns, FRAME), "point": dict(zip("xyz", r, strict=True))}
            out.append((ns, track.topic, STAMPED, point))
    for notice in recording.notices:
        (ns,) = _ns(np.array([notice.t]))
        out.append((ns, notice.topic, TEXT, {"data": notice.text}))
    return out


def _header(ns: int, frame: str) -> dict[str, Any]:
    """Return a message header."""
    sec, nanosec = divmod(ns, 1_000_000_000)
    return {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": frame}


def _ns(t: Array) -> list[int]:
    """Return times in whole nanoseconds; a tick before release counts as release."""
    ns: list[int] = np.maximum(np.rint(t * 1e9), 0.0).astype(np.int64).tolist()
    return ns
