"""The ROS 2 messages that a cell speaks, to and from CDR; types and fields are those of ROS 2.

| message                           | for                                                  |
|-----------------------------------|------------------------------------------------------|
| ``sensor_msgs/JointState``        | encoders                                             |
| ``geometry_msgs/PointStamped``    | the ball                                             |
| ``geometry_msgs/PoseStamped``     | the ball, from motion capture                        |
| ``trajectory_msgs/JointTrajectory`` | commands, one point                                |
| ``std_msgs/Float64MultiArray``    | commands, what the drives take                       |
| ``std_msgs/Bool``                 | brakes                                               |
| ``diagnostic_msgs/DiagnosticArray`` | state of the robot                                 |
| ``std_msgs/String``               | what a simulated cell says of a throw                |
"""

from collections.abc import Iterator
from typing import NamedTuple, final

import numpy as np

from mitt.errors import InputError
from mitt.link.cdr import Reader, Writer
from mitt.signals import Array

#: Time that a trajectory's point is given to be reached [ns]: two updates at 500 Hz.
_REACH_NS = 4_000_000


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
    names, q, dq = r.texts(), r.row(), r.row()
    if len(q) != len(names):
        raise InputError("joint states", f"{len(names)} positions, one a name", len(q))
    return JointReading(t, names, q, dq if len(dq) == len(names) else np.zeros(0))


def joint_state(t: float, names: tuple[str, ...], q: Array, dq: Array) -> bytes:
    """Return a JointState without efforts."""
    return Writer().header(t, "").texts(names).row(q).row(dq).row(np.zeros(0)).done()


def read_point(raw: bytes) -> tuple[float, str, Array]:
    """Return stamp [s], frame and position [m] of a PointStamped or a PoseStamped."""
    r = Reader(raw)
    t, frame = r.header()
    return t, frame, r.numbers(3)


def point(t: float, frame: str, r_o: Array) -> bytes:
    """Return a PointStamped."""
    return Writer().header(t, frame).numbers(r_o).done()


def pose(t: float, frame: str, r_o: Array) -> bytes:
    """Return a PoseStamped without turn."""
    turn = np.array([0.0, 0.0, 0.0, 1.0])
    return Writer().header(t, frame).numbers(np.concatenate([r_o, turn])).done()


def trajectory(answers: float, names: tuple[str, ...], rows: Array) -> bytes:
    """Return a JointTrajectory of one point that begins when it is taken: its stamp is 0.

    Its frame, of which a controller makes nothing, names the reading that it answers.

    Args:
        answers: Stamp of that reading [s].
        names: Joints.
        rows: Positions, velocities, accelerations and efforts, or the first of them, shape
            (k, names); those after them are left empty.
    """
    w = Writer().stamp(0.0).text(repr(float(answers))).texts(names).whole(1)
    for row in rows:
        w.row(row)
    for _ in range(4 - len(rows)):
        w.whole(0)
    return w.whole(0).whole(_REACH_NS).done()


def read_trajectory(raw: bytes) -> tuple[float, tuple[str, ...], Array]:
    """Return which reading a JointTrajectory answers, its names and its last point's rows.

    The rows have shape (4, names), NaN where one is left out; so is the stamp of the reading where
    the frame names none.
    """
    r = Reader(raw)
    _, frame = r.header()
    names, count = r.texts(), r.count()
    if count == 0:
        raise InputError("a trajectory", "at least one point", "none")
    rows = np.zeros((4, len(names)))
    for _ in range(count):
        for k in range(4):
            row = r.row()
            if len(row) not in (0, len(names)):
                raise InputError("a trajectory", f"{len(names)} numbers a row", len(row))
            rows[k] = row if len(row) else np.nan
        r.stamp()
    try:
        answers = float(frame)
    except ValueError:
        answers = np.nan
    return answers, names, rows


def array(x: Array) -> bytes:
    """Return a Float64MultiArray without a layout."""
    return Writer().whole(0).whole(0).row(x).done()


def read_array(raw: bytes) -> Array:
    """Return the numbers of a Float64MultiArray."""
    r = Reader(raw)
    for _ in range(r.count()):
        r.text()
        r.whole()
        r.whole()
    r.whole()
    return r.row()


def flag(x: bool) -> bytes:
    """Return a Bool."""
    return Writer().small(int(x)).done()


def read_flag(raw: bytes) -> bool:
    """Return what a Bool says."""
    return Reader(raw).small() != 0


def text(x: str) -> bytes:
    """Return a String."""
    return Writer().text(x).done()


def read_text(raw: bytes) -> str:
    """Return what a String says."""
    return Reader(raw).text()


def diagnostics(t: float, name: str, level: int, message: str) -> bytes:
    """Return a DiagnosticArray of one entry; levels are 0 fine, 1 warning, 2 error, 3 stale."""
    w = Writer().header(t, "").whole(1).small(level)
    return w.text(name).text(message).text("").whole(0).done()


def search_diagnostics(raw: bytes, name: str) -> Iterator[tuple[int, str] | None]:
    """Look for an entry of a DiagnosticArray, a field at a time: others write what they like there.

    Args:
        raw: The message.
        name: Of the entry.

    Yields:
        None as long as it was not found; then its level and message, and no more.

    Raises:
        InputError: It is no such message.
    """
    if name.encode() + b"\0" not in raw:
        return
    r = Reader(raw)
    r.header()
    for _ in range(r.count()):
        level, found, message = r.small(), r.text(), r.text()
        if found == name:
            yield level, message
            return
        r.text()
        yield None
        for _ in range(r.count()):
            r.text()
            r.text()
            yield None
