"""The basket as data: what it weighs, where it is mounted, what lies in it, what it is called."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.core.arm.arm import difference, identity_of
from mitt.core.arm.basket import HANDS, Basket, hand_named
from mitt.core.arm.description import checked_hand, mounting
from mitt.core.arm.hands import HandModel
from mitt.core.errors import InputError, UnknownNameError
from mitt.io.load import build_arm

ROUNDING = 1e-12


def test_a_basket_is_a_body_that_can_be() -> None:
    """Its moments of inertia are positive and obey the triangle inequality."""
    xx, yy, zz = np.diag(Basket().inertia)
    assert 0.0 < Basket().com < Basket().ring_height
    assert min(xx, yy, zz) > 0.0
    assert xx == yy
    assert zz < xx + yy


@given(tilt=st.floats(-2.0, 2.0))
def test_the_catch_point_stays_on_the_axis_of_the_plate(tilt: float) -> None:
    """However a basket is tilted; its opening looks where the tilt says, and clear of the plate."""
    basket = Basket(tilt=tilt)
    stand, mount = mounting(basket)
    at = mount @ np.array([0.0, 0.0, basket.catch_offset, 1.0])
    assert at[:3] == pytest.approx([0.0, 0.0, stand], abs=ROUNDING)
    assert mount[:3, 2] == pytest.approx([np.sin(tilt), 0.0, np.cos(tilt)], abs=ROUNDING)
    assert mount[:3, :3] @ mount[:3, :3].T == pytest.approx(np.eye(3), abs=ROUNDING)


def test_a_basket_without_tilt_and_fingers_are_on_the_plate_itself() -> None:
    """Their own plate is the arm's, and their catch point as far beyond it as they say."""
    for hand in (Basket(), HandModel()):
        stand, mount = mounting(hand)
        assert stand == hand.catch_offset
        assert np.array_equal(mount, np.eye(4))


@given(r=st.floats(0.0, 0.2), a=st.floats(-np.pi, np.pi), z=st.floats(-0.3, 0.3))
def test_what_lies_in_a_basket(r: float, a: float, z: float) -> None:
    """A centre between ring and bottom and no farther off the axis than the net, and no other."""
    basket = Basket()
    inside = basket.contains(np.array([r * np.cos(a), r * np.sin(a), z]))
    below = basket.catch_depth - z
    wanted = 0.0 <= below <= basket.depth and r <= basket.net_radius
    if min(abs(below), abs(below - basket.depth), abs(r - basket.net_radius)) > ROUNDING:
        assert inside == wanted


def test_the_shapes_for_self_contact_hold_ring_and_bottom() -> None:
    """The corner of the ring and of the net's bottom are in the wide capsule."""
    b = Basket()
    _, wide = b.capsules()
    low, high = wide.start[2], wide.end[2]
    for radius, height in (
        (b.net_radius, b.ring_height + b.ring_thickness),
        (b.net_radius + b.ring_thickness, b.ring_height),
        (b.ring_radius + b.clear, b.floor),
    ):
        beyond = max(low - height, height - high, 0.0)
        assert np.hypot(radius, beyond) <= wide.radius + 1e-6


def test_hands_have_names() -> None:
    """Those of the table, and none; another is refused with the names there are."""
    assert hand_named("none") is None
    for name, hand in HANDS.items():
        assert hand_named(name) is hand
    with pytest.raises(UnknownNameError, match="basket"):
        hand_named("glove")
    with pytest.raises(InputError, match="a HandModel or a Basket"):
        checked_hand(3)


def test_an_arm_takes_a_hand_by_name() -> None:
    """The same arm as with the hand itself."""
    named, given_ = build_arm("wam", hand="basket"), build_arm("wam", hand=Basket())
    assert difference(identity_of(named), identity_of(given_)) is None


def test_hands_tell_arms_apart() -> None:
    """Fingers, a basket, and the same basket tilted: no map of one is taken for another."""
    arms = [build_arm("wam", hand=x) for x in (HandModel(), Basket(), Basket(tilt=0.5))]
    for k, one in enumerate(arms):
        for other in arms[k + 1 :]:
            assert difference(identity_of(one), identity_of(other)) is not None


def test_a_tilted_basket_turns_the_palm_of_the_arm() -> None:
    """The palm's normal of the WAM leaves the forearm's direction by the tilt."""
    straight, tilted = (build_arm("wam", hand=Basket(tilt=x)) for x in (0.0, -0.7))
    q = straight.q_ready
    cosine = straight.orientation(q)[:, 2] @ tilted.orientation(q)[:, 2]
    assert np.arccos(cosine) == pytest.approx(0.7)
    assert replace(Basket(), tilt=-0.7).stand > Basket().catch_offset * np.cos(0.7)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("depth", -1.0),
        ("mass", 0.0),
        ("ring_radius", np.nan),
        ("catch_depth", 0.3),
        ("tilt", 3.0),
        ("restitution", 1.5),
        ("cords", 21),
        ("cords", 2),
        ("struts", 2.5),
        ("floor", "high"),
    ],
)
def test_a_basket_that_nobody_can_build_is_refused(name: str, value: object) -> None:
    with pytest.raises(InputError, match=f"Basket.{name}"):
        Basket(**{name: value})  # type: ignore[arg-type]
