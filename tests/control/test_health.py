"""Why a catcher has stopped: readings that no joint can have are told as such."""

import numpy as np
import pytest

import mitt
from mitt.arm.arm import Arm
from mitt.control.health import Reason, StoppedBy, hint_of
from mitt.map.learn import Learned
from mitt.signals import Array


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
