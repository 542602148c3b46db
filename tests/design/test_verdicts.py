"""Verdicts on flights: as the catcher's, and how the ball comes into the hand."""

from dataclasses import replace

import numpy as np

from mitt.catcher.settings import CatcherSettings
from mitt.design.verdicts import verdicts
from mitt.generator.design import MapDesign
from mitt.generator.flights import Flight
from mitt.generator.learn import Learned, learn
from mitt.generator.mapping import unlearned
from mitt.robot.arm import Arm

SETTINGS = CatcherSettings()


def test_the_map_of_the_paper_meets_the_ball_without_relative_speed(
    learned: Learned, flights: list[Flight]
) -> None:
    """Kappa = 1 and inward = 0: hand and ball have one velocity, and the limits are kept."""
    said = verdicts(learned.map, flights, learned.map.arm, SETTINGS)
    assert said.speed.max() < 0.05
    assert np.mean(said.share <= 1.0) > 0.9
    assert said.binds.split(":")[0] in ("torque", "speed", "range", "brake")


def test_an_inward_map_meets_it_faster_and_near_the_normal(arm: Arm, flights: list[Flight]) -> None:
    """The ball comes in within 25 degrees of the palm's normal; with kappa = 3 it crosses it."""
    inward = learn(arm, MapDesign(q_catch=0.6, inward=3.0), flights).map
    across = learn(arm, MapDesign(kappa=3.0), flights).map
    straight = verdicts(inward, flights, arm, SETTINGS)
    aslant = verdicts(across, flights, arm, SETTINGS)
    assert straight.angle.max() < np.deg2rad(25.0)
    assert aslant.angle.min() > np.deg2rad(60.0)
    assert straight.speed.min() > 3.0


def test_a_motion_that_the_arm_cannot_follow_is_refused(
    learned: Learned, flights: list[Flight]
) -> None:
    """An arm with a tenth of the torque is late, by more the weaker it is."""
    model, limits, shares = learned.map.arm.model, learned.map.arm.limits, []
    for part in (0.5, 0.2, 0.1):
        weak = Arm(model, replace(limits, tau_peak=part * limits.tau_peak))
        said = verdicts(replace(learned.map, arm=weak), flights[:4], weak, SETTINGS)
        shares.append(float(np.median(said.share)))
    assert shares[-1] > 1.0
    assert shares == sorted(shares)


def test_a_flight_outside_the_domain_has_no_share(arm: Arm, flights: list[Flight]) -> None:
    """A map whose domain the flights leave says so."""
    said = verdicts(unlearned(arm, MapDesign(q_catch=0.2)), flights, arm, SETTINGS)
    assert np.all(np.isinf(said.share))
    assert said.binds == "domain"
