"""Shapes of the links of a description file: meshes and simple solids, and capsules about them.

Meshes are looked for as ``package://NAME/...`` in a folder NAME beside the file, in one above it
that is called so or whose ``package.xml`` says that name, in ``share/NAME`` of the folders of
``AMENT_PREFIX_PATH`` (ROS 2) and in ``ROS_PACKAGE_PATH`` (ROS 1); other names below the file's own
folder. No other file is opened, in a URDF as in an MJCF.

A capsule about an axis: the circle about the points as seen along the axis gives line and radius,
and the ends are drawn in as far as the round caps still hold every point. Axes tried: the principal
ones of the points. A shape that two capsules, side by side along it, hold in less space gets two.
"""

import os
import re
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from io import BytesIO
from itertools import combinations
from pathlib import Path, PurePosixPath
from typing import NamedTuple, final
from xml.etree.ElementTree import Element

import mujoco
import numpy as np
from numpy.typing import NDArray

from mitt.core.arm.description import Capsule, roll_pitch_yaw
from mitt.core.errors import FileError, heard
from mitt.core.signals import Array
from mitt.io.description_files import Seat, Shape, Stated, numbers_of
from mitt.io.reading import read_bytes

#: Largest mesh that is read, and all of a description file together [byte].
_MAX_BYTES = 50_000_000
_MAX_TOTAL = 300_000_000
#: Largest package.xml that is read [byte], and the name of a package in it.
_MAX_ABOUT = 1_000_000
_PACKAGE_NAME = re.compile(rb"<name>\s*([^<\s]+)\s*</name>")
#: What may be a mesh.
_KINDS = (".stl", ".obj", ".ply", ".dae")
#: Largest size of a shape, and farthest from its link's frame, that is taken for meant [m].
_LARGEST = 100.0
#: Characters of a name that a note keeps.
_LONGEST = 100
#: Corners of a box of half widths 1, shape (8, 3).
_CORNERS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
#: Points of the circles that stand for the ends of a cylinder.
_CIRCLE = 16
#: Share of the space that two capsules may take instead of one.
_WORTH = 0.7
#: Fewest points that are fitted with two capsules.
_FEWEST = 8
#: Most points all of whose pairs are taken for edges.
_FEW = 40
#: Most capsules of one link; of more shapes some get one together.
_MOST_CAPSULES = 6


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
    return (
        f"no {kind} that can be read for {', '.join(names[:3])}{more}: the arm may touch itself"
        f" there, and hides no ball{first}",
    )


def _remedy(path: Path, mesh: str) -> str:
    """Return why a mesh of a description file is not there, and what to do."""
    package, inner = _split(mesh)
    if find_mesh(path, mesh) is not None:
        lacks = inner.suffix.lower() == ".dae" and find_spec("collada") is None
        return f"it cannot be read, {'pip install pycollada, or ' if lacks else ''}save it as .stl"
    if inner.suffix.lower() not in _KINDS:
        return f"save it as one of {', '.join(_KINDS)}"
    if inner.is_absolute() or ".." in inner.parts or (not package and "://" in mesh):
        if path.suffix.lower() != ".urdf":
            return "put it below the folder of the file, and name it from there without .."
        return "name it as package://NAME/..., or below the folder of the file"
    if package:
        return (
            f"no such file; put the folder {inner.parts[0][:_LONGEST]!r} above or beside the"
            " file, or source the workspace that has it (AMENT_PREFIX_PATH, or in ROS 1"
            " ROS_PACKAGE_PATH)"
        )
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
            R = roll_pitch_yaw(numbers_of(origin, "rpy", 3, "0 0 0"))
            points = points @ R.T + numbers_of(origin, "xyz", 3, "0 0 0")
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
        raise FileError(
            place,
            f"shapes within {_LARGEST:g} m of their links",
            f"{np.abs(points).max():g} m",
            do="check units and scale",
        )


def _solid(path: Path, solid: Element, meshes: "Meshes") -> tuple[Array, float] | None:
    """Return the points of a solid, and a radius about them; None where a mesh is missing."""
    if solid.tag == "box":
        return solid_points("box", 0.5 * _sizes(path, solid, "size", 3))
    if solid.tag == "sphere":
        return solid_points("sphere", _sizes(path, solid, "radius", 1))
    if solid.tag in ("cylinder", "capsule"):
        (radius,), (length,) = (_sizes(path, solid, x, 1) for x in ("radius", "length"))
        return solid_points(solid.tag, np.array([radius, 0.5 * length]))
    if solid.tag != "mesh":
        return None
    file = find_mesh(path, solid.get("filename", ""))
    points = None if file is None else meshes.points(file)
    return None if points is None else (points * numbers_of(solid, "scale", 3, "1 1 1"), 0.0)


def _sizes(path: Path, solid: Element, key: str, count: int) -> Array:
    """Return the sizes of a solid [m]; FileError where none can have them."""
    sizes = numbers_of(solid, key, count)
    if not np.all((sizes >= 0.0) & (sizes <= _LARGEST)):
        wanted = f"{key} of 0 to {_LARGEST:g} m"
        raise FileError(f"{path} <{solid.tag}>", wanted, repr(solid.get(key, "")[:60]))
    return sizes


def solid_points(kind: str, size: Array) -> tuple[Array, float]:
    """Return points of a solid about its middle, and a radius about them [m].

    Args:
        kind: ``sphere``, ``capsule``, ``cylinder``, ``ellipsoid`` or ``box``.
        size: Its radius; radius and half length; half axes or half widths [m].
    """
    if kind == "sphere":
        return np.zeros((1, 3)), float(size[0])
    if kind == "capsule":
        return np.array([[0.0, 0.0, -size[1]], [0.0, 0.0, size[1]]]), float(size[0])
    if kind == "cylinder":
        return _cylinder_points(float(size[0]), float(size[1])), 0.0
    return (_ball_points() if kind == "ellipsoid" else _CORNERS) * size, 0.0


def _ball_points() -> Array:
    """Return the corners of a dodecahedron that holds the unit ball, shape (20, 3)."""
    golden = 0.5 * (1.0 + np.sqrt(5.0))
    signs = (-1.0, 1.0)
    edges = [(0.0, x / golden, y * golden) for x in signs for y in signs]
    turned = [np.roll(edge, k) for k in range(3) for edge in edges]
    corners = np.vstack((_CORNERS, turned))
    inside = golden**2 / np.sqrt(1.0 + golden**2)  # radius of the ball that touches the faces
    return np.asarray(corners / inside)


def _cylinder_points(radius: float, half: float) -> Array:
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
        if _is_package(folder, package):
            yield folder / rest
    for prefix in _folders("AMENT_PREFIX_PATH"):
        yield prefix / "share" / inner
    for root in _folders("ROS_PACKAGE_PATH"):
        yield root / inner
        if _is_package(root, package):
            yield root / rest


def _folders(variable: str) -> Iterator[Path]:
    """Yield the folders that a variable of the environment names."""
    yield from map(Path, filter(None, os.environ.get(variable, "").split(os.pathsep)))


def _is_package(folder: Path, name: str) -> bool:
    """Say whether a folder is the ROS package of a name: as it is called, or its package.xml."""
    if folder.name == name:
        return True
    about = folder / "package.xml"
    if not about.is_file():
        return False
    try:
        found = _PACKAGE_NAME.search(read_bytes(about, max_bytes=_MAX_ABOUT))
    except FileError:
        return False
    return found is not None and found.group(1).decode(errors="replace") == name


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
                raise FileError(
                    self._place,
                    f"meshes of at most {_MAX_TOTAL} bytes together",
                    "more",
                    do="take simpler ones",
                )
            self._known[file] = _hull(content, file.suffix[1:].lower())
        return self._known[file]


def _hull(content: bytes, kind: str) -> Array | None:
    """Return the points of a mesh's convex hull [m], shape (k, 3); None if it cannot be read."""
    import trimesh  # noqa: PLC0415 (heavy, and only for arms with meshes)

    try:
        mesh = trimesh.load_scene(BytesIO(content), file_type=kind).to_mesh()
        points = np.asarray(mesh.vertices, dtype=np.float64)
    except Exception:  # what a reader of meshes raises on broken ones is unknown
        return None
    faces = hull_faces(points) if np.isfinite(points).all() else None
    return None if faces is None else points[np.unique(faces)]


def carried_shapes(
    stated: Stated, seats: Sequence[Seat], joints: int, tool: Array | None
) -> tuple[tuple[Capsule, ...], ...]:
    """Return the capsules of the base and of each link behind a joint, in their frames.

    Args:
        stated: What the file states.
        seats: Where its parts are.
        joints: Number of the joints, one behind the other.
        tool: Tool plate of a hand that is mounted on the last link, shape (4, 4): what the file
            has beyond it, as a gripper, is taken to be unmounted. None without one.
    """
    parts: list[list[tuple[Array, float]]] = [[] for _ in range(joints + 1)]
    for shape in stated.shapes:
        if shape.frame not in stated.tree:
            continue
        carrier, T = seats[stated.tree.place(shape.frame)]
        points = shape.points @ T[:3, :3].T + T[:3, 3]
        if carrier == joints and tool is not None:
            points = behind(points, (points - tool[:3, 3]) @ tool[:3, 2] - shape.radius)
        if len(points):
            parts[carrier].append((points, shape.radius))
    fitted = [_fitted(x) for x in parts]
    if tool is not None:
        fitted[-1] = [x for x in (_behind(c, tool) for c in fitted[-1]) if x is not None]
    return tuple(tuple(x) for x in fitted)


def _fitted(parts: list[tuple[Array, float]]) -> list[Capsule]:
    """Return capsules about the shapes of one link.

    Of many shapes, two at a time get capsules together, those with the least space between them.
    """
    parts, fits = list(parts), [capsules_about(*x) for x in parts]
    while len(parts) > 1 and sum(map(len, fits)) > _MOST_CAPSULES:
        spaces = [_space(*x) for x in parts]
        between = {
            (i, k): _space(*_joined(parts[i], parts[k])) - spaces[i] - spaces[k]
            for i, k in combinations(range(len(parts)), 2)
        }
        first, second = min(between, key=lambda pair: between[pair])
        parts[first] = _joined(parts[first], parts.pop(second))
        fits[first], _ = capsules_about(*parts[first]), fits.pop(second)
    return [x for fit in fits for x in fit]


def _joined(first: tuple[Array, float], second: tuple[Array, float]) -> tuple[Array, float]:
    """Return the shapes of two parts as one, of the larger radius."""
    return np.vstack((first[0], second[0])), max(first[1], second[1])


def _space(points: Array, radius: float) -> float:
    """Return about how much space a capsule of balls about points takes [m^3]."""
    sides = np.sort(np.ptp(points @ _axes(points).T, axis=0))
    across = 0.5 * float(np.hypot(sides[0], sides[1])) + radius
    return float(np.pi * across**2 * (sides[2] + 4.0 / 3.0 * across))


def _behind(capsule: Capsule, tool: Array) -> Capsule | None:
    """Return a capsule drawn in behind the tool plate; None where nothing is left of it.

    Its round end would reach into the hand, which has shapes of its own there. What is too thick to
    be drawn in, as a flange, becomes thinner instead.
    """
    p, normal, radius = tool[:3, 3], tool[:3, 2], capsule.radius
    ends = np.array([capsule.start, capsule.end])
    height = (ends - p) @ normal
    top, low = int(np.argmax(height)), int(np.argmin(height))
    if height[low] >= radius:
        return None
    room = -radius if height[low] <= -radius else max(height[low], 0.0)
    if height[top] > room:
        ends[top] += (height[top] - room) / (height[top] - height[low]) * (ends[low] - ends[top])
    if height[low] > -radius:
        radius = 0.5 * (radius - height[low])
        ends -= np.outer((ends - p) @ normal + radius, normal)
    start, end = (tuple(x.tolist()) for x in ends)
    return Capsule(start=start, end=end, radius=radius)


def capsules_about(points: Array, radius: float = 0.0) -> tuple[Capsule, ...]:
    """Return one or two capsules that hold the convex hull of balls about points.

    Args:
        points: Centres of the balls [m], shape (k, 3).
        radius: Radius of the balls [m].
    """
    whole = _capsule(points, radius)
    along = (points - points.mean(axis=0)) @ _axes(points)[0]
    cut = _cut(points, along)
    if cut is None:
        return (whole,)
    parts = [np.vstack((points[side], cut)) for side in (along <= 0.0, along >= 0.0)]
    both = tuple(_capsule(x, radius) for x in parts)
    return both if sum(map(volume, both)) < _WORTH * volume(whole) else (whole,)


def _cut(points: Array, along: Array) -> Array | None:
    """Return where edges of the convex hull cross the middle plane; None where it has no inside.

    Args:
        points: Shape (k, 3).
        along: Their places along the axis, the plane at 0, shape (k,).
    """
    edges = None if len(points) < _FEWEST else _hull_edges(points)
    return None if edges is None else _crossings(points, edges, along)


def behind(points: Array, height: Array) -> Array:
    """Return points whose hull is the part of the points' hull at heights up to 0.

    Args:
        points: Shape (k, 3).
        height: Their heights over a plane, shape (k,).
    """
    edges = _hull_edges(points) if len(points) > _FEW else None
    if edges is None:
        edges = np.array(np.triu_indices(len(points), 1)).T
    return np.vstack((points[height <= 0.0], _crossings(points, edges, height)))


def _hull_edges(points: Array) -> NDArray[np.int64] | None:
    """Return the edges of the convex hull, shape (m, 2); None where it has no inside."""
    faces = hull_faces(points)
    return None if faces is None else np.vstack((faces[:, :2], faces[:, 1:], faces[:, ::2]))


def hull_faces(points: Array) -> NDArray[np.int64] | None:
    """Return the triangles of the convex hull, shape (m, 3); None where it has no inside.

    MuJoCo finds them as it compiles a mesh, to seven digits.
    """
    spec = mujoco.MjSpec()
    spec.add_mesh(
        name="hull", uservert=points.ravel(), inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    )
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="hull")
    try:
        with heard():
            graph = spec.compile().mesh_graph
    except ValueError:  # flat, or all in one place
        return None
    vertices, faces = graph[:2]
    return np.asarray(graph[2 + 3 * (vertices + faces) :].reshape(faces, 3), dtype=np.int64)


def _crossings(points: Array, edges: NDArray[np.int64], along: Array) -> Array:
    """Return where edges cross the plane at 0 of the points' places along an axis, shape (j, 3)."""
    first, second = along[edges[:, 0]], along[edges[:, 1]]
    crosses = first * second < 0.0
    share = (first / np.where(crosses, first - second, 1.0))[crosses, None]
    a, b = points[edges[crosses, 0]], points[edges[crosses, 1]]
    return np.asarray(a + share * (b - a))


def volume(capsule: Capsule) -> float:
    """Return the volume of a capsule [m^3]."""
    length = float(np.linalg.norm(np.subtract(capsule.end, capsule.start)))
    return float(np.pi * capsule.radius**2 * (length + 4.0 / 3.0 * capsule.radius))


def _axes(points: Array) -> Array:
    """Return the principal axes of points, the longest first, shape (3, 3)."""
    away = points - points.mean(axis=0)
    return np.asarray(np.linalg.eigh(away.T @ away)[1].T[::-1])


def _capsule(points: Array, radius: float) -> Capsule:
    """Return the smallest capsule about a principal axis."""
    fitted: Sequence[Capsule] = [_about(points, axis, radius) for axis in _axes(points)]
    return min(fitted, key=volume)


def _about(points: Array, axis: Array, radius: float) -> Capsule:
    """Return a capsule that holds balls about points, its axis along a unit vector."""
    along = points @ axis
    flat = points - along[:, None] * axis
    centre = 0.5 * (flat.min(axis=0) + flat.max(axis=0))
    for step in range(60):  # towards the smallest circle (Badoiu and Clarkson 2003)
        far = flat[np.argmax(np.linalg.norm(flat - centre, axis=1))]
        centre = centre + (far - centre) / (step + 2.0)
    centre = centre - (centre @ axis) * axis
    away = np.linalg.norm(flat - centre, axis=1)
    most = float(away.max())
    cap = np.sqrt(np.maximum(most**2 - away**2, 0.0))
    low, high = float(np.min(along + cap)), float(np.max(along - cap))
    if low > high:
        low = high = 0.5 * (low + high)
        most = float(np.max(np.hypot(away, along - low)))
    start, end = (tuple((centre + x * axis).tolist()) for x in (low, high))
    return Capsule(start=start, end=end, radius=most + radius + 1e-9)  # m, against rounding
