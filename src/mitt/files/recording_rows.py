"""What is written into a recording, as messages: ticks, sightings, frames, texts."""

from collections.abc import Iterable, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from mitt.catcher.state import Result
from mitt.files import messages as of
from mitt.files.messages import Rows
from mitt.signals import Array, Frame, Senses, Sighting

STAMPED, JOINTS = "geometry_msgs/msg/PointStamped", "sensor_msgs/msg/JointState"
TEXT, FLAG, IMAGE = "std_msgs/msg/String", "std_msgs/msg/Bool", "sensor_msgs/msg/Image"
TICK, POINT, FRAME = "mitt_msgs/msg/Tick", "mitt_msgs/msg/Point", "mitt_msgs/msg/Frame"
#: What a correction of the eyes' stamps is called among the calls.
_CLOCK = "clock"
#: Largest time that a stamp can say [ns].
_LAST = 2**31 * 1_000_000_000 - 1

Said: TypeAlias = tuple[str, str, bytes, int | None]
"""A message: topic, type, content, time [ns]; that of its tick where None."""


def tick_rows(results: Result, senses: Sequence[Senses], heads: int) -> Rows:
    """Return ticks of the layout :func:`mitt.files.messages.ticks`.

    Args:
        results: What they brought about, k of them.
        senses: What they took; where there is none, time and encoders are those of the results.
        heads: Number of cameras that turn.
    """
    s, k, n = results.scalars, len(results.scalars), results.command.shape[-1]
    rows = np.repeat(of.ticks(n, heads), k)
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
    return of.CALLS, TEXT, of.text(name), None


def clock_call(offset: float) -> str:
    """Return what is kept of a correction of the eyes' stamps, which they bear already [s]."""
    return f"{_CLOCK} {offset!r}"


def clock_in(calls: Iterable[str]) -> float:
    """Return what stamps were corrected by, as the newest of the calls says [s]; 0 without one."""
    said = [name.split() for name in calls]
    given = [words[1] for words in said if len(words) == 2 and words[0] == _CLOCK]
    try:
        return float(given[-1]) if given else 0.0
    except ValueError:
        return 0.0


def notice_message(topic: str, text: str) -> Said:
    """Return something that happens now."""
    return topic, TEXT, of.text(text), None


def point_message(row: np.void) -> Said:
    """Return a sighting of :func:`point_rows`."""
    return of.POINTS, POINT, row.tobytes(), None


def point_rows(sightings: Sequence[Sighting]) -> Rows:
    """Return sightings of the layout :func:`mitt.files.messages.points`."""
    rows = of.points()
    if len(sightings) != 1:
        rows = np.repeat(rows, len(sightings))
    for row, sighting in zip(rows, sightings, strict=True):
        row["t"], row["found"] = sighting.t, sighting.found
        row["r_o"], row["covariance"] = sighting.r_o, sighting.covariance.ravel()
    return rows


def frame_row(frame: Frame) -> tuple[Rows, bytes]:
    """Return a frame of the layout :func:`mitt.files.messages.frames`, and its grey values."""
    row = of.frames()
    row["t"], row["camera"], row["number"] = frame.t, frame.camera, frame.number
    row["pan"], row["tilt"] = frame.pan, frame.tilt
    return row, frame.pixels.tobytes()


def frame_messages(
    row: Rows, pixels: bytes, shapes: Sequence[tuple[int, int]]
) -> tuple[Said, Said]:
    """Return what belongs to an image, and the image."""
    camera = int(row["camera"][0])
    image = of.image(shapes[camera], camera)
    image["sec"], image["nanosec"] = np.divmod(ns_of(row["t"]), 1_000_000_000)
    image["data"] = np.frombuffer(pixels, np.uint8)
    topic = of.IMAGE.format(camera)
    return (of.FRAMES, FRAME, row.tobytes(), None), (topic, IMAGE, image.tobytes(), None)


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
