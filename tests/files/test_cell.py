"""Cell files: what ships can be read; what does not fit the arm is refused in one line."""

import tomllib
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mitt.core.arm.description import roll_pitch_yaw
from mitt.core.errors import FileError, MittError
from mitt.core.eyes.camera import fixed_rig
from mitt.core.eyes.lens import Lens
from mitt.io.cell import arm_of, around_of, cell_of, lenses_of, read_cell, rig_of
from mitt.io.rig import CalibratedRig, RigCamera, write_rig

SHIPPED = Path(str(files("mitt") / "data" / "cells" / "wam-sim.toml"))


def changed(change: Callable[[dict[str, Any]], object]) -> dict[str, Any]:
    """Return what the shipped file says, changed."""
    raw = tomllib.loads(SHIPPED.read_text("utf-8"))
    change(raw)
    return raw


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda raw: raw.update(typo=1), "key 'typo'"),
        (lambda raw: raw["robot"].update(rate=125.0), "1000 or 500 or 250 Hz, got 125"),
        (lambda raw: raw["robot"].update(rate=250.0), "1000 or 500 Hz for torques"),
        (lambda raw: raw["robot"].update(takes="voltage"), "robot.takes"),
        (lambda raw: raw["ball"].update(radius=40.0), "ball.radius"),
        (lambda raw: raw["source"].update(sigma=float("nan")), "source.sigma"),
        (lambda raw: raw.pop("schema"), "schema"),
        (lambda raw: raw["motion"].update(ready_speed=2.0), "motion.ready_speed"),
    ],
)
def test_bad_keys_are_named(change: Callable[[dict[str, Any]], object], says: str) -> None:
    """With the file and what is wanted."""
    with pytest.raises(FileError) as caught:
        cell_of(changed(change), place="CELL.toml")
    assert says in str(caught.value)
    assert "CELL.toml" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda raw: raw["robot"].update(joints=["a", "b"]), "one for each of j1, j2, j4"),
        (lambda raw: raw["robot"].update(joints=["a", "b", "a"]), "3 different names"),
        (lambda raw: raw["arm"].update(file="nobody"), "nobody"),
        (lambda raw: raw["arm"].update(limits="nothing"), "nothing"),
    ],
)
def test_an_arm_that_does_not_fit_is_refused(
    change: Callable[[dict[str, Any]], object], says: str
) -> None:
    """Other joints than the arm has, an arm or limits that there are not."""
    with pytest.raises(MittError) as caught:
        arm_of(cell_of(changed(change), place="CELL.toml"))
    assert says in str(caught.value)


def test_a_zone_in_which_the_arm_waits_is_refused() -> None:
    """Before anything moves."""
    zone = {"start": [0.0, 0.0, 0.3], "end": [0.0, 0.0, 0.6], "radius": 0.5}
    cell = cell_of(changed(lambda raw: raw.update(zones=[zone])), place="CELL.toml")
    with pytest.raises(MittError, match="zone 0"):
        around_of(cell, arm_of(cell))


def test_the_speed_scale_lowers_the_speeds_alone() -> None:
    """Torques stay; the limit set's name says so."""
    half = cell_of(changed(lambda raw: raw["motion"].update(speed_scale=0.5)), place="CELL.toml")
    arm, slow = arm_of(read_cell("wam-sim")), arm_of(half)
    assert np.allclose(slow.dq_max, 0.5 * arm.dq_max)
    assert np.allclose(slow.tau_max, arm.tau_max)
    assert slow.limits.name == "paper x0.5"


def test_files_are_looked_for_beside_the_cell(tmp_path: Path) -> None:
    """Names of ours stay names."""
    text = SHIPPED.read_text("utf-8").replace('file = "wam"', 'file = "mine.toml"')
    (tmp_path / "cell.toml").write_text('map = "MAP.json"\n' + text)
    cell = read_cell(tmp_path / "cell.toml")
    assert cell.arm.file == str(tmp_path / "mine.toml")
    assert cell.map == str(tmp_path / "MAP.json")
    assert cell.arm.limits == "paper"


def test_what_is_neither_name_nor_file_is_refused(tmp_path: Path) -> None:
    """The cells that ship are listed."""
    with pytest.raises(FileError, match="wam-sim"):
        read_cell("wam-simm")
    with pytest.raises(FileError):
        read_cell(tmp_path / "none.toml")


def test_roll_pitch_and_yaw_are_about_fixed_axes() -> None:
    """As REP 103 and SciPy have them."""
    rpy = (0.3, -0.4, 1.1)
    assert np.allclose(roll_pitch_yaw(np.array(rpy)), Rotation.from_euler("xyz", rpy).as_matrix())


def test_a_rig_whose_lenses_bend_gives_straight_cameras_and_the_lenses(tmp_path: Path) -> None:
    """One bent lens is enough; a rig that bends nothing gives none."""
    for k1, count in ((-0.2, 2), (0.0, 0)):
        cameras = tuple(
            RigCamera(
                name=name,
                rms_px=0.1,
                T_world_cam=camera.T_world_cam,
                lens=Lens(
                    width=128,
                    height=128,
                    numbers=np.array([220.0, 220.0, 63.5, 63.5, bend, 0.0, 0.0, 0.0, 0.0]),
                ),
            )
            for name, camera, bend in zip("ab", fixed_rig().cameras, (k1, 0.0), strict=True)
        )
        write_rig(tmp_path / "rig.toml", CalibratedRig(frame="robot", cameras=cameras), version="x")
        raw = {
            "schema": "mitt.cell/1",
            "name": "x",
            "source": {"kind": "images", "rig": "rig.toml"},
        }
        cell = cell_of(raw, place="x", folder=tmp_path)
        lenses = lenses_of(cell)
        assert len(lenses) == count
        assert [lens.numbers[4] for lens in lenses] == [k1, 0.0][:count]
        assert all(camera.f_px == pytest.approx(220.0) for camera in rig_of(cell).cameras)


@pytest.mark.parametrize(
    "name",
    [
        "../../x",
        "/etc/x",
        "a/b",
        "..",
        ".",
        ".hidden",
        "a\\b",
        "a\nb",
        "a\n",
        "a\0b",
        "",
        " a",
        "[x]",
        "x" * 61,
        "a:b",
        "-a",
    ],
)
def test_a_name_is_part_of_a_file_s_name(name: str) -> None:
    """So a recording stays in the folder that was named."""
    with pytest.raises(FileError, match="name"):
        cell_of({"schema": "mitt.cell/1", "name": name}, place="cell")


def test_names_of_people_are_names() -> None:
    """Letters of any language, digits, spaces."""
    for name in ("wam-sim", "Zelle 3", "käfig_2", "ur5e.v2+", "a"):
        assert cell_of({"schema": "mitt.cell/1", "name": name}, place="cell").name == name
