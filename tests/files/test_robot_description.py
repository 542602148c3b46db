"""The URDF in a recording is the arm: mitt reads it back, and its frames are where the arm is."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from mitt.core.arm.arm import Arm
from mitt.core.arm.hands import HandModel
from mitt.core.signals import Array
from mitt.io.load import build_arm
from mitt.io.messages import WORLD
from mitt.io.robot_description import (
    CATCH_POINT,
    HAND,
    LinkFrame,
    frames_of,
    quaternion,
    urdf_of,
)

_EXACT_M = 1e-9
_TELESCOPE = """<robot name="telescope">
  <link name="base"/><link name="boom"/><link name="rod"/><link name="tip"/>
  <joint name="swing" type="revolute"><parent link="base"/><child link="boom"/>
    <origin xyz="0 0 0.4" rpy="0.3 1.5707963267948966 -0.7"/><axis xyz="0.6 0 0.8"/>
    <limit lower="-2" upper="2" effort="50" velocity="4"/></joint>
  <joint name="slide" type="prismatic"><parent link="boom"/><child link="rod"/>
    <origin xyz="0.1 0 0" rpy="0 -1.5707963267948966 0"/><axis xyz="1 0 0"/>
    <limit lower="0" upper="0.5" effort="80" velocity="2"/></joint>
  <joint name="end" type="fixed"><parent link="rod"/><child link="tip"/>
    <origin xyz="0.2 0 0.1" rpy="0 0.5 0"/></joint>
</robot>"""
_MASS = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'


@pytest.fixture(params=["wam", "ur5e", "franka-panda", "telescope"])
def any_arm(request: pytest.FixtureRequest, tmp_path: Path) -> Arm:
    """An arm with fingers, one with a basket and held joints, one of seven, one that slides."""
    if request.param == "telescope":
        text = _TELESCOPE
        for link in ("boom", "rod"):
            text = text.replace(
                f'<link name="{link}"/>', f'<link name="{link}">{_MASS}</inertial></link>'
            )
        path = tmp_path / "telescope.urdf"
        path.write_text(text)
        return build_arm(path, tip="tip", joints=("swing", "slide"))
    if request.param == "ur5e":
        held = ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint")
        return build_arm("ur5e", joints=held, held={"wrist_1_joint": 0.7}, hand="basket")
    return build_arm(request.param, hand=HandModel())


def _poses(frames: tuple[LinkFrame, ...], q: Array, hand: float) -> dict[str, Array]:
    """Return the pose of each frame in the world, shape (4, 4)."""
    out, values = {WORLD: np.eye(4)}, np.array([*q, hand])
    for frame in frames:
        x, y, z, *turn = frame.poses(values[[frame.follows]])[0]
        T = np.eye(4)
        u, w = np.array(turn[:3]), turn[3]
        cross = np.array([[0, -u[2], u[1]], [u[2], 0, -u[0]], [-u[1], u[0], 0]])
        T[:3, :3] += 2.0 * (w * cross + cross @ cross)
        T[:3, 3] = x, y, z
        out[frame.name] = out[frame.parent] @ T
    return out


def test_the_description_and_the_frames_are_the_arm(any_arm: Arm, tmp_path: Path) -> None:
    """Read by mitt and by Pinocchio, and by its frames: the same catch point, normal and mass."""
    model, rng = any_arm.model, np.random.default_rng(4)
    path = tmp_path / "arm.urdf"
    path.write_text(urdf_of(any_arm))
    back = build_arm(path, tip=CATCH_POINT, joints=model.names)
    other = pin.buildModelFromUrdf(str(path))
    data, tip, full = other.createData(), other.getFrameId(CATCH_POINT), np.zeros(other.nq)
    places = [other.joints[other.getJointId(name)].idx_q for name in model.names]
    for _ in range(10):
        q = rng.uniform(any_arm.q_min, any_arm.q_max)
        poses = _poses(frames_of(any_arm), q, 0.3)
        full[places] = q
        pin.framesForwardKinematics(other, data, full)
        np.testing.assert_allclose(data.oMf[tip].translation, any_arm.position(q), atol=_EXACT_M)
        np.testing.assert_allclose(back.position(q), any_arm.position(q), atol=_EXACT_M)
        np.testing.assert_allclose(poses[CATCH_POINT][:3, 3], any_arm.position(q), atol=_EXACT_M)
        normal = poses[HAND][:3, 2]
        np.testing.assert_allclose(normal, any_arm.orientation(q)[:, 2], atol=_EXACT_M)
    np.testing.assert_allclose(back.q_max, any_arm.q_max, atol=_EXACT_M)
    np.testing.assert_allclose(back.tau_max, any_arm.tau_max, rtol=_EXACT_M)
    weighs = sum(link.mass for link in model.links) + (
        0.0 if model.hand is None else model.hand.mass
    )
    assert sum(link.mass for link in back.model.links) == pytest.approx(weighs)


def test_fingers_close_as_the_hand_says(arm: Arm) -> None:
    """The tip of a finger, drawn at an angle, is where the hand's model has it."""
    hand = arm.model.hand
    assert isinstance(hand, HandModel)
    frames, angle = frames_of(arm), 0.8
    poses = _poses(frames, arm.model.q_ready, angle)
    open_, closed = (np.array(hand.finger.points(x)) for x in (0.0, angle))
    tip = np.array([open_[2, 0] - open_[0, 0], 0.0, open_[2, 1] - open_[0, 1], 1.0])
    at = np.linalg.inv(poses[HAND]) @ poses["finger_0"] @ tip
    np.testing.assert_allclose(np.hypot(at[0], at[1]), np.hypot(closed[2, 0], hand.finger.offset))
    np.testing.assert_allclose(at[2], closed[2, 1])


def test_a_quaternion_turns_as_its_matrix() -> None:
    """Also by half a turn, where the scalar part is zero."""
    for x in (np.array([0.0, 0.0, 1.0, 0.0]), np.array([0.5, -0.5, 0.5, 0.5])):
        u, w = x[:3], x[3]
        cross = np.array([[0, -u[2], u[1]], [u[2], 0, -u[0]], [-u[1], u[0], 0]])
        R = np.eye(3) + 2.0 * (w * cross + cross @ cross)
        assert abs(quaternion(R) @ x) == pytest.approx(1.0, abs=1e-12)
