"""What a ball keeps of its speed on the palm is what the scene asks for."""

import mujoco
import numpy as np
import pytest

from mitt.core.arm.arm import Arm
from mitt.lab.world.build import (
    FRICTION_ON_PAD,
    RESTITUTION,
    SceneModel,
    build_scene,
    friction_of,
    on_pad,
    restitution_of,
)
from mitt.lab.world.scene import Ball, Contact, Scene, named_scene

#: Distances from the palm at which an impact begins [m]: contacts begin anywhere within a step.
STARTS = np.linspace(0.010, 0.012, 5)


def rebound(built: SceneModel, arm: Arm, speed: float, start: float) -> float:
    """Return the share of its speed that a ball keeps on a palm that is held still."""
    model = built.model
    data, n, ball = mujoco.MjData(model), built.joints + built.fingers, -6
    data.qpos[: built.joints] = arm.q_ready
    mujoco.mj_forward(model, data)
    held = data.qpos[:n].copy()
    place, normal = data.site_xpos[built.site], data.site_xmat[built.site].reshape(3, 3)[:, 2]
    data.qpos[-7:-4], data.qvel[ball : ball + 3] = place + start * normal, -speed * normal
    for _ in range(80):
        mujoco.mj_step(model, data)
        data.qpos[:n], data.qvel[:n] = held, 0.0
    return float(data.qvel[ball : ball + 3] @ normal / speed)


def measured(scene: Scene, arm: Arm, speed: float) -> float:
    """Return the mean restitution on the palm at a speed [m/s], without weight."""
    built = build_scene(scene, arm.model)
    built.model.opt.gravity[:] = 0.0
    return float(np.mean([rebound(built, arm, speed, start) for start in STARTS]))


@pytest.mark.parametrize("speed", [3.0, 4.5, 6.0])
@pytest.mark.parametrize("wanted", [0.2, 0.35, 0.5, 0.7, 0.85])
def test_the_measured_restitution_is_the_one_asked_for(
    arm: Arm, wanted: float, speed: float
) -> None:
    """Within 0.05, from 3 to 6 m/s, wherever within a step the contact begins."""
    scene = Scene(contact=Contact(restitution=wanted))
    assert measured(scene, arm, speed) == pytest.approx(wanted, abs=0.05)


@pytest.mark.parametrize("mass", [0.0027, 0.034, 0.2])
def test_restitution_does_not_depend_on_the_mass(arm: Arm, mass: float) -> None:
    """On a palm that is held still; from a table-tennis ball to a heavy one."""
    scene = Scene(ball=Ball(mass=mass), contact=Contact(restitution=0.5))
    assert measured(scene, arm, 4.5) == pytest.approx(0.5, abs=0.05)


def test_a_material_gives_friction_and_restitution_and_keys_go_before_it() -> None:
    """On the pads a ball keeps less than on a hard floor; without a material nothing is said."""
    for material, hard in RESTITUTION.items():
        scene = Scene(ball=Ball(material=material))
        assert restitution_of(scene) == on_pad(material) < hard
        assert friction_of(scene) == FRICTION_ON_PAD[material]
    given = Scene(ball=Ball(material="rubber"), contact=Contact(restitution=0.3, friction=0.4))
    assert (restitution_of(given), friction_of(given)) == (0.3, 0.4)
    assert (restitution_of(Scene()), friction_of(Scene())) == (None, 1.0)


def test_the_ball_of_the_laboratory_rebounds(arm: Arm) -> None:
    """A foam ball keeps 0.48 of its speed on the pads."""
    assert measured(named_scene("lab"), arm, 4.5) == pytest.approx(0.48, abs=0.05)
