"""Files written whole or not at all; JSON that says what JSON may say; folders kept safe."""

import json
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mitt.errors import FileError, InputError, MittError
from mitt.files.files import (
    LOCK,
    check_folder,
    claim_folder,
    read_json,
    write_atomically,
    write_json,
    write_text,
)

LARGE = 10_000

values = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**53), 2**53) | st.floats(allow_nan=False,
    allow_infinity=False) | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner,
    max_size=4), max_leaves=12,
)  # fmt: skip


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(value=values)
def test_json_comes_back_as_it_went(tmp_path: Path, value: object) -> None:
    """Every finite value survives writing and reading to the bit."""
    path = tmp_path / "x.json"
    write_json(path, value)
    assert read_json(path, max_bytes=1_000_000) == value


@pytest.mark.parametrize("bad", [float("nan"), float("inf"), -float("inf")])
def test_numbers_that_json_does_not_have_are_not_written(tmp_path: Path, bad: float) -> None:
    """NaN and infinity raise, and leave neither the file nor a temporary one."""
    with pytest.raises(ValueError, match="JSON"):
        write_json(tmp_path / "x.json", {"a": [bad]})
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "text",
    [
        "", "{", "[1,", '{"a": NaN}', "Infinity", "-Infinity", '{"a": 1, "a": 2}', "[" * 100_000,
        "\ud800".encode("utf-8", "surrogatepass").decode("latin-1") + "{", "{'a': 1}", "1 2",
    ],
)  # fmt: skip
def test_what_is_no_json_is_refused_in_one_line(tmp_path: Path, text: str) -> None:
    """Cut short, NaN, repeated keys, endless nesting: a FileError that names the file."""
    path = tmp_path / "x.json"
    path.write_text(text)
    with pytest.raises(FileError) as caught:
        read_json(path, max_bytes=1_000_000)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_files_that_cannot_be_read_are_refused(tmp_path: Path) -> None:
    """Missing, a folder, too large, not text."""
    large, binary = tmp_path / "large.json", tmp_path / "binary.json"
    large.write_text("1" * (LARGE + 1))
    binary.write_bytes(b"\xff\xfe{}")
    for path in (tmp_path / "missing.json", tmp_path, large, binary):
        with pytest.raises(FileError):
            read_json(path, max_bytes=LARGE)


def test_a_failing_write_leaves_the_old_file_and_no_other(tmp_path: Path) -> None:
    """Half-written and failed: what stood there stands there, the temporary file is gone."""
    path = tmp_path / "x.json"
    write_text(path, "old")

    def fail(temporary: Path) -> None:
        temporary.write_text("half")
        raise OSError(28, "No space left on device")

    with pytest.raises(FileError, match="No space left"):
        write_atomically(path, fail)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_an_interrupt_while_writing_leaves_the_old_file(tmp_path: Path) -> None:
    """Ctrl-C in the middle of a write: the old file, nothing else."""
    path = tmp_path / "x.json"
    write_text(path, "old")

    def interrupt(temporary: Path) -> None:
        temporary.write_text("half")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_atomically(path, interrupt)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_folders_on_the_way_are_made(tmp_path: Path) -> None:
    """A file in a folder that does not exist yet can be written, readable for all."""
    path = tmp_path / "a" / "b" / "x.json"
    write_json(path, {"a": 1})
    assert json.loads(path.read_text()) == {"a": 1}
    assert path.stat().st_mode & 0o777 == 0o644


@pytest.mark.parametrize("place", ["file/x", "file/deeper/x"])
def test_a_path_below_a_file_is_an_error_of_ours(tmp_path: Path, place: str) -> None:
    """Neither a file nor a folder can be made there: FileError, one line."""
    (tmp_path / "file").write_text("")
    with pytest.raises(FileError, match="wanted a file that can be written"):
        write_text(tmp_path / place, "x")
    with pytest.raises(MittError) as caught:
        claim_folder(tmp_path / place, overwrite=True, ours=())
    assert "\n" not in str(caught.value)


def test_a_folder_with_files_needs_overwrite(tmp_path: Path) -> None:
    """Refused without the word; with it only our names go, links are not followed."""
    (tmp_path / "result.json").write_text("old")
    (tmp_path / "recordings").mkdir()
    (tmp_path / "recordings" / "x.mcap").write_text("old")
    (tmp_path / "mine.txt").write_text("mine")
    ours = ("result.json", "recordings")
    with pytest.raises(InputError, match="--overwrite"):
        claim_folder(tmp_path, overwrite=False, ours=ours)
    assert (tmp_path / "result.json").exists()
    claim_folder(tmp_path, overwrite=True, ours=ours)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


def test_a_link_among_our_names_is_removed_not_followed(tmp_path: Path) -> None:
    """A folder of ours that is a link elsewhere: the link goes, what it points to stays."""
    out, elsewhere = tmp_path / "out", tmp_path / "elsewhere"
    out.mkdir()
    elsewhere.mkdir()
    (elsewhere / "precious.txt").write_text("precious")
    (out / "recordings").symlink_to(elsewhere)
    claim_folder(out, overwrite=True, ours=("recordings",))
    assert (elsewhere / "precious.txt").exists()
    assert not (out / "recordings").exists()


def test_a_lock_alone_does_not_fill_a_folder(tmp_path: Path) -> None:
    """A folder that a study has locked is still new; with another file in it, it is not."""
    (tmp_path / LOCK).touch()
    check_folder(tmp_path, overwrite=False)
    (tmp_path / "mine").touch()
    with pytest.raises(InputError, match="empty"):
        check_folder(tmp_path, overwrite=False)


def test_checking_a_folder_touches_nothing(tmp_path: Path) -> None:
    """Neither the folder nor its parents are made; a file in its place is refused."""
    check_folder(tmp_path / "a" / "b", overwrite=False)
    assert not list(tmp_path.iterdir())
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="a file"):
        check_folder(tmp_path / "file", overwrite=True)
