"""Laws of a paddle's contact: what a ball keeps of its speed and its spin."""

from dataclasses import replace
from functools import cache

import mujoco
import numpy as np
import pytest

from mitt.core.arm.arm import Arm
from mitt.core.arm.tools import USUAL_SPEED, Paddle, inertia_share
from mitt.core.map.striking import Impact, mass_behind, rebound, spin_after
from mitt.core.signals import TICK, Array
from mitt.io.arm_file import load_arm
from mitt.lab.trials.bat_station import impact_of
from mitt.lab.world.build import TOUCH
from mitt.lab.world.engine import BALL_HAND
from mitt.lab.world.motion import arrive, leave
from mitt.lab.world.scene import Ball, Material, Mismatch, Scene
from mitt.lab.world.simulation import World
from mitt.lab.world.throws import Throw

#: Balls: mass [kg], radius [m], and whether they are thin shells.
BALLS: dict[Material, tuple[float, float, bool]] = {
    "foam": (0.034, 0.04, False),
    "tennis": (0.058, 0.033, False),
    "table-tennis": (0.0027, 0.02, True),
}
#: How near what is measured has to be to what is asked for.
NEAR = 0.03


@cache
def built(kind: Material) -> tuple[Arm, Impact, World]:
    """Return an arm with a paddle for a kind of ball, how they part, and a world without weight."""
    mass, radius, hollow = BALLS[kind]
    paddle = Paddle(half=radius, touch=TOUCH[kind])
    arm = load_arm("wam", hand=paddle)
    ball = Ball(mass=mass, radius=radius, material=kind, drag=0.0, lift=0.0, hollow=hollow)
    exact = Mismatch(mass=0.0, viscous=0.0, coulomb=0.0, drag=0.0)
    scene = Scene(ball=ball, mismatch=exact)
    world = World(scene, arm.model)
    world.model.opt.gravity[:] = 0.0
    return arm, impact_of(scene, paddle), world


def struck(
    kind: Material, way: Array, spin: Array, *, held: bool, ahead: float = 0.3
) -> tuple[Array, Array]:
    """Return velocity [m/s] and spin [rad/s] after an impact of a resting arm, in its tool's axes.

    Args:
        kind: The ball.
        way: Its velocity before, in the tool's axes [m/s], shape (3,).
        spin: Its spin before, likewise [rad/s], shape (3,).
        held: Whether the arm is held where it is.
        ahead: How far it is from the face, in steps.
    """
    arm, _, world = built(kind)
    plant, data, n = world._plant, world.data, arm.n
    axes = arm.orientation(arm.q_ready)
    step = TICK / plant.fine
    start = arm.position(arm.q_ready) - axes @ way * (0.001 + ahead * step)
    world.reset(Throw(r=start, dr=axes @ way, spin=axes @ spin), 0)
    plant = world._plant
    plant.state["steps"], plant.step[0] = plant.fine, step
    touched = False
    for k in range(round(0.02 / step)):
        leave(plant)
        if held:
            data.qpos[:n], data.qvel[:n] = arm.q_ready, 0.0
        arrive(plant, k * step)
        touched |= bool(plant.state["seen"][0] & BALL_HAND)
        if touched and data.ncon == 0:
            break
    turned = np.zeros(9)
    mujoco.mju_quat2Mat(turned, data.qpos[-4:])
    after = turned.reshape(3, 3) @ data.qvel[-3:]
    return np.asarray(axes.T @ data.qvel[-6:-3]), np.asarray(axes.T @ after)


@pytest.mark.parametrize("kind", BALLS)
@pytest.mark.parametrize("speed", [2.0, 7.0, 12.0])
def test_a_held_paddle_is_a_rigid_bodys_impact(kind: Material, speed: float) -> None:
    """Velocity and spin are those of the law that the catcher aims by, whatever ball and spin."""
    _, impact, _ = built(kind)
    normal = np.array([0.0, 0.0, 1.0])
    for slant, spin in (
        (0.0, (0.0, 0.0, 0.0)),
        (0.5, (0.0, 0.0, 0.0)),
        (0.3, (60.0, -150.0, 40.0)),
    ):
        way = speed * np.array([np.sin(slant), 0.0, -np.cos(slant)])
        found, turned = struck(kind, way, np.array(spin), held=True)
        known = replace(impact, spin=spin)
        wanted = rebound(known, np.inf, normal, way, np.zeros(3))
        rolled = spin_after(known, normal, way)
        slide = np.hypot(*way[:2]) + impact.radius * float(np.hypot(*spin[:2]))
        assert found[2] == pytest.approx(wanted[2], rel=NEAR)
        assert found[:2] == pytest.approx(wanted[:2], abs=NEAR * slide + 0.01)
        assert turned == pytest.approx(rolled, abs=2.0 * NEAR * slide / impact.radius + 0.5)


def test_the_restitution_falls_with_speed() -> None:
    """By what the rubber says for each metre a second, about the speed for which it is given."""
    _, impact, _ = built("tennis")
    slow, fast = (
        struck("tennis", np.array([0.0, 0.0, -v]), np.zeros(3), held=True)[0][2] / v
        for v in (USUAL_SPEED - 3.0, USUAL_SPEED + 3.0)
    )
    assert slow - fast == pytest.approx(6.0 * impact.fall, abs=0.01)


@pytest.mark.parametrize("kind", BALLS)
def test_an_arm_that_may_move_yields_by_its_inertia(kind: Material) -> None:
    """The ball's velocity changes by (1 + e) mu u, mu = M / (M + m), M the arm's at the face."""
    arm, impact, _ = built(kind)
    q = arm.q_ready
    way = np.array([0.0, 0.0, -6.0])
    found = struck(kind, way, np.zeros(3), held=False)[0]
    behind = mass_behind(arm, q, arm.orientation(q)[:, 2])
    wanted = rebound(impact, behind, np.array([0.0, 0.0, 1.0]), way, np.zeros(3))
    assert found[2] - way[2] == pytest.approx(wanted[2] - way[2], rel=NEAR)


def test_a_shell_turns_harder_than_a_solid_ball() -> None:
    """So of the same slip it loses more velocity: 2/5 where it ends rolling, and not 2/7."""
    paddle = Paddle()
    assert paddle.loss(hollow=False, tangential=0.0) == pytest.approx(2.0 / 7.0)
    assert paddle.loss(hollow=True, tangential=0.0) == pytest.approx(2.0 / 5.0)
    assert inertia_share(hollow=True) > inertia_share(hollow=False)
