"""URDF files: links and joints as a tree of parts, and the limits beside.

What has no meaning is passed over, as the axis of a fixed joint; a continuous joint turns once
about zero; a limit that is missing is asked for by name once it is needed. The schema of URDF: the
ROS wiki, pages urdf/XML/joint and urdf/XML/link. The rotor of a drive, of which URDF says nothing,
is read as Drake's parsers read it: ``drake:rotor_inertia`` and ``drake:gear_ratio`` of an actuator.
"""

from collections.abc import Iterator
from math import hypot, inf, isfinite, isnan, pi
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element

import numpy as np

from mitt.core import checks
from mitt.core.arm.description import roll_pitch_yaw, transform
from mitt.core.errors import FileError, ModelError
from mitt.core.signals import Array
from mitt.io.description_files import (
    LINK,
    WORLD,
    Kind,
    KinematicPart,
    LeftOut,
    Mimic,
    Stated,
    Tree,
    number_of,
    numbers_of,
    read_xml,
)
from mitt.io.meshes import urdf_shapes

#: Joints that move, with a range that the file has to state or not.
_MOVING: dict[str, Kind] = {"revolute": "hinge", "continuous": "hinge", "prismatic": "slide"}
_TYPES = (*_MOVING, "fixed", "floating", "planar")
#: Elements of an actuator: inertia of its rotor [kg m^2], and its turns for one of the joint.
_ROTOR, _GEARS = (f"{{http://drake.mit.edu}}{x}" for x in ("rotor_inertia", "gear_ratio"))
_KEYS_OF = {
    "range": "<limit> lower and upper",
    "torque": "<limit> effort",
    "speed": "<limit> velocity",
    "mass": "<inertial> of the child link",
}


def read_urdf(path: Path) -> Stated:
    """Read a URDF file.

    Raises:
        FileError: It cannot be read or parsed, has two roots, a closed chain or a joint of more
            than one degree of freedom.
    """
    path = checks.path("arm", path)
    _, root = read_xml(path, "robot")
    _check_numbers(path, root)
    joints = root.findall("joint")
    _check_tree(path, root, joints)
    left_out = _left_out(root, joints)
    limits = _limits(path, joints)
    mimics = dict(_mimics(path, joints))
    shapes, notes = urdf_shapes(path, root)
    return Stated(
        place=str(path),
        tree=_tree(path, root, joints),
        mimics=mimics,
        shapes=shapes,
        notes=(*notes, *_turned(root)),
        keys=_KEYS_OF,
        left_out=left_out,
        **limits._asdict(),
    )


def _check_tree(path: Path, root: Element, joints: list[Element]) -> None:
    """Refuse two roots, closed chains, and joints that are no tree."""
    links = [x.get("name", "") for x in root.findall("link")]
    if not links:
        raise FileError(str(path), "a URDF arm with links", "none", do="export it again")
    for kind, names in (("link", links), ("joint", [x.get("name", "") for x in joints])):
        if "" in names:
            raise FileError(str(path), f"{kind}s with names", "one without")
        twice = next((x for k, x in enumerate(names) if x in names[:k]), None)
        if twice is not None:
            raise FileError(
                str(path),
                f"{kind}s with names of their own",
                f"two {twice!r}",
                do="rename one of them",
            )
    above: dict[str, str] = {}
    for joint in joints:
        name, child = joint.get("name", ""), _link_of(joint, "child")
        if joint.get("type") not in _TYPES:
            raise FileError(
                f"{path} joint {name!r}",
                f"one of the types {', '.join(_TYPES)}",
                repr(joint.get("type", "")),
            )
        for end in ("parent", "child"):
            if _link_of(joint, end) not in links:
                raise FileError(
                    f"{path} joint {name!r}",
                    f"a link of the file as its {end}",
                    repr(_link_of(joint, end)),
                )
        if child in above:
            raise FileError(
                str(path),
                "an arm without closed chains",
                f"link {child!r} behind joints {above[child]!r} and {name!r}",
                do="take one of them out",
            )
        above[child] = name
    roots = [name for name in links if name not in above]
    if len(roots) > 1:
        raise FileError(
            str(path),
            "one root link",
            f"{len(roots)}: {', '.join(roots[:4])}",
            do="join them by a fixed joint",
        )
    if links and not roots:
        raise FileError(
            str(path),
            "an arm without closed chains",
            "no root link",
            do="take out the joint that closes the chain",
        )


def _link_of(joint: Element, end: str) -> str:
    """Return the name of the link at an end of a joint."""
    element = joint.find(end)
    return "" if element is None else element.get("link", "")


def _tree(path: Path, root: Element, joints: list[Element]) -> Tree:
    """Return links and joints, each subtree as a whole, joints at a link by their names."""
    names = {x.get("name", "") for x in joints}
    links = {x.get("name", ""): x for x in root.findall("link")}
    behind: dict[str, list[Element]] = {name: [] for name in links}
    for joint in sorted(joints, key=lambda x: x.get("name", "")):
        behind[_link_of(joint, "parent")].append(joint)
    children = {_link_of(joint, "child") for joint in joints}
    rotors = _rotors(root)
    parts = [KinematicPart(name=WORLD, kind="world")]
    pending: list[tuple[int, Element]] = []

    def add_link(name: str) -> None:
        called = name + LINK if name in names else name
        parts.append(
            KinematicPart(name=called, kind="link", before=len(parts) - 1, **_inertial(links[name]))
        )
        pending.extend((len(parts) - 1, joint) for joint in reversed(behind[name]))

    add_link(next(name for name in links if name not in children))
    while pending:
        before, joint = pending.pop()
        kind = _MOVING.get(joint.get("type", ""), "fixed")
        axis = np.zeros(3) if kind == "fixed" else _axis(path, joint)
        name = joint.get("name", "")
        parts.append(
            KinematicPart(
                name=name,
                kind=kind,
                before=before,
                placement=_origin(joint),
                axis=axis,
                armature=0.0 if kind == "fixed" else rotors.get(name, 0.0),
            )
        )
        add_link(_link_of(joint, "child"))
    return Tree(parts)


def _rotors(root: Element) -> dict[str, float]:
    """Return the inertias of rotors as seen from their joints [kg m^2]."""
    return {
        joint.get("name", ""): float(rotor.get("value", "0")) * _ratio(actuator) * _ratio(actuator)
        for transmission in root.iter("transmission")
        for joint in transmission.findall("joint")
        for actuator in transmission.findall("actuator")
        for rotor in actuator.findall(_ROTOR)
    }


def _ratio(actuator: Element) -> float:
    """Return how often a rotor turns while its joint turns once; 1 where nothing is said."""
    gears = actuator.find(_GEARS)
    return 1.0 if gears is None else float(gears.get("value", "1"))


def _origin(element: Element) -> Array:
    """Return the frame that an element's origin says, shape (4, 4)."""
    origin = element.find("origin")
    R = roll_pitch_yaw(numbers_of(origin, "rpy", 3, "0 0 0"))
    return transform(R, numbers_of(origin, "xyz", 3, "0 0 0"))


def _inertial(link: Element) -> dict[str, Any]:
    """Return mass, centre of mass and inertia of a link as fields; none where it does not say."""
    inertial = link.find("inertial")
    mass, moments = (None if inertial is None else inertial.find(x) for x in ("mass", "inertia"))
    if inertial is None or mass is None or moments is None or "value" not in mass.attrib:
        return {}
    if not all(key in moments.attrib for key in _MOMENTS):
        return {}
    xx, xy, xz, yy, yz, zz = (float(moments.get(key, "0")) for key in _MOMENTS)
    T, own = _origin(inertial), np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return {
        "mass": float(mass.get("value", "0")),
        "com": T[:3, 3],
        "inertia": T[:3, :3] @ own @ T[:3, :3].T,
    }


def _axis(path: Path, joint: Element) -> Array:
    """Return the unit axis of a joint, shape (3,); refuse one without a direction."""
    axis = joint.find("axis")
    given = "1 0 0" if axis is None else axis.get("xyz", "1 0 0")
    direction = [number_of(x) for x in given.split()]
    size = hypot(*direction)
    if len(direction) != 3 or not 1e-6 < size < 1e6:
        do = "separate the numbers by spaces" if "," in given else ""
        raise FileError(str(path), "joint axes with a direction", repr(given[:60]), do=do)
    return np.array(direction) / size


_KEYS = ("lower", "upper", "effort", "velocity")


class _Limits(NamedTuple):
    """What joints state, by their names."""

    ranges: dict[str, tuple[float, float]]
    torque: dict[str, float]
    speed: dict[str, float]
    unusable: dict[str, str]  # in the place of a limit: 0, less, or no end


def _limits(path: Path, joints: list[Element]) -> _Limits:
    """Return the limits that joints state."""
    out = _Limits({}, {}, {}, {})
    for joint in joints:
        name, kind = joint.get("name", ""), joint.get("type", "")
        if kind in ("floating", "planar"):
            raise FileError(
                f"{path} joint {name!r}",
                "one axis, on a base that stands still",
                kind,
                do="make the joint fixed",
            )
        if kind not in _MOVING:
            continue
        limit = joint.find("limit")
        stated = (
            {}
            if limit is None
            else {key: _number(path, name, limit, key) for key in _KEYS if limit.get(key)}
        )
        if kind == "continuous":
            out.ranges[name] = (-pi, pi)
        elif "lower" in stated or "upper" in stated:
            ends = stated.get("lower", 0.0), stated.get("upper", 0.0)
            if all(map(isfinite, ends)):
                out.ranges[name] = ends
        for table, key in ((out.torque, "effort"), (out.speed, "velocity")):
            if 0.0 < stated.get(key, 0.0) < inf:
                table[name] = stated[key]
        odd = [
            key
            for key, x in stated.items()
            if not (isfinite(x) and (x > 0.0 or key in ("lower", "upper")))
        ]
        if limit is not None and odd:
            out.unusable[name] = ", ".join(f"{key} {limit.get(key, '')[:20]}" for key in odd)
    return out


def _left_out(root: Element, joints: list[Element]) -> dict[str, LeftOut]:
    """Return what is stated of joints and not counted."""
    geared = {
        joint.get("name", ""): reduction
        for transmission in root.iter("transmission")
        for joint in transmission.findall("joint")
        for reduction in transmission.findall(".//mechanicalReduction")
    }
    out = {}
    for joint in joints:
        name, others = joint.get("name", ""), []
        lost = {"damping": 0.0, "friction": 0.0}
        for dynamics in joint.findall("dynamics"):
            lost |= {key: abs(float(dynamics.get(key, "0"))) for key in lost}
            others += [f"{key} {x[:20]}" for key, x in dynamics.attrib.items() if key not in lost]
        limit = joint.find("limit")
        more = {} if limit is None else limit.attrib
        others += [f"{key} {x[:20]}" for key, x in more.items() if key not in _KEYS]
        others += ["safety_controller"] * (joint.find("safety_controller") is not None)
        ratio = "1" if name not in geared else (geared[name].text or "1").strip()
        others += [f"mechanicalReduction {ratio[:20]}"] * (number_of(ratio) != 1.0)
        out[name] = LeftOut(**lost, others=tuple(others))
    return out


def _turned(root: Element) -> Iterator[str]:
    """Yield a note of the first frame that is turned by more than one turn."""
    for part in root:
        for origin in part.iter("origin") if part.tag in ("link", "joint") else ():
            rpy = origin.get("rpy", "0")
            largest = max((abs(float(x)) for x in rpy.split()), default=0.0)
            if largest > 2.0 * pi + 0.01:  # rad, with room for rounding
                yield (
                    f"large angles: rpy {rpy[:60]!r} of {part.tag} {part.get('name', '')!r}; if"
                    " they are in degrees, write radians"
                )
                return


def _number(path: Path, joint: str, element: Element, key: str) -> float:
    """Return a number of an element, infinity included; refuse what is none."""
    given = element.get(key, "")
    value = number_of(given)
    if isnan(value):
        raise FileError(f"{path} joint {joint!r}", f"a number for {key}", repr(given[:60]))
    return value


def _mimics(path: Path, joints: list[Element]) -> Iterator[tuple[str, Mimic]]:
    """Yield joints that follow others; the model keeps all its joints."""
    for joint in joints:
        tag = joint.find("mimic")
        if tag is None:
            continue
        name, of = joint.get("name", ""), tag.get("joint")
        if of is None:
            raise FileError(str(path), "a URDF arm", f"joint {name!r}: no mimic joint specified")
        factors = [
            _number(path, name, tag, key) if tag.get(key) else default
            for key, default in (("multiplier", 1.0), ("offset", 0.0))
        ]
        yield name, Mimic(joint=of, multiplier=factors[0], offset=factors[1])


#: Numbers that attributes of a URDF hold, by the path of their element in a link or a joint.
_SHAPES = {
    "box": {"size": 3},
    "cylinder": {"radius": 1, "length": 1},
    "sphere": {"radius": 1},
    "capsule": {"radius": 1, "length": 1},
    "mesh": {"scale": 3},
}
_PLACE = {"xyz": 3, "rpy": 3}
_MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
_NUMBERS: dict[str, dict[str, dict[str, int]]] = {
    "link": {
        "inertial/mass": {"value": 1},
        "inertial/inertia": dict.fromkeys(_MOMENTS, 1),
        "inertial/origin": _PLACE,
        **{f"{x}/origin": _PLACE for x in ("visual", "collision")},
        **{
            f"{x}/geometry/{solid}": keys
            for x in ("visual", "collision")
            for solid, keys in _SHAPES.items()
        },
    },
    "joint": {
        "origin": _PLACE,
        "dynamics": {"damping": 1, "friction": 1},
    },
    "transmission": {f"actuator/{x}": {"value": 1} for x in (_ROTOR, _GEARS)},
}


def _check_numbers(path: Path, root: Element) -> None:
    """Refuse what is not as many numbers as it should be: parsers would take it as left out."""
    for part in root:
        for inner, keys in _NUMBERS.get(part.tag, {}).items():
            for element in part.findall(inner):
                for key, count in keys.items():
                    given = element.get(key)
                    finite = "geometry" not in inner  # sizes are looked at with the shapes
                    if given is not None and not _are_numbers(given, count, finite=finite):
                        name = element.tag.rpartition("}")[2]
                        _refuse(path, part, f"{name} {key}", given, count)
        for mass in part.findall("inertial/mass"):
            if float(mass.get("value", "0")) < 0.0:
                where = f"{path} link {part.get('name', '')!r}"
                raise ModelError(where, "a mass of at least 0 kg", mass.get("value", ""))


def _refuse(path: Path, part: Element, what: str, given: str, count: int) -> None:
    """Raise the error of an attribute."""
    wanted = f"a number for {what}" if count == 1 else f"{count} numbers for {what}"
    do = "separate them by spaces, with points for decimals" if "," in given else ""
    raise FileError(f"{path} {part.tag} {part.get('name', '')!r}", wanted, repr(given[:60]), do=do)


def _are_numbers(text: str, count: int, *, finite: bool) -> bool:
    """Say whether a text is so many numbers."""
    try:
        values = [float(x) for x in text.split()]
    except ValueError:
        return False
    known = "_" not in text and (not finite or all(isfinite(x) for x in values))
    return len(values) == count and known
