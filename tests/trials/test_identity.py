"""A study is known by what the files of its arms hold, in its folder and in each worker."""

import json
from collections.abc import Mapping
from dataclasses import replace
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest
from small_study import TEXT, ready, write_study
from soak.samples import URDF

from mitt.core.errors import FileError, InputError
from mitt.core.map.learn import Learned
from mitt.io.reading import changed_file, noted, read_bytes
from mitt.lab.trials import registry
from mitt.lab.trials.catch_study import CatchStudy, throw_again
from mitt.lab.trials.study import Chunk, Material, Player
from mitt.lab.trials.study_folder import Folder
from mitt.lab.trials.study_run import ChunkError, all_chunks, run_chunk

ARM = """schema = "mitt.arm/1"
[arm]
file = "arm.urdf"
tip = "l3"
joints = ["j1", "j2", "j3"]
limits = "limits.toml"
[hand]
name = "none"
[throws]
speed = [5.0, 5.6]
"""
LIMITS = """schema = "mitt.limits/1"
[limits]
joints = ["j1", "j2", "j3"]
speed = [6.0, 6.0, 6.0]
"""
STL = (
    b"solid x\n"
    + b"".join(
        b"facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 0.1 0 0\nvertex 0 %s 0.1\nendloop\n"
        b"endfacet\n" % y
        for y in (b"0", b"0.1", b"0.2")
    )
    + b"endsolid x\n"
)
MESH = b'<link name="l3"><collision><geometry><mesh filename="l3.stl"/></geometry></collision>'
#: What makes the arm, and another content of each that is as good.
FILES: Mapping[str, tuple[bytes, bytes]] = {
    "arm.toml": (ARM.encode(), ARM.replace("5.6]", "7.1]").encode()),
    "arm.urdf": (URDF.replace(b'<link name="l3">', MESH), URDF.replace(b"1.5", b"1.6")),
    "l3.stl": (STL, STL.replace(b"0.2", b"0.3")),
    "limits.toml": (LIMITS.encode(), LIMITS.replace("6.0,", "5.0,", 1).encode()),
}


@pytest.fixture
def study(tmp_path: Path) -> CatchStudy:
    """A study of an arm of its own."""
    for name, (content, _) in FILES.items():
        (tmp_path / name).write_bytes(content)
    return _study(tmp_path)


def _study(folder: Path) -> CatchStudy:
    """Read the study."""
    arm = f'arm = {{ arm = "{folder / "arm.toml"}" }}\n'
    return write_study(folder, TEXT.replace('vision = "points"\n', 'vision = "points"\n' + arm))


def test_all_that_an_arm_is_read_from_is_known(study: CatchStudy) -> None:
    """Arm file, description, mesh and limits, by their digests, in the study and its manifest."""
    for condition in study.conditions:
        assert {Path(name).name for name in condition.arm_files} == set(FILES)
    again = CatchStudy.model_validate(json.loads(study.model_dump_json()))
    assert again.digest == study.digest


@pytest.mark.parametrize("name", FILES)
def test_a_study_does_not_go_on_with_another_content_of_a_file(
    study: CatchStudy, tmp_path: Path, name: str
) -> None:
    """Whichever it is: refused, and named."""
    folder = Folder(tmp_path / "out")
    folder.claim(study, resume=False, overwrite=False)
    folder.check(_study(tmp_path), resume=True)
    (tmp_path / name).write_bytes(FILES[name][1])
    with pytest.raises(InputError, match=name.replace(".", r"\.")):
        folder.check(_study(tmp_path), resume=True)


def _chunk(study: CatchStudy) -> Chunk:
    """Return a chunk of a study, whose map is not looked at before its arm."""
    return Chunk(
        number=0,
        study=study,
        player=Player("direct"),
        condition=study.conditions[0],
        start=0,
        stop=1,
        material=Material(map="{}"),
        notes=(),
    )


@pytest.mark.parametrize("name", FILES)
def test_a_worker_refuses_another_content_of_a_file(
    study: CatchStudy, tmp_path: Path, name: str
) -> None:
    """For a chunk, and for a throw that is made once more; also one that is not there any more."""
    chunk = _chunk(study)
    with pytest.raises(ChunkError, match="map of the study"):
        run_chunk(chunk)
    (tmp_path / name).write_bytes(FILES[name][1])
    with pytest.raises(ChunkError, match=name.replace(".", r"\.")):
        run_chunk(replace(chunk, material=Material(map="{ }")))
    with pytest.raises(FileError, match=name.replace(".", r"\.")):
        throw_again(replace(chunk, material=Material(map="{ }")), 0)


def test_a_worker_refuses_another_source_of_a_plug_in(
    study: CatchStudy, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is held to what the study was begun with, wherever it runs."""
    (tmp_path / "a_planner.py").write_text(
        "from mitt.lab.rivals.planned import make_quintic as f\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    point = EntryPoint("theirs", "a_planner:f", registry.GROUP)
    monkeypatch.setattr(registry, "entry_points", lambda **_: (point,))
    monkeypatch.setattr("mitt.lab.trials.catch_study._learned", lambda _: (None, None))
    plugins = {"theirs": "theirs 1.0, sources 0123"}
    made = study.model_copy(update={"plugins": plugins})
    chunk = replace(_chunk(made), player=Player("theirs"))
    with pytest.raises(ChunkError, match=r"sources 0123, got sources "):
        run_chunk(chunk)


def test_a_part_of_another_map_is_not_taken_for_done(tmp_path: Path, learned: Learned) -> None:
    """What a chunk was thrown with is part of what it is."""
    study = write_study(tmp_path, TEXT)
    folder = ready(tmp_path / "out", study, learned)
    one = next(all_chunks(study, folder, lambda *_: None))
    path = folder.map(study.conditions[0].arm)
    path.write_text(path.read_text().replace("\n", " "))
    two = next(all_chunks(study, folder, lambda *_: None))
    assert one.material.digest != two.material.digest


def test_files_are_told_apart_by_what_they_hold(tmp_path: Path) -> None:
    """Equal contents at other places are the same; one more, one less, another are not."""
    for name in ("a", "b", "c"):
        (tmp_path / name).write_text(name)
    (tmp_path / "a2").write_text("a")

    def read(*names: str) -> dict[str, str]:
        with noted() as found:
            for name in names:
                read_bytes(tmp_path / name, max_bytes=10)
        return found

    ab = read("a", "b")
    assert changed_file(ab, read("a2", "b")) == ""
    for names, said in ((("a", "c"), "c"), (("a",), "b"), (("a", "b", "c"), "c"), ((), "a")):
        assert changed_file(ab, read(*names)).endswith(said)
