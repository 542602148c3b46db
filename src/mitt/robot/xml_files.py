"""Description files as XML: what a file is that is none, and why it cannot be read, in words."""

import codecs
import re
from collections.abc import Iterator
from math import isfinite
from pathlib import Path
from typing import Literal
from xml.etree.ElementTree import Element

from defusedxml import DefusedXmlException, ElementTree

from mitt.errors import FileError, ModelError
from mitt.reading import read_bytes

#: Largest description file read [byte]; real ones stay below 1 MB.
MAX_BYTES = 5_000_000
#: Elements in one another; more would be too many for the parsers behind Pinocchio.
_MOST_LEVELS = 100
#: The kinds of files that are read, by the name of their root.
_KINDS = {"robot": "a URDF, <robot>...</robot>", "mujoco": "an MJCF, <mujoco>...</mujoco>"}
#: What else is handed in for one, by root or first bytes, and what to do.
_ROOTS = {
    "robot": ("a URDF", "name it .urdf"),
    "mujoco": ("an MJCF", "name it .xml"),
    "sdf": ("an SDF", "take the URDF that it was made from"),
    "COLLADA": ("a mesh in COLLADA", "name the URDF that uses it"),
    "mujocoinclude": ("a part of an MJCF", "join the files into one: mj_saveLastXML writes it"),
    "launch": ("a launch file", "name the URDF that it loads"),
    "html": ("a web page", "download the file itself"),
}
_HEADS = {
    b"PXR-USDC": "a USD file", b"#usda": "a USD file", b"PK\x03\x04": "a packed archive",
    b"\x1f\x8b": "a packed archive", b"solid ": "a mesh in STL",
    b"version https://git-lfs": "a pointer of Git LFS in the place of the file",
}  # fmt: skip
_EXPAND = "expand it first: xacro FILE.urdf.xacro > FILE.urdf"
_ENCODING = re.compile(rb"""^<\?xml[^>]*?encoding\s*=\s*["']([\w.:-]{1,40})["']""")
#: What xacro puts in the place of values.
_UNEXPANDED = re.compile(r"\$\{|\$\((find|arg|env|optenv|dirname|eval|cwd|anon)\b")


def check_suffix(path: Path) -> None:
    """Refuse files that are known by their names not to be read.

    Raises:
        FileError: A xacro file, an SDF or a USD.
    """
    suffix = path.suffix.lower()
    if suffix == ".xacro":
        raise FileError(str(path), "a URDF", "a xacro file", do=_EXPAND)
    given = {".sdf": "an SDF", ".world": "an SDF", ".usd": "a USD file", ".usda": "a USD file",
             ".usdc": "a USD file", ".usdz": "a USD file"}  # fmt: skip
    if suffix in given:
        raise FileError(str(path), "a URDF (.urdf) or an MJCF (.xml)", given[suffix],
                        do="take the URDF or MJCF that it was made from")  # fmt: skip


def read_xml(path: Path, root: Literal["robot", "mujoco"]) -> tuple[str, Element]:
    """Return the text and the root of a description file.

    Raises:
        FileError: It cannot be read, is no XML, is another kind of file, or has elements without
            end.
    """
    wanted = _KINDS[root]
    text = _text(path, wanted)
    found = _parsed(path, wanted, text)
    _check_xacro(path, found)
    if found.tag != root:
        given, do = _ROOTS.get(found.tag, (f"<{found.tag[:40]}>", f"name {wanted}"))
        raise FileError(str(path), wanted, given, do=do)
    if found.find(".//include") is not None:
        raise FileError(str(path), "one file", "one that includes others", do="join them")
    return text, found


def _text(path: Path, wanted: str) -> str:
    """Return a file as text, in the encoding that it declares."""
    content = read_bytes(path, max_bytes=MAX_BYTES)
    if not content.strip():
        raise FileError(str(path), wanted, "an empty file", do="export or copy it again")
    for head, kind in _HEADS.items():
        if content.startswith(head):
            raise FileError(str(path), wanted, kind, do="name the description file itself")
    declared = _ENCODING.match(content.removeprefix(codecs.BOM_UTF8))
    name = "utf-8-sig" if declared is None else declared.group(1).decode("ascii")
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        name = "utf-16"
    name = "utf-8-sig" if name.lower() in ("utf-8", "utf8", "us-ascii", "ascii") else name
    try:
        return content.decode(name)
    except (UnicodeError, LookupError) as error:
        bad = f"a bad byte at {error.start}" if isinstance(error, UnicodeDecodeError) else name
        raise FileError(str(path), "UTF-8 text, or the encoding that its first line declares", bad,
                        do="save it as UTF-8") from None  # fmt: skip


def _parsed(path: Path, wanted: str, text: str) -> Element:
    """Return the root of an XML text."""
    try:
        root: Element = ElementTree.fromstring(text, forbid_dtd=True)
    except (ElementTree.ParseError, DefusedXmlException, ValueError) as error:
        if "<xacro:" in text:
            raise FileError(str(path), wanted, "xacro", do=_EXPAND) from None
        if "<" not in text:
            raise FileError(str(path), wanted, "text without any element") from None
        given = "a DOCTYPE" if isinstance(error, DefusedXmlException) else str(error)
        do = "take that line out" if isinstance(error, DefusedXmlException) else "mend it there"
        raise FileError(str(path), "well-formed XML", given, do=do) from error
    level = [root]
    for _ in range(_MOST_LEVELS):
        level = [child for element in level for child in element]
    if level:
        raise FileError(str(path), f"at most {_MOST_LEVELS} elements in one another", "more")
    return root


def _check_xacro(path: Path, root: Element) -> None:
    """Refuse xacro that nobody expanded."""
    for element in root.iter():
        if "xacro" in element.tag.partition("}")[0] and element.tag.startswith("{"):
            raise FileError(str(path), "a URDF", f"xacro, <{element.tag.partition('}')[2]}>",
                            do=_EXPAND)  # fmt: skip
        for key, value in element.attrib.items():
            if _UNEXPANDED.search(value):
                raise FileError(str(path), "a URDF", f"xacro, {key}={value[:60]!r}", do=_EXPAND)


#: Numbers that attributes of a URDF hold, by the path of their element in a link or a joint.
_SHAPES = {"box": {"size": 3}, "cylinder": {"radius": 1, "length": 1}, "sphere": {"radius": 1},
           "capsule": {"radius": 1, "length": 1}, "mesh": {"scale": 3}}  # fmt: skip
_PLACE = {"xyz": 3, "rpy": 3}
_MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
_NUMBERS: dict[str, dict[str, dict[str, int]]] = {
    "link": {
        "inertial/mass": {"value": 1},
        "inertial/inertia": dict.fromkeys(_MOMENTS, 1),
        "inertial/origin": _PLACE,
        **{f"{x}/origin": _PLACE for x in ("visual", "collision")},
        **{f"{x}/geometry/{solid}": keys for x in ("visual", "collision")
           for solid, keys in _SHAPES.items()},
    },
    "joint": {
        "origin": _PLACE,
        "dynamics": {"damping": 1, "friction": 1},
    },
}  # fmt: skip


def check_numbers(path: Path, root: Element) -> None:
    """Refuse attributes of a URDF that are not as many numbers as they should be.

    The parsers behind take a link whose mass does not parse for one without mass.

    Raises:
        FileError: It names the link or the joint, the element and what stands there.
        ModelError: A mass is below 0.
    """
    for part in root:
        for inner, keys in _NUMBERS.get(part.tag, {}).items():
            for element in part.findall(inner):
                for key, count in keys.items():
                    given = element.get(key)
                    finite = "geometry" not in inner  # sizes are looked at with the shapes
                    if given is not None and not _are_numbers(given, count, finite=finite):
                        _refuse(path, part, f"{element.tag} {key}", given, count)
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


_SOURCES = re.compile(r"((^|\s+)at line \d+ in \S+|^Error:\s*)")


def without_sources(said: Iterator[str] | list[str]) -> str:
    """Return what a parser says in one line, without the lines of its own source."""
    words = [_SOURCES.sub("", line.strip()) for line in said]
    return "; ".join(dict.fromkeys(x for x in words if x))
