"""Between a command and its torques: a delay, and drives that follow; encoders that count."""

import numpy as np
import pytest

from mitt.robot.load import load_arm
from mitt.signals import Array
from mitt.world.drives import MEAN, NOW, command, follow, fresh_drives
from mitt.world.scene import Actuation, Mismatch, Scene, Sensing
from mitt.world.scenes import named_scene
from mitt.world.sensors import DQ, Q, encoder_steps, fresh_encoders, read_encoders
from mitt.world.simulation import World
from mitt.world.throws import Throw

HOLDING = np.array([0.0, 20.0, -3.0])
THROW = Throw(r=np.array([3.6, 0.1, 0.2]), dr=np.array([-5.0, 0.0, 2.6]))


def acted(actuation: Actuation, orders: Array, *, steps: int) -> tuple[Array, Array]:
    """Return mean torques of each tick, shape (k, 3), and closing angles, of a row of commands."""
    table, means, angles = fresh_drives(actuation, HOLDING), [], []
    for k, order in enumerate(orders):
        command(table, k, order, float(k))
        mean = np.zeros(3)
        for _ in range(steps):
            angle = follow(table, k, 0.001 / steps)
            mean += table[MEAN, :3] / steps
        means.append(mean)
        angles.append(angle)
    return np.array(means), np.array(angles)


@pytest.mark.parametrize("delay", [0, 1, 2, 7])
def test_a_command_acts_so_many_ticks_later_and_holds_until_then(delay: int) -> None:
    """Before the first has arrived, the drives hold the arm and the hand is open."""
    orders = np.random.default_rng(3).standard_normal((20, 3))
    means, angles = acted(Actuation(delay=delay), orders, steps=2)
    assert np.array_equal(means[delay:], orders[: 20 - delay])
    assert np.all(means[:delay] == HOLDING)
    assert angles.tolist() == [0.0] * delay + list(range(20 - delay))


def test_what_a_drive_brings_about_does_not_depend_on_the_length_of_the_steps() -> None:
    """The mean over a tick is that of the exact response, in one step or in four."""
    orders = np.random.default_rng(4).standard_normal((30, 3))
    one, four = (acted(Actuation(bandwidth=300.0), orders, steps=n)[0] for n in (1, 4))
    assert np.allclose(one, four, atol=1e-12)


def test_a_drive_follows_a_step_with_its_bandwidth() -> None:
    """After one time constant 63 % of the step is there; it never overshoots."""
    actuation = Actuation(bandwidth=100.0)
    table, h = fresh_drives(actuation, np.zeros(1)), 1e-5
    command(table, 0, np.ones(1), 0.0)
    reached = []
    for _ in range(round(1.0 / (2.0 * np.pi * 100.0) / h)):
        follow(table, 0, h)
        reached.append(table[NOW, 0])
    assert reached[-1] == pytest.approx(1.0 - np.exp(-1.0), abs=2e-3)
    assert np.all(np.diff(reached) > 0.0)


def test_the_arm_s_own_encoders_are_those_of_its_motors() -> None:
    """4096 counts a motor turn through the WAM's ratios; a number is that for all joints."""
    arm, turn = load_arm("wam").model, 2.0 * np.pi / 4096.0
    assert np.allclose(encoder_steps(named_scene("lab"), arm), turn / np.array([42.0, 28.25, 18.0]))
    assert np.all(encoder_steps(Scene(sensing=Sensing(encoder_step=1e-4)), arm) == 1e-4)
    assert not np.any(encoder_steps(Scene(), arm))


def test_encoders_count_and_their_velocity_is_the_difference_of_counts() -> None:
    """Readings are multiples of the step, within half of one; the true velocity is not told."""
    steps = np.array([1e-4, 3e-4, 0.0])
    table, rng = fresh_encoders(steps), np.random.default_rng(5)
    q, before = rng.standard_normal(3), np.zeros(3)
    for k in range(50):
        q = q + 1e-3 * rng.standard_normal(3)
        dq = rng.standard_normal(3)
        read_encoders(table, k * 1e-3, q, dq)
        assert np.all(np.abs(table[Q, :2] - q[:2]) <= 0.5 * steps[:2] + 1e-15)
        counts = table[Q, :2] / steps[:2]
        assert np.allclose(counts, np.rint(counts), atol=1e-9)
        assert (table[Q, 2], table[DQ, 2]) == (q[2], dq[2])
        wanted = np.zeros(2) if k == 0 else (table[Q, :2] - before[:2]) / 1e-3
        assert np.allclose(table[DQ, :2], wanted, atol=1e-9)
        before = table[Q].copy()


def test_a_ball_differs_from_its_model_and_nothing_else_is_drawn_otherwise() -> None:
    """Radius and mass within their bounds, others in other trials; the arm as without them."""
    arm = load_arm("wam").model
    plain = World(Scene(), arm)
    varied = World(Scene(mismatch=Mismatch(ball_mass=0.1, ball_radius=0.03)), arm)
    radii = []
    for seed in range(6):
        plain.reset(THROW, seed)
        varied.reset(THROW, seed)
        masses = [world.model.body_mass.copy() for world in (plain, varied)]
        ball = varied.model.geom("ball")
        assert varied.model.geom_size[ball.id, 0] == varied.radius
        assert abs(varied.radius / 0.04 - 1.0) <= 0.03
        assert abs(masses[1][ball.bodyid[0]] / 0.07 - 1.0) <= 0.1
        others = np.arange(len(masses[0])) != ball.bodyid[0]
        assert np.array_equal(masses[0][others], masses[1][others])
        assert plain.radius == 0.04
        radii.append(varied.radius)
    assert len(set(radii)) == 6
