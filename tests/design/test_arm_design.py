"""The region of balls that a design catches: laws of its grid and of the limits it names."""

from dataclasses import replace

import numpy as np
import pytest
from design.conftest import TINY

from mitt.core.arm.arm import Arm
from mitt.lab.design import arm_design as module
from mitt.lab.design.arm_design import Design, Region, region_of
from mitt.lab.design.task import DesignTask
from mitt.lab.report.design_page import region_plot
from mitt.lab.world.throws import fly


def quiet(name: str, done: int, of: int) -> None:
    """Tell nobody."""


@pytest.fixture(scope="module")
def region(found: Design) -> Region:
    assert found.region is not None
    return found.region


@pytest.mark.thorough
def test_balls_at_the_middle_of_the_box_are_caught_and_far_off_it_they_are_not(
    region: Region,
) -> None:
    middle = len(region.height) // 2
    assert region.caught[middle, middle] > 0.0
    corners = region.caught[[0, 0, -1, -1], [0, -1, 0, -1]]
    assert corners.min() == 0.0


def test_the_hand_meets_each_ball_that_is_caught_within_reach(region: Region, whole: Arm) -> None:
    """The WAM reaches 0.55 + 0.30 m and the hand from its shoulder, which is the base frame."""
    assert len(region.hand) == round(3 * region.caught.sum())
    assert np.linalg.norm(region.hand, axis=1).max() < 1.2
    assert whole.model.name == "wam"


def test_a_limit_is_named_where_a_ball_is_not_caught_and_nowhere_else(region: Region) -> None:
    named = np.array(region.binding) != ""
    assert np.array_equal(named, region.caught < 1.0)


@pytest.mark.thorough
def test_a_weaker_arm_catches_fewer_balls_for_want_of_torque(
    region: Region, found: Design, whole: Arm, task: DesignTask
) -> None:
    assert found.best is not None
    weak = Arm(whole.model, replace(whole.limits, tau_peak=0.35 * whole.limits.tau_peak))
    fewer = region_of(weak, found.best.candidate, task, quiet, each_way=TINY.grid)
    assert fewer is not None
    assert fewer.caught.sum() < region.caught.sum()
    assert any(name.startswith("torque:") for row in fewer.binding for name in row)


@pytest.mark.parametrize("faster", [-1.0, 0.0, 1.0])
def test_a_ball_passes_the_point_that_is_meant(task: DesignTask, faster: float) -> None:
    """It does so with the velocity of the task, half a second after its release."""
    point = np.array([0.7, 0.2, 0.1])
    ball = module._through(point, task, faster)
    after = np.linspace(0.0, 0.8, 801)
    path = np.array([fly(ball.r_o, ball.dr_o, drag=ball.drag, duration=float(t))[0] for t in after])
    gap = np.linalg.norm(path - point, axis=1)
    assert gap.min() < 5e-3
    dr = fly(ball.r_o, ball.dr_o, drag=ball.drag, duration=float(after[np.argmin(gap)]))[1]
    assert np.linalg.norm(dr) == pytest.approx(
        np.linalg.norm(task.balls.velocity(faster)), abs=0.02
    )


def test_the_plot_names_the_limits_that_bind_where_none_is_caught(region: Region) -> None:
    none = np.array(region.binding)[region.caught == 0.0]
    values, counts = np.unique(none, return_counts=True)
    assert str(values[np.argmax(counts)]) in region_plot(region).svg
