"""Steps of either length move ball and arm alike, and contacts are noticed as finely as before."""

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.core.arm.arm import Arm
from mitt.core.signals import Command
from mitt.io.load import build_arm
from mitt.lab.world.motion import NEAR
from mitt.lab.world.scene import exact_scene
from mitt.lab.world.simulation import World
from mitt.lab.world.throws import Throw, fly

FLIGHT_M = 1e-6
"""Flight in the world against Runge-Kutta over the whole way."""
VELOCITY = 1e-10
"""Catch point's velocity against MuJoCo's own [m/s]."""

WORLD = World(exact_scene(), build_arm("wam").model)
G = np.array([0.0, 0.0, -9.81])
rates = st.tuples(*[st.floats(-20.0, 20.0)] * 3).map(np.array)


def still(world: World, arm: Arm, ticks: int) -> None:
    """Hold the ready pose."""
    for _ in range(ticks):
        state = world.sense().arm
        ddq = 900.0 * (arm.q_ready - state.q) - 60.0 * state.dq
        tau = arm.inverse_dynamics(state.q, state.dq, ddq)
        world.apply(Command(t=world.t, joints=np.array([state.q, state.dq, ddq, tau]), hand=0.0))


@pytest.mark.parametrize("aside", [0.2, 1.5])
def test_a_flight_does_not_depend_on_the_steps(arm: Arm, aside: float) -> None:
    """Past the hand, where steps are fine, and far from it, the ball flies as reckoned."""
    catch = arm.position(arm.q_ready)
    dr = np.array([-5.0, 0.0, 0.5])
    r = catch + np.array([0.0, aside, 0.0]) - 0.3 * dr + 0.5 * G * 0.09
    throw = Throw(r=r, dr=dr - 0.3 * G)
    WORLD.reset(throw, 0)
    lengths = set()
    for _ in range(400):
        still(WORLD, arm, 1)
        lengths.add(WORLD.model.opt.timestep)
    truth, trace = WORLD.truth(), WORLD.trace()
    near = np.linalg.norm(trace.r_o - trace.position, axis=1).min() < NEAR
    assert near == (aside < NEAR)
    assert lengths == ({0.0005, 0.001} if near else {0.001})
    wanted = fly(throw.r, throw.dr, drag=0.04, duration=0.4)
    assert WORLD.first_contact is None
    assert truth.r_o == pytest.approx(wanted[0], abs=FLIGHT_M)
    assert truth.dr_o == pytest.approx(wanted[1], abs=FLIGHT_M / 0.1)


@given(dq=rates, shift=st.floats(-0.3, 0.3))
def test_the_catch_points_velocity_is_mujocos(dq: np.ndarray, shift: float) -> None:
    """What the trace keeps is the velocity of MuJoCo's site."""
    WORLD.reset(Throw(r=np.array([3.0, 1.5, 0.3]), dr=np.zeros(3)), 0)
    WORLD.data.qpos[:3] += shift
    WORLD.data.qvel[:3] = dq
    mujoco.mj_forward(WORLD.model, WORLD.data)
    site, velocity = WORLD.model.site("catch_point").id, np.zeros(6)
    kind = mujoco.mjtObj.mjOBJ_SITE
    mujoco.mj_objectVelocity(WORLD.model, WORLD.data, kind, site, velocity, 0)
    assert WORLD.truth().velocity == pytest.approx(velocity[3:], abs=VELOCITY)


def test_first_contacts_are_noticed_to_half_a_tick(arm: Arm) -> None:
    """A ball released a little nearer each time touches earlier, in steps of half a tick."""
    catch, dr = arm.position(arm.q_ready), np.array([-4.0, 0.0, -4.0])
    times = []
    for k in range(8):
        duration = 0.2 - 0.00025 * k
        r = catch - duration * dr + 0.5 * G * duration**2
        WORLD.reset(Throw(r=r, dr=dr - duration * G), 0)
        still(WORLD, arm, 215)
        assert WORLD.first_contact is not None
        times.append(WORLD.first_contact.t)
    halves = np.array(times) / 0.0005
    assert halves == pytest.approx(np.rint(halves), abs=1e-6)
    assert np.all(np.diff(times) < 1e-9)
    assert len(set(np.rint(halves))) >= 4
    assert np.any(np.rint(halves) % 2 == 1)
