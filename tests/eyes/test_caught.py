"""The clocks of eyes and arm from a ball that rides on the braking hand."""

from dataclasses import replace

import numpy as np
import pytest

from mitt.core.arm.arm import Arm
from mitt.core.arm.kinematics import joint_records, tip_motion
from mitt.core.eyes.clock_offset import (
    TRIAL,
    WARNED,
    CatchSeen,
    ClockOffset,
    LearnedClock,
    caught_offset,
)
from mitt.core.signals import TICK, Array

BRAKE = 0.6
REST = 0.8
#: Speeds of the joints as the braking begins [rad/s].
SPEEDS = np.array([0.4, -1.0, -8.0])


def joints(arm: Arm, t: Array, speeds: Array = SPEEDS) -> Array:
    """Return angles of an arm that brakes evenly from ``BRAKE`` to ``REST`` [rad], (k, n)."""
    s = np.clip(t - BRAKE, None, REST - BRAKE)
    way = s - np.where(s > 0.0, 0.5 * s**2 / (REST - BRAKE), 0.0)
    start = arm.q_ready + np.array([0.0, 0.1, -0.4])
    return np.asarray(start + way[:, None] * speeds)


def catch(
    arm: Arm,
    offset: float,
    *,
    noise: float = 0.002,
    place: tuple[float, ...] = (0.01, 0.0, 0.02),
    speeds: Array = SPEEDS,
    every: int = 2,
    seed: int = 0,
) -> CatchSeen:
    """Return a catch whose eyes see ``offset`` ahead of their stamps."""
    rng = np.random.default_rng(seed)
    t_arm = np.arange(0.3, REST + 0.1, TICK)
    t = np.arange(BRAKE - 0.3, REST, every * TICK)
    q = joints(arm, t + offset, speeds)
    seen = [arm.position(x) + arm.orientation(x) @ place for x in q]
    covariance = np.tile(noise**2 * np.eye(3), (len(t), 1, 1))
    return CatchSeen(
        t_arm=t_arm,
        q=joints(arm, t_arm, speeds),
        t_seen=t,
        seen=np.array(seen) + noise * rng.standard_normal((len(t), 3)),
        covariance=covariance,
        t_brake=BRAKE,
        t_rest=REST,
    )


def test_the_catch_point_and_its_velocity_are_those_of_the_arm(arm: Arm) -> None:
    """By one pass down the chain, at random poses and speeds, to 1e-12."""
    rng, motion = np.random.default_rng(1), np.zeros((3, 3))
    for _ in range(20):
        q, dq = rng.uniform(arm.q_min, arm.q_max), rng.standard_normal(arm.n)
        tip_motion(joint_records(arm.chain), q, dq, motion)
        assert motion[0] == pytest.approx(arm.position(q), abs=1e-12)
        assert motion[1] == pytest.approx(arm.jacobian(q) @ dq, abs=1e-12)


@pytest.mark.parametrize("offset", [-0.01, -0.005, 0.0, 0.002, 0.01])
def test_the_offset_is_found_wherever_the_ball_lies_in_the_hand(arm: Arm, offset: float) -> None:
    """Within four of its sigmas; half the frames, 2 mm of noise."""
    for seed, place in enumerate([(0.0, 0.0, 0.0), (0.03, -0.01, 0.02)]):
        found = caught_offset(arm, catch(arm, offset, place=place, seed=seed))
        assert not found.unknown
        assert found.sigma < 5e-4
        assert abs(found.offset - offset) < 4.0 * found.sigma
        assert found.residual == pytest.approx(0.002, rel=0.2)


def test_a_sighting_of_one_camera_tells_what_it_can(arm: Arm) -> None:
    """Its error along the ray counts for nothing, however large."""
    of, ray = catch(arm, 0.004, noise=0.001), np.array([1.0, 0.2, 0.3]) / np.sqrt(1.13)
    P = 1e-6 * np.eye(3) + np.outer(ray, ray)
    along = 0.05 * np.random.default_rng(2).standard_normal((len(of.seen), 1))
    one = replace(of, seen=of.seen + along * ray, covariance=np.tile(P, (len(of.seen), 1, 1)))
    found = caught_offset(arm, one)
    assert not found.unknown
    assert abs(found.offset - 0.004) < 5e-4


def test_what_tells_nothing_is_not_known(arm: Arm) -> None:
    """Too few sightings, too little motion, a ball that falls, one in no hand."""
    whole = catch(arm, 0.004)
    few = replace(
        whole, t_seen=whole.t_seen[::20], seen=whole.seen[::20], covariance=whole.covariance[::20]
    )
    assert "hardly seen" in caught_offset(arm, few).unknown
    slow = catch(arm, 0.004, speeds=0.01 * SPEEDS)
    assert "moved too little" in caught_offset(arm, slow).unknown
    fall = 0.5 * 9.81 * np.clip(whole.t_seen - BRAKE, 0.0, None) ** 2
    dropped = replace(whole, seen=whole.seen - np.outer(fall, (0.0, 0.0, 1.0)))
    assert "did not ride" in caught_offset(arm, dropped).unknown
    assert "did not ride" in caught_offset(arm, catch(arm, 0.0, place=(0.1, 0.0, 0.0))).unknown


@pytest.mark.parametrize(("normal", "side"), [(True, -1), (False, 1)])
def test_a_lost_ball_says_which_part_of_the_hand_struck_it(
    arm: Arm, normal: bool, side: int
) -> None:
    """Off the palm: it came early, images are older than stamped. Across the fingers: newer."""
    of, since = catch(arm, 0.0), catch(arm, 0.0).t_seen - BRAKE
    R = arm.orientation(joints(arm, np.array([BRAKE]))[0])
    away = R[:, 2] if normal else -R[:, 1]
    flight = np.outer(since, (-5.0, 0.0, -1.0)) - np.outer(4.9 * since**2, (0.0, 0.0, 1.0))
    struck = 2.0 * np.clip(since + 0.02, 0.0, None)[:, None] * away
    lost = caught_offset(arm, replace(of, seen=of.seen[0] + flight + struck))
    assert lost.unknown
    assert lost.side == side
    free = caught_offset(arm, replace(of, seen=of.seen[0] + flight))
    assert free.side == 0


def told(offset: float, sigma: float = 3e-4) -> ClockOffset:
    """Return what a catch said."""
    return ClockOffset(offset=offset, sigma=sigma, residual=0.001, count=100)


def learned(offsets: list[float]) -> LearnedClock:
    """Return what is learned of catches whose whole offsets are these."""
    clock = LearnedClock()
    for offset in offsets:
        clock.take(told(offset - clock.offset), clock.offset)
    return clock


def test_catches_are_weighed_and_stamps_corrected_by_what_they_say() -> None:
    """The error falls with the catches; a correction that is in use already counts."""
    rng = np.random.default_rng(3)
    for true in (-0.01, -0.002, 0.0, 0.005):
        clock = learned((true + 4e-4 * rng.standard_normal(10)).tolist())
        assert clock.count == 10
        assert abs(clock.offset - true) < 4.0 * clock.sigma < 1e-3


def test_a_clock_that_is_set_is_followed_and_one_odd_catch_is_not() -> None:
    """Two catches that agree are a new offset; one alone is none."""
    assert learned([0.001] * 4 + [0.02] + [0.001] * 2).offset == pytest.approx(0.001, abs=1e-4)
    assert learned([0.001] * 4 + [0.006] * 2).offset == pytest.approx(0.006, abs=1e-4)


def test_an_unsure_first_catch_waits_for_one_that_agrees() -> None:
    """Alone it changes no stamp; a sure one is believed at once, whatever it said."""
    clock = LearnedClock()
    clock.take(told(0.0026, sigma=6e-4), 0.0)
    assert (clock.count, clock.offset) == (0, 0.0)
    clock.take(told(-0.0024, sigma=1e-4), 0.0)
    assert (clock.count, clock.offset) == (1, -0.0024)
    clock = LearnedClock()
    for offset in (0.0026, 0.003):
        clock.take(told(offset, sigma=6e-4), clock.offset)
    assert clock.count == 2
    assert clock.offset == pytest.approx(0.0028)


def test_an_offset_is_tried_where_no_ball_is_held() -> None:
    """To the side that the ball was struck from, then to the other, then none, then anew."""
    clock, lost = LearnedClock(), ClockOffset(unknown="lost", side=-1)
    tried = []
    for _ in range(4):
        clock.take(lost, clock.offset)
        tried.append(clock.offset)
    assert tried == [-TRIAL, TRIAL, 0.0, -TRIAL]
    assert clock.count == 0
    assert clock.warning == ""
    assert clock.figures["offset_s"] is None
    clock = LearnedClock()
    clock.take(lost, 0.0)
    clock.take(told(-0.003), clock.offset)
    assert clock.offset == pytest.approx(-TRIAL - 0.003)
    clock.take(lost, clock.offset)
    assert clock.offset == pytest.approx(-TRIAL - 0.003)


@pytest.mark.parametrize(
    ("offset", "said"), [(0.0, ""), (0.0015, ""), (-0.005, "older"), (0.003, "newer")]
)
def test_a_person_is_warned_beyond_two_milliseconds(offset: float, said: str) -> None:
    """And is told which way."""
    warning = learned([offset]).warning
    assert (abs(offset) > WARNED) == bool(warning)
    assert said in warning


def test_balls_lost_on_one_side_are_counted() -> None:
    """In a row: one of the other side begins anew, a held one ends it."""
    clock = LearnedClock()
    held, unsure = ClockOffset(sigma=5e-4), ClockOffset(unknown="hardly seen")
    lost = {side: ClockOffset(unknown="lost", side=side) for side in (-1, 1)}
    counts = []
    for found in (lost[1], lost[1], unsure, lost[-1], lost[-1], lost[-1], held, lost[1]):
        clock.take(found, 0.0)
        counts.append(clock.struck)
    assert counts == [1, 2, 2, -1, -2, -3, 0, 1]
