"""The rules of the score: statuses, what counts as held, and every kind of violation."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.records import Phase, Record, fresh_result
from mitt.robot.arm import Arm
from mitt.robot.load import load_arm
from mitt.signals import Array, Command
from mitt.study.score import HELD_GAP, Meter, held, status_of
from mitt.world.contacts import ARM_FLOOR, BALL_FLOOR, BALL_HAND, SELF
from mitt.world.simulation import World
from mitt.world.truth import Trace, Truth

RADIUS, TICKS = 0.04, 6
ZERO = np.zeros(3)


@dataclass(frozen=True)
class Ended:
    """What the score reads of a world."""

    diverged: bool = False
    first_contact: object | None = None


def status(ended: Ended, *, phase: Phase = Phase.FOLLOW, was_held: bool = False) -> str:
    """Return the status of a stand-in world."""
    return status_of(cast("World", ended), phase, was_held=was_held)


def command(arm: Arm, *, q: Array | None = None, dq: Array = ZERO, tau: Array = ZERO) -> Command:
    """Return a command of an arm in its ready pose but for what is given."""
    q = arm.q_ready if q is None else q
    return Command(t=0.0, told=np.array([q, dq, ZERO, tau]), hand=0.0)


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
    return replace(still, **rows)


def meter(arm: Arm, *commands: Command) -> Meter:
    """Return a meter told some commands, and ready ones up to the number of ticks."""
    told = (*commands, *[command(arm)] * (TICKS - len(commands)))
    return Meter(arm, ticks(arm, told))


def ticks(arm: Arm, told: Sequence[Command], asked: Sequence[tuple[Array, Array]] = ()) -> Record:
    """Return the results of ticks: commands, and what the first of them were asked, q and dq."""
    out = np.repeat(fresh_result(arm.n), len(told))
    for k, c in enumerate(told):
        out["told"][k, :4] = c.q, c.dq, c.ddq, c.tau
    for k, rows in enumerate(asked):
        out["asked"][k, :2], out["following"][k] = rows, True
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
        (Ended(first_contact="touch"), Phase.STOPPED, True, "aborted"),
        (Ended(diverged=True, first_contact="touch"), Phase.BRAKE, True, "aborted"),
        (Ended(diverged=True), Phase.REFUSED, False, "aborted"),
    ],
)
def test_each_status_has_its_rule(
    ended: Ended, phase: Phase, was_held: bool, expected: str
) -> None:
    """Diverged or stopped goes before refused, refused before touched, untouched is missed."""
    assert status(ended, phase=phase, was_held=was_held) == expected


@given(gap=st.floats(-0.04, 0.08), geoms=st.integers(0, 6))
def test_held_takes_nearness_and_two_geoms(gap: float, geoms: int) -> None:
    """Within radius + 20 mm of the catch point and touched by two geoms or more, not else."""
    names = frozenset(f"finger_{k}" for k in range(geoms))
    ball = Truth(
        t=0.0, r_o=np.array([0.8, 0.0, RADIUS + gap]), dr_o=ZERO, position=np.array([0.8, 0, 0]),
        velocity=ZERO, q=ZERO, dq=ZERO, tau=ZERO, fingers=ZERO, touching=names, contact_force=1.0,
        self_contact=False, floor_contact=False, ball_on_floor=False,
    )  # fmt: skip
    if abs(gap - HELD_GAP) > 1e-9:
        assert held(ball, RADIUS) == (gap < HELD_GAP and geoms >= 2)


def test_the_rule_for_held_is_the_contract() -> None:
    """20 mm and half a second, design.md section 3."""
    from mitt.study.score import HELD_AFTER, HELD_GEOMS  # noqa: PLC0415 (beside what it checks)

    assert (HELD_GAP, HELD_GEOMS, HELD_AFTER) == (0.020, 2, 0.5)


def test_a_still_arm_violates_nothing(arm: Arm) -> None:
    """Commands and truth within the limits: no violation, and at the very limit none either."""
    assert meter(arm).violations(trace(arm)) == 0
    edge = command(arm, q=arm.q_max, dq=arm.dq_max, tau=arm.tau_max)
    assert meter(arm, edge).violations(trace(arm)) == 0


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
        assert meter(arm, told).violations(trace(arm)) == 1
        assert meter(arm, told, told).violations(trace(arm)) == 2


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
            assert meter(arm).violations(changed) == count


def test_a_tick_counts_once_whatever_it_exceeds(arm: Arm) -> None:
    """Several limits exceeded in the same tick, by command and plant, are one violation."""
    wild = command(arm, q=arm.q_max + 1.0, dq=2 * arm.dq_max, tau=2 * arm.tau_max)
    assert meter(arm, wild).violations(at(arm, "dq", 1, 0, 100.0)) == 1
    assert meter(arm, wild).violations(at(arm, "dq", 2, 0, 100.0)) == 2


@pytest.mark.parametrize(
    ("seen", "count"), [(SELF, 1), (ARM_FLOOR, 1), (BALL_HAND, 0), (BALL_FLOOR, 0)]
)
def test_an_arm_that_hits_itself_or_the_floor_violates(arm: Arm, seen: int, count: int) -> None:
    """Contact of the arm with itself or the floor counts, contact of the ball does not."""
    flags = np.zeros(TICKS + 1, dtype=np.int64)
    flags[2] = seen
    assert meter(arm).violations(trace(arm, seen=flags)) == count


def test_a_drive_beyond_its_limit_counts_though_no_joint_alone_is() -> None:
    """With the differential, torques at joint 2 and in motor 3 are held drive by drive."""
    motors = load_arm("wam", limits="wam-48v")
    most = motors.limits.tau_peak[0]
    drive = np.abs(motors.limits.drive_torque(motors.all_joints(motors.tau_max)))
    assert np.all(drive <= most * (1.0 + 1e-9))
    over = command(motors, tau=motors.tau_max * np.array([1.0, 1.0 + 1e-6, 1.0]))
    assert meter(motors, over).violations(trace(motors)) == 1


@given(scale=st.floats(0.1, 3.0))
def test_peaks_are_shares_of_the_limits(arm: Arm, scale: float) -> None:
    """The largest torque and speed of each joint, in any tick and of any sign."""
    truth = trace(arm)
    truth.tau[2], truth.qvel[4, :3] = -scale * arm.tau_max, scale * arm.dq_max
    torque, speed = meter(arm).peaks(truth)
    assert torque == pytest.approx([scale] * 3)
    assert speed == pytest.approx([scale] * 3)


def test_the_demand_is_that_of_the_reference_before_saturation(arm: Arm) -> None:
    """Mean over the ticks with a reference of tau and omega squares over their limits."""
    still = [command(arm)] * 2
    assert Meter(arm, ticks(arm, still)).demand_cost() == 0.0
    asked = ticks(arm, still, [(arm.q_ready, 2.0 * arm.dq_max)])
    asked["saturated"] = True
    out = Meter(arm, asked)
    tau = arm.inverse_dynamics(arm.q_ready, 2.0 * arm.dq_max, ZERO) / arm.tau_max
    assert out.demand_cost() == pytest.approx(float(tau @ tau) + 4.0 * 3)
    assert out.saturated == 2


def test_the_excess_is_the_farthest_reference_beyond_its_range(arm: Arm) -> None:
    """Within the ranges 0; beyond them the largest distance on either side."""
    still = [command(arm)] * 3
    rows = [arm.q_ready, arm.q_max + np.array([0.1, 0, 0]), arm.q_min - np.array([0, 0.3, 0])]
    assert Meter(arm, ticks(arm, still)).excess() == 0.0
    assert Meter(arm, ticks(arm, still, [(rows[0], ZERO)])).excess() == 0.0
    asked = ticks(arm, still, [(q, ZERO) for q in rows])
    assert Meter(arm, asked).excess() == pytest.approx(0.3)
