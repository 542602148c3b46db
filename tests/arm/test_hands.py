"""Hands as data: what none can be, what they hold, and the capsules that hold them."""

from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mitt.core.arm.basket import Basket
from mitt.core.arm.catch import FingerDrive
from mitt.core.arm.description import Capsule
from mitt.core.arm.hands import Closing, Finger, HandModel
from mitt.core.errors import InputError, MittError
from mitt.core.signals import Array
from mitt.io.load import build_arm

PARTS: tuple[Any, ...] = (Finger(), FingerDrive(), Closing(), HandModel())
"""Everything that a hand is made of."""
PALM = 0.041
RIM = 0.012
"""Radius of the palm, and how far its rim stands above it [m]."""

lengths = st.floats(0.01, 0.15)
shapes = st.builds(
    Finger,
    base_radius=st.floats(0.0, 0.12),
    base_height=st.floats(-0.05, 0.2),
    offset=st.floats(-0.03, 0.03),
    lean=st.floats(-1.0, 1.6),
    proximal=lengths,
    distal=lengths,
    bend=st.floats(-0.5, 2.0),
    thickness=st.floats(0.002, 0.02),
)
hands = st.builds(
    HandModel,
    finger=shapes,
    palm_height=st.floats(0.02, 0.3),
    catch_offset=st.floats(0.0, 0.4),
    drive=st.builds(FingerDrive, closed=st.floats(0.2, 3.0)),
)


@pytest.mark.parametrize(
    ("part", "name"), [(part, x.name) for part in PARTS for x in fields(part)], ids=str
)
@pytest.mark.parametrize("bad", [np.nan, np.inf, -1e9, 1e300, "much", True, None, []])
def test_what_no_hand_can_be_is_refused(part: Any, name: str, bad: object) -> None:  # noqa: ANN401
    """Every field, one line that names it; a force without end is one that nobody knows."""
    if name == "force" and bad in (np.inf, 1e300):
        assert replace(part, **{name: bad}).force == bad
        return
    with pytest.raises(MittError, match=f"{type(part).__name__}.{name}") as caught:
        replace(part, **{name: bad})
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "inertia",
    [
        np.eye(2),
        -np.eye(3),
        np.full((3, 3), np.nan),
        np.arange(9.0).reshape(3, 3),
        np.zeros((3, 3)),
        np.diag([1e-3, 1e-3, 9e-3]),
    ],
)
def test_what_is_no_inertia_is_refused(inertia: Array) -> None:
    """Another shape, not symmetric, moments that no body has; a list of rows is taken."""
    with pytest.raises(MittError, match=r"HandModel\.inertia"):
        HandModel(inertia=inertia)
    assert HandModel(inertia=np.eye(3).tolist()).inertia.dtype == np.float64  # type: ignore[arg-type]


def test_a_restitution_from_which_balls_are_hard_lies_above_that_of_soft_ones() -> None:
    """Their difference stands in a denominator."""
    for hard in (0.5, 0.4):
        with pytest.raises(InputError, match=r"Closing\.soft: wanted a number below hard"):
            Closing(soft=0.5, hard=hard)


def _beyond(points: Array, capsules: tuple[Capsule, ...]) -> float:
    """Return how far the farthest point lies outside of all capsules [m]."""
    least = np.full(len(points), np.inf)
    for c in capsules:
        on_axis = np.zeros_like(points)
        on_axis[:, 2] = np.clip(points[:, 2], c.start[2], c.end[2])
        least = np.minimum(least, np.linalg.norm(points - on_axis, axis=1) - c.radius)
    return float(least.max())


@given(hands)
@settings(max_examples=40)
def test_capsules_hold_palm_and_fingers_at_any_angle(hand: HandModel) -> None:
    """Whatever their shape: not one point of a rod or of the palm is outside by 1 um."""
    capsules, finger = hand.capsules(), hand.finger
    along = np.linspace(0.0, 1.0, 9)[:, None]
    for angle in np.linspace(0.0, hand.drive.closed, 23):
        base, knuckle, tip = finger.points(float(angle))
        rods = np.vstack([base + along * (knuckle - base), knuckle + along * (tip - knuckle)])
        places = np.column_stack([rods[:, 0], np.full(len(rods), finger.offset), rods[:, 1]])
        assert _beyond(places, capsules[1:]) + finger.thickness < 1e-6
    heights = np.linspace(0.0, hand.palm_height + RIM, 30)
    wall = np.column_stack([np.full(30, PALM), np.zeros(30), heights])
    assert _beyond(wall, capsules) < 1e-9


@given(hands, st.floats(0.0, 3.0))
@settings(max_examples=25)
def test_what_a_hand_holds_is_bounded_by_its_drives(hand: HandModel, friction: float) -> None:
    """From 5 to 500 mm: at most what levers as long as a finger is thick give, at least 0.

    Nothing where the open fingers do not let the ball in, or do not reach it; and a ball that is
    too large stays so.
    """
    radii = np.linspace(0.005, 0.5, 60).tolist()
    force = [hand.holding_force(r, friction) for r in radii]
    most = hand.fingers * hand.drive.tau_max / hand.finger.thickness * np.hypot(1.0, friction)
    assert min(force) >= 0.0
    assert max(force) <= most
    assert all(np.isfinite(force))
    fits = [hand.finger.gap(0.0, r, hand.catch_offset) > 0.0 for r in radii]
    assert fits == sorted(fits, reverse=True)
    angles = np.linspace(0.0, hand.drive.closed, 181).tolist()
    for r, held, fit in zip(radii, force, fits, strict=True):
        meets = any(hand.finger.gap(x, r, hand.catch_offset) <= 0.0 for x in angles)
        assert held == 0.0 or (fit and meets)


def test_none_mounts_nothing_and_left_out_mounts_what_the_arm_has() -> None:
    """The tool plate is the catch point then, and the hand weighs nothing."""
    bare, basket = (build_arm("wam", hand=x) for x in ("none", "basket"))
    usual, same = build_arm("wam"), build_arm("wam", hand="three-finger")
    assert bare.model.hand is None
    assert isinstance(basket.model.hand, Basket)
    assert isinstance(usual.model.hand, HandModel)
    assert np.array_equal(usual.position(usual.q_ready), same.position(same.q_ready))
    reach = [np.linalg.norm(x.position(x.q_ready)) for x in (bare, usual)]
    plate = (
        bare.position(bare.q_ready)
        + usual.model.hand.catch_offset * bare.orientation(bare.q_ready)[:, 2]
    )
    assert np.allclose(plate, usual.position(usual.q_ready), atol=1e-12)
    assert reach[0] < reach[1]
    still = np.zeros(3)
    weight = [np.abs(x.inverse_dynamics(x.q_ready, still, still)).max() for x in (bare, usual)]
    assert weight[0] < weight[1]


def test_a_capsule_takes_lists_and_refuses_what_is_no_point() -> None:
    """It is hashed as the same capsule."""
    one = Capsule(start=[0, 0, 0], end=np.array([0.0, 0.0, 1.0]), radius=1)  # type: ignore[arg-type]
    assert hash(one) == hash(Capsule(start=(0.0, 0.0, 0.0), end=(0.0, 0.0, 1.0), radius=1.0))
    for bad in ({"start": (0.0, 0.0)}, {"end": "up"}, {"radius": None}, {"radius": 0.0}):
        with pytest.raises(MittError, match="capsule"):
            replace(one, **bad)


@pytest.mark.parametrize("closed", [1.6, 2.2, 3.1])
def test_fingers_that_could_pass_a_small_ball_hold_it_where_they_meet_it(closed: float) -> None:
    """How far they could go without it takes nothing from how they hold it."""
    hand, far = HandModel(), HandModel(drive=FingerDrive(closed=closed))
    for radius in (0.02, 0.04):
        assert far.reaches(radius)
        assert far.touch_angle(radius) == pytest.approx(hand.touch_angle(radius), abs=1e-9)
        assert far.holding_force(radius, 1.0) == pytest.approx(hand.holding_force(radius, 1.0))
