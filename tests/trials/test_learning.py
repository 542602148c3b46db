"""Learning with everything silent filled in: seeded, and sharing nothing with evaluations."""

import numpy as np

from mitt.generator.learn import Flight, LearnSettings
from mitt.generator.map_design import MapDesign
from mitt.robot.arm import Arm
from mitt.trials.learning import LEARNING_SEED, Neighbourhood, learn

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
