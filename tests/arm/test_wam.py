"""The WAM against its sources, and its two implementations against each other."""

import mujoco
import numpy as np
import pytest

from mitt.core.arm.arm import Arm
from mitt.core.arm.hands import HandModel
from mitt.io.wam import TRANSMISSION, wam, wam_limits
from mitt.lab.world.plant import add_arm

AGREE = 1e-9
#: Published figures are rounded in their last digit.
ROUNDING = 5e-4
#: The source's own figures for one motor type differ by 11 %, joint 4 being the lowest.
MOTOR_SPREAD = 1.12


def both(held_3: float | None) -> tuple[Arm, mujoco.MjModel, mujoco.MjData]:
    """Return the arm of the catcher and the same arm in MuJoCo, without contacts and stops."""
    model = wam(HandModel(), held_3=held_3)
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.disableflags = mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    add_arm(spec, model.complete())
    built = spec.compile()
    return Arm(model, wam_limits("paper")), built, mujoco.MjData(built)


@pytest.mark.parametrize("held_3", [0.0, 0.4, None])
def test_pinocchio_and_mujoco_are_the_same_arm(held_3: float | None) -> None:
    """Pose, Jacobian, mass matrix and torque agree to 1e-9 at random states."""
    arm, model, data = both(held_3)
    rng = np.random.default_rng(5)
    for _ in range(20):
        q, dq, ddq = (s * rng.standard_normal(arm.n) for s in (1.0, 4.0, 30.0))
        data.qpos[:], data.qvel[:], data.qacc[:] = q, dq, ddq
        mujoco.mj_inverse(model, data)
        site = data.site("catch_point")
        J, M = np.zeros((3, arm.n)), np.zeros((arm.n, arm.n))
        mujoco.mj_jacSite(model, data, J, None, site.id)
        mujoco.mj_fullM(model, data, M)
        assert np.allclose(arm.position(q), site.xpos, atol=AGREE)
        assert np.allclose(arm.orientation(q), site.xmat.reshape(3, 3), atol=AGREE)
        assert np.allclose(arm.jacobian(q), J, atol=AGREE)
        assert np.allclose(arm.mass_matrix(q), M, atol=AGREE)
        assert np.allclose(arm.inverse_dynamics(q, dq, ddq), data.qfrc_inverse, atol=AGREE)


def test_upright_the_tool_plate_is_where_the_paper_says(arm: Arm) -> None:
    """Upright, the catch point is 0.90 m + 0.12 m above the shoulder (Table 1)."""
    assert np.allclose(arm.position(np.zeros(3)), [0.0, 0.0, 1.02], atol=AGREE)
    nominal = arm.position(np.array([0.0, np.pi / 4, np.pi / 2]))
    assert np.allclose(nominal, [0.785, 0.0, 0.057], atol=ROUNDING)


def test_positive_angles_lean_and_bend_forward(arm: Arm) -> None:
    """Positive q2 and positive q4 move the upright hand towards +x; positive q1 turns left."""
    J = arm.jacobian(np.zeros(3))
    assert J[0, 1] > 0.5
    assert J[0, 2] > 0.3
    assert arm.position(np.array([0.1, 0.8, 0.5]))[1] > 0.0


def test_rotor_inertia_is_the_reflected_motor_inertia() -> None:
    """Armatures equal N' Jm N for one motor inertia, the differential leaving no coupling."""
    stated = np.array([link.armature for link in wam(HandModel()).links])
    per_motor = TRANSMISSION.T @ TRANSMISSION
    assert np.allclose(per_motor, np.diag(np.diag(per_motor)), atol=1e-9)
    motor = stated / np.diag(per_motor)
    assert motor.max() / motor.min() < MOTOR_SPREAD


def test_no_load_speeds_are_those_of_the_manual() -> None:
    """48 V and 80 V give the no-load joint speeds of the data sheet."""
    for name, speeds in (
        ("wam-48v", (2.39, 3.55, 5.96, 5.57)),
        ("wam-80v", (3.98, 5.91, 9.93, 9.28)),
    ):
        arm = Arm(wam(HandModel(), held_3=None), wam_limits(name))
        assert np.allclose(arm.dq_max, speeds, atol=0.01)


def test_without_rotors_joint_4_is_the_lighter_by_the_share_of_its_rotor() -> None:
    """At the start pose the rotors carry the share of the bare arm's inertia that is known."""
    bare = Arm(wam(HandModel(mass=1e-9, inertia=1e-12 * np.eye(3))), wam_limits("paper"))
    M = np.diag(bare.mass_matrix(bare.q_ready))
    assert np.allclose([0.0346 / M[2], 0.2052 / M[0]], [0.46, 0.27], atol=0.015)
