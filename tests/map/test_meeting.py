"""Laws of the meeting map: at the end the tool moves as the target, whatever both do before."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from mitt.core.arm.arm import Arm
from mitt.core.arm.tools import Suction
from mitt.core.errors import ModelError
from mitt.core.map.meeting import MeetingMap, interpolate_motion, unlearned_meeting
from mitt.core.map.reach import reach_of
from mitt.core.signals import Array
from mitt.io.arm_file import load_arm
from mitt.io.wam import wrist_wam

#: A pose of each arm from which targets are within reach, and its joints that reach for them.
POSES = {
    "wam": (np.array([0.2, 0.5, 1.5]), (0, 1, 2)),
    "ur5e": (np.array([0.2, -1.3, 1.8, -2.1, -1.5, 0.3]), (0, 1, 2, 3, 4, 5)),
}
seeds = st.integers(0, 2**31)
arms = st.sampled_from(sorted(POSES))


@cache
def arm_of(name: str) -> Arm:
    """Return an arm that waits in its pose."""
    arm = load_arm(name) if name == "wam" else load_arm(name, hand="none", joints=None)
    return Arm(replace(arm.model, q_ready=POSES[name][0]), arm.limits)


def drawn(name: str, seed: int) -> tuple[MeetingMap, Array, np.random.Generator]:
    """Return a map with random coefficients, a target in reach, and a source of more."""
    rng, arm = np.random.default_rng(seed), arm_of(name)
    f = unlearned_meeting(arm, POSES[name][1], across=1)
    f = replace(f, alpha=0.3 * rng.standard_normal(f.alpha.shape))
    r = arm.position(arm.q_ready) + 0.05 * rng.standard_normal(3)
    return f, np.array([r, rng.uniform(-1.5, 1.5, 3), rng.uniform(-3.0, 3.0, 3)]), rng


@given(name=arms, seed=seeds, T=st.floats(0.3, 2.0))
def test_at_the_end_position_velocity_and_acceleration_match(
    name: str, seed: int, T: float
) -> None:
    """Whatever the target does and whatever alpha is; and afterwards, for as long as it goes on."""
    f, target, rng = drawn(name, seed)
    for s in (0.0, -rng.uniform(0.0, 1.0)):
        rows = f.motion(target, s, T)
        assert rows is not None
        q, dq, ddq = rows[:3]
        assert np.allclose(f.arm.position(q), target[0], atol=1e-9)
        assert np.allclose(f.arm.jacobian(q) @ dq, target[1], atol=1e-8)
        h = 1e-5
        ahead, behind = (
            f.arm.jacobian(q + x * h * dq + 0.5 * h * h * ddq) @ (dq + x * h * ddq)
            for x in (1.0, -1.0)
        )
        assert np.allclose((ahead - behind) / (2.0 * h), target[2], atol=1e-6 * (1 + dq @ dq))


@given(name=arms, seed=seeds, T=st.floats(0.3, 2.0))
def test_the_motion_starts_where_the_arm_is(name: str, seed: int, T: float) -> None:
    """In position, velocity and acceleration, by the projection of eq. (12)."""
    f, target, rng = drawn(name, seed)
    n = f.arm.n
    state = np.array([f.arm.q_ready + 0.2 * rng.standard_normal(n), *rng.standard_normal((2, n))])
    adapted = f.adapt(target, state, T)
    assert adapted is not None
    rows = adapted.motion(target, 1.0, T)
    assert rows is not None
    assert np.allclose(rows[:3], state, atol=1e-6 * (1.0 + np.abs(state).max()))


@given(name=arms, seed=seeds)
@settings(max_examples=20)
def test_the_rates_are_those_of_the_motion(name: str, seed: int) -> None:
    """By differences along the target's motion, on the way."""
    f, target, _ = drawn(name, seed)
    T, h = 0.8, 1e-5

    def rows(t: float) -> Array:
        r = target[0] + t * target[1] + 0.5 * t * t * target[2]
        moved = f.motion(np.array([r, target[1] + t * target[2], target[2]]), 0.6 - t / T, T)
        assert moved is not None
        return moved

    before, now, after = rows(-h), rows(0.0), rows(h)
    for k in (0, 1, 3, 4):
        slope = (after[k] - before[k]) / (2.0 * h)
        assert np.allclose(slope, now[k + 1], atol=1e-5 * (1.0 + np.abs(now[k + 1]).max()))


@given(seed=seeds)
@settings(max_examples=20)
def test_six_joints_hold_the_tool_as_it_was_asked(seed: int) -> None:
    """All of its axes, wherever the target is."""
    f, target, _ = drawn("ur5e", seed)
    inside, virtual = f.virtual(target)
    assert inside
    assert np.allclose(f.arm.orientation(virtual[0]), f.frame, atol=1e-9)


@given(seed=seeds)
@settings(max_examples=20)
def test_a_wrist_that_follows_two_joints_keeps_the_direction_of_the_tool(seed: int) -> None:
    """Three joints of the WAM reach the target; joint 6 turns back what 2 and 4 turn."""
    rng, arm = np.random.default_rng(seed), wrist_wam(Suction())
    q = np.array([0.1, 0.5, 2.0, np.pi - 2.5])
    arm = Arm(replace(arm.model, q_ready=q), arm.limits)
    f = unlearned_meeting(arm, (0, 1, 2), coupling=np.array([[0.0, -1.0, -1.0]]))
    f = replace(f, alpha=0.3 * rng.standard_normal(f.alpha.shape))
    r = arm.position(q) + 0.1 * rng.standard_normal(3)
    target = np.array([r, rng.uniform(-1.0, 1.0, 3), rng.uniform(-3.0, 3.0, 3)])
    rows = f.motion(target, 0.0, 1.0)
    assert rows is not None
    assert np.allclose(arm.position(rows[0]), r, atol=1e-9)
    assert np.allclose(arm.jacobian(rows[0]) @ rows[1], target[1], atol=1e-8)
    assert np.allclose(arm.orientation(rows[0])[:, 2], [0.0, 0.0, -1.0], atol=1e-9)


@given(name=arms, seed=seeds)
@settings(max_examples=10)
def test_a_motion_is_the_same_at_once_and_instant_by_instant(name: str, seed: int) -> None:
    """Where the inverse goes on from the instant before, and where it starts anew."""
    f, target, _ = drawn(name, seed)
    t = np.linspace(0.0, 0.04, 5)
    path = target + np.array([[[x], [0.0], [0.0]] for x in t]) * target[1]
    s = 1.0 - t
    rows = f.motion_along(path, s, 1.0)
    assume(rows is not None)
    assert rows is not None
    for k in range(5):
        alone = f.motion(path[k], float(s[k]), 1.0)
        assert alone is not None
        assert np.allclose(rows[k], alone, atol=1e-6)


def test_a_target_out_of_reach_has_no_motion() -> None:
    """Nor one so fast that numbers overflow."""
    f, target, _ = drawn("ur5e", 0)
    far = target + np.outer([1.0, 0.0, 0.0], [3.0, 0.0, 0.0])
    assert f.motion(far, 0.5, 1.0) is None
    assert f.adapt(far, np.zeros((3, 6)), 1.0) is None
    assert f.motion(target * [[1.0], [1e9], [1.0]], 0.5, 1.0) is None


def test_joints_that_cannot_reach_are_refused() -> None:
    """Four rows, or joints that are none."""
    arm = arm_of("ur5e")
    for free in ((0, 1, 2, 3), (0, 0, 1), (0, 1, 9)):
        with pytest.raises(ModelError):
            reach_of(arm, free)


@settings(max_examples=25)
@given(seed=st.integers(0, 2**31), T=st.floats(0.05, 3.0), count=st.integers(2, 400))
def test_between_its_instants_a_motion_is_a_polynomial_of_fifth_order(
    seed: int, T: float, count: int
) -> None:
    """One that is such a polynomial comes out as it is, with its rates, however often asked."""
    rng = np.random.default_rng(seed)
    coefficients = rng.standard_normal((6, 4))

    def motion(instants: int) -> Array:
        x, rows = np.linspace(0.0, 1.0, instants), []
        for d in range(3):
            of = np.polynomial.polynomial.polyder(coefficients, d)
            rows.append(np.polynomial.polynomial.polyval(x, of).T / T**d)
        return np.stack(rows, axis=1)

    found, exact = interpolate_motion(motion(24), T, count), motion(count)
    for d in range(3):
        assert np.allclose(found[:, d], exact[:, d], atol=1e-9 * (1.0 + np.abs(exact[:, d]).max()))
