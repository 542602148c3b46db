"""Arms by name: each catches with the design that ships, and its figures are those of it."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

import mitt
from mitt.cli.catching import prepare_run
from mitt.cli.main import main
from mitt.cli.options import CatchOptions
from mitt.core.errors import InputError
from mitt.core.map.map_design import default_design
from mitt.io import arm_file
from mitt.io.arm_file import ArmFile, design_of, load_arm
from mitt.io.load import arm_names
from mitt.io.reading import shipped
from mitt.io.shipped_arms import ShippedArm, arm_digest, shipped_arms
from mitt.io.wam import LIMIT_SETS

ARMS = shipped_arms()
DESIGNS = shipped("designs")
#: Fewest throws of a figure.
_FEWEST = 200


def id_of(arm: ShippedArm) -> str:
    """Return what a case is called."""
    return f"{arm.name}-{arm.limits}"


def test_every_arm_is_listed_with_what_it_is_called() -> None:
    """Under its own name, or its name and a hand; the WAM with each of its limit sets."""
    names = {x.name for x in ARMS}
    assert set(arm_names()) <= names
    assert set(DESIGNS) <= names
    assert all(re.fullmatch(r"(.+?)(-basket|-fingers)?", x) for x in names)
    assert [x.limits for x in ARMS if x.name == "wam"] == list(LIMIT_SETS)
    assert all(x.title and x.source for x in ARMS)


@pytest.mark.parametrize("arm", [x for x in ARMS if x.designed], ids=id_of)
def test_figures_are_those_of_what_ships(arm: ShippedArm) -> None:
    """Measured anew wherever a number of the arm, its design or its limits is another."""
    assert arm.figures is not None, "run benchmarks/shipped_arms.py"
    chosen = arm.spec.read()
    assert arm.figures.digest == arm_digest(chosen), "run benchmarks/shipped_arms.py"
    assert arm.figures.joints == tuple(chosen.arm.names)
    assert arm.figures.throws >= _FEWEST
    assert 0.5 * arm.figures.throws < arm.figures.caught <= arm.figures.throws


def test_a_digest_notices_a_number() -> None:
    """The catch angle is another by a millionth of a radian."""
    chosen = ARMS[0].spec.read()
    moved = ARMS[0].spec.model_copy(update={"q_catch": chosen.design.q_catch + 1e-6}).read()
    assert arm_digest(moved) != arm_digest(chosen)


@pytest.mark.parametrize("name", DESIGNS)
def test_a_name_alone_is_its_design(name: str, tmp_path: Path) -> None:
    """Its joints, hand, map and throws; limits may be others; no path is in the file."""
    file = design_of(name)
    assert file is not None
    assert file.arm in arm_names()
    assert file.limits is None or not isinstance(file.limits, Path)
    prepared = prepare_run(CatchOptions(arm=name, out=tmp_path / "run"))
    assert prepared.arm.model.hand is not None
    assert prepared.arm.names == file.joints
    assert prepared.design == file.map
    arm = mitt.load_arm(name)
    assert arm.names == file.joints
    assert default_design(arm) == file.map  # of mitt.learn(arm), too
    assert load_arm(name, limits="model").limits.name != prepared.arm.limits.name


def test_what_is_said_beside_a_name_makes_the_bare_arm() -> None:
    """All its joints and the flange, or those that are named; nothing of the design."""
    design = design_of("ur5e")
    assert design is not None
    assert load_arm("ur5e").names == design.joints
    bare = load_arm("ur5e", hand="none")
    assert (bare.n, bare.model.hand) == (6, None)
    assert load_arm("ur5e", tip="wrist_3_link").n == 6
    assert np.array_equal(load_arm("ur5e", ready=[0.1] * 6).q_ready, np.full(6, 0.1))


def test_an_arm_without_a_design_says_how_to_get_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """In one line; as the bare arm it can be had."""
    there = {"designs": (), "limits": shipped("limits")}
    monkeypatch.setattr(arm_file, "shipped", there.get)
    with pytest.raises(InputError, match=r"mitt design ur5e --out ur5e\.toml looks for one$"):
        load_arm("ur5e")
    assert load_arm("ur5e", hand="none").n == 6
    assert design_of("wam") is None


def test_the_list_fits_a_screen_and_its_json_is_the_contract(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """80 columns; one row an arm, and which command it takes."""
    assert main(["arms"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 80
    assert sum(any(x.title in line for x in ARMS) for line in lines) == len(ARMS)
    assert "takes velocity at 500 Hz: ur5e, ur10e" in lines
    assert main(["arms", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["schema"] == "mitt.arms/1"
    keys = {
        "name",
        "title",
        "limits",
        "joints",
        "source",
        "rate",
        "throws",
        "relative_speed_m_s",
        "force_n",
        "takes",
        "command_hz",
    }
    assert all(keys <= row.keys() for row in said["arms"])
    assert [row["name"] for row in said["arms"]] == [x.name for x in ARMS]
    assert main(["arms", "--check"]) == 0


def test_an_arm_file_that_names_an_arm_is_of_the_bare_arm() -> None:
    """What a design leaves out is not taken from another design."""
    assert ArmFile(arm="ur5e", hand="basket").load().n == 6
