"""Inverse kinematics and the meeting with the ball, held to the arm's own kinematics."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.generator.prediction import fly_on, state_of
from mitt.rivals.intercept import APPROACH, Chooser, lift, meet, reach, resolve
from mitt.robot.arm import Arm
from mitt.robot.kinematics import ZERO
from mitt.signals import Array, BallState

seeds = st.integers(0, 2**31)
#: Residuals of positions [m] and of central differences.
EXACT, CLOSE = 1e-8, 1e-4


def _angles(seed: int) -> Array:
    """Return joint angles well within the reach, elbow bent forward."""
    rng = np.random.default_rng(seed)
    return np.array([rng.uniform(-1, 1), rng.uniform(0, 1.2), rng.uniform(0.7, 2.3)])


@given(seed=seeds)
def test_the_inverse_reaches_the_point(chooser: Chooser, seed: int) -> None:
    """From the nominal catch the iteration ends where the catch point is at the point asked."""
    f, q = chooser.map, chooser.map.start.copy()
    r = chooser.arm.position(_angles(seed))
    assert reach(f.packed, r, q, f.work) < EXACT
    assert np.allclose(chooser.arm.position(q), r, atol=EXACT)


def test_out_of_reach_the_inverse_stretches_towards_the_point(chooser: Chooser) -> None:
    """Beyond the reach the residual is the way that is missing, and the angles stay finite."""
    f, q = chooser.map, chooser.map.start.copy()
    left = reach(f.packed, np.array([3.0, 0.0, 0.0]), q, f.work)
    assert np.all(np.isfinite(q))
    assert left > 1.9


def test_damping_leaves_good_poses_alone_and_bounds_bad_ones() -> None:
    """Where J is well conditioned J' x = b holds exactly; where it is singular x stays small."""
    out = np.empty(3)
    good = np.array([[0.8, 0.1, 0.0], [0.0, 0.7, 0.2], [0.1, 0.0, 0.5]])
    resolve(good, (1.0, -2.0, 0.5), out)
    assert np.allclose(good.T @ out, [1.0, -2.0, 0.5], atol=1e-12)
    bad = np.array([[0.8, 0.0, 0.0], [0.0, 0.7, 0.0], [0.0, 0.3, 1e-9]])
    resolve(bad, (0.0, 0.0, 1.0), out)
    assert np.linalg.norm(out) < 1.0


@given(seed=seeds)
def test_a_moving_point_is_followed_in_all_derivatives(chooser: Chooser, seed: int) -> None:
    """Speeds and accelerations of the joints are central differences of their angles."""
    f, rng = chooser.map, np.random.default_rng(seed)
    q = _angles(seed)
    point = np.array([chooser.arm.position(q), rng.normal(size=3), rng.normal(size=3)])
    rows = np.array([q, np.zeros(3), np.zeros(3)])
    lift(f.packed, chooser.hand, ZERO, point, rows, f.work)
    h, near = 1e-3, []
    for s in (-h, h):
        at = q.copy()
        reach(f.packed, point[0] + s * point[1] + 0.5 * s * s * point[2], at, f.work)
        near.append(at)
    assert np.allclose(rows[1], (near[1] - near[0]) / (2 * h), rtol=1e-3, atol=1e-3)
    assert np.allclose(rows[2], (near[1] - 2 * rows[0] + near[0]) / h**2, rtol=0.01, atol=0.05)


@given(seed=seeds)
def test_a_point_before_the_palm_is_followed(chooser: Chooser, seed: int) -> None:
    """l(q) + h n(q) is at the point, and its motion is the point's, by central differences."""
    f, arm, rng = chooser.map, chooser.arm, np.random.default_rng(seed)
    q, h = _angles(seed), (0.1, -0.5, 3.0)
    at = arm.position(q) + h[0] * arm.orientation(q)[:, 2]
    point = np.array([at, rng.normal(size=3), rng.normal(size=3)])
    rows = np.array([q, np.zeros(3), np.zeros(3)])
    assert lift(f.packed, chooser.hand, h, point, rows, f.work) < EXACT

    def place(s: float) -> Array:
        x = rows[0] + s * rows[1] + 0.5 * s * s * rows[2]
        out: Array = (
            arm.position(x) + (h[0] + s * h[1] + 0.5 * s * s * h[2]) * (arm.orientation(x)[:, 2])
        )
        return out

    s = 1e-4
    assert np.allclose((place(s) - place(-s)) / (2 * s), point[1], atol=CLOSE)
    assert np.allclose((place(s) - 2 * place(0.0) + place(-s)) / s**2, point[2], atol=CLOSE * 10)


@pytest.mark.parametrize("seed", range(5))
def test_the_ball_is_met_from_the_front(
    chooser: Chooser, ball_of: Callable[[int, float], BallState], seed: int
) -> None:
    """At the meeting position and velocity agree and the ball accelerates along the normal."""
    ball = ball_of(seed, 0.1)
    catch = chooser.choose(ball, np.array([chooser.arm.q_ready, np.zeros(3), np.zeros(3)]))
    assert catch is not None
    arm, q, dq, ddq = chooser.arm, *catch.end
    at = np.empty((3, 3))
    fly_on(state_of(ball), catch.t_c - ball.t, at)
    assert np.allclose(arm.position(q), at[0], atol=EXACT)
    assert np.allclose(arm.jacobian(q) @ dq, at[1], atol=EXACT)
    s = 1e-5
    slope = arm.jacobian(q + s * dq) - arm.jacobian(q - s * dq)
    tip = arm.jacobian(q) @ ddq + slope @ dq / (2 * s)
    relative, normal = at[2] - tip, arm.orientation(q)[:, 2]
    a = float(relative @ normal)
    low, high = APPROACH
    assert low - CLOSE <= a <= high + CLOSE
    assert np.allclose(relative, a * normal, atol=CLOSE)


def test_no_meeting_out_of_reach(chooser: Chooser, arm: Arm) -> None:
    """A ball that stays 3 m away is not met."""
    f, rows = chooser.map, np.array([arm.q_ready, np.zeros(3), np.zeros(3)])
    ball = np.array([[3.0, 0.0, 0.0], np.zeros(3), np.zeros(3)])
    assert not meet(f.packed, chooser.hand, APPROACH, ball, rows, f.work)
