"""Recordings come back number for number through mcap_ros2's own decoder."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from mitt.core.errors import FileError, ShapeError
from mitt.core.signals import Array
from mitt.io import messages as of
from mitt.io.messages import BRAKES, ESTIMATE, EVENT, PHASE, TICKS, TRUTH
from mitt.io.recordings import METADATA, Heading, Notice, Recording, Track, write_recording
from mitt.io.robot_description import LinkFrame

_NS = 1e-9


def _frames(n: int) -> tuple[LinkFrame, ...]:
    """Return a chain of n frames that turn about z, 0.1 m apart, and one that stands at its end."""
    names, still = ("world", *(f"l{i}" for i in range(n)), "tip"), (0.0, 0.0, 0.0)
    return tuple(
        LinkFrame(
            name=name,
            parent=parent,
            place=(0.1, 0.0, 0.0),
            turn=(0.0, 0.0, 0.0, 1.0),
            axis=still if name == "tip" else (0.0, 0.0, 1.0),
            follows=min(i, n - 1),
        )
        for i, (parent, name) in enumerate(pairwise(names))
    )


def _recording(k: int, n: int, seed: int) -> Recording:
    """Return a recording of random numbers."""
    rng = np.random.default_rng(seed)
    t: Array = np.arange(k, dtype=np.float64) * 1e-3
    ticks = np.repeat(of.ticks(n, 0), k)
    ticks["t"], ticks["brakes"] = t, t >= t[rng.integers(k)]
    for name in ("q", "dq", "command", "ball"):
        ticks[name] = rng.standard_normal(ticks[name].shape)
    ticks["out_tracked"] = np.arange(k) >= k // 2
    return Recording(
        heading=Heading(
            joints=tuple(f"j{i}" for i in range(n)),
            heads=0,
            shapes=(),
            about="{}",
            description="<robot/>",
            frames=_frames(n),
            radius=0.03,
            metadata={"seed": str(seed), "trial": '{"index": 0}'},
        ),
        ticks=ticks,
        tracks=(Track(topic=TRUTH, t=t[k // 2 :], r=rng.standard_normal((k - k // 2, 3))),),
        notices=(Notice(topic=EVENT, t=0.0, text="watch"), Notice(topic=EVENT, t=0.5, text="ä\n")),
    )


def _read(path: Path) -> tuple[dict[str, list[tuple[int, Any]]], dict[str, str]]:
    """Return the messages of each topic with their times [ns], and the metadata."""
    topics: dict[str, list[tuple[int, Any]]] = {}
    with path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages():
            topics.setdefault(channel.topic, []).append((message.log_time, decoded))
        notes = {x.name: x.metadata for x in reader.iter_metadata()}
    return topics, notes[METADATA]


@settings(max_examples=12, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(k=st.integers(1, 40), n=st.integers(1, 7), seed=st.integers(0, 99))
def test_numbers_come_back_exactly(tmp_path: Path, k: int, n: int, seed: int) -> None:
    """Every float64 survives: encoders, commands, torques, points, times, texts, metadata."""
    sent = _recording(k, n, seed)
    write_recording(tmp_path / "x.mcap", sent)
    topics, notes = _read(tmp_path / "x.mcap")
    states, commands, ticks = topics["/joint_states"], topics["/joint_commands"], sent.ticks
    told = ticks["command"].reshape(k, 4, n)
    np.testing.assert_array_equal([m.position for _, m in states], ticks["q"])
    np.testing.assert_array_equal([m.velocity for _, m in states], ticks["dq"])
    np.testing.assert_array_equal([m.position for _, m in commands], told[:, 0])
    np.testing.assert_array_equal([m.effort for _, m in commands], told[:, 3])
    assert [m.data for _, m in topics[BRAKES]] == ticks["brakes"].tolist()
    assert all(tuple(m.name) == sent.heading.joints for _, m in states + commands)
    points = [(m.point.x, m.point.y, m.point.z) for _, m in topics[TRUTH]]
    np.testing.assert_array_equal(points, sent.tracks[0].r)
    points = [(m.point.x, m.point.y, m.point.z) for _, m in topics[ESTIMATE]]
    np.testing.assert_array_equal(points, ticks["ball"][k // 2 :, :3])
    assert {m.header.frame_id for _, m in topics[TRUTH]} == {"world"}
    np.testing.assert_allclose([ns * _NS for ns, _ in states], ticks["t"], atol=_NS)
    stamps = [m.header.stamp.sec + m.header.stamp.nanosec * _NS for _, m in states]
    np.testing.assert_allclose(stamps, ticks["t"], atol=_NS)
    np.testing.assert_array_equal([m.t for _, m in topics[TICKS]], ticks["t"])
    assert [m.data for _, m in topics[EVENT]] == ["watch", "ä\n"]
    assert [m.data for _, m in topics[PHASE]] == ["watch"]
    assert notes == sent.heading.metadata


def test_each_tenth_tick_says_where_the_arm_and_the_ball_are(tmp_path: Path) -> None:
    """Transforms along the chain make up the pose of the tip; the ball has one once it is seen."""
    n, k = 4, 95
    sent = _recording(k, n, 3)
    write_recording(tmp_path / "x.mcap", sent)
    topics, _ = _read(tmp_path / "x.mcap")
    (_, description), (_, standing) = topics["/robot_description"][0], topics["/tf_static"][0]
    assert description.data == "<robot/>"
    (tip,) = standing.transforms
    assert (tip.header.frame_id, tip.child_frame_id) == ("l3", "tip")
    arm = [(ns, m) for ns, m in topics["/tf"] if len(m.transforms) == n]
    ball = [(ns, m.transforms[0]) for ns, m in topics["/tf"] if len(m.transforms) == 1]
    assert [ns for ns, _ in arm] == [10_000_000 * i for i in range(10)]
    for (_, message), q in zip(arm, sent.ticks["q"][::10], strict=True):
        for transform, angle in zip(message.transforms, q, strict=True):
            r = transform.transform.rotation
            np.testing.assert_allclose(2.0 * np.arctan2(r.z, r.w), angle, atol=1e-12)
    assert [m.transform.translation.x for _, m in ball] == sent.ticks["ball"][50::10, 0].tolist()
    ((at, marker),) = topics["/ball/marker"]
    assert at == ball[0][0]
    assert (marker.header.frame_id, marker.type, marker.frame_locked) == ("ball", 2, True)
    assert (marker.scale.x, marker.scale.z, marker.color.a) == (0.06, 0.06, 1.0)


def test_the_same_recording_gives_the_same_bytes(tmp_path: Path) -> None:
    """Nothing of the clock or of the machine enters a file."""
    for name in ("a", "b"):
        write_recording(tmp_path / name, _recording(30, 3, 1))
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_messages_lie_in_the_order_of_time(tmp_path: Path) -> None:
    """A player that reads straight through sees time rise."""
    write_recording(tmp_path / "x.mcap", _recording(700, 2, 1))
    with (tmp_path / "x.mcap").open("rb") as stream:
        times = [m.log_time for *_, m in make_reader(stream).iter_messages(log_time_order=False)]
    assert times == sorted(times)


def test_topics_have_the_types_that_foxglove_knows(tmp_path: Path) -> None:
    """Schemas carry ROS 2's full names and say that they are ros2msg."""
    write_recording(tmp_path / "x.mcap", _recording(3, 2, 1))
    with (tmp_path / "x.mcap").open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    kinds = {c.topic: summary.schemas[c.schema_id] for c in summary.channels.values()}
    assert {topic: schema.name for topic, schema in kinds.items()} == {
        "/joint_states": "sensor_msgs/msg/JointState",
        "/joint_commands": "sensor_msgs/msg/JointState",
        "/brakes": "std_msgs/msg/Bool",
        ESTIMATE: "geometry_msgs/msg/PointStamped",
        TRUTH: "geometry_msgs/msg/PointStamped",
        PHASE: "std_msgs/msg/String",
        "/state": "std_msgs/msg/String",
        EVENT: "std_msgs/msg/String",
        TICKS: "mitt_msgs/msg/Tick",
        "/robot_description": "std_msgs/msg/String",
        "/tf": "tf2_msgs/msg/TFMessage",
        "/tf_static": "tf2_msgs/msg/TFMessage",
    }
    assert {schema.encoding for schema in kinds.values()} == {"ros2msg"}


def test_a_file_that_cannot_be_written_leaves_the_old_one(tmp_path: Path) -> None:
    """A folder in the way is refused in one line, and no temporary file stays behind."""
    (tmp_path / "x.mcap").mkdir()
    with pytest.raises(FileError, match="can be written"):
        write_recording(tmp_path / "x.mcap", _recording(3, 2, 1))
    assert [x.name for x in tmp_path.iterdir()] == ["x.mcap"]


def test_points_that_do_not_go_with_their_times_are_refused() -> None:
    """The shapes are checked when a recording is put together, not when it is written."""
    with pytest.raises(ShapeError, match=TRUTH):
        Track(topic=TRUTH, t=np.zeros(3), r=np.zeros((2, 3)))
