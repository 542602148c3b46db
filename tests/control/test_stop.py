"""Laws of the stops in closed form: they are Ruckig's, and the search finds the hardest."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ruckig import ControlInterface, InputParameter, Ruckig, Synchronization, Trajectory

from mitt.control.stop import (
    INSTANTS,
    ONSET,
    SHARE,
    braking,
    hardest,
    instant,
    lay,
    mass_work,
    plan_brake,
    scratch_of,
)
from mitt.control.stop import short_of_room as is_short
from mitt.control.stop import torque_share as share_of
from mitt.robot.arm import Arm
from mitt.signals import Array

#: Agreement with Ruckig [rad, rad/s, rad/s^2].
EXACT = 1e-9
#: Gap to the end of a range that counts as near [rad], of :mod:`mitt.control.stop`.
NEAR = 0.45

seeds = st.integers(0, 2**31)


def any_state(seed: int) -> tuple[Array, Array]:
    """Return q, dq, ddq of an arm that moves anyhow, shape (3, 3), and decelerations, (3,)."""
    rng = np.random.default_rng(seed)
    speed = 10.0 ** rng.uniform(-3.0, 1.3, 3) * rng.choice([-1.0, 1.0], 3)
    motion = np.array([rng.uniform(-1.5, 1.5, 3), speed, rng.uniform(-90.0, 90.0, 3)])
    return motion, 10.0 ** rng.uniform(0.0, 2.3, 3)


def ruckigs(motion: Array, rate: Array) -> Trajectory:
    """Return Ruckig's stop at decelerations."""
    request, trajectory = InputParameter(3), Trajectory(3)
    request.control_interface = ControlInterface.Velocity
    request.synchronization = Synchronization.No
    request.current_position, request.current_velocity = motion[:2].tolist()
    request.current_acceleration = [
        braking(*x) for x in zip(motion[1], motion[2], rate, strict=True)
    ]
    request.target_velocity = [0.0] * 3
    request.max_acceleration, request.max_jerk = rate.tolist(), (rate / ONSET).tolist()
    Ruckig(3).calculate(request, trajectory)
    return trajectory


def short_of_room(arm: Arm, motion: Array) -> bool:
    """Ask the kernel with buffers of its own."""
    most = np.array([arm.tau_max, arm.q_min, arm.q_max])
    return bool(is_short(arm.tables, most, motion, mass_work(arm)))


@settings(max_examples=200)
@given(seed=seeds)
def test_a_stop_in_closed_form_is_ruckigs(arm: Arm, seed: int) -> None:
    """Q, dq and ddq agree at all instants at which the torque is looked at, and at rest."""
    motion, rate = any_state(seed)
    w, theirs = scratch_of(arm), ruckigs(motion, rate)
    w.rate[:] = rate
    lay(motion, w)
    for i in range(INSTANTS):
        rows = np.array(theirs.at_time(instant(i, theirs.duration)))
        # In an edge of the acceleration a rounding of the time is one of the jerk times it.
        assert np.allclose(w.rows[i, :2], rows[:2], atol=EXACT)
        assert np.allclose(w.rows[i, 2], rows[2], atol=EXACT * rate.max() / ONSET)
    assert np.allclose(w.last[0], theirs.at_time(theirs.duration)[0], atol=EXACT)
    assert np.allclose(w.last[1:], 0.0, atol=EXACT)


@settings(max_examples=50)
@given(seed=seeds)
def test_the_pieces_of_a_brake_are_ruckigs(arm: Arm, seed: int) -> None:
    """A brake, from a state that brakes harder than allowed as well, is what Ruckig says of it."""
    motion, _ = any_state(seed)
    brake = plan_brake(arm, 0.0, motion)
    rates = np.abs(brake.pieces[:, :, 4]).max(axis=1) * ONSET
    theirs = ruckigs(motion, rates)
    assert brake.duration == pytest.approx(theirs.duration, abs=EXACT)
    for t in np.linspace(0.0, brake.duration, 9)[:-1]:
        assert np.allclose(brake.at(t)[:2], theirs.at_time(t)[:2], atol=EXACT)


@settings(max_examples=50)
@given(seed=seeds, others=st.sampled_from([0.15, 0.4, 0.8, 1.2]), urgent=st.integers(0, 2))
def test_the_hardest_stop_leaves_no_room(arm: Arm, seed: int, others: float, urgent: int) -> None:
    """It keeps the share of torque, and one that is a step of the search harder does not."""
    motion, _ = any_state(seed)
    rate, w = arm.tau_max / np.diag(arm.mass_matrix(motion[0])), scratch_of(arm)
    share = hardest(arm.tables, motion, rate, urgent, others, w)
    found = w.rate[urgent] / rate[urgent]
    if found > 0.2 + EXACT:
        assert share <= SHARE
    if found < 1.55:
        w.rate[urgent] = (found + 1.4 / 32) * rate[urgent]
        lay(motion, w)
        assert share_of(arm.tables, w.rows, w.tau, w.scratch) > SHARE


@settings(max_examples=100)
@given(seed=seeds)
def test_room_is_short_where_a_joint_alone_would_stop_near_its_end(arm: Arm, seed: int) -> None:
    """By Pinocchio's mass matrix, and constant deceleration at the full torque."""
    motion, _ = any_state(seed)
    way = 0.5 * motion[1] * np.abs(motion[1]) * np.diag(arm.mass_matrix(motion[0])) / arm.tau_max
    end = motion[0] + way
    near = (end > arm.q_max - NEAR) | (end < arm.q_min + NEAR)
    assert short_of_room(arm, motion) == np.any(near)


@given(seed=seeds)
def test_room_shrinks_with_speed(arm: Arm, seed: int) -> None:
    """A joint that is short of room at some speed towards a stop is so at every higher one."""
    motion, _ = any_state(seed)
    motion[0], motion[1, :2] = (0.0, np.pi / 4, 1.6), 0.0
    speeds = np.linspace(0.0, 25.0, 26)
    short = []
    for speed in speeds:
        motion[1, 2] = speed
        short.append(short_of_room(arm, motion))
    assert short == sorted(short)
    assert not short[0]
    assert short[-1]
