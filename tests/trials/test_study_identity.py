"""A study is what its files hold: from wherever they are named, and wherever they lie."""

import shutil
from pathlib import Path

import pytest

from mitt.lab.trials.study_folder import throw_name
from mitt.lab.trials.tasks import read_study

ROOT = Path(__file__).parents[2]
CATCH = (
    'name = "x"\nthrows = 2\ngenerators = ["direct"]\n[arm]\narm = "{}"\n'
    '[[conditions]]\nname = "a"\n'
)
MEET = (
    'task = "meet"\nname = "x"\ntrials = 2\ngenerators = ["direct"]\narm = "{}"\n'
    '[[conditions]]\nname = "belt"\ntarget = "belt"\nspeed = 0.3\n'
)


def _digests(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, file: str) -> set[str]:
    """Return the digests of a study whose arm is named in four ways, in two folders."""
    found = set()
    for folder in ("a", "b"):
        whole = str(tmp_path / folder / file)
        ways = (
            (folder, file),
            (".", f"{folder}/{file}"),
            (folder, f"../{folder}/{file}"),
            (".", whole),
        )
        for cwd, name in ways:
            monkeypatch.chdir(tmp_path / cwd)
            study = tmp_path / "study.toml"
            study.write_text(text.format(name))
            found.add(read_study(study).digest)
    return found


@pytest.mark.parametrize("text", [CATCH, MEET])
def test_the_place_of_a_file_is_no_part_of_a_study(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str
) -> None:
    """But what it holds is."""
    source = ROOT / "src" / "mitt" / "data" / "designs" / "ur5e.toml"
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        shutil.copy(source, tmp_path / folder / "my.toml")
    same = _digests(tmp_path, monkeypatch, text, "my.toml")
    assert len(same) == 1
    for folder in ("a", "b"):
        with (tmp_path / folder / "my.toml").open("a") as file:
            file.write("# another\n")
    assert not same & _digests(tmp_path, monkeypatch, text, "my.toml")


def test_files_of_two_cells_never_share_a_name() -> None:
    """Names with hyphens, and such as have to be changed to be names of files."""
    names = ("line", "line-compensated", "compensated-x", "x", "a+b", "a b", "a_b", "-", "+", "x-1")
    made = [throw_name(generator, condition) for generator in names for condition in names]
    assert len(set(made)) == len(made)
