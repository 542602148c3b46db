"""Arm files: read as written, everything checked, one line for what cannot be."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from arm.test_load import urdf

import mitt
from mitt.core.arm.basket import Basket
from mitt.core.arm.hands import HandModel
from mitt.core.errors import FileError, InputError, MittError
from mitt.core.map.map_design import MapDesign, default_design
from mitt.io.arm_file import (
    ArmFile,
    ThrowSettings,
    digest_of,
    is_arm_file,
    read_arm_file,
    write_arm_file,
)

TEXT = """schema = "mitt.arm/1"
[arm]
file = "five.urdf"
tip = "l5"
joints = ["j1", "j2", "j4"]
ready = [0.0, 0.5, -0.9]
limits = "own.toml"
[arm.held]
j3 = 0.4
[hand]
name = "three-finger"
turn = 0.3
[map]
catch_joint = 2
q_catch = 0.8
inward = 2.0
[throws]
speed = [4.0, 5.0]
"""
LIMITS = """schema = "mitt.limits/1"
[limits]
joints = ["j1", "j2", "j3", "j4", "j5"]
acceleration = [10.0, 11.0, 12.0, 13.0, 14.0]
torque = [40.0, 41.0, 42.0, 43.0, 44.0]
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Return an arm file, beside what it names."""
    urdf(tmp_path / "five.urdf")
    (tmp_path / "own.toml").write_text(LIMITS)
    file = tmp_path / "arm.toml"
    file.write_text(TEXT)
    return file


def test_an_arm_file_is_an_arm_and_a_design(path: Path) -> None:
    """Joints, held angles, ready pose, limits, hand and map are those of the file."""
    arm = mitt.load_arm(path)
    design = arm.model.design
    assert arm.names == ("j1", "j2", "j4")
    assert arm.q_ready.tolist() == [0.0, 0.5, -0.9]
    assert [x.held for x in arm.model.links] == [None, None, 0.4, None, 0.0]
    assert arm.limits.name == "own"
    assert arm.tau_max.tolist() == [40.0, 41.0, 43.0]
    assert arm.limits.acceleration is not None
    assert arm.model.hand is not None
    assert design == MapDesign(q_catch=0.8, inward=2.0)
    turned = mitt.load_arm(path)
    assert np.array_equal(turned.model.tool, arm.model.tool)
    plain = read_arm_file(path)
    bare = replace(plain, hand_turn=0.0).load()
    R = bare.orientation(bare.q_ready).T @ arm.orientation(arm.q_ready)
    assert np.arctan2(R[1, 0], R[0, 0]) == pytest.approx(0.3)
    assert mitt.load_arm(path, limits="model").tau_max.tolist() == [50.0, 50.0, 50.0]


def test_what_is_written_is_read(path: Path, tmp_path: Path) -> None:
    """From another folder too; every digit stays."""
    said = replace(
        read_arm_file(path),
        sha256=digest_of(tmp_path / "five.urdf"),
        ready=(0.1, 1.0 / 3.0, -1e-7),
        throws=ThrowSettings(speed=(4.0, 5.5), spread=0.5),
        hand="none",
    )
    other = tmp_path / "deep" / "other.toml"
    write_arm_file(other, said, comment="An arm.\nOf a test.")
    again = read_arm_file(other)
    assert other.read_text().startswith("# An arm.\n# Of a test.\n")
    assert isinstance(again.arm, Path)
    assert again.arm.resolve() == tmp_path / "five.urdf"
    assert replace(again, arm=said.arm, limits=said.limits) == said
    assert again.load().model.hand is None


def test_an_arm_by_name(tmp_path: Path) -> None:
    """The WAM, with another joint free."""
    file = tmp_path / "wam.toml"
    joints = ("j1", "j2", "j3", "j4")
    write_arm_file(file, ArmFile(arm="wam", joints=joints, limits="wam-80v"))
    arm = mitt.load_arm(file)
    assert arm.names == joints
    assert arm.limits.name == "wam-80v"
    assert arm.model.design is None
    held = ArmFile(arm="wam", joints=("j1", "j2", "j4"), held={"j3": 0.5}, ready=(0.1, 0.2, 0.3))
    write_arm_file(file, held)
    arm = mitt.load_arm(file)
    assert arm.q_ready.tolist() == [0.1, 0.2, 0.3]
    assert [x.held for x in arm.model.links] == [None, None, 0.5, None]
    default = mitt.load_arm("wam")
    assert arm.limits.name == default.limits.name


@pytest.mark.parametrize(
    ("before", "after", "wanted"),
    [
        ("mitt.arm/1", "mitt.arm/2", "mitt.arm/1"),
        ('tip = "l5"', 'tip = "l5"\nflange = 1', "one of file, name, sha256, tip"),
        ("turn = 0.3", "turning = 0.3", "one of name, turn"),
        ("inward = 2.0", "inwards = 2.0", "one of catch_joint"),
        ("speed = [4.0, 5.0]", "speeds = [4.0, 5.0]", "one of duration"),
        ("[throws]", "[balls]", "one of schema, arm, hand, map, throws"),
        ("speed = [4.0, 5.0]", "speed = [5.0, 4.0]", "lower end"),
        ('file = "five.urdf"', "", "one of file and name"),
        ('file = "five.urdf"', 'file = "six.urdf"', "six.urdf"),
        ('file = "five.urdf"', 'file = "five.urdf"\nname = "wam"', "one of file and name"),
        ('tip = "l5"', 'tip = "l7"', "one of"),
        ('"j1", "j2", "j4"]', '"j1", "j2", "j9"]', "one of"),
        ("ready = [0.0, 0.5, -0.9]", "ready = [0.0, 0.5]", "3 angles"),
        ("ready = [0.0, 0.5, -0.9]", "ready = [0.0, 0.5, nan]", "finite"),
        ("j3 = 0.4", "j3 = 40.0", "an angle in"),
        ("j3 = 0.4", "j4 = 0.4", "not active"),
        ("three-finger", "five-finger", "three-finger"),
        ("q_catch = 0.8", "q_catch = 8.0", "an angle in"),
        ("catch_joint = 2", "catch_joint = 5", "free joints"),
        ('limits = "own.toml"', 'limits = "none.toml"', "none.toml"),
        ('limits = "own.toml"', 'limits = "franka"', "franka-fr3"),
        ('limits = "own.toml"', 'limits = "ur5e"', "shoulder_pan_joint"),
        ('limits = "own.toml"', 'limits = "wam-80v"', "paper, wam-48v, wam-80v are of the WAM"),
        ('tip = "l5"', f'tip = "l5"\nsha256 = "{"0" * 64}"', "SHA-256 0000"),
        ('tip = "l5"', 'tip = "l5"\nsha256 = "abc"', "sha256"),
    ],
)
def test_what_cannot_be_is_refused(path: Path, before: str, after: str, wanted: str) -> None:
    """One line that says what was wanted."""
    assert before in TEXT
    path.write_text(TEXT.replace(before, after))
    with pytest.raises(MittError, match=wanted) as caught:
        mitt.load_arm(path)
    assert "\n" not in str(caught.value)


def test_nothing_beside_an_arm_file(path: Path) -> None:
    """It says tip and joints itself."""
    with pytest.raises(InputError, match="nothing beside an arm file"):
        mitt.load_arm(path, tip="l5")
    with pytest.raises(FileError):
        mitt.load_arm(path.with_name("absent.toml"))
    assert not is_arm_file("wam")


def test_options_go_before_the_files_design(path: Path) -> None:
    """What is given is taken, the rest is the file's; another catch joint has its own defaults."""
    arm = mitt.load_arm(path)
    assert default_design(arm) == arm.model.design
    assert default_design(arm, kappa=2.0) == MapDesign(q_catch=0.8, inward=2.0, kappa=2.0)
    other = default_design(arm, catch_joint=1)
    assert (other.catch_joint, other.inward) == (1, 0.0)


def test_a_basket_its_tilt_and_catch_point_are_read_and_written(path: Path, tmp_path: Path) -> None:
    """They are the arm's hand, and stay as they are from file to file."""
    said = replace(read_arm_file(path), hand="basket", hand_tilt=-1.25, hand_depth=0.04)
    other = tmp_path / "basket.toml"
    write_arm_file(other, said)
    again = read_arm_file(other)
    assert (again.hand, again.hand_tilt, again.hand_turn) == ("basket", -1.25, 0.3)
    assert again.load().model.hand == Basket(tilt=-1.25, catch_depth=0.04)
    write_arm_file(other, replace(said, hand="three-finger", hand_tilt=0.0))
    with pytest.raises(FileError, match="wanted a basket"):
        read_arm_file(other)


def test_force_of_hand_and_arm_are_read_and_written(path: Path, tmp_path: Path) -> None:
    """Each stays as it is; the weaker is the arm's; a hand that is not there takes none."""
    assert read_arm_file(path).hand_force is None
    (tmp_path / "own.toml").write_text(LIMITS + "force = 150.0\n")
    assert read_arm_file(path).load().force == min(150.0, HandModel().force)
    for hand in ("three-finger", "basket"):
        said = replace(read_arm_file(path), hand=hand, hand_force=80.0)
        write_arm_file(tmp_path / "soft.toml", said)
        again = read_arm_file(tmp_path / "soft.toml")
        assert again.hand_force == 80.0
        arm = again.load()
        assert (arm.force, arm.limits.force) == (80.0, 150.0)
    text = TEXT.replace('"three-finger"', '"none"').replace("turn = 0.3", "force = 10.0")
    path.write_text(text)
    with pytest.raises(FileError, match="force of hand: wanted a hand, got none"):
        read_arm_file(path)


@pytest.mark.parametrize("said", ["tilt = 0.3", "catch_depth = 0.04", "catch_depth = 0.0"])
def test_what_only_a_basket_has_is_refused_of_fingers(said: str, path: Path) -> None:
    """One line says what can be, of a depth of zero as well."""
    path.write_text(TEXT.replace("turn = 0.3", said))
    with pytest.raises(FileError, match=f"{said[:4]}.*: wanted a basket, got three-finger"):
        read_arm_file(path)
