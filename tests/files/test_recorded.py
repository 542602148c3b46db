"""Files that are cut, foreign, altered or hostile are refused in one line, and quickly."""

import contextlib
import re
import struct
import tracemalloc
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import zstandard
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Channel
from mcap.writer import LIBRARY_IDENTIFIER, CompressionType, Writer
from recorded_trials import CASES, Case, recorded
from soak.packing import MAGIC, chunk_of, records_of

from mitt.core.arm.arm import Arm
from mitt.core.errors import FileError
from mitt.io import messages as of
from mitt.io import recordings as recorded_file
from mitt.io.about import about_of
from mitt.io.cdr import encode_text
from mitt.io.recordings import ABOUT, Recorded


@pytest.fixture(scope="module")
def one(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recorded throw."""
    ((_, path),) = recorded(CASES[0], tmp_path_factory.mktemp("one"), throws=1, seed=5)
    return path


def _refused(path: Path) -> str:
    with pytest.raises(FileError) as caught:
        _ = Recorded(path).ticks
    text = str(caught.value)
    assert path.name in text
    assert "\n" not in text
    assert len(text) < 400
    return text


@pytest.mark.parametrize(
    "content", [b"", b"mine", b"\x89MCAP0\r\n", b"\0" * 1000, b"PK\x03\x04" * 99]
)
def test_what_is_no_recording_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "x.mcap").write_bytes(content)
    _refused(tmp_path / "x.mcap")


def test_folders_devices_and_files_that_are_not_there_are_refused(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "no.mcap", Path("/dev/zero")):
        _refused(path)


def test_a_foreign_mcap_file_is_refused(tmp_path: Path) -> None:
    """A sound file of another program, with topics of the same names, says nothing of a catcher."""
    path = tmp_path / "x.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.LZ4)
        writer.start()
        schema = writer.register_schema("mitt_msgs/msg/Tick", "ros2msg", b"float64 t\n")
        channel = writer.register_channel("/mitt/ticks", "cdr", schema)
        writer.add_message(channel, 0, b"\0" * 12, 0)
        writer.finish()
    said = _refused(path)
    for words in ("recording of mitt", ABOUT, "ROS 2 bag", "mitt track", LIBRARY_IDENTIFIER[:8]):
        assert words in said


@pytest.mark.parametrize("kind", list(CompressionType))
def test_a_ros_2_bag_is_called_one(tmp_path: Path, kind: CompressionType) -> None:
    """However it is packed, as a file and by its folder; a SQLite and a ROS 1 bag as well."""
    bag = tmp_path / "bag"
    bag.mkdir()
    (bag / "metadata.yaml").write_text("rosbag2_bagfile_information:\n  version: 8\n")
    with (bag / "bag_0.mcap").open("wb") as stream:
        writer = Writer(stream, compression=kind)
        writer.start(profile="ros2", library="rosbag2")
        schema = writer.register_schema("geometry_msgs/msg/PointStamped", "ros2msg", b"")
        channel = writer.register_channel("/ball", "cdr", schema)
        for k in range(1000):
            writer.add_message(channel, k, bytes(1000), k)
        writer.finish()
    (tmp_path / "x.db3").write_bytes(b"SQLite format 3\0" + bytes(100))
    (tmp_path / "x.bag").write_bytes(b"#ROSBAG V2.0\n" + bytes(100))
    for path in (bag, bag / "bag_0.mcap", tmp_path / "x.db3", tmp_path / "x.bag"):
        said = _refused(path)
        assert re.search("ROS [12] bag", said)
        assert "mitt track" in said


def _with(one: Path, path: Path, chunks: Iterable[bytes]) -> None:
    """Write the beginning of a recording, its topics and other chunks."""
    records = records_of(one.read_bytes())
    head = [(kind, data) for kind, data in records if kind in (1, 9, 12)]
    first = next(data for kind, data in records_of(one.read_bytes()) if kind == Opcode.CHUNK)
    rows = [struct.pack("<BQ", k, len(x)) + x for k, x in (*head, (Opcode.CHUNK, first))]
    path.write_bytes(MAGIC + b"".join([*rows, *chunks]))


def _message(channel: int, data: bytes) -> bytes:
    """Return the record of a message."""
    body = struct.pack("<HIQQ", channel, 0, 0, 0) + data
    return struct.pack("<BQ", Opcode.MESSAGE, len(body)) + body


def _channel(number: int, topic: str) -> bytes:
    """Return the record that makes a topic known."""
    record = RecordBuilder()
    Channel(id=number, topic=topic, message_encoding="cdr", metadata={}, schema_id=0).write(record)
    return bytes(record.end())


#: A message for every topic of which something is kept.
MESSAGES = {
    of.TICKS: of.ticks(3, 0).tobytes(),
    of.POINTS: of.points().tobytes(),
    of.CALLS: encode_text(""),
    of.TRUTH: of.point_stamped().tobytes(),
    of.EVENT: encode_text(""),
    of.PHASE: encode_text("x" * 9),
    of.STATES: b"",
    "/unknown": b"",
}


@pytest.mark.parametrize("topic", MESSAGES)
@pytest.mark.parametrize("size", [20_000, 200_000])
def test_a_small_file_that_swells_is_refused_whatever_it_is_full_of(
    one: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, topic: str, size: int
) -> None:
    """Many chunks or few, of any topic: what is unpacked and what is kept has one bound."""
    monkeypatch.setattr(recorded_file, "_FREE", 1_000_000)
    row = _message(500, MESSAGES[topic])
    chunk = chunk_of(_channel(500, topic) + row * (size // len(row)))
    path = tmp_path / "x.mcap"
    _with(one, path, [chunk] * 100)
    most = 1_000_000 + 100 * path.stat().st_size
    _with(one, path, [chunk] * (100 + 3 * most // size))
    assert "times its size" in _refused(path)


def test_a_file_that_states_to_swell_is_refused_before_anything_is_unpacked(
    one: Path, tmp_path: Path
) -> None:
    """By the sizes of all its chunks together; a size that is not true is refused as well."""
    path, packed = tmp_path / "x.mcap", chunk_of(bytes(40_000_000))
    _with(one, path, [packed] * 50)
    tracemalloc.start()
    said = _refused(path)
    assert tracemalloc.get_traced_memory()[1] < 30_000_000
    tracemalloc.stop()
    assert "times its size" in said
    small = bytearray(chunk_of(_message(1, b"") * 1000))
    for stated in (10, 10**6, 2**63):
        small[25:33] = struct.pack("<Q", stated)
        _with(one, path, [bytes(small)])
        _refused(path)


@pytest.mark.parametrize("case", [CASES[0], CASES[2]], ids=lambda case: case.name)
def test_a_recording_is_far_from_what_is_refused(tmp_path: Path, case: Case) -> None:
    """What it comes to is a third of the bound, or less, also with images."""
    ((_, path),) = recorded(case, tmp_path, throws=1, seed=6)
    assert Recorded(path)._spent < 100 * path.stat().st_size / 3


def test_records_and_chunks_that_claim_to_be_huge_are_refused(tmp_path: Path) -> None:
    """No memory is taken on a file's word: a record of 2^60 bytes, a text that unpacks to 1 GB."""
    path = tmp_path / "x.mcap"
    path.write_bytes(b"\x89MCAP0\r\n" + struct.pack("<BQ", 6, 2**60))
    assert "at most" in _refused(path)
    bomb = zstandard.ZstdCompressor().compress(bytes(10**9 // 4))
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        writer.add_attachment(0, 0, ABOUT, "application/zstd", bomb)
        writer.finish()
    assert "more than" in _refused(path)


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_file_with_bytes_changed_is_refused_or_read(
    one: Path, tmp_path: Path, data: st.DataObject
) -> None:
    """Whatever bytes are changed: a file error of one line, or a recording; nothing else."""
    content = bytearray(one.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(content) - 1))
        content[at] = data.draw(st.integers(0, 255))
    path = tmp_path / "x.mcap"
    path.write_bytes(content)
    with contextlib.suppress(FileError):
        assert len(Recorded(path).ticks) <= 2000


def test_what_a_recording_is_about_comes_back_to_the_bit(one: Path) -> None:
    """Arm, limits, maps, settings, cameras: written again, the text is the same."""
    about = Recorded(one).about
    again = about_of(about.text, place="x")
    assert again.text == about.text
    assert np.array_equal(again.maps[0].alpha, about.maps[0].alpha)
    assert again.settings == about.settings


def test_a_design_that_the_arm_carries_comes_back(one: Path) -> None:
    """An arm by name has one; a recording of it is read again."""
    about = Recorded(one).about
    model = replace(
        about.arm.model, design=replace(about.maps[0].design, coupling=((1.0, 2.0, 3.0),))
    )
    about = replace(about, arm=Arm(model, about.arm.limits))
    again = about_of(about.text, place="x")
    assert again.arm.model.design == model.design
    assert again.text == about.text


def test_an_altered_text_about_the_catcher_is_refused(one: Path) -> None:
    """A number of the arm changed by hand does not go with the digest."""
    text = Recorded(one).about.text
    mass = text.index('"mass": ') + 8
    for wrong in (text[:mass] + "9" + text[mass:], text[:-1], "[]", "{}", "null", "[" * 100_000):
        with pytest.raises(FileError):
            about_of(wrong, place="x")
