"""Files that somebody else wrote: read within bounds of size, kind and nesting, or refused."""

import os
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mitt.core.arm.arm import Arm
from mitt.core.errors import FileError
from mitt.core.map.mapping import DirectMap
from mitt.io.csv_table import header_of
from mitt.io.load import build_arm
from mitt.io.maps import read_map
from mitt.io.reading import MAX_JSON_BYTES, MAX_TOML_BYTES, read_bytes, read_json, read_toml
from mitt.io.rig import read_rig
from mitt.lab.trials.catch_study import read_catch_study
from mitt.lab.world.flights import read_flights
from mitt.lab.world.scene import read_scene
from mitt.lab.world.throws import read_throws
from mitt.robot.cameras.cameras import read_image
from mitt.robot.cameras.filtering import read_positions

GIGABYTE = 1_000_000_000
#: Memory that refusing a file may take, the largest table that is read included [bytes].
MOST_MEMORY = 250_000_000

READERS: dict[str, Callable[[Path, Arm], object]] = {
    ".toml scene": lambda path, _: read_scene(path),
    ".toml study": lambda path, _: read_catch_study(path, generators=("direct",)),
    ".toml rig": lambda path, _: read_rig(path),
    ".csv throws": lambda path, _: read_throws(path),
    ".csv flights": lambda path, _: read_flights(path),
    ".csv positions": lambda path, _: read_positions(path),
    ".csv header": lambda path, _: header_of(path),
    ".json": lambda path, _: read_json(path),
    ".json map": read_map,
    ".urdf": lambda path, _: build_arm(path, tip="hand", joints=["a"]),
    ".xml": lambda path, _: build_arm(path, tip="hand", joints=["a"]),
    ".png": lambda path, _: read_image(path),
}


def refused(read: Callable[[Path, Arm], object], path: Path, arm: Arm) -> None:
    """Hold a reader to an error of one line that names the file, in little memory."""
    tracemalloc.start()
    try:
        with pytest.raises(FileError) as caught:
            read(path, arm)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert str(caught.value).count(str(path)) == 1
    assert "\n" not in str(caught.value)
    assert peak < MOST_MEMORY


@pytest.mark.parametrize("kind", READERS)
def test_no_reader_takes_in_a_gigabyte_a_device_or_a_pipe(
    kind: str, arm: Arm, tmp_path: Path
) -> None:
    """A file of 1 GB, a link to a device without end, a pipe that nobody writes to, a folder."""
    name = f"x{kind.split(maxsplit=1)[0]}"
    large, device, pipe = (tmp_path / sub / name for sub in ("large", "device", "pipe"))
    for path in (large, device, pipe):
        path.parent.mkdir()
    with large.open("wb") as file:
        file.truncate(GIGABYTE)
    device.symlink_to("/dev/zero")
    os.mkfifo(pipe)
    for path in (large, device, pipe, tmp_path / "large" / ".." / "missing" / name):
        refused(READERS[kind], path, arm)


@pytest.mark.parametrize(
    "text",
    [
        "a" + 200_000 * ".a" + " = 1",
        "[a" + 200_000 * ".a" + "]",
        "[[" + 20 * "'a' . " + "a]]",
        "a" * 400_000 + " = 1",
        "'" + "a" * 400_000 + "' = 1",
        "a = " + 1000 * "[" + 1000 * "]",
        "a = " + 300 * "{a = " + "1" + 300 * "}",
        '"""' + 100_000 * '\\"""',
        "a = '''\n" + 300_000 * "x",
    ],
    ids=["dots", "table", "parts", "key", "quoted", "arrays", "tables", "string", "open"],
)
def test_toml_that_would_take_much_memory_is_refused(text: str, arm: Arm, tmp_path: Path) -> None:
    """Long dotted keys, deep brackets, strings without an end: one line, little memory."""
    path = tmp_path / "x.toml"
    path.write_text(text)
    assert len(text) < MAX_TOML_BYTES
    refused(lambda place, _: read_toml(place), path, arm)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a.b.c = 1.5", {"a": {"b": {"c": 1.5}}}),
        ("[a.b]\nc = [[1.0, 2.0], [3.0]] # x.y.z " + 20 * "[.", {"a": {"b": {"c": [[1, 2], [3]]}}}),
        ("a = '" + 20 * "[.{" + "'", {"a": 20 * "[.{"}),
        ('a = """' + 40 * "x.y\n[" + '\\""""', {"a": 40 * "x.y\n[" + '"'}),
        ("a = ['" + 300 * "x" + "']", {"a": [300 * "x"]}),
        ("a = " + 16 * "[" + 16 * "]", None),
    ],
)
def test_toml_that_only_looks_deep_is_read(text: str, said: object, tmp_path: Path) -> None:
    """Dots and brackets inside strings and comments do not count."""
    path = tmp_path / "x.toml"
    path.write_text(text)
    found = read_toml(path)
    assert said is None or found == said


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(content=st.binary(max_size=40), most=st.integers(0, 40))
def test_as_many_bytes_as_allowed_are_read_and_no_more(
    tmp_path: Path, content: bytes, most: int
) -> None:
    """All of a file that fits, an error for one that is a byte too long."""
    path = tmp_path / "x"
    path.write_bytes(content)
    if len(content) <= most:
        assert read_bytes(path, max_bytes=most) == content
    else:
        with pytest.raises(FileError, match="at most"):
            read_bytes(path, max_bytes=most)


def test_a_description_with_elements_too_deep_in_one_another_is_refused(
    arm: Arm, tmp_path: Path
) -> None:
    """A hundred thousand nested elements do not reach the parser of the library."""
    path = tmp_path / "deep.urdf"
    path.write_text("<robot name='a'>" + 100_000 * "<a>" + 100_000 * "</a>" + "</robot>")
    refused(READERS[".urdf"], path, arm)


def test_what_mitt_writes_is_within_the_bounds(plain: DirectMap) -> None:
    """A map of the WAM takes a small share of the largest JSON file that is read."""
    assert 25 * plain.H.size < 0.1 * MAX_JSON_BYTES
