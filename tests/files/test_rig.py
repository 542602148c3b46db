"""RIG.toml: it comes back to the bit, and nothing that is no rig is taken for one."""

import re
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from boards import true_lens
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from throws_on_film import calibrated

from mitt.core.errors import FileError
from mitt.core.eyes.camera import turned
from mitt.io.rig import CalibratedRig, HeadAxes, read_rig, write_rig


def full() -> CalibratedRig:
    """Return a rig that has all that a file can hold."""
    rig = calibrated()
    head = HeadAxes(
        T_world_cam=rig.cameras[0].T_world_cam,
        pan_axis=np.array((0.6, 0.0, 0.8)),
        pan_point=np.array((-1.8, 1.25, 0.3)),
        tilt_axis=np.array((0.0, 1.0, 0.0)),
        tilt_point=np.array((-1.8, 1.2, 0.31)),
    )
    left = replace(rig.cameras[0], head=head, lens=true_lens(), readout=0.0123)
    return replace(rig, cameras=(left, rig.cameras[1]), clock_offset=-0.0123, clock_sigma=3e-5)


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    """A full rig on disk."""
    write_rig(tmp_path / "RIG.toml", full(), version="test")
    return tmp_path / "RIG.toml"


def test_a_rig_comes_back_to_the_bit(saved: Path) -> None:
    """Lenses, poses, heads and clock are the saved ones."""
    again, rig = read_rig(saved), full()
    assert (again.frame, again.clock_offset, again.clock_sigma) == ("robot", -0.0123, 3e-5)
    for a, b in zip(again.cameras, rig.cameras, strict=True):
        assert np.array_equal(a.lens.numbers, b.lens.numbers)
        assert np.array_equal(a.T_world_cam, b.T_world_cam)
        assert (a.name, a.rms_px, a.readout) == (b.name, b.rms_px, b.readout)
    ours, theirs = again.cameras[0].head, rig.cameras[0].head
    assert ours is not None
    assert theirs is not None
    assert np.array_equal(ours.pose(0.3, -0.2), theirs.pose(0.3, -0.2))


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(share=st.floats(0.0, 0.7))
def test_a_file_cut_short_is_refused(saved: Path, share: float) -> None:
    """Cut before the second camera's pose is whole, it is never a rig of two cameras."""
    text = saved.read_text()
    cut = saved.with_name("cut.toml")
    cut.write_text(text[: int(share * len(text))])
    with suppress(FileError):
        assert len(read_rig(cut).cameras) < 2


def swapped(text: str, old: str, new: str) -> str:
    """Return a text with the first match of a pattern exchanged; it must be there."""
    out, count = re.subn(old, new, text, count=1)
    assert count == 1, old
    return out


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda t: swapped(t, "mitt.rig/1", "mitt.rig/9"), "schema"),
        (lambda t: swapped(t, "width = 640", "width = 640\nblur = 1"), "blur"),
        (lambda t: swapped(t, "width = 640\n", ""), "width"),
        (lambda t: swapped(t, "width = 640", "width = nan"), "width"),
        (lambda t: swapped(t, "K = \\[\n    \\[700.0", "K = [\n    [inf"), "K"),
        (lambda t: swapped(t, "K = \\[\n    \\[700.0, 0.0", "K = [\n    [700.0, 1.0"), "a K of"),
        (lambda t: swapped(t, "K = \\[\n    \\[700.0", "K = [\n    [-700.0"), "focal"),
        (
            lambda t: swapped(t, "T_world_cam = \\[\n    \\[[^,]*", "T_world_cam = [\n    [9.0"),
            "rotation",
        ),
        (lambda t: swapped(t, '"right"', '"left"'), "different"),
        (lambda t: swapped(t, "pan_axis = \\[0.6", "pan_axis = [0.7"), "length 1"),
        (lambda t: swapped(t, 'frame = "robot"', 'frame = "moon"'), "frame"),
        (lambda t: t + "[[camera", "TOML"),
    ],
)
def test_a_file_that_is_no_rig_is_refused(
    saved: Path, spoil: Callable[[str], str], says: str
) -> None:
    """Unknown and missing keys, NaN, skew, no rotation, equal names: one line that names it."""
    saved.write_text(spoil(saved.read_text()))
    with pytest.raises(FileError, match=re.escape(says)) as caught:
        read_rig(saved)
    assert "\n" not in str(caught.value)


def test_eyes_in_one_place_are_refused(tmp_path: Path) -> None:
    """Without a base line there is no depth."""
    rig = calibrated()
    one = tuple(replace(c, T_world_cam=rig.cameras[0].T_world_cam) for c in rig.cameras)
    write_rig(tmp_path / "RIG.toml", replace(rig, cameras=one), version="test")
    with pytest.raises(FileError, match="base line"):
        read_rig(tmp_path / "RIG.toml")


def test_another_frame_moves_cameras_and_heads_alike() -> None:
    """A head seen from elsewhere turns its camera to the same place, seen from there."""
    T = turned(np.eye(4), np.array((0.3, -0.2, 0.5, 1.0, 2.0, 3.0)))
    rig = full()
    moved = rig.seen_from(T, "board")
    before, after = rig.cameras[0].head, moved.cameras[0].head
    assert before is not None
    assert after is not None
    assert np.abs(after.pose(0.2, 0.1) - T @ before.pose(0.2, 0.1)).max() < 1e-12


@pytest.mark.parametrize(
    "text",
    [
        "cam0:\n  camera_model: pinhole\n  intrinsics: [461.6, 460.3, 363.0, 248.1]\n",
        "%YAML:1.0\n---\nM1: !!opencv-matrix\n   rows: 3\n",
        '{"fx": 1.0}',
        "<?xml version='1.0'?>\n<opencv_storage/>",
    ],
)
def test_calibrations_of_other_programs_are_told_what_to_do(tmp_path: Path, text: str) -> None:
    """Kalibr and OpenCV: that they are not read, and how their numbers get into a rig."""
    path = tmp_path / "camchain.yaml"
    path.write_text(text)
    with pytest.raises(FileError, match="Kalibr and OpenCV are not read") as caught:
        read_rig(path)
    assert "RIG.toml" in str(caught.value)


def test_a_missing_file_is_one_line(tmp_path: Path) -> None:
    """It says which file."""
    with pytest.raises(FileError, match=r"none\.toml"):
        read_rig(tmp_path / "none.toml")


@pytest.mark.parametrize("value", ["9" * 5000, "[" * 5000 + "]" * 5000], ids=["digits", "depth"])
def test_what_toml_cannot_hold_is_one_line(tmp_path: Path, value: str) -> None:
    """A number of 5000 digits and lists 5000 deep are refused like any other broken file."""
    path = tmp_path / "RIG.toml"
    path.write_text(f"a = {value}\n")
    with pytest.raises(FileError, match=r"RIG\.toml"):
        read_rig(path)


def test_a_camera_at_the_end_of_the_world_is_refused(tmp_path: Path) -> None:
    """Numbers that would overflow are refused before anything is computed from them."""
    path = tmp_path / "RIG.toml"
    write_rig(path, calibrated(), version="test")
    path.write_text(
        path.read_text().replace("-1.0,", "-1e+308,").replace("0.0, 0.0", "0.0, 1e+308")
    )
    with pytest.raises(FileError, match=r"RIG\.toml"):
        read_rig(path)
