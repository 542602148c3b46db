"""URDF files: checked and mended in memory before Pinocchio sees them.

What is mended has no meaning, or one that Pinocchio does not know: the axis of a fixed joint, a
continuous joint (one turn about zero), a limit that is missing (asked for by name once it is
needed). The schema of URDF: the ROS wiki, pages urdf/XML/joint and urdf/XML/link.
"""

from collections.abc import Iterator
from math import hypot, isfinite, pi
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np
import pinocchio as pin
from defusedxml import DefusedXmlException, ElementTree

from mitt import checks
from mitt.errors import FileError, heard
from mitt.reading import read_text
from mitt.robot.meshes import urdf_shapes
from mitt.robot.stated import LINK, Mimic, Stated

#: Largest description file read [byte]; real ones stay below 1 MB.
MAX_BYTES = 5_000_000
#: Elements in one another; more would be too many for the parsers behind Pinocchio.
_MOST_LEVELS = 100
#: Joints that move, with a range that the file has to state or not.
_MOVING = ("revolute", "prismatic", "continuous")
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
    root = checked_xml(path, read_text(path, max_bytes=MAX_BYTES))
    if root.tag != "robot":
        raise FileError(str(path), "a URDF, <robot>...</robot>", f"<{root.tag[:40]}>")
    joints = [x for x in root.findall("joint") if x.get("type") is not None]
    _check_tree(path, root, joints)
    for joint in joints:
        for axis in joint.findall("axis"):
            if joint.get("type") == "fixed":
                joint.remove(axis)  # it has no meaning there, and some files have zeros
            else:
                _check_axis(path, axis)
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
        reason = f"{''.join(said)} {failed}".split() or ["a parse error"]
        raise FileError(str(path), "a URDF arm", " ".join(reason)[:200]) from failed
    return Stated(
        place=str(path), model=model, ranges=ranges, torque=torque, speed=speed,
        mimics=mimics, shapes=shapes, notes=notes, keys=_KEYS_OF,
    )  # fmt: skip


def checked_xml(path: Path, text: str) -> Element:
    """Return the root of an XML file; refuse malformed ones and masses that are no numbers.

    The parsers behind take a link whose mass does not parse for one without mass.
    """
    try:
        root: Element = ElementTree.fromstring(text, forbid_dtd=True)
    except (ElementTree.ParseError, DefusedXmlException, ValueError) as error:
        raise FileError(str(path), "well-formed XML", error) from error
    level = [root]
    for _ in range(_MOST_LEVELS):
        level = [child for element in level for child in element]
    if level:
        raise FileError(str(path), f"at most {_MOST_LEVELS} elements in one another", "more")
    if root.find(".//include") is not None:
        raise FileError(str(path), "one file", "one that includes others", do="join them")
    for inertial in root.iter("inertial"):
        for element in (x for x in inertial if x.tag in ("mass", "inertia")):
            for key, value in element.attrib.items():
                if not _is_number(value):
                    raise FileError(str(path), f"a number for {element.tag} {key}", repr(value))
    return root


def _is_number(text: str) -> bool:
    """Say whether a text is a finite number."""
    try:
        return isfinite(float(text))
    except ValueError:
        return False


def _check_tree(path: Path, root: Element, joints: list[Element]) -> None:
    """Refuse two roots, closed chains, and joints that are no tree."""
    links = [x.get("name", "") for x in root.findall("link")]
    above: dict[str, str] = {}
    for joint in joints:
        name, child = joint.get("name", ""), _link_of(joint, "child")
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
        size = hypot(*(float(x) for x in given.split()))
    except ValueError:
        size = 0.0
    if not 1e-6 < size < 1e6:
        raise FileError(str(path), "joint axes with a direction", repr(given[:60]))


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
            ranges[name] = (stated.get("lower", 0.0), stated.get("upper", 0.0))
        for table, key in ((torque, "effort"), (speed, "velocity")):
            if stated.get(key, 0.0) > 0.0:
                table[name] = stated[key]
        low, high = ranges.get(name, (0.0, 0.0))
        for key, value in zip(_KEYS, (low, high, torque.get(name, 0.0), speed.get(name, 0.0)),
                              strict=True):  # fmt: skip
            limit.set(key, repr(float(value)))
    return ranges, torque, speed


_KEYS = ("lower", "upper", "effort", "velocity")


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
