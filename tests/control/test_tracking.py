"""Laws of the tracker: the error's own equation inside the limits, every limit outside."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from stages import Tracker

from mitt.core.arm.arm import Arm
from mitt.core.arm.limits import bound_of
from mitt.core.control.encoders import Encoders, monitor_of, predict_acceleration
from mitt.core.control.envelope import bound_acceleration, bounds_of
from mitt.core.control.stop import mass_work
from mitt.core.control.tracking import derate, track, tracking_of
from mitt.core.signals import TICK, ArmState, Array, Command
from mitt.io.load import build_arm

BANDWIDTH = 80.0
#: Agreement of an acceleration through inverse dynamics and back, share of its size.
EXACT = 1e-9
#: Agreement of the simulated error with its closed form, share of its first size; the
#: controller is stepped each 0.1 ms, so w dt = 0.008.
FOLLOWED = 0.02
FINE = 1e-4
#: Largest torque of a drive beyond its bound [N m]: rounding.
ROUNDING = 1e-9
SETS = ("paper", "wam-48v", "wam-80v")

seeds = st.integers(0, 2**31)


@pytest.fixture(scope="module")
def arms() -> dict[str, Arm]:
    """The WAM with each limit set."""
    return {name: build_arm("wam", limits=name) for name in SETS}


def acceleration(arm: Arm, q: Array, dq: Array, tau: Array) -> Array:
    """Return the acceleration of an exact arm under a torque: M^-1 (tau - H dq - g), (n,)."""
    bias = arm.inverse_dynamics(q, dq, np.zeros(arm.n))
    out: Array = np.linalg.solve(arm.mass_matrix(q), tau - bias).astype(np.float64)
    return out


def begun(arm: Arm, q: Array, dq: Array) -> Tracker:
    """Return a tracker that has told the arm to move as it does."""
    tracker = Tracker(arm, bandwidth=BANDWIDTH)
    tracker.safety_filter.begin(q, dq)
    return tracker


def command(arm: Arm, q: Array, dq: Array, wanted: Array) -> Command:
    """Return the command of a fresh tracker."""
    state = ArmState(t=0.0, q=q, dq=dq)
    return Tracker(arm, bandwidth=BANDWIDTH).step(state, wanted, hand=0.0).command


def drive_excess(arm: Arm, dq: Array, tau: Array) -> float:
    """Return the largest excess of a drive's torque over its bound [N m]."""
    drive = arm.limits.drive_torque(arm.all_joints(tau))
    bound = arm.limits.torque_bound(drive, arm.limits.drive_speed(arm.all_joints(dq)))
    return float(np.max(np.abs(drive) - bound))


@given(seed=seeds)
def test_within_the_limits_the_error_obeys_its_own_equation(arm: Arm, seed: int) -> None:
    """At any instant without a limit, the arm accelerates by ddq_d + 2 w de + w^2 e."""
    rng = np.random.default_rng(seed)
    q = arm.q_ready + rng.uniform([-1.0, -0.4, 0.2], [1.0, 0.4, 1.5])
    dq = rng.uniform(-1.0, 1.0, 3)
    wanted = np.array(
        [q + rng.uniform(-1e-3, 1e-3, 3), dq + rng.uniform(-0.05, 0.05, 3), rng.uniform(-3, 3, 3)]
    )
    e, de = wanted[0] - q, wanted[1] - dq
    law = wanted[2] + 2.0 * BANDWIDTH * de + BANDWIDTH**2 * e
    tracked = begun(arm, q, dq).step(ArmState(t=0.0, q=q, dq=dq), wanted, hand=0.3)
    assert not tracked.saturated
    got = acceleration(arm, q, dq, tracked.command.tau)
    assert np.allclose(got, law, atol=EXACT * (1.0 + np.abs(law).max()))
    assert np.array_equal(tracked.command.q, wanted[0])
    assert tracked.command.hand == 0.3


@settings(max_examples=15)
@given(seed=seeds)
def test_an_arm_follows_a_reference_as_the_closed_form_says(arm: Arm, seed: int) -> None:
    """e(t) = (e_0 + (de_0 + w e_0) t) exp(-w t) along a moving reference, to 2 %."""
    rng = np.random.default_rng(seed)
    middle, size, w = np.array([0.1, 0.8, 0.9]), rng.uniform(-0.2, 0.2, 3), BANDWIDTH
    rate = rng.uniform(1.0, 4.0, 3)

    def reference(t: float) -> Array:
        s, c = np.sin(rate * t), np.cos(rate * t)
        return np.array([middle + size * s, size * rate * c, -size * rate**2 * s])

    e_0, de_0 = rng.uniform(-2e-3, 2e-3, 3), rng.uniform(-0.05, 0.05, 3)
    q, dq = reference(0.0)[:2] - np.array([e_0, de_0])
    tracker = begun(arm, *reference(0.0)[:2])
    for k in range(500):
        t = k * FINE
        wanted = reference(t)
        e = (e_0 + (de_0 + w * e_0) * t) * np.exp(-w * t)
        scale = np.max(np.abs(e_0) + np.abs(de_0) / w)
        assert np.allclose(wanted[0] - q, e, atol=FOLLOWED * scale)
        tracked = tracker.step(ArmState(t=t, q=q, dq=dq), wanted, hand=0.0)
        assert not tracked.saturated
        ddq = acceleration(arm, q, dq, tracked.command.tau)
        q, dq = q + FINE * dq + 0.5 * FINE**2 * ddq, dq + FINE * ddq


@pytest.mark.parametrize("name", SETS)
@given(seed=seeds, wild=st.sampled_from([0.1, 1.0, 10.0]))
def test_whatever_is_wanted_the_command_keeps_every_limit(
    arms: dict[str, Arm], name: str, seed: int, wild: float
) -> None:
    """Position, speed and every drive's torque are within the set, also from states beyond it."""
    arm, rng = arms[name], np.random.default_rng(seed)
    q = rng.uniform(arm.q_min - 0.2, arm.q_max + 0.2)
    dq = 1.3 * rng.uniform(-arm.dq_max, arm.dq_max)
    wanted = wild * rng.standard_normal((3, 3)) * np.array([[1.0], [10.0], [100.0]])
    kept = command(arm, q, dq, wanted)
    assert np.all((kept.q >= arm.q_min) & (kept.q <= arm.q_max))
    assert np.all(np.abs(kept.dq) <= arm.dq_max)
    assert drive_excess(arm, dq, kept.tau) <= ROUNDING


@given(seed=seeds)
def test_saturation_is_told_exactly_when_a_limit_was_met(arm: Arm, seed: int) -> None:
    """A small wish is not marked; the largest acceleration of each joint, all at once, is."""
    rng = np.random.default_rng(seed)
    q, rest = arm.q_ready + rng.uniform(-0.3, 0.3, 3), np.zeros(3)
    state = ArmState(t=0.0, q=q, dq=rest)
    tracker = begun(arm, q, rest)
    push = tracker.safety_filter.bounds["ddq_max"]
    assert not tracker.step(state, np.array([q, rest, rest]), hand=0.0).saturated
    assert tracker.step(state, np.array([q, rest, push]), hand=0.0).saturated


@pytest.mark.parametrize("name", SETS)
@settings(max_examples=25)
@given(seed=seeds)
def test_an_exact_arm_never_outruns_its_limits(arms: dict[str, Arm], name: str, seed: int) -> None:
    """A simulated exact arm led by a wild reference keeps speeds to 1 % and never meets a stop."""
    arm, rng = arms[name], np.random.default_rng(seed)
    tracker, dt = Tracker(arm, bandwidth=BANDWIDTH), 1e-3
    q, dq = arm.q_ready.copy(), np.zeros(3)
    wanted = np.array([q, dq, dq])
    for k in range(150):
        if k % 50 == 0:
            wanted = np.array(
                [rng.uniform(arm.q_min, arm.q_max), rng.uniform(-arm.dq_max, arm.dq_max), dq * 0]
            )
        kept = tracker.step(ArmState(t=k * dt, q=q, dq=dq), wanted, hand=0.0).command
        for _ in range(2):
            dq = dq + 0.5 * dt * acceleration(arm, q, dq, kept.tau)
            q = q + 0.5 * dt * dq
        assert np.all(np.abs(dq) <= 1.01 * arm.dq_max)
        assert np.all((q >= arm.q_min) & (q <= arm.q_max))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("row", [0, 1, 2])
def test_a_wish_that_is_no_number_never_reaches_the_command(arm: Arm, row: int, bad: float) -> None:
    """NaN or infinity in q_d, dq_d or ddq_d: every field of the command is finite."""
    wanted = np.array([arm.q_ready, np.zeros(3), np.zeros(3)])
    wanted[row, 1] = bad
    kept = command(arm, arm.q_ready, np.zeros(3), wanted)
    assert all(np.all(np.isfinite(x)) for x in (kept.q, kept.dq, kept.ddq, kept.tau))


@given(seed=st.integers(0, 2**31))
def test_the_acceleration_that_torques_bring_is_the_models(arm: Arm, seed: int) -> None:
    """Whatever was cut: Pinocchio's forward dynamics of the torques as commanded."""
    rng, n = np.random.default_rng(seed), arm.n
    q, dq = rng.uniform(arm.q_min, arm.q_max), rng.uniform(-1.5, 1.5, n) * arm.dq_max
    tracker, monitor = Tracker(arm, bandwidth=80.0), monitor_of(arm, Encoders())
    tracker.safety_filter.begin(q, dq)
    wanted = np.array([q, dq, np.zeros(n)]) + rng.standard_normal((3, n))
    tau = tracker.step(ArmState(t=0.0, q=q, dq=dq), wanted, hand=0.0).command.tau
    unknown = rng.uniform(0.0, 3.0, n)
    monitor.joints["unknown"] = unknown
    predict_acceleration(monitor, arm.tables, np.array([q, dq]), tau, mass_work(arm))
    ddq, coupling = monitor.ddq_by_tau, monitor.coupling
    bias, M = arm.inverse_dynamics(q, dq, np.zeros(n)), arm.mass_matrix(q)
    assert np.allclose(ddq, np.linalg.solve(M, tau - bias), rtol=1e-8, atol=1e-8)
    any_of_them = np.abs(np.linalg.inv(M)) @ unknown
    assert np.allclose(monitor.joints["ddq_unknown"], any_of_them, rtol=1e-8, atol=1e-8)
    assert np.allclose(monitor.joints["ddq_own"], unknown / np.diag(M), rtol=1e-8, atol=1e-8)
    a, k = rng.standard_normal(n), int(rng.integers(n))  # the others move otherwise than modelled
    others = np.arange(n) != k
    alone = (tau[k] - bias[k] - M[k, others] @ a[others]) / M[k, k]
    given_others = ddq[k] + coupling[k, others] @ (ddq - a)[others]
    assert np.isclose(given_others, alone, rtol=1e-6, atol=1e-6)


@given(seed=st.integers(0, 2**31))
def test_torque_that_runs_out_speeds_up_no_joint_beyond_its_limit(arm: Arm, seed: int) -> None:
    """Also where slowing down as fast as the bounds ask takes more torque than there is.

    As long as the drives can at least keep the speed, a joint beyond its limit gets no faster.
    """
    rng, n = np.random.default_rng(seed), arm.n
    middle, half = 0.5 * (arm.q_min + arm.q_max), 0.25 * (arm.q_max - arm.q_min)
    q, dq = middle + rng.uniform(-half, half), rng.uniform(-1.5, 1.5, n) * arm.dq_max
    torque = arm.torque(q, dq, np.zeros(n))
    speed = arm.all_joints(dq)
    assume(arm.limits.torque_ratio(torque, speed).max() < 1.0)
    tracker = Tracker(arm, bandwidth=80.0)
    tracker.safety_filter.begin(q, dq)
    wanted = np.array([q, dq, np.zeros(n)]) + rng.standard_normal((3, n))
    tau = tracker.step(ArmState(t=0.0, q=q, dq=dq), wanted, hand=0.0).command.tau
    ddq = np.linalg.solve(arm.mass_matrix(q), tau - arm.inverse_dynamics(q, dq, np.zeros(n)))
    beyond = np.abs(dq) > arm.dq_max
    assert np.all(ddq[beyond] * np.sign(dq[beyond]) <= 1e-6)


#: Largest change of a torque in a tick, where a set has rates [N m].
CHANGE = 1.0


@dataclass(frozen=True, kw_only=True)
class Lagging:
    """An arm in a motion whose accelerations it has, joints of which lag behind.

    Attributes:
        q, dq: Of the arm [rad, rad/s], shape (n,).
        given, asked: Accelerations commanded, and with the feedback [rad/s^2], shape (n,).
        found: Those that the torques bring, likewise.
        before: Torques of the tick before [N m], shape (n,).
    """

    q: Array
    dq: Array
    given: Array
    asked: Array
    found: Array
    before: Array


def lagging(arm: Arm, rng: np.random.Generator, *, rates: bool, lag: Array) -> Lagging:
    """Return a motion that is followed, or give the example up where it is beyond the drives."""
    n, bounds = arm.n, bounds_of(arm)
    q = 0.5 * (arm.q_min + arm.q_max) + 0.2 * rng.uniform(-1.0, 1.0, n)
    dq, ddq = rng.uniform(-1.0, 1.0, n), rng.uniform(-1.0, 1.0, n) * bounds["deceleration"]
    tau = arm.torque(q, dq, ddq)
    assume(arm.limits.torque_ratio(tau, arm.all_joints(dq)).max() < 0.99)
    motion, estimated = np.array([q + lag, dq, ddq, np.zeros(n)]), np.array([q, dq])
    w = tracking_of(arm)
    before = arm.active(tau) + rng.uniform(-0.9, 0.9, n) * CHANGE
    if rates:
        w.change[:], w.before[:] = CHANGE, before
    track(w, arm.tables, bounds, BANDWIDTH, estimated, motion, TICK)
    found, asked = acceleration(arm, q, dq, motion[3]), ddq + BANDWIDTH**2 * lag
    for wanted in (asked, ddq):
        bound_acceleration(bounds, q, dq, wanted)
    return Lagging(q=q, dq=dq, given=ddq, asked=asked, found=found, before=before)


@given(seed=seeds, joint=st.integers(0, 2), rates=st.booleans())
def test_a_joint_that_lags_takes_no_braking_from_the_others(
    arm: Arm, seed: int, joint: int, rates: bool
) -> None:
    """Where the drives have what is commanded, each joint gets that, or some of its feedback more.

    A stop is certified so: the arm is beside it as far as it was at its start. It is the same where
    torques have rates and can change to what is commanded.
    """
    rng, lag = np.random.default_rng(seed), np.zeros(arm.n)
    lag[joint] = rng.choice([-1.0, 1.0]) * rng.uniform(0.005, 0.1)
    x = lagging(arm, rng, rates=rates, lag=lag)
    slack = EXACT * (1.0 + np.abs(x.asked))
    assert np.all(x.found >= np.minimum(x.given, x.asked) - slack)
    assert np.all(x.found <= np.maximum(x.given, x.asked) + slack)


@given(seed=seeds, rates=st.booleans())
def test_a_joint_that_asks_for_too_much_takes_no_feedback_from_the_others(
    arm: Arm, seed: int, rates: bool
) -> None:
    """The last joint has its feedback, or so much that a limit is met, however others lag."""
    rng = np.random.default_rng(seed)
    x = lagging(arm, rng, rates=rates, lag=rng.uniform(-0.1, 0.1, arm.n))
    further, lacking = x.found.copy(), x.asked[-1] - x.found[-1]
    if abs(lacking) <= EXACT * (1.0 + abs(x.asked[-1])):
        return
    further[-1] += 1e-3 * lacking
    tau = arm.torque(x.q, x.dq, further)
    most = arm.limits.torque_ratio(tau, arm.all_joints(x.dq)).max()
    if rates:
        most = max(most, np.abs(arm.active(tau) - x.before).max() / CHANGE)
    assert most > 1.0 - EXACT


@pytest.mark.parametrize("beyond", [0.99, 1.02, 1.1])
def test_a_motor_that_can_hold_nothing_more_does_not_keep_the_others_from_braking(
    beyond: float,
) -> None:
    """At the no-load speed of a differential of which one motor also holds a joint's weight."""
    arm = build_arm("wam", limits="wam-80v", joints=["j1", "j3", "j4"], held={"j2": np.pi / 2})
    q, dq = np.array([0.6, -0.8, 2.1]), np.array([-2.0, beyond * arm.dq_max[1], 3.0])
    assert arm.limits.torque_ratio(arm.torque(q, dq, np.zeros(3)), arm.all_joints(dq)).max() > 0.99
    wanted = np.array([q, [-1.0, 0.8 * dq[1], 1.0], [10.0, -35.0, -100.0]])
    tracker = begun(arm, q, dq)
    tau = tracker.step(ArmState(t=0.0, q=q, dq=dq), wanted, hand=0.0).command.tau
    assert tau[1] < -5.0
    assert drive_excess(arm, dq, tau) <= ROUNDING
    assert acceleration(arm, q, dq, tau)[1] < -35.0


@given(seed=seeds, wild=st.sampled_from([0.1, 1.0, 10.0]))
def test_torques_change_no_faster_than_their_rates(arm: Arm, seed: int, wild: float) -> None:
    """Whatever is wanted."""
    rng, rate = np.random.default_rng(seed), np.full(len(arm.model.links), 1000.0)
    slow = Tracker(Arm(arm.model, replace(arm.limits, torque_rate=rate)), bandwidth=BANDWIDTH)
    state = ArmState(t=0.0, q=arm.q_ready, dq=np.zeros(arm.n))
    still = np.array([arm.q_ready, np.zeros(arm.n), np.zeros(arm.n)])
    before = slow.step(state, still, hand=0.0).command.tau.copy()
    hold = arm.inverse_dynamics(arm.q_ready, state.dq, state.dq)
    assert np.allclose(before, hold)
    cut = 0
    for k in range(60):
        q = arm.q_ready + 1e-3 * wild * rng.standard_normal(arm.n)
        wanted = still + 0.1 * wild * rng.standard_normal((3, arm.n))
        tracked = slow.step(ArmState(t=k * TICK, q=q, dq=state.dq), wanted, hand=0.0)
        change = np.abs(tracked.command.tau - before)
        assert np.all(change <= 1000.0 * TICK + ROUNDING)
        if change.max() > 1000.0 * TICK - ROUNDING:
            cut += 1
            assert tracked.saturated
        before = tracked.command.tau.copy()
    assert cut > 0
    assert drive_excess(arm, state.dq, before) <= ROUNDING


def test_an_arm_with_torque_rates_comes_back_from_a_push(arm: Arm) -> None:
    """After a sudden speed, as of an impact, it settles; plain feedback swings ever farther."""
    rate = np.full(len(arm.model.links), 1000.0)
    slow = Arm(arm.model, replace(arm.limits, torque_rate=rate))
    tracker, q, dq = Tracker(slow, bandwidth=BANDWIDTH), arm.q_ready.copy(), np.zeros(arm.n)
    still, fastest = np.array([arm.q_ready, dq, dq]), 0.0
    for k in range(1500):
        dq = dq + (np.array([0.4, -0.3, 0.5]) if k == 10 else 0.0)
        tau = tracker.step(ArmState(t=k * TICK, q=q, dq=dq), still, hand=0.0).command.tau
        ddq = acceleration(arm, q, dq, tau)
        q, dq = q + TICK * dq + 0.5 * TICK**2 * ddq, dq + TICK * ddq
        fastest = max(fastest, float(np.abs(dq).max()))
    assert fastest < 0.8
    assert np.abs(q - arm.q_ready).max() < 1e-3
    assert np.abs(dq).max() < 1e-2


LEAD = 0.0023


@pytest.fixture(scope="module")
def motors() -> Arm:
    """The arm with its 80 V motors, joints 2 and 3 on one differential."""
    return build_arm("wam", limits="wam-80v")


def derated(arm: Arm, given: dict[str, np.ndarray], *, struck: bool) -> np.ndarray:
    """Return the drives for a state of the joints."""
    monitor, w = monitor_of(arm, Encoders()), tracking_of(arm)
    monitor.joints["variance_dq"] = given["sigma"] ** 2
    monitor.joints["ddq_unknown"], monitor.ddq_by_tau[:] = given["doubt"], given["rate"]
    derate(w, arm.tables, monitor, given["dq"], given["jump"], LEAD, struck)
    return w.drives


def drawn(arm: Arm, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Return a state of the joints, up to their speed limits."""
    return {
        "dq": rng.uniform(-0.98, 0.98, arm.n) * arm.dq_max,
        "sigma": rng.uniform(0.0, 0.05, arm.n),
        "rate": rng.uniform(-100.0, 100.0, arm.n),
        "doubt": rng.uniform(0.0, 20.0, arm.n),
        "jump": rng.uniform(-0.5, 0.5, arm.n),
    }


def speeds(arm: Arm, dq: np.ndarray) -> np.ndarray:
    """Return the drives' speeds for those of the active joints [rad/s]."""
    whole = np.zeros(len(arm.model.links))
    whole[list(arm.model.active)] = dq
    return arm.limits.drive_speed(whole)


@pytest.mark.parametrize("struck", [False, True])
def test_a_torque_within_the_derated_bound_is_within_the_bound_when_it_acts(
    motors: Arm, struck: bool
) -> None:
    """Whatever speed the joints have by then, as long as it is one that the margin allows for."""
    rng, drives = np.random.default_rng(1), motors.limits.packed
    for _ in range(300):
        given = drawn(motors, rng)
        lower, now = derated(motors, given, struck=struck), speeds(motors, given["dq"])
        off = rng.uniform(-1.0, 1.0, motors.n) * (3.0 * given["sigma"] + LEAD * given["doubt"])
        later = given["dq"] + off + rng.uniform(0.0, LEAD) * given["rate"]
        later = later + (rng.uniform(0.0, 1.0) * given["jump"] if struck else 0.0)
        for m, (w, true) in enumerate(zip(now, speeds(motors, later), strict=True)):
            torque = np.copysign(bound_of(lower, m, w, w, 0.0), w)
            assert abs(torque) <= bound_of(drives, m, torque, true, 1e-3) + EXACT


def test_a_brake_and_a_drive_without_a_line_keep_their_torque(motors: Arm) -> None:
    """Against its motion a motor has its peak at any speed; a joint-level set has no line."""
    given = drawn(motors, np.random.default_rng(2))
    lower = derated(motors, given, struck=True)
    for m, w in enumerate(speeds(motors, given["dq"])):
        assert bound_of(lower, m, -w, w, 0.0) == motors.limits.tau_peak[m]
    plain = build_arm("wam", limits="paper")
    assert np.array_equal(derated(plain, given, struck=True), plain.limits.packed)


def test_nothing_uncertain_takes_nothing(motors: Arm) -> None:
    """At a steady speed that is known exactly the line is the motor's own."""
    given = {name: np.zeros(motors.n) for name in ("sigma", "rate", "doubt", "jump")}
    given["dq"] = 0.9 * motors.dq_max
    assert np.allclose(derated(motors, given, struck=True), motors.limits.packed, rtol=1e-15)
