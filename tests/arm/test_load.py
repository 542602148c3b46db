"""Arms from files: the same kinematics as the file, and one clear line for what cannot be."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import mitt
from mitt.core.arm.hands import HandModel
from mitt.core.errors import FileError, MittError, ModelError, UnknownNameError
from mitt.io.load import TIP_AXES, build_arm

LINK = """<link name="l{k}"><inertial><origin xyz="0 0 0.2"/><mass value="{mass}"/>
<inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
JOINT = """<joint name="j{k}" type="{kind}"><parent link="l{p}"/><child link="l{k}"/>
<origin xyz="0.1 0 0.4"/><axis xyz="{axis}"/>
<limit lower="-2" upper="2.5" effort="{effort}" velocity="5"/></joint>"""


def urdf(path: Path, *, mass: str = "2.0", kind: str = "revolute", effort: str = "50") -> Path:
    """Write a five-joint arm."""
    axes = ("0 0 1", "0 1 0", "1 0 0", "0 1 0", "0.6 0 0.8")
    links = [LINK.format(k=k, mass=mass if k == 3 else "2.0") for k in range(6)]
    joints = [
        JOINT.format(k=k, p=k - 1, kind=kind if k == 2 else "revolute", axis=axis, effort=effort)
        for k, axis in enumerate(axes, start=1)
    ]
    path.write_text(f'<robot name="five">{"".join(links + joints)}</robot>')
    return path


def test_a_file_arm_is_where_its_file_says(tmp_path: Path) -> None:
    """Position, Jacobian and torque of the active joints agree with Pinocchio on the file."""
    path = urdf(tmp_path / "five.urdf")
    arm = build_arm(path, tip="l5", joints=["j1", "j2", "j4"])
    full = pin.buildModelFromUrdf(str(path))
    data, at = full.createData(), [0, 1, 3]
    q, dq, ddq = (np.random.default_rng(k).standard_normal(3) for k in range(3))
    whole = [np.zeros(5) for _ in range(3)]
    for vector, part in zip(whole, (q, dq, ddq), strict=True):
        vector[at] = part
    frame = full.getFrameId("l5")
    pin.framesForwardKinematics(full, data, whole[0])
    assert np.allclose(arm.position(q), data.oMf[frame].translation, atol=1e-12)
    J = pin.computeFrameJacobian(full, data, whole[0], frame, pin.LOCAL_WORLD_ALIGNED)[:3, at]
    assert np.allclose(arm.jacobian(q), J, atol=1e-12)
    tau = pin.rnea(full, data, *whole)[at]
    assert np.allclose(arm.inverse_dynamics(q, dq, ddq), tau, atol=1e-9)


def test_a_mounted_hand_catches_at_the_tip(tmp_path: Path) -> None:
    """A hand adds its weight but leaves the catch point at the tip."""
    path = urdf(tmp_path / "five.urdf")
    names = ["j1", "j2", "j4"]
    bare, armed = (build_arm(path, tip="l5", joints=names, hand=h) for h in (None, HandModel()))
    q = np.array([0.3, 0.4, -0.5])
    assert np.allclose(bare.position(q), armed.position(q), atol=1e-12)
    assert armed.mass_matrix(q)[1, 1] > bare.mass_matrix(q)[1, 1] + 0.1


def test_bad_files_are_refused_in_one_line(tmp_path: Path) -> None:
    """Broken, lying or unsuitable descriptions raise a MittError that says what was wanted."""
    names = ["j1", "j2", "j4"]
    good = urdf(tmp_path / "good.urdf")
    cut = tmp_path / "cut.urdf"
    cut.write_text(good.read_text()[:400])
    bomb = tmp_path / "bomb.urdf"
    bomb.write_text("<!DOCTYPE x><robot/>")
    nested = tmp_path / "nested.xml"
    nested.write_text('<mujoco><include file="other.xml"/></mujoco>')
    cases: list[tuple[Path, str, list[str], type[MittError]]] = [
        (tmp_path / "absent.urdf", "l5", names, FileError),
        (cut, "l5", names, FileError),
        (bomb, "l5", names, FileError),
        (nested, "l5", names, FileError),
        (urdf(tmp_path / "huge.urdf", mass="1e300"), "l5", names, ModelError),
        (good, "l9", names, UnknownNameError),
        (good, "l5", ["j1", "jx", "j4"], UnknownNameError),
        (good, "l2", names, ModelError),
        (urdf(tmp_path / "mass.urdf", mass="-2"), "l5", names, ModelError),
        (urdf(tmp_path / "text.urdf", mass="abc"), "l5", names, FileError),
        (urdf(tmp_path / "drone.urdf", kind="floating"), "l5", names, FileError),
        (urdf(tmp_path / "weak.urdf", effort="0"), "l5", names, ModelError),
        (tmp_path / "arm.stl", "l5", names, UnknownNameError),
    ]
    for path, tip, joints, kind in cases:
        with pytest.raises(kind) as caught:
            build_arm(path, tip=tip, joints=joints)
        assert "\n" not in str(caught.value)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("axis", ["0 0 1e300", "0 0 0", "1e-9 0 0", "nan 0 0", "x y z"])
def test_an_axis_without_a_direction_is_refused(tmp_path: Path, axis: str) -> None:
    """One line and no warning of an overflow."""
    path = urdf(tmp_path / "arm.urdf")
    path.write_text(path.read_text().replace('xyz="0.6 0 0.8"', f'xyz="{axis}"'))
    with pytest.raises(FileError, match="joint axes with a direction"):
        build_arm(path, tip="l5", joints=["j1", "j2", "j4"])


def test_a_parser_in_c_is_heard_not_seen(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """What urdfdom writes to the error stream becomes part of the one line."""
    path = urdf(tmp_path / "five.urdf")
    path.write_text(path.read_text().replace('xyz="0.1 0 0.4"', 'xyz="0.1 up 0.4"'))
    with pytest.raises(FileError, match="up"):
        build_arm(path, tip="l5", joints=["j1", "j2", "j4"])
    assert capfd.readouterr().err == ""


MJCF = """<mujoco model="two"><compiler angle="radian"/><custom>
 <numeric name="velocity_limit_a" data="8"/><numeric name="velocity_limit_b" data="12"/>
</custom><worldbody><body name="one"><joint name="a" axis="0 0 1" range="-2 2"
  actuatorfrcrange="-80 80"/><inertial pos="0 0 0.2" mass="2" diaginertia="0.02 0.02 0.01"/>
 <body name="two" pos="0 0 0.4"><joint name="b" axis="0 1 0" range="-1 2"
  actuatorfrcrange="-60 60"/><inertial pos="0 0 0.1" mass="1" diaginertia="0.01 0.01 0.005"/>
</body></body></worldbody></mujoco>"""


def test_an_mjcf_states_its_speeds_among_its_own_numbers(tmp_path: Path) -> None:
    """MJCF knows no limit of speed: ``velocity_limit_JOINT`` is one; without it, it is refused."""
    path = tmp_path / "two.xml"
    path.write_text(MJCF)
    arm = build_arm(path, tip="two", joints=["a", "b"])
    assert arm.dq_max.tolist() == [8.0, 12.0]
    assert arm.tau_max.tolist() == [80.0, 60.0]
    assert arm.q_min.tolist() == [-2.0, -1.0]
    for bad in ("nan", "-1", "fast", "inf"):
        path.write_text(MJCF.replace('data="12"', f'data="{bad}"'))
        with pytest.raises(FileError, match="velocity_limit_b"):
            build_arm(path, tip="two", joints=["a", "b"])
    path.write_text(MJCF.replace("velocity_limit_b", "other"))
    with pytest.raises(ModelError, match="velocity_limit_JOINT"):
        build_arm(path, tip="two", joints=["a", "b"])


def test_encoders_have_the_resolution_of_their_joint() -> None:
    """4096 counts a motor turn over the joint's ratio, or what the caller says."""
    turn = 2.0 * np.pi / 4096.0
    assert np.allclose(build_arm("wam").encoder_step, [turn / 42.0, turn / 28.25, turn / 18.0])
    assert np.allclose(build_arm("wam", encoder_step=1e-4).encoder_step, 1e-4)
    assert np.allclose(build_arm("wam", encoder_step=[1e-4, 2e-4, 3e-4]).encoder_step[1], 2e-4)
    for bad in (0.0, -1.0, [1e-4, 1e-4], float("nan")):
        with pytest.raises(ModelError, match=r"encoder"):
            build_arm("wam", encoder_step=bad)


def test_an_unknown_arm_says_which_files_may_be_named(tmp_path: Path) -> None:
    """Arm file, URDF and MJCF; a file that an arm file names is no arm file."""
    for load in (build_arm, mitt.load_arm):
        with pytest.raises(UnknownNameError) as caught:
            load("panda")
        for kind in ("wam", "arm file (.toml)", "URDF (.urdf)", "MJCF (.xml)"):
            assert kind in str(caught.value)
    with pytest.raises(UnknownNameError) as caught:
        build_arm(tmp_path / "other.toml", tip="l5", joints=["j1"])
    assert "arm file" not in str(caught.value)


def test_a_tip_without_joints_is_told_what_there_is(tmp_path: Path) -> None:
    """A wrong tip by its likeness and the links; a right one by its joints; none by the links."""
    path = urdf(tmp_path / "five.urdf")
    path.write_text(path.read_text().replace('"l5"', '"palm_link"'))
    with pytest.raises(UnknownNameError, match=r"did you mean 'palm_link'\?") as unknown:
        build_arm(path, tip="palm")
    assert unknown.value.available == ("l0", "l1", "l2", "l3", "l4", "palm_link")
    with pytest.raises(ModelError, match=r"base to 'l4': j1, j2, j3, j4$"):
        build_arm(path, tip="l4")
    with pytest.raises(ModelError, match="links of the file: l0, l1"):
        build_arm(path)
    with pytest.raises(FileError):
        build_arm(tmp_path / "absent.urdf")


@pytest.mark.parametrize("axis", TIP_AXES)
def test_a_hand_points_along_the_axis_that_a_tip_names(tmp_path: Path, axis: str) -> None:
    """Any axis of the frame, either way; the catch point stays, and a turn is about that axis."""
    path, names, q = urdf(tmp_path / "five.urdf"), ["j1", "j2", "j4"], np.array([0.3, 0.4, -0.5])
    plain = build_arm(path, tip="l5", joints=names)
    arm = build_arm(path, tip=f"l5:{axis}", joints=names)
    turned = build_arm(path, tip=f"l5:{axis}", joints=names, hand="three-finger", hand_turn=0.7)
    way = np.sign(-1.0 if axis[0] == "-" else 1.0) * np.eye(3)["xyz".index(axis[-1])]
    R = arm.orientation(q)
    assert np.allclose(R[:, 2], plain.orientation(q) @ way, atol=1e-12)
    assert np.allclose(R @ R.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(R) > 0.0
    assert np.allclose(turned.orientation(q)[:, 2], R[:, 2], atol=1e-12)
    assert np.allclose(turned.position(q), plain.position(q), atol=1e-12)


@pytest.mark.parametrize("tip", ["l5:w", "l5:", ":x", "l5:x:y", "x"])
def test_a_tip_of_no_such_axis_is_no_frame(tmp_path: Path, tip: str) -> None:
    with pytest.raises(UnknownNameError):
        build_arm(urdf(tmp_path / "five.urdf"), tip=tip, joints=["j1", "j2", "j4"])


def test_a_held_angle_in_degrees_is_told_its_unit(tmp_path: Path) -> None:
    """As a ready pose is."""
    path = urdf(tmp_path / "five.urdf")
    with pytest.raises(MittError, match="angles are in rad"):
        build_arm(path, tip="l5", joints=["j1", "j2", "j4"], held={"j3": 90.0})
