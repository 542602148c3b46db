"""What is left out of a design follows from the arm and its limits; the throws do not."""

import numpy as np
import pytest

from mitt.generator.design import MapDesign, default_design, further_designs, nominal_catch
from mitt.robot.arm import Arm
from mitt.robot.load import load_arm


def test_the_paper_s_arm_has_the_paper_s_design(arm: Arm) -> None:
    """Elbow at 90 degrees, the ball's velocity matched, degree 4."""
    assert default_design(arm) == MapDesign()


@pytest.mark.parametrize("limits", ["wam-48v", "wam-80v"])
def test_an_arm_slower_than_the_ball_lets_it_in_along_the_palm_s_normal(limits: str) -> None:
    """A chosen design has an inward line, what is stated replaces it, another joint drops it."""
    arm = load_arm("wam", limits=limits)
    chosen = default_design(arm)
    assert chosen.inward > 0.0
    stated = default_design(arm, q_catch=1.1, inward=0.0, kappa=3.0, order=3)
    assert stated == MapDesign(q_catch=1.1, inward=0.0, kappa=3.0, order=3)
    assert default_design(arm, catch_joint=1).inward == 0.0
    before, after = further_designs(arm)
    assert all(x.inward < chosen.inward for x in before)
    assert all(x.inward > chosen.inward for x in after)


def test_throws_are_the_same_for_every_limit_set(arm: Arm) -> None:
    """The nominal catch depends on the arm alone."""
    for limits in ("wam-48v", "wam-80v"):
        other = load_arm("wam", limits=limits)
        assert np.array_equal(nominal_catch(other), nominal_catch(arm))
