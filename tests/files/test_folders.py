"""Output folders: what is not provably ours is never gone, whatever it is called."""

import json
import os
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mitt.core.errors import InputError
from mitt.io.writing import (
    Leaves,
    check_folder,
    check_ours,
    claim_folder,
    clear_temporary,
    new_folder,
    overlaps,
    wrote,
)
from mitt.lab.trials.score import CATCH

LEAVES = Leaves(
    command="mitt try",
    schema="mitt.try/1",
    manifests=("try.json",),
    names=(
        r"try\.json",
        r"page\.html",
        r"maps/map-[0-9a-f]{4}\.json",
        r"parts/part-\d{2}\.parquet",
    ),
)
MANIFEST = json.dumps({"schema": "mitt.try/1"}, indent=1)
OURS = {
    "try.json": MANIFEST,
    "page.html": "<!doctype html>\n<html>\n<title>mitt: it</title>",
    "maps/map-00ff.json": '{"schema": "mitt.map/2"}',
    "parts/part-01.parquet": "PAR1",
    "parts/.part-02.parquet.0a1b2c3d": "half",
}
#: Names of ours and of others, and contents of ours and of others.
NAMES = (
    *OURS,
    "notes.txt",
    "maps/mine.json",
    "maps/map-00fg.json",
    "parts/part-1.parquet",
    ".git/config",
    "parts/.git",
    "page.html.bak",
    ".page.html.swp",
    "flights/mine.csv",
    "maps/deep/map-00ff.json",
    "try.json.old",
)
FOREIGN = ("mine", "", '{"schema": "other/1"}', "<!doctype html><title>my page</title>")


def put(folder: Path, name: str, content: str) -> None:
    """Write a file."""
    (folder / name).parent.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text(content)


def files_of(folder: Path) -> dict[str, str]:
    """Return what a folder holds."""
    found = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_text() for path in found}


@settings(deadline=None, max_examples=150)
@given(data=st.data())
def test_nothing_foreign_is_ever_gone(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    """Any mixture of files, ours and foreign, with the proof or without: foreign ones stay.

    Where the folder is refused nothing at all has changed.
    """
    folder = tmp_path_factory.mktemp("out")
    names = data.draw(st.lists(st.sampled_from(NAMES), unique=True))
    for name in names:
        content = data.draw(st.sampled_from((*FOREIGN, *[OURS[x] for x in OURS if x == name])))
        put(folder, name, content)
    before = files_of(folder)
    proven = before.get("try.json") == MANIFEST
    can_be_ours = {name for name, content in before.items() if OURS.get(name) == content}
    tables = {"parts/part-01.parquet", "parts/.part-02.parquet.0a1b2c3d"}
    ours = (can_be_ours | (tables & before.keys())) if proven else set()
    if {name for name in before if LEAVES.calls(name)} - ours:
        with pytest.raises(InputError):
            claim_folder(folder, LEAVES, overwrite=True)
        assert files_of(folder) == before
    else:
        claim_folder(folder, LEAVES, overwrite=True)
        assert files_of(folder) == {k: x for k, x in before.items() if k not in ours}


def test_a_folder_with_files_needs_the_word(tmp_path: Path) -> None:
    """Without it nothing is touched; with it what a run left is gone, and its empty folders."""
    for name, content in OURS.items():
        put(tmp_path, name, content)
    with pytest.raises(InputError, match="--overwrite"):
        claim_folder(tmp_path, LEAVES, overwrite=False)
    assert files_of(tmp_path) == OURS
    claim_folder(tmp_path, LEAVES, overwrite=True)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["page.html", "maps", "parts", "try.json", "maps/map-00ff.json"])
def test_a_link_among_our_names_is_neither_removed_nor_followed(tmp_path: Path, name: str) -> None:
    """To a folder, to a file, to nothing: the folder is refused as it is."""
    out, elsewhere = tmp_path / "out", tmp_path / "elsewhere"
    for file, content in OURS.items():
        put(out, file, content)
        put(elsewhere, file, content)
    before = files_of(elsewhere)
    for target in (elsewhere / name, tmp_path / "nothing"):
        place = out / name
        if place.is_dir() and not place.is_symlink():
            for inner in place.iterdir():
                inner.unlink()
            place.rmdir()
        else:
            place.unlink()
        place.symlink_to(target)
        with pytest.raises(InputError, match=r"link|did not write"):
            claim_folder(out, LEAVES, overwrite=True)
        assert place.is_symlink()
        assert files_of(elsewhere) == before


def test_what_is_read_stays(tmp_path: Path) -> None:
    """An input that is called as one of ours, and lies there, is not removed."""
    for name, content in OURS.items():
        put(tmp_path, name, content)
    claim_folder(tmp_path, LEAVES, overwrite=True, keep=[tmp_path / "maps" / "map-00ff.json"])
    assert files_of(tmp_path).keys() == {"maps/map-00ff.json"}


def test_what_another_run_did_not_make_is_in_the_way(tmp_path: Path) -> None:
    """A name that fits, in a folder of ours, but of no throw that was made."""
    put(tmp_path, "try.json", MANIFEST)
    put(tmp_path, "parts/part-07.parquet", "mine")
    with pytest.raises(InputError, match="part-07"):
        claim_folder(tmp_path, LEAVES, overwrite=True, made=lambda name: "07" not in name)
    assert (tmp_path / "parts" / "part-07.parquet").read_text() == "mine"


def test_half_written_files_of_ours_alone_are_swept_away(tmp_path: Path) -> None:
    """By their whole name: no other hidden file, no folder."""
    mine = (
        ".git/x",
        "parts/.hidden",
        "parts/.part-01.parquet.swp",
        ".page.html.swp",
        "parts/.notes.parquet.0a1b2c3d",
    )
    for name in (*mine, "parts/.part-02.parquet.0a1b2c3d", ".page.html.0a1b2c3d"):
        put(tmp_path, name, "x")
    clear_temporary(tmp_path, LEAVES)
    assert files_of(tmp_path).keys() == set(mine)


def test_a_new_folder_counts_up(tmp_path: Path) -> None:
    """-2, -3 where there are files; a lock alone, or an empty folder, is new."""
    base, seen = tmp_path / "0-direct", []
    for _ in range(3):
        seen.append(new_folder(base).name)
        put(tmp_path / seen[-1], "x", "x")
    assert seen == ["0-direct", "0-direct-2", "0-direct-3"]
    (tmp_path / "0-direct-4").mkdir()
    (tmp_path / "0-direct-4" / ".lock").touch()
    (tmp_path / "0-direct-5").symlink_to(tmp_path / "nothing")
    assert new_folder(base).name == "0-direct-4"
    put(tmp_path / "0-direct-4", "x", "x")
    assert new_folder(base).name == "0-direct-6"


def test_only_what_says_so_is_taken_for_ours(tmp_path: Path) -> None:
    """Pages and JSON by how they begin; the proof of a run is a schema, not a name."""
    for name, content in (("a.html", "<html>"), ("a.json", "{}"), ("a.mcap", "\x89MCAP0\r\n")):
        put(tmp_path, name, content)
        assert not wrote(tmp_path / name)
    put(tmp_path, "result.json", "{}")
    assert not CATCH.leaves.owns(tmp_path)
    with pytest.raises(InputError, match="did not write"):
        check_ours(tmp_path, CATCH.leaves)
    put(tmp_path, "result.json", '{\n "schema": "mitt.catch/1",\n')
    assert CATCH.leaves.owns(tmp_path)


def test_an_output_is_never_an_input(tmp_path: Path) -> None:
    """By the file that it is, whatever its path; also one of a folder of images that is read."""
    put(tmp_path, "a.csv", "x")
    os.link(tmp_path / "a.csv", tmp_path / "b.csv")
    (tmp_path / "here").symlink_to(tmp_path)
    put(tmp_path, "images/1.png", "x")
    for other in ("a.csv", "b.csv", "here/a.csv"):
        assert overlaps(tmp_path / other, tmp_path / "a.csv")
    assert overlaps(tmp_path / "images" / "1.png", tmp_path / "images")
    assert not overlaps(tmp_path / "images" / "2.png", tmp_path / "images")
    assert overlaps(tmp_path / "new.csv", tmp_path / "new.csv")
    assert not overlaps(tmp_path / "new.csv", Path("nul\0"))


def test_a_folder_in_a_file_is_refused_before_anything_is_made(tmp_path: Path) -> None:
    """However deep it would be; a folder that is not there yet is fine."""
    check_folder(tmp_path / "new/one", overwrite=False)
    (tmp_path / "file").write_text("x")
    for folder in ("file", "file/a", "file/a/b"):
        with pytest.raises(InputError, match="file, which is a file"):
            check_folder(tmp_path / folder, overwrite=True)
    assert [x.name for x in tmp_path.iterdir()] == ["file"]
