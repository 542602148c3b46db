"""Laws of the encoders' monitor: silent on what an arm can do, sure of what it cannot."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from mitt.core.arm.arm import Arm
from mitt.core.control import encoders
from mitt.core.control.encoders import (
    BRIDGED,
    FAST,
    FINE,
    GOOD_TICKS,
    JUMPED,
    LOSSY_TICKS,
    REVERSED,
    SILENT,
    SILENT_TICKS,
    STUCK,
    Encoders,
    Reading,
    estimate_joints,
    monitor_of,
)
from mitt.core.control.envelope import bounds_of
from mitt.core.errors import InputError
from mitt.core.signals import TICK, Array

#: Resolutions of encoders [rad], from fine to coarse.
STEPS = (1e-5, 8.5e-5, 1e-3)
#: Acceleration by unknown forces that the monitor is told of [rad/s^2], and share of it and of the
#: modelled acceleration by which the true one differs.
DOUBT = 15.0
WRONG = 0.15
#: Ticks within which a fault is found that shows itself.
WITHIN = 5

seeds = st.integers(0, 2**31)
steps = st.sampled_from(STEPS)
joints = st.integers(0, 2)


def motion(arm: Arm, seed: int, ticks: int) -> tuple[Array, Array, Array]:
    """Return a smooth motion within the limits: q, dq, ddq, each shape (ticks, n)."""
    rng, b = np.random.default_rng(seed), bounds_of(arm)
    w = rng.uniform(3.0, 12.0, arm.n)
    size = 0.7 * np.minimum(b["dq_max"] / w, b["ddq_max"] / w**2) * rng.uniform(0.1, 1.0, arm.n)
    size = np.minimum(size, 0.6)
    t = TICK * np.arange(ticks)[:, None]
    phase = rng.uniform(0.0, 2.0 * np.pi, arm.n)
    q = arm.q_ready + size * np.sin(w * t + phase)
    return q, size * w * np.cos(w * t + phase), -size * w**2 * np.sin(w * t + phase)


class Watch:
    """A monitor that is fed a motion, tick by tick."""

    def __init__(self, arm: Arm, step: float = 3.65e-5) -> None:
        """Start with nothing read."""
        self.monitor, self.step = monitor_of(arm, Encoders(step=step)), step
        self.monitor.bounds[:] = bounds_of(arm)
        self.monitor.coupling[:] = np.eye(arm.n)
        self.joints, self.estimated = self.monitor.joints, np.zeros((2, arm.n))
        self.joints["ddq_unknown"] = self.joints["ddq_own"] = DOUBT
        self.impact_dq = np.zeros(arm.n)

    def couple(self, arm: Arm) -> None:
        """Let joints drive each other as the arm's, with a tenth of its torque unknown."""
        M, unknown = arm.mass_matrix(arm.q_ready), 0.1 * arm.tau_max
        self.monitor.coupling[:] = M / np.diag(M)[:, None]
        self.joints["ddq_unknown"] = np.abs(np.linalg.inv(M)) @ unknown
        self.joints["ddq_own"] = unknown / np.diag(M)

    def read(
        self,
        q: Array,
        push: Array,
        dq: Array | None = None,
        *,
        held: bool = False,
        passed: float = TICK,
    ) -> int:
        """Feed positions as they are."""
        read = np.array([q, np.zeros_like(q) if dq is None else dq])
        self.monitor.ddq_by_tau[:] = push
        when = Reading(passed, passed, 0.0)
        return int(estimate_joints(self.monitor, read, held, self.impact_dq, when, self.estimated))

    def count(self, q: Array, push: Array, dq: Array | None = None) -> int:
        """Feed positions as the encoders count them."""
        return self.read(self.step * np.round(q / self.step), push, dq)


@pytest.mark.thorough
@given(seed=seeds, step=steps, noise=st.sampled_from((0.0, 0.05, 5.0)))
def test_a_true_motion_raises_no_alarm(arm: Arm, seed: int, step: float, noise: float) -> None:
    """Counted readings of a motion whose model is wrong are believed, whatever the velocity says.

    The estimate is better than a difference of counts: its speed is within 0.3 rad/s.
    """
    q, dq, ddq = motion(arm, seed, 600)
    rng, watch = np.random.default_rng(seed), Watch(arm, step)
    wrong = 1.0 + rng.uniform(-WRONG, WRONG, arm.n)
    off = 0.5 * DOUBT * rng.uniform(-1.0, 1.0, arm.n)
    for k in range(1, 600):
        read = dq[k] + noise * rng.standard_normal(arm.n)
        assert watch.count(q[k], wrong * ddq[k - 1] + off, read if k > 1 else dq[k]) == FINE
        if k > 50:
            assert np.all(np.abs(watch.estimated[0] - q[k]) <= 2.0 * step + 2e-4)
            assert np.all(np.abs(watch.estimated[1] - dq[k]) <= 0.3)


@given(seed=seeds, step=steps)
def test_a_third_of_the_readings_may_be_lost(arm: Arm, seed: int, step: float) -> None:
    """With 30 % of the readings no number the others are used, and nothing is alarmed."""
    q, dq, ddq = motion(arm, seed, 600)
    rng, watch = np.random.default_rng(seed), Watch(arm, step)
    for k in range(1, 600):
        lost = rng.random(arm.n) < 0.3
        read = np.where(lost & (k > 1), np.nan, step * np.round(q[k] / step))
        assert watch.read(read, (1.0 + WRONG) * ddq[k - 1], dq[k]) <= BRIDGED
        if k > 50:
            assert np.all(np.abs(watch.estimated[0] - q[k]) <= 2.0 * step + 2e-3)


@given(joint=joints, speed=st.floats(1.0, 2.0), step=st.sampled_from(STEPS[:2]))
def test_an_impact_may_mirror_a_velocity(arm: Arm, joint: int, speed: float, step: float) -> None:
    """While the ball may strike, its impact may turn a velocity round; else the encoder is."""
    for may_strike in (True, False):
        watch, dq = Watch(arm, step), np.zeros(arm.n)
        watch.impact_dq[joint] = 2.5 * speed if may_strike else 0.0
        q, dq[joint] = arm.q_ready.copy(), speed
        found = FINE
        for k in range(100):
            dq[joint] = speed if k < 60 else -speed
            q = q + TICK * dq
            found = max(found, watch.count(q, np.zeros(arm.n), dq))
        assert found <= BRIDGED if may_strike else found == REVERSED


@given(joint=joints, step=st.sampled_from(STEPS[:2]))
def test_an_impact_may_halt_a_joint(arm: Arm, joint: int, step: float) -> None:
    """While the ball may strike, its impact may bring a joint to rest; else the encoder is stuck.

    The speed is so low that readings are refused in neither case.
    """
    for may_strike in (True, False):
        watch, dq = Watch(arm, step), np.zeros(arm.n)
        watch.impact_dq[joint] = 1.0 if may_strike else 0.0
        q, found = arm.q_ready.copy(), FINE
        for k in range(100):
            dq[joint] = 0.5 if k < 60 else 0.0
            q = q + TICK * dq
            found = max(found, watch.count(q, np.zeros(arm.n), dq))
        assert found <= BRIDGED if may_strike else found == STUCK


@given(seed=seeds, joint=joints, change=st.floats(0.5, 3.0), step=steps)
def test_an_impact_is_no_fault(arm: Arm, seed: int, joint: int, change: float, step: float) -> None:
    """A velocity that changes at once, as by a blow, is believed after three ticks at most."""
    watch, rng = Watch(arm, step), np.random.default_rng(seed)
    q, dq, push = arm.q_ready.copy(), np.zeros(arm.n), np.zeros(arm.n)
    dq[joint] = before = rng.uniform(0.2, 1.0)
    for k in range(120):
        if k == 60:
            dq[joint] = -np.sign(dq[joint]) * rng.uniform(0.0, 0.6) * abs(dq[joint])
            dq[joint] += change * rng.choice([-1.0, 1.0])
            assume(abs(dq[joint] + before) > 0.1 * before + 3.0 * step / TICK)  # no mirror image
        q = q + TICK * dq
        assert watch.count(q, push, dq) <= BRIDGED
        assert watch.monitor.joints["fault"][joint] == FINE
    assert np.all(np.abs(watch.estimated[1] - dq) <= 0.3)


@given(joint=joints, side=st.sampled_from((-1.0, 1.0)), step=steps)
def test_a_joint_that_friction_holds_is_not_a_stuck_encoder(
    arm: Arm, joint: int, side: float, step: float
) -> None:
    """Driven by less than unknown forces can hold, a still joint is believed."""
    watch, push = Watch(arm, step), np.zeros(arm.n)
    push[joint] = side * DOUBT
    for _ in range(300):
        assert watch.count(arm.q_ready, push) == FINE


@given(step=st.sampled_from(STEPS[:2]), held=st.booleans())
def test_how_the_others_move_says_whether_something_holds_a_joint(
    arm: Arm, step: float, held: bool
) -> None:
    """Whatever holds joint 4 pushes joint 2; if joint 2 does as commanded, nothing holds joint 4.

    By unknown torques at all joints it could be held.
    """
    watch, push, found = Watch(arm, step), np.array([0.0, 0.0, -60.0]), FINE
    watch.joints["ddq_unknown"], watch.joints["ddq_own"] = 80.0, 8.0
    watch.monitor.coupling[2, 1] = 1.6
    for k in range(100):
        t = TICK * max(k - 40, 0)
        q = arm.q_ready + np.array([0.0, -0.5 * t * t * 60.0 / 1.6 if held else 0.0, 0.0])
        found = max(found, watch.count(q, push if k >= 40 else 0.0 * push))
        if found > BRIDGED:
            break
    assert found == (FINE if held else STUCK)
    assert held or k <= 40 + 3 * WITHIN


@given(joint=joints, times=st.floats(3.0, 12.0), step=st.sampled_from(STEPS[:2]))
def test_a_stuck_encoder_puts_no_other_in_doubt(
    arm: Arm, joint: int, times: float, step: float
) -> None:
    """One joint is driven and reads nothing of it, the others rest: it alone is in doubt."""
    watch, push = Watch(arm, step), np.zeros(arm.n)
    watch.couple(arm)
    push[joint] = times * watch.joints["ddq_own"][joint]
    for k in range(300):
        watch.count(arm.q_ready, push if k >= 40 else 0.0 * push)
    assert encoders.faulty(watch.monitor.joints) == [joint]


@given(joint=joints, change=st.floats(-1.0, 1.0), step=st.sampled_from(STEPS[:2]))
def test_a_blow_to_one_joint_puts_no_other_in_doubt(
    arm: Arm, joint: int, change: float, step: float
) -> None:
    """The ball strikes so that one joint moves and the others, which are coupled to it, rest."""
    watch, dq = Watch(arm, step), np.zeros(arm.n)
    watch.couple(arm)
    watch.impact_dq[joint] = 1.5 * abs(change)
    q = arm.q_ready.copy()
    for k in range(200):
        dq[joint] = change if k >= 60 else 0.0
        q = q + TICK * dq
        assert watch.count(q, np.zeros(arm.n)) <= BRIDGED


@given(joint=joints, speed=st.floats(0.3, 2.0), step=st.sampled_from(STEPS[:2]))
def test_brakes_that_hold_a_joint_are_no_stuck_encoder(
    arm: Arm, joint: int, speed: float, step: float
) -> None:
    """They bring it to rest within some ticks, without a torque of the drives."""
    watch, dq, q = Watch(arm, step), np.zeros(arm.n), arm.q_ready.copy()
    watch.couple(arm)
    for k in range(200):
        dq[joint] = speed * min(max(1.0 - (k - 60) / 20.0, 0.0), 1.0)
        q = q + TICK * dq
        read = step * np.round(q / step)
        assert watch.read(read, np.zeros(arm.n), dq, held=k >= 60) <= BRIDGED


@pytest.mark.parametrize("late", range(4))
@pytest.mark.parametrize("step", [1e-6, 1e-5])
def test_a_joint_whose_torque_acts_late_is_not_a_stuck_encoder(
    arm: Arm, late: int, step: float
) -> None:
    """It has rested for long, and stays so for some ticks after the torque was commanded."""
    watch, push, dq, q = Watch(arm, step), np.zeros(arm.n), np.zeros(arm.n), arm.q_ready.copy()
    for k in range(120):
        push[2] = 8.0 * DOUBT if k >= 60 else 0.0
        dq[2] += TICK * push[2] if k >= 60 + late else 0.0
        q = q + TICK * dq
        assert watch.count(q, push) <= BRIDGED


@given(joint=joints, side=st.sampled_from((-1.0, 1.0)))
def test_an_end_stop_is_not_a_stuck_encoder(arm: Arm, joint: int, side: float) -> None:
    """Driven into the end of its range with much more, it is believed too."""
    watch, push, q = Watch(arm), np.zeros(arm.n), arm.q_ready.copy()
    push[joint], q[joint] = 10.0 * side * DOUBT, (arm.q_max if side > 0.0 else arm.q_min)[joint]
    for _ in range(100):
        assert watch.count(q, push) == FINE


@pytest.mark.parametrize("bad", [4.0, -9.0, 1e18])
def test_a_first_reading_has_to_be_one_of_this_joint(arm: Arm, bad: float) -> None:
    """Far outside its range a first reading is refused, and the third one is a fault."""
    watch, q = Watch(arm), arm.q_ready.copy()
    q[1] += bad
    said = [watch.read(q, np.zeros(arm.n)) for _ in range(3)]
    assert said == [BRIDGED, BRIDGED, SILENT]
    assert watch.estimated[0, 1] == 0.0


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_first_reading_may_be_lost(arm: Arm, bad: float) -> None:
    """Three and more lost readings at the start cost nothing, as with 30 % lost; fifteen do."""
    for lost in (3, LOSSY_TICKS - 1, LOSSY_TICKS):
        watch, q = Watch(arm), arm.q_ready.copy()
        q[1] = bad
        said = [watch.read(q, np.zeros(arm.n)) for _ in range(lost)][-1]
        assert said == (SILENT if lost == LOSSY_TICKS else BRIDGED)
        if lost < LOSSY_TICKS:
            assert watch.read(arm.q_ready, np.zeros(arm.n)) == FINE
            assert watch.estimated[0, 1] == arm.q_ready[1]


@pytest.mark.parametrize("step", [1e-7, 1e-6, 1e-5])
@pytest.mark.parametrize("ddq_unknown", [15.0, 400.0, 4000.0])
def test_a_wrong_velocity_dies_out_however_fine_the_encoder(
    arm: Arm, step: float, ddq_unknown: float
) -> None:
    """A joint that is struck within a tick: the estimate is off for some ticks, not for ever.

    With noise that is constant within a tick the velocity of a light arm with fine encoders swung
    about the truth without end, the controller with it, until the joint seemed too fast.
    """
    watch, speed, found = Watch(arm, step), 0.5, []
    watch.joints["ddq_unknown"] = watch.joints["ddq_own"] = ddq_unknown
    for k in range(60):
        way = speed * TICK * max(k - 29.75, 0.0)
        assert watch.read(arm.q_ready + way, np.zeros(arm.n)) == FINE
        found.append(watch.estimated[1].copy())
    assert np.all(np.abs(np.array(found[50:]) - speed) < 0.02)


@given(seed=seeds, joint=joints, bad=st.sampled_from([np.nan, np.inf, 9.0, -40.0, 1e300]))
def test_a_single_glitch_is_bridged(arm: Arm, seed: int, joint: int, bad: float) -> None:
    """One absurd reading leaves what is believed within a tenth of a milliradian of the truth."""
    q, dq, ddq = motion(arm, seed, 60)
    watch = Watch(arm)
    for k in range(1, 60):
        read = q[k].copy()
        if k == 30:
            read[joint] = bad
        said = watch.read(read, ddq[k - 1], dq[k])
        assert said == (BRIDGED if k == 30 else FINE)
        assert k < 10 or np.abs(watch.estimated[0] - q[k]).max() < 1e-4


@pytest.mark.parametrize("lossy", [True, False])
@pytest.mark.parametrize("bad", [np.nan, np.inf])
@pytest.mark.parametrize("joint", [0, 1, 2])
def test_silence_is_bridged_for_a_stated_time(
    arm: Arm, joint: int, bad: float, lossy: bool
) -> None:
    """The sixth missing reading in a row is a fault in motion, the fifteenth after other gaps."""
    watch, dq = Watch(arm), np.zeros(arm.n)
    dq[joint], allowed = 0.5, LOSSY_TICKS if lossy else SILENT_TICKS
    for k in range(200):
        read = arm.q_ready + TICK * k * dq
        if k >= 150 or (lossy and k == 145):
            read[joint] = bad
        said = watch.read(read, 0.0 * dq, dq)
        if k >= 150:
            assert said == (BRIDGED if k < 149 + allowed else SILENT)


@given(seed=seeds, joint=joints, jump=st.floats(0.05, 2.0), side=st.sampled_from((-1.0, 1.0)))
def test_a_jump_is_found_at_its_third_reading(
    arm: Arm, seed: int, joint: int, jump: float, side: float
) -> None:
    """Readings beside the motion are never believed, and the third is a fault."""
    q, dq, ddq = motion(arm, seed, 60)
    watch = Watch(arm)
    for k in range(1, 60):
        read = q[k].copy()
        if k >= 50:
            read[joint] += side * jump
        said = watch.read(read, ddq[k - 1], dq[k])
        assert said == (FINE if k < 50 else (BRIDGED if k < 52 else JUMPED))
        assert k < 10 or abs(watch.estimated[0, joint] - q[k, joint]) < 1e-3


@given(joint=joints, speed=st.floats(0.4, 1.0), side=st.sampled_from((-1.0, 1.0)))
def test_no_unknown_force_stops_a_joint_at_once(
    arm: Arm, joint: int, speed: float, side: float
) -> None:
    """An encoder that freezes while its joint coasts is found in five ticks.

    The joint is then taken to go on nearly as fast as it did.
    """
    watch, q, dq = Watch(arm), arm.q_ready.copy(), np.zeros(arm.n)
    dq[joint] = side * speed
    for k in range(20):
        assert watch.count(q + TICK * k * dq, 0.0 * q, dq) == FINE
    stuck = q + TICK * 19 * dq
    said = [watch.count(stuck, 0.0 * q) for _ in range(WITHIN)]
    assert STUCK in said
    least = speed - DOUBT * TICK * WITHIN - 0.1
    assert side * watch.estimated[1, joint] >= least


def test_a_sign_that_turns_in_motion_is_found_at_its_third_reading(arm: Arm) -> None:
    """Near zero a reversed encoder shows by its velocity alone: the mirror image of itself."""
    watch, dq = Watch(arm), np.array([0.8, 0.0, 0.0])
    q, said = -0.05 * dq, []
    for k in range(100):
        q = q + TICK * dq
        read = q * (np.array([-1.0, 1.0, 1.0]) if k >= 50 else 1.0)
        said.append(watch.read(read, 0.0 * q, dq))
    assert said[49] == FINE
    assert said[52] == REVERSED
    assert abs(watch.estimated[0, 0] - q[0]) < 1e-3
    assert watch.estimated[1, 0] == pytest.approx(0.8, abs=0.05)


@pytest.mark.parametrize("step", STEPS)
def test_a_reading_that_gains_speed_against_the_torques_has_the_wrong_sign(
    arm: Arm, step: float
) -> None:
    """From rest at zero, it is found by then, and the joint is reckoned from before it began."""
    watch, push, q, dq = Watch(arm, step), np.array([60.0, 0.0, 0.0]), np.zeros(3), np.zeros(3)
    said = [watch.count(q, 0.0 * q) for _ in range(30)]
    for _ in range(40):
        dq = dq + TICK * push
        q = q + TICK * dq
        said.append(watch.count(q * np.array([-1.0, 1.0, 1.0]), push))
    assert said[-1] == REVERSED
    assert said.index(REVERSED) < 30 + 25
    assert watch.estimated[1, 0] == pytest.approx(dq[0], abs=0.6)


@pytest.mark.thorough
@settings(max_examples=300)
@given(seed=seeds, joint=joints)
def test_a_passive_contact_is_not_a_wrong_sign(arm: Arm, seed: int, joint: int) -> None:
    """A joint pushed into an elastic wall rebounds against its torques; that is believed."""
    watch, rng = Watch(arm), np.random.default_rng(seed)
    push, q, dq = np.zeros(arm.n), arm.q_ready.copy(), np.zeros(arm.n)
    wall, stiff = q[joint] + 0.05, rng.uniform(2e3, 5e4)
    push[joint] = rng.uniform(20.0, 60.0)
    for _ in range(400):
        force = -stiff * max(q[joint] - wall, 0.0) - 5.0 * dq[joint]
        dq[joint] += TICK * (push[joint] + force)
        q[joint] += TICK * dq[joint]
        watch.count(q, push, dq)
        assert watch.monitor.joints["fault"][joint] not in (REVERSED, JUMPED)


@given(seed=seeds, joint=joints, impact_dq=st.floats(0.1, 2.0))
def test_a_blow_against_the_torques_is_not_a_wrong_sign(
    arm: Arm, seed: int, joint: int, impact_dq: float
) -> None:
    """Struck while it is pushed the other way, a joint slows down again; that is believed."""
    watch, rng = Watch(arm), np.random.default_rng(seed)
    push, q, dq = np.zeros(arm.n), arm.q_ready.copy(), np.zeros(arm.n)
    for k in range(120):
        push[joint] = 60.0 if k >= 60 else 0.0
        if k in range(60, 60 + rng.integers(1, 4)):
            dq[joint] -= 0.5 * impact_dq
        dq[joint] = min(dq[joint] + TICK * 0.85 * push[joint], 0.3)
        q = q + TICK * dq
        watch.count(q, push, dq)
        assert watch.monitor.joints["fault"][joint] == FINE


def test_a_joint_much_beyond_its_speed_is_a_fault(arm: Arm) -> None:
    """At twice its limit the readings, though they agree with one another, stop the arm."""
    watch, q = Watch(arm), arm.q_min.copy()
    dq, said = 2.0 * watch.monitor.bounds["dq_max"], []
    for k in range(60):
        push = dq / 0.05 if k < 50 else 0.0 * dq
        said.append(watch.read(q, push))
        q = q + TICK * dq * min(k / 50.0, 1.0)
    assert FAST in said


@pytest.mark.parametrize("kind", ["silent", "jumped", "stuck"])
def test_nothing_that_an_encoder_in_doubt_reads_reaches_the_estimate(arm: Arm, kind: str) -> None:
    """The joint goes on by the model, the same to the bit whatever is read; brakes end that."""
    q, dq, ddq = motion(arm, 5, 300)
    watches = Watch(arm), Watch(arm)
    for k in range(1, 300):
        for watch, lie in zip(watches, (0.3, -0.2), strict=True):
            read = q[k].copy()
            bad = {"silent": np.nan, "jumped": q[k, 1] + 1.0, "stuck": q[99, 1]}[kind]
            read[1] = read[1] if k < 100 else (bad if k < 150 else q[k, 1] + lie)
            watch.read(read, ddq[k - 1], dq[k], held=k >= 250)
    one, other = (watch.estimated for watch in watches)
    assert np.array_equal(one[:, 1], other[:, 1])
    assert one[1, 1] == 0.0
    assert np.allclose(one[0, [0, 2]], q[-1, [0, 2]], atol=1e-4)


@given(seed=seeds)
def test_an_encoder_is_good_again_after_readings_that_fit(arm: Arm, seed: int) -> None:
    """So many in a row where the joint is reckoned; elsewhere, or with a gap between, it is not."""
    rng, watch, q = np.random.default_rng(seed), Watch(arm), arm.q_ready.copy()
    still = np.zeros(arm.n)
    for k in range(100):
        watch.read(np.where(np.array([0, 1, 0]) * (k >= 50) > 0, np.nan, q), still)
    assert not encoders.recovered(watch.monitor.joints)[1]
    off = np.array([0.0, rng.choice([0.0, 0.05, 0.3]), 0.0])
    for _ in range(GOOD_TICKS + 1):
        assert not encoders.recovered(watch.monitor.joints)[1]
        watch.read(q + off, still, held=True)
    assert encoders.recovered(watch.monitor.joints)[1] == (off[1] < 0.1)
    watch.read(np.full(3, np.nan), still, held=True)
    assert not encoders.recovered(watch.monitor.joints)[1]


def test_what_is_known_of_the_encoders_is_one_number_or_one_a_joint(arm: Arm) -> None:
    """Left out, it is the arm's own; another count of numbers is refused."""
    own = arm.encoder_step
    assert np.array_equal(Encoders().steps(own), own)
    assert np.array_equal(Encoders(step=1e-4).steps(own), [1e-4] * 3)
    assert np.array_equal(Encoders(step=(1e-4, 2e-4, 3e-4)).steps(own)[1:], [2e-4, 3e-4])
    for bad in ((1e-4, 1e-4), 0.0, np.nan):
        with pytest.raises(InputError, match=r"encoder step|Encoders\.step"):
            Encoders(step=bad).steps(own)
    with pytest.raises(InputError, match=r"Encoders\.unknown"):
        Encoders(unknown=-1.0).of(arm)
