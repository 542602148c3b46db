"""Other people's readers decode every topic: ``rosbags``, and ``mcap`` with its ROS 2 decoder."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from recorded_trials import CASES, recorded
from rosbags.highlevel import AnyReader

from mitt.io.reading import shipped_path
from mitt.io.recordings import Recorded

_TOPICS = {
    "/joint_states",
    "/joint_commands",
    "/brakes",
    "/ball/estimate",
    "/ball/truth",
    "/hand/catch_point",
    "/phase",
    "/state",
    "/events",
    "/mitt/ticks",
    "/robot_description",
    "/tf",
    "/tf_static",
    "/ball/marker",
}


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A throw with images, and one with points."""
    folder = tmp_path_factory.mktemp("files")
    cases = {case.name: case for case in CASES}
    return {
        name: path
        for name in ("images", "points")
        for _, path in recorded(cases[name], folder, throws=1, seed=6)
    }


@pytest.mark.parametrize("name", ["images", "points"])
def test_rosbags_reads_every_message(files: dict[str, Path], name: str) -> None:
    """From the definitions in the file alone: no type is known to it beforehand."""
    back, found = Recorded(files[name]), dict[str, int]()
    own = {
        "images": {"/mitt/frames", "/camera_0/image", "/camera_1/image"},
        "points": {"/mitt/points"},
    }[name]
    with AnyReader([files[name]]) as reader:
        for connection, _, raw in reader.messages():
            message: Any = reader.deserialize(raw, connection.msgtype)
            k = found.get(connection.topic, 0)
            found[connection.topic] = k + 1
            if connection.topic == "/mitt/ticks":
                assert message.t == back.ticks["t"][k]
                assert np.array_equal(message.command, back.ticks["command"][k])
                assert np.array_equal(message.sighting, back.ticks["sighting"][k])
            elif connection.topic == "/joint_states":
                assert np.array_equal(message.position, back.ticks["q"][k])
    assert set(found) == _TOPICS | own
    assert found["/mitt/ticks"] == found["/joint_commands"] == len(back.ticks)


def test_the_layout_for_foxglove_names_what_a_recording_has(files: dict[str, Path]) -> None:
    """Each topic that it shows is there, and each field of a plot is one of its message."""
    layout = json.loads(shipped_path("layouts", "foxglove", ".json").read_text())
    panels = layout["configById"].values()
    paths = [path["value"] for panel in panels for path in panel.get("paths", ())]
    shown = [topic for panel in panels for topic in panel.get("topics", ())]
    assert {*shown, *(path.partition(".")[0] for path in paths)} <= _TOPICS
    first = dict[str, Any]()
    with AnyReader([files["points"]]) as reader:
        for connection, _, raw in reader.messages():
            if connection.topic not in first:
                first[connection.topic] = reader.deserialize(raw, connection.msgtype)
    for path in paths:
        topic, _, fields = path.partition(".")
        found = first[topic]
        for name in fields.split("."):
            found = getattr(found, name.partition("[")[0])


def test_the_mcap_package_alone_reads_every_message(files: dict[str, Path]) -> None:
    """Images have the size of their camera, and the grey values that the catcher saw."""
    back = Recorded(files["images"])
    seen, shape = 0, back.about.shapes[0]
    with files["images"].open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages():
            if channel.topic != "/camera_0/image":
                continue
            assert (decoded.height, decoded.width) == shape
            mine = [f for f in back.frames(message.sequence) if f.camera == 0]
            assert any(bytes(decoded.data) == f.pixels.tobytes() for f in mine)
            seen += 1
    assert seen > 300
