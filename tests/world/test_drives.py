"""Between a command and its torques: joint control, delay, drives, brakes; encoders that count."""

from math import pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mitt.core.arm.arm import Arm
from mitt.core.catcher.generators import Direct
from mitt.core.control.setpoints import Setpoints
from mitt.core.errors import InputError
from mitt.core.map.learn import Learned
from mitt.core.signals import TICK, Array, Command
from mitt.io.load import build_arm
from mitt.lab.trials.catcher_settings import bandwidth_of
from mitt.lab.trials.runner import TrialRunner
from mitt.lab.trials.source import source_of
from mitt.lab.world.drives import (
    JointControl,
    JointServo,
    brakes_of,
    command,
    follow,
    fresh_drives,
    hold,
)
from mitt.lab.world.scene import Actuation, Mismatch, Scene, Sensing, named_scene, read_scene
from mitt.lab.world.sensors import encoder_steps, fresh_encoders, read_encoders
from mitt.lab.world.simulation import World
from mitt.lab.world.throws import Throw

HOLDING = np.array([0.0, 20.0, -3.0])
THROW = Throw(r=np.array([3.6, 0.1, 0.2]), dr=np.array([-5.0, 0.0, 2.6]))


def acted(actuation: Actuation, orders: Array, *, steps: int) -> tuple[Array, Array]:
    """Return mean torques of each tick, shape (k, 3), and closing angles, of a row of commands."""
    drives, means, angles = fresh_drives(actuation, HOLDING), [], []
    for k, order in enumerate(orders):
        command(drives, k, order, float(k))
        mean = np.zeros(3)
        for _ in range(steps):
            angle = follow(drives, k, 0.001 / steps)
            mean += drives.mean / steps
        means.append(mean)
        angles.append(angle)
    return np.array(means), np.array(angles)


@pytest.mark.parametrize("delay", [0, 1, 2, 7])
def test_a_command_acts_so_many_ticks_later_and_holds_until_then(delay: int) -> None:
    """Before the first has arrived, the drives hold the arm and the hand is open."""
    orders = np.random.default_rng(3).standard_normal((20, 3))
    means, angles = acted(Actuation(delay=delay), orders, steps=2)
    assert np.array_equal(means[delay:], orders[: 20 - delay])
    assert np.all(means[:delay] == HOLDING)
    assert angles.tolist() == [0.0] * delay + list(range(20 - delay))


def test_what_a_drive_brings_about_does_not_depend_on_the_length_of_the_steps() -> None:
    """The mean over a tick is that of the exact response, in one step or in four."""
    orders = np.random.default_rng(4).standard_normal((30, 3))
    one, four = (acted(Actuation(bandwidth=300.0), orders, steps=n)[0] for n in (1, 4))
    assert np.allclose(one, four, atol=1e-12)


def test_a_drive_follows_a_step_with_its_bandwidth() -> None:
    """After one time constant 63 % of the step is there; it never overshoots."""
    actuation = Actuation(bandwidth=100.0)
    drives, h = fresh_drives(actuation, np.zeros(1)), 1e-5
    command(drives, 0, np.ones(1), 0.0)
    reached = []
    for _ in range(round(1.0 / (2.0 * np.pi * 100.0) / h)):
        follow(drives, 0, h)
        reached.append(drives.now[0])
    assert reached[-1] == pytest.approx(1.0 - np.exp(-1.0), abs=2e-3)
    assert np.all(np.diff(reached) > 0.0)


def test_the_arm_s_own_encoders_are_those_of_its_motors() -> None:
    """4096 counts a motor turn through the WAM's ratios; a number is that for all joints."""
    arm, turn = build_arm("wam").model, 2.0 * np.pi / 4096.0
    assert np.allclose(encoder_steps(named_scene("lab"), arm), turn / np.array([42.0, 28.25, 18.0]))
    assert np.all(encoder_steps(Scene(sensing=Sensing(encoder_step=1e-4)), arm) == 1e-4)
    assert not np.any(encoder_steps(Scene(), arm))


def test_encoders_count_and_their_velocity_is_the_difference_of_counts() -> None:
    """Readings are multiples of the step, within half of one; the true velocity is not told."""
    steps = np.array([1e-4, 3e-4, 0.0])
    encoders, rng = fresh_encoders(steps), np.random.default_rng(5)
    q, before = rng.standard_normal(3), np.zeros(3)
    for k in range(50):
        q = q + 1e-3 * rng.standard_normal(3)
        dq = rng.standard_normal(3)
        read_encoders(encoders, k * 1e-3, q, dq)
        assert np.all(np.abs(encoders.q[:2] - q[:2]) <= 0.5 * steps[:2] + 1e-15)
        counts = encoders.q[:2] / steps[:2]
        assert np.allclose(counts, np.rint(counts), atol=1e-9)
        assert (encoders.q[2], encoders.dq[2]) == (q[2], dq[2])
        wanted = np.zeros(2) if k == 0 else (encoders.q[:2] - before[:2]) / 1e-3
        assert np.allclose(encoders.dq[:2], wanted, atol=1e-9)
        before = encoders.q.copy()


def test_a_ball_differs_from_its_model_and_nothing_else_is_drawn_otherwise() -> None:
    """Radius and mass within their bounds, others in other trials; the arm as without them."""
    arm = build_arm("wam").model
    plain = World(Scene(), arm)
    varied = World(Scene(mismatch=Mismatch(ball_mass=0.1, ball_radius=0.03)), arm)
    radii = []
    for seed in range(6):
        plain.reset(THROW, seed)
        varied.reset(THROW, seed)
        masses = [world.model.body_mass.copy() for world in (plain, varied)]
        ball = varied.model.geom("ball")
        assert varied.model.geom_size[ball.id, 0] == varied.radius
        assert abs(varied.radius / 0.04 - 1.0) <= 0.03
        assert abs(masses[1][ball.bodyid[0]] / 0.07 - 1.0) <= 0.1
        others = np.arange(len(masses[0])) != ball.bodyid[0]
        assert np.array_equal(masses[0][others], masses[1][others])
        assert plain.radius == 0.04
        radii.append(varied.radius)
    assert len(set(radii)) == 6


AWAY = Throw(r=np.array([3.0, 3.0, 3.0]), dr=np.array([0.0, 3.0, 3.0]))


@settings(max_examples=30)
@given(load=st.floats(-2.0, 2.0), speed=st.floats(-5.0, 5.0))
def test_a_brake_sticks_below_its_torque_and_slips_above(
    arm: Arm, load: float, speed: float
) -> None:
    """Under a constant load it rests and stays to a nanoradian, or it gives its torque and no more.

    Args:
        arm: The arm.
        load: Share of the brake's torque.
        speed: At the beginning [rad/s].
    """
    brakes, h, inertia = brakes_of(arm.model.complete(), arm.limits), 1e-3, 2.0
    most = brakes["torque"][0]
    qvel, ctrl, q, places = np.array([speed, 0.0, 0.0]), np.full(3, 9.0), 0.0, []
    for k in range(3000):
        passive = np.zeros(3)
        hold(brakes, 1.0, qvel, ctrl, passive, h)
        assert abs(passive[0]) <= most * (1.0 + 1e-12)
        assert not ctrl.any()
        qvel[0] += h * (load * most + passive[0]) / inertia
        q += h * qvel[0]
        if k >= 2000:
            places.append(q)
    if abs(load) < 0.9:
        assert np.ptp(places) < 1e-9
    elif abs(load) > 1.1:
        assert np.ptp(places) > 0.1


def test_before_its_delay_a_brake_does_nothing(arm: Arm) -> None:
    """And one that was not told to engage never does."""
    brakes = brakes_of(arm.model.complete(), arm.limits)
    for since in (-1.0, 0.0, float(brakes["delay"].min()) - 0.001):
        ctrl, passive = np.ones(3), np.zeros(3)
        hold(brakes, since, np.ones(3), ctrl, passive, 1e-3)
        assert np.all(ctrl == 1.0)
        assert not passive.any()
        assert not brakes["given"].any()


@pytest.mark.parametrize("brakes", [True, False])
def test_an_arm_without_drives_hangs_on_its_brakes(arm: Arm, brakes: bool) -> None:
    """With them it sinks by what the springs give under its weight, once; without them it falls."""
    world, zero = World(Scene(), arm.model, limits=arm.limits), np.zeros(arm.n)
    world.reset(AWAY, 3)
    for _ in range(3000):
        q = world.truth().q
        falls = arm.inverse_dynamics(q, zero, zero) if world.t < 0.1 else zero
        told = np.array([q, zero, zero, falls])
        world.apply(Command(t=world.t, joints=told, hand=0.0, brakes=brakes))
    q = world.trace().q
    numbers = brakes_of(arm.model.complete(), arm.limits)
    assert numbers.shape == (arm.n,)
    gives = numbers["torque"] / numbers["stiffness"]
    moved = np.abs(q[1000:] - q[100]).max(axis=0)
    if brakes:
        assert np.all(moved < gives + 0.02)
        assert np.ptp(q[1000:], axis=0).max() < 1e-6
    else:
        assert moved.max() > 0.5


TAKES = ("position", "velocity")
START = np.array([0.1, 0.6, 1.0])
TURN = np.array([0.3, -0.4, 0.8])
TIME = 0.4


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
def test_what_asks_for_too_much_torque_is_done_in_part_and_throws_no_joint_aside(
    takes: str, arm: Arm
) -> None:
    """The accelerations are a share of those asked for, and a torque is at its limit."""
    q, dq, w = START, np.array([0.5, -1.0, 1.5]), 50.0
    found = []
    for gap in (1e-3 * TURN, 3.0 * TURN):
        control = JointControl(arm, takes, bandwidth=w)
        control.take(dq + gap if takes == "velocity" else q + gap)
        tau = control.torque(q, dq)
        damped = 2.0 * w * gap if takes == "velocity" else w**2 * gap - 2.0 * w * dq
        share = _forward(arm, q, dq, tau) / damped
        assert share == pytest.approx(np.full(3, share[0]))
        used = arm.limits.torque_ratio(arm.all_joints(tau), arm.all_joints(dq)).max()
        found.append((share[0], used))
    (little, _), (much, used) = found
    assert little == pytest.approx(1.0)
    assert 0.0 < much < 1.0
    assert used == pytest.approx(1.0)


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
    """By 10 ms: the second of these was stopped on encoders that were right before it did."""
    lab, f = read_scene("lab"), learned.map
    actuation = Actuation.model_validate({"takes": "velocity", "delay": 10})
    scene = lab.model_copy(update={"actuation": actuation})
    runner = TrialRunner(f.arm, Direct(f), scene, pixels=False)
    source = source_of(f.arm, seed=83500, count=4, drag=scene.ball.drag)
    statuses = [runner.throw(source, k).trial.status for k in (2, 3)]
    assert statuses == ["caught"] * 2


def test_an_arm_without_limits_takes_torques(arm: Arm) -> None:
    scene = Scene(actuation=Actuation(takes="position"))
    with pytest.raises(InputError, match=r"actuation\.takes"):
        World(scene, arm.model)
