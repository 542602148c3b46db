"""URDF files: checked and mended in memory before Pinocchio sees them.

What is mended has no meaning, or one that Pinocchio does not know: the axis of a fixed joint, a
continuous joint (one turn about zero), a limit that is missing (asked for by name once it is
needed). The schema of URDF: the ROS wiki, pages urdf/XML/joint and urdf/XML/link.
"""

from collections.abc import Iterator
from math import hypot, inf, isfinite, pi
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np
import pinocchio as pin

from mitt import checks
from mitt.errors import FileError, heard
from mitt.robot.meshes import urdf_shapes
from mitt.robot.stated import LINK, LeftOut, Mimic, Stated
from mitt.robot.xml_files import check_numbers, read_xml, without_sources

#: Joints that move, with a range that the file has to state or not.
_MOVING = ("revolute", "prismatic", "continuous")
#: Largest angle of a frame that is believed: one turn, and room for rounding [rad].
_ONE_TURN = 2.0 * pi + 0.01
_TYPES = (*_MOVING, "fixed", "floating", "planar")
_KEYS_OF = {
    "range": "<limit> lower and upper", "torque": "<limit> effort", "speed": "<limit> velocity"
}  # fmt: skip


def read_urdf(path: Path) -> Stated:
    """Read a URDF file.

    Raises:
        FileError: It cannot be read or parsed, has two roots, a closed chain or a joint of more
            than one degree of freedom.
    """
    path = checks.path("arm", path)
    _, root = read_xml(path, "robot")
    check_numbers(path, root)
    joints = root.findall("joint")
    _check_tree(path, root, joints)
    for joint in joints:
        for axis in joint.findall("axis"):
            if joint.get("type") == "fixed":
                joint.remove(axis)  # it has no meaning there, and some files have zeros
            else:
                _check_axis(path, axis)
    left_out, unusable = _left_out(root, joints), _unusable(joints)
    ranges, torque, speed = _mended(path, joints)
    mimics = dict(_mimics(path, joints))
    shapes, notes = urdf_shapes(path, root)
    _tell_apart(root, joints)
    with heard() as said:
        try:
            model, failed = pin.buildModelFromXML(tostring(root, encoding="unicode")), None
        except (ValueError, RuntimeError, IndexError, KeyError) as error:
            failed = error
    if failed is not None:
        reason = without_sources("".join(said).splitlines()) or without_sources([str(failed)])
        raise FileError(str(path), "a URDF arm", reason[:200] or "a parse error") from failed
    return Stated(
        place=str(path), model=model, ranges=ranges, torque=torque, speed=speed,
        mimics=mimics, shapes=shapes, notes=(*notes, *_turned(root)), keys=_KEYS_OF,
        left_out=left_out, unusable=unusable,
    )  # fmt: skip


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
            raise FileError(str(path), f"{kind}s with names of their own", f"two {twice!r}",
                            do="rename one of them")  # fmt: skip
    above: dict[str, str] = {}
    for joint in joints:
        name, child = joint.get("name", ""), _link_of(joint, "child")
        if joint.get("type") not in _TYPES:
            raise FileError(f"{path} joint {name!r}", f"one of the types {', '.join(_TYPES)}",
                            repr(joint.get("type", "")))  # fmt: skip
        for end in ("parent", "child"):
            if _link_of(joint, end) not in links:
                raise FileError(f"{path} joint {name!r}", f"a link of the file as its {end}",
                                repr(_link_of(joint, end)))  # fmt: skip
        if child in above:
            raise FileError(str(path), "an arm without closed chains",
                            f"link {child!r} behind joints {above[child]!r} and {name!r}",
                            do="take one of them out")  # fmt: skip
        above[child] = name
    roots = [name for name in links if name not in above]
    if len(roots) > 1:
        raise FileError(str(path), "one root link", f"{len(roots)}: {', '.join(roots[:4])}",
                        do="join them by a fixed joint")  # fmt: skip
    if links and not roots:
        raise FileError(str(path), "an arm without closed chains", "no root link",
                        do="take out the joint that closes the chain")  # fmt: skip


def _link_of(joint: Element, end: str) -> str:
    """Return the name of the link at an end of a joint."""
    element = joint.find(end)
    return "" if element is None else element.get("link", "")


def _check_axis(path: Path, axis: Element) -> None:
    """Refuse an axis without a direction."""
    given = axis.get("xyz", "1 0 0")
    try:
        x, y, z = (float(x) for x in given.split())
        size = hypot(x, y, z)
    except ValueError:
        size = 0.0
    if not 1e-6 < size < 1e6:
        do = "separate the numbers by spaces" if "," in given else ""
        raise FileError(str(path), "joint axes with a direction", repr(given[:60]), do=do)


_Limits = tuple[dict[str, tuple[float, float]], dict[str, float], dict[str, float]]


def _mended(path: Path, joints: list[Element]) -> _Limits:
    """Mend joints in memory and return the ranges, torques and speeds that they state."""
    ranges: dict[str, tuple[float, float]] = {}
    torque: dict[str, float] = {}
    speed: dict[str, float] = {}
    for joint in joints:
        name, kind = joint.get("name", ""), joint.get("type", "")
        if kind in ("floating", "planar"):
            raise FileError(f"{path} joint {name!r}", "one axis, on a base that stands still", kind,
                            do="make the joint fixed")  # fmt: skip
        if kind not in _MOVING:
            continue
        limit = joint.find("limit")
        limit = SubElement(joint, "limit") if limit is None else limit
        stated = {key: _number(path, name, limit, key) for key in _KEYS if limit.get(key)}
        if kind == "continuous":
            joint.set("type", "revolute")
            ranges[name] = (-pi, pi)
        elif "lower" in stated or "upper" in stated:
            ends = stated.get("lower", 0.0), stated.get("upper", 0.0)
            if all(map(isfinite, ends)):
                ranges[name] = ends
        for table, key in ((torque, "effort"), (speed, "velocity")):
            if 0.0 < stated.get(key, 0.0) < inf:
                table[name] = stated[key]
        low, high = ranges.get(name, (0.0, 0.0))
        for key, value in zip(_KEYS, (low, high, torque.get(name, 0.0), speed.get(name, 0.0)),
                              strict=True):  # fmt: skip
            limit.set(key, repr(float(value)))
    return ranges, torque, speed


_KEYS = ("lower", "upper", "effort", "velocity")


def _unusable(joints: list[Element]) -> dict[str, str]:
    """Return what joints state in the place of a limit: 0, less, or no end."""
    out = {}
    for joint in joints:
        given = joint.find("limit")
        stated = {} if given is None else {k: given.get(k, "") for k in _KEYS if given.get(k)}
        words = [f"{key} {text[:20]}" for key, text in stated.items() if not _usable(key, text)]
        if words:
            out[joint.get("name", "")] = ", ".join(words)
    return out


def _usable(key: str, text: str) -> bool:
    """Say whether a text is a limit: of a torque or a speed above 0, of any finite."""
    try:
        value = float(text)
    except ValueError:
        return False
    return isfinite(value) and (value > 0.0 or key in ("lower", "upper"))


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
            joint.remove(dynamics)  # what is read of it stands here
            lost |= {key: abs(float(dynamics.get(key, "0"))) for key in lost}
            others += [f"{key} {x[:20]}" for key, x in dynamics.attrib.items() if key not in lost]
        limit = joint.find("limit")
        more = {} if limit is None else limit.attrib
        others += [f"{key} {x[:20]}" for key, x in more.items() if key not in _KEYS]
        others += ["safety_controller"] * (joint.find("safety_controller") is not None)
        ratio = "1" if name not in geared else (geared[name].text or "1").strip()
        others += [f"mechanicalReduction {ratio[:20]}"] * (not _is_one(ratio))
        out[name] = LeftOut(**lost, others=tuple(others))
    return out


def _turned(root: Element) -> Iterator[str]:
    """Yield a note of the first frame that is turned by more than one turn."""
    for part in root:
        for origin in part.iter("origin") if part.tag in ("link", "joint") else ():
            rpy = origin.get("rpy", "0")
            if max((abs(float(x)) for x in rpy.split()), default=0.0) > _ONE_TURN:
                yield (f"large angles: rpy {rpy[:60]!r} of {part.tag} {part.get('name', '')!r}; if"
                       " they are in degrees, write radians")  # fmt: skip
                return


def _is_one(text: str) -> bool:
    """Say whether a text is the number 1."""
    try:
        return float(text) == 1.0
    except ValueError:
        return False


def _number(path: Path, joint: str, element: Element, key: str) -> float:
    """Return a number of an element, infinity included; refuse what is none."""
    given = element.get(key, "")
    try:
        value = float(given)
    except ValueError:
        value = np.nan
    if np.isnan(value):
        raise FileError(f"{path} joint {joint!r}", f"a number for {key}", repr(given[:60]))
    return value


def _mimics(path: Path, joints: list[Element]) -> Iterator[tuple[str, Mimic]]:
    """Yield joints that follow others; the model keeps all its joints."""
    for joint in joints:
        tag = joint.find("mimic")
        if tag is None:
            continue
        name, of = joint.get("name", ""), tag.get("joint", "")
        factors = [
            _number(path, name, tag, key) if tag.get(key) else default
            for key, default in (("multiplier", 1.0), ("offset", 0.0))
        ]
        yield name, Mimic(joint=of, multiplier=factors[0], offset=factors[1])


def _tell_apart(root: Element, joints: list[Element]) -> None:
    """Rename links that are called as a joint is: Pinocchio keeps one frame a name."""
    names = {x.get("name", "") for x in joints}
    called = [(x, "name") for x in root.findall("link")]
    called += [(x, "link") for joint in joints for x in joint if x.tag in ("parent", "child")]
    for element, key in called:
        if element.get(key) in names:
            element.set(key, f"{element.get(key)}{LINK}")
