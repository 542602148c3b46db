"""Messages are as Cyclone's own implementation writes and reads them."""

from contextlib import suppress
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.errors import InputError
from mitt.link import messages as m
from mitt.link.cdr import Reader, Writer

try:
    from mitt.link import dds_types
except InputError:
    pytest.skip("no Cyclone DDS", allow_module_level=True)
dds: Any = dds_types

NAMES = st.lists(st.text("abcdefgh_123", min_size=1, max_size=12), min_size=1, max_size=8)


def theirs(message: Any) -> bytes:  # noqa: ANN401
    """Return what Cyclone makes of a message, filled up to a multiple of four."""
    raw: bytes = type(message).__idl__.serialize(message, use_version_2=False)
    return raw + bytes(-len(raw) % 4)


@given(NAMES)
def test_joint_states(names: list[str]) -> None:
    """Byte by byte, whatever the names' lengths do to the alignment; read back the same."""
    n, t = len(names), 1_700_000_000.25
    q, dq = np.arange(2.0 * n).reshape(2, n) - 1.25
    ours = m.joint_state(t, tuple(names), q, dq)
    header = dds.Header(dds.Time(1_700_000_000, 250_000_000), "")
    assert ours == theirs(dds.JointState(header, names, q.tolist(), dq.tolist(), []))
    back = m.read_joint_state(ours)
    assert back.t == t
    assert back.names == tuple(names)
    assert np.array_equal([back.q, back.dq], [q, dq])


@given(NAMES)
def test_trajectories(names: list[str]) -> None:
    """One point with all four rows."""
    rows = np.random.default_rng(len(names)).standard_normal((4, len(names)))
    ours = m.trajectory(2.5, tuple(names), rows)
    point = dds.TrajectoryPoint(*rows.tolist(), dds.Duration(0, 2_000_000))
    header = dds.Header(dds.Time(2, 500_000_000), "")
    assert ours == theirs(dds.JointTrajectory(header, names, [point]))
    t, back, read = m.read_trajectory(ours)
    assert (t, back) == (2.5, tuple(names))
    assert np.array_equal(read, rows)


@given(st.text("abc_/", max_size=9))
def test_points_and_poses(frame: str) -> None:
    """Both are read by one function."""
    r_o, header = np.array([1.5, -2.0, 0.25]), dds.Header(dds.Time(3, 0), frame)
    point, pose = m.point(3.0, frame, r_o), m.pose(3.0, frame, r_o)
    assert point == theirs(dds.PointStamped(header, dds.Point(1.5, -2.0, 0.25)))
    turn = dds.Quaternion(0.0, 0.0, 0.0, 1.0)
    assert pose == theirs(dds.PoseStamped(header, dds.Pose(dds.Point(1.5, -2.0, 0.25), turn)))
    for raw in (point, pose):
        t, named, read = m.read_point(raw)
        assert (t, named) == (3.0, frame)
        assert np.array_equal(read, r_o)


def test_the_others() -> None:
    """Arrays, flags, texts, diagnostics."""
    layout = dds.Layout([dds.Dimension("tau", 2, 2)], 0)
    assert m.array(np.array([1.0, 2.0])) == theirs(dds.MultiArray(dds.Layout([], 0), [1.0, 2.0]))
    assert m.read_array(theirs(dds.MultiArray(layout, [1.0, 2.0]))).tolist() == [1.0, 2.0]
    assert [m.read_flag(theirs(dds.Bool(x))) for x in (True, False)] == [True, False]
    assert m.flag(True) == theirs(dds.Bool(True))
    assert m.read_text(m.text("é")) == "é"
    entries = [dds.Status(2, "robot", "stop", "", [dds.KeyValue("a", "b")]),
               dds.Status(0, "other", "", "x", [])]  # fmt: skip
    raw = theirs(dds.Diagnostics(dds.Header(dds.Time(1, 0), "f"), entries))
    assert m.read_diagnostics(raw) == {"robot": (2, "stop"), "other": (0, "")}
    ours = m.diagnostics(1.0, "robot", 2, "stop")
    one = dds.Diagnostics(dds.Header(dds.Time(1, 0), ""), [dds.Status(2, "robot", "stop", "", [])])
    assert ours == theirs(one)


@given(st.binary(max_size=200))
def test_what_is_no_message_is_refused(raw: bytes) -> None:
    """By no other error, and without reading beyond its end."""
    for read in (m.read_joint_state, m.read_trajectory, m.read_diagnostics, m.read_array):
        with suppress(InputError):
            read(raw)


def test_every_cut_of_a_message_is_refused() -> None:
    """A message that lacks its end is not taken for a shorter one."""
    whole = m.joint_state(1.0, ("a", "bc"), np.ones(2), np.ones(2))
    for k in range(len(whole) - 4):
        with pytest.raises(InputError):
            m.read_joint_state(whole[:k])


def test_big_endian_is_read() -> None:
    """As hosts of the other order write it."""
    assert Reader(b"\x00\x00\x00\x00" + (7).to_bytes(4, "big")).whole() == 7
    assert Writer().whole(7).done()[4:] == (7).to_bytes(4, "little")
