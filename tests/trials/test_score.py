"""The score of a trial follows the contract, locked joints' drives included."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mitt.core.arm.arm import Arm
from mitt.core.arm.basket import Basket
from mitt.core.arm.hands import HandModel
from mitt.core.catcher.settings import Phase
from mitt.core.catcher.state import Result, fresh_result, room_for
from mitt.core.signals import TICK, Array, Command
from mitt.io.load import build_arm
from mitt.lab.trials.score import (
    HELD_GAP,
    LYING,
    Measured,
    drive_loads,
    held,
    lies_in,
    link_torques,
    measure,
    trial_status,
)
from mitt.lab.world.engine import ARM_FLOOR, BALL_FLOOR, BALL_HAND, SELF
from mitt.lab.world.simulation import World
from mitt.lab.world.truth import Trace, Truth

RADIUS = 0.04
TICKS = 6
ZERO = np.zeros(3)
#: Agreement of sums with NumPy's, which go in another order.
ROUNDING = 1e-9


@dataclass(frozen=True)
class Ended:
    """What the score reads of a world."""

    diverged: bool = False
    first_contact: object | None = None


def status(ended: Ended, *, phase: Phase = Phase.FOLLOW, was_held: bool = False) -> str:
    """Return the status of a fake world."""
    refused = phase is Phase.REFUSED
    return trial_status(cast("World", ended), phase, refused=refused, was_held=was_held)


def command(arm: Arm, *, q: Array | None = None, dq: Array = ZERO, tau: Array = ZERO) -> Command:
    """Return a command of an arm in its ready pose but for what is given."""
    q = arm.q_ready if q is None else q
    return Command(t=0.0, joints=np.array([q, dq, ZERO, tau]), hand=0.0)


def trace(arm: Arm, **rows: Any) -> Trace:  # noqa: ANN401 (columns of several kinds)
    """Return true states at rest but for the columns given."""
    k, n = TICKS + 1, arm.n
    still = Trace(
        t=1e-3 * np.arange(k, dtype=np.float64),
        qpos=np.hstack([np.tile(arm.q_ready, (k, 1)), np.zeros((k, 10))]),
        qvel=np.zeros((k, n + 9)),
        tau=np.zeros((k, n)),
        position=np.zeros((k, 3)),
        velocity=np.zeros((k, 3)),
        force=np.zeros(k),
        seen=np.zeros(k, dtype=np.int64),
    )
    return still._replace(**rows)


def measured(arm: Arm, truth: Trace, *commands: Command) -> Measured:
    """Return what a trial was with some commands, and ready ones up to the number of ticks."""
    told = (*commands, *[command(arm)] * (TICKS - len(commands)))
    return measure(arm, ticks(arm, told), truth)


def violations(arm: Arm, truth: Trace, *commands: Command) -> int:
    """Return the violations of such a trial."""
    return measured(arm, truth, *commands).limit_violations


def ticks(arm: Arm, told: Sequence[Command], asked: Sequence[tuple[Array, Array]] = ()) -> Result:
    """Return the results of ticks: commands, and what the first of them were asked, q and dq."""
    out = room_for(fresh_result(arm.n), len(told))
    for k, c in enumerate(told):
        out.command[k, :4] = c.q, c.dq, c.ddq, c.tau
    for k, rows in enumerate(asked):
        out.reference[k, :2], out.scalars["following"][k] = rows, True
    return out


def at(arm: Arm, field: str, tick: int, joint: int, value: float) -> Trace:
    """Return a still trace with one true value changed."""
    still = trace(arm)
    {"q": still.qpos, "dq": still.qvel, "tau": still.tau}[field][tick, joint] = value
    return still


@pytest.mark.parametrize(
    ("ended", "phase", "was_held", "expected"),
    [
        (Ended(first_contact="touch"), Phase.BRAKE, True, "caught"),
        (Ended(first_contact="touch"), Phase.BRAKE, False, "dropped"),
        (Ended(), Phase.FOLLOW, False, "missed"),
        (Ended(), Phase.REFUSED, False, "unreachable"),
        (Ended(first_contact="touch"), Phase.REFUSED, True, "unreachable"),
        (Ended(first_contact="touch"), Phase.STOPPED, True, "stopped"),
        (Ended(), Phase.STOPPED, False, "stopped"),
        (Ended(diverged=True), Phase.STOPPED, False, "aborted"),
        (Ended(diverged=True, first_contact="touch"), Phase.BRAKE, True, "aborted"),
        (Ended(diverged=True), Phase.REFUSED, False, "aborted"),
    ],
)
def test_each_status_has_its_rule(
    ended: Ended, phase: Phase, was_held: bool, expected: str
) -> None:
    """Diverged goes before stopped, that before refused, before touched; untouched is missed."""
    assert status(ended, phase=phase, was_held=was_held) == expected


@given(gap=st.floats(-0.04, 0.08), geoms=st.integers(0, 6))
def test_held_takes_nearness_and_two_geoms(gap: float, geoms: int) -> None:
    """Within radius + 20 mm of the catch point and touched by two geoms or more, not else."""
    names = frozenset(f"finger_{k}" for k in range(geoms))
    ball = Truth(
        t=0.0,
        r_o=np.array([0.8, 0.0, RADIUS + gap]),
        dr_o=ZERO,
        position=np.array([0.8, 0, 0]),
        velocity=ZERO,
        q=ZERO,
        dq=ZERO,
        tau=ZERO,
        fingers=ZERO,
        touching=names,
        contact_force=1.0,
        self_contact=False,
        floor_contact=False,
        ball_on_floor=False,
    )
    if abs(gap - HELD_GAP) > 1e-9:
        assert held(ball, RADIUS) == (gap < HELD_GAP and geoms >= 2)


def test_the_rule_for_held_is_the_contract() -> None:
    """20 mm and half a second, as docs/notation.md has it."""
    from mitt.lab.trials.score import HELD_AFTER, HELD_GEOMS  # noqa: PLC0415 (beside what it checks)

    assert (HELD_GAP, HELD_GEOMS, HELD_AFTER) == (0.020, 2, 0.5)


def test_a_still_arm_violates_nothing(arm: Arm) -> None:
    """Commands and truth within the limits: no violation, and at the very limit none either."""
    assert violations(arm, trace(arm)) == 0
    edge = command(arm, q=arm.q_max, dq=arm.dq_max, tau=arm.tau_max)
    assert violations(arm, trace(arm), edge) == 0


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("joint", [0, 1, 2])
def test_a_command_beyond_a_limit_counts_from_1e_9_on(arm: Arm, joint: int, sign: float) -> None:
    """Position, speed or torque of any joint a millionth beyond, on either side: one tick each."""
    one = np.eye(3)[joint] * (1.0 + 1e-6)
    edge = np.where(sign > 0, arm.q_max, arm.q_min)
    q = np.where(np.arange(3) == joint, edge + sign * 1e-6, arm.q_ready)
    for told in (
        command(arm, q=q),
        command(arm, dq=sign * one * arm.dq_max),
        command(arm, tau=sign * one * arm.tau_max),
    ):
        assert violations(arm, trace(arm), told) == 1
        assert violations(arm, trace(arm), told, told) == 2


@pytest.mark.parametrize("joint", [0, 1, 2])
def test_the_plant_may_exceed_by_1_percent_and_no_more(arm: Arm, joint: int) -> None:
    """True speed or torque 0.9 % beyond is let pass, 1.1 % beyond is a violation; ranges alike."""
    span = arm.q_max[joint] - arm.q_min[joint]
    for share, count in ((0.009, 0), (0.011, 1)):
        for changed in (
            at(arm, "dq", 3, joint, (1 + share) * arm.dq_max[joint]),
            at(arm, "tau", 3, joint, -(1 + share) * arm.tau_max[joint]),
            at(arm, "q", 3, joint, arm.q_max[joint] + share * span),
            at(arm, "q", 3, joint, arm.q_min[joint] - share * span),
        ):
            assert violations(arm, changed) == count


def test_a_tick_counts_once_whatever_it_exceeds(arm: Arm) -> None:
    """Several limits exceeded in the same tick, by command and plant, are one violation."""
    wild = command(arm, q=arm.q_max + 1.0, dq=2 * arm.dq_max, tau=2 * arm.tau_max)
    assert violations(arm, at(arm, "dq", 1, 0, 100.0), wild) == 1
    assert violations(arm, at(arm, "dq", 2, 0, 100.0), wild) == 2


@pytest.mark.parametrize(
    ("seen", "count"), [(SELF, 1), (ARM_FLOOR, 1), (BALL_HAND, 0), (BALL_FLOOR, 0)]
)
def test_an_arm_that_hits_itself_or_the_floor_violates(arm: Arm, seen: int, count: int) -> None:
    """Contact of the arm with itself or the floor counts, contact of the ball does not."""
    flags = np.zeros(TICKS + 1, dtype=np.int64)
    flags[2] = seen
    assert violations(arm, trace(arm, seen=flags)) == count


def test_a_drive_beyond_its_limit_counts_though_no_joint_alone_is() -> None:
    """With the differential, torques at joint 2 and in motor 3 are held drive by drive."""
    motors = build_arm("wam", limits="wam-48v")
    most = motors.limits.tau_peak[0]
    drive = np.abs(motors.limits.drive_torque(motors.all_joints(motors.tau_max)))
    assert np.all(drive <= most * (1.0 + 1e-9))
    over = command(motors, tau=motors.tau_max * np.array([1.0, 1.0 + 1e-6, 1.0]))
    assert violations(motors, trace(motors), over) == 1


@given(scale=st.floats(0.1, 3.0))
def test_peaks_are_shares_of_the_limits(arm: Arm, scale: float) -> None:
    """The largest torque and speed of each joint, in any tick and of any sign."""
    truth = trace(arm)
    truth.tau[2], truth.qvel[4, :3] = -scale * arm.tau_max, scale * arm.dq_max
    found = measured(arm, truth)
    assert found.peak_torque_ratio == pytest.approx([scale] * 3)
    assert found.peak_speed_ratio == pytest.approx([scale] * 3)


def test_the_demand_is_that_of_the_reference_before_saturation(arm: Arm) -> None:
    """Mean over the ticks with a reference of tau and omega squares over their limits."""
    still = [command(arm)] * TICKS
    assert measured(arm, trace(arm)).demand_cost == 0.0
    asked = ticks(arm, still, [(arm.q_ready, 2.0 * arm.dq_max)])
    asked.scalars["saturated"][:2] = True
    out = measure(arm, asked, trace(arm))
    tau = arm.inverse_dynamics(arm.q_ready, 2.0 * arm.dq_max, ZERO) / arm.tau_max
    assert out.demand_cost == pytest.approx(float(tau @ tau) + 4.0 * 3)
    assert out.saturated_ticks == 2


def test_the_excess_is_the_farthest_reference_beyond_its_range(arm: Arm) -> None:
    """Within the ranges 0; beyond them the largest distance on either side."""
    rows = [arm.q_ready, arm.q_max + np.array([0.1, 0, 0]), arm.q_min - np.array([0, 0.3, 0])]
    for count, excess in ((0, 0.0), (1, 0.0), (2, 0.1), (3, 0.3)):
        asked = ticks(arm, [command(arm)] * TICKS, [(q, ZERO) for q in rows[:count]])
        assert measure(arm, asked, trace(arm)).range_excess_rad == pytest.approx(excess)


def test_a_step_of_the_commanded_speed_is_jerk(arm: Arm) -> None:
    """Whatever acceleration is sent beside it: of four differences of second order two are it."""
    step = np.array([0.0, 0.1, 0.0])
    told = [command(arm, dq=step if k >= 3 else ZERO) for k in range(TICKS)]
    found = measure(arm, ticks(arm, told, [(arm.q_ready, ZERO)] * TICKS), trace(arm))
    assert found.jerk_rad_s3 == pytest.approx(0.1 / TICK**2 / np.sqrt(2.0), rel=ROUNDING)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**31), limits=st.sampled_from(["paper", "wam-48v"]))
def test_the_sums_over_a_trial_are_those_of_its_arrays(seed: int, limits: str) -> None:
    """Peaks, continuous torque and violations are what NumPy says of all ticks at once."""
    arm, rng = build_arm("wam", limits=limits), np.random.default_rng(seed)
    truth, wide = trace(arm), 1.1 * (arm.q_max - arm.q_min)
    truth.qpos[:, :3] = arm.q_min + wide * rng.uniform(-0.05, 1.0, (TICKS + 1, 3))
    truth.qvel[:, :3] = arm.dq_max * rng.uniform(-1.1, 1.1, (TICKS + 1, 3))
    truth.tau[:] = arm.tau_max * rng.uniform(-1.1, 1.1, (TICKS + 1, 3))
    asked = ticks(arm, [command(arm)] * TICKS)
    asked.command[:, 3] = truth.tau[1:]
    found = measure(arm, asked, truth)
    tau, speed = _all_torques(arm, truth), np.zeros((TICKS, 4))
    speed[:, arm.model.active] = truth.dq[:-1]
    drive, share = arm.limits.drive_torque(tau), arm.limits.torque_ratio(tau, speed)
    rms = np.sqrt(np.mean(drive**2, axis=0)) / arm.limits.tau_rms
    bad = np.any(share > 1.0 + 1e-9, axis=1) | np.any(
        (np.abs(truth.dq[1:]) > 1.01 * arm.dq_max)
        | (truth.q[1:] < arm.q_min - 0.01 * (arm.q_max - arm.q_min))
        | (truth.q[1:] > arm.q_max + 0.01 * (arm.q_max - arm.q_min)),
        axis=1,
    )
    assert found.peak_torque_ratio == pytest.approx(arm.by_joint(share.max(axis=0)), rel=ROUNDING)
    speeds = np.abs(truth.dq) / arm.dq_max
    assert found.peak_speed_ratio == pytest.approx(speeds.max(axis=0), rel=ROUNDING)
    assert found.rms_torque_ratio == pytest.approx(rms, rel=ROUNDING)
    assert found.limit_violations == np.sum(bad) + np.sum(rms > 1.01)


def _all_torques(arm: Arm, truth: Trace) -> Array:
    """Return the torques of all links in each tick, by Pinocchio's mass matrix, shape (k, N)."""
    index, out = list(arm.model.active), []
    for q, dq, tau in zip(truth.q[:-1], truth.dq[:-1], truth.tau[1:], strict=True):
        bias, mass = arm.torque(q, dq, ZERO), arm.torque_derivatives(q, dq, ZERO)[2]
        out.append(bias + mass @ np.linalg.solve(mass[index], tau - bias[index]))
    return np.array(out)


@pytest.mark.parametrize(
    ("bound", "row", "ticks_over"),
    [("acceleration", 2, 1), ("jerk", 2, 2), ("torque_rate", 3, 2)],
)
def test_acceleration_jerk_and_torque_rate_of_the_command_count(
    arm: Arm, bound: str, row: int, ticks_over: int
) -> None:
    """A spike above the bound is one tick of acceleration, and two of a rate: up and down."""
    size = len(arm.model.links)
    most = {"acceleration": 50.0, "jerk": 50.0 / 1e-3, "torque_rate": 10.0 / 1e-3}[bound]
    given: dict[str, Any] = {bound: np.full(size, most)}
    limited = Arm(arm.model, replace(arm.limits, **given))
    for height, expected in ((0.999, 0), (1.01, ticks_over)):
        told = np.zeros((4, arm.n))
        told[0], told[row, 1] = arm.q_ready, height * (50.0 if row == 2 else 10.0)
        spike = Command(t=0.0, joints=told, hand=0.0)
        assert (
            violations(limited, trace(arm), command(arm), spike)
            - violations(arm, trace(arm), command(arm), spike)
            == expected
        )


def test_a_joint_without_a_bound_has_none(arm: Arm) -> None:
    """Infinite where a set names other joints only."""
    endless = np.full(len(arm.model.links), np.inf)
    limits = replace(arm.limits, acceleration=endless, jerk=endless, torque_rate=endless)
    told = np.array([arm.q_ready, ZERO, [1e6, 0.0, 0.0], ZERO])
    spike = Command(t=0.0, joints=told, hand=0.0)
    assert violations(Arm(arm.model, limits), trace(arm), spike) == 0


BASKET = Basket()


def test_a_ball_that_stays_in_a_basket_lies_in_it() -> None:
    """The same without chance: inside and touched; untouched; out for a tick."""
    for depth, seen, out, wanted in (
        (0.1, BALL_HAND, None, True),
        (0.1, 0, None, False),
        (0.1, BALL_HAND, -5, False),
    ):
        arm = build_arm("wam", hand=BASKET)
        normal, position = arm.orientation(arm.q_ready)[:, 2], arm.position(arm.q_ready)
        ball = np.tile(position + (BASKET.catch_depth - depth) * normal, (LYING, 1))
        if out is not None:
            ball[out] += 0.15 * normal
        qpos = np.hstack([np.tile(arm.q_ready, (LYING, 1)), ball, np.zeros((LYING, 4))])
        rows = np.zeros((LYING, 3))
        truth = Trace(
            t=np.linspace(0.0, 0.1, LYING),
            qpos=qpos,
            qvel=np.zeros((LYING, 9)),
            tau=rows,
            position=np.tile(position, (LYING, 1)),
            velocity=rows,
            force=np.zeros(LYING),
            seen=np.full(LYING, seen),
        )
        assert lies_in(arm, BASKET, truth) == wanted


@pytest.fixture(name="motors", scope="module")
def _motors() -> Arm:
    """A WAM with its motors, joint 3 held."""
    return build_arm("wam", limits="wam-48v", hand=HandModel())


@settings(max_examples=30)
@given(seed=st.integers(0, 2**31))
def test_holding_is_what_inverse_dynamics_says(motors: Arm, seed: int) -> None:
    """From the active torques of a motion, those of all links come back."""
    rng = np.random.default_rng(seed)
    motion = rng.uniform(-1.0, 1.0, (4, 3, 3)) * np.array([1.0, 5.0, 60.0])[:, None]
    tau = np.array([motors.torque(*row) for row in motion])
    found = link_torques(motors, motion[:, 0], motion[:, 1], motors.active(tau))
    assert np.allclose(found, tau, atol=1e-9 * (1.0 + np.abs(tau).max()))


def test_a_held_joint_loads_the_motors_of_its_neighbour(motors: Arm) -> None:
    """Both motors of the differential count for joint 2, so holding joint 3 is seen."""
    tau = np.array([0.0, 40.0, 20.0, 0.0])
    share = motors.limits.torque_ratio(tau, np.zeros(4))
    alone = motors.limits.torque_ratio(tau * [1, 1, 0, 1], np.zeros(4))
    by_joint = motors.by_joint(share)
    assert by_joint[1] == pytest.approx(max(share[1], share[2]))
    assert by_joint[1] > motors.by_joint(alone)[1]


def test_without_held_joints_the_torques_are_those_of_the_active_ones(motors: Arm) -> None:
    """An arm all of whose joints move has nobody to hold."""
    links = tuple(replace(link, held=None) for link in motors.model.links)
    arm = Arm(replace(motors.model, links=links, q_ready=np.zeros(4)), motors.limits)
    tau, still = np.array([[1.0, 2.0, 3.0, 4.0]]), np.zeros((1, 4))
    assert np.array_equal(link_torques(arm, still, still, tau), tau)


@settings(max_examples=30)
@given(seed=st.integers(0, 2**31))
def test_the_loads_are_those_of_the_limit_set(motors: Arm, seed: int) -> None:
    """Torque and share of each drive, locked joints included, and which instants are over."""
    rng = np.random.default_rng(seed)
    q, dq = np.tile(motors.q_ready, (10, 1)), rng.uniform(-1.0, 1.0, (10, 3))
    tau, limits = rng.uniform(-90.0, 90.0, (10, 3)), motors.limits
    found, links = drive_loads(motors, q, dq, tau), link_torques(motors, q, dq, tau)
    speeds = np.array([motors.all_joints(row) for row in dq])
    assert np.array_equal(found.torque, limits.drive_torque(links))
    assert np.array_equal(found.share, limits.torque_ratio(links, speeds))
    assert np.array_equal(found.over(1e-9), np.any(found.share > 1.0 + 1e-9, axis=1))
    assert not np.any(found.over(np.full(10, np.inf)))
