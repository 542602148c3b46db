"""What stands between a camera and a thing hides it, and nothing else does."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mitt.core.arm.tools import TOOLS
from mitt.core.signals import Array
from mitt.lab.trials.station import arm_with_tool
from mitt.lab.world.scene import Scene, scene_of
from mitt.lab.world.sight import Viewpoint, is_seen, viewpoint_of
from mitt.lab.world.simulation import World
from mitt.lab.world.throws import Throw

EYE = np.array([0.0, 0.0, 1.0])
NOBODY = np.zeros(3)
places = st.tuples(*[st.floats(-0.6, 0.6)] * 3)
#: Share of a radius by which rays and points along them may differ from the whole outline [1].
ROUND = 0.1


def nearest(r: Array, size: float, capsule: Array) -> float:
    """Return how near a capsule's surface comes to the lines of sight to a disc [m]."""
    away = (r - EYE) / np.linalg.norm(r - EYE)
    wide = np.linalg.svd(away[None])[2][1:]
    angles = np.linspace(0.0, 2.0 * np.pi, 40, endpoint=False)
    rim = r + size * (np.cos(angles)[:, None] * wide[0] + np.sin(angles)[:, None] * wide[1])
    share = np.linspace(0.0, 1.0, 300)[:, None, None]
    points = (EYE + share * (np.concatenate([[r], rim]) - EYE)).reshape(-1, 3)
    axis = capsule[3:6] - capsule[:3]
    along = np.clip((points - capsule[:3]) @ axis / max(axis @ axis, 1e-12), 0.0, 1.0)
    gaps = np.linalg.norm(points - capsule[:3] - along[:, None] * axis, axis=1)
    return float(gaps.min() - capsule[6])


@settings(max_examples=200, deadline=None)
@given(places, places, places, st.floats(0.01, 0.2), st.floats(0.0, 0.05))
def test_a_thing_is_hidden_by_what_stands_before_its_outline(
    r: tuple[float, ...], a: tuple[float, ...], b: tuple[float, ...], radius: float, size: float
) -> None:
    """Against points along rays to all of the outline, in plain NumPy."""
    place, capsule = np.array(r), np.array([*a, *b, radius])
    gap = nearest(place, size, capsule)
    seen = is_seen(Viewpoint(EYE, -1.0, size, NOBODY), place, capsule[None])
    if gap < -0.005:
        assert not seen or gap > -ROUND * size - 0.005
    if gap > 0.005:
        assert seen


def test_a_camera_sees_what_is_in_its_view() -> None:
    """Half its angle about straight down, and what is held from behind where that is away."""
    none = np.zeros((0, 8))
    narrow = Viewpoint(EYE, np.cos(0.3), 0.02, NOBODY)
    assert is_seen(narrow, np.array([0.25, 0.0, 0.0]), none)
    assert not is_seen(narrow, np.array([0.35, 0.0, 0.0]), none)
    thing = np.array([0.3, 0.0, 0.0])
    for behind, seen in (([1.0, 0.0, 0.0], True), ([-0.3, 0.0, 0.95], False)):
        held = Viewpoint(EYE, -1.0, 0.02, np.array(behind) / np.linalg.norm(behind))
        assert is_seen(held, thing, none) == seen


BELT = {"middle": [0.5, 0.1], "height": 0.1, "direction": 0.0}


@pytest.mark.parametrize(
    ("view", "place"),
    [
        ("above", (0.5, 0.1, 1.1)),
        ("upstream", (-0.2, 0.1, 1.1)),
        ((0.1, 0.2, 0.9), (0.1, 0.2, 0.9)),
    ],
)
def test_a_viewpoint_hangs_over_its_belt(view: object, place: tuple[float, ...]) -> None:
    scene = scene_of({"belt": BELT, "sensing": {"viewpoint": view}}, place="scene")
    sight = viewpoint_of(scene, 0.04, None)
    assert sight is not None
    assert sight.place == pytest.approx(place)
    assert viewpoint_of(Scene(), 0.04, None) is None


def test_what_the_tool_covers_is_not_delivered() -> None:
    """One thing before the tool, seen from behind the tool, from before it, and from around."""
    arm = arm_with_tool("ur5e", TOOLS["suction"])
    q = arm.q_ready
    tip, axis = arm.position(q), arm.orientation(q)[:, 2]
    ball = Throw(r=tip + 0.06 * axis, dr=np.zeros(3))
    views = {"before": tuple(tip + 0.8 * axis), "behind": tuple(tip - 0.8 * axis)}
    for view, seen in (("before", True), ("behind", False), ("around", True)):
        sensing = {"latency": 0, "viewpoint": views.get(view, view)}
        world = World(scene_of({"sensing": sensing}, place="scene"), arm.model)
        world.reset(ball, 1)
        assert bool(world.sense().points) == seen
