"""``--arm`` of every task, at every door: a name, an arm file, a design, a description file."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import thorough

pytest.importorskip("gymnasium")

import mitt.gym
from mitt.cli.main import main
from mitt.core.arm.arm import identity_of
from mitt.core.arm.tools import TOOLS, Paddle
from mitt.core.errors import InputError, MittError, ModelError
from mitt.io.arm_file import ArmFile, hand_of, read_arm_file, write_arm_file
from mitt.io.cell import read_cell
from mitt.io.load import described
from mitt.io.reading import shipped_path
from mitt.lab.trials.bat_station import arm_with_paddle
from mitt.lab.trials.bat_study import read_bat_study
from mitt.lab.trials.meet_study import read_meet_study
from mitt.lab.trials.station import arm_with_tool
from mitt.lab.trials.study_folder import Folder
from mitt.lab.trials.study_run import all_chunks
from mitt.robot.cell.prepare import prepare

JOINTS = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
)
STUDY = 'task = "{task}"\nname = "one"\narm = "{arm}"\n{more}\n[[conditions]]\nname = "all"\n'


@pytest.fixture
def files(tmp_path: Path) -> dict[str, Path]:
    """Return an arm in each kind of file: a design that ships, another with few joints, own ones.

    The own one says where its description is, as `mitt design ARM.urdf` does.
    """
    out = {"urdf": tmp_path / "own.urdf"}
    out["urdf"].write_text(described("ur5e").read_text())
    for name in ("ur5e", "ur10e"):
        out[name] = tmp_path / f"{name}-copy.toml"
        out[name].write_text(shipped_path("designs", name).read_text())
    out["own"] = tmp_path / "own.toml"
    held = {"wrist_2_joint": 1.2, "wrist_3_joint": 0.3}
    own = ArmFile(
        arm=out["urdf"],
        tip="tool0",
        joints=JOINTS[:4],
        held=held,
        hand="basket",
        hand_mount="plate",
    )
    write_arm_file(out["own"], own)
    return out


def beside(kind: str) -> list[str]:
    """Return what is said beside a file on the command line."""
    return ["--tip", "tool0", "--joints", ",".join(JOINTS)] if kind == "urdf" else []


def by_command(file: Path, kind: str) -> None:
    """Check the input of ``mitt meet``."""
    assert main(["meet", "--arm", str(file), *beside(kind), "--check"]) == 0


def by_cell(file: Path, kind: str) -> None:
    """Prepare a cell that names it, as ``mitt run --check`` does."""
    text = shipped_path("cells", "ur5e-belt-sim").read_text()
    more = f'\ntip = "tool0"\njoints = {list(JOINTS)}' if kind == "urdf" else ""
    cell = file.parent / "cell.toml"
    cell.write_text(text.replace('file = "ur5e"', f'file = "{file.name}"{more}'))
    assert prepare(read_cell(cell)).arm.names == JOINTS


def by_study(file: Path, kind: str) -> None:
    """Read a study of it, and build its station."""
    more = f'tip = "tool0"\njoints = "{",".join(JOINTS)}"' if kind == "urdf" else ""
    path = file.parent / "study.toml"
    text = STUDY.format(task="meet", arm=file, more=more) + 'target = "belt"\nspeed = 0.3\n'
    path.write_text(text)
    study = read_meet_study(path)
    (condition,) = study.conditions
    assert str(file) in condition.arm_files
    chunk = next(all_chunks(study, Folder(file.parent / "out"), lambda *_: None))
    trials, _ = study.played(replace(chunk, stop=0))
    assert trials == []


def by_environment(file: Path, kind: str) -> None:
    """Make the environment."""
    more: dict[str, Any] = {"tip": "tool0", "joints": JOINTS} if kind == "urdf" else {}
    assert mitt.gym.MeetEnv(arm=file, **more).arm.names == JOINTS


DOORS: list[Callable[[Path, str], None]] = [by_command, by_cell, by_study, by_environment]


@pytest.mark.parametrize("door", DOORS, ids=lambda x: x.__name__)
@pytest.mark.parametrize("kind", thorough(["own"], ["ur5e", "urdf"]))
def test_an_arm_of_a_file_meets_at_every_door(
    kind: str, door: Callable[[Path, str], None], files: dict[str, Path]
) -> None:
    """The tool of the task takes the place of the hand that the file mounts."""
    door(files[kind], kind)


@pytest.mark.parametrize("name", ["ur5e", "ur10e", "franka-panda", "kuka-iiwa14"])
def test_a_design_that_ships_is_the_arm_of_its_name(name: str) -> None:
    """To the bit, whatever joints its catch holds, however its basket is turned."""
    tool = TOOLS["suction"]
    design = arm_with_tool(shipped_path("designs", name), tool)
    assert identity_of(design) == identity_of(arm_with_tool(name, tool))


def test_a_tool_is_screwed_on_where_the_hand_was(files: dict[str, Path]) -> None:
    """A hand whose catch point is at the tip has its plate as far behind it as it is long."""
    own = read_arm_file(files["own"])
    tool, hand = TOOLS["jaw"], hand_of("three-finger", 0.0)
    assert hand is not None
    at_tip = replace(own, hand="three-finger", hand_mount="catch", joints=JOINTS, held={})
    ends = [at_tip.carrying(tool).position(q) - at_tip.load().position(q) for q in np.eye(6)]
    assert np.linalg.norm(ends, axis=1) == pytest.approx(abs(tool.catch_offset - hand.stand))
    assert read_arm_file(files["own"]).carrying(tool).names == JOINTS[:4]
    assert arm_with_tool(files["own"], tool).names == JOINTS


def test_what_brings_no_tool_to_a_target_is_refused(files: dict[str, Path]) -> None:
    """Four joints that nobody else is held beside; something beside an arm file; no tip."""
    tool = TOOLS["suction"]
    with pytest.raises(ModelError, match=r"3, 5, 6 or 7 joints that move, got 4.*--joints"):
        arm_with_tool(files["urdf"], tool, tip="tool0", joints=JOINTS[:4])
    with pytest.raises(InputError, match="nothing beside an arm file"):
        arm_with_tool(files["ur5e"], tool, tip="tool0")
    with pytest.raises(MittError, match=r"--tip, --joints"):
        arm_with_tool(files["urdf"], tool)


def test_an_arm_bats_by_its_name_or_by_a_file_that_names_it(files: dict[str, Path]) -> None:
    """At each door; of another arm no stance is known, and the line says what to do."""
    paddle = Paddle()
    of_name, stance = arm_with_paddle("ur5e", paddle)
    of_file, same = arm_with_paddle(files["ur5e"], paddle)
    assert (identity_of(of_file), same) == (identity_of(of_name), stance)
    assert main(["bat", "--arm", str(files["ur5e"]), "--check"]) == 0
    path = files["ur5e"].parent / "study.toml"
    path.write_text(STUDY.format(task="bat", arm=files["ur5e"], more=""))
    assert str(files["ur5e"]) in read_bat_study(path).conditions[0].arm_files
    assert mitt.gym.BatEnv(arm=files["ur5e"]).arm.n == len(stance.joints)
    for other in ("ur10e", "urdf", "own"):
        with pytest.raises(ModelError, match=r"stance for batting is known: wam.*choose one"):
            arm_with_paddle(files[other], paddle)
    path.write_text(STUDY.format(task="bat", arm=files["urdf"], more=""))
    with pytest.raises(ModelError, match="stance for batting"):
        read_bat_study(path)
