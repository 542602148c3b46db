"""The whole of an arm: which joints a search may move, and what is said of the others."""

from pathlib import Path

import pytest
from arm.test_load import urdf

from mitt.core.errors import ModelError, UnknownNameError
from mitt.lab.design.driven_arm import whole_arm


def _without(path: Path, *joints: str, tip: str = "") -> Path:
    """Write the arm of test_load with joints that state no speed."""
    parts = urdf(path).read_text().split("<joint ")
    parts = [
        x.replace(' velocity="5"', tip) if x[6:8] in joints and x.startswith('name="') else x
        for x in parts
    ]
    path.write_text("<joint ".join(parts))
    return path


@pytest.mark.parametrize("stated", ["", ' velocity="0"'])
def test_a_joint_without_a_speed_is_held_and_told(tmp_path: Path, stated: str) -> None:
    """The note names the joint, the attribute, and the key of a limits file."""
    path = _without(tmp_path / "a.urdf", "j2", tip=stated)
    whole = whole_arm(path, tip="l5", limits=None, hand=None)
    assert whole.names == ("j1", "j3", "j4", "j5")
    (note,) = whole.model.notes
    assert "held joint 'j2': no speed known" in note
    assert "<limit> velocity of 'j2' in the file, or speed in a limits file" in note


def test_a_joint_that_carries_no_mass_is_held_and_told(tmp_path: Path) -> None:
    """As the flange of a maker's file, a link without inertia behind the last joint."""
    path, text = tmp_path / "a.urdf", urdf(tmp_path / "a.urdf").read_text()
    last = text.index('<link name="l5">')
    end = text.index("</link>", last) + len("</link>")
    path.write_text(f'{text[:last]}<link name="l5"/>{text[end:]}')
    whole = whole_arm(path, tip="l5", limits=None, hand=None)
    assert whole.names == ("j1", "j2", "j3", "j4")
    (note,) = whole.model.notes
    assert "held joint 'j5': no mass known" in note
    assert note.endswith("state <inertial> of the child link of 'j5' in the file")
    with pytest.raises(ModelError, match=r"'j5': wanted a mass above 0.*state <inertial> of"):
        whole_arm(path, tip="l5", limits=None, hand=None, joints=["j1", "j2", "j5"])


def test_a_joint_that_is_named_has_to_be_driven(tmp_path: Path) -> None:
    """Asked for by name, it is refused for what it lacks, not as if it did not exist."""
    path = _without(tmp_path / "a.urdf", "j2")
    with pytest.raises(
        ModelError, match=r"joint 'j2': wanted a velocity limit above 0.*<limit> vel"
    ):
        whole_arm(path, tip="l5", limits=None, hand=None, joints=["j1", "j2", "j4"])


def test_too_few_joints_are_told_why(tmp_path: Path) -> None:
    """What they lack, each by name; or, where none lacks anything, that the tip is too near."""
    path = _without(tmp_path / "a.urdf", "j2", "j3", "j4")
    with pytest.raises(ModelError, match=r"got j1, j5; state .* of 'j2', 'j3', 'j4' in"):
        whole_arm(path, tip="l5", limits=None, hand=None)
    with pytest.raises(ModelError, match="got j1, j2; name as tip a link behind more joints"):
        whole_arm(urdf(tmp_path / "b.urdf"), tip="l2", limits=None, hand=None)
    with pytest.raises(UnknownNameError, match="one of l0, l1, l2, l3, l4, l5, got 'l9'"):
        whole_arm(path, tip="l9", limits=None, hand=None)
