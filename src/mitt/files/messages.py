"""Messages of a recording as arrays: ROS 2 definitions, and where CDR puts each number.

A message whose sequences have known lengths is as long each time. Then CDR (XCDR1, little endian)
puts every number at the same place, and many messages are one structured array: a column is written
at once, and a message is the bytes of a row. Numbers are aligned to their size, counted from behind
the 4 bytes that say how they are encoded (OMG DDSI-RTPS 2.5, 10.2; OMG CORBA 3.3 part 2, 9.3).
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from mitt.catcher.state import fresh_result

Rows: TypeAlias = NDArray[np.void]
"""Messages of one kind, one a row."""

#: What stands before a message: plain CDR, little endian.
CDR = b"\x00\x01\x00\x00"
#: Topics, and the frame in which all points are given (REP 105 has no name for a shoulder frame).
STATES, COMMANDS, BRAKES = "/joint_states", "/joint_commands", "/brakes"
ESTIMATE, TRUTH, CATCH_POINT = "/ball/estimate", "/ball/truth", "/hand/catch_point"
PHASE, STATE, EVENT = "/phase", "/state", "/events"
TICKS, POINTS, FRAMES, CALLS = "/mitt/ticks", "/mitt/points", "/mitt/frames", "/mitt/calls"
IMAGE, FRAME = "/camera_{}/image", "world"

_KINDS = {"bool": "?", "uint8": "u1", "int32": "<i4", "uint32": "<u4", "int64": "<i8",
          "float64": "<f8"}  # fmt: skip
_BREAK = "=" * 80 + "\n"
_TIME = "int32 sec\nuint32 nanosec\n"
_HEADER = "builtin_interfaces/Time stamp\nstring frame_id\n"
_STAMP = ("sec", "int32", None), ("nanosec", "uint32", None)

Field: TypeAlias = tuple[str, str, Any]
"""Name, type of ROS 2, and the length of a sequence or the text of a string; None elsewhere."""


def _definition(own: str, **parts: str) -> str:
    """Return a message definition with those of its parts, as a ``ros2msg`` schema has it."""
    parts |= {"std_msgs/Header": _HEADER, "builtin_interfaces/Time": _TIME}
    return _BREAK.join((own, *(f"MSG: {name}\n{text}" for name, text in parts.items())))


def _results() -> list[Field]:
    """Return the single numbers of a result as fields."""
    kinds = {"b": "bool", "i": "int64", "f": "float64"}
    dtype = fresh_result(1).scalars.dtype
    return [(f"out_{name}", kinds[dtype[name].kind], None) for name in dtype.names or ()]


def _tick(n: int | None, heads: int | None) -> list[Field]:
    """Return the fields of a tick of ``n`` joints; of lengths unknown for the definition."""
    many = [None if n is None else rows * n for rows in (1, 4, 6)]
    return [
        ("t", "float64", None), ("t_arm", "float64", None), ("points", "uint32", None),
        ("frames", "uint32", None), ("q", "float64[]", many[0]), ("dq", "float64[]", many[0]),
        ("command", "float64[]", many[1]), ("hand", "float64", None), ("brakes", "bool", None),
        ("gaze", "float64[]", None if heads is None else 4 * heads),
        *_results(),
        ("ball", "float64[9]", None), ("covariance", "float64[36]", None),
        ("reference", "float64[]", many[2]), ("sighting", "float64[12]", None),
    ]  # fmt: skip


_POINT: list[Field] = [("t", "float64", None), ("found", "bool", None), ("r_o", "float64[3]", None),
                       ("covariance", "float64[9]", None)]  # fmt: skip
_FRAME: list[Field] = [("t", "float64", None), ("camera", "int64", None), ("number", "int64", None),
                       ("pan", "float64", None), ("tilt", "float64", None)]  # fmt: skip


def _listed(fields: Sequence[Field]) -> str:
    """Return fields as a definition."""
    return "".join(f"{kind} {name}\n" for name, kind, _ in fields)


# Definitions as in ROS 2's common_interfaces and rcl_interfaces, without their comments; those of
# mitt_msgs are ours.
SCHEMAS = {
    "sensor_msgs/msg/JointState": _definition(
        "std_msgs/Header header\nstring[] name\n"
        "float64[] position\nfloat64[] velocity\nfloat64[] effort\n"
    ),
    "geometry_msgs/msg/PointStamped": _definition(
        "std_msgs/Header header\ngeometry_msgs/Point point\n",
        **{"geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z\n"},
    ),
    "sensor_msgs/msg/Image": _definition(
        "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\n"
        "uint8 is_bigendian\nuint32 step\nuint8[] data\n"
    ),
    "std_msgs/msg/String": "string data\n",
    "std_msgs/msg/Bool": "bool data\n",
    "mitt_msgs/msg/Tick": _listed(_tick(None, None)),
    "mitt_msgs/msg/Point": _listed(_POINT),
    "mitt_msgs/msg/Frame": _listed(_FRAME),
}


def layout(fields: Sequence[Field]) -> Rows:
    """Return a message with these fields, all numbers zero, as an array of one row.

    Strings and the lengths of sequences are filled in, and are not to be written to.
    """
    return _laid_out(tuple(fields)).copy()


@lru_cache(maxsize=256)
def _laid_out(fields: tuple[Field, ...]) -> Rows:
    """Return what :func:`layout` returns a copy of."""
    names, kinds, offsets, fixed = ["_cdr"], ["V4"], [0], {"_cdr": CDR}
    at = 0

    def put(name: str, kind: str, count: int | None, align: int) -> None:
        nonlocal at
        at += -at % align
        names.append(name)
        kinds.append(kind if count is None else f"({count},){kind}")
        offsets.append(4 + at)
        at += np.dtype(kinds[-1]).itemsize

    for name, kind, given in fields:
        base, bracket, inside = kind.partition("[")
        if base == "string":
            at += -at % 4
            texts = [given] if not bracket else list(given)
            data = b"" if not bracket else len(texts).to_bytes(4, "little")
            for text in texts:
                code = text.encode() + b"\0"
                data += b"\0" * (-(at + len(data)) % 4) + len(code).to_bytes(4, "little") + code
            put(name, f"V{len(data)}", None, 1)
            fixed[name] = data
            continue
        count = None if not bracket else given if inside == "]" else int(inside[:-1])
        if inside == "]":
            put(f"_{name}", "<u4", None, 4)
            fixed[f"_{name}"] = int(given).to_bytes(4, "little")
        number = np.dtype(_KINDS[base])
        put(name, _KINDS[base], count, number.itemsize if count != 0 else 1)
    dtype = np.dtype({"names": names, "formats": kinds, "offsets": offsets, "itemsize": 4 + at})
    raw = np.zeros(dtype.itemsize, np.uint8)
    for name, value in fixed.items():
        start = offsets[names.index(name)]
        raw[start : start + len(value)] = np.frombuffer(value, np.uint8)
    return raw.view(dtype)


def ticks(n: int, heads: int) -> Rows:
    """Return a ``mitt_msgs/msg/Tick`` of ``n`` joints and so many heads, 0 where cameras stand."""
    return layout(_tick(n, heads))


def joint_states(names: Sequence[str], *, efforts: bool) -> Rows:
    """Return a ``sensor_msgs/msg/JointState``; without efforts, they are unknown."""
    n = len(names)
    return layout([
        *_STAMP, ("frame_id", "string", ""), ("name", "string[]", tuple(names)),
        ("position", "float64[]", n), ("velocity", "float64[]", n),
        ("effort", "float64[]", n if efforts else 0),
    ])  # fmt: skip


def point_stamped() -> Rows:
    """Return a ``geometry_msgs/msg/PointStamped``, its point as ``r``."""
    return layout([*_STAMP, ("frame_id", "string", FRAME), ("r", "float64[3]", None)])


def image(shape: tuple[int, int], camera: int) -> Rows:
    """Return a ``sensor_msgs/msg/Image`` of grey values, shape (height, width)."""
    height, width = shape
    out = layout([
        *_STAMP, ("frame_id", "string", f"camera_{camera}"), ("height", "uint32", None),
        ("width", "uint32", None), ("encoding", "string", "mono8"), ("big", "uint8", None),
        ("step", "uint32", None), ("data", "uint8[]", height * width),
    ])  # fmt: skip
    out["height"], out["width"], out["step"] = height, width, width
    return out


def points() -> Rows:
    """Return a ``mitt_msgs/msg/Point``: a sighting that was given to the catcher."""
    return layout(_POINT)


def frames() -> Rows:
    """Return a ``mitt_msgs/msg/Frame``: what a frame says besides its image."""
    return layout(_FRAME)


def flag() -> Rows:
    """Return a ``std_msgs/msg/Bool``."""
    return layout([("data", "bool", None)])


def text(content: str) -> bytes:
    """Return a ``std_msgs/msg/String``."""
    return _laid_out((("data", "string", content),)).tobytes()


def read_text(message: bytes) -> str:
    """Return the text of a ``std_msgs/msg/String``; ValueError where it is none."""
    size = int.from_bytes(message[4:8], "little")
    if message[:4] != CDR or size < 1 or len(message) < 8 + size:
        raise ValueError("no std_msgs/msg/String")
    return message[8 : 7 + size].decode()
