"""Maps are learned with what is silent filled in, from flights as they are said to be."""

from dataclasses import replace

import numpy as np
import pytest

from mitt.core.arm.arm import Arm
from mitt.core.ball.flight import advance
from mitt.core.map.learn import Flight, LearnSettings
from mitt.core.map.map_design import MapDesign
from mitt.core.map.mapping import DirectMap
from mitt.core.map.neighbourhood import (
    LEARNING_SEED,
    Neighbourhood,
    learn,
    neighbourhood,
    neighbourhood_of_ball,
)
from mitt.core.signals import Array
from mitt.lab.trials.source import aim_of
from mitt.lab.world.throws import default_throw

FEW = Neighbourhood(flights=12, instants=12)


def test_learning_repeats_itself_to_the_bit(arm: Arm) -> None:
    """The same seed learns the same coefficients and metric, another seed others."""
    first, again, other = (learn(arm, seed=s, around=FEW) for s in (3, 3, 4))
    assert np.array_equal(first.map.alpha, again.map.alpha)
    assert np.array_equal(first.map.H, again.map.H)
    assert first.steps == again.steps
    assert not np.array_equal(first.map.alpha, other.map.alpha)


def test_the_seed_of_learning_is_not_one_that_people_type() -> None:
    """Maps are not learned on the throws that ``--seed 0`` and its like evaluate."""
    assert LEARNING_SEED > 10**6


def test_flights_given_are_the_flights_used(arm: Arm, flights: list[Flight]) -> None:
    """With flights of one's own no neighbourhood is drawn."""
    learned = learn(arm, flights=flights[:6], seed=1)
    assert learned.flights == 6
    assert np.array_equal(learned.map.alpha, learn(arm, flights=flights[:6], seed=2).map.alpha)


def test_design_and_settings_reach_the_learner(arm: Arm, flights: list[Flight]) -> None:
    """Kappa and order are those asked for; one step is one step beyond the projected start."""
    design = MapDesign(kappa=1.5, order=3)
    learned = learn(arm, design=design, flights=flights[:6], settings=LearnSettings(steps=1))
    assert learned.map.design == design
    assert learned.map.basis.order == 3
    assert learned.status == "steps"
    assert len(learned.steps) == len(learned.maps) == 3
    assert learned.maps[-1] is learned.map


def test_the_last_map_is_the_one_handed_over(arm: Arm) -> None:
    """The first cost is that of alpha = 0 and the highest, the last the lowest to 1 %."""
    learned = learn(arm, around=FEW)
    costs = [step.cost_torque + step.cost_speed for step in learned.steps]
    assert costs[0] == max(costs)
    assert costs[-1] <= min(costs) * 1.01
    assert not np.any(learned.maps[0].alpha)
    assert np.array_equal(learned.maps[-1].alpha, learned.map.alpha)


AROUND = Neighbourhood(flights=24)
#: Largest deviation of an undisturbed flight's rows from a parabola with little drag [m].
SMOOTH = 0.02


def drawn(f: DirectMap, seed: int, around: Neighbourhood = AROUND) -> list[Flight]:
    """Return flights drawn with a seed."""
    return neighbourhood(f, np.random.default_rng(seed), around)


@pytest.fixture(scope="module")
def around(plain: DirectMap) -> list[Flight]:
    """Two dozen flights."""
    return drawn(plain, 4)


def test_there_are_as_many_flights_as_asked(plain: DirectMap, around: list[Flight]) -> None:
    """Those that never reach the catch are redrawn."""
    assert len(around) == AROUND.flights
    assert all(len(flight.t) == AROUND.instants for flight in around)
    assert len(drawn(plain, 1, Neighbourhood(flights=3, instants=7))) == 3


def test_a_seed_is_a_neighbourhood(plain: DirectMap, around: list[Flight]) -> None:
    """The same seed draws the same flights to the bit, another seed others."""
    again, other = drawn(plain, 4), drawn(plain, 5)
    for a, b in zip(around, again, strict=True):
        assert np.array_equal(a.ball, b.ball)
        assert np.array_equal(a.seen, b.seen)
    assert not np.array_equal(around[0].ball, other[0].ball)


def test_every_flight_runs_from_t_0_to_just_past_its_catch(
    plain: DirectMap, around: list[Flight]
) -> None:
    """S changes its sign between the last but 10 ms and the end, and nowhere before."""
    i = plain.design.catch_joint
    for flight in around:
        assert AROUND.t_0[0] <= flight.t[0] <= AROUND.t_0[1]
        s = [plain.virtual(row)[1][0, i] - plain.design.q_catch for row in flight.ball]
        before = np.interp(flight.t[-1] - AROUND.after - 2e-3, flight.t, s)
        assert np.sign(before) == np.sign(s[0])
        assert np.sign(s[-1]) == -np.sign(s[0])


def test_rows_are_motions(around: list[Flight]) -> None:
    """Velocity is the difference of position, kicks and bounces aside."""
    for flight in around:
        mean = 0.5 * (flight.ball[1:, 1] + flight.ball[:-1, 1])
        gap = np.diff(flight.ball[:, 0], axis=0) - mean * np.diff(flight.t)[:, None]
        assert np.sum(np.abs(gap).max(axis=1) > 1e-3) <= 1


def test_disturbed_flights_are_among_them(plain: DirectMap) -> None:
    """With all flights kicked or bounced every one has a jump of its velocity, with none none."""
    calm = drawn(plain, 3, Neighbourhood(flights=10, kicked=0.0, bounced=0.0))
    bounced = drawn(plain, 3, Neighbourhood(flights=10, kicked=0.0, bounced=1.0))

    def jump(flight: Flight) -> float:
        return float(np.abs(np.diff(flight.ball[:, 1, 2]) / np.diff(flight.t) + 9.81).max())

    assert max(jump(flight) for flight in calm) < 5.0
    assert min(jump(flight) for flight in bounced) > 20.0


def test_the_belief_at_t_0_errs_as_stated(plain: DirectMap) -> None:
    """Errors of the believed position and velocity spread by sigma_r and sigma_dr, to a third."""
    around = drawn(plain, 6, Neighbourhood(flights=80, instants=5))
    errors = np.array([flight.seen[:2] - flight.ball[0, :2] for flight in around])
    assert np.std(errors[:, 0]) == pytest.approx(0.003, rel=0.33)
    assert np.std(errors[:, 1]) == pytest.approx(0.1, rel=0.33)


def test_the_aim_is_the_box_of_the_contract(plain: DirectMap) -> None:
    """q1 in +-0.3, q2 in pi/4 +- 0.22, q4 = q_alpha."""
    aim = aim_of(plain.arm)
    assert np.allclose(aim.q_low, [-0.3, np.pi / 4 - 0.22, np.pi / 2])
    assert np.allclose(aim.q_high, [0.3, np.pi / 4 + 0.22, np.pi / 2])


def test_learning_flights_reach_beyond_the_default_throws(plain: DirectMap) -> None:
    """At the nominal catch's distance they are farther to the side and up, slower and faster."""
    flights = drawn(plain, 7, Neighbourhood(flights=150, kicked=0.0, bounced=0.0))
    radius = float(np.hypot(*plain.arm.position(plain.start)[:2]))
    learned = [passing(flight.ball[:, 0], flight.ball[:, 1], radius) for flight in flights]
    rng, aim = np.random.default_rng(7), aim_of(plain.arm)
    tested = []
    for throw in (default_throw(rng, aim) for _ in range(60)):
        r, dr, rows = throw.r.copy(), throw.dr.copy(), []
        for _ in range(70):
            advance(r, dr, 0.04, 0.01)
            rows.append((r.copy(), dr.copy()))
        path = np.array(rows)
        tested.append(passing(path[:, 0], path[:, 1], radius))
    low, high = np.nanpercentile(np.array(learned), [3, 97], axis=0)
    assert np.all(low < np.nanpercentile(np.array(tested), 8, axis=0))
    assert np.all(high > np.nanpercentile(np.array(tested), 92, axis=0))


def passing(r: Array, dr: Array, radius: float) -> Array:
    """Return y, z and speed where positions (K, 3) come within a distance of the axis; or NaN."""
    k = int(np.argmax(np.hypot(r[:, 0], r[:, 1]) <= radius))
    near = np.hypot(*r[k, :2]) <= radius
    return np.array([*r[k, 1:], np.linalg.norm(dr[k])]) if near else np.full(3, np.nan)


def test_learning_flights_have_the_drag_of_the_ball(plain: DirectMap) -> None:
    """A ball with more drag is slowed down more on its way, by its own share of v^2."""
    for drag in (0.0, 0.3):
        settings = replace(neighbourhood_of_ball(drag), flights=10, kicked=0.0, bounced=0.0)
        for flight in drawn(plain, 8, settings):
            v, a = flight.ball[0, 1], flight.ball[0, 2] + np.array([0.0, 0.0, 9.81])
            k = float(np.linalg.norm(a) / (v @ v))
            assert 0.75 * drag - 1e-3 <= k <= 1.25 * drag + 1e-3
