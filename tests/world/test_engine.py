"""Compiled code sees MuJoCo as Python does, and makes the same steps."""

import mujoco
import numpy as np
from numba import njit

from mitt.robot.load import load_arm
from mitt.world.build import build_plant
from mitt.world.engine import MOST, Views, contact_force, step1, step2, views_of
from mitt.world.scene import exact_scene

PLANT = build_plant(exact_scene(), load_arm("wam").model)


@njit
def _run(views: Views, steps: int) -> None:
    """Make steps."""
    for _ in range(steps):
        step1(views[0][0], views[0][1])
        step2(views[0][0], views[0][1])


@njit
def _force(views: Views, contact: int, six: np.ndarray) -> None:
    """Ask for a contact's force."""
    contact_force(views[0][0], views[0][1], contact, six.ctypes.data)


def falling() -> mujoco.MjData:
    """Return a ball that is about to meet the hand of an arm that sinks."""
    data, ball = mujoco.MjData(PLANT.model), PLANT.joints + PLANT.fingers
    data.qpos[: PLANT.joints] = load_arm("wam").q_ready
    mujoco.mj_kinematics(PLANT.model, data)
    data.qpos[ball : ball + 3] = data.site_xpos[PLANT.site]
    return data


def test_compiled_steps_are_pythons() -> None:
    """300 steps of a ball on the hand, called either way, end in the same bits."""
    ours, theirs = falling(), falling()
    views = views_of(PLANT.model, ours, PLANT.site, PLANT.joints)
    touched = 0
    for _ in range(60):
        _run(views, 5)
        for _ in range(5):
            mujoco.mj_step1(PLANT.model, theirs)
            mujoco.mj_step2(PLANT.model, theirs)
        touched += theirs.ncon
        assert views[1][0] == theirs.ncon == ours.ncon
        assert np.array_equal(views[2][: theirs.ncon], theirs.contact.geom)
        assert ours.qpos.tobytes() == theirs.qpos.tobytes()
        assert ours.qvel.tobytes() == theirs.qvel.tobytes()
        for contact in range(theirs.ncon):
            six, wanted = np.zeros(6), np.zeros(6)
            _force(views, contact, six)
            mujoco.mj_contactForce(PLANT.model, theirs, contact, wanted)
            assert np.array_equal(six, wanted)
    assert 0 < touched < 60 * MOST


def test_the_length_of_a_step_is_the_models() -> None:
    """What compiled code writes is what the model says."""
    data = falling()
    step = views_of(PLANT.model, data, PLANT.site, PLANT.joints)[3]
    before = PLANT.model.opt.timestep
    step[0] = 0.00025
    assert PLANT.model.opt.timestep == 0.00025
    PLANT.model.opt.timestep = before
    assert step[0] == before
