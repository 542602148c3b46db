"""Messages of a recording: topics, ROS 2 definitions, and what each says, as rows of arrays."""

from collections.abc import Iterable, Sequence
from math import isfinite, nan
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from mitt.core.catcher.state import Result, fresh_result
from mitt.core.signals import Array, BeltReading, Frame, Senses, Sighting
from mitt.io.cdr import Field, Rows, encode_text, layout
from mitt.io.robot_description import LinkFrame as Drawn
from mitt.numerals import real_of

#: Topics, and the frame in which all points are given (REP 105 has no name for a shoulder frame).
STATES = "/joint_states"
COMMANDS = "/joint_commands"
BRAKES = "/brakes"
ESTIMATE = "/ball/estimate"
TRUTH = "/ball/truth"
CATCH_POINT = "/hand/catch_point"
PHASE = "/phase"
STATE = "/state"
EVENT = "/events"
TICKS = "/mitt/ticks"
POINTS = "/mitt/points"
BELT = "/mitt/belt"
FRAMES = "/mitt/frames"
CALLS = "/mitt/calls"
IMAGES = "/camera_{}/image"
WORLD = "world"
DESCRIPTION = "/robot_description"
MOVING = "/tf"
FIXED = "/tf_static"
BALL = "ball"
MARKER = "/ball/marker"

#: Types of messages.
STAMPED = "geometry_msgs/msg/PointStamped"
JOINTS = "sensor_msgs/msg/JointState"
TEXT = "std_msgs/msg/String"
FLAG = "std_msgs/msg/Bool"
IMAGE = "sensor_msgs/msg/Image"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
SHAPE = "visualization_msgs/msg/Marker"
TICK = "mitt_msgs/msg/Tick"
POINT = "mitt_msgs/msg/Point"
TRAVEL = "mitt_msgs/msg/Travel"
FRAME = "mitt_msgs/msg/Frame"
#: A marker's type of a ball.
_SPHERE = 2
#: Among the calls: a correction of the eyes' stamps, torques that were taken over.
_CLOCK = "clock"
_TORQUES = "torques"
#: Largest time that a stamp can say [ns].
_LAST = 2**31 * 1_000_000_000 - 1

Said: TypeAlias = tuple[str, str, bytes, int | None]
"""A message: topic, type, content, time [ns]; that of its tick where None."""

_BREAK = "=" * 80 + "\n"
_TIME = "int32 sec\nuint32 nanosec\n"
_HEADER = "builtin_interfaces/Time stamp\nstring frame_id\n"
_STAMP = ("sec", "int32", None), ("nanosec", "uint32", None)
_POSE_OF = {
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z\n",
}
_ON_ANOTHER = "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n"
_TRANSFORM = "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n"
_MARKER_OF = {
    "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n",
    "std_msgs/ColorRGBA": "float32 r\nfloat32 g\nfloat32 b\nfloat32 a\n",
    "builtin_interfaces/Duration": "int32 sec\nuint32 nanosec\n",
    "sensor_msgs/CompressedImage": "std_msgs/Header header\nstring format\nuint8[] data\n",
    "visualization_msgs/UVCoordinate": "float32 u\nfloat32 v\n",
    "visualization_msgs/MeshFile": "string filename\nuint8[] data\n",
}
_PLACE_OF = {"geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z\n"}


def _definition(own: str, **parts: str) -> str:
    """Return a message definition with those of its parts, as a ``ros2msg`` schema has it."""
    parts |= {"std_msgs/Header": _HEADER, "builtin_interfaces/Time": _TIME}
    return _BREAK.join(
        (own, *(f"MSG: {name}\n{encode_text}" for name, encode_text in parts.items()))
    )


def _results() -> list[Field]:
    """Return the single numbers of a result as fields."""
    kinds = {"b": "bool", "i": "int64", "f": "float64"}
    dtype = fresh_result(1).scalars.dtype
    return [(f"out_{name}", kinds[dtype[name].kind], None) for name in dtype.names or ()]


def _tick(n: int | None, heads: int | None) -> list[Field]:
    """Return the fields of a tick of ``n`` joints; of lengths unknown for the definition."""
    many = [None if n is None else rows * n for rows in (1, 4, 6)]
    return [
        ("t", "float64", None),
        ("t_arm", "float64", None),
        ("points", "uint32", None),
        ("frames", "uint32", None),
        ("q", "float64[]", many[0]),
        ("dq", "float64[]", many[0]),
        ("command", "float64[]", many[1]),
        ("hand", "float64", None),
        ("brakes", "bool", None),
        ("gaze", "float64[]", None if heads is None else 4 * heads),
        *_results(),
        ("ball", "float64[9]", None),
        ("covariance", "float64[36]", None),
        ("reference", "float64[]", many[2]),
        ("sighting", "float64[12]", None),
    ]


_POINT: list[Field] = [
    ("t", "float64", None),
    ("found", "bool", None),
    ("r_o", "float64[3]", None),
    ("covariance", "float64[9]", None),
]
_TRAVEL: list[Field] = [
    ("t", "float64", None),
    ("travel", "float64", None),
]
_FRAME: list[Field] = [
    ("t", "float64", None),
    ("camera", "int64", None),
    ("number", "int64", None),
    ("pan", "float64", None),
    ("tilt", "float64", None),
]


def _listed(fields: Sequence[Field]) -> str:
    """Return fields as a definition."""
    return "".join(f"{kind} {name}\n" for name, kind, _ in fields)


# Definitions as in ROS 2's common_interfaces and rcl_interfaces, without their comments; those of
# mitt_msgs are ours.
SCHEMAS = {
    JOINTS: _definition(
        "std_msgs/Header header\nstring[] name\n"
        "float64[] position\nfloat64[] velocity\nfloat64[] effort\n"
    ),
    STAMPED: _definition(
        "std_msgs/Header header\ngeometry_msgs/Point point\n",
        **_PLACE_OF,
    ),
    TRANSFORMS: _definition(
        "geometry_msgs/TransformStamped[] transforms\n",
        **{"geometry_msgs/TransformStamped": _ON_ANOTHER, "geometry_msgs/Transform": _TRANSFORM},
        **_POSE_OF,
    ),
    SHAPE: _definition(
        "std_msgs/Header header\nstring ns\nint32 id\nint32 type\nint32 action\n"
        "geometry_msgs/Pose pose\ngeometry_msgs/Vector3 scale\nstd_msgs/ColorRGBA color\n"
        "builtin_interfaces/Duration lifetime\nbool frame_locked\n"
        "geometry_msgs/Point[] points\nstd_msgs/ColorRGBA[] colors\n"
        "string texture_resource\nsensor_msgs/CompressedImage texture\n"
        "visualization_msgs/UVCoordinate[] uv_coordinates\nstring text\nstring mesh_resource\n"
        "visualization_msgs/MeshFile mesh_file\nbool mesh_use_embedded_materials\n",
        **_POSE_OF,
        **_PLACE_OF,
        **_MARKER_OF,
    ),
    IMAGE: _definition(
        "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\n"
        "uint8 is_bigendian\nuint32 step\nuint8[] data\n"
    ),
    TEXT: "string data\n",
    FLAG: "bool data\n",
    TICK: _listed(_tick(None, None)),
    POINT: _listed(_POINT),
    TRAVEL: _listed(_TRAVEL),
    FRAME: _listed(_FRAME),
}


def ticks(n: int, heads: int, count: int = 1) -> Rows:
    """Return so many ``mitt_msgs/msg/Tick`` of ``n`` joints; ``heads`` is 0 where cameras stand."""
    return layout(_tick(n, heads), count)


def joint_states(names: Sequence[str], *, efforts: bool) -> Rows:
    """Return a ``sensor_msgs/msg/JointState``; without efforts, they are unknown."""
    n = len(names)
    return layout(
        [
            *_STAMP,
            ("frame_id", "string", ""),
            ("name", "string[]", tuple(names)),
            ("position", "float64[]", n),
            ("velocity", "float64[]", n),
            ("effort", "float64[]", n if efforts else 0),
        ]
    )


def point_stamped() -> Rows:
    """Return a ``geometry_msgs/msg/PointStamped``, its point as ``r``."""
    return layout([*_STAMP, ("frame_id", "string", WORLD), ("r", "float64[3]", None)])


def transforms(frames: Sequence[Drawn], ns: NDArray[np.int64], poses: Sequence[Array]) -> Rows:
    """Return ``tf2_msgs/msg/TFMessage`` of all frames at k times [ns].

    Args:
        frames: The frames.
        ns: Times [ns], shape (k,).
        poses: Of each frame on its parent, position and quaternion x, y, z, w, shape (k, 7).
    """
    fields: list[Field] = [("count", "uint32", None)]
    for k, frame in enumerate(frames):
        fields += [
            (f"sec_{k}", "int32", None),
            (f"nanosec_{k}", "uint32", None),
            (f"parent_{k}", "string", frame.parent),
            (f"child_{k}", "string", frame.name),
            (f"pose_{k}", "float64[7]", None),
        ]
    rows = layout(fields, len(ns))
    rows["count"] = len(frames)
    for k, pose in enumerate(poses):
        rows[f"sec_{k}"], rows[f"nanosec_{k}"] = np.divmod(ns, 1_000_000_000)
        rows[f"pose_{k}"] = pose
    return rows


def ball_marker(ns: int, radius: float) -> bytes:
    """Return a ``visualization_msgs/msg/Marker``: a ball [m] that goes with the frame ``ball``."""
    fields: list[Field] = [
        *_STAMP,
        ("frame_id", "string", BALL),
        ("ns", "string", BALL),
        ("id", "int32", None),
        ("type", "int32", None),
        ("action", "int32", None),
        ("pose", "float64[7]", None),
        ("scale", "float64[3]", None),
        ("color", "float32[4]", None),
        ("lasts", "int32[2]", None),
        ("frame_locked", "bool", None),
        ("points", "float64[]", 0),
        ("colors", "float64[]", 0),
        ("texture_resource", "string", ""),
        ("texture_sec", "int32[2]", None),
        ("texture_frame", "string", ""),
        ("format", "string", ""),
        ("data", "uint8[]", 0),
        ("uv", "float64[]", 0),
        ("text", "string", ""),
        ("mesh_resource", "string", ""),
        ("filename", "string", ""),
        ("mesh", "uint8[]", 0),
        ("materials", "bool", None),
    ]
    row = layout(fields)
    row["sec"], row["nanosec"] = divmod(ns, 1_000_000_000)
    row["type"], row["pose"], row["scale"] = _SPHERE, (0, 0, 0, 0, 0, 0, 1), 2.0 * radius
    row["color"], row["frame_locked"] = (0.84, 0.37, 0.0, 1.0), True
    return row.tobytes()


def image_type(shape: tuple[int, int], camera: int) -> Rows:
    """Return a ``sensor_msgs/msg/Image`` of grey values, shape (height, width)."""
    height, width = shape
    out = layout(
        [
            *_STAMP,
            ("frame_id", "string", f"camera_{camera}"),
            ("height", "uint32", None),
            ("width", "uint32", None),
            ("encoding", "string", "mono8"),
            ("big", "uint8", None),
            ("step", "uint32", None),
            ("data", "uint8[]", height * width),
        ]
    )
    out["height"], out["width"], out["step"] = height, width, width
    return out


def points(count: int = 1) -> Rows:
    """Return so many ``mitt_msgs/msg/Point``: sightings that were given to the catcher."""
    return layout(_POINT, count)


def travels(count: int = 1) -> Rows:
    """Return so many ``mitt_msgs/msg/Travel``: readings of a belt's encoder."""
    return layout(_TRAVEL, count)


def frame_type() -> Rows:
    """Return a ``mitt_msgs/msg/Frame``: what a frame says besides its image."""
    return layout(_FRAME)


def bool_type() -> Rows:
    """Return a ``std_msgs/msg/Bool``."""
    return layout([("data", "bool", None)])


def tick_rows(results: Result, senses: Sequence[Senses], heads: int) -> Rows:
    """Return ticks of the layout :func:`mitt.io.messages.ticks`.

    Args:
        results: What they brought about, k of them.
        senses: What they took; where there is none, time and encoders are those of the results.
        heads: Number of cameras that turn.
    """
    s, k, n = results.scalars, len(results.scalars), results.command.shape[-1]
    rows = ticks(n, heads, k)
    rows["t"] = rows["t_arm"] = s["t"]
    rows["q"], rows["dq"] = results.encoders[:, 0], results.encoders[:, 1]
    for row, x in zip(rows, senses, strict=False):
        row["t"], row["t_arm"], row["q"], row["dq"] = x.t, x.arm.t, x.arm.q, x.arm.dq
        row["points"], row["frames"] = len(x.points), len(x.frames)
    rows["command"] = results.command.reshape(k, 4 * n)
    rows["hand"], rows["brakes"] = s["hand"], s["brakes"]
    if heads:
        rows["gaze"] = results.gaze.reshape(k, 4 * heads)
    for name in s.dtype.names or ():
        rows[f"out_{name}"] = s[name]
    for name in ("ball", "covariance", "reference", "sighting"):
        rows[name] = results._asdict()[name].reshape(k, rows[name].shape[1])
    return rows


def call_message(name: str) -> Said:
    """Return what the catcher was told to do."""
    return CALLS, TEXT, encode_text(name), None


def torques_call(torques: Array) -> str:
    """Return what is kept of torques that a catcher took over [N m], shape (n,)."""
    return " ".join([_TORQUES, *map(repr, torques.tolist())])


def torques_in(call: str, n: int) -> Array | None:
    """Return the torques that a call says were taken over [N m], (n,); None for another."""
    kind, *values = call.split() or [""]
    torques = np.array([nan if (x := real_of(text)) is None else x for text in values])
    whole = kind == _TORQUES and len(torques) == n and bool(np.all(np.isfinite(torques)))
    return torques if whole else None


def clock_call(offset: float) -> str:
    """Return what is kept of a correction of the eyes' stamps, which they bear already [s]."""
    return f"{_CLOCK} {offset!r}"


def clock_in(calls: Iterable[str]) -> float:
    """Return what stamps were corrected by, as the newest of the calls says [s]; 0 without one."""
    said = [name.split() for name in calls]
    given = [words[1] for words in said if len(words) == 2 and words[0] == _CLOCK]
    offset = real_of(given[-1]) if given else 0.0
    return offset if offset is not None and isfinite(offset) else 0.0


def notice_message(topic: str, said: str) -> Said:
    """Return something that happens now."""
    return topic, TEXT, encode_text(said), None


def point_message(row: np.void) -> Said:
    """Return a sighting of :func:`point_rows`."""
    return POINTS, POINT, row.tobytes(), None


def point_rows(sightings: Sequence[Sighting]) -> Rows:
    """Return sightings of the layout :func:`mitt.io.messages.points`."""
    rows = points(len(sightings))
    for row, sighting in zip(rows, sightings, strict=True):
        row["t"], row["found"] = sighting.t, sighting.found
        row["r_o"], row["covariance"] = sighting.r_o, sighting.covariance.ravel()
    return rows


def travel_messages(readings: Sequence[BeltReading]) -> list[Said]:
    """Return readings of a belt's encoder that were given to the catcher."""
    rows = travels(len(readings))
    for row, reading in zip(rows, readings, strict=True):
        row["t"], row["travel"] = reading.t, reading.travel
    return [(BELT, TRAVEL, row.tobytes(), None) for row in rows]


def frame_row(frame: Frame) -> tuple[Rows, bytes]:
    """Return a frame of the layout :func:`mitt.io.messages.frame_type`, and its grey values."""
    row = frame_type()
    row["t"], row["camera"], row["number"] = frame.t, frame.camera, frame.number
    row["pan"], row["tilt"] = frame.pan, frame.tilt
    return row, frame.pixels.tobytes()


def frame_messages(
    row: Rows, pixels: bytes, shapes: Sequence[tuple[int, int]]
) -> tuple[Said, Said]:
    """Return what belongs to an image, and the image."""
    camera = int(row["camera"][0])
    row_of_image = image_type(shapes[camera], camera)
    row_of_image["sec"], row_of_image["nanosec"] = np.divmod(ns_of(row["t"]), 1_000_000_000)
    row_of_image["data"] = np.frombuffer(pixels, np.uint8)
    topic = IMAGES.format(camera)
    return (FRAMES, FRAME, row.tobytes(), None), (topic, IMAGE, row_of_image.tobytes(), None)


def filled(template: Rows, ns: NDArray[np.int64] | None, **columns: NDArray[Any]) -> Rows:
    """Return messages with these columns, stamped where there are times [ns]."""
    rows = np.repeat(template, len(next(iter(columns.values()))))
    if ns is not None:
        rows["sec"], rows["nanosec"] = np.divmod(ns, 1_000_000_000)
    for name, column in columns.items():
        rows[name] = column
    return rows


def ns_of(t: Array | float) -> NDArray[np.int64]:
    """Return times in whole nanoseconds; before release counts as release, no time as 0."""
    known = np.nan_to_num(np.asarray(t, np.float64), nan=0.0, posinf=_LAST * 1e-9)
    return np.clip(np.rint(known * 1e9), 0.0, _LAST).astype(np.int64)
