"""What a robot that follows setpoints is sent is finite and bounded, whatever it is read."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.core.arm.arm import Arm
from mitt.core.control.envelope import bounds_of
from mitt.core.control.setpoints import Setpoints
from mitt.core.errors import MittError
from mitt.core.signals import TICK, Command

W = 50.0
DELAY = 0.004

takes = st.sampled_from(["position", "velocity"])


@given(seed=st.integers(0, 2**31), takes=takes, lost=st.floats(0.0, 1.0))
def test_every_setpoint_is_finite_and_near_the_one_before(
    arm: Arm, seed: int, takes: str, lost: float
) -> None:
    """Desired motions that jump, readings that are lost, brakes that engage and let go."""
    rng, setpoints = np.random.default_rng(seed), Setpoints(arm, takes, bandwidth=W, delay=DELAY)
    hardest = bounds_of(arm)["ddq_max"]
    most = {
        "position": TICK * arm.dq_max,
        "velocity": hardest * (TICK + 2.0 * DELAY + 1.0 / W) + W * TICK * arm.dq_max,
    }[takes]
    before = None
    for _ in range(40):
        q = rng.uniform(arm.q_min, arm.q_max)
        q[rng.random(arm.n) < lost] = rng.choice([np.nan, np.inf])
        joints = np.array([rng.uniform(arm.q_min, arm.q_max), *rng.standard_normal((3, arm.n))])
        brakes = bool(rng.random() < 0.2)
        joints[3] *= not brakes
        command = Command(t=0.0, joints=joints, hand=0.0, brakes=brakes)
        sent = setpoints.lead(command, q).joints[0 if takes == "position" else 1]
        assert np.all(np.isfinite(sent))
        assert np.all(np.abs(sent) <= arm.dq_max) or takes == "position"
        if takes == "velocity" and brakes:
            assert not sent.any()
            before = None
            continue
        if before is not None:
            assert np.all(np.abs(sent - before) <= most + 1e-12)
        before = sent


@pytest.mark.parametrize("takes", ["position", "velocity"])
def test_a_reading_that_is_lost_once_leaves_no_trace(arm: Arm, takes: str) -> None:
    """The first, or a later one: what is sent afterwards is what would have been sent."""
    still = np.array([arm.q_ready, np.zeros(arm.n), np.zeros(arm.n)])
    for lost in range(3):
        sent = []
        for spoils in (False, True):
            setpoints = Setpoints(arm, takes, bandwidth=W, delay=DELAY)
            for k in range(4):
                q = arm.q_ready.copy()
                q[1] = np.nan if spoils and k == lost else q[1]
                told = setpoints.of(still, q)
                assert np.all(np.isfinite(told))
            sent.append(told)
        assert np.array_equal(sent[0], sent[1])


@pytest.mark.parametrize(
    ("field", "bad"),
    [
        ("bandwidth", 0.0),
        ("bandwidth", np.nan),
        ("bandwidth", -1.0),
        ("bandwidth", "8"),
        ("delay", np.nan),
        ("delay", -0.001),
        ("delay", np.inf),
        ("takes", "torque"),
        ("takes", None),
    ],
)
def test_a_control_that_cannot_be_is_refused(arm: Arm, field: str, bad: object) -> None:
    """One line that names the field."""
    given = {"takes": "position", "bandwidth": W, "delay": DELAY} | {field: bad}
    with pytest.raises(MittError, match=field):
        Setpoints(arm, **given)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "bad"),
    [
        ("desired", np.full((3, 3), np.nan)),
        ("desired", np.zeros((2, 3))),
        ("q", np.zeros(2)),
        ("passed", 0.0),
        ("passed", np.nan),
        ("fastest", np.nan),
        ("fastest", -1.0),
    ],
)
def test_a_tick_that_cannot_be_is_refused(arm: Arm, name: str, bad: object) -> None:
    """One line that names the argument, and nothing changes."""
    setpoints = Setpoints(arm, "position", bandwidth=W, delay=DELAY)
    good = {"desired": np.array([arm.q_ready, *np.zeros((2, 3))]), "q": arm.q_ready}
    with pytest.raises(MittError, match=name):
        setpoints.of(**(good | {name: bad}))  # type: ignore[arg-type]
    assert np.array_equal(setpoints.of(good["desired"], good["q"]), arm.q_ready)
