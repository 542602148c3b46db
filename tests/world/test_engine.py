"""Compiled code sees MuJoCo as Python does, and makes the same steps."""

import mujoco
import numpy as np
from numba import njit

from mitt.io.load import build_arm
from mitt.lab.world.build import build_scene
from mitt.lab.world.engine import MOST, Plant, contact_force, plant_of, step1, step2
from mitt.lab.world.scene import exact_scene

SCENE = build_scene(exact_scene(), build_arm("wam").model)


@njit
def _run(plant: Plant, steps: int) -> None:
    """Make steps."""
    for _ in range(steps):
        step1(plant.address[0], plant.address[1])
        step2(plant.address[0], plant.address[1])


@njit
def _force(plant: Plant, contact: int, six: np.ndarray) -> None:
    """Ask for a contact's force."""
    contact_force(plant.address[0], plant.address[1], contact, six.ctypes.data)


def falling() -> mujoco.MjData:
    """Return a ball that is about to meet the hand of an arm that sinks."""
    data, ball = mujoco.MjData(SCENE.model), SCENE.joints + SCENE.fingers
    data.qpos[: SCENE.joints] = build_arm("wam").q_ready
    mujoco.mj_kinematics(SCENE.model, data)
    data.qpos[ball : ball + 3] = data.site_xpos[SCENE.site]
    return data


def test_compiled_steps_are_pythons() -> None:
    """300 steps of a ball on the hand, called either way, end in the same bits."""
    ours, theirs = falling(), falling()
    plant = plant_of(SCENE.model, ours, SCENE.site, SCENE.joints)
    touched = 0
    for _ in range(60):
        _run(plant, 5)
        for _ in range(5):
            mujoco.mj_step1(SCENE.model, theirs)
            mujoco.mj_step2(SCENE.model, theirs)
        touched += theirs.ncon
        assert plant.contacts[0] == theirs.ncon == ours.ncon
        assert np.array_equal(plant.geoms[: theirs.ncon], theirs.contact.geom)
        assert ours.qpos.tobytes() == theirs.qpos.tobytes()
        assert ours.qvel.tobytes() == theirs.qvel.tobytes()
        for contact in range(theirs.ncon):
            six, wanted = np.zeros(6), np.zeros(6)
            _force(plant, contact, six)
            mujoco.mj_contactForce(SCENE.model, theirs, contact, wanted)
            assert np.array_equal(six, wanted)
    assert 0 < touched < 60 * MOST


def test_the_length_of_a_step_is_the_models() -> None:
    """What compiled code writes is what the model says."""
    data = falling()
    step = plant_of(SCENE.model, data, SCENE.site, SCENE.joints).step
    before = SCENE.model.opt.timestep
    step[0] = 0.00025
    assert SCENE.model.opt.timestep == 0.00025
    SCENE.model.opt.timestep = before
    assert step[0] == before
