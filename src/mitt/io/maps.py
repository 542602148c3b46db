"""Learned maps on disk: JSON with a schema, a version, the arm's numbers and a checksum."""

import re
from dataclasses import asdict
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field

from mitt.core import checks
from mitt.core.arm.arm import Arm, difference, identity_of
from mitt.core.errors import FileError, InputError, MittError
from mitt.core.map.learn import Learned, Step
from mitt.core.map.map_design import MapDesign, tangent_of
from mitt.core.map.mapping import DirectMap, basis_of
from mitt.io.reading import read_json
from mitt.io.schema import FileSection, Finite, from_plain, parsed
from mitt.io.writing import json_digest, write_json
from mitt.version import __version__

SCHEMA = "mitt.map/2"

_AGAIN = "learn it again with mitt learn"


class _MapFile(FileSection):
    """Content of a map file; ``checksum`` covers all the rest."""

    schema_name: Literal["mitt.map/2"] = Field(alias="schema")
    version: str
    arm: str
    limits: str
    joints: list[str]
    identity: dict[str, list[Finite | None]]
    design: dict[str, Any]
    centre: list[Finite]
    scale: list[Finite]
    alpha: list[list[Finite]]
    H: list[list[Finite]]
    region: list[list[Finite]]
    steps: list[dict[str, Any]]
    flights: int
    left_out: int
    status: str
    checksum: str


def save_map(path: Path, learned: Learned, *, version: str = __version__) -> None:
    """Write a learned map.

    Args:
        path: The file; one that is there is replaced.
        learned: What :func:`mitt.learn` returned.
        version: Version of mitt that the file says it was written by, this one if left out;
            :func:`read_map` refuses maps of later versions.

    Raises:
        InputError: Nothing was learned, or an argument is not what it should be.
        FileError: The file cannot be written.
    """
    learned = checks.instance("learned", learned, Learned)
    if not np.all(np.isfinite(learned.map.region)):
        raise InputError("learned", "a map that was learned from flights", "one that was not")
    write_json(path, map_content(learned, version=checks.text("version", version)))


def map_content(learned: Learned, *, version: str) -> dict[str, object]:
    """Return what the file of a learned map says."""
    f = learned.map
    content: dict[str, object] = {
        "schema": SCHEMA,
        "version": version,
        "arm": f.arm.model.name,
        "limits": f.arm.limits.name,
        "joints": list(f.arm.names),
        "identity": identity_of(f.arm),
        "design": asdict(f.design),
        "centre": f.basis.centre.tolist(),
        "scale": f.basis.scale.tolist(),
        "alpha": f.alpha.tolist(),
        "H": f.H.tolist(),
        "region": f.region.tolist(),
        "steps": [asdict(step) for step in learned.steps],
        "flights": learned.flights,
        "left_out": learned.left_out,
        "status": learned.status,
    }
    return content | {"checksum": json_digest(content)}


def read_map(path: str | Path, arm: Arm) -> Learned:
    """Return a learned map for an arm.

    Raises:
        FileError: The file is missing, cut short, altered, of another schema or of a later
            version, or was learned for another arm or other limits.
    """
    path, arm = checks.path("path", path), checks.instance("arm", arm, Arm)
    return map_from(read_json(path), arm, place=str(path))


def map_from(raw: Any, arm: Arm, *, place: str) -> Learned:  # noqa: ANN401 (any JSON value)
    """Return a learned map for an arm from what its file says.

    Args:
        raw: Content of the file.
        arm: The arm.
        place: What an error calls the file.

    Raises:
        FileError: As for :func:`read_map`.
    """
    content = parsed(_MapFile, raw, place=place, wanted=f"a map of schema {SCHEMA}", do=_AGAIN)
    stated = {key: value for key, value in raw.items() if key != "checksum"}
    if json_digest(stated) != content.checksum:
        raise FileError(place, "a map that matches its checksum", "one that was altered", do=_AGAIN)
    if not _is_known(content.version):
        raise FileError(
            f"{place} key 'version'",
            f"a map of mitt {__version__} or before",
            repr(content.version[:20]),
            do=_AGAIN,
        )
    mine = (arm.model.name, arm.limits.name, list(arm.names))
    given = (content.arm, content.limits, content.joints)
    if mine != given:
        wanted, other = ("arm {}, limits {}, joints {}".format(*x) for x in (mine, given))
        raise FileError(place, f"a map for {wanted}", f"one for {other}")
    unlike = difference(identity_of(arm), content.identity)
    if unlike is not None:
        raise FileError(
            place,
            f"a map for this arm {arm.model.name}",
            f"one for another of that name: {unlike}",
            do=_AGAIN,
        )
    return _learned(place, content, arm)


def _learned(place: str, content: _MapFile, arm: Arm) -> Learned:
    """Build the map from a file's content."""
    try:
        design = from_plain(MapDesign, content.design, place="design")
        basis = basis_of(design, np.array(content.centre), np.array(content.scale))
        alpha, H, region = map(np.array, (content.alpha, content.H, content.region))
        f = DirectMap(arm=arm, design=design, basis=basis, alpha=alpha, H=H, region=region)
        tangent_of(arm, design)
        np.linalg.cholesky(f.H)
        steps = tuple(from_plain(Step, x, place="a step") for x in content.steps)
    except (MittError, ValueError, np.linalg.LinAlgError) as error:
        raise FileError(place, "a map that fits together", error) from error
    return Learned(
        map=f,
        maps=(f,),
        steps=steps,
        flights=content.flights,
        left_out=content.left_out,
        status=content.status,
    )


def _is_known(version: str) -> bool:
    """Say whether a version is this program's or an earlier one."""
    mine, given = (re.findall(r"\d+", text)[:3] for text in (__version__, version))
    plain = re.match(r"\d", version) is not None and all(len(x) < 9 for x in given)
    return plain and [int(x) for x in given] <= [int(x) for x in mine]
