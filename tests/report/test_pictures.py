"""Pictures: every body appears where the camera sees it, the nearer one in front."""

import base64
import io

import matplotlib.image
import mujoco
import numpy as np
import pytest

from mitt.core.arm.arm import Arm
from mitt.core.signals import Array
from mitt.lab.report.painter import View, painted, png_of, seen_from
from mitt.lab.report.pictures import body_faces, placed_faces
from mitt.lab.world.build import build_scene
from mitt.lab.world.scene import Scene

_FLOOR = -1.0
#: What the camera looks at [m].
TARGET = (0.72, 0.0, 0.16)


def _pixels(corners: Array, colours: Array) -> Array:
    """Return the picture of some faces, shape (height, width, 3)."""
    png = base64.b64decode(png_of(painted(corners, colours, _FLOOR)))
    image: Array = matplotlib.image.imread(io.BytesIO(png), format="png")[:, :, :3]
    return image


def _square(at: Array, half: float) -> Array:
    """Return two triangles that face the camera, around a point, shape (2, 3, 3)."""
    x, z = half * np.array([1.0, 0.0, 0.0]), half * np.array([0.0, 0.0, 1.0])
    a, b, c, d = at - x - z, at + x - z, at + x + z, at - x + z
    return np.array([[a, b, c], [a, c, d]])


def _beside(x: float, y: float, z: float) -> Array:
    """Return the point that the camera looks at, moved by so much [m]."""
    return np.add(TARGET, (x, y, z), dtype=np.float64)


def _red(image: Array) -> tuple[float, float, int]:
    """Return the mean row and column of what is red in a picture, and how many pixels it has."""
    rows, columns = np.nonzero(image[:, :, 0] > 2.0 * image[:, :, 1])
    return float(rows.mean()), float(columns.mean()), len(rows)


def test_a_face_is_drawn_where_it_is() -> None:
    """What the camera looks at is near the middle, x to the right, z up; far is small."""
    red = np.tile((0.9, 0.1, 0.1), (2, 1))
    row, column, size = _red(_pixels(_square(_beside(0.0, 0.0, 0.0), 0.03), red))
    assert (row, column) == pytest.approx((130.5, 169.5), abs=6.0)
    right = _red(_pixels(_square(_beside(0.4, 0.0, 0.0), 0.03), red))
    up = _red(_pixels(_square(_beside(0.0, 0.0, 0.4), 0.03), red))
    assert right[1] > column + 50.0
    assert abs(right[0] - row) < 10.0
    assert up[0] < row - 50.0
    assert abs(up[1] - column) < 10.0
    far = _red(_pixels(_square(_beside(0.0, 2.0, 0.0), 0.03), red))
    assert far[2] < 0.6 * size


def test_what_is_nearer_hides_what_is_behind_it() -> None:
    """Whatever the order of the faces, the square nearer to the camera is the one that shows."""
    near, far = _square(_beside(0.0, -0.5, 0.0), 0.05), _square(_beside(0.0, 0.5, 0.0), 0.5)
    red, blue = np.tile((0.9, 0.1, 0.1), (2, 1)), np.tile((0.1, 0.1, 0.9), (2, 1))
    for order in ((near, far, red, blue), (far, near, blue, red)):
        image = _pixels(np.concatenate(order[:2]), np.concatenate(order[2:]))
        row, column, _ = _red(image)
        assert image[round(row), round(column), 0] > image[round(row), round(column), 2]
        assert np.sum(image[:, :, 2] > 2.0 * image[:, :, 0]) > 1000


@pytest.mark.parametrize("azimuth", [-85.5, 20.0, 140.0])
def test_a_view_is_a_perspective(azimuth: float) -> None:
    """The target is in the middle, z is up, and things shrink as their distance grows."""
    view = seen_from(12.0, azimuth, TARGET)
    right, down, ahead = view.axes
    np.testing.assert_allclose(view.axes @ view.axes.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(np.cross(right, down), ahead, atol=1e-12)
    assert right[2] == 0.0
    assert down[2] < 0.0
    at = view.pixels(np.array([TARGET, TARGET + 0.1 * right, TARGET + 0.1 * right + 3.6 * ahead]))
    np.testing.assert_allclose(at[0], (170.0, 131.0, 3.6), atol=1e-9)
    assert at[1][0] - 170.0 == pytest.approx(2.0 * (at[2][0] - 170.0))
    assert at[1][1] == pytest.approx(131.0)


def test_what_is_above_the_floor_throws_a_shadow_on_it() -> None:
    """The floor is darker below a plate than without it, and only there."""
    view = View(eye=(0.0, -4.0, 2.0), target=(0.0, 0.0, _FLOOR), angle=0.9)
    a, b, c, d = np.array([(-0.3, -0.3, 0), (0.3, -0.3, 0), (0.3, 0.3, 0), (-0.3, 0.3, 0)])
    plate, red = np.array([[a, b, c], [a, c, d]]), np.tile((0.9, 0.1, 0.1), (2, 1))
    with_it = np.asarray(painted(plate, red, _FLOOR, view=view), np.int64)
    without = np.asarray(painted(plate[:0], red[:0], _FLOOR, view=view), np.int64)
    darker = np.all(with_it < without, axis=2) & (with_it[:, :, 0] <= 1.1 * with_it[:, :, 1])
    assert 200 < np.sum(darker) < 0.1 * darker.size


def test_the_ball_is_drawn_where_the_plant_has_it(arm: Arm) -> None:
    """The middle of the ball's faces is the ball's place, in any state of the plant."""
    scene = Scene()
    model = build_scene(scene, arm.model).model
    bodies = [body_faces(model, b, arm, scene) for b in range(model.nbody)]
    data, ball = mujoco.MjData(model), model.body("ball").id
    mujoco.mj_resetData(model, data)
    data.qpos[-7:-4] = (1.5, 0.2, 0.4)
    mujoco.mj_kinematics(model, data)
    corners, colours = placed_faces(model, bodies, data.qpos, np.zeros((0, 3)))
    start = sum(len(f) for f, _ in bodies[:ball])
    mine = corners[start : start + len(bodies[ball][0])].reshape(-1, 3)
    np.testing.assert_allclose(
        0.5 * (mine.min(axis=0) + mine.max(axis=0)), data.xpos[ball], atol=1e-3
    )
    assert corners.shape == (len(colours), 3, 3)
