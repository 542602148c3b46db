"""Why a catcher has stopped: readings that no joint can have are told as such."""

import numpy as np
import pytest

import mitt
from mitt.core.arm.arm import Arm
from mitt.core.catcher.generators import Direct
from mitt.core.control.health import (
    CLOCK,
    Reason,
    State,
    StoppedBy,
    fresh_health,
    hint_of,
    pass_time,
)
from mitt.core.map.learn import Learned
from mitt.core.signals import Array


def _stopped(arm: Arm, learned: Learned, q: Array) -> StoppedBy:
    """Return why a catcher stops on readings [rad], shape (n,)."""
    catcher = mitt.Catcher(arm, learned)
    for t in 1e-3 * np.arange(20):
        catcher.step(mitt.Senses(t=t, arm=mitt.ArmState(t=t, q=q, dq=np.zeros(arm.n))))
    assert catcher.stopped_by is not None
    return catcher.stopped_by


def test_readings_in_degrees_are_told(arm: Arm, learned: Learned) -> None:
    """The hint names the joint, its range and degrees."""
    stopped = _stopped(arm, learned, np.degrees(arm.q_ready))
    assert stopped.reason is Reason.SILENT
    k = int(np.argmax(np.abs(arm.q_ready)))
    assert f"{arm.names[k]} reads {np.degrees(arm.q_ready[k]):.4g}" in stopped.hint
    assert "degrees" in stopped.hint
    assert "\n" not in stopped.hint


def test_no_reading_is_no_unit(arm: Arm, learned: Learned) -> None:
    """An encoder that gives no number has stopped for nothing that units explain."""
    stopped = _stopped(arm, learned, np.full(arm.n, np.nan))
    assert (stopped.reason, stopped.hint) == (Reason.SILENT, "")


@pytest.mark.parametrize("reason", [x for x in Reason if x is not Reason.SILENT])
def test_other_reasons_have_no_hint(arm: Arm, reason: Reason) -> None:
    """They say what they are."""
    assert hint_of(arm, reason, np.full(arm.n, 90.0)) == ""


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("count", [1, 3, 10])
@pytest.mark.parametrize("begin", [5.0, -3.0, 1.7e9])
def test_times_that_are_none_at_the_start_stop_nothing(
    arm: Arm, learned: Learned, bad: float, count: int, begin: float
) -> None:
    """Whatever is given in place of the first times, the first usable one is right."""
    catcher = mitt.Catcher(arm, learned)
    for t in [bad] * count + [begin + 1e-3 * k for k in range(30)]:
        reading = mitt.ArmState(t=t, q=arm.q_ready, dq=np.zeros(arm.n))
        catcher.step(mitt.Senses(t=t, arm=reading))
    assert catcher.stopped_by is None
    assert catcher.tick is not None
    assert catcher.tick.state is State.NOMINAL


def test_twenty_times_that_are_none_at_the_start_stop_the_arm() -> None:
    """As anywhere else."""
    notes = fresh_health()[0]
    assert [pass_time(notes, np.nan)[1] for _ in range(20)][-1] == CLOCK


@pytest.mark.parametrize("period", [0.0003, 0.0005, 0.001, 0.004])
@pytest.mark.parametrize("way", ["recover", "again"])
def test_torques_after_a_new_start_change_for_as_long_as_has_passed(
    arm: Arm, learned: Learned, period: float, way: str
) -> None:
    """After ``recover`` and ``take_over`` the first tick counts the time since the one before."""
    catcher, k = mitt.Catcher(arm, learned), 0

    def tick(at: float) -> None:
        reading = mitt.ArmState(t=at, q=arm.q_ready, dq=np.zeros(arm.n))
        catcher.step(mitt.Senses(t=at, arm=reading))

    for k in range(400):
        if k == 100 and way == "recover":
            catcher.stop()
        tick(k * period)
    if way == "recover":
        catcher.recover()
    else:
        before = catcher.result.command[3].copy()
        catcher = catcher.again(Direct(learned.map))
        catcher.take_over(before, k * period)
    tick((k + 1) * period)
    assert catcher.state.scalars["passed"][0] == pytest.approx(period, rel=1e-6)
    tick((k + 1) * period + 0.003)
    assert catcher.state.scalars["passed"][0] == pytest.approx(0.003, rel=1e-6)


def test_after_a_pause_and_a_new_start_nothing_is_late(arm: Arm, learned: Learned) -> None:
    """A person recovers the arm after seconds without a tick, or with a clock that began anew."""
    for later in (30.0, -0.5):
        catcher = mitt.Catcher(arm, learned)
        for k in range(200):
            if k == 50:
                catcher.stop()
            t = 1.0 + 1e-3 * k
            reading = mitt.ArmState(t=t, q=arm.q_ready, dq=np.zeros(arm.n))
            catcher.step(mitt.Senses(t=t, arm=reading))
        catcher.recover()
        for k in range(10):
            t = 1.0 + later + 1e-3 * k
            reading = mitt.ArmState(t=t, q=arm.q_ready, dq=np.zeros(arm.n))
            catcher.step(mitt.Senses(t=t, arm=reading))
            assert catcher.state.scalars["passed"][0] <= 0.005
        assert catcher.stopped_by is None
