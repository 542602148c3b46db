"""Randomness of a plan: a stream for each entry, so that none disturbs another or the trial."""

from collections.abc import Iterator
from typing import TypeVar

import numpy as np

from mitt.signals import Array
from mitt.world.faults.plan import Fault

#: Key of the streams of faults beside those of plant and sensors.
_FAULTS = 0xFA17

_Kind = TypeVar("_Kind")


def drawn(plan: tuple[Fault, ...], seed: int) -> Iterator[tuple[Fault, np.random.Generator]]:
    """Yield all entries, each with its own source of randomness.

    Args:
        plan: All entries.
        seed: Seed of the trial.
    """
    for number, fault in enumerate(plan):
        yield fault, np.random.default_rng([_FAULTS, number, seed])


def of_kind(
    plan: tuple[Fault, ...], seed: int, kind: type[_Kind]
) -> list[tuple[_Kind, np.random.Generator]]:
    """Return the entries of one kind, each with its own source of randomness."""
    return [(fault, rng) for fault, rng in drawn(plan, seed) if isinstance(fault, kind)]


def direction(rng: np.random.Generator) -> Array:
    """Return a unit vector of any direction, shape (3,)."""
    v = rng.standard_normal(3)
    return np.asarray(v / np.linalg.norm(v))
