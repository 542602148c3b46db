"""The generators by name: those that ship, and those of other packages.

A package adds one by an entry point of the group ``mitt.generators`` that names a function from
a :class:`DirectMap` (it knows the arm) to a :class:`Generator`. A built-in name cannot be taken.
"""

from collections.abc import Callable
from importlib.metadata import EntryPoint, entry_points

from mitt.errors import InputError, UnknownNameError
from mitt.generator.generators import Direct, Generator, Unoptimised
from mitt.generator.mapping import DirectMap, unlearned
from mitt.rivals.clairvoyant import make_clairvoyant
from mitt.rivals.ds import make_ds
from mitt.rivals.ik import make_ik
from mitt.rivals.mpc import make_mpc
from mitt.rivals.quintic import make_quintic
from mitt.rivals.ruckig import make_ruckig
from mitt.trials.external import Added, answered_by
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
    with answered_by(name):
        generator = factory(f)
    ours = type(generator).__module__.startswith("mitt.")
    return generator if ours else Added(name, generator)


def _added() -> dict[str, EntryPoint]:
    """Return the entry points of other packages by name."""
    return {entry.name: entry for entry in entry_points(group=GROUP)}
