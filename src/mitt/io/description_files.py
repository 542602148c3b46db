"""What a description file of an arm states, whatever its format, and how its XML is read.

A file is a tree of parts, each a frame seen from the one before it; limits stand beside, by the
names of the joints. What a file is that is none, and why it cannot be read, is said in words.
"""

import codecs
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, Literal, NamedTuple, final
from xml.etree.ElementTree import Element

import numpy as np
from defusedxml import DefusedXmlException, ElementTree

from mitt.core.arm.description import rotation, transform
from mitt.core.errors import FileError, UnknownNameError
from mitt.core.signals import Array
from mitt.io.reading import read_bytes

_OPTION = "--limits FILE.toml, docs/arms.md"
LINK = " (link)"
"""What the name of a link ends with where a joint of the file is called the same."""
WORLD: Final = "universe"
"""What the first part of a tree is called: what stands still."""

#: Largest description file read [byte]; real ones stay below 1 MB.
MAX_BYTES = 5_000_000
#: Elements in one another; more would be too many for parsers that recurse, as MuJoCo's.
_MOST_LEVELS = 100
#: The kinds of files that are read, by the name of their root.
_KINDS = {"robot": "a URDF, <robot>...</robot>", "mujoco": "an MJCF, <mujoco>...</mujoco>"}
JOIN: Final = "join the files into one, as mujoco.mj_saveLastXML writes it of a loaded model"
"""What to do with an MJCF of several files."""
#: What else is handed in for one, by root or first bytes, and what to do.
_ROOTS = {
    "robot": ("a URDF", "name it .urdf"),
    "mujoco": ("an MJCF", "name it .xml"),
    "sdf": ("an SDF", "take the URDF that it was made from"),
    "COLLADA": ("a mesh in COLLADA", "name the URDF that uses it"),
    "mujocoinclude": ("a part of an MJCF", JOIN),
    "launch": ("a launch file", "name the URDF that it loads"),
    "html": ("a web page", "download the file itself"),
}
_HEADS = {
    b"PXR-USDC": "a USD file",
    b"#usda": "a USD file",
    b"PK\x03\x04": "a packed archive",
    b"\x1f\x8b": "a packed archive",
    b"solid ": "a mesh in STL",
    b"version https://git-lfs": "a pointer of Git LFS in the place of the file",
}
_EXPAND = "expand it first: xacro FILE.urdf.xacro > FILE.urdf"
_ENCODING = re.compile(rb"""^<\?xml[^>]*?encoding\s*=\s*["']([\w.:-]{1,40})["']""")
#: A comment, in which files of others have "--", which XML forbids and their readers pass over.
_COMMENT = re.compile(r"<!--.*?(?:-->|\Z)", re.DOTALL)
#: What xacro puts in the place of values.
_UNEXPANDED = re.compile(r"\$\{|\$\((find|arg|env|optenv|dirname|eval|cwd|anon)\b")

Kind = Literal["world", "link", "site", "fixed", "hinge", "slide", "ball", "free"]
"""What a part is: what stands still, a link, a mark on one, or a joint of some kind."""
_MOVING = ("hinge", "slide", "ball", "free")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class KinematicPart:
    """A joint, a link or a site, as a frame seen from that of the part before.

    Attributes:
        name: What the file calls it.
        kind: What it is.
        before: Index of the part before.
        placement: Where it is there, its joint at 0, shape (4, 4).
        axis: Unit axis of a joint, in its own frame, shape (3,).
        armature: Rotor inertia at a joint [kg m^2].
        mass: Mass of a link [kg].
        com: Its centre of mass [m], shape (3,).
        inertia: Its inertia about that [kg m^2], shape (3, 3).
    """

    name: str
    kind: Kind
    before: int = 0
    placement: Array = field(default_factory=transform)
    axis: Array = field(default_factory=lambda: np.zeros(3))
    armature: float = 0.0
    mass: float = 0.0
    com: Array = field(default_factory=lambda: np.zeros(3))
    inertia: Array = field(default_factory=lambda: np.zeros((3, 3)))

    def motion(self, q: float) -> Array:
        """Return how a joint moves what is behind it at a value [rad or m], shape (4, 4)."""
        if self.kind == "slide":
            return transform(p=q * self.axis)
        return transform(rotation(self.axis, q)) if self.kind == "hinge" else transform()


class Seat(NamedTuple):
    """Where a part is: the number of the joint that carries it, 0 for none, and its frame there."""

    carrier: int
    pose: Array


@final
class Tree:
    """The parts of a file, each behind the one before it.

    Attributes:
        parts: The world, then all others.
        joints: Names of the joints that move.
        links: Names of links and sites.
    """

    def __init__(self, parts: Sequence[KinematicPart]) -> None:
        """Take parts in an order in which each comes after the one before it."""
        self.parts = tuple(parts)
        self.joints = tuple(part.name for part in parts if part.kind in _MOVING)
        self.links = tuple(
            part.name.removesuffix(LINK) for part in parts if part.kind in ("link", "site")
        )
        self._places = {part.name: k for k, part in enumerate(parts)}

    @property
    def flange(self) -> str:
        """The last of the links and sites that the most joints move."""
        moved = {name: len(self.joints_to(name)) for name in self.links}
        return max(self.links, key=lambda name: (moved[name], self.place(name)))

    def __contains__(self, name: str) -> bool:
        """Say whether there is a frame of a name."""
        return name in self._places

    def place(self, name: str) -> int:
        """Return the index of a frame, the link where a joint is called the same.

        Raises:
            UnknownNameError: There is no such frame.
        """
        if name not in self._places:
            raise UnknownNameError(
                "tip", name, self.links, do="name the link or site of the palm (--tip)"
            )
        return self._places.get(name + LINK, self._places[name])

    def joint(self, name: str) -> KinematicPart:
        """Return a joint."""
        return self.parts[self._places[name]]

    def carried(self, name: str) -> float:
        """Return the mass that a joint carries, up to the next joints that move [kg]."""
        fixed, mass = {self._places[name]}, 0.0
        for k, part in enumerate(self.parts):
            if part.before in fixed and part.kind not in _MOVING:
                fixed.add(k)
                mass += part.mass
        return mass

    def joints_to(self, name: str) -> list[str]:
        """Return the joints that move a frame, from the base outwards.

        Raises:
            UnknownNameError: There is no such frame.
        """
        at, found = self.place(name), []
        while at:
            part = self.parts[at]
            found += [part.name] if part.kind in _MOVING else []
            at = part.before
        return found[::-1]

    def seats(self, moving: Sequence[str], q: Mapping[str, float]) -> list[Seat]:
        """Return where all parts are, in their order, once all joints but some are held.

        Args:
            moving: Names of these, which count from 1; each is at 0.
            q: Values of the others [rad or m]; 0 where there is none.
        """
        seats = [Seat(0, transform())]
        for part in self.parts[1:]:
            if part.kind in _MOVING and part.name in moving:
                seats.append(Seat(moving.index(part.name) + 1, transform()))
            else:
                carrier, pose = seats[part.before]
                pose = pose @ part.placement @ part.motion(q.get(part.name, 0.0))
                seats.append(Seat(carrier, pose))
        return seats


@dataclass(frozen=True, slots=True, kw_only=True)
class Mimic:
    """A joint that follows another one: ``multiplier`` times its value, plus ``offset`` [rad]."""

    joint: str
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Shape:
    """Points that hold a body: the convex hull of balls about them.

    Attributes:
        frame: Name of the frame that they are given in.
        points: Points [m], shape (k, 3).
        radius: Radius of the balls [m].
    """

    frame: str
    points: Array
    radius: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftOut:
    """What a file states of a joint and mitt does not count.

    Attributes:
        damping: Torque per speed [N m s/rad].
        friction: Dry friction [N m].
        others: Anything else, as a note says it.
    """

    damping: float = 0.0
    friction: float = 0.0
    others: tuple[str, ...] = ()

    @property
    def words(self) -> str:
        """What it is, in words; empty where it is nothing."""
        named = (("damping", self.damping), ("dry friction", self.friction))
        return ", ".join((*(f"{name} {x:.4g}" for name, x in named if x), *self.others))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stated:
    """What a file states; a joint that is missing in one of the tables has no such limit there.

    Attributes:
        place: What an error calls the file.
        tree: All its parts.
        ranges: Ends of the joints' ranges [rad or m]; of continuous joints one turn about zero.
        torque: Largest torques [N m or N].
        speed: Largest speeds [rad/s or m/s].
        mimics: Joints that follow others.
        loops: Pairs of frames that the file joins besides the tree.
        shapes: Shapes of the bodies whose meshes are there.
        notes: What a user should know of how the file was read.
        keys: How such a file states the range, torque and speed of a joint, by these words.
        left_out: What is stated of joints and not counted.
        unusable: What is written of a joint in the place of a limit that is missing.
    """

    place: str
    tree: Tree
    ranges: Mapping[str, tuple[float, float]]
    torque: Mapping[str, float]
    speed: Mapping[str, float]
    mimics: Mapping[str, Mimic] = field(default_factory=dict)
    loops: tuple[tuple[str, str], ...] = ()
    shapes: tuple[Shape, ...] = ()
    notes: tuple[str, ...] = ()
    keys: Mapping[str, str] = field(default_factory=dict)
    left_out: Mapping[str, LeftOut] = field(default_factory=dict)
    unusable: Mapping[str, str] = field(default_factory=dict)

    def missing(self, name: str) -> tuple[str, ...]:
        """Return which of range, torque, speed and the mass behind it are not known of a joint."""
        tables = {"range": self.ranges, "torque": self.torque, "speed": self.speed}
        light = ("mass",) if self.tree.carried(name) == 0.0 else ()
        return tuple(kind for kind, table in tables.items() if name not in table) + light

    def remedy(self, *names: str) -> str:
        """Return where what is missing of joints can be stated: of all that lack the same."""
        missing = self.missing(names[0])
        alike = [repr(name) for name in names if self.missing(name) == missing]
        keys = " and ".join(self.keys.get(kind, kind) for kind in missing)
        limits = ["lower, upper" if kind == "range" else kind for kind in missing if kind != "mass"]
        also = f", or {' and '.join(limits)} in a limits file ({_OPTION})" if limits else ""
        return f"state {keys} of {', '.join(alike)} in the file{also}"

    def neutral(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the values of all joints of one axis [rad or m].

        Args:
            values: Values of joints [rad or m]; any other is 0, moved into its range, and a joint
                that follows another one is where that one takes it.
        """
        q = {}
        for name in (x.name for x in self.tree.parts if x.kind in ("hinge", "slide")):
            low, high = self.ranges.get(name, (-np.inf, np.inf))
            q[name] = values.get(name, min(max(0.0, low), high))
        for _ in self.mimics:  # once for each, so that a joint may follow one that follows
            for name, mimic in self.mimics.items():
                if name in q and mimic.joint in q:
                    q[name] = mimic.multiplier * q[mimic.joint] + mimic.offset
        return q


def check_suffix(path: Path) -> None:
    """Refuse files that are known by their names not to be read.

    Raises:
        FileError: A xacro file, an SDF or a USD.
    """
    suffix = path.suffix.lower()
    if suffix == ".xacro":
        raise FileError(str(path), "a URDF", "a xacro file", do=_EXPAND)
    given = {
        ".sdf": "an SDF",
        ".world": "an SDF",
        ".usd": "a USD file",
        ".usda": "a USD file",
        ".usdc": "a USD file",
        ".usdz": "a USD file",
    }
    if suffix in given:
        raise FileError(
            str(path),
            "a URDF (.urdf) or an MJCF (.xml)",
            given[suffix],
            do="take the URDF or MJCF that it was made from",
        )


def read_xml(path: Path, root: Literal["robot", "mujoco"]) -> tuple[str, Element]:
    """Return the text and the root of a description file, its comments taken out of both.

    Raises:
        FileError: It cannot be read, is no XML, is another kind of file, or has elements without
            end.
    """
    wanted = _KINDS[root]
    text = _COMMENT.sub(lambda x: " " + "\n" * x.group().count("\n"), _text(path, wanted))
    found = _parsed(path, wanted, text)
    _check_xacro(path, found)
    if found.tag != root:
        given, do = _ROOTS.get(found.tag, (f"<{found.tag[:40]}>", f"name {wanted}"))
        raise FileError(str(path), wanted, given, do=do)
    if found.find(".//include") is not None:
        raise FileError(str(path), "one file", "one that includes others", do=JOIN)
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
        raise FileError(
            str(path),
            "UTF-8 text, or the encoding that its first line declares",
            bad,
            do="save it as UTF-8",
        ) from None


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
            raise FileError(
                str(path), "a URDF", f"xacro, <{element.tag.partition('}')[2]}>", do=_EXPAND
            )
        for key, value in element.attrib.items():
            if _UNEXPANDED.search(value):
                raise FileError(str(path), "a URDF", f"xacro, {key}={value[:60]!r}", do=_EXPAND)


def number_of(text: str) -> float:
    """Return the number that a text is, infinity included; NaN where it is none."""
    try:
        return float(text)
    except ValueError:
        return np.nan


def numbers_of(element: Element | None, key: str, count: int, default: str = "") -> Array:
    """Return the numbers of an attribute, of its default where it is not there.

    Raises:
        ValueError: They are not as many, or none.
    """
    text = default if element is None else element.get(key, default)
    given = np.array([float(x) for x in text.split()])
    if len(given) != count:
        raise ValueError(f"{count} numbers for {key}")
    return given
