"""The wheel holds all that an installed mitt needs, and says the truth about itself."""

import re
import subprocess
import sys
from email import message_from_string
from email.message import Message
from pathlib import Path
from zipfile import ZipFile

import pytest

import mitt

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> ZipFile:
    """Return the wheel, as ``benchmarks/wheels.py`` builds it."""
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, str(ROOT / "benchmarks" / "wheels.py"), "--build", str(folder)]
    made = subprocess.run(command, capture_output=True, text=True, check=False)
    assert made.returncode == 0, made.stderr
    (path,) = folder.glob("*.whl")
    return ZipFile(path)


@pytest.fixture(scope="module")
def said(wheel: ZipFile) -> Message:
    """Return the wheel's metadata."""
    (name,) = (x for x in wheel.namelist() if x.endswith(".dist-info/METADATA"))
    return message_from_string(wheel.read(name).decode())


def test_the_wheel_has_every_file_of_the_package_and_no_other(wheel: ZipFile) -> None:
    """Modules, arms, pages, scenes, limits, cells, studies, flights and ``py.typed``."""
    source = ROOT / "src"
    files = {
        path.relative_to(source).as_posix()
        for path in (source / "mitt").rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    packed = {name for name in wheel.namelist() if ".dist-info/" not in name}
    assert packed == files
    assert "mitt/py.typed" in packed
    kinds = {name.split("/")[2] for name in packed if name.startswith("mitt/data/")}
    folders = {
        "arms",
        "cells",
        "designs",
        "flights",
        "layouts",
        "limits",
        "pages",
        "scenes",
        "studies",
    }
    assert kinds == folders | {"arms.toml", "figures.json"}


def test_the_metadata_are_those_of_mitt(said: Message) -> None:
    """Version, command, licences with their texts, and the Pythons that were tried."""
    assert said["Version"] == mitt.__version__
    assert said["License-Expression"] == "Apache-2.0 AND BSD-3-Clause"
    texts = said.get_all("License-File") or []
    assert {Path(name).parent.as_posix() for name in texts} == {".", "src/mitt/data/flights"}
    assert said["Requires-Python"] == ">=3.11"
    pythons = re.findall(r"Python :: (3\.\d+)", "\n".join(said.get_all("Classifier") or []))
    assert pythons == ["3.11", "3.12", "3.13"]


def test_the_command_and_the_licences_are_in_the_wheel(wheel: ZipFile) -> None:
    """``mitt`` starts ``mitt.cli.main:main``; both licences are there to be read."""
    about = {Path(name).name: name for name in wheel.namelist() if ".dist-info/" in name}
    assert "mitt = mitt.cli.main:main" in wheel.read(about["entry_points.txt"]).decode()
    texts = [wheel.read(x).decode() for x in wheel.namelist() if "/licenses/" in x]
    assert len(texts) == 2
    assert sum("Apache License" in text for text in texts) == 1
    assert sum("Redistribution and use" in text for text in texts) == 1


def test_every_package_that_is_needed_has_a_pinned_version(said: Message) -> None:
    """The default install and every extra: a Makefile that pins half of them pins nothing."""
    pins = (ROOT / "constraints.txt").read_text(encoding="utf-8")
    pinned = {name.lower().replace("_", "-") for name in re.findall(r"^([\w.-]+)==", pins, re.M)}
    needed = {re.split(r"[\[<>=; ]", x)[0].lower() for x in said.get_all("Requires-Dist") or []}
    assert {x.replace("_", "-") for x in needed} - {"mitt"} <= pinned
    assert {"numpy", "sphinx"} <= needed
