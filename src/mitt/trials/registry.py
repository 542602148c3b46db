"""The generators by name: those that ship, and those of other packages.

A package adds one by an entry point of the group ``mitt.generators`` that names a function from
a :class:`DirectMap` (it knows the arm) to a :class:`Generator`. A built-in name cannot be taken.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from typing import final

from mitt.baselines.clairvoyant import make_clairvoyant
from mitt.baselines.ds import make_ds
from mitt.baselines.ik import make_ik
from mitt.baselines.mpc import make_mpc
from mitt.baselines.quintic import make_quintic
from mitt.baselines.ruckig import make_ruckig
from mitt.errors import InputError, MittError, UnknownNameError
from mitt.generator.feasibility import Verdict
from mitt.generator.generators import Direct, Generator, Unoptimised
from mitt.generator.mapping import DirectMap, unlearned
from mitt.signals import Array, BallState, JointReference
from mitt.trials.learning import learn_several

#: Makes a generator for the arm of a learned map.
Factory = Callable[[DirectMap], Generator]

#: Group of the entry points.
GROUP = "mitt.generators"


def make_unoptimised(f: DirectMap) -> Generator:
    """Return the map with alpha = 0."""
    return Unoptimised(unlearned(f.arm, f.design))


#: Generators that ship.
BUILT_IN: dict[str, Factory] = {
    "direct": Direct,
    "several": learn_several,
    "unoptimised": make_unoptimised,
    "ik": make_ik,
    "quintic": make_quintic,
    "ruckig": make_ruckig,
    "mpc": make_mpc,
    "ds": make_ds,
    "clairvoyant": make_clairvoyant,
}


def available() -> tuple[str, ...]:
    """Return the names of all generators, those that ship first."""
    return (*BUILT_IN, *sorted(set(_added()) - set(BUILT_IN)))


def check_name(name: str) -> None:
    """Refuse a name that no generator has."""
    if name not in BUILT_IN and name not in _added():
        raise UnknownNameError("--generator", name, available())


def make_generator(name: str, f: DirectMap) -> Generator:
    """Return a generator by name.

    Args:
        name: Its name.
        f: A learned map; it knows the arm.

    Raises:
        UnknownNameError: No generator is called that.
        InputError: The entry point of another package does not load, or it raises an error.
    """
    check_name(name)
    if name in BUILT_IN:
        return BUILT_IN[name](f)
    entry = _added()[name]
    try:
        factory: Factory = entry.load()
    except (ImportError, AttributeError) as error:
        wanted = f"the entry point {entry.value} to load"
        raise InputError(f"generator {name!r}", wanted, error, do="repair that package") from error
    with _answered_by(name):
        generator = factory(f)
    ours = type(generator).__module__.startswith("mitt.")
    return generator if ours else _Added(name, generator)


def _added() -> dict[str, EntryPoint]:
    """Return the entry points of other packages by name."""
    return {entry.name: entry for entry in entry_points(group=GROUP)}


@contextmanager
def _answered_by(name: str) -> Iterator[None]:
    """Raise any exception of the block as an InputError of the package that adds a generator."""
    try:
        yield
    except MittError:
        raise
    except Exception as error:
        given = f"{type(error).__name__}: {error}"[:200]
        raise InputError(f"generator {name!r}", "an answer of the package that adds it", given,
                         do="repair that package") from error  # fmt: skip


@final
@dataclass(frozen=True, slots=True)
class _Added:
    """A generator of another package: the same calls, its exceptions named after it."""

    name: str
    inner: Generator

    def sharpness(self, ball: BallState) -> float:
        with _answered_by(self.name):
            return self.inner.sharpness(ball)

    def verdict(self, ball: BallState, q: Array) -> Verdict:
        with _answered_by(self.name):
            return self.inner.verdict(ball, q)

    def unsettled(self, ball: BallState, q: Array) -> bool:
        with _answered_by(self.name):
            return self.inner.unsettled(ball, q)

    def returns(self, ball: BallState) -> bool:
        with _answered_by(self.name):
            return self.inner.returns(ball)

    def waiting(self, ball: BallState) -> BallState:
        with _answered_by(self.name):
            return self.inner.waiting(ball)

    def adapt(self, ball: BallState, q: Array, dq: Array) -> "_Added":
        with _answered_by(self.name):
            return _Added(self.name, self.inner.adapt(ball, q, dq))

    def reference(self, ball: BallState) -> JointReference:
        with _answered_by(self.name):
            return self.inner.reference(ball)

    def as_map(self) -> DirectMap | None:
        with _answered_by(self.name):
            return self.inner.as_map()
