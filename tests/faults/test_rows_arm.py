"""Rows 9 to 22 of the fault table: numbers, time, the map, the arm, the ball, the world."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from faults.conftest import Range, Thrown
from support import ball_state

from mitt.core.arm.arm import Arm
from mitt.core.catcher.catcher import CatcherSettings
from mitt.core.control.health import CLOCK, OVERRUN, fresh_health, pass_time
from mitt.core.map.mapping import DirectMap
from mitt.core.signals import Command, MapStatus
from mitt.lab.world.scene import exact_scene
from mitt.lab.world.simulation import World
from mitt.lab.world.throws import Throw

TOWARDS = np.array([-5.5, 0.1, 1.0]), np.array([0.0, 0.0, -9.81])


def is_sound(thrown: Thrown) -> bool:
    """Say whether all commands were finite and within the limits."""
    return thrown.finite and thrown.violations == 0


@pytest.mark.parametrize("where", ["points", "stamps", "encoders"])
def test_row_09_nan_and_infinity(place: Range, where: str) -> None:
    """One number in a hundred is none: rejected at the boundary, nothing of it in any command."""
    thrown = place.throw({"kind": "nan", "where": where, "magnitude": 0.01})
    assert is_sound(thrown)
    assert thrown.status == "caught"
    assert np.all(np.isfinite(thrown.ticks.ball))


@pytest.mark.parametrize("jump", [-3600.0, 3600.0])
def test_row_10_clock_jump(place: Range, jump: float) -> None:
    """A camera clock that is an hour off for 10 ms costs those frames and nothing else."""
    fault = {"kind": "clock", "clock": "camera", "magnitude": jump, "start": 0.2, "length": 0.01}
    thrown = place.throw(fault)
    assert is_sound(thrown)
    assert jump < 0.0 or thrown.status == "caught"


@pytest.mark.parametrize("jump", [-3600.0, 3600.0])
def test_row_10_clock_jump_of_the_ticks(place: Range, jump: float) -> None:
    """Time that runs backwards is bridged by the tick, and stops the arm if it lasts."""
    fault = {"kind": "clock", "clock": "tick", "magnitude": jump, "start": 0.3}
    thrown = place.throw(fault)
    assert is_sound(thrown)
    assert np.all(np.diff(thrown.ticks.scalars["t"]) > 0.0)
    assert thrown.reasons & {"clock", "overrun", "ball lost"}
    assert thrown.status == "stopped"


@pytest.mark.parametrize("at", [300, 450])
@pytest.mark.parametrize("missing", [4, 14, 19, 29])
def test_row_11_overrun(place: Range, missing: int, at: int) -> None:
    """A tick that comes late is bridged up to 20 ms, and counted; a later one stops the arm.

    The arm goes on meanwhile, under the torques of the last command.
    """
    thrown, stops = place.throw(late=(at, missing)), missing >= 20
    assert thrown.finite
    assert stops or thrown.violations == 0
    assert thrown.status == ("stopped" if stops else "caught")
    assert ("overrun" in thrown.reasons) is stops
    assert ("late tick" in thrown.reasons) is (5 <= missing < 20)
    assert not any(reason.startswith("encoder") for reason in thrown.reasons)


def test_row_11_time_that_stands_still() -> None:
    """Twenty ticks without a usable time in a row stop the arm; so does one that comes too late."""
    notes = fresh_health()[0]
    assert [pass_time(notes, t)[1] for t in (0.0, 0.001, 0.05)][-1] == OVERRUN
    assert [pass_time(notes, 0.04)[1] for _ in range(20)][-1] == CLOCK


@pytest.mark.parametrize("off", [0.0, 1e-12, 1e-9, 1e-6, 1e-3])
def test_row_12_singular_configuration(plain: DirectMap, off: float) -> None:
    """At and beside the edge of the domain and over the axis all answers are finite."""
    edge = plain.tangent
    for r_o in (
        np.array([off, 0.0, 0.9]),
        np.array([off, off, -0.9]),
        np.array([0.55 + off, 0, 0]),
    ):
        asked = plain.reference(ball_state(r_o, *TOWARDS))
        rows = np.concatenate([asked.q_d, asked.dq_d, asked.ddq_d, asked.q_o, asked.dq_o])
        assert np.all(np.isfinite(rows)), (r_o, edge)


def test_row_13_target_outside_the_domain(plain: DirectMap) -> None:
    """Close to the shoulder l_c has no inverse: the status says DOMAIN, with finite numbers."""
    rng = np.random.default_rng(13)
    for r_o in rng.standard_normal((300, 3)):
        status, q_o = plain.to_joints(0.3 * r_o / np.linalg.norm(r_o))
        assert status is MapStatus.DOMAIN
        assert np.all(np.isfinite(q_o))


def test_row_14_far_ball(place: Range) -> None:
    """However far the ball, the adapted map starts at the arm's q and dq."""
    f, q, dq = place.taught.map, place.taught.map.arm.q_ready, np.array([0.1, -0.1, 0.2])
    for far in (1.8, 3.0, 6.0, 20.0):
        ball = ball_state(np.array([far, 0.3, 0.4]), *TOWARDS)
        asked = f.adapt(ball, q, dq).reference(ball)
        assert np.allclose(asked.q_d, q, atol=1e-7)
        assert np.allclose(asked.dq_d, dq, atol=1e-6)


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e300])
def test_row_15_optimiser_fails(place: Range, bad: float) -> None:
    """Asked to adapt to what is no ball, the map keeps coefficients that are finite."""
    f = place.taught.map
    ball = ball_state(np.array([bad, 0.0, 0.4]), *TOWARDS)
    assert np.all(np.isfinite(f.adapt(ball, f.arm.q_ready, np.zeros(3)).alpha))


def test_row_16_singular_constraint(place: Range) -> None:
    """At the catch itself C of eq. (12) has no rank left: all stays finite.

    What a gap would ask of the coefficients there has no bounds; the catcher leaves the map alone
    for the last 50 ms, and the envelope holds whatever is asked.
    """
    f = place.taught.map
    ball = ball_state(f.arm.position(f.start), *TOWARDS)
    adapted = f.adapt(ball, f.arm.q_ready, np.zeros(3))
    asked = adapted.reference(ball)
    assert np.all(np.isfinite(adapted.alpha))
    assert np.all(np.isfinite(np.concatenate([asked.q_d, asked.dq_d, asked.ddq_d])))
    assert CatcherSettings().adapt_until >= 0.05


@pytest.mark.parametrize("side", [-3.0, 3.0])
def test_row_17_infeasible_throw(place: Range, side: float) -> None:
    """A throw out of reach is refused before anything moves, with its reason."""
    ball = Throw(r=np.array([3.5, side, 0.2]), dr=np.array([-6.0, 0.0, 1.5]))
    thrown = place.throw(ball=ball)
    assert thrown.status == "unreachable"
    assert is_sound(thrown)
    assert not thrown.ticks.command[:, 1].any()


@pytest.mark.parametrize(
    "fault", [{"kind": "torque", "magnitude": 0.5}, {"kind": "payload", "magnitude": 2.0}]
)
def test_row_18_saturation(place: Range, fault: dict[str, Any]) -> None:
    """Motors at half their torque, or 2 kg too many: every command stays finite and bounded."""
    thrown = place.throw(fault)
    assert thrown.finite
    arm = place.taught.map.arm
    assert np.all(np.abs(thrown.ticks.command[:, 1]) <= arm.dq_max)
    assert np.all(np.abs(thrown.ticks.command[:, 3]) <= arm.tau_max * (1.0 + 1e-9))


@pytest.mark.parametrize("joint", [0, 1, 2])
@pytest.mark.parametrize("fault", ["stuck", "jump", "dropout", "sign"])
def test_row_19_encoder_failure(place: Range, fault: str, joint: int) -> None:
    """A lying encoder stops the arm within the limits, with a reason that names encoders."""
    plan = {"kind": "encoder", "fault": fault, "joint": joint, "start": 0.30, "magnitude": 0.4}
    thrown = place.throw(plan)
    assert thrown.status == "stopped"
    assert is_sound(thrown)
    assert any(reason.startswith("encoder") for reason in thrown.reasons)
    soon = fault in ("jump", "dropout")
    assert thrown.first("abort") <= (0.305 if soon else 0.45)


def test_row_19_coarse_encoders_are_no_failure(place: Range) -> None:
    """Counts of a WAM's joint 1, 37 microradians, are believed."""
    plan = {"kind": "encoder", "fault": "step", "magnitude": 3.65e-5}
    assert place.throw(plan).status == "caught"


@pytest.mark.parametrize("number", range(3))
def test_row_20_kick_in_flight(place: Range, number: int) -> None:
    """A kick of 0.5 m/s: the ball is never out of sight for more than 20 ms, nor a limit broken."""
    thrown = place.throw({"kind": "kick", "magnitude": 0.5, "share": 0.5}, number=number)
    assert is_sound(thrown)
    following = thrown.ticks.scalars["following"]
    assert thrown.ticks.scalars["age"][following].max() <= 0.020


def test_row_21_missed_ball(place: Range) -> None:
    """A ball that is kicked away by 3 m/s is no catch, and the arm stays within its limits."""
    thrown = place.throw({"kind": "kick", "magnitude": 4.0, "share": 0.93}, number=1)
    assert thrown.status in ("missed", "dropped", "stopped")
    assert is_sound(thrown)


@pytest.mark.parametrize("tau", [np.nan, np.inf])
def test_row_22_simulator_divergence(arm: Arm, tau: float) -> None:
    """Torques that break the physics mark the world as diverged; it is not reset in silence."""
    world, still = World(exact_scene(), arm.model), np.zeros(arm.n)
    world.reset(Throw(r=np.array([3.0, 0.0, 0.5]), dr=np.array([-5.0, 0.0, 2.0])), 1)
    bad = Command(t=0.0, joints=np.array([still, still, still, np.full(arm.n, tau)]), hand=0.0)
    for _ in range(30):
        world.apply(bad)
    assert world.diverged


def test_the_invariant_holds_with_all_faults_at_once(place: Range) -> None:
    """Every fault of the rows above together: finite commands within every limit."""
    plans: list[dict[str, Any]] = [
        {"kind": "outlier", "chance": 0.2},
        {"kind": "dropout", "magnitude": 0.3},
        {"kind": "late", "chance": 0.3},
        {"kind": "duplicate", "magnitude": 0.2},
        {"kind": "nan", "where": "encoders", "magnitude": 0.02},
        {"kind": "kick", "magnitude": 1.0},
    ]
    check: Callable[[Thrown], bool] = is_sound
    assert all(check(place.throw(*plans, number=k, pixels=k % 2 == 0)) for k in range(3))
