"""An arm that says where it wants its balls gets them there, and learns from such flights."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mitt.ball.flight import advance
from mitt.errors import FileError
from mitt.files.arm_file import open_arm
from mitt.generator.map_design import MapDesign
from mitt.generator.mapping import unlearned
from mitt.robot.arm import Arm
from mitt.signals import Array
from mitt.trials.learning import Neighbourhood, neighbourhood
from mitt.trials.source import source_of
from mitt.world.throws import Throw

AIM = np.array([[0.7, 0.1, 0.3], [0.02, 0.1, 0.08]])
#: How near to the box a ball has to pass, for steps of a millisecond [m].
_NEAR = 0.01
FILE = """
schema = "mitt.arm/1"
[arm]
name = "wam"
[throws]
at = [0.7, 0.1, 0.3]
"""


@pytest.fixture(scope="module")
def aimed(arm: Arm) -> Arm:
    return Arm(replace(arm.model, aim=AIM), arm.limits)


def _outside(r: Array) -> float:
    """Return the distance of a point from the box [m]."""
    return float(np.linalg.norm(np.maximum(np.abs(r - AIM[0]) - AIM[1], 0.0)))


def test_default_throws_pass_the_box(aimed: Arm) -> None:
    source = source_of(aimed, seed=5, drag=0.04, count=20)
    for k in range(20):
        ball = source.ball(k)
        assert isinstance(ball, Throw)
        r, dr, nearest = ball.r.copy(), ball.dr.copy(), np.inf
        for _ in range(900):
            advance(r, dr, 0.04, 0.001)
            nearest = min(nearest, _outside(r))
        assert nearest < _NEAR
        assert 5.0 <= np.linalg.norm(ball.dr) <= 7.1
        assert 0.0 <= ball.r[2] - AIM[0, 2] + 0.26 <= 0.81


def test_an_arm_without_a_wish_keeps_its_throws(arm: Arm, aimed: Arm) -> None:
    mine, other = (source_of(x, seed=5, drag=0.04) for x in (arm, aimed))
    assert mine.aim.q_low.shape == (arm.n,)
    assert mine.ranges != other.ranges
    np.testing.assert_allclose(other.catch_point, AIM[0])


def test_flights_that_no_map_can_follow_are_not_learned_from(aimed: Arm) -> None:
    f = unlearned(aimed, MapDesign())
    settings = Neighbourhood(flights=30, kicked=0.0, bounced=0.0, max_speed_share=1.2)
    for flight in neighbourhood(f, np.random.default_rng(3), settings):
        for motion in flight.ball:
            inside, rows = f.virtual(motion)
            assert inside
            assert np.all(np.abs(rows[1]) <= 1.2 * aimed.dq_max)


def test_learning_flights_arrive_near_the_box(aimed: Arm) -> None:
    f = unlearned(aimed, MapDesign())
    flights = neighbourhood(f, np.random.default_rng(3), Neighbourhood(flights=30, kicked=0.0))
    assert len(flights) == 30
    ends = np.array([flight.ball[-1, 0] for flight in flights])
    assert np.abs(ends.mean(axis=0) - AIM[0])[1] < 0.1


def test_an_arm_file_says_where(tmp_path: Path) -> None:
    path = tmp_path / "arm.toml"
    path.write_text(FILE + "around = [0.02, 0.1, 0.08]\n")
    aim = open_arm(path)[0].model.aim
    assert aim is not None
    np.testing.assert_array_equal(aim, AIM)


def test_half_a_box_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "arm.toml"
    path.write_text(FILE)
    with pytest.raises(FileError, match="at and around"):
        open_arm(path)
