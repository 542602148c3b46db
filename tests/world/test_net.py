"""Laws of the simulated basket: its net takes energy, lets no ball through, and is seen."""

from dataclasses import dataclass

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from mitt.core.arm.arm import Arm
from mitt.core.arm.basket import Basket
from mitt.core.signals import Array
from mitt.io.load import build_arm
from mitt.lab.world.build import SceneModel, build_scene
from mitt.lab.world.capsules import body_of, lay_capsules
from mitt.lab.world.hand_bodies import HAND
from mitt.lab.world.scene import Ball, Scene

#: Relative growth of the kinetic energy that is rounding of the integrator.
GROWTH = 1e-3
STEPS = 400
#: A ball that still rolls about in the net, half a second after it came in [m/s].
SLOW = 0.4


@dataclass(frozen=True)
class Fallen:
    """A ball in a basket that is held still: axes and origin of the catch point.

    Attributes:
        place: Its centre at each step [m], shape (k, 3).
        velocity: Of it [m/s], shape (k, 3).
        free: Whether it touched nothing in a step, shape (k,).
        force: Total contact force at each step [N], shape (k,).
    """

    place: Array
    velocity: Array
    free: NDArray[np.bool_]
    force: Array


def thrown(
    built: SceneModel, arm: Arm, place: Array, velocity: Array, steps: int = STEPS
) -> Fallen:
    """Let a ball into a basket that is held still; place and velocity in the basket's axes."""
    model, n = built.model, built.joints
    data = mujoco.MjData(model)
    data.qpos[:n] = arm.q_ready
    mujoco.mj_forward(model, data)
    at, R = data.site_xpos[built.site].copy(), data.site_xmat[built.site].reshape(3, 3).copy()
    data.qpos[n : n + 3], data.qvel[n : n + 3] = at + R @ place, R @ velocity
    held, rows = data.qpos[:n].copy(), []
    for _ in range(steps):
        mujoco.mj_step(model, data)
        data.qpos[:n], data.qvel[:n] = held, 0.0
        r, dr = R.T @ (data.qpos[n : n + 3] - at), R.T @ data.qvel[n : n + 3]
        force = np.linalg.norm(data.qfrc_constraint[n : n + 3])
        rows.append(np.concatenate([r, dr, [data.ncon == 0, force]]))
    table = np.array(rows)
    return Fallen(table[:, :3], table[:, 3:6], table[:, 6] > 0.0, table[:, 7])


def world(radius: float = 0.04, *, weight: bool = False) -> tuple[SceneModel, Arm]:
    """Return a scene with a basket on the WAM; its ready pose has the opening upwards a little."""
    arm = build_arm("wam", hand="basket")
    built = build_scene(Scene(ball=Ball(radius=radius)), arm.model)
    if not weight:
        built.model.opt.gravity[:] = 0.0
    return built, arm


@pytest.mark.parametrize("speed", [1.0, 3.0, 5.0])
@pytest.mark.parametrize("side", [0.0, 0.02, 0.04])
def test_the_net_gives_back_what_the_basket_says(speed: float, side: float) -> None:
    """Within 0.03 of its restitution straight into the bottom, wherever in it."""
    built, arm = world()
    fell = thrown(built, arm, np.array([side, 0.5 * side, 0.0]), np.array([0.0, 0.0, -speed]))
    back = float(fell.velocity[:, 2].max()) / speed
    assert back == pytest.approx(Basket().restitution, abs=0.03)


def test_the_ball_never_gains_energy() -> None:
    """From one free instant to any later one, for 40 ways into the basket and over its ring."""
    built, arm = world()
    rng, hits = np.random.default_rng(4), 0
    for _ in range(40):
        place = np.array([*rng.uniform(-0.12, 0.12, 2), 0.2])
        way = np.array([*rng.uniform(-0.6, 0.6, 2), -1.0])
        speed = rng.uniform(0.5, 8.0)
        fell = thrown(built, arm, place, speed * way / np.linalg.norm(way))
        square = np.sum(fell.velocity**2, axis=1)[fell.free]
        hits += int(not fell.free.all())
        assert np.all(square[1:] <= np.minimum.accumulate(square)[:-1] * (1.0 + GROWTH))
    assert hits > 20


@pytest.mark.parametrize("radius", [0.02, 0.04])
def test_no_ball_goes_through_the_net(radius: float) -> None:
    """A ball of a table-tennis ball's size or more stays in, and is held, as deep as it may be."""
    built, arm = world(radius, weight=True)
    rng, basket = np.random.default_rng(5), Basket()
    for _ in range(15):
        way = np.array([*rng.uniform(-0.4, 0.4, 2), -1.0])
        start = np.array([*rng.uniform(-0.03, 0.03, 2), 0.0])
        speed = rng.uniform(0.5, 5.0)
        fell = thrown(built, arm, start, speed * way / np.linalg.norm(way), 1000)
        assert basket.contains(fell.place[-1])
        assert not fell.free[-1]
        assert np.linalg.norm(fell.velocity[-1]) < SLOW


def test_the_force_on_a_ball_is_that_of_a_soft_net() -> None:
    """At 5 m/s less than a third of what stopping within 2 mm, as hard parts do, would take."""
    built, arm = world()
    fell = thrown(built, arm, np.zeros(3), np.array([0.0, 0.0, -5.0]))
    mass = float(built.model.body_mass[built.model.body("ball").id])
    assert 0.0 < fell.force.max() < mass * 5.0**2 / (2.0 * 0.002) / 3.0


def test_mass_and_centre_are_those_of_the_data() -> None:
    """MuJoCo's body has what the catcher's model reckons with."""
    built, _ = world()
    body = built.model.body("basket")
    assert body.mass[0] == Basket().mass
    assert body.ipos == pytest.approx([0.0, 0.0, Basket().com])
    moments = np.sort(np.diag(Basket().inertia))
    assert np.sort(body.inertia) == pytest.approx(moments)


def test_the_cameras_see_the_basket() -> None:
    """Each of its parts is a capsule of the hand among what is painted, as large as it is."""
    built, _ = world()
    data = mujoco.MjData(built.model)
    mujoco.mj_forward(built.model, data)
    body = body_of(built.model, data)
    lay_capsules(body, body.capsules)
    own = body.capsules[body.capsules[:, 7] > 0.0]
    assert len(own) == int(np.sum(built.model.geom_contype == HAND))
    b = Basket()
    assert len(own) == b.cords + b.cords // 2 + b.cords + 2 * b.struts + 1
    assert own[:, 6].max() == pytest.approx(b.flange)


@pytest.mark.parametrize("tilt", [-1.57, -0.8, 0.8, 1.57])
def test_a_tilted_basket_is_held_by_a_bracket_outside_its_net(tilt: float) -> None:
    """It begins at the arm's plate, and no part of the net is in its way."""
    arm = build_arm("wam", hand=Basket(tilt=tilt))
    model = build_scene(Scene(), arm.model).model
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    bracket = model.geom("bracket").id
    names = [model.geom(g).name for g in range(model.ngeom)]
    cords = [g for g, name in enumerate(names) if name.startswith("cord")]
    gaps = [mujoco.mj_geomDistance(model, data, bracket, g, 1.0, None) for g in cords]
    assert min(gaps) > 0.0
