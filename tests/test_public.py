"""The public names: few, importable, and light until they are used."""

import json
import subprocess
import sys
from importlib import import_module

import pytest

import mitt

PROMISED = {
    "load_arm",
    "DirectMap",
    "learn",
    "Catcher",
    "simulate",
    "BallState",
    "JointReference",
    "MittError",
    "Eyes",
    "Senses",
    "Scene",
    "Generator",
    "Direct",
    "BallFilter",
}
MOST = 25
HEAVY = ("numpy", "mujoco", "numba", "pinocchio", "matplotlib", "viser", "ruckig", "pydantic")


def loaded_by(code: str) -> list[str]:
    """Return which heavy packages a fresh interpreter has loaded after running code."""
    asked = f"{code}; import sys, json; print(json.dumps([x for x in {HEAVY} if x in sys.modules]))"
    out = subprocess.run(
        [sys.executable, "-c", asked], capture_output=True, text=True, check=True, timeout=120
    )
    found: list[str] = json.loads(out.stdout)
    return found


def test_the_promised_names_are_there_and_few() -> None:
    """The contract's names are public, and no more than 25 in all."""
    assert set(mitt.__all__) >= PROMISED
    assert len(mitt.__all__) <= MOST
    assert len(set(mitt.__all__)) == len(mitt.__all__)
    assert set(dir(mitt)) == set(mitt.__all__)


@pytest.mark.parametrize("name", mitt.__all__)
def test_every_public_name_is_found_and_documented(name: str) -> None:
    """Each name leads to an object with a docstring, the version to a string."""
    value = vars(mitt).get(name) or mitt.__getattr__(name)
    assert isinstance(value, str) if name == "__version__" else value.__doc__


def test_an_unknown_name_is_an_attribute_error() -> None:
    """As of any other module, so that hasattr and tools work."""
    with pytest.raises(AttributeError, match="nothing"):
        mitt.__getattr__("nothing")


def test_importing_mitt_loads_nothing_heavy() -> None:
    """``import mitt`` alone brings in neither NumPy nor a simulator."""
    assert loaded_by("import mitt") == []


def test_what_flows_needs_numpy_alone() -> None:
    """BallState and its like bring in NumPy and no more."""
    assert loaded_by("import mitt; mitt.BallState") == ["numpy"]


def test_every_module_can_be_imported_first() -> None:
    """No cycle hides in the imports: the homes of all names load on their own."""
    for name in (
        "mitt.core.errors",
        "mitt.core.signals",
        "mitt.cli.options",
        "mitt.cli",
        "mitt.core.catcher.catcher",
    ):
        assert import_module(name).__doc__
