"""Randomness of a plan: a stream for each entry, so that none disturbs another or the trial."""

from collections.abc import Iterator

import numpy as np

from mitt.signals import Array
from mitt.world.faults.plan import Fault

#: First key of the random streams of faults, which plant and sensors do not use.
_FAULTS = 0xFA17


def drawn(plan: tuple[Fault, ...], seed: int) -> Iterator[tuple[Fault, np.random.Generator]]:
    """Yield all entries of a trial's plan, each with its own source of randomness."""
    for number, fault in enumerate(plan):
        yield fault, np.random.default_rng([_FAULTS, number, seed])


def direction(rng: np.random.Generator) -> Array:
    """Return a unit vector of any direction, shape (3,)."""
    v = rng.standard_normal(3)
    return np.asarray(v / np.linalg.norm(v))
