"""Choosing a design: what counts as able, and that the gentlest able one is taken."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mitt.generator.design import MapDesign
from mitt.generator.flights import Flight
from mitt.generator.learn import Learned
from mitt.generator.mapping import unlearned
from mitt.generator.select import Assessment, Choice, assess, choose
from mitt.robot.arm import Arm


def assessment(*, share: float, speed: float, angle: float = 0.1) -> Assessment:
    """Return an assessment of ten equal flights."""
    ten = np.ones(10)
    return Assessment(
        design=MapDesign(inward=speed),
        share=share * ten,
        speed=speed * ten,
        angle=angle * ten,
        binding=("speed:j4",) * 10,
    )


def test_the_map_of_the_paper_meets_the_ball_without_relative_velocity(
    learned: Learned, flights: list[Flight]
) -> None:
    """Kappa = 1 and inward = 0: what is left is the 10 ms that the flights go on for."""
    found = assess(learned.map, flights)
    assert found.speed.max() < 1.0
    assert found.able(Choice(share=1.0)) > 0.9
    assert found.binds.split(":")[0] in ("torque", "speed", "range")


def test_an_inward_map_meets_it_faster_and_near_the_normal(arm: Arm, flights: list[Flight]) -> None:
    """The ball comes in within 25 degrees of the palm's normal; with kappa = 3 it crosses it."""
    inward = assess(unlearned(arm, MapDesign(q_catch=0.6, inward=3.0)), flights)
    across = assess(unlearned(arm, MapDesign(kappa=3.0)), flights)
    assert inward.angle.max() < np.deg2rad(25.0)
    assert across.angle.min() > np.deg2rad(60.0)
    assert inward.speed.min() > 3.0


@given(speeds=st.lists(st.floats(1.0, 9.0), min_size=1, max_size=6, unique=True))
def test_of_equally_able_designs_the_gentlest_is_chosen(speeds: list[float]) -> None:
    """Slow entry wins among the able; a gentler design that breaks a limit does not."""
    able = [assessment(share=0.8, speed=speed) for speed in speeds]
    unable = [assessment(share=1.2, speed=0.5), assessment(share=0.8, speed=1.01, angle=1.5)]
    assert choose([*unable, *able]).speed[0] == min(speeds)


def test_a_flight_outside_the_domain_is_not_able(arm: Arm, flights: list[Flight]) -> None:
    """A map whose domain the flights leave has infinite shares and says so."""
    found = assess(unlearned(arm, MapDesign(q_catch=0.2)), flights)
    assert np.all(np.isinf(found.share))
    assert found.binds == "domain"
    assert found.able(Choice()) == 0.0
