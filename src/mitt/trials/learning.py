"""Learning a map with everything that is silent filled in: the neighbourhood of default throws."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mitt import checks
from mitt.errors import InputError
from mitt.generator.design import MapDesign, default_design, further_designs
from mitt.generator.generators import Direct
from mitt.generator.learn import Flight, Learned, LearnSettings
from mitt.generator.learn import learn as learn_from
from mitt.generator.mapping import DirectMap, unlearned
from mitt.generator.several import Several
from mitt.robot.arm import Arm
from mitt.trials.neighbourhood import Neighbourhood, neighbourhood

#: Seed of the flights that maps are learned from; evaluations use other seeds.
LEARNING_SEED = 20020708
#: Share of a joint's speed that l_c^-1 may ask of an arm that says where it wants its balls; a
#: choice of this project.
FASTEST_SHARE = 3.0


def learn(
    arm: Arm,
    *,
    design: MapDesign | None = None,
    flights: Sequence[Flight] | None = None,
    seed: int = LEARNING_SEED,
    around: Neighbourhood | None = None,
    settings: LearnSettings | None = None,
) -> Learned:
    """Learn a map for an arm, eq. (22).

    Args:
        arm: The arm.
        design: Catch joint, its angle, kappa and order; the paper's for the WAM if left out.
        flights: Flights to learn from; a neighbourhood of default throws if left out.
        seed: Seed of that neighbourhood.
        around: Its settings.
        settings: How to learn.

    Returns:
        The map (``.map``) and the cost at each step (``.steps``).
    """
    checks.instance("arm", arm, Arm)
    seed = checks.whole("seed", seed, least=0)
    design = default_design(arm) if design is None else checks.instance("design", design, MapDesign)
    if flights is not None and not isinstance(flights, Sequence):
        raise InputError("flights", "a sequence of flights", checks.shown(flights))
    for name, value, kind in (
        ("around", around, Neighbourhood),
        ("settings", settings, LearnSettings),
    ):
        if value is not None:
            checks.instance(name, value, kind)
    around = around or Neighbourhood()
    if arm.model.aim is not None and not np.isfinite(around.max_speed_share):
        around = replace(around, max_speed_share=FASTEST_SHARE)
    if flights is None:
        start = unlearned(arm, design)
        flights = neighbourhood(start, np.random.default_rng(seed), around)
    for flight in flights:
        checks.instance("flights", flight, Flight)
    return learn_from(arm, design, flights, settings=settings)


def learn_several(first: DirectMap) -> Several:
    """Return a choice among a map and those of the further designs for its arm and limits.

    In order of preference, the gentlest first; a map that is one of them already stands once.
    """
    before, after = further_designs(first.arm)
    weight = first.design.match_weight
    before, after = (tuple(replace(x, match_weight=weight) for x in y) for y in (before, after))
    maps = [learn(first.arm, design=x).map for x in (*before, *after) if x != first.design]
    count = sum(x != first.design for x in before)
    return Several(tuple(Direct(f) for f in (*maps[:count], first, *maps[count:])))
