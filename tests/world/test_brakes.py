"""Laws of the plant's brakes: what they hold does not creep, and they have a largest torque."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.robot.arm import Arm
from mitt.signals import Command
from mitt.world.brakes import DELAY, GIVEN, ROWS, STIFFNESS, TORQUE, brake_numbers, hold
from mitt.world.scene import Scene
from mitt.world.simulation import World
from mitt.world.throws import Throw

AWAY = Throw(r=np.array([3.0, 3.0, 3.0]), dr=np.array([0.0, 3.0, 3.0]))


@given(load=st.floats(-2.0, 2.0), speed=st.floats(-5.0, 5.0))
def test_a_brake_sticks_below_its_torque_and_slips_above(
    arm: Arm, load: float, speed: float
) -> None:
    """Under a constant load it rests and stays to a nanoradian, or it gives its torque and no more.

    Args:
        arm: The arm.
        load: Share of the brake's torque.
        speed: At the beginning [rad/s].
    """
    brakes, h, inertia = brake_numbers(arm.model.complete(), arm.limits), 1e-3, 2.0
    most = brakes[TORQUE, 0]
    qvel, ctrl, q, places = np.array([speed, 0.0, 0.0]), np.full(3, 9.0), 0.0, []
    for k in range(3000):
        passive = np.zeros(3)
        hold(brakes.ravel(), 1.0, qvel, ctrl, passive, h)
        assert abs(passive[0]) <= most * (1.0 + 1e-12)
        assert not ctrl.any()
        qvel[0] += h * (load * most + passive[0]) / inertia
        q += h * qvel[0]
        if k >= 2000:
            places.append(q)
    if abs(load) < 0.9:
        assert np.ptp(places) < 1e-9
    elif abs(load) > 1.1:
        assert np.ptp(places) > 0.1


def test_before_its_delay_a_brake_does_nothing(arm: Arm) -> None:
    """And one that was not told to engage never does."""
    brakes = brake_numbers(arm.model.complete(), arm.limits)
    for since in (-1.0, 0.0, float(brakes[DELAY].min()) - 0.001):
        ctrl, passive = np.ones(3), np.zeros(3)
        hold(brakes.ravel(), since, np.ones(3), ctrl, passive, 1e-3)
        assert np.all(ctrl == 1.0)
        assert not passive.any()
        assert not brakes[GIVEN].any()


@pytest.mark.parametrize("brakes", [True, False])
def test_an_arm_without_drives_hangs_on_its_brakes(arm: Arm, brakes: bool) -> None:
    """With them it sinks by what the springs give under its weight, once; without them it falls."""
    world, zero = World(Scene(), arm.model, limits=arm.limits), np.zeros(arm.n)
    world.reset(AWAY, 3)
    for _ in range(3000):
        q = world.truth().q
        falls = arm.inverse_dynamics(q, zero, zero) if world.t < 0.1 else zero
        told = np.array([q, zero, zero, falls])
        world.apply(Command(t=world.t, joints=told, hand=0.0, brakes=brakes))
    q = world.trace().q
    numbers = brake_numbers(arm.model.complete(), arm.limits)
    assert numbers.shape == (ROWS, arm.n)
    gives = numbers[TORQUE] / numbers[STIFFNESS]
    moved = np.abs(q[1000:] - q[100]).max(axis=0)
    if brakes:
        assert np.all(moved < gives + 0.02)
        assert np.ptp(q[1000:], axis=0).max() < 1e-6
    else:
        assert moved.max() > 0.5
