"""The plant is the arm that the catcher reckons with: MuJoCo and Pinocchio agree."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.core.arm.arm import Arm
from mitt.core.arm.description import Capsule
from mitt.core.errors import ModelError
from mitt.core.signals import Array
from mitt.io.load import build_arm
from mitt.lab.world.build import PlantDraw, build_scene, describe
from mitt.lab.world.scene import Mismatch, Scene, exact_scene

ARM = build_arm("wam")
PLANT = build_scene(exact_scene(), ARM.model)
TORQUE = 1e-9  # [N m]
PLACE = 1e-12  # [m]
angles = st.tuples(st.floats(-2.5, 2.5), st.floats(-1.9, 1.9), st.floats(-0.8, 3.0)).map(np.array)
rates = st.tuples(*[st.floats(-20.0, 20.0)] * 3).map(np.array)


def still(q: Array, dq: Array) -> mujoco.MjData:
    """Return the plant with the arm in some state, fingers open, the ball far away."""
    data = mujoco.MjData(PLANT.model)
    data.qpos[:3], data.qvel[:3] = q, dq
    data.qpos[6:9] = [50.0, 0.0, 50.0]
    return data


@given(q=angles, dq=rates, ddq=rates)
def test_inverse_dynamics_agree_with_pinocchio(q: Array, dq: Array, ddq: Array) -> None:
    """With the fingers carried along rigidly, MuJoCo asks for the torque of eq. (14)."""
    data = still(q, dq)
    data.qacc[:3] = 10.0 * ddq
    mujoco.mj_forward(PLANT.model, data)
    data.qacc[:] = 0.0
    data.qacc[:3] = 10.0 * ddq
    out = np.zeros(PLANT.model.nv)
    mujoco.mj_rne(PLANT.model, data, 1, out)
    rotors = PLANT.model.dof_armature[:3] * 10.0 * ddq
    wanted = ARM.inverse_dynamics(q, dq, 10.0 * ddq)
    assert out[:3] + rotors == pytest.approx(wanted, abs=TORQUE)


@given(q=angles, dq=rates)
def test_the_catch_point_is_where_the_arm_says(q: Array, dq: Array) -> None:
    """Site position is l(q) and its velocity J dq."""
    data = still(q, dq)
    mujoco.mj_forward(PLANT.model, data)
    velocity = np.zeros(6)
    kind = mujoco.mjtObj.mjOBJ_SITE
    mujoco.mj_objectVelocity(PLANT.model, data, kind, PLANT.site, velocity, 0)
    assert data.site_xpos[PLANT.site] == pytest.approx(ARM.position(q), abs=PLACE)
    assert velocity[3:] == pytest.approx(ARM.jacobian(q) @ dq, abs=1e-10)


def test_the_arm_can_move_through_the_catch_untouched() -> None:
    """From the ready pose to well beyond the catch no part of arm and hand meets another."""
    for q4 in np.linspace(0.0, 2.8, 30):
        for q2 in (0.4, 0.8, 1.2):
            data = still(np.array([0.2, q2, q4]), np.zeros(3))
            mujoco.mj_fwdPosition(PLANT.model, data)
            assert data.ncon == 0


def test_the_forearm_meets_the_upper_arm() -> None:
    """Bent to its stop the arm touches itself: successive links are not left out."""
    data = still(np.array([0.0, 0.8, 3.1]), np.zeros(3))
    mujoco.mj_fwdPosition(PLANT.model, data)
    assert data.ncon > 0


def test_an_arm_without_a_hand_is_refused() -> None:
    """The world needs fingers."""
    with pytest.raises(ModelError, match="hand"):
        build_scene(Scene(), replace(ARM.model, hand=None))


def test_the_fixture_and_the_module_arm_are_the_same(arm: Arm) -> None:
    """Both are the WAM with three active joints, and the plant has as many."""
    assert arm.names == ARM.names
    assert PLANT.joints == arm.n == 3
    assert PLANT.fingers == 3


@pytest.mark.parametrize("seed", range(4))
def test_a_ball_of_another_radius_touches_at_that_radius(seed: int) -> None:
    """Whatever radius a trial draws, contact begins when a ball over the floor is that far off."""
    scene = Scene(mismatch=Mismatch(ball_radius=0.2))
    plant = build_scene(scene, ARM.model)
    data, rng = mujoco.MjData(plant.model), np.random.default_rng(seed)
    radius = PlantDraw(scene, plant).draw(data, rng, ball=rng).radius
    assert radius != scene.ball.radius
    data.qpos[:3], data.qpos[9] = ARM.model.q_ready, 1.0
    for gap, contacts in ((1e-6, 0), (-1e-6, 1)):
        data.qpos[6:9] = [0.0, 3.0, scene.floor + radius + gap]
        mujoco.mj_fwdPosition(plant.model, data)
        assert data.ncon == contacts
    mujoco.mj_kinematics(plant.model, data)
    pad = plant.model.geom("pad")
    frame = data.geom_xmat[pad.id].reshape(3, 3)
    for gap, touches in ((1e-6, False), (-1e-6, True)):
        away = (plant.model.geom_size[pad.id, 1] + radius + gap) * frame[:, 2]
        data.qpos[6:9] = data.geom_xpos[pad.id] + away
        mujoco.mj_fwdPosition(plant.model, data)
        pairs = data.contact.geom[: data.ncon]
        assert (
            bool(np.any(np.all(np.sort(pairs) == sorted((pad.id, plant.ball)), axis=1))) == touches
        )


def test_links_that_overlap_when_ready_do_not_push_each_other() -> None:
    """Capsules about a wrist's meshes are wider than the wrist: no contact while the arm waits."""
    arm = build_arm("wam")
    links = list(arm.model.links)
    ends = {0: (0.42, 0.0, 0.36), 3: (0.0, 0.0, 0.2)}
    for k, end in ends.items():
        wide = Capsule(start=(0.0, 0.0, 0.0), end=end, radius=0.12)
        links[k] = replace(links[k], capsules=(wide,))
    model = replace(arm.model, links=tuple(links))
    spec, _ = describe(exact_scene(), model)
    assert {(x.bodyname1, x.bodyname2) for x in spec.excludes} >= {("link_j1", "link_j4")}
    compiled = spec.compile()
    data = mujoco.MjData(compiled)
    data.qpos[: arm.n] = arm.q_ready
    mujoco.mj_forward(compiled, data)
    touching = {
        frozenset(compiled.body(compiled.geom_bodyid[g]).name for g in (c.geom1, c.geom2))
        for c in data.contact[: data.ncon]
    }
    assert frozenset(("link_j1", "link_j4")) not in touching
