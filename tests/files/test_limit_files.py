"""Limit sets in files: those that ship can be used, others are checked."""

from pathlib import Path

import numpy as np
import pytest

from mitt.core.arm.limits import KINDS
from mitt.core.errors import MittError, UnknownNameError
from mitt.io.arm_file import read_limits
from mitt.io.reading import shipped

TEXT = 'schema = "mitt.limits/1"\n[limits]\njoints = ["a", "b"]\nspeed = [1.0, 2.0]\n'


def test_common_arms_have_a_set() -> None:
    """At least these; each names its source, and has speed and torque of all joints."""
    wanted = {
        "franka-panda",
        "franka-fr3",
        "ur3e",
        "ur5e",
        "ur10e",
        "kuka-iiwa7",
        "kuka-iiwa14",
        "kinova-gen3",
        "xarm6",
        "xarm7",
        "sawyer",
        "so-101",
    }
    assert wanted <= set(shipped("limits"))
    folder = Path(__file__).parents[2] / "src/mitt/data/limits"
    for name in shipped("limits"):
        limits = read_limits(name)
        assert limits.shipped
        assert {"speed", "torque"} <= limits.bounds.keys()
        assert "# Source" in (folder / f"{name}.toml").read_text()
        for kind, least, most in (("speed", 0.5, 7.0), ("torque", 1.0, 400.0)):
            assert np.all((limits.bounds[kind] > least) & (limits.bounds[kind] < most))


def test_a_file_is_read_as_it_says(tmp_path: Path) -> None:
    """Its name is that of the set; what is left out is not there."""
    path = tmp_path / "mine.toml"
    path.write_text(TEXT)
    limits = read_limits(path)
    assert limits.name == "mine"
    assert not limits.shipped
    assert limits.joints == ("a", "b")
    assert {k: x.tolist() for k, x in limits.bounds.items()} == {"speed": [1.0, 2.0]}
    assert set(limits.bounds) <= set(KINDS)


def test_a_set_may_say_what_force_the_arm_takes(tmp_path: Path) -> None:
    """Those of Universal Robots do, with their source; elsewhere nothing is known of it."""
    path = tmp_path / "mine.toml"
    path.write_text(TEXT)
    assert read_limits(path).force == np.inf
    path.write_text(TEXT + "force = 42.5\n")
    assert read_limits(path).force == 42.5
    for bad in ("0.0", "-1.0", "nan", "inf", '"much"'):
        path.write_text(TEXT + f"force = {bad}\n")
        with pytest.raises(MittError, match="force"):
            read_limits(path)
    for name in ("ur3e", "ur5e", "ur10e"):
        assert read_limits(name).force == 100.0
    assert read_limits("franka-fr3").force == np.inf


def test_a_byte_order_mark_is_no_text(tmp_path: Path) -> None:
    """Editors of Windows write one; tables and descriptions have it taken off, too."""
    path = tmp_path / "mine.toml"
    path.write_text(TEXT, encoding="utf-8-sig")
    assert read_limits(path).joints == ("a", "b")


def test_a_panda_is_no_kuka() -> None:
    """Both have seven joints."""
    panda = [f"panda_joint{k}" for k in range(1, 8)]
    assert read_limits("franka-panda").fitted(panda)["torque"]["panda_joint1"] == 87.0
    for name in ("kuka-iiwa7", "kuka-iiwa14", "kinova-gen3"):
        with pytest.raises(MittError, match="an arm with the joints joint_1"):
            read_limits(name).fitted(panda)


@pytest.mark.parametrize(
    ("before", "after", "wanted"),
    [
        ("mitt.limits/1", "mitt.limits/9", "wanted 'mitt.limits/1', got 'mitt.limits/9'"),
        ("[1.0, 2.0]", '["1.0", 2.0]', "wanted a number, got '1.0'"),
        ("[1.0, 2.0]", "[true, 2.0]", "wanted a number, got True"),
        ("[1.0, 2.0]", "1.0", "wanted a list, got 1.0"),
        ("[limits]", "limits = 3\n[more]", "wanted a table, got 3"),
        ('joints = ["a", "b"]', "", "key 'limits.joints': wanted a value, got none"),
        ("speed", "velocity", "one of joints, force, lower, upper, speed"),
        ("[1.0, 2.0]", "[1.0]", "shape"),
        ("[1.0, 2.0]", "[1.0, -2.0]", "above 0"),
        ("[1.0, 2.0]", "[1.0, inf]", "finite"),
        ('"a", "b"', '"a", "a"', "different names"),
        ("speed", "lower", "both ends"),
    ],
)
def test_what_cannot_be_is_refused(tmp_path: Path, before: str, after: str, wanted: str) -> None:
    """One line each."""
    path = tmp_path / "mine.toml"
    path.write_text(TEXT.replace(before, after))
    with pytest.raises(MittError, match=wanted) as caught:
        read_limits(path)
    assert "\n" not in str(caught.value)


def test_an_unknown_name_lists_the_known_ones() -> None:
    """Those of the WAM too."""
    with pytest.raises(UnknownNameError, match="franka-fr3") as caught:
        read_limits("panda")
    assert "wam-80v" in str(caught.value)
