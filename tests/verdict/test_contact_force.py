"""How hard a ball presses: the model against the simulated hand, and what the fingers do to it."""

from dataclasses import replace
from itertools import pairwise

import mujoco
import numpy as np
import pytest
from verdict.test_impact import BANDWIDTH, V, approach

from mitt.core.arm.arm import Arm
from mitt.core.arm.basket import Basket
from mitt.core.arm.catch import CaughtBall, HandImpact
from mitt.core.arm.description import Hand
from mitt.core.arm.hands import HandModel, jam, rate
from mitt.core.verdict.feasibility import Outcome, Verdict
from mitt.core.verdict.holding import force_of
from mitt.core.verdict.impact import examined, harms, shares_after
from mitt.io.load import build_arm
from mitt.lab.world.build import build_scene
from mitt.lab.world.hand_bodies import NET
from mitt.lab.world.scene import Ball, Contact, Scene

#: Share by which the model may err on a palm that is held still, for balls that do not jam; and for
#: those that do.
CLEAN = 0.25
JAMMED = 0.45
#: Distances from what is struck at which an impact begins [m]: a contact begins within a step.
STARTS = (0.0100, 0.0107, 0.0114)
SPEED = 4.5
HAND = HandModel()
#: One whose fingers close around a ball that is in the palm already.
TOO_LATE = replace(HAND, closing=replace(HAND.closing, firm=0.0, passed=1.0))


def ball(
    mass: float = 0.034, *, radius: float = 0.04, e: float = 0.48, mu: float = 1.0
) -> CaughtBall:
    """Return a ball whose mass [kg] is known."""
    return CaughtBall(mass=mass, radius=radius, restitution=e, friction=mu, doubt=0.0)


def hardest(arm: Arm, b: CaughtBall, speed: float) -> float:
    """Return the largest single force [N] on a ball that strikes a hand held still; the mean."""
    scene = Scene(
        ball=Ball(mass=b.mass, radius=b.radius),
        contact=Contact(restitution=b.restitution, friction=b.friction),
    )
    built = build_scene(scene, arm.model)
    model, n, peaks = built.model, built.joints + built.fingers, []
    model.opt.gravity[:] = 0.0
    for start in STARTS:
        data, force, peak = mujoco.MjData(model), np.zeros(6), 0.0
        data.qpos[: built.joints] = arm.q_ready
        mujoco.mj_forward(model, data)
        held = data.qpos[:n].copy()
        normal = data.site_xmat[built.site].reshape(3, 3)[:, 2]
        data.qpos[-7:-4] = data.site_xpos[built.site] + (start + b.radius - 0.04) * normal
        data.qvel[-6:-3] = -speed * normal
        for _ in range(60):
            mujoco.mj_step(model, data)
            for c in range(data.ncon):
                if built.ball in data.contact[c].geom:
                    mujoco.mj_contactForce(model, data, c, force)
                    peak = max(peak, float(np.linalg.norm(force[:3])))
            data.qpos[:n], data.qvel[:n] = held, 0.0
        peaks.append(peak)
    return float(np.mean(peaks))


def on_palm(hand: Hand, b: CaughtBall, speed: float) -> float:
    """Return the force [N] of a ball that nothing slows before the palm: fingers start too late."""
    return hand.contact_force(b, HandImpact(speed, speed, lead=0.0))


@pytest.mark.parametrize(
    ("b", "speed"),
    [
        (ball(radius=0.02, e=0.2), 4.5),
        (ball(radius=0.02), 3.0),
        (ball(radius=0.025, e=0.75), 6.0),
        (ball(0.2, radius=0.025), 4.5),
        (ball(radius=0.033, mu=0.5), 4.5),
    ],
)
def test_on_a_palm_held_still_it_is_rate_mass_and_speed(
    arm: Arm, b: CaughtBall, speed: float
) -> None:
    """Of small, soft, hard, heavy and slippery balls, none of which jams in the dish."""
    assert on_palm(HAND, b, speed) == pytest.approx(hardest(arm, b, speed), rel=CLEAN)


@pytest.mark.parametrize("b", [ball(), ball(e=0.75), ball(radius=0.046), ball(0.2), ball(e=0.2)])
def test_a_ball_between_pad_and_rim_jams(arm: Arm, b: CaughtBall) -> None:
    """Of one as large as the dish, rough and hard, single contacts press up to ten times harder."""
    assert on_palm(HAND, b, SPEED) == pytest.approx(hardest(arm, b, SPEED), rel=JAMMED)


def test_hard_and_rough_balls_of_the_size_of_the_dish_jam_most() -> None:
    """Soft and slippery ones, and others than 40 mm, jam less or not at all."""
    assert jam(ball()) > 4.0
    for less in (ball(e=0.3), ball(mu=0.8), ball(radius=0.03), ball(radius=0.05)):
        assert 1.0 < jam(less) < jam(ball())
    assert jam(ball(e=0.2)) == jam(ball(mu=0.5)) == 1.0
    rates = [rate(e) for e in (0.05, 0.2, 0.4, 0.6, 0.9)]
    assert rates == sorted(rates, reverse=True)


def test_a_net_presses_with_its_damping() -> None:
    """As the simulated cords do, a tenth as hard as a palm; the ball may be of any kind."""
    net = on_palm(Basket(), ball(), SPEED)
    assert net == pytest.approx(-NET[1] * 0.034 * SPEED)
    assert net < 0.12 * on_palm(HAND, ball(), SPEED)


def test_fingers_meet_a_ball_the_farther_out_the_earlier_they_start() -> None:
    """At 20 ms they close around a ball in the palm; from 27 ms on they come below it."""
    leads = (0.020, 0.024, 0.026, 0.028, 0.031)
    for speed in (4.5, 5.2):
        places = [HAND.meeting(0.04, lead, speed) for lead in leads]
        assert all(a < b for a, b in pairwise(places))
        assert places[0] < -0.005 < 0.0 < places[3]
    assert HAND.meeting(0.04, 0.028, 0.2) < -0.02  # a slow ball is in the palm by then
    slow = replace(HAND, closing=replace(HAND.closing, acceleration=50.0, touch_speed=2.0))
    assert slow.meeting(0.04, 0.028, 4.5) < HAND.meeting(0.04, 0.028, 4.5)


def test_fingers_that_come_between_ball_and_palm_stop_it_a_heavy_one_later() -> None:
    """What they leave falls from all to nothing with the place where they meet it."""
    places = np.linspace(-0.02, 0.02, 41)
    for mass, stops in ((0.034, 0.002), (0.2, 0.006), (0.5, 0.014)):
        left = [HAND.speed_left(ball(mass), float(x)) for x in places]
        assert left == sorted(left, reverse=True)
        assert (left[0], left[-1]) == (1.0, 0.0)
        assert HAND.speed_left(ball(mass), stops) == 0.0 < HAND.speed_left(ball(mass), -0.001)


def test_a_ball_with_more_energy_than_the_fingers_take_goes_through_them() -> None:
    """The more the heavier and faster it is, never faster than it came; a strong drive stops it."""
    strong = replace(HAND, drive=replace(HAND.drive, tau_max=50.0))
    for mass, speed in ((0.034, 7.0), (0.1, 5.0), (0.5, 1.0)):
        assert HAND.speed_through(ball(mass), speed) == 0.0
    for mass, speed in ((0.2, 5.0), (0.5, 3.0), (0.5, 5.0)):
        through = HAND.speed_through(ball(mass), speed)
        assert 0.0 < through < min(speed, HAND.speed_through(ball(1.2 * mass), 1.2 * speed))
        assert strong.speed_through(ball(mass), speed) == 0.0


def test_a_heavy_ball_at_5_m_s_is_above_what_the_hand_takes(arm: Arm) -> None:
    """0.2 kg presses above its 240 N in more than a third of the throws; 0.1 kg below."""
    q, v = arm.q_ready, -5.0 * arm.orientation(arm.q_ready)[:, 2]
    assert force_of(arm, q, v, ball(0.1)) < HAND.force < force_of(arm, q, v, ball(0.2))


def test_a_ball_that_the_fingers_stop_presses_a_tenth(arm: Arm) -> None:
    """The lead decides: 27 instead of 20 ms; without a hand nothing is known."""
    q, v = arm.q_ready, -5.0 * arm.orientation(arm.q_ready)[:, 2]
    late, early = (force_of(_with(arm, hand), q, v, ball()) for hand in (TOO_LATE, HAND))
    assert 400.0 < late < 700.0
    assert 35.0 < early < 0.12 * late
    assert force_of(_with(arm, None), q, v, ball()) == 0.0
    assert force_of(arm, q, -v, ball()) == HAND.press(0.04)  # a ball that flies away


def _with(arm: Arm, hand: Hand | None, force: float = np.inf) -> Arm:
    """Return an arm with another hand, that takes a force [N]."""
    return Arm(replace(arm.model, hand=hand), replace(arm.limits, force=force))


def test_the_verdict_keeps_the_force_of_hand_and_of_arm(arm: Arm) -> None:
    """The weaker of them is the limit; half of it doubles the share; beyond it is a refusal."""
    b = CaughtBall(mass=0.034, radius=0.02)
    way = approach(np.array([0.2, 1.2, 0.6]), np.array([0.0, 0.5, 3.5]), V)
    free = _with(arm, replace(HAND, force=np.inf))
    assert free.force == np.inf
    assert "force" not in shares_after(free, way, b)
    shares = [
        shares_after(_with(arm, replace(HAND, force=of_hand), of_arm), way, b)["force"]
        for of_hand, of_arm in ((500.0, np.inf), (500.0, 250.0), (250.0, 500.0))
    ]
    assert shares[1] == shares[2] == pytest.approx(2.0 * shares[0])
    given = Verdict(
        outcome=Outcome.FEASIBLE,
        binding_limit="range:j4",
        share=0.9,
        t_catch=0.5,
        sigma=0.001,
        approach=way,
    )
    weak = _with(arm, replace(HAND, force=0.5 * 500.0 * shares[0]))
    refused = examined(weak, given, b, bandwidth=BANDWIDTH)
    assert (refused.outcome, refused.binding_limit) == (Outcome.UNREACHABLE, "force")
    assert refused.share == pytest.approx(2.0)
    assert harms(weak, given, b)
    assert examined(free, given, b, bandwidth=BANDWIDTH).outcome is Outcome.FEASIBLE


def test_a_basket_takes_what_a_hand_does_not() -> None:
    """The same ball, arm and motion: the net keeps far below a palm that no finger saves."""
    way = approach(np.array([0.2, 1.2, 0.6]), np.array([0.0, 0.5, 3.5]), V)
    share = [
        shares_after(_with(build_arm("wam", hand=hand), hand, 100.0), way, ball())["force"]
        for hand in (TOO_LATE, Basket())
    ]
    assert share[1] < 0.2 * share[0]
