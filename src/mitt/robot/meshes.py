"""Shapes of the links of a description file: meshes where they are there, and simple solids.

Meshes are looked for as ``package://NAME/...`` in a folder NAME above or beside the file and in
``ROS_PACKAGE_PATH``; other names below the file's own folder. No other file is opened.
"""

import os
from collections.abc import Iterator, Sequence
from io import BytesIO
from pathlib import Path, PurePosixPath
from typing import NamedTuple, final
from xml.etree.ElementTree import Element

import numpy as np

from mitt.errors import FileError
from mitt.reading import read_bytes
from mitt.robot.description import roll_pitch_yaw
from mitt.robot.stated import Shape
from mitt.signals import Array

#: Largest mesh that is read, and all of a description file together [byte].
_MAX_BYTES, _MAX_TOTAL = 50_000_000, 300_000_000
#: What may be a mesh.
_KINDS = (".stl", ".obj", ".ply", ".dae")
#: Largest size of a shape, and farthest from its link's frame, that is taken for meant [m].
_LARGEST = 100.0
#: Characters of a name that a note keeps.
_LONGEST = 100
#: Points of the circles that stand for the ends of a cylinder.
_CIRCLE = 16


def urdf_shapes(path: Path, root: Element) -> tuple[tuple[Shape, ...], tuple[str, ...]]:
    """Return the shapes of the links of a URDF, and notes of what is missing.

    Those of ``collision``, or of ``visual`` where a link has none.
    """
    shapes: list[Shape] = []
    missing: list[Missing] = []
    meshes = Meshes(str(path))
    for link in root.findall("link"):
        name = link.get("name", "")
        for element in link.findall("collision") or link.findall("visual"):
            found = _urdf_points(path, element, meshes)
            if found is None:
                mesh = element.find("geometry/mesh")
                missing.append(Missing(name, "" if mesh is None else mesh.get("filename", "")))
            else:
                shapes.append(Shape(frame=name, points=found[0], radius=found[1]))
    return tuple(shapes), missing_notes(path, missing)


class Missing(NamedTuple):
    """A link whose shape is not known, and the mesh that it names; nothing where it names none."""

    link: str
    mesh: str


def missing_notes(path: Path, missing: Sequence[Missing]) -> tuple[str, ...]:
    """Return a note of the links whose shapes are not known, the first file that is missing too.

    Args:
        path: The description file.
        missing: These links, in the order of the file.
    """
    if not missing:
        return ()
    names = list(dict.fromkeys(x.link for x in missing))
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    mesh = next((x.mesh for x in missing if x.mesh), "")
    first = f"; first {mesh[:_LONGEST]!r}: {_remedy(path, mesh)}" if mesh else ""
    kind = "mesh" if mesh else "shape"
    return (f"no {kind} that can be read for {', '.join(names[:3])}{more}: the arm may touch itself"
            f" there, and hides no ball{first}",)  # fmt: skip


def _remedy(path: Path, mesh: str) -> str:
    """Return why a mesh of a description file is not there, and what to do."""
    package, inner = _split(mesh)
    if find_mesh(path, mesh) is not None:
        return "it cannot be read, save it as .stl"
    if inner.suffix.lower() not in _KINDS:
        return f"save it as one of {', '.join(_KINDS)}"
    if inner.is_absolute() or ".." in inner.parts or (not package and "://" in mesh):
        return "name it as package://NAME/..., or below the folder of the file"
    if package:
        return (f"no such file; put the folder {inner.parts[0][:_LONGEST]!r} above or beside the"
                " file, or the folder that holds it into ROS_PACKAGE_PATH")  # fmt: skip
    return f"no such file below the folder {str(path.parent)!r}; put it there"


def _urdf_points(path: Path, element: Element, meshes: "Meshes") -> tuple[Array, float] | None:
    """Return the points of one shape in its link's frame, and a radius about them [m].

    None where its mesh is missing, or where what should be numbers is none.
    """
    geometry = element.find("geometry")
    solid = next(iter(geometry), None) if geometry is not None else None
    try:
        found = None if solid is None else _solid(path, solid, meshes)
        if found is None:
            return None
        points, radius = found
        origin = element.find("origin")
        if origin is not None:
            R = roll_pitch_yaw(_numbers(origin, "rpy", 3, "0 0 0"))
            points = points @ R.T + _numbers(origin, "xyz", 3, "0 0 0")
    except FileError:
        raise
    except ValueError:
        return None
    check_place(str(path), points)
    return points, radius


def check_place(place: str, points: Array) -> None:
    """Refuse points of a shape [m], shape (k, 3), that are farther off than any arm is long.

    Raises:
        FileError: One is 100 m or more from its link's frame along an axis, or is no number.
    """
    if not np.all(np.abs(points) < _LARGEST):
        raise FileError(place, f"shapes within {_LARGEST:g} m of their links",
                        f"{np.abs(points).max():g} m", do="check units and scale")  # fmt: skip


def _solid(path: Path, solid: Element, meshes: "Meshes") -> tuple[Array, float] | None:
    """Return the points of a solid, and a radius about them; None where a mesh is missing."""
    if solid.tag == "box":
        return box_points(0.5 * _sizes(path, solid, "size", 3)), 0.0
    if solid.tag == "sphere":
        return np.zeros((1, 3)), float(_sizes(path, solid, "radius", 1)[0])
    if solid.tag in ("cylinder", "capsule"):
        radius, half = (float(_sizes(path, solid, x, 1)[0]) for x in ("radius", "length"))
        if solid.tag == "capsule":
            return np.array([[0.0, 0.0, -0.5 * half], [0.0, 0.0, 0.5 * half]]), radius
        return cylinder_points(radius, 0.5 * half), 0.0
    if solid.tag != "mesh":
        return None
    file = find_mesh(path, solid.get("filename", ""))
    points = None if file is None else meshes.points(file)
    return None if points is None else (points * _numbers(solid, "scale", 3, "1 1 1"), 0.0)


def _sizes(path: Path, solid: Element, key: str, count: int) -> Array:
    """Return the sizes of a solid [m]; FileError where none can have them."""
    sizes = _numbers(solid, key, count)
    if not np.all((sizes >= 0.0) & (sizes <= _LARGEST)):
        wanted = f"{key} of 0 to {_LARGEST:g} m"
        raise FileError(f"{path} <{solid.tag}>", wanted, repr(solid.get(key, "")[:60]))
    return sizes


def _numbers(element: Element, key: str, count: int, default: str = "") -> Array:
    """Return the numbers of an attribute; ValueError where they are others."""
    given = np.array([float(x) for x in element.get(key, default).split()])
    if len(given) != count:
        raise ValueError(f"{count} numbers for {key}")
    return given


def box_points(half: Array) -> Array:
    """Return the corners of a box of half widths [m], shape (8, 3)."""
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    return np.asarray(signs * half)


def ball_points() -> Array:
    """Return the corners of a dodecahedron that holds the unit ball, shape (20, 3)."""
    golden = 0.5 * (1.0 + np.sqrt(5.0))
    signs = (-1.0, 1.0)
    edges = [(0.0, x / golden, y * golden) for x in signs for y in signs]
    turned = [np.roll(edge, k) for k in range(3) for edge in edges]
    corners = np.vstack((box_points(np.ones(3)), turned))
    inside = golden**2 / np.sqrt(1.0 + golden**2)  # radius of the ball that touches the faces
    return np.asarray(corners / inside)


def cylinder_points(radius: float, half: float) -> Array:
    """Return points about z whose hull holds a cylinder of a half length [m], shape (k, 3)."""
    angles = 2.0 * np.pi * np.arange(_CIRCLE) / _CIRCLE
    ring = radius / np.cos(np.pi / _CIRCLE) * np.array([np.cos(angles), np.sin(angles)]).T
    return np.vstack([np.column_stack((ring, np.full(_CIRCLE, z))) for z in (-half, half)])


def _split(name: str) -> tuple[bool, PurePosixPath]:
    """Say whether a mesh is named by its package, and return its path without what says so."""
    package = name.startswith(("package://", "model://"))
    return package, PurePosixPath(name.partition("://")[2] if package else name)


def find_mesh(path: Path, name: str) -> Path | None:
    """Return where a mesh of a description file is; None where it is not, or is not to be read."""
    package, inner = _split(name)
    outside = inner.is_absolute() or ".." in inner.parts
    if outside or not inner.parts or inner.suffix.lower() not in _KINDS or "\0" in name:
        return None
    if not package:
        here = path.parent / inner
        return here if here.is_file() else None
    return next((x for x in _places(path, inner) if x.is_file()), None)


def _places(path: Path, inner: PurePosixPath) -> Iterator[Path]:
    """Yield where a file of a package may be; the package is the path's first part."""
    package, rest = inner.parts[0], Path(*inner.parts[1:])
    yield path.parent / inner
    for folder in path.absolute().parents:
        if folder.name == package:
            yield folder / rest
    for root in filter(None, os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep)):
        yield Path(root) / inner
        if Path(root).name == package:
            yield Path(root) / rest


@final
class Meshes:
    """The meshes of one description file: each is read once, and all have a bound together."""

    def __init__(self, place: str) -> None:
        """Begin with none.

        Args:
            place: What an error calls the description file.
        """
        self._place, self._left = place, _MAX_TOTAL
        self._known: dict[Path, Array | None] = {}

    def points(self, file: Path) -> Array | None:
        """Return the points of a mesh's convex hull [m], shape (k, 3); None if it cannot be read.

        Raises:
            FileError: The meshes of the file are too large together.
        """
        if file not in self._known:
            try:
                content = read_bytes(file, max_bytes=_MAX_BYTES)
            except FileError:
                content = b""
            self._left -= len(content)
            if self._left < 0:
                raise FileError(self._place, f"meshes of at most {_MAX_TOTAL} bytes together",
                                "more", do="take simpler ones")  # fmt: skip
            self._known[file] = _hull(content, file.suffix[1:].lower())
        return self._known[file]


def _hull(content: bytes, kind: str) -> Array | None:
    """Return the points of a mesh's convex hull [m], shape (k, 3); None if it cannot be read."""
    import trimesh  # noqa: PLC0415 (heavy, and only for arms with meshes)

    try:
        scene = trimesh.load_scene(BytesIO(content), file_type=kind)
        points = np.asarray(scene.to_mesh().convex_hull.vertices, dtype=np.float64)
    except Exception:  # what a reader of meshes raises on broken ones is unknown
        return None
    return points if len(points) >= 4 and np.isfinite(points).all() else None
