"""A motion that somebody asks for is one, begins where the arm is, ends at rest, keeps limits."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.control.envelope import bounds_of, check_motion
from mitt.errors import InputError
from mitt.link.live import slow_motion
from mitt.robot.arm import Arm
from mitt.signals import TICK, Array


def quintic(start: Array, end: Array, ticks: int) -> Array:
    """Return q, dq, ddq of a quintic each tick, shape (ticks + 1, 3, n)."""
    x = np.linspace(0.0, 1.0, ticks + 1)[:, None]
    s = 10.0 * x**3 - 15.0 * x**4 + 6.0 * x**5
    ds = (30.0 * x**2 - 60.0 * x**3 + 30.0 * x**4) / (ticks * TICK)
    dds = (60.0 * x - 180.0 * x**2 + 120.0 * x**3) / (ticks * TICK) ** 2
    return np.stack([start + s * (end - start), ds * (end - start), dds * (end - start)], axis=1)


def checked(arm: Arm, motion: Array, start: Array | None = None) -> None:
    """Check a motion from rest in a pose, the ready one where there is none."""
    q = arm.q_ready if start is None else start
    last = np.array([q, np.zeros(arm.n), np.zeros(arm.n)])
    check_motion(arm.names, bounds_of(arm), last, motion)


@given(seed=st.integers(0, 2**31), ticks=st.integers(800, 3000))
def test_a_motion_between_two_poses_is_taken(arm: Arm, seed: int, ticks: int) -> None:
    """From anywhere to anywhere within the ranges, and from beyond an end back in."""
    rng, b = np.random.default_rng(seed), bounds_of(arm)
    start, end = (
        rng.uniform(b["q_min"] - 0.5, b["q_max"] + 0.5),
        rng.uniform(b["q_min"], b["q_max"]),
    )
    slow = max(ticks, int(2000.0 * np.max(np.abs(end - start) / b["dq_max"])))
    checked(arm, quintic(start, end, slow), start)


def test_a_motion_at_full_acceleration_is_taken(arm: Arm) -> None:
    """Acceleration may step between two ticks, and in the middle of one."""
    a, ticks = 10.0, 201
    t = np.minimum(TICK * np.arange(ticks + 1), TICK * ticks)
    half = 0.5 * t[-1]
    up = t <= half
    dq = np.where(up, a * t, a * (t[-1] - t))
    q = np.where(up, 0.5 * a * t**2, a * half**2 - 0.5 * a * (t[-1] - t) ** 2)
    ddq = np.where(up, a, -a)
    rows = np.stack([q, dq, ddq], axis=1)[:, :, None] * np.array([0.3, -0.2, 0.5])
    rows[:, 0] += arm.q_ready
    rows = np.concatenate([rows, np.array([[rows[-1, 0], np.zeros(3), np.zeros(3)]])])
    checked(arm, rows)


SPOILED: dict[str, Callable[[Array], object]] = {
    "start": lambda m: m[:, 0].__iadd__(1e-3),
    "end at rest": lambda m: m[-1, 1].__iadd__(1e-2),
    "start at rest": lambda m: m[0, 1].__iadd__(1e-2),
    "positions a tick apart": lambda m: m[300:, 0].__iadd__(1e-4),
    "speeds a tick apart": lambda m: m[:, 2].__imul__(0.0),
    "positions": lambda m: m[1:-1, 1].__imul__(0.5),
}


@pytest.mark.parametrize("wanted", SPOILED)
@pytest.mark.parametrize("joint", [0, 1, 2])
def test_a_motion_that_is_none_is_refused(arm: Arm, wanted: str, joint: int) -> None:
    """One joint is enough; the line names it or says what is wrong."""
    end = arm.q_ready.copy()
    end[joint] -= 0.5
    motion = quintic(arm.q_ready, end, 700)
    checked(arm, motion)
    one = motion[:, :, joint : joint + 1]
    SPOILED[wanted](one)
    with pytest.raises(InputError, match=wanted) as refused:
        checked(arm, motion)
    assert arm.names[joint] in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("joint", [0, 1, 2])
def test_a_motion_beyond_a_limit_is_refused(arm: Arm, joint: int) -> None:
    """Too far, too fast, too hard, too sudden: the joint and the limit are named."""
    n, end = len(arm.model.links), arm.q_ready.copy()
    beyond = arm.q_ready.copy()
    beyond[joint] = arm.q_max[joint]
    most = np.full(n, 3.0)
    slower = Arm(arm.model, replace(arm.limits, acceleration=most))
    smoother = Arm(arm.model, replace(arm.limits, jerk=most))
    end[joint] += 1.0 if joint == 2 else -1.0
    for what, other, to, ticks in (
        ("positions", arm, beyond, 3000),
        ("speed", arm, end, 60),
        ("acceleration", slower, end, 800),
        ("jerk", smoother, end, 2000),
    ):
        motion = quintic(arm.q_ready, to, ticks)
        with pytest.raises(InputError, match=f"{what} of {arm.names[joint]}"):
            checked(other, motion)
        if other is not arm:
            checked(arm, motion)


@given(seed=st.integers(0, 2**31), share=st.floats(0.05, 1.0))
def test_the_motions_of_mitt_are_taken(arm: Arm, seed: int, share: float) -> None:
    """On the way to the ready pose, with slow limits of any kind, from beyond an end as well."""
    rng, n = np.random.default_rng(seed), len(arm.model.links)
    low = {
        name: None if rng.random() < 0.5 else np.full(n, size)
        for name, size in (("acceleration", 0.5), ("jerk", 4.0), ("torque_rate", 100.0))
    }
    slow = Arm(arm.model, replace(arm.limits, **low))  # type: ignore[arg-type]
    start = rng.uniform(arm.q_min - 0.3, arm.q_max + 0.3)
    motion = slow_motion(slow, start, arm.q_ready, share)
    checked(slow, motion, start)
    assert np.allclose(motion[-1, 0], arm.q_ready)
