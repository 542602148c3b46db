"""What the arm makes of a motion: where it comes to on its model, within all limits."""

import numpy as np
import pytest

from mitt.control.envelope import bounds_of
from mitt.generator.feasibility import Approach
from mitt.impact import gap_at_catch
from mitt.robot.arm import Arm
from mitt.robot.limits import joint_level
from mitt.robot.load import load_arm
from mitt.signals import Array

BANDWIDTH = 80.0
#: A motion within all limits is followed as closely as this [m].
CLOSE = 1e-3


@pytest.fixture(scope="module")
def motors() -> Arm:
    """The arm with its 80 V motors."""
    return load_arm("wam", limits="wam-80v")


def swing(arm: Arm, way: Array, duration: float) -> Approach:
    """Return a motion from rest in the ready pose, 10 x^3 - 15 x^4 + 6 x^5 of twice a way [rad].

    It ends half-way, where it is fastest.
    """
    x = np.linspace(0.0, 0.5, 25)[:, None]
    t = 2.0 * duration
    rows = [
        arm.q_ready + 2.0 * way * (10 * x**3 - 15 * x**4 + 6 * x**5),
        2.0 * way / t * (30 * x**2 - 60 * x**3 + 30 * x**4),
        2.0 * way / t**2 * (60 * x - 180 * x**2 + 120 * x**3),
    ]
    return Approach(motion=np.stack(rows, axis=1), step=duration / 24, dr_o=np.zeros(3))


def test_a_motion_within_the_limits_is_followed(motors: Arm) -> None:
    """The hand is at its place, but for what is between the instants."""
    approach = swing(motors, np.array([0.2, 0.2, 0.8]), 0.4)
    assert gap_at_catch(motors, approach, motors.dq_max, BANDWIDTH) < CLOSE


def test_a_little_too_fast_is_a_little_late(motors: Arm) -> None:
    """3 % beyond the no-load speed asks for a multiple of the torque left, but costs little way."""
    approach = swing(motors, np.array([0.0, 0.0, 1.0]), 0.2)
    fastest = float(np.abs(approach.motion[:, 1, 2]).max())
    few = swing(motors, np.array([0.0, 0.0, 1.03 * motors.dq_max[2] / fastest]), 0.2)
    much = swing(motors, np.array([0.0, 0.0, 2.0 * motors.dq_max[2] / fastest]), 0.2)
    assert gap_at_catch(motors, few, motors.dq_max, BANDWIDTH) < 0.03
    assert gap_at_catch(motors, much, motors.dq_max, BANDWIDTH) > 0.1


def test_torque_beyond_all_limits_leaves_the_hand_behind(motors: Arm) -> None:
    """0.6 rad of joint 1 in 60 ms are beyond any motor."""
    approach = swing(motors, np.array([0.3, 0.0, 0.0]), 0.06)
    assert gap_at_catch(motors, approach, motors.dq_max, BANDWIDTH) > 0.05


def test_what_a_weak_arm_cannot_follow_it_misses() -> None:
    """With limits of speed alone out of the way, torque makes the hand late: eq. (14) is obeyed."""
    strong = load_arm("wam", limits="paper")
    tau = np.array([8.0, 60.0, 60.0, 9.0])
    weak = Arm(strong.model, joint_level("weak", tau=tau, speed=np.full(4, 50.0)))
    approach = swing(strong, np.array([0.5, 0.0, 1.0]), 0.25)
    gaps = [gap_at_catch(arm, approach, np.full(3, 50.0), BANDWIDTH) for arm in (strong, weak)]
    assert gaps[0] < CLOSE < 0.05 < gaps[1]


def test_caps_make_a_fast_motion_late(motors: Arm) -> None:
    """A joint kept at half of its speed cannot be where a faster one would be."""
    approach = swing(motors, np.array([0.0, 0.0, 1.0]), 0.25)
    fast = bounds_of(motors)["dq_max"]
    gaps = [gap_at_catch(motors, approach, share * fast, BANDWIDTH) for share in (1.0, 0.5)]
    assert gaps[0] < CLOSE < 0.02 < gaps[1]
