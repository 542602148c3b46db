"""Files written whole or not at all; JSON that says what JSON may say; folders kept safe."""

import json
import os
import re
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mitt.core import checks
from mitt.core.errors import FileError, InputError, MittError
from mitt.io.reading import read_json, read_text
from mitt.io.writing import (
    LOCK,
    check_folder,
    file_name,
    make_folder,
    write_atomically,
    write_json,
    write_text,
)

LARGE = 10_000

values = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**53), 2**53)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(max_size=20),
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4)
    ),
    max_leaves=12,
)


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
        "",
        "{",
        "[1,",
        '{"a": NaN}',
        "Infinity",
        "-Infinity",
        '{"a": 1, "a": 2}',
        "[" * 100_000,
        "\ud800".encode("utf-8", "surrogatepass").decode("latin-1") + "{",
        "{'a': 1}",
        "1 2",
    ],
)
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
    """A file in a folder that does not exist yet can be written."""
    path = tmp_path / "a" / "b" / "x.json"
    write_json(path, {"a": 1})
    assert json.loads(path.read_text()) == {"a": 1}


@pytest.mark.parametrize("mask", [0o077, 0o022, 0o002, 0o027])
def test_a_file_has_the_rights_that_its_user_gives_to_new_files(tmp_path: Path, mask: int) -> None:
    """By the umask, as any other program's; also where an older file had others."""
    path = tmp_path / "x.json"
    before = os.umask(mask)
    try:
        for _ in range(2):
            write_json(path, {"a": 1})
            assert path.stat().st_mode & 0o777 == 0o666 & ~mask
            path.chmod(0o600)
    finally:
        os.umask(before)


HOSTILE = (
    "../../up",
    "/etc/passwd",
    "..",
    ".",
    "",
    "a/b",
    "a\\b",
    ".hidden",
    "nul\0",
    "line\nend",
    "x" * 300,
    "\u202e",
    "\ud800",
    "a b",
    "$(ls)",
    "~",
    "C:x",
    "é",
)


@given(
    names=st.lists(
        st.sampled_from(HOSTILE) | st.text(max_size=120), min_size=2, max_size=5, unique=True
    )
)
def test_a_name_from_elsewhere_never_leads_out_of_a_folder(names: list[str]) -> None:
    """Whatever it says it is one visible file, and two names are two files."""
    made = [file_name(name) for name in names]
    for name in made:
        assert re.fullmatch(r"[A-Za-z0-9_-][A-Za-z0-9._-]{0,110}", name)
        assert (Path("folder") / name).parent == Path("folder")
    assert len(set(made)) == len(made)


def test_a_plain_name_stays_as_it_is() -> None:
    """Letters, digits, dots, dashes and underlines."""
    assert [file_name(x) for x in ("direct", "wam-80v_2.1")] == ["direct", "wam-80v_2.1"]


@pytest.mark.parametrize("place", ["file/x", "file/deeper/x"])
def test_a_path_below_a_file_is_an_error_of_ours(tmp_path: Path, place: str) -> None:
    """Neither a file nor a folder can be made there: FileError, one line."""
    (tmp_path / "file").write_text("")
    with pytest.raises(FileError, match="wanted a file that can be written"):
        write_text(tmp_path / place, "x")
    with pytest.raises(MittError) as caught:
        make_folder(tmp_path / place)
    assert "\n" not in str(caught.value)


def test_the_working_folder_is_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """``.`` is a path as any other, and a folder of output; an empty text is none."""
    monkeypatch.chdir(tmp_path)
    for here in (".", Path(), "./"):
        assert checks.path("folder", here) == Path()
        check_folder(Path(here), overwrite=False)
    write_text(Path("./x.txt"), "x")
    with pytest.raises(InputError, match="empty"):
        check_folder(Path(), overwrite=False)
    with pytest.raises(InputError, match="an empty text"):
        checks.path("folder", "")
    for wrong in (Path(), ".", ".."):
        with pytest.raises(FileError):
            read_text(Path(wrong), max_bytes=9)
        with pytest.raises(FileError):
            write_text(Path(wrong), "x")
    assert [x.name for x in tmp_path.iterdir()] == ["x.txt"]


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
