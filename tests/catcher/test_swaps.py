"""What the safety filter certified in a tick holds in the next, whatever has changed by then."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import thorough

from mitt.core.arm.arm import Arm
from mitt.core.arm.description import STOP_GAP, Capsule
from mitt.core.arm.shapes import MARGIN, Surroundings, clearance
from mitt.core.catcher.settings import CatcherSettings
from mitt.core.catcher.state import CatcherState, exchange_arm, fresh_state
from mitt.core.control.envelope import bounds_of, speeds_of
from mitt.core.control.stop import EASIEST, SHARE, choose_stop
from mitt.core.control.viability import safety_filter
from mitt.core.eyes.eyes import closed_eyes
from mitt.core.signals import TICK, Array

#: A pillar that the arm runs into when it turns from its ready pose, and a floor near below.
AROUND = Surroundings(
    floor=-0.6, zones=(Capsule(start=(0.5, 0.75, -0.5), end=(0.5, 0.75, 1.2), radius=0.1),)
)
#: Excess that is rounding [m, rad], and what torques between the instants that are looked at take.
ROUNDING = 1e-6
BETWEEN = 1.05
TICKS = 400


def begun(arm: Arm, mass: float) -> CatcherState:
    """Return the state of a catcher of balls of a mass [kg] at its start."""
    return fresh_state(arm, closed_eyes(), CatcherSettings(ball_mass=mass, around=AROUND), None)


def gap(state: CatcherState, q: Array) -> float:
    """Return the clearance of a pose [m]."""
    s = state.safety
    return float(clearance(s.arm.bodies, q, s.shapes, s.pairs, s.ends))


def wished(state: CatcherState, speed: Array) -> Array:
    """Return a motion on from the last command at some speeds, shape (3, n)."""
    return np.array([state.last[0] + TICK * speed, speed, np.zeros(len(speed))])


@pytest.mark.parametrize("mass", thorough([0.07, 0.5], [0.034, 0.2]))
@pytest.mark.parametrize("swapped", ["load", "caps", "both"])
@settings(max_examples=12)
@given(seed=st.integers(0, 2**31))
def test_a_command_stays_in_range_and_clear_and_can_stop_whatever_changes(
    arm: Arm, mass: float, swapped: str, seed: int
) -> None:
    """Ball taken up or let go, speeds capped or freed, at any tick of any motion."""
    rng, state, fastest = np.random.default_rng(seed), begun(arm, mass), speeds_of(arm)
    arms, speed = (arm, arm.holding(mass)), np.zeros(arm.n)
    low, high = arm.q_min + STOP_GAP - ROUNDING, arm.q_max - STOP_GAP + ROUNDING
    s = state.safety
    for tick in range(TICKS):
        if tick % 60 == 0:
            speed = fastest * rng.choice([-1.0, 1.0, 0.3, 0.0], arm.n)
        if swapped != "caps" and rng.random() < 0.3:
            exchange_arm(state, arms[rng.integers(2)])
        if swapped != "load" and rng.random() < 0.05:
            s.bounds["dq_max"] = fastest * rng.choice([0.4, 0.7, 1.0], arm.n)
        safety_filter(s, state.last, wished(state, speed), state.last[:2].copy())
        assert np.all((state.last[0] >= low) & (state.last[0] <= high))
        assert gap(state, state.last[0]) >= MARGIN - ROUNDING
        ends = state.last[0] + 0.5 * state.last[1] * abs(state.last[1]) / s.bounds["deceleration"]
        assert np.all((ends >= low) & (ends <= high))
    for _ in range(TICKS):
        if swapped != "caps":
            exchange_arm(state, arms[rng.integers(2)])
        safety_filter(s, state.last, wished(state, np.zeros(arm.n)), state.last[:2].copy())
        assert gap(state, state.last[0]) >= MARGIN - ROUNDING
    assert np.all(state.last[1] == 0.0)


@pytest.mark.parametrize("mass", [0.07, 0.5])
def test_drives_can_stop_with_any_part_of_the_load(arm: Arm, mass: float) -> None:
    """The torque of a stop is linear in the load: what both ends allow, all between allow."""
    rng, state = np.random.default_rng(5), begun(arm, mass)
    s, looked = state.safety, 0
    for tick in range(TICKS):
        if tick % 60 == 0:
            speed = speeds_of(arm) * rng.choice([-1.0, 1.0, 0.3, 0.0], arm.n)
        safety_filter(s, state.last, wished(state, speed), state.last[:2].copy())
        share = choose_stop(s.arm, s.loaded, s.bounds, state.last, EASIEST, s.stop)
        if share > SHARE or tick % 10:
            continue
        q, dq, rates = state.last[0], state.last[1], s.stop.rates
        for part in (0.0, 0.3, 0.7, 1.0):
            held = arm.holding(part * mass)
            tau = held.torque(q, dq, -np.copysign(np.minimum(rates, abs(dq) / TICK), dq))
            ratio = held.limits.torque_ratio(tau, held.all_joints(dq)).max()
            assert ratio <= BETWEEN * SHARE
            looked += 1
    assert looked > 20


def test_nothing_that_a_stop_rests_on_changes_with_the_ball(arm: Arm) -> None:
    """Taking it up exchanges the model of the torques and no number of the safety filter."""
    state = begun(arm, 0.5)
    before = [np.copy(x) for x in (state.safety.bounds, state.safety.arm.bodies)]
    was = state.arm.bodies.copy()
    exchange_arm(state, arm.holding(0.5))
    after = state.safety.bounds, state.safety.arm.bodies
    assert all(np.array_equal(x, y) for x, y in zip(before, after, strict=True))
    assert not np.array_equal(was, state.arm.bodies)
    held = bounds_of(arm.holding(0.5))
    for name in ("deceleration", "jerk", "ddq_max"):
        assert np.all(state.safety.bounds[name] <= held[name])
    heavy = CatcherSettings(ball_mass=0.5)
    trusted = fresh_state(arm, closed_eyes(), heavy, None).safety.bounds["deceleration"]
    lighter = fresh_state(arm, closed_eyes(), CatcherSettings(), None).safety.bounds
    assert np.all(trusted <= lighter["deceleration"])
    assert trusted[-1] < lighter["deceleration"][-1]
