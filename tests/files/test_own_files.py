"""What a user has stays: each place that writes is listed here, and each output of each command."""

import ast
import os
from collections import defaultdict
from pathlib import Path

import pytest

import mitt
from mitt.cli.main import main
from mitt.core.errors import InputError
from mitt.io.writing import check_own, own_file, remove_own

PACKAGE = Path(mitt.__file__).parent
SCHEMA = "mitt.search/1"
#: Calls by which a file or a folder is made, changed, moved or removed.
CHANGES = {
    "chmod",
    "copy2",
    "copyfile",
    "copytree",
    "ftruncate",
    "hardlink_to",
    "link",
    "makedirs",
    "memfd_create",
    "mkdir",
    "mkdtemp",
    "mkfifo",
    "mknod",
    "mkstemp",
    "NamedTemporaryFile",
    "removedirs",
    "rename",
    "renames",
    "rmdir",
    "rmtree",
    "SpooledTemporaryFile",
    "symlink",
    "symlink_to",
    "TemporaryDirectory",
    "TemporaryFile",
    "touch",
    "truncate",
    "unlink",
    "write_bytes",
    "write_text",
}
#: Functions of ``io/writing.py`` that replace what has the name: who calls them has asked first.
REPLACES = {"write_atomically", "write_bytes", "write_json", "write_text", "temporary_beside"}
#: Where else the system is asked, and why nothing of a user can be lost there.
SYSTEM = {
    "robot/cameras/video_writer.py VideoWriter.__init__": "a temporary file; check_new_files",
    "robot/cameras/video_writer.py VideoWriter.__exit__": "its own temporary file; check_new_files",
    "robot/cell/frames.py FrameWriter.__init__": "without a name, then a link that must be new",
    "robot/cell/frames.py FrameWriter._remove_left": "its number is ours, nobody holds its lock",
    "robot/cell/frames.py FrameWriter.close": "the very file that was opened",
    "robot/cell/frames.py FrameReader.__init__": "reads",
    "robot/cell/exchange.py Exchange.__init__": "memory without a name",
    "robot/cell/exchange.py exchange_pair": "memory without a name",
    "robot/cell/recorder.py Ring.new": "memory without a name",
    "robot/cell/recorder.py recorder_main": "a file that must be new",
    "cli/main.py _open_streams": "the null device",
    "cli/main.py _give_up": "the null device",
    "lab/design/search_jobs.py Answers.open": "what own_file opened",
    "core/errors.py heard": "a file without a name",
    "io/recordings.py _fill": "the temporary file of write_atomically",
    "io/recordings.py Recorded._opened": "reads",
    "core/kernels.py _is_writable": "the folder of compiled kernels; a file without a name",
    "core/kernels.py _delete_old": "compiled kernels, in a folder that only those have; no link",
    "io/reading.py read_bytes": "reads",
    "lab/report/__init__.py": "a new temporary folder",
    "lab/trials/journal.py Journal.__init__": "a file that must be new",
    "lab/trials/study_run.py record_trial": "a new temporary folder",
    "lab/trials/study_run.py _is_done": "a part of this study that is not whole, in its own folder",
}
#: Who writes by the functions of ``io/writing.py``, and who has asked before.
WRITERS = {
    "robot/cameras/filtering.py": "cli: check_new_files",
    "robot/cameras/video_writer.py": "cli: check_new_files",
    "cli/measuring.py": "a run of ours that has no result",
    "io/arm_file.py": "cli: check_new_files",
    "io/measured_cell.py": "cli: check_new_files",
    "io/maps.py": "cli: check_new_files or claim_folder; the cache of maps",
    "io/recordings.py": "claim_folder",
    "io/rig.py": "cli: check_new_files",
    "lab/report/design_page.py": "cli: check_new_files",
    "lab/report/pictures.py": "cli: check_new_files or claim_folder",
    "lab/report/recording_page.py": "cli: check_ours",
    "lab/report/outputs.py": "claim_folder",
    "lab/report/study_page.py": "cli: check_own; replays in the folder of the study",
    "lab/trials/journal.py": "claim_folder",
    "lab/trials/study_folder.py": "claim_folder",
    "lab/trials/study_run.py": "Folder.claim",
    "lab/trials/task_run.py": "claim_folder",
}


def _called(call: ast.Call) -> str:
    """Return the last name of what is called."""
    of = call.func
    return of.attr if isinstance(of, ast.Attribute) else of.id if isinstance(of, ast.Name) else ""


def _changes(call: ast.Call) -> bool:
    """Say whether a call may change what is on a disk; reading by ``os.open`` counts, too."""
    name, of = _called(call), call.func
    module = of.value.id if isinstance(of, ast.Attribute) and isinstance(of.value, ast.Name) else ""
    if name == "open":
        said = [
            x.value
            for x in (*call.args, *(k.value for k in call.keywords))
            if isinstance(x, ast.Constant)
        ]
        return module == "os" or any(set(str(x)) & set("wax+") and len(str(x)) <= 3 for x in said)
    if name in ("replace", "remove"):  # of texts and lists there are many
        return module in ("os", "shutil") or (
            name == "replace"
            and isinstance(of, ast.Attribute)
            and len(call.args) == 1
            and not call.keywords
        )
    if name in ("move", "copy"):
        return module == "shutil"
    return name in CHANGES and not (name in REPLACES and isinstance(of, ast.Name))


def _calls(tree: ast.AST, place: tuple[str, ...]) -> list[tuple[str, ast.Call]]:
    """Return all calls of a module, each with the function that it stands in."""
    found = []
    for node in ast.iter_child_nodes(tree):
        inner = place
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            inner = (*place, node.name)
        if isinstance(node, ast.Call):
            found.append((".".join(place), node))
        found += _calls(node, inner)
    return found


def test_each_place_that_writes_is_listed_with_what_keeps_a_users_files() -> None:
    """A new one, and one that is gone, has to be said here; ``io/writing.py`` holds the rule."""
    system, writers = set[str](), defaultdict[str, set[str]](set)
    for path in sorted(PACKAGE.rglob("*.py")):
        name = path.relative_to(PACKAGE).as_posix()
        if name == "io/writing.py":
            continue
        for place, call in _calls(ast.parse(path.read_text(encoding="utf-8")), ()):
            if _changes(call):
                system.add(f"{name} {place}".strip())
            elif _called(call) in REPLACES:
                writers[name].add(_called(call))
    assert system == set(SYSTEM)
    assert set(writers) == set(WRITERS)


def put(kind: str, path: Path) -> Path:
    """Put something of a user's where an output would be; return what holds the text."""
    held = path
    if kind == "link":
        held = path.with_name("held.txt")
        path.symlink_to(held)
    if kind in ("file", "link"):
        held.write_text("mine")
    if kind == "dangling":
        held = path.with_name("nowhere")
        path.symlink_to(held)
    return held


@pytest.mark.parametrize("kind", ["file", "link", "dangling"])
@pytest.mark.parametrize("more", [(), ("--overwrite",), ("--resume",)])
@pytest.mark.parametrize("name", ["d.search.jsonl", "d.html", "d.toml"])
def test_a_design_leaves_what_is_beside_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], kind: str, more: tuple[str, ...], name: str
) -> None:
    """Answers, page and arm file: refused in one line before the search, nothing is touched."""
    path = tmp_path / name
    held = put(kind, path)
    words = ["design", "wam", "--effort", "quick", "--workers", "1"]
    assert main([*words, "--out", str(tmp_path / "d.toml"), *more]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert path.is_symlink() == (kind != "file")
    assert held.exists() == (kind != "dangling")
    assert kind == "dangling" or held.read_text() == "mine"
    assert len(list(tmp_path.iterdir())) == 1 + (kind == "link")


@pytest.mark.parametrize("kind", ["file", "link", "dangling"])
@pytest.mark.parametrize(
    "words", [["learn", "--out", "OUT.json"], ["learn", "--arm", "ur5e", "--out", "OUT.toml"]]
)
def test_a_named_output_is_replaced_only_where_mitt_wrote_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], kind: str, words: list[str]
) -> None:
    """With --overwrite as without, and for the check of it."""
    path = tmp_path / words[-1]
    held = put(kind, path)
    for more in (["--overwrite"], [], ["--overwrite", "--check"]):
        assert main([*words[:-1], str(path), *more]) == 2
        assert capsys.readouterr().err.count("\n") == 1
        assert path.is_symlink() == (kind != "file")
        assert kind == "dangling" or held.read_text() == "mine"


def test_a_file_of_ours_is_gone_on_with_and_another_is_not(tmp_path: Path) -> None:
    """New, empty, ours; not a text, a link, a pipe, a folder. What took its name is not removed."""
    path = tmp_path / "a.jsonl"
    for content in (None, b"", b'{"schema": "mitt.search/1", "version": "0"}\n'):
        if content is not None:
            path.write_bytes(content)
        os.close(own_file(path, SCHEMA))
        assert path.read_bytes() == (content or b"")
    for content in (b"mine", b'{"schema": "mitt.map/2"}', b"\0" * 10):
        path.write_bytes(content)
        with pytest.raises(InputError, match="which mitt did not write"):
            own_file(path, SCHEMA)
        assert path.read_bytes() == content
    path.unlink()
    os.mkfifo(path)
    with pytest.raises(InputError):
        own_file(path, SCHEMA)
    path.unlink()
    handle = own_file(path, SCHEMA)
    with pytest.raises(BlockingIOError):
        own_file(path, SCHEMA)
    path.unlink()
    path.write_text("mine")
    remove_own(path, handle)
    os.close(handle)
    assert path.read_text() == "mine"
    path.write_text("")
    handle = own_file(path, SCHEMA)
    remove_own(path, handle)
    os.close(handle)
    assert not path.exists()
    path.symlink_to(tmp_path / "nowhere")
    for refuse in (lambda: own_file(path, SCHEMA), lambda: check_own("--out", path)):
        with pytest.raises(InputError, match="a link"):
            refuse()
    assert path.is_symlink()
