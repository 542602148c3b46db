"""The generators by name: those that ship, and those of other packages.

A package adds one by an entry point of the group ``mitt.generators`` that names a function from
a :class:`DirectMap` (it knows the arm) to a :class:`Generator`. A built-in name cannot be taken.
"""

import hashlib
import sys
from collections.abc import Callable
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path

from mitt.core import checks
from mitt.core.catcher.family import direct
from mitt.core.catcher.generators import Direct, Generator, Unoptimised
from mitt.core.catcher.given import added, map_of
from mitt.core.errors import InputError, UnknownNameError, answered_by, check_package
from mitt.core.map.mapping import DirectMap, unlearned
from mitt.lab.rivals.clairvoyant import make_clairvoyant
from mitt.lab.rivals.mpc import make_mpc
from mitt.lab.rivals.planned import budgeted, make_quintic, make_ruckig
from mitt.lab.rivals.servo import make_ds, make_ik

#: Makes a generator for the arm of a learned map.
Factory = Callable[[DirectMap], Generator]

#: Group of the entry points.
GROUP = "mitt.generators"


#: Generators that ship.
BUILT_IN: dict[str, Factory] = {
    "direct": direct,
    "single": Direct,
    "unoptimised": lambda f: Unoptimised(unlearned(f.arm, f.design)),  # alpha = 0
    "ik": make_ik,
    "quintic": make_quintic,
    "quintic-100hz": budgeted(100.0),
    "quintic-30hz": budgeted(30.0),
    "quintic-10hz": budgeted(10.0),
    "ruckig": make_ruckig,
    "mpc": make_mpc,
    "ds": make_ds,
    "clairvoyant": make_clairvoyant,
}


def available() -> tuple[str, ...]:
    """Return the names of all generators, those that ship first."""
    return (*BUILT_IN, *sorted(set(_added()) - set(BUILT_IN)))


def make_generator(name: str, f: DirectMap) -> Generator:
    """Return a generator by name, for the arm of a learned map.

    Raises:
        UnknownNameError: No generator is called that.
        InputError: The entry point of another package does not load, or it raises an error.
    """
    factory = factory_of(name)
    if name in BUILT_IN:
        return factory(f)
    with answered_by(f"generator {name!r}"):
        generator = factory(f)
    return generator if _is_map(generator) else added(f"generator {name!r}", generator, f.arm.n)


def factory_of(name: str) -> Factory:
    """Return what makes a generator, by its name; a package that adds it is loaded.

    Raises:
        UnknownNameError: No generator is called that.
        InputError: Two packages add it, or the entry point does not load.
    """
    if name in BUILT_IN:
        return BUILT_IN[name]
    if name not in _added():
        raise UnknownNameError("--generator", name, available())
    entry, where = _added()[name], f"generator {name!r}"
    places = sorted({x.value for x in entry_points(group=GROUP) if x.name == name})
    if len(places) > 1:
        raise InputError(
            where,
            "one package that adds it",
            " and ".join(places),
            do="uninstall one of the packages",
        )
    try:
        factory: Factory = entry.load()
    except (ImportError, AttributeError) as error:
        wanted = f"the entry point {entry.value} to load"
        raise InputError(where, wanted, error, do="repair that package") from error
    if not callable(factory):
        wanted = f"a function of a map in the entry point {entry.value}"
        raise InputError(where, wanted, checks.shown(factory), do="repair that package")
    return factory


def check_generator(name: str) -> None:
    """Refuse a generator that is not there, or whose package is not.

    Raises:
        UnknownNameError: No generator is called that.
        InputError: Its entry point does not load, or a package that it needs is not installed.
    """
    factory_of(name)
    if name == "clairvoyant":
        check_package("generator clairvoyant", "casadi", "CasADi", "rivals")


def origin_of(name: str) -> str:
    """Return package, version and digest of the sources of a generator of another package.

    The sources are the Python files of the package that the entry point names. Nothing is returned
    for a generator that ships.

    Raises:
        UnknownNameError: No generator is called that.
        InputError: The entry point does not load.
    """
    factory_of(name)
    if name in BUILT_IN:
        return ""
    entry = _added()[name]
    module = sys.modules[entry.module.partition(".")[0]]
    place = Path(getattr(module, "__file__", None) or "none")
    sources = sorted(place.parent.rglob("*.py")) if place.stem == "__init__" else [place]
    digest = hashlib.sha256(b"".join(x.read_bytes() for x in sources if x.is_file())).hexdigest()
    package = "" if entry.dist is None else f"{entry.dist.name} {entry.dist.version}, "
    return f"{package}sources {digest[:16]}"


def _is_map(generator: Generator) -> bool:
    """Say whether a generator is a map of ours, which runs none of its package's code."""
    return type(generator).__module__.startswith("mitt.") and map_of(generator) is not None


def _added() -> dict[str, EntryPoint]:
    """Return the entry points of other packages by name."""
    return {entry.name: entry for entry in entry_points(group=GROUP)}
