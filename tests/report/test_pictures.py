"""Pictures: every body appears where the camera sees it, the nearer one in front."""

import io

import matplotlib.image
import mujoco
import numpy as np
import pytest

from mitt.report.figures.pictures import body_faces, drawn, placed, project, shaded
from mitt.robot.arm import Arm
from mitt.signals import Array
from mitt.world.build import build_plant
from mitt.world.scene import Scene

_FLOOR = -1.0


def _pixels(corners: Array, colours: Array) -> Array:
    """Return the picture of some faces, shape (height, width, 3)."""
    png = drawn(corners, colours, _FLOOR)
    image: Array = matplotlib.image.imread(io.BytesIO(png), format="png")[:, :, :3]
    return image


def _square(at: Array, half: float) -> Array:
    """Return two triangles that face the camera, around a point, shape (2, 3, 3)."""
    x, z = half * np.array([1.0, 0.0, 0.0]), half * np.array([0.0, 0.0, 1.0])
    a, b, c, d = at - x - z, at + x - z, at + x + z, at - x + z
    return np.array([[a, b, c], [a, c, d]])


def _place(at: Array) -> tuple[int, int]:
    """Return row and column of a point in a picture of 340 x 262 pixels."""
    x, y = project(at)
    return round(0.5 * 262 * (1.0 - y) - 0.5), round(0.5 * 262 * x + 0.5 * 340 - 0.5)


@pytest.mark.parametrize("at", [(0.7, 0.0, 0.2), (1.2, 0.3, 0.5), (0.3, -0.3, 0.0)])
def test_a_face_is_drawn_where_it_is_projected_to(at: tuple[float, float, float]) -> None:
    """The middle of a small red square is red, a little beside it is not."""
    corners, red = _square(np.array(at), 0.03), np.tile((0.9, 0.1, 0.1), (2, 1))
    image, (row, column) = _pixels(corners, red), _place(np.array(at))
    assert image[row, column, 0] > 2.0 * image[row, column, 1]
    assert image[row - 25, column, 0] < 1.2 * image[row - 25, column, 1]


def test_what_is_nearer_hides_what_is_behind_it() -> None:
    """Whatever the order of the faces, the square nearer to the camera is the one that shows."""
    near, far = _square(np.array([0.7, -0.5, 0.2]), 0.05), _square(np.array([0.7, 0.5, 0.17]), 0.5)
    red, blue = np.tile((0.9, 0.1, 0.1), (2, 1)), np.tile((0.1, 0.1, 0.9), (2, 1))
    row, column = _place(np.array([0.7, -0.5, 0.2]))
    for order in ((near, far, red, blue), (far, near, blue, red)):
        image = _pixels(np.concatenate(order[:2]), np.concatenate(order[2:]))
        assert image[row, column, 0] > image[row, column, 2]


def test_faces_that_look_away_are_left_out() -> None:
    """Of a square only the side that faces the camera is drawn."""
    square, grey = _square(np.array([0.7, 0.0, 0.2]), 0.05), np.full((2, 3), 0.5)
    assert len(shaded(square, grey)[0]) == 2
    assert len(shaded(square[:, ::-1], grey)[0]) == 0


def test_the_ball_is_drawn_where_the_plant_has_it(arm: Arm) -> None:
    """The middle of the ball's faces is the ball's place, in any state of the plant."""
    scene = Scene()
    model = build_plant(scene, arm.model).model
    bodies = [body_faces(model, b, arm, scene) for b in range(model.nbody)]
    data, ball = mujoco.MjData(model), model.body("ball").id
    mujoco.mj_resetData(model, data)
    data.qpos[-7:-4] = (1.5, 0.2, 0.4)
    mujoco.mj_kinematics(model, data)
    corners, colours = placed(model, bodies, data.qpos, np.zeros((0, 3)))
    start = sum(len(f) for f, _ in bodies[:ball])
    mine = corners[start : start + len(bodies[ball][0])].reshape(-1, 3)
    np.testing.assert_allclose(0.5 * (mine.min(axis=0) + mine.max(axis=0)), data.xpos[ball],
                               atol=1e-3)  # fmt: skip
    assert corners.shape == (len(colours), 3, 3)
