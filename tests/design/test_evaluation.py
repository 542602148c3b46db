"""Verdicts on balls: as the catcher's, and how they come into the hand."""

from dataclasses import replace

import numpy as np
import pytest

from mitt.core.arm.arm import Arm
from mitt.core.catcher.settings import CatcherSettings
from mitt.core.map.learn import Flight, Learned, learn_from
from mitt.core.map.map_design import MapDesign, catch_place
from mitt.core.map.mapping import unlearned
from mitt.core.signals import GRAVITY, BallState
from mitt.lab.design.evaluation import balls_of as thrown
from mitt.lab.design.evaluation import verdicts
from mitt.lab.design.task import Balls, DesignTask
from mitt.lab.world.flights import RecordedFlight
from mitt.lab.world.scene import read_scene
from mitt.lab.world.throws import Throw, fly

SETTINGS = CatcherSettings()


def balls_of(flights: list[Flight]) -> list[BallState]:
    """Return balls as they are at the first instants of flights."""
    drag = SETTINGS.flight.drag_mean
    return [BallState(t=0.0, r_o=x.ball[0, 0], dr_o=x.ball[0, 1], drag=drag) for x in flights]


def test_the_map_of_the_paper_meets_the_ball_without_relative_speed(
    learned: Learned, flights: list[Flight]
) -> None:
    """Kappa = 1 and inward = 0: hand and ball have one velocity, and the limits are kept."""
    said = verdicts(learned.map, balls_of(flights), learned.map.arm, SETTINGS)
    assert said.speed.max() < 0.05
    assert np.mean(said.share <= 1.0) > 0.9
    assert said.binds.split(":")[0] in ("torque", "speed", "range", "brake")


def test_an_inward_map_meets_it_faster_and_near_the_normal(arm: Arm, flights: list[Flight]) -> None:
    """The ball comes in within 25 degrees of the palm's normal; with kappa = 3 it crosses it."""
    inward = learn_from(arm, MapDesign(q_catch=0.6, inward=3.0), flights).map
    across = learn_from(arm, MapDesign(kappa=3.0), flights).map
    straight = verdicts(inward, balls_of(flights), arm, SETTINGS)
    aslant = verdicts(across, balls_of(flights), arm, SETTINGS)
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
        said = verdicts(replace(learned.map, arm=weak), balls_of(flights[:4]), weak, SETTINGS)
        shares.append(float(np.median(said.share)))
    assert shares[-1] > 1.0
    assert shares == sorted(shares)


def test_a_ball_that_does_not_come_to_the_map_has_no_share(arm: Arm, flights: list[Flight]) -> None:
    """A map whose domain the balls leave says so."""
    said = verdicts(unlearned(arm, MapDesign(q_catch=0.2)), balls_of(flights), arm, SETTINGS)
    assert np.all(np.isinf(said.share))
    assert said.binds == "domain"


def test_the_hand_is_no_faster_than_its_joints(arm: Arm, flights: list[Flight]) -> None:
    """A map asks for what it likes; with joints at 0.4 of the speed the ball comes in faster."""
    found = learn_from(arm, MapDesign(), flights).map
    slow = Arm(arm.model, replace(arm.limits, dq_max=0.4 * arm.limits.dq_max))
    usual = verdicts(found, balls_of(flights), arm, SETTINGS)
    said = verdicts(replace(found, arm=slow), balls_of(flights), slow, SETTINGS)
    assert np.median(usual.speed) < 0.05
    assert np.median(said.speed) > 1.0


def test_throws_of_a_user_are_judged_once_each(learned: Learned) -> None:
    """Five throws are five balls, 50 ms after their release, however many are asked for."""
    throws = tuple(
        Throw(r=np.array([3.0, 0.1 * k, 0.3]), dr=np.array([-5.5, 0.0, 2.0])) for k in range(5)
    )
    task = DesignTask(balls=Balls(), scene=read_scene("lab"), throws=throws)
    balls = thrown(learned.map, task, count=30, seed=1)
    assert [ball.r_o[1] for ball in balls] == [0.1 * k for k in range(5)]
    assert balls[0].r_o[0] == pytest.approx(3.0 - 0.05 * 5.5, abs=0.01)


def test_a_recorded_ball_that_bounces_comes_to_the_catch_point(learned: Learned) -> None:
    """A bounce on its way does not lead it elsewhere: flown on freely it passes the hand."""
    t = np.linspace(0.0, 0.8, 161)
    fall, rise = 1.0 - 0.5 * GRAVITY * t**2, 0.7 * GRAVITY * 0.4 * (t - 0.4)
    up = 1.0 - 0.5 * GRAVITY * 0.16 + rise - 0.5 * GRAVITY * (t - 0.4) ** 2
    r = np.stack([3.0 - 4.0 * t, 0.0 * t, np.where(t < 0.4, fall, up)], axis=1)
    bounced = RecordedFlight(name="bounced", t=t, r=r)
    task = DesignTask(balls=Balls(), scene=read_scene("lab"), recordings=(bounced,))
    (ball,) = thrown(learned.map, task, count=30, seed=1)
    there = fly(ball.r_o, ball.dr_o, drag=ball.drag, duration=0.4)[0]
    assert np.linalg.norm(there - catch_place(learned.map.arm)) < 0.1
