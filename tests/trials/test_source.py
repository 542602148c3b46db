"""Where balls come from, and where they are aimed."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mitt.core.arm.arm import Arm
from mitt.core.ball.flight import advance
from mitt.core.errors import FileError
from mitt.core.map.map_design import MapDesign
from mitt.core.map.mapping import DirectMap, unlearned
from mitt.core.map.neighbourhood import Neighbourhood, neighbourhood
from mitt.core.signals import Array
from mitt.io.arm_file import load_arm
from mitt.lab.trials.source import Source, release_of, source_of
from mitt.lab.world.flights import PlacedFlight, builtin_flights
from mitt.lab.world.throws import Throw


def source(
    f: DirectMap,
    *,
    seed: int = 0,
    count: int | None = None,
    throws: Path | None = None,
    flights: Path | None = None,
) -> Source:
    """Return a source with the files given."""
    return source_of(
        f.arm, seed=seed, count=count, throws_file=throws, flights_file=flights, drag=0.12
    )


@settings(max_examples=20)
@given(seed=st.integers(0, 2**62), index=st.integers(0, 10**6))
def test_a_ball_depends_on_seed_and_index_alone(plain: DirectMap, seed: int, index: int) -> None:
    """Drawn again, in any order, the ball is the same to the bit; its neighbours differ."""
    run = source(plain, seed=seed)
    first = run.ball(index)
    other = run.ball(index + 1)
    again = source(plain, seed=seed, count=3).ball(index)
    assert isinstance(first, Throw)
    assert isinstance(again, Throw)
    assert isinstance(other, Throw)
    assert np.array_equal(first.r, again.r)
    assert np.array_equal(first.dr, again.dr)
    assert not np.array_equal(first.r, other.r)


def test_default_throws_follow_the_scene_s_drag(plain: DirectMap) -> None:
    """The drag of a source is what its throws are aimed with: more drag is thrown harder."""
    thick, thin = (source_of(plain.arm, seed=3, count=5, drag=drag) for drag in (0.3, 0.0))
    for index in range(5):
        heavy, light = thick.ball(index), thin.ball(index)
        assert isinstance(heavy, Throw)
        assert isinstance(light, Throw)
        assert np.linalg.norm(heavy.dr) > np.linalg.norm(light.dr) + 0.5


def test_the_seeds_of_trials_are_all_different(plain: DirectMap) -> None:
    """Over 40 seeds and 50 throws no two trials share their noise."""
    seeds = {source(plain, seed=s).trial_seed(k) for s in range(40) for k in range(50)}
    assert len(seeds) == 2000


def test_counts_follow_the_file_unless_said(plain: DirectMap, tmp_path: Path) -> None:
    """10 throws without a file, each row of a file once, or as many as --throws says."""
    path = tmp_path / "t.csv"
    path.write_text("x,y,z,vx,vy,vz\n3,0,0.2,-6,0,1.5\n3.5,0,0.2,-6,0,1\n")
    assert source(plain).count == 10
    run = source(plain, throws=path)
    assert run.count == 2
    assert source(plain, throws=path, count=5).count == 5
    rows = [run.ball(k) for k in range(4)]
    assert release_of(rows[1]).tolist() == [3.5, 0.0, 0.2]
    assert np.array_equal(release_of(rows[0]), release_of(rows[2]))
    assert [run.name(k) for k in range(3)] == ["row 1", "row 2", "row 1"]


def test_recorded_flights_pass_the_nominal_catch_point(plain: DirectMap, tmp_path: Path) -> None:
    """At 75 % of its duration each flight is within the jitter of l([0, pi/4, pi/2])."""
    recording = builtin_flights()[0]
    path = tmp_path / "f.csv"
    rows = [f"a,{t},{r[0]},{r[1]},{r[2]}" for t, r in zip(recording.t, recording.r, strict=True)]
    path.write_text("\n".join(["flight,t_s,x_m,y_m,z_m", *rows]))
    run = source(plain, flights=path)
    assert run.count == 1
    nominal = plain.arm.position(plain.start)
    for index in range(5):
        ball = run.ball(index)
        assert isinstance(ball, PlacedFlight)
        gap = ball.at(0.75 * ball.duration)[0] - nominal
        assert np.all(np.abs(gap) <= 0.030 + 1e-9)
    assert np.array_equal(release_of(run.ball(3)), release_of(run.ball(3)))
    assert not np.array_equal(release_of(run.ball(3)), release_of(run.ball(4)))


@pytest.mark.parametrize("index", [0, 2**31])
def test_a_default_ball_has_a_name_by_its_number(plain: DirectMap, index: int) -> None:
    """Names tell trials apart in the report."""
    assert source(plain).name(index) == f"throw {index}"


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
    aim = load_arm(path).model.aim
    assert aim is not None
    np.testing.assert_array_equal(aim, AIM)


def test_half_a_box_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "arm.toml"
    path.write_text(FILE)
    with pytest.raises(FileError, match="at and around"):
        load_arm(path)
