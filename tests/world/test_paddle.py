"""Laws of a paddle's contact: what a ball keeps of its speed along and across the face."""

from functools import cache

import mujoco
import numpy as np
import pytest

from mitt.core.arm.arm import Arm
from mitt.core.arm.tools import Paddle
from mitt.core.signals import TICK, Array
from mitt.io.arm_file import load_arm
from mitt.lab.world.build import TOUCH, SceneModel, build_scene, restitution_on
from mitt.lab.world.scene import Ball, Material, Scene

#: Balls: mass [kg] and radius [m].
BALLS: dict[Material, tuple[float, float]] = {
    "foam": (0.034, 0.04),
    "tennis": (0.058, 0.033),
    "table-tennis": (0.0027, 0.02),
}
#: How near what is measured has to be to what is asked for.
NEAR = 0.03


@cache
def built(kind: Material) -> tuple[Arm, Scene, SceneModel]:
    """Return an arm with a paddle for a kind of ball, its scene, and the model without weight."""
    mass, radius = BALLS[kind]
    arm = load_arm("wam", hand=Paddle(half=radius, touch=TOUCH[kind]))
    scene = Scene(ball=Ball(mass=mass, radius=radius, material=kind))
    model = build_scene(scene, arm.model)
    model.model.opt.gravity[:], model.model.opt.timestep = 0.0, TICK / model.fine
    return arm, scene, model


def struck(kind: Material, speed: float, slant: float, ahead: float, *, held: bool) -> Array:
    """Return normal and tangential velocity before and after [m/s], (2, 2), of a resting arm's."""
    arm, _, scene = built(kind)
    model, n = scene.model, scene.joints
    data = mujoco.MjData(model)
    data.qpos[:n] = arm.q_ready
    mujoco.mj_forward(model, data)
    place, axes = data.site_xpos[scene.site].copy(), data.site_xmat[scene.site].reshape(3, 3).copy()
    way = speed * (np.sin(slant) * axes[:, 0] - np.cos(slant) * axes[:, 2])
    data.qpos[-7:-4] = place - ahead * way / (speed * np.cos(slant))
    data.qvel[-6:-3] = way
    touched = False
    for _ in range(round(0.02 / model.opt.timestep)):
        mujoco.mj_step(model, data)
        if held:
            data.qpos[:n], data.qvel[:n] = arm.q_ready, 0.0
        touched |= data.ncon > 0
        if touched and data.ncon == 0:
            break
    return np.asarray(np.array([way, data.qvel[-6:-3]]) @ axes[:, [2, 0]])


@pytest.mark.parametrize("kind", BALLS)
@pytest.mark.parametrize("speed", [2.0, 7.0, 12.0])
def test_a_held_paddle_gives_back_what_its_rubber_says(kind: Material, speed: float) -> None:
    """Along its normal the restitution, across it all but the loss, wherever a step begins."""
    arm, scene, model = built(kind)
    paddle = arm.model.hand
    assert isinstance(paddle, Paddle)
    wanted = restitution_on(scene, paddle)
    step = speed * model.model.opt.timestep
    for slant, ahead in ((0.0, 0.2), (0.3, 0.5), (0.6, 0.8)):
        before, after = struck(kind, speed, slant, 1e-3 + ahead * step, held=True)
        assert after[0] == pytest.approx(-wanted * before[0], rel=NEAR)
        kept = (1.0 - paddle.loss(-before[0])) * before[1]
        assert after[1] == pytest.approx(kept, abs=NEAR * before[1] + 2e-3 * speed)


@pytest.mark.parametrize("kind", BALLS)
def test_an_arm_that_may_move_yields_by_its_inertia(kind: Material) -> None:
    """The ball's velocity changes by (1 + e) mu u, mu = M / (M + m), M the arm's at the face."""
    arm, scene, _ = built(kind)
    paddle = arm.model.hand
    assert isinstance(paddle, Paddle)
    q = arm.q_ready
    along = arm.orientation(q)[:, 2] @ arm.jacobian(q)
    behind = 1.0 / (along @ np.linalg.solve(arm.mass_matrix(q), along))
    mu = behind / (behind + scene.ball.mass)
    before, after = struck(kind, 6.0, 0.0, 1.2e-3, held=False)
    change = after[0] - before[0]
    wanted = -(1.0 + restitution_on(scene, paddle)) * mu * before[0]
    assert change == pytest.approx(wanted, rel=NEAR)
