"""Contacts are looked for wherever there can be any, and a trial does not depend on it."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from mitt.robot.arm import Arm
from mitt.robot.load import load_arm
from mitt.signals import Array, Command
from mitt.world.build import Plant, build_plant
from mitt.world.clearing import MARGIN, OFF, fresh_table, is_clear, joints_of, measure, pairs_of
from mitt.world.faults.plan import Bounce, Carried, Fault, Gust, Kick, Spring
from mitt.world.hand import BALL, FLOOR
from mitt.world.scene import Scene, exact_scene
from mitt.world.simulation import World
from mitt.world.throws import Throw

PLANT = build_plant(exact_scene(), load_arm("wam").model)
MODEL, DATA = PLANT.model, mujoco.MjData(PLANT.model)
PAIRS, JOINTS = pairs_of(MODEL), joints_of(PLANT)
COUNT = len(JOINTS)


def _telescope() -> Plant:
    """Return the plant of an arm whose third link slides by up to 0.4 m."""
    model = load_arm("wam").model
    links = list(model.links)
    links[2] = replace(links[2], prismatic=True, held=None, q_min=0.0, q_max=0.4)
    q_ready = np.insert(model.q_ready, 2, 0.0)
    return build_plant(exact_scene(), replace(model, links=tuple(links), q_ready=q_ready))


SLIDING = _telescope()
#: In front of the arm of the default scene; it lands in the hand or beside it.
THROW = Throw(r=np.array([3.6, 0.1, 0.2]), dr=np.array([-5.0, 0.0, 2.6]))

shares = st.lists(st.floats(-0.3, 1.3), min_size=COUNT, max_size=COUNT).map(np.array)
places = st.tuples(*[st.floats(-1.2, 1.2)] * 3).map(np.array)


def lay(q: Array, ball: Array) -> None:
    """Bring the plant into a configuration and find its contacts."""
    DATA.qpos[:] = 0.0
    DATA.qpos[:COUNT], DATA.qpos[COUNT : COUNT + 3], DATA.qpos[COUNT + 3] = q, ball, 1.0
    mujoco.mj_fwdPosition(MODEL, DATA)


def angles(share: Array) -> Array:
    """Return joint angles at shares of their ranges."""
    return np.asarray(JOINTS[:, 0] + share * (JOINTS[:, 1] - JOINTS[:, 0]))


@settings(max_examples=150, deadline=None)
@given(shares, places)
def test_each_contact_is_of_a_pair_that_is_known(share: Array, ball: Array) -> None:
    """MuJoCo finds no contact of other shapes, and none whose gap is held for open."""
    lay(angles(share), ball)
    known = {frozenset(int(x) for x in pair[:2]): pair for pair in PAIRS}
    for geoms in DATA.contact.geom[: DATA.ncon]:
        gaps = np.empty(3)
        measure(DATA.geom_xpos, DATA.geom_xmat, known[frozenset(geoms.tolist())][None], gaps)
        assert gaps.min() <= 1e-9


def test_no_gap_is_held_for_wider_than_it_is() -> None:
    """Gaps are MuJoCo's own distances, or less where a cylinder is held for a capsule."""
    q = np.append(load_arm("wam").q_ready, np.full(PLANT.fingers, 0.3))
    lay(q, np.array([1.5, 0.2, 0.4]))
    exact = 0
    for pair in PAIRS:
        gaps, geoms = np.empty(3), pair[:2].astype(int)
        measure(DATA.geom_xpos, DATA.geom_xmat, pair[None], gaps)
        gap, wanted = gaps.min(), mujoco.mj_geomDistance(MODEL, DATA, *geoms, 9.0, None)
        assert gap <= wanted + 1e-9
        exact += abs(gap - wanted) < 1e-9
    assert exact > 0.8 * len(PAIRS)


@settings(max_examples=200, deadline=None)
@given(shares, places, st.floats(0.0, 1.0), st.integers(0, 2**32))
def test_what_is_held_for_clear_is_clear(share: Array, ball: Array, size: float, seed: int) -> None:
    """Whatever moves at most as is foreseen touches nothing and meets no stop."""
    rng, h = np.random.default_rng(seed), 0.02
    lay(angles(np.clip(share, 0.05, 0.95)), ball)
    q, r = DATA.qpos.copy(), ball.copy()
    dq = np.zeros(MODEL.nv)
    dq[: COUNT + 3] = 5.0 * size * rng.uniform(-1.0, 1.0, COUNT + 3)
    table = fresh_table(COUNT)
    place = DATA.geom_xpos, DATA.geom_xmat, PAIRS, JOINTS, table, h, PLANT.joints
    assume(is_clear(q, dq, *place))
    for part in (0.0, 0.5, 1.0):
        lay(q[:COUNT] + part * h * dq[:COUNT], r + part * h * dq[COUNT : COUNT + 3])
        assert DATA.ncon == 0
        assert np.all((DATA.qpos[:COUNT] > JOINTS[:, 0]) & (DATA.qpos[:COUNT] < JOINTS[:, 1]))


@pytest.mark.parametrize("sliding", [False, True])
@settings(max_examples=60, deadline=None)
@given(shares, st.integers(0, 2**32))
def test_no_shape_moves_farther_than_is_foreseen(sliding: bool, share: Array, seed: int) -> None:
    """A change of the joints moves no point of a shape by more than the table says."""
    plant = SLIDING if sliding else PLANT
    model, joints, data = plant.model, joints_of(plant), mujoco.MjData(plant.model)
    change = 0.02 * np.random.default_rng(seed).uniform(-1.0, 1.0, len(joints))
    start = joints[:, 0] + np.clip(np.resize(share, len(joints)), 0.1, 0.9) * (
        joints[:, 1] - joints[:, 0]
    )
    tips = []
    for q in (start, start + change):
        data.qpos[: len(joints)], data.qpos[len(joints) + 3] = q, 1.0
        mujoco.mj_kinematics(model, data)
        axes = data.geom_xmat.reshape(-1, 3, 3)[:, :, 2] * model.geom_rbound[:, None]
        tips.append(np.concatenate([data.geom_xpos + axes, data.geom_xpos - axes]))
    own = np.tile(model.geom_contype & (BALL | FLOOR) == 0, 2)
    moved = np.linalg.norm(tips[1] - tips[0], axis=1)[own]
    assert moved.max() <= joints[:, 2] @ np.abs(change)


def test_what_was_measured_holds_until_it_has_been_used_up() -> None:
    """It is not measured again before joints and ball have moved by as much as there was room."""
    lay(np.append(load_arm("wam").q_ready, np.zeros(PLANT.fingers)), np.array([3.0, 0.0, 0.0]))
    table, still = fresh_table(COUNT), np.zeros(MODEL.nv)
    place = DATA.geom_xpos, DATA.geom_xmat, PAIRS, JOINTS, table, 0.001, PLANT.joints
    assert is_clear(DATA.qpos, still, *place)
    gaps, qpos = table[:3].copy(), DATA.qpos.copy()
    qpos[0] += 0.9 * (gaps[0] - MARGIN) / JOINTS[0, 2]
    before = table.copy()
    assert is_clear(qpos, still, *place)
    assert np.array_equal(table, before)
    qpos[0] += 0.2 * (gaps[0] - MARGIN) / JOINTS[0, 2]
    assert is_clear(qpos, still, *place)
    assert not np.array_equal(table, before)


def both_ways(arm: Arm, scene: Scene) -> tuple[World, World, int]:
    """Return two worlds after a throw at a moving arm, and in how many ticks the first was off.

    In the second one contacts are always looked for; both are compared tick by tick.
    """
    free, always = worlds = [World(scene, load_arm("wam").model) for _ in range(2)]
    for world in worlds:
        world.reset(THROW, 3)
    mask, off = ~OFF, 0
    for k in range(900):
        wish = arm.q_ready + 0.3 * np.sin(0.01 * k) * np.array([1.0, -0.5, 0.5])
        off += bool(free.model.opt.disableflags & OFF)
        always.model.opt.disableflags = int(always.model.opt.disableflags) & mask
        for world in worlds:
            state = world.sense().arm
            ddq = 400.0 * (wish - state.q) - 40.0 * state.dq
            tau = arm.inverse_dynamics(state.q, state.dq, ddq)
            hand = 1.2 if k > 500 else 0.0
            world.apply(Command(t=world.t, told=np.array([wish, 0 * wish, ddq, tau]), hand=hand))
        assert free.data.qpos.tobytes() == always.data.qpos.tobytes()
        assert free.data.qvel.tobytes() == always.data.qvel.tobytes()
    assert np.array_equal(free.trace().seen, always.trace().seen)
    return free, always, off


@pytest.mark.parametrize("scene", [exact_scene(), Scene()])
def test_a_trial_is_the_same_with_contacts_always_looked_for(arm: Arm, scene: Scene) -> None:
    """To the last bit, from release until the ball has met the hand, an arm moving all the way."""
    free, _, off = both_ways(arm, scene)
    assert np.any(free.trace().seen)
    assert 200 < off < 850


@pytest.mark.parametrize(
    "fault",
    [
        Kick(kind="kick", magnitude=20.0, share=0.97),
        Bounce(kind="bounce", magnitude=0.15, share=0.95, restitution=1.0),
        Gust(kind="gust", magnitude=30.0),
        Spring(kind="spring", magnitude=10.0),
        Carried(kind="carried", magnitude=5.0),
    ],
)
def test_a_disturbed_trial_is_the_same_with_contacts_always_looked_for(
    arm: Arm, fault: Fault
) -> None:
    """What pushes or leads the ball cannot bring about a contact that is not looked for."""
    _, _, off = both_ways(arm, Scene(faults=(fault,)))
    assert off > 100
