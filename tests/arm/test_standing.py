"""An arm stands and waits clear of its scene, or the scene is refused, at every door."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from sysconfig import get_paths

import numpy as np
import pytest
from arm.test_load import urdf
from hypothesis import given, settings
from hypothesis import strategies as st

from mitt.cli.main import main
from mitt.core.arm.arm import Arm
from mitt.core.arm.standing import Slab, check_standing
from mitt.core.arm.tools import TOOLS
from mitt.core.errors import InputError, ModelError
from mitt.io.arm_file import arm_with_hand
from mitt.io.cell import cell_of
from mitt.io.load import build_arm
from mitt.io.reading import read_toml, shipped_path
from mitt.lab.trials.bat_station import bat_station
from mitt.lab.trials.runs import simulate
from mitt.lab.trials.station import PARTS_SCENE, station, tip_out_of_flange
from mitt.lab.world.overlap import check_scene
from mitt.lab.world.scene import Belt, Tray, named_scene
from mitt.robot.cell.prepare import prepare

#: A belt along x, at the height of the foot of an arm.
THROUGH = Belt(middle=(0.55, 0.0), direction=0.0, height=0.03)
LINE = "beside|below"

length = st.floats(0.1, 3.0)
place = st.floats(-2.0, 2.0)


@settings(max_examples=60)
@given(
    size=st.tuples(length, length, length),
    at=st.tuples(place, place, place),
    turn=st.floats(-4.0, 4.0),
    point=st.tuples(place, place, place),
)
def test_the_distance_from_a_slab_is_that_of_its_nearest_point(
    size: tuple[float, float, float],
    at: tuple[float, float, float],
    turn: float,
    point: tuple[float, float, float],
) -> None:
    """Of points on a grid none is nearer, and one is about as near."""
    slab = Slab(middle=at[:2], direction=turn, height=at[2], size=size)
    c, s = np.cos(turn), np.sin(turn)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    grid = np.stack(np.meshgrid(*[np.linspace(-0.5, 0.5, 21)] * 3), axis=-1).reshape(-1, 3)
    points = np.array([*at[:2], at[2] - 0.5 * size[2]]) + (grid * size) @ R.T
    least = float(np.linalg.norm(points - point, axis=1).min())
    found = slab.distance(np.array([point]))
    assert found <= least + 1e-9
    assert least <= found + 0.5 * np.linalg.norm(np.array(size) / 20.0) + 1e-9


@pytest.fixture(scope="module")
def arm() -> Arm:
    """Return a UR5e as it catches."""
    return arm_with_hand("ur5e")[0]


def test_what_overlaps_is_refused_and_what_is_beside_is_not(arm: Arm) -> None:
    """A belt, a tray and the floor, moved by some millimetres; each says what to do."""
    scene = named_scene("lab")
    for belt in (THROUGH, replace_belt(middle=(0.0, 0.2), direction=0.4)):
        with pytest.raises(InputError, match=r"belt: wanted one beside ur5e where it stands.*move"):
            check_scene(arm, scene.model_copy(update={"belt": belt}))
    check_scene(arm, scene.model_copy(update={"belt": replace_belt(middle=(0.0, 0.6))}))
    foot = arm.model.base_capsules[0]
    edge = foot.radius + 0.5 * 0.3
    for off, clear in ((edge - 0.003, False), (edge + 0.003, True)):
        slab = Slab(
            middle=(0.0, off), direction=0.0, height=foot.start[2] + 0.02, size=(6.0, 0.3, 0.05)
        )
        assert stands(arm, -1.0, slab) == clear
    low = arm.position(arm.q_ready)
    tray = Tray(middle=(float(low[0]), float(low[1])), height=float(low[2]))
    with pytest.raises(InputError, match=r"tray.*in its ready pose"):
        check_scene(arm, scene.model_copy(update={"tray": tray}))


def replace_belt(**of: object) -> Belt:
    """Return the belt through the foot with other keys."""
    return Belt(**(THROUGH.model_dump() | of))


def stands(arm: Arm, floor: float, slab: Slab) -> bool:
    """Say whether an arm is clear of a floor and a slab."""
    try:
        check_standing(arm, floor, {"slab": (slab, "move it")})
    except InputError:
        return False
    return True


def test_a_floor_over_a_hand_that_waits_is_refused(arm: Arm) -> None:
    """The arm stands above it, its hand hangs below: nothing would be kept from the floor."""
    down = Arm(replace(arm.model, q_ready=np.array([0.0, 0.6, 0.0, 0.0, 0.0])), arm.limits)
    with pytest.raises(InputError, match=r"floor: wanted one below ur5e in its ready pose.*lower"):
        check_standing(down, 0.0)
    check_standing(down, -2.0)


def by_meeting(file: Path) -> None:
    """``mitt meet`` in a scene."""
    assert main(["meet", "--scene", str(file), "--check"]) == 2


def by_catching(file: Path) -> None:
    """``mitt catch`` in a scene."""
    assert main(["catch", "--arm", "ur5e", "--scene", str(file), "--check"]) == 2


def by_batting(file: Path) -> None:  # noqa: ARG001
    """A station that bats."""
    scene = named_scene("lab").model_copy(update={"belt": THROUGH})
    with pytest.raises(InputError, match=LINE):
        bat_station("ur5e", scene=scene, target=None, learns=False)


def by_python(file: Path) -> None:
    """Throws from Python."""
    from mitt.core.catcher.generators import Direct  # noqa: PLC0415
    from mitt.core.map.map_design import default_design  # noqa: PLC0415
    from mitt.core.map.mapping import unlearned  # noqa: PLC0415

    arm = arm_with_hand("ur5e")[0]
    with pytest.raises(InputError, match=LINE):
        simulate(Direct(unlearned(arm, default_design(arm))), throws=1, scene=file)


def by_study(file: Path) -> None:
    """A study of throws."""
    study = file.parent / "study.toml"
    belt = "belt = { middle = [0.55, 0.0], direction = 0.0, height = 0.03 }"
    study.write_text(
        f'name = "one"\ngenerators = ["direct"]\narm = {{ arm = "ur5e" }}\nscene = {{ {belt} }}\n'
        '[[conditions]]\nname = "all"\n'
    )
    assert main(["study", str(study), "--out", str(file.parent / "out"), "--check"]) == 2


def by_cell(file: Path) -> None:  # noqa: ARG001
    """A cell where parts are met, and one whose floor is over the hand that waits."""
    raw = read_toml(shipped_path("cells", "ur5e-belt-sim"))
    task = raw["task"] | {"belt": THROUGH.model_dump()}
    with pytest.raises(InputError, match=LINE):
        prepare(cell_of(raw | {"task": task}, place="a cell"))


DOORS: list[Callable[[Path], None]] = [
    by_meeting,
    by_catching,
    by_batting,
    by_python,
    by_study,
    by_cell,
]


@pytest.mark.parametrize("door", DOORS, ids=lambda x: x.__name__)
def test_a_belt_through_the_foot_is_refused_at_every_door(
    door: Callable[[Path], None], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """In one line."""
    file = tmp_path / "scene.toml"
    file.write_text('base = "lab"\n[belt]\nmiddle = [0.55, 0.0]\ndirection = 0.0\nheight = 0.03\n')
    door(file)
    lines = capsys.readouterr().err.splitlines()
    assert all("belt: wanted one beside" in line for line in lines)
    assert len(lines) <= 1


def test_a_belt_that_leads_past_the_arm_is_taken() -> None:
    """The usual one, and one along x that ends before the foot."""
    short = Belt(middle=(0.5527, 0.0), direction=0.0, height=0.0225, length=0.7)
    scene = PARTS_SCENE.model_copy(update={"belt": short})
    assert station("ur5e", TOOLS["suction"], "belt", scene).scene.belt == short


@pytest.mark.parametrize("axis", ["1 0 0", "-1 0 0"])
@pytest.mark.parametrize("said", ["l5", "l5:y", "l5:-z", "l5:-y"])
def test_a_tool_across_the_flange_is_told_which_axis_leads_out(
    tmp_path: Path, axis: str, said: str
) -> None:
    """Of the frame as the file has it, whatever axis was said; with that one all is well."""
    path, joints = urdf(tmp_path / "a.urdf"), [f"j{k}" for k in range(1, 6)]
    path.write_text(path.read_text().replace("0.6 0 0.8", axis))
    assert tip_out_of_flange(build_arm(path, tip=said, joints=joints), said) == "l5:x"
    assert tip_out_of_flange(build_arm(path, tip="l5:x", joints=joints), "l5:x") is None


@pytest.mark.thorough
def test_what_is_told_of_the_flange_helps() -> None:
    """The Z1's frames have x out of them, and it reaches lower and nearer than the others do."""
    path = Path(get_paths()["purelib"]) / "cmeel.prefix/share/example-robot-data/robots"
    path, joints = path / "z1_description/urdf/z1.urdf", [f"joint{k}" for k in range(1, 7)]
    with pytest.raises(ModelError, match="say --tip link06:x"):
        station(path, TOOLS["suction"], "belt", PARTS_SCENE, tip="link06", joints=joints)
    at = station(path, TOOLS["suction"], "belt", PARTS_SCENE, tip="link06:x", joints=joints)
    assert np.allclose(at.arm.orientation(at.arm.q_ready)[:, 2], (0.0, 0.0, -1.0), atol=1e-3)
