"""Laws of the encoders' monitor: silent on what an arm can do, quick on what it cannot."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.control import monitor
from mitt.control.envelope import TICK, bounds_of
from mitt.control.monitor import BRIDGED, FINE, JUMPED, REVERSED, SILENT, STUCK, Encoders
from mitt.errors import InputError
from mitt.robot.arm import Arm
from mitt.signals import Array

COUNT = 2.0 * np.pi / (4096.0 * 42.0)
#: A fault is found so many ticks after it shows itself.
WITHIN = 5
FAULTS = (SILENT, JUMPED, STUCK, REVERSED)
#: Share by which the true acceleration may differ from the model's.
WRONG_MODEL = 0.15
#: Bandwidth of the tracking [rad/s].
BANDWIDTH = 80.0

seeds = st.integers(0, 2**31)


def motion(arm: Arm, seed: int, ticks: int) -> tuple[Array, Array, Array]:
    """Return a smooth motion within the limits: q, dq, ddq, each shape (ticks, n)."""
    rng, b = np.random.default_rng(seed), bounds_of(arm)
    w = rng.uniform(3.0, 12.0, arm.n)
    size = 0.7 * np.minimum(b[2] / w, b[4] / w**2) * rng.uniform(0.1, 1.0, arm.n)
    size = np.minimum(size, 0.6)
    t = TICK * np.arange(ticks)[:, None]
    phase = rng.uniform(0.0, 2.0 * np.pi, arm.n)
    q = arm.q_ready + size * np.sin(w * t + phase)
    return q, size * w * np.cos(w * t + phase), -size * w**2 * np.sin(w * t + phase)


def quantised(q: Array) -> Array:
    """Return what an encoder of finite resolution reads."""
    return COUNT * np.round(q / COUNT)


def telling(dq: Array, push: Array) -> Array:
    """Return what a tick told the arm, as far as the monitor reads it, shape (5, n)."""
    return np.array([0.0 * dq, dq, 0.0 * dq, 0.0 * dq, push])


class Watch:
    """A monitor that is fed a motion, tick by tick."""

    def __init__(self, arm: Arm) -> None:
        """Start with nothing read."""
        self.b = bounds_of(arm)
        self.memory, self.believed = monitor.memory_of(arm.n), np.zeros((2, arm.n))

    def step(self, read: Array, told: Array) -> int:
        """Feed one tick."""
        m = self.memory
        return int(monitor.believe(m, self.b, np.full(3, COUNT), read, told, self.believed))


@given(seed=seeds)
def test_a_true_motion_raises_no_alarm(arm: Arm, seed: int) -> None:
    """Quantised readings of a motion, told with a model 15 % wrong, are believed as they are."""
    q, dq, ddq = motion(arm, seed, 600)
    rng, watch = np.random.default_rng(seed), Watch(arm)
    wrong = 1.0 + rng.uniform(-WRONG_MODEL, WRONG_MODEL, arm.n)
    for k in range(1, 600):
        read = np.array([quantised(q[k]), dq[k]])
        assert watch.step(read, telling(dq[k - 1], wrong * ddq[k - 1])) == FINE
        assert np.array_equal(watch.believed, read)


@given(joint=st.integers(0, 2), speed=st.floats(0.1, 1.0), onward=st.sampled_from((-1.0, 1.0)))
def test_no_friction_stops_a_joint_at_once(
    arm: Arm, joint: int, speed: float, onward: float
) -> None:
    """An encoder that freezes while its joint coasts at 0.1 rad/s is found in five ticks."""
    watch, q, dq = Watch(arm), arm.q_ready.copy(), np.zeros(arm.n)
    dq[joint] = onward * speed
    for k in range(20):
        read = np.array([quantised(q + TICK * k * dq), dq])
        assert watch.step(read, telling(dq, 0.0 * dq)) == FINE
    said = [watch.step(read, telling(0.0 * dq, 0.0 * dq)) for _ in range(WITHIN)]
    assert STUCK in said


@given(joint=st.integers(0, 2), speed=st.floats(-0.3, 0.3))
def test_a_joint_that_friction_holds_is_not_a_stuck_encoder(
    arm: Arm, joint: int, speed: float
) -> None:
    """Told to creep, driven by less than a tenth of its torque, a still joint is believed."""
    watch = Watch(arm)
    told = telling(np.zeros(arm.n), np.zeros(arm.n))
    told[1, joint], told[4, joint] = speed, 0.09 * watch.b[3, joint]
    for _ in range(200):
        assert watch.step(np.array([arm.q_ready, 0.0 * arm.q_ready]), told) == FINE


@pytest.mark.parametrize("bad", [4.0, -9.0, 1e18])
def test_a_first_reading_has_to_be_one_of_this_joint(arm: Arm, bad: float) -> None:
    """Far outside its range a first reading is refused, and the third one is a fault."""
    watch, q = Watch(arm), arm.q_ready.copy()
    q[1] += bad
    still = telling(np.zeros(arm.n), np.zeros(arm.n))
    said = [watch.step(np.array([q, 0.0 * q]), still) for _ in range(3)]
    assert said == [BRIDGED, BRIDGED, SILENT]
    assert watch.believed[0, 1] == 0.0


@given(seed=seeds, joint=st.integers(0, 2), bad=st.sampled_from([np.nan, np.inf, 9.0, -40.0]))
def test_a_single_glitch_is_bridged(arm: Arm, seed: int, joint: int, bad: float) -> None:
    """One absurd reading leaves what is believed within a tick's motion of the truth."""
    q, dq, ddq = motion(arm, seed, 60)
    watch = Watch(arm)
    for k in range(1, 60):
        read = np.array([q[k], dq[k]])
        if k == 30:
            read[0, joint] = bad
        said = watch.step(read, telling(dq[k - 1], ddq[k - 1]))
        assert said == (BRIDGED if k == 30 else FINE)
        assert np.abs(watch.believed[0] - q[k]).max() < 1e-3


def broken(kind: str, then: Array, now: Array) -> tuple[float, float]:
    """Return q, dq as an encoder reads that broke at ``then``."""
    readings = {
        "silent": (np.nan, np.nan),
        "jumped": (now[0] + 1.0, now[1]),
        "stuck": (then[0], 0.0),
        "reversed": (-now[0], -now[1]),
    }
    return readings[kind]


@pytest.mark.parametrize("kind", ["silent", "jumped", "stuck", "reversed"])
@given(seed=seeds, joint=st.integers(0, 2))
def test_a_fault_is_found_within_five_ticks(arm: Arm, kind: str, seed: int, joint: int) -> None:
    """Counted from when it shows: stuck, by five counts that friction could not have prevented.

    The controller pushes against what it believes is a lag. A reversed one shows by a jump or by
    gained speed.
    """
    q, dq, ddq = motion(arm, seed, 500)
    watch, start, shown, moved, gained = Watch(arm), 200, None, 0.0, 0.0
    least = dq[start, joint]
    for k in range(1, 500):
        lag = np.array([q[k - 1], dq[k - 1]]) - watch.believed if k > 1 else np.zeros((2, arm.n))
        push = ddq[k - 1] + BANDWIDTH**2 * lag[0] + 2.0 * BANDWIDTH * lag[1]
        read, told = np.array([q[k], dq[k]]), telling(dq[k - 1], push)
        gained += told[4, joint] * TICK - 0.2 * gained
        if k >= start:
            at = np.array([q[k, joint], dq[k, joint]])
            read[:, joint] = broken(kind, np.array([q[start, joint], dq[start, joint]]), at)
            if k > start:
                least += told[4, joint] * TICK
                least -= np.sign(least) * min(abs(least), 0.1 * watch.b[3, joint] * TICK)
                moved += least * TICK
            jump = abs(2.0 * at[0]) > 1.6 * watch.b[2, joint] * TICK
            shows = {
                "stuck": abs(moved) > 5.0 * COUNT,
                "reversed": jump or abs(gained) > 0.4,
            }
            if shown is None and shows.get(kind, True):
                shown = k
        said = watch.step(read, told)
        assert (said < SILENT) or k >= start
        if said >= SILENT:
            assert said in {"silent": (SILENT,), "jumped": (JUMPED,)}.get(kind, FAULTS)
            return
        assert shown is None or k - shown < WITHIN


def test_after_a_fault_the_joint_is_reckoned(arm: Arm) -> None:
    """A silent encoder's joint goes on along the told motion, the others are read."""
    q, dq, ddq = motion(arm, 5, 300)
    watch = Watch(arm)
    for k in range(1, 300):
        read = np.array([q[k], dq[k]])
        if k >= 100:
            read[:, 1] = np.nan
        watch.step(read, telling(dq[k - 1], ddq[k - 1]))
    assert np.array_equal(watch.believed[0, [0, 2]], q[-1, [0, 2]])
    assert abs(watch.believed[0, 1] - q[-1, 1]) < 0.01


def stuck_watch(arm: Arm, q: Array, dq: Array, ddq: Array) -> Watch:
    """Return a monitor that has found joint 1's encoder stuck at tick 100 of a motion."""
    watch, said = Watch(arm), FINE
    for k in range(1, 200):
        read = np.array([q[k], dq[k]])
        if k >= 100:
            read[:, 1] = q[100, 1], 0.0
        said = max(said, watch.step(read, telling(dq[k - 1], ddq[k - 1])))
    assert said == STUCK
    return watch


@pytest.mark.parametrize("lost", [0.0, 0.3])
def test_the_motion_of_a_stuck_encoder_that_moves_on_counts(arm: Arm, lost: float) -> None:
    """From the third tick of motion one way on its steps and speed are taken, wherever it reads."""
    q, dq, ddq = motion(arm, 5, 300)
    watch = stuck_watch(arm, q, dq, ddq)
    for k in range(200, 230):
        before = watch.believed[0, 1]
        read = np.array([q[k], dq[k]])
        read[0, 1] += lost
        watch.step(read, telling(0.0 * dq[k], 0.0 * dq[k]))
        if k > 203:
            assert watch.believed[0, 1] - before == pytest.approx(q[k, 1] - q[k - 1, 1], abs=1e-12)
            assert watch.believed[1, 1] == dq[k, 1]


def test_a_stuck_encoder_that_flickers_stays_reckoned(arm: Arm) -> None:
    """Counts up and down are no motion: the joint goes on along what it was told."""
    q, dq, ddq = motion(arm, 5, 300)
    watch = stuck_watch(arm, q, dq, ddq)
    before = watch.believed[0, 1]
    for k in range(200, 260):
        read, told = np.array([q[k], dq[k]]), telling(dq[k - 1], 0.0 * dq[k])
        read[:, 1] = q[100, 1] + COUNT * (k % 2), (k % 2 - 0.5) * 2.0 * COUNT / TICK
        watch.step(read, told)
        before += TICK * dq[k - 1, 1]
    assert watch.believed[0, 1] == pytest.approx(before, abs=1e-12)


def test_a_reversed_encoder_is_read_with_its_sign_turned(arm: Arm) -> None:
    """From the fault on, q and dq are those of the joint again; absurd readings are not taken."""
    watch, push, said = Watch(arm), np.array([80.0, 0.0, 0.0]), FINE
    for k in range(1, 40):
        q, dq = arm.q_ready + 0.5 * push * (k * TICK) ** 2, push * k * TICK
        read = np.array([q, dq])
        read[:, 0] *= -1.0
        said = max(said, watch.step(read, telling(dq, push)))
        if said == REVERSED:
            assert np.array_equal(watch.believed[:, 0], [q[0], dq[0]])
    assert said == REVERSED
    for bad in (np.nan, np.inf, 1e300, -1e9):
        read[:, 0] = bad
        watch.step(read, telling(dq, push))
        assert np.all(np.abs(watch.believed) < 30.0)


def test_what_is_known_of_the_encoders_is_one_number_or_one_a_joint(arm: Arm) -> None:
    """Left out, it is the arm's own; another count of numbers is refused."""
    assert np.array_equal(Encoders().steps(arm.encoder_step), arm.encoder_step)
    assert np.array_equal(Encoders(step=1e-4).steps(arm.encoder_step), [1e-4] * 3)
    assert np.array_equal(
        Encoders(step=(1e-4, 2e-4, 3e-4)).steps(arm.encoder_step)[1:], [2e-4, 3e-4]
    )
    for bad in ((1e-4, 1e-4), 0.0, np.nan):
        with pytest.raises(InputError, match="encoder step"):
            Encoders(step=bad).steps(arm.encoder_step)
