"""Many poses at once: the same kinematics as the arm's own, and as finite differences."""

import numpy as np
import pytest

from mitt.core.arm.arm import Arm
from mitt.core.arm.hands import HandModel
from mitt.lab.design.driven_arm import whole_arm
from mitt.lab.design.poses import poses_of, touching
from mitt.lab.world.scene import Scene

#: Step of central differences [rad], and what they agree to.
_STEP = 1e-6
_ROUNDED = 1e-8


@pytest.fixture(scope="module")
def whole() -> Arm:
    return whole_arm("wam", tip=None, limits="wam-80v", hand=HandModel())


def test_places_and_jacobians_are_those_of_the_arm(whole: Arm) -> None:
    q = np.random.default_rng(3).uniform(whole.q_min, whole.q_max, (40, whole.n))
    poses = poses_of(whole.model, q)
    for k in range(len(q)):
        np.testing.assert_allclose(poses.tip[k], whole.position(q[k]), atol=1e-12)
        np.testing.assert_allclose(poses.J[k].T, whole.jacobian(q[k]), atol=1e-12)
        np.testing.assert_allclose(poses.palm[k], whole.orientation(q[k])[:, 2], atol=1e-12)


def test_jacobians_are_the_central_differences_of_places(whole: Arm) -> None:
    q = np.random.default_rng(4).uniform(whole.q_min, whole.q_max, (10, whole.n))
    poses = poses_of(whole.model, q)
    for joint in range(whole.n):
        step = np.zeros(whole.n)
        step[joint] = _STEP
        ahead, behind = (poses_of(whole.model, q + x).tip for x in (step, -step))
        np.testing.assert_allclose(
            poses.J[:, joint], (ahead - behind) / (2.0 * _STEP), atol=_ROUNDED
        )


def test_some_poses_are_taken_from_all(whole: Arm) -> None:
    q = np.random.default_rng(5).uniform(whole.q_min, whole.q_max, (6, whole.n))
    poses = poses_of(whole.model, q)
    some = poses.take(np.array([4, 1]))
    np.testing.assert_array_equal(some.tip, poses.tip[[4, 1]])
    np.testing.assert_array_equal(some.W, poses.W[[4, 1]])


#: The WAM's base ends 0.346 m below its shoulder.
TABLE = Scene(floor=-0.36)
PEDESTAL = Scene(floor=-1.0)


@pytest.mark.parametrize(("scene", "low"), [(TABLE, True), (PEDESTAL, False)])
def test_an_arm_on_a_table_touches_it_where_it_reaches_down(
    arm: Arm, scene: Scene, *, low: bool
) -> None:
    """In its ready pose it stands there; straight and 23 degrees below the horizontal it hits."""
    assert not touching(arm, scene, arm.q_ready[None])
    down = np.array([0.0, 0.5 * np.pi + 0.4, 0.0])
    assert touching(arm, scene, down[None]) == low
