"""Files that are cut, foreign, altered or hostile are refused in one line, and quickly."""

import contextlib
import struct
from pathlib import Path

import numpy as np
import pytest
import zstandard
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.writer import CompressionType, Writer
from recorded_trials import CASES, recorded

from mitt.errors import FileError
from mitt.files.about import about_of
from mitt.files.recorded import Recorded
from mitt.files.recording import ABOUT


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
    assert "zstd" in _refused(path)


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


def test_an_altered_text_about_the_catcher_is_refused(one: Path) -> None:
    """A number of the arm changed by hand does not go with the digest."""
    text = Recorded(one).about.text
    mass = text.index('"mass": ') + 8
    for wrong in (text[:mass] + "9" + text[mass:], text[:-1], "[]", "{}", "null", "[" * 100_000):
        with pytest.raises(FileError):
            about_of(wrong, place="x")
