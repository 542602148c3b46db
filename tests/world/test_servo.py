"""Robots that take positions or velocities follow as with torques: delay and lag are known."""

from math import pi

import numpy as np
import pytest

from mitt.control.setpoints import Setpoints
from mitt.errors import InputError
from mitt.generator.generators import Direct
from mitt.generator.learn import Learned
from mitt.robot.arm import Arm
from mitt.signals import TICK, Array, Command
from mitt.trials.catcher_settings import bandwidth_of
from mitt.trials.runner import TrialRunner
from mitt.trials.source import source_of
from mitt.world.scene import Actuation, Scene
from mitt.world.scenes import read_scene
from mitt.world.servo import JointServo
from mitt.world.simulation import World

TAKES = ("position", "velocity")
START, TURN, TIME = np.array([0.1, 0.6, 1.0]), np.array([0.3, -0.4, 0.8]), 0.4


def _desired(t: float) -> Array:
    """Return q, dq, ddq of a motion from rest to rest (minimum jerk), shape (3, 3)."""
    x = min(max(t / TIME, 0.0), 1.0)
    q = 10.0 * x**3 - 15.0 * x**4 + 6.0 * x**5
    dq = (30.0 * x**2 - 60.0 * x**3 + 30.0 * x**4) / TIME
    ddq = (60.0 * x - 180.0 * x**2 + 120.0 * x**3) / TIME**2
    return np.array([START + q * TURN, dq * TURN, ddq * TURN])


def _largest_gap(arm: Arm, actuation: Actuation, *, led: bool) -> float:
    """Return how far the arm is off a motion at most [rad].

    Args:
        arm: The arm.
        actuation: How it follows.
        led: Whether the accelerations of the motion are known to what makes the setpoints.
    """
    servo, q, dq, gap = JointServo(arm, actuation), START.copy(), np.zeros(3), 0.0
    for k in range(round(TIME / TICK)):
        joints = np.vstack([_desired(k * TICK), np.zeros(3)])
        joints[2] *= led
        tau = servo.torques(Command(t=k * TICK, joints=joints, hand=0.0), q, dq).tau
        ddq = _forward(arm, q, dq, tau)
        q = q + TICK * (dq + 0.5 * TICK * ddq)
        dq = dq + TICK * ddq
        gap = max(gap, float(np.abs(q - _desired((k + 1) * TICK)[0]).max()))
    return gap


def _forward(arm: Arm, q: Array, dq: Array, tau: Array) -> Array:
    """Return the acceleration by torques, from inverse dynamics alone [rad/s^2], shape (3,)."""
    bias = arm.active(arm.torque(q, dq, np.zeros(3)))
    columns = [arm.active(arm.torque(q, dq, e)) - bias for e in np.eye(3)]
    return np.asarray(np.linalg.solve(np.array(columns).T, tau - bias), np.float64)


@pytest.mark.parametrize("takes", TAKES)
def test_an_arm_follows_its_setpoints_in_spite_of_lag_and_delay(takes: str, arm: Arm) -> None:
    actuation = Actuation.model_validate({"takes": takes, "servo": 8.0, "delay": 4})
    gap = _largest_gap(arm, actuation, led=True)
    assert gap < 0.003
    assert _largest_gap(arm, actuation, led=False) > 3.0 * gap


def test_a_steady_motion_is_led_by_delay_and_lag(arm: Arm) -> None:
    """At a constant acceleration e is ddq / w^2."""
    q, w = arm.q_ready, 20.0 * pi
    desired = np.array([q, np.full(3, 0.4), np.full(3, 30.0)])
    setpoints = Setpoints(arm, "position", bandwidth=w, delay=3e-3)
    lead = q + 3e-3 * 0.4 + (0.5 * 9e-6 + 1.0 / w**2) * 30.0
    for _ in range(3):
        assert setpoints.of(desired, lead) == pytest.approx(lead)
    setpoints = Setpoints(arm, "velocity", bandwidth=w, delay=3e-3)
    speed = np.full(3, 0.4 + 0.5 * w * 0.01 + (3e-3 + 0.5 / w) * 30.0)
    assert setpoints.of(desired, q - 0.01) == pytest.approx(speed)


@pytest.mark.parametrize("takes", TAKES)
def test_no_setpoint_is_beyond_a_limit(takes: str, arm: Arm) -> None:
    """However far the arm is behind, and however hard the motion accelerates."""
    for sign, fastest in ((-1.0, np.inf), (1.0, 1.5)):
        setpoints, q = Setpoints(arm, takes, bandwidth=50.0, delay=0.01), arm.q_ready
        most = np.minimum(arm.dq_max, fastest)
        desired = np.array([q + sign * 4.0, sign * arm.dq_max, np.full(3, sign * 500.0)])
        command, before = Command(t=0.0, joints=np.vstack([desired, np.zeros(3)]), hand=0.0), q
        for _ in range(4000):
            led = setpoints.lead(command, q, passed=2.0 * TICK, fastest=fastest)
            if takes == "velocity":
                assert led.dq == pytest.approx(sign * most)
                assert np.array_equal(led.q, desired[0])
                continue
            assert np.all(np.abs(led.q - before) <= 2.0 * TICK * most * (1.0 + 1e-9))
            before = led.q
            assert np.array_equal(led.dq, desired[1])
        if takes == "position":
            assert np.array_equal(before, np.clip(q + sign * 9.0, arm.q_min, arm.q_max))


@pytest.mark.parametrize("takes", TAKES)
def test_on_its_brakes_an_arm_is_told_to_stay(takes: str, arm: Arm) -> None:
    """Whatever the motion was to be; a torque says that the brakes do not hold it yet."""
    setpoints, q = Setpoints(arm, takes, bandwidth=50.0, delay=0.0), arm.q_ready
    for torque, stays in ((0.0, True), (1.0, False)):
        joints = np.array([q + 0.01, np.full(3, 0.2), np.zeros(3), np.full(3, torque)])
        led = setpoints.lead(Command(t=0.0, joints=joints, hand=0.0, brakes=True), q)
        row = led.dq if takes == "velocity" else led.q - q
        assert np.all(row == 0.0) == stays


def test_ticks_that_are_left_out_change_nothing_of_what_makes_up_for_the_lag(arm: Arm) -> None:
    """20 ms of a steady acceleration from rest, in one step or in twenty."""
    q, found = arm.q_ready, []
    start = np.array([q, np.zeros(3), np.zeros(3)])
    pushed = np.array([q, np.zeros(3), np.full(3, 50.0)])
    for count in (1, 20):
        setpoints = Setpoints(arm, "position", bandwidth=50.0, delay=0.0)
        setpoints.of(start, q)
        for _ in range(count):
            setpoints.of(pushed, q, passed=0.02 / count)
        found.append(setpoints.of(pushed, q, passed=1.0))
    assert np.all(found[0] > q + 0.001)
    assert found[0] == pytest.approx(found[1], abs=1e-9)


def test_the_hand_waits_as_the_joints_do(arm: Arm) -> None:
    servo = JointServo(arm, Actuation(takes="position", delay=2))
    still = np.vstack([arm.q_ready, np.zeros((3, 3))])
    hands = [
        servo.torques(Command(t=k * TICK, joints=still, hand=float(k)), arm.q_ready, np.zeros(3))
        for k in range(5)
    ]
    assert [x.hand for x in hands] == [0.0, 0.0, 0.0, 1.0, 2.0]


@pytest.mark.slow
@pytest.mark.parametrize("takes", TAKES)
def test_balls_are_caught_by_robots_that_take_no_torques(takes: str, learned: Learned) -> None:
    lab = read_scene("lab")
    actuation = Actuation.model_validate({"takes": takes, "delay": 4})
    scene = lab.model_copy(update={"actuation": actuation})
    f = learned.map
    runner = TrialRunner(f.arm, Direct(f), scene, pixels=False)
    source = source_of(f.arm, seed=90, count=3, drag=scene.ball.drag)
    trials = [runner.throw(source, k).trial for k in range(3)]
    assert [x.status for x in trials] == ["caught"] * 3
    assert sum(x.limit_violations for x in trials) == 0
    assert bandwidth_of(takes, 8.0) == pytest.approx(16.0 * pi)


@pytest.mark.slow
def test_the_monitor_knows_that_setpoints_act_late(learned: Learned) -> None:
    """By 10 ms: of twelve throws some were stopped on encoders that were right before it did."""
    lab, f = read_scene("lab"), learned.map
    actuation = Actuation.model_validate({"takes": "velocity", "delay": 10})
    scene = lab.model_copy(update={"actuation": actuation})
    runner = TrialRunner(f.arm, Direct(f), scene, pixels=False)
    source = source_of(f.arm, seed=83500, count=12, drag=scene.ball.drag)
    statuses = [runner.throw(source, k).trial.status for k in range(12)]
    assert statuses == ["caught"] * 12


def test_an_arm_without_limits_takes_torques(arm: Arm) -> None:
    scene = Scene(actuation=Actuation(takes="position"))
    with pytest.raises(InputError, match=r"actuation\.takes"):
        World(scene, arm.model)
