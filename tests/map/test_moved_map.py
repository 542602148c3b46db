"""Maps that catch elsewhere than the learned one: what they share with it, and where they are."""

import numpy as np
import pytest

import mitt
from mitt.core.arm.arm import Arm
from mitt.core.map.demand import Tolerance
from mitt.core.map.family import family_of, moved
from mitt.core.map.foresight import foresee
from mitt.core.map.learn import Learned
from mitt.core.map.mapping import DirectMap
from mitt.core.map.neighbourhood import Neighbourhood, learn, nominal_ball
from mitt.core.signals import BallState
from mitt.core.verdict.feasibility import Outcome, judge


@pytest.fixture(scope="module", params=["wam", "kuka-iiwa14"])
def taught(request: pytest.FixtureRequest) -> DirectMap:
    """A map learned from few flights, of an arm without a slope or with one."""
    name: str = request.param
    arm = mitt.load_arm(name, limits="paper") if name == "wam" else mitt.load_arm(name)
    return learn(arm, around=Neighbourhood(flights=12, instants=10)).map


def test_each_of_a_family_catches_earlier_than_the_one_before(taught: DirectMap) -> None:
    """Along the flight that the map was learned for, up to the end of the reach."""
    ball = nominal_ball(taught.arm)
    times = [foresee(f, ball).after for f in (taught, *family_of(taught, ball))]
    assert len(times) >= 4
    assert np.all(np.isfinite(times))
    assert np.all(np.diff(times) < 1e-4)
    assert times[0] - times[-1] > 0.02


def test_a_moved_map_has_what_was_learned(learned: Learned) -> None:
    """The coefficients, their metric and the joints; moved by nothing it is the map itself."""
    f = learned.map
    for g in family_of(f, nominal_ball(f.arm)):
        assert g.alpha is f.alpha or np.array_equal(g.alpha, f.alpha)
        assert np.array_equal(g.H, f.H)
        assert g.design.free == f.design.free
    same = moved(f, f.design.q_catch, f.design.inward)
    r = f.arm.position(f.start) + np.array([0.5, 0.1, 0.1])
    assert np.array_equal(same.to_joints(r)[1], f.to_joints(r)[1])


def test_a_ball_that_falls_short_is_within_the_limits_of_another(arm: Arm) -> None:
    """It never comes to the surface of the learned map; one of the family reaches it."""
    f = learn(arm).map
    ball = nominal_ball(arm)
    lower = (
        BallState(t=0.0, r_o=ball.r_o, dr_o=ball.dr_o - [0.0, 0.0, down])
        for down in np.arange(1.0, 4.0, 0.05)
    )
    short = next(x for x in lower if not np.isfinite(foresee(f, x).after))
    said = [judge(g, short, arm.q_ready, tolerance=Tolerance()).outcome for g in family_of(f, ball)]
    assert Outcome.FEASIBLE in said
