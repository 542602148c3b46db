"""Gaps between shapes: against MuJoCo, against a brute search, and what the hand's hull holds."""

from dataclasses import replace
from itertools import combinations

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.core.arm.arm import Arm
from mitt.core.arm.description import ArmModel, Capsule, Link
from mitt.core.arm.hands import HandModel
from mitt.core.arm.limits import joint_level
from mitt.core.arm.shapes import (
    LEAST_GAP,
    MARGIN,
    Shapes,
    Surroundings,
    clearance,
    place_shapes,
    segment_distance,
    shapes_of,
)
from mitt.core.arm.shapes import gap as pair_gap
from mitt.core.errors import InputError
from mitt.core.signals import Array
from mitt.lab.world.plant import add_arm

#: Agreement with MuJoCo's distance of two capsules [m].
EXACT = 1e-7
ZONE = Capsule(start=(0.9, -0.8, 0.2), end=(0.9, -0.6, 0.6), radius=0.12)

seeds = st.integers(0, 2**31)


@pytest.fixture(scope="module")
def shapes(arm: Arm) -> Shapes:
    """The WAM beside one zone, over a floor."""
    return shapes_of(arm, Surroundings(floor=-0.9, zones=(ZONE,)))


def gap(arm: Arm, shapes: Shapes, q: Array) -> float:
    """Return the clearance in a pose."""
    return float(clearance(arm.bodies, q, shapes.table, shapes.pairs, shapes.ends))


def mujoco_gap(arm: Arm, q: Array) -> float:
    """Return the smallest distance of the watched pairs by MuJoCo."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    plate = add_arm(spec, arm.model)
    kind = mujoco.mjtGeom.mjGEOM_CAPSULE
    assert arm.model.hand is not None
    for k, x in enumerate(arm.model.hand.capsules()):
        plate.add_geom(
            name=f"hull{k}",
            type=kind,
            fromto=[*x.start, *x.end],
            size=[x.radius, 0.0, 0.0],
            mass=0.0,
        )
    floor = mujoco.mjtGeom.mjGEOM_PLANE
    spec.worldbody.add_geom(name="floor", type=floor, size=[5.0, 5.0, 0.1], pos=[0.0, 0.0, -0.9])
    spec.worldbody.add_geom(
        name="zone", type=kind, fromto=[*ZONE.start, *ZONE.end], size=[ZONE.radius, 0.0, 0.0]
    )
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_kinematics(model, data)
    names = ["floor", "base_0", "zone", "j3_0", "j4_0", "hull0", "hull1"]
    group = [0, 0, 0, 1, 2, 2, 2]
    found = [data.geom(names[k]).id for k in range(7)]
    nearest: float = min(
        mujoco.mj_geomDistance(model, data, found[a], found[b], 5.0, None)
        for a in range(7)
        for b in range(a)
        if group[a] != group[b]
    )
    return nearest


@given(seed=seeds)
def test_clearance_is_that_of_mujoco(arm: Arm, shapes: Shapes, seed: int) -> None:
    """In any pose the smallest gap between the arm's shapes, base and zone is MuJoCo's."""
    q = np.random.default_rng(seed).uniform(arm.q_min, arm.q_max)
    theirs = mujoco_gap(arm, q)
    assert gap(arm, shapes, q) == pytest.approx(theirs, abs=EXACT)


@given(points=st.lists(st.floats(-2.0, 2.0), min_size=12, max_size=12).map(np.array))
def test_no_sampled_pair_of_points_is_closer_than_the_segments(points: Array) -> None:
    """The distance of two segments is the least over a grid of their points, and is reached."""
    a, b, c, d = points.reshape(4, 3)
    share = np.linspace(0.0, 1.0, 41)[:, None]
    one, two = a + share * (b - a), c + share * (d - c)
    sampled = np.linalg.norm(one[:, None] - two[None], axis=-1).min()
    exact = segment_distance(*(tuple(x.tolist()) for x in (a, b, c, d)))
    step = (np.linalg.norm(b - a) + np.linalg.norm(d - c)) / 80.0
    assert sampled - step - 1e-9 <= exact <= sampled + 1e-9


def test_the_hull_of_the_hand_holds_the_fingers_at_every_angle() -> None:
    """Every point of a finger, its thickness included, lies in the hull, open to closed."""
    hand = HandModel()
    hull = hand.capsules()[1]
    low, high = hull.start[2], hull.end[2]
    for angle in np.linspace(0.0, hand.drive.closed, 97):
        for x, z in hand.finger.points(float(angle)):
            away = np.hypot(np.hypot(x, hand.finger.offset), z - np.clip(z, low, high))
            assert away + hand.finger.thickness <= hull.radius + 1e-9


@pytest.mark.parametrize(
    ("floor", "fits"), [(-0.36, True), (-0.24, True), (-0.2, False), (0.0, False)]
)
def test_a_floor_above_what_the_arm_stands_on_is_refused(
    arm: Arm, floor: float, *, fits: bool
) -> None:
    """The foot of the WAM is 0.33 m below its shoulder, and 0.1 m thick."""
    if fits:
        shapes_of(arm, Surroundings(floor=floor))
        return
    with pytest.raises(InputError, match=r"floor: wanted at most -0\.23 m, where wam stands"):
        shapes_of(arm, Surroundings(floor=floor))


def test_an_arm_that_begins_in_a_zone_is_refused(arm: Arm) -> None:
    """Such a pair could not be watched; the floor under an arm's foot may be as near as it is."""
    x, y, z = (float(k) for k in arm.position(arm.q_ready))
    inside = Capsule(start=(x, y, z), end=(x, y, z + 0.1), radius=0.05)
    with pytest.raises(InputError, match="zone 0: wanted 10 mm or more from the arm"):
        shapes_of(arm, Surroundings(zones=(inside,)))


def test_a_ball_of_an_arm_is_a_capsule_of_the_plant(arm: Arm) -> None:
    """MuJoCo has no capsule without length, and a round mesh gives one."""
    spec = mujoco.MjSpec()
    ball = Capsule(start=(0.0, 0.0, 0.1), end=(0.0, 0.0, 0.1), radius=0.05)
    add_arm(spec, replace(arm.model, base_capsules=(ball,)))
    model = spec.compile()
    assert model.geom("base_0").size[0] == 0.05
    assert model.geom("base_0").size[1] <= 1e-4


def _beads(angle: float, radius: float) -> Arm:
    """Return an arm with a ball 0.5 m out, and one on its base at an angle about its first axis."""
    at, axes = (0.5 * np.cos(angle), 0.5 * np.sin(angle), 0.0), np.eye(3)[[2, 0, 1]]
    ball = Capsule(start=(0.5, 0.0, 0.0), end=(0.5, 0.0, 0.0), radius=radius)
    links = tuple(
        Link(
            name=f"j{k}",
            placement=np.eye(4),
            axis=axis,
            q_min=-2.0 * np.pi,
            q_max=2.0 * np.pi,
            mass=1.0,
            com=np.zeros(3),
            inertia=np.eye(3),
            capsules=(ball,) if k == 1 else (),
        )
        for k, axis in enumerate(axes)
    )
    still = Capsule(start=at, end=at, radius=radius)
    model = ArmModel(
        name="beads",
        links=links,
        tool=np.eye(4),
        hand=None,
        q_ready=np.zeros(3),
        base_capsules=(still,),
        mount=np.eye(4),
    )
    return Arm(model, joint_level("beads", tau=np.ones(3), speed=np.ones(3)))


@pytest.mark.parametrize(("angle", "radius"), [(np.pi / 20.0, 0.03), (0.14, 0.025)])
def test_shapes_that_meet_in_a_narrow_range_of_angles_are_watched(
    angle: float, radius: float
) -> None:
    """Balls that overlap within a few hundredths of a radian, in ranges of two turns."""
    arm = _beads(angle, radius)
    shapes = shapes_of(arm, Surroundings(floor=-2.0))
    assert [1, 2] in shapes.pairs.tolist()
    assert gap(arm, shapes, arm.q_ready) > 0.01
    assert gap(arm, shapes, np.array([angle, 1.0, 0.0])) < -0.04


def _random_arm(rng: np.random.Generator, *, slides: int | None = None) -> Arm:
    """Return an arm of three links, each with a capsule, and one on its base; one may slide."""
    beads = _beads(0.0, float(rng.uniform(0.02, 0.05)))
    links = list(beads.model.links)
    for k in range(3):
        placement = np.eye(4)
        placement[:3, 3] = rng.uniform(-0.1, 0.1, 3)
        start, end = (tuple(x) for x in rng.uniform(-0.2, 0.2, (2, 3)).tolist())
        capsule = Capsule(start=start, end=end, radius=0.03)
        links[k] = replace(links[k], placement=placement, capsules=(capsule,))
    if slides is not None:
        links[slides] = replace(links[slides], prismatic=True, q_min=-0.3, q_max=0.2)
    return Arm(replace(beads.model, links=tuple(links)), beads.limits)


@given(seed=seeds, slides=st.sampled_from([None, 0, 1, 2]), size=st.floats(1e-3, 1.0))
def test_no_gap_changes_faster_than_its_slopes_say(
    seed: int, slides: int | None, size: float
) -> None:
    """Wherever all joints turn or slide to; joints beside a pair do not change its gap."""
    rng = np.random.default_rng(seed)
    arm = _random_arm(rng, slides=slides)
    shapes, gaps = shapes_of(arm, Surroundings(floor=-2.0, zones=(ZONE,))), []
    by = size * rng.uniform(-1.0, 1.0, arm.n)
    q = rng.uniform(arm.q_min, arm.q_max)
    for pose in (q, q + by):
        ends = shapes.ends
        place_shapes(arm.bodies, pose, shapes.table, ends)
        gaps.append([pair_gap(shapes.table, ends, *pair) for pair in shapes.pairs.tolist()])
    change = np.abs(np.array(gaps[1]) - gaps[0])
    assert np.all(change <= shapes.slopes @ np.abs(by) + 1e-9)
    assert change.shape == (len(shapes.pairs),)


def test_a_gap_of_shapes_on_the_axes_between_them_is_not_watched() -> None:
    """The base about the first axis, a housing about the second: 15 mm apart in every pose."""
    beads, up = _beads(0.0, 0.03), np.eye(4)
    up[:3, 3] = 0.0, 0.0, 0.1
    links = list(beads.model.links)
    housing = Capsule(start=(-0.05, 0.0, 0.0), end=(0.05, 0.0, 0.0), radius=0.035)
    links[1] = replace(links[1], placement=up, capsules=(housing,))
    base = Capsule(start=(0.0, 0.0, -0.3), end=(0.0, 0.0, 0.0), radius=0.05)
    arm = Arm(replace(beads.model, links=tuple(links), base_capsules=(base,)), beads.limits)
    assert links[1].axis.tolist() == [1.0, 0.0, 0.0]
    assert not np.any(np.all(shapes_of(arm, Surroundings(floor=-2.0)).pairs == [1, 2], axis=1))


@given(seed=seeds)
def test_a_pair_of_the_arm_that_is_not_watched_never_meets(seed: int) -> None:
    """No random pose brings a pair that was dropped nearer than 12 mm.

    A link and the next that are nearer in the ready pose are dropped because they always are.
    """
    rng = np.random.default_rng(seed)
    arm = _random_arm(rng)
    shapes = shapes_of(arm, Surroundings(floor=-2.0))
    ends, kept = shapes.ends, set(map(tuple, shapes.pairs.tolist()))
    place_shapes(arm.bodies, arm.q_ready, shapes.table, ends)
    dropped = [
        pair
        for pair in combinations(range(1, len(shapes.table)), 2)
        if pair not in kept
        and pair_gap(shapes.table, ends, *pair)
        > (
            LEAST_GAP
            if shapes.table["link"][pair[1]] - shapes.table["link"][pair[0]] == 1
            else MARGIN
        )
    ]
    for q in rng.uniform(arm.q_min, arm.q_max, (300, 3)) if dropped else ():
        place_shapes(arm.bodies, q, shapes.table, ends)
        assert min(pair_gap(shapes.table, ends, *pair) for pair in dropped) > 0.012
