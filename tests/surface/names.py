"""What is public, found by looking: nothing is listed here that could be forgotten.

Public are the names of ``mitt.__all__`` and ``mitt.gym.__all__``, what docs/api.md names, and every
function of the package that reads a file by its path.
"""

import inspect
import pkgutil
import re
from collections.abc import Callable, Iterator
from enum import Enum
from importlib import import_module
from pathlib import Path
from typing import Any

import mitt
import mitt.gym

ROOT = Path(__file__).parents[2]
_DIRECTIVE = re.compile(r"auto(function|class|module):: (\S+)\n(?:[ ]+:members:[ ]*(.*))?")
_READER = re.compile(r"^(read|open|load)_")
#: Packages whose readers take files of users.
_READERS = ("io", "robot.cameras", "lab.trials", "lab.world")
#: Methods that the planner alone calls, with what it knows of a verdict so far.
_BY_THE_PLANNER = frozenset(("consider",))


def of_the_page() -> dict[str, Any]:
    """Return what docs/api.md names, by its name."""
    found: dict[str, Any] = {}
    for kind, path, members in _DIRECTIVE.findall((ROOT / "docs" / "api.md").read_text()):
        if kind == "module":
            home = import_module(path)
            named = [x.strip() for x in members.split(",") if x.strip()]
            own = [x for x, v in vars(home).items() if getattr(v, "__module__", "") == path]
            found |= {x: vars(home)[x] for x in named or own if not x.startswith("_")}
        else:
            place, name = path.rsplit(".", 1)
            found[name] = vars(import_module(place))[name]
    return found


def readers() -> dict[str, tuple[Callable[..., Any], str]]:
    """Return the functions that read a file, by module and name, with the name of its path."""
    found: dict[str, tuple[Callable[..., Any], str]] = {}
    for package in _READERS:
        home = import_module(f"mitt.{package}")
        for place in pkgutil.walk_packages(home.__path__, f"mitt.{package}."):
            if place.name == "mitt.io.reading":  # takes any file: those of formats read by it
                continue
            for name, value in vars(import_module(place.name)).items():
                if not (inspect.isfunction(value) and _READER.match(name)):
                    continue
                first = next(iter(inspect.signature(value).parameters.values()), None)
                if value.__module__ == place.name and first and "Path" in str(first.annotation):
                    found[f"{place.name.removeprefix('mitt.')}.{name}"] = value, first.name
    return found


def public() -> dict[str, Any]:
    """Return all functions and classes that users call, by their names."""
    top = {name: getattr(mitt, name) for name in mitt.__all__ if name != "__version__"}
    gym = {f"gym.{name}": getattr(mitt.gym, name) for name in mitt.gym.__all__}
    return of_the_page() | top | gym


def callables() -> Iterator[tuple[str, list[inspect.Parameter]]]:
    """Yield every public function, constructor and method that takes something, with what.

    Of a reader that is not public by name only its path is.

    A protocol is what somebody else implements, an enumeration and an error are what mitt hands
    out: they are left out here, and what implements a protocol is held to it elsewhere.
    """
    for name, value in public().items():
        if not inspect.isclass(value):
            if taken := list(inspect.signature(value).parameters.values()):
                yield name, taken
            continue
        if issubclass(value, Enum | Exception) or getattr(value, "_is_protocol", False):
            continue
        if taken := list(inspect.signature(value).parameters.values()):
            yield name, taken
        for method, function in inspect.getmembers(value, inspect.isfunction):
            own = function.__module__.startswith("mitt.")
            taken = list(inspect.signature(function).parameters.values())[1:]
            if own and taken and not method.startswith("_") and method not in _BY_THE_PLANNER:
                yield f"{name}.{method}", taken
    for name, (reader, path) in readers().items():
        yield name, [inspect.signature(reader).parameters[path]]
