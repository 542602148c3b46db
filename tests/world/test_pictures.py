"""Pictures: every solid is met where MuJoCo meets it, and appears where the camera sees it."""

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.robot.load import load_arm
from mitt.world.build import build_plant
from mitt.world.pictures import View, picture, strip
from mitt.world.scene import Scene
from mitt.world.solids import BOX, CAPSULE, CYLINDER, FAR, SPHERE, Solids, meet

PLANT = build_plant(Scene(), load_arm("wam").model)
VIEW = View(width=120, height=100)
KINDS = {
    SPHERE: mujoco.mjtGeom.mjGEOM_SPHERE,
    CAPSULE: mujoco.mjtGeom.mjGEOM_CAPSULE,
    CYLINDER: mujoco.mjtGeom.mjGEOM_CYLINDER,
    BOX: mujoco.mjtGeom.mjGEOM_BOX,
}


@given(kind=st.sampled_from(sorted(KINDS)), seed=st.integers(0, 100_000))
def test_rays_meet_solids_where_mujoco_says(kind: int, seed: int) -> None:
    """Distance and normal agree with mju_rayGeom."""
    rng = np.random.default_rng(seed)
    size, pos = rng.uniform(0.05, 0.4, 3), rng.uniform(-0.2, 0.2, 3)
    mat = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    mat *= np.sign(np.linalg.det(mat))
    eye = 2.5 * _unit(rng)
    ray = _turned_to(pos + rng.uniform(-0.5, 0.5, 3) - eye)
    solids = Solids(np.array([kind]), pos[None], mat[None], size[None], np.zeros((1, 3)),
                    np.ones(1), np.zeros((1, 4)))  # fmt: skip
    normal, theirs = np.zeros(3), np.zeros(3)
    found = meet(solids, 0, eye, ray, normal)
    wanted = mujoco.mju_rayGeom(pos, mat.ravel(), size, eye, ray, int(KINDS[kind]), theirs)
    if wanted < 0.0:
        assert found == FAR
    else:
        assert found == pytest.approx(wanted, abs=1e-9)
        assert normal == pytest.approx(theirs, abs=1e-6)


def _unit(rng: np.random.Generator) -> np.ndarray:
    """Return a random direction."""
    return _turned_to(rng.standard_normal(3))


def _turned_to(v: np.ndarray) -> np.ndarray:
    """Return the unit vector along ``v``."""
    return np.asarray(v / np.linalg.norm(v))


def state(x: float, z: float) -> np.ndarray:
    """Return the plant in its ready pose with the ball somewhere."""
    qpos = np.zeros(PLANT.model.nq)
    qpos[:3] = [0.0, np.pi / 4, 0.0]
    qpos[6:10] = [x, 0.0, z, 1.0]
    return qpos


@pytest.mark.parametrize(("x", "z"), [(1.1, 0.4), (0.6, -0.3), (1.2, -0.1)])
def test_the_ball_appears_where_the_camera_sees_it(x: float, z: float) -> None:
    """The centroid of the orange pixels is the projected centre of the ball, to half a pixel."""
    image = picture(PLANT.model, state(x, z), VIEW).astype(float)
    orange = (image[:, :, 0] > 1.5 * image[:, :, 2]) & (image[:, :, 0] > 60.0)
    local = VIEW.axes() @ (np.array([x, 0.0, z]) - np.array(VIEW.eye))
    u = VIEW.focal * local[0] / local[2] + 0.5 * (VIEW.width - 1)
    v = VIEW.focal * local[1] / local[2] + 0.5 * (VIEW.height - 1)
    rows, columns = np.nonzero(orange)
    assert columns.mean() == pytest.approx(u, abs=0.5)
    assert rows.mean() == pytest.approx(v, abs=0.5)
    area = np.pi * (VIEW.focal * 0.04 / local[2]) ** 2
    assert orange.sum() == pytest.approx(area, rel=0.25)


def test_pictures_repeat_and_differ() -> None:
    """The same state gives the same picture, and dots of the trail are seen."""
    first, again = (picture(PLANT.model, state(1.0, 0.3), VIEW) for _ in range(2))
    dots = picture(PLANT.model, state(1.0, 0.3), VIEW, trail=np.array([[1.2, 0.0, 0.35]]))
    assert first.shape == (100, 120, 3)
    assert np.array_equal(first, again)
    assert 1 <= np.any(first != dots, axis=2).sum() < 60


def test_the_ball_throws_a_shadow() -> None:
    """Where the sun's ray through the ball meets the floor, the floor is darker than without."""
    view = View(eye=(1.0, -0.5, 4.0), target=(1.0, 0.2, -1.0), width=100, height=100)
    with_ball, without = (picture(PLANT.model, state(x, -0.8), view) for x in (1.0, 30.0))
    sun = np.array([0.35, -0.5, 0.79])
    shadow = np.array([1.0, 0.0, -0.8]) - 0.2 / sun[2] * sun - np.array(view.eye)
    local = view.axes() @ shadow
    u = round(view.focal * local[0] / local[2] + 49.5)
    v = round(view.focal * local[1] / local[2] + 49.5)
    assert with_ball[v, u].astype(float).sum() < 0.8 * without[v, u].astype(float).sum()


def test_a_strip_is_its_pictures_in_rows() -> None:
    """Five states in rows of three: two rows, each picture in its place."""
    states = np.array([state(1.2 - 0.1 * k, 0.3) for k in range(5)])
    view = View(width=40, height=30)
    sheet = strip(PLANT.model, states, view, columns=3)
    assert sheet.shape == (64, 128, 3)
    assert np.array_equal(sheet[34:64, 44:84], picture(PLANT.model, states[4], view))
