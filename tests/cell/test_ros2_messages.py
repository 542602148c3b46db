"""Messages are as Cyclone's own implementation writes and reads them."""

from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mitt.core.errors import InputError
from mitt.io.cdr import Reader, Writer
from mitt.robot.cell import ros2_messages as m

try:
    from mitt.robot.cell import dds as dds_types
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
    """One point with the first rows, to be reached from now on; its frame says what it answers."""
    rows, t = np.random.default_rng(len(names)).standard_normal((4, len(names))), 1.7e9 + 1 / 3
    for k in range(1, 5):
        ours = m.trajectory(t, tuple(names), rows[:k])
        told = [*rows[:k].tolist(), *[[]] * (4 - k)]
        point = dds.TrajectoryPoint(*told, dds.Duration(0, 4_000_000))
        header = dds.Header(dds.Time(0, 0), repr(t))
        assert ours == theirs(dds.JointTrajectory(header, names, [point]))
        answers, back, read = m.read_trajectory(ours)
        assert (answers, back) == (t, tuple(names))
        assert np.array_equal(read[:k], rows[:k])
        assert np.all(np.isnan(read[k:]))


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
    assert m.array_message(np.array([1.0, 2.0])) == theirs(
        dds.MultiArray(dds.Layout([], 0), [1.0, 2.0])
    )
    assert m.read_array(theirs(dds.MultiArray(layout, [1.0, 2.0])))[1].tolist() == [1.0, 2.0]
    layout = dds.Layout([dds.Dimension("1.5", 2, 2)], 0)
    labelled = m.array_message(np.array([1.0, 2.0]), 1.5)
    assert labelled == theirs(dds.MultiArray(layout, [1.0, 2.0]))
    assert m.read_array(labelled)[0] == 1.5
    assert [m.read_flag(theirs(dds.Bool(x))) for x in (True, False)] == [True, False]
    assert m.bool_message(True) == theirs(dds.Bool(True))
    assert m.read_string(m.string_message("é")) == "é"
    entries = [
        dds.Status(2, "robot", "stop", "", [dds.KeyValue("a", "b")]),
        dds.Status(0, "other", "", "x", []),
    ]
    raw = theirs(dds.Diagnostics(dds.Header(dds.Time(1, 0), "f"), entries))
    assert searched(raw, "robot") == (2, "stop")
    assert searched(raw, "other") == (0, "")
    assert searched(raw, "a") is None
    ours = m.diagnostics(1.0, "robot", 2, "stop")
    one = dds.Diagnostics(dds.Header(dds.Time(1, 0), ""), [dds.Status(2, "robot", "stop", "", [])])
    assert ours == theirs(one)


def searched(raw: bytes, name: str) -> tuple[int, str] | None:
    """Return an entry of a DiagnosticArray; None where it is not there."""
    return next((x for x in m.search_diagnostics(raw, name) if x is not None), None)


def test_diagnostics_are_read_a_field_at_a_time() -> None:
    """However many entries and values others put before the one that is looked for."""
    values = [dds.KeyValue("k", "v")] * 30
    entries = [dds.Status(0, f"node {k}", "m", "", values) for k in range(20)]
    entries.append(dds.Status(2, "robot", "stop", "", []))
    raw = theirs(dds.Diagnostics(dds.Header(dds.Time(1, 0), ""), entries))
    steps = list(m.search_diagnostics(raw, "robot"))
    assert steps == [*[None] * (20 * 31), (2, "stop")]
    assert list(m.search_diagnostics(raw, "none of them")) == []


#: Valid messages, and what reads and writes each again.
VALID: tuple[tuple[Any, bytes, Callable[[Any], bytes]], ...] = (
    (
        m.read_joint_state,
        m.joint_state(1.5, ("a", "bc"), np.ones(2), np.ones(2)),
        lambda x: m.joint_state(x.t, x.names, x.q, x.dq),
    ),
    (
        m.read_trajectory,
        m.trajectory(1.5, ("a", "bc"), np.ones((4, 2))),
        lambda x: m.trajectory(*x),
    ),
    (m.read_array, m.array_message(np.arange(3.0), 1.5), lambda x: m.array_message(x[1], x[0])),
    (m.read_point, m.pose(1.5, "map", np.ones(3)), lambda x: m.point(*x)),
    (m.read_flag, m.bool_message(True), m.bool_message),
    (m.read_string, m.string_message("robot"), m.string_message),
    (
        lambda raw: searched(raw, "robot"),
        m.diagnostics(1.5, "robot", 2, "stop"),
        lambda x: m.diagnostics(0.0, "robot", *x) if x else b"",
    ),
)


@st.composite
def mutated(draw: st.DrawFn, whole: bytes) -> bytes:
    """Return a valid message with some bytes changed, cut, doubled or put in; its head is right."""
    raw = bytearray(whole)
    for _ in range(draw(st.integers(1, 3))):
        at = draw(st.integers(4, max(len(raw) - 1, 4)))
        change, word = draw(st.sampled_from(["byte", "word", "cut", "more"])), draw(WORDS)
        if change == "byte":
            raw[at : at + 1] = word[:1]
        elif change == "word":
            at -= at % 4
            raw[at : at + 4] = word
        elif change == "cut":
            del raw[at:]
        else:
            raw[at:at] = word
    return bytes(raw)


WORDS = st.one_of(
    st.binary(min_size=4, max_size=4),
    st.sampled_from([0, 1, 2, 3, 5, 8, 4096, 4097, 2**31 - 1, 2**31, 2**32 - 1]).map(
        lambda x: x.to_bytes(4, "little")
    ),
)


@pytest.mark.parametrize("k", range(len(VALID)))
def test_what_is_no_message_is_refused_and_nothing_else_raises(k: int) -> None:
    """A changed message is refused in one line, or is another one that reads back the same."""
    read, whole, write = VALID[k]
    ends = Counter[str]()

    @settings(max_examples=150, deadline=None, database=None)
    @given(mutated(whole))
    def check(raw: bytes) -> None:
        try:
            found = read(raw)
        except InputError:
            ends["refused"] += 1
            return
        ends["read"] += 1
        if found is not None:
            once = read(write(found))  # a time in range, a text that is one
            assert repr(read(write(once))) == repr(once)

    check()
    assert ends["read"] >= 5, ends  # so both ways are tried
    assert ends["refused"] >= 5 or read is m.read_flag, ends


def test_every_cut_of_a_message_is_refused() -> None:
    """A message that lacks its end is not taken for a shorter one."""
    whole = m.joint_state(1.0, ("a", "bc"), np.ones(2), np.ones(2))
    for k in range(len(whole) - 4):
        with pytest.raises(InputError):
            m.read_joint_state(whole[:k])


def test_big_endian_is_read() -> None:
    """As hosts of the other order write it."""
    assert Reader(b"\x00\x00\x00\x00" + (7).to_bytes(4, "big")).uint32() == 7
    assert Writer().uint32(7).done()[4:] == (7).to_bytes(4, "little")
