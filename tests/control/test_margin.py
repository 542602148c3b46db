"""What is left of a torque-speed line at the speed at which a command will act."""

import numpy as np
import pytest

from mitt.control.encoders import Encoders, monitor_of
from mitt.control.tracking import derate, tracking_of
from mitt.robot.arm import Arm
from mitt.robot.limits import bound_of
from mitt.robot.load import load_arm

#: Rounding of a torque [N m].
EXACT = 1e-9
LEAD = 0.0023


@pytest.fixture(scope="module")
def motors() -> Arm:
    """The arm with its 80 V motors, joints 2 and 3 on one differential."""
    return load_arm("wam", limits="wam-80v")


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
    plain = load_arm("wam", limits="paper")
    assert np.array_equal(derated(plain, given, struck=True), plain.limits.packed)


def test_nothing_uncertain_takes_nothing(motors: Arm) -> None:
    """At a steady speed that is known exactly the line is the motor's own."""
    given = {name: np.zeros(motors.n) for name in ("sigma", "rate", "doubt", "jump")}
    given["dq"] = 0.9 * motors.dq_max
    assert np.allclose(derated(motors, given, struck=True), motors.limits.packed, rtol=1e-15)
