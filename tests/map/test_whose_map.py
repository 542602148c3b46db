"""Whose map it is: a generator serves the arm that it was made for, by its numbers alone."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from mitt.core.arm.arm import Arm
from mitt.core.arm.hands import HandModel
from mitt.core.arm.limits import Limits
from mitt.core.catcher.catcher import Catcher
from mitt.core.catcher.family import Family
from mitt.core.catcher.generators import Direct, Generator, refining
from mitt.core.catcher.given import check_arm, for_arm
from mitt.core.errors import InputError
from mitt.core.map.learn import Learned
from mitt.core.signals import BallState
from mitt.io.load import build_arm
from mitt.lab.rivals.planned import make_quintic
from mitt.lab.trials.catcher_settings import reserved

Change = Callable[[Arm], Arm]


def of_limits(**scale: float) -> Change:
    """Return a change that scales numbers of the limit set."""

    def change(arm: Arm) -> Arm:
        limits: Limits = arm.limits
        scaled = {name: share * getattr(limits, name) for name, share in scale.items()}
        return Arm(arm.model, replace(limits, **scaled))

    return change


def of_link(k: int, **changes: object) -> Change:
    """Return a change of one link."""

    def change(arm: Arm) -> Arm:
        links = list(arm.model.links)
        links[k] = replace(links[k], **changes)  # type: ignore[arg-type]
        return Arm(replace(arm.model, links=tuple(links)), arm.limits)

    return change


def of_model(**changes: object) -> Change:
    """Return a change of the model."""
    return lambda arm: Arm(replace(arm.model, **changes), arm.limits)  # type: ignore[arg-type]


def other_hand(arm: Arm) -> Arm:
    """Return the arm with a hand that catches 20 mm farther in."""
    hand = arm.model.hand
    assert isinstance(hand, HandModel)
    nearer = replace(hand, catch_offset=hand.catch_offset - 0.02)
    return Arm(replace(arm.model, hand=nearer), arm.limits)


LIMITS: dict[str, Change] = {
    "peak torques": of_limits(tau_peak=0.45),
    "peak torques ": of_limits(tau_peak=1.01),
    "joint speeds": of_limits(dq_max=0.9),
    "accelerations": lambda arm: Arm(
        arm.model, replace(arm.limits, acceleration=np.full(len(arm.limits.dq_max), 40.0))
    ),
    "joint ranges": of_link(1, q_max=1.5),
}
OTHERS: dict[str, Change] = {
    "catch point": other_hand,
    "held angles": of_link(2, held=0.1),
    "masses": of_link(3, mass=1.0),
    "shapes": of_model(base_capsules=()),
    "ready pose": of_model(q_ready=np.array([0.1, 0.8, 0.1])),
}


def generators(learned: Learned) -> list[Generator]:
    """Return a generator of each kind for the arm of a map."""
    f = learned.map
    return [Direct(f), refining(f), Family((Direct(f), Direct(f))), make_quintic(f)]


@pytest.mark.parametrize("kind", OTHERS)
def test_no_part_of_another_arm_passes(arm: Arm, learned: Learned, kind: str) -> None:
    """Refused in one line that names what differs, by the catcher and by whoever checks a map."""
    other = OTHERS[kind](arm)
    for generator in generators(learned):
        with pytest.raises(InputError, match=kind.strip()):
            Catcher(other, generator)
    with pytest.raises(InputError, match="learn a map for this arm"):
        check_arm(other, learned.map)


@pytest.mark.parametrize("kind", LIMITS)
def test_other_limits_of_the_same_arm_are_those_that_judge(
    arm: Arm, learned: Learned, kind: str
) -> None:
    """A catcher's verdict is that of the map bound to its arm; what cannot be bound is refused."""
    other, (*maps, rival) = LIMITS[kind](arm), generators(learned)
    ball = BallState(
        t=0.0,
        r_o=np.array([2.7, 0.1, 0.55]),
        dr_o=np.array([-5.6, -0.1, 1.4]),
        covariance=1e-8 * np.eye(6),
    )
    for generator in maps:
        used = for_arm(other, generator)[0]
        bound = [f.arm for f in (used.as_map(),) if f is not None]
        assert bound == [other]
    direct = for_arm(other, learned.map)[0]
    expected = Direct(replace(learned.map, arm=other)).verdict(ball, other.q_ready)
    assert direct.verdict(ball, other.q_ready) == expected
    catcher = Catcher(other, learned.map)
    assert catcher.again(learned.map) is not catcher
    with pytest.raises(InputError, match=kind.strip()):
        Catcher(other, rival)
    check_arm(other, learned.map)


def test_a_map_of_another_arm_among_several_is_found(arm: Arm, learned: Learned) -> None:
    """Not only the one that is asked first, nor only the one in use."""
    f = learned.map
    weak = replace(f, arm=OTHERS["masses"](arm))
    for generator in (Family((Direct(f), Direct(weak))), Direct(f, learned=weak)):
        with pytest.raises(InputError, match="masses"):
            Catcher(arm, generator)
        with pytest.raises(InputError, match="masses"):
            Catcher(arm, Direct(f)).again(generator)


def test_the_same_arm_passes(arm: Arm, learned: Learned) -> None:
    """Loaded anew, and with a little of its torque in reserve."""
    for same in (arm, build_arm("wam", limits="paper"), reserved(arm)):
        for generator in generators(learned):
            Catcher(same, generator)
        check_arm(same, learned.map)
