"""Study files: what they spell out, and what is refused in one line."""

from pathlib import Path

import pytest
from small_study import GENERATORS, TEXT, write_study

from mitt.core.errors import InputError, MittError, UnknownNameError
from mitt.io.reading import shipped
from mitt.io.schema import merged
from mitt.lab.trials.catch_study import CatchStudy, read_catch_study
from mitt.lab.trials.registry import BUILT_IN
from mitt.lab.trials.study import extent, planned
from mitt.lab.trials.study_folder import Folder
from mitt.lab.trials.tasks import read_study
from mitt.lab.world.disturbances import Kick

ROOT = Path(__file__).parents[2]
#: Names that a registry with all rivals has.
EVERY = tuple(BUILT_IN)


def test_a_sweep_is_a_condition_a_value(study: CatchStudy) -> None:
    names = [(c.name, c.disturbance, c.value, c.unit) for c in study.conditions]
    assert names == [
        ("clean", "clean", None, ""),
        ("blind", "blind", None, ""),
        ("kick 1 m/s", "kick", 1.0, "m/s"),
    ]
    (kick,) = study.conditions[2].scene.faults
    assert kick == Kick(magnitude=1.0)


def test_settings_of_a_condition_stand_over_those_of_the_study(tmp_path: Path) -> None:
    text = TEXT + "scene.ball = { mass = 0.1 }\n[scene]\nball = { radius = 0.03, mass = 0.2 }\n"
    study = write_study(tmp_path, text)
    balls = [c.scene.ball for c in study.conditions]
    assert [(b.radius, b.mass) for b in balls] == [(0.03, 0.2), (0.03, 0.2), (0.03, 0.1)]


def test_merging_keeps_what_is_below_and_changes_neither() -> None:
    below, above = {"a": {"b": 1, "c": 2}, "d": 3}, {"a": {"c": 4}, "e": [5]}
    assert merged(below, above) == {"a": {"b": 1, "c": 4}, "d": 3, "e": [5]}
    assert below == {"a": {"b": 1, "c": 2}, "d": 3}


def test_the_digest_knows_all_that_decides_a_result_and_nothing_else(tmp_path: Path) -> None:
    first = write_study(tmp_path, TEXT)
    for change in (
        "seed = 500|seed = 501",
        "throws = 2|throws = 5",
        "magnitude = 0.0|share = 0.5, magnitude = 0.0",
        '"points"|"pixels"',
    ):
        old, new = change.split("|")
        assert write_study(tmp_path, TEXT.replace(old, new)).digest != first.digest
    about = write_study(tmp_path, 'about = "other words"\n' + TEXT)
    assert about.digest == first.digest


def test_a_folder_of_the_same_name_is_not_taken_for_the_study(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """``mitt study smoke --out smoke --resume``: the folder is the output, the study ships."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "smoke").mkdir()
    assert read_catch_study(Path("smoke"), generators=EVERY).name == "smoke"


def test_two_names_never_share_a_recording(tmp_path: Path) -> None:
    """Characters that a file's name had better not have are replaced, and names stay apart."""
    names = ("kick 1", "kick_1", "kick/1", "kick=1", "kick+1")
    paths = {Folder(tmp_path).recording("direct", name, 0) for name in names}
    assert len(paths) == len(names)
    assert Folder(tmp_path).recordings / "direct+kick_1-0.mcap" in paths


@pytest.mark.parametrize("name", shipped("studies"))
def test_studies_that_ship_can_be_read_by_name(name: str) -> None:
    study = read_study(Path(name))
    assert study.name == name
    assert study == read_study(ROOT / "studies" / f"{name}.toml")


def test_the_studies_that_ship_are_those_that_are_promised() -> None:
    assert set(shipped("studies")) >= {"smoke", "evidence", "paper"}
    smoke, evidence = (read_catch_study(Path(n), generators=EVERY) for n in ("smoke", "evidence"))
    assert (smoke.generators, len(smoke.conditions)) == (EVERY, 3)
    assert len(evidence.conditions) >= 20
    counts = evidence.conditions[0].counts
    rivals = [n for name, n in counts.items() if name != "clairvoyant"]
    assert min(rivals) >= 300


def test_a_study_says_how_large_it_is() -> None:
    smoke = read_catch_study(Path("smoke"), generators=EVERY)
    assert planned(smoke) == 8 * 3 * len(EVERY)
    assert extent(smoke, 1216) == f"{len(EVERY)} generators, 3 conditions, 1,216 throws"
    one = smoke.conditions[0].model_copy(update={"counts": {"direct": 1}})
    alone = smoke.model_copy(update={"conditions": (one,)})
    assert extent(alone, 1) == "1 generator, 1 condition, 1 throw"


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ('"unoptimised"|"oracle"', "one of direct, unoptimised"),
        ("throws = 2|throws = 0", "greater than or equal to 1"),
        ("throws = 2|throws = nan", "integer"),
        ("seed = 500|sead = 500", "seed"),
        ('name = "clean"|name = "../x"', "pattern"),
        ("faults.0.mag|faults." + 5000 * "9" + ".mag", "an address that the sweep's tables have"),
        ('name = "clean"|name = "kick 1 m/s"', "twice"),
        ("values = [1.0]|values = []", "at least 1"),
        ("values = [1.0]|values = [inf]", "finite"),
        ("faults.0.magnitude|faults.3.magnitude", "address"),
        ("faults.0.magnitude|faults.0.size", "share"),
        ("scene.faults.0.magnitude|__class__.x", "pattern"),
        ('kind = "kick"|kind = "sneeze"', "kick"),
        ("chunk = 1|chunk = ", "TOML"),
        ('name = "clean"|name = "clean"\nflights = "none.csv"', "CSV file"),
        ('name = "clean"|name = "clean"\nthrows.speed = [5.0, 3.0]', "upper end"),
        ('name = "clean"|name = "clean"\narm.limits = "huge"', "wam-48v"),
    ],
)
def test_a_study_that_cannot_be_meant_is_refused_in_one_line(
    tmp_path: Path, change: str, word: str
) -> None:
    old, new = change.split("|")
    assert old in TEXT
    with pytest.raises(MittError, match=word) as refused:
        write_study(tmp_path, TEXT.replace(old, new))
    assert "\n" not in str(refused.value)


def test_an_unknown_rival_is_named_beside_those_that_there_are(tmp_path: Path) -> None:
    with pytest.raises(UnknownNameError, match="one of direct, unoptimised"):
        write_study(tmp_path, TEXT.replace('"unoptimised"', '"oracle"'))


def test_a_study_that_is_no_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="readable TOML"):
        read_catch_study(tmp_path / "none.toml", generators=GENERATORS)
