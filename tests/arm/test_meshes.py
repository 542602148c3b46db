"""Shapes of imported arms, found beside the file and in packages, and the capsules about them."""

from itertools import product
from pathlib import Path

import numpy as np
import pytest
import trimesh
from arm.test_load import MJCF, urdf
from hypothesis import given
from hypothesis import strategies as st

from mitt.core.arm.description import Capsule
from mitt.core.arm.hands import HandModel
from mitt.core.arm.shapes import Surroundings, gap, place_shapes, shapes_of
from mitt.core.errors import FileError, ModelError
from mitt.core.signals import Array
from mitt.io.load import build_arm
from mitt.io.meshes import behind, capsules_about, find_mesh, volume

_NAMES = ["j1", "j2", "j4"]


def _shaped(path: Path, **geometry: str) -> Path:
    """Write the five-joint arm of test_load with shapes of links."""
    text = urdf(path).read_text()
    for link, solid in geometry.items():
        shape = f'<collision><origin xyz="0 0 0.2" rpy="0 1.5708 0"/><geometry>{solid}</geometry>'
        text = text.replace(f'<link name="{link}">', f'<link name="{link}">{shape}</collision>')
    path.write_text(text)
    return path


def _mesh(path: Path, scale: float = 1.0) -> None:
    """Write a box of 0.1, 0.04 and 0.04 m as a mesh, in other units."""
    path.parent.mkdir(parents=True, exist_ok=True)
    trimesh.creation.box(extents=np.array([0.1, 0.04, 0.04]) / scale).export(path)


def test_solids_become_capsules_of_their_link(tmp_path: Path) -> None:
    """A cylinder about z, turned about y, lies along x; the base's stands still."""
    path = _shaped(
        tmp_path / "a.urdf",
        l0='<sphere radius="0.1"/>',
        l2='<cylinder radius="0.03" length="0.4"/>',
        l4='<box size="0.02 0.02 0.3"/>',
    )
    arm = build_arm(path, tip="l5", joints=_NAMES)
    (base,) = arm.model.base_capsules
    assert np.allclose([*base.start, base.radius], [0.0, 0.0, 0.2, 0.1], atol=1e-6)
    (cylinder,) = arm.model.links[1].capsules
    ends = sorted([cylinder.start, cylinder.end])
    assert ends[0][0] < -0.15
    assert ends[1][0] > 0.15
    assert 0.03 < cylinder.radius < 0.035
    assert np.allclose([x[2] for x in ends], 0.2, atol=1e-4)
    assert [len(x.capsules) for x in arm.model.links] == [0, 1, 0, 1, 0]
    assert arm.model.notes == ()


@pytest.mark.parametrize(
    "where", ["beside", "above", "clone", "package path", "clone in it", "prefix", "below"]
)
def test_meshes_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, where: str) -> None:
    """In a package above or beside the file, where ROS 1 and 2 look for it, or below its folder.

    A package is also a folder of another name whose package.xml says it.
    """
    at = {
        "beside": tmp_path / "own/urdf/robot/meshes/a.stl",
        "above": tmp_path / "robot/meshes/a.stl",
        "clone": tmp_path / "Robot-main/meshes/a.stl",
        "package path": tmp_path / "share/robot/meshes/a.stl",
        "clone in it": tmp_path / "Robot-jazzy/meshes/a.stl",
        "prefix": tmp_path / "install/robot/share/robot/meshes/a.stl",
        "below": tmp_path / "own/urdf/meshes/a.stl",
    }[where]
    above = {"above": "robot/urdf", "clone": "Robot-main/urdf/deep"}
    folder = tmp_path / above.get(where, "own/urdf")
    folder.mkdir(parents=True)
    _mesh(at, scale=0.001)
    for clone in ("Robot-main", "Robot-jazzy"):
        (tmp_path / clone).mkdir(exist_ok=True)
        (tmp_path / clone / "package.xml").write_text("<package><name> robot\n</name></package>")
    roots = [tmp_path / x for x in ("none", "share", "Robot-jazzy")]
    monkeypatch.setenv("ROS_PACKAGE_PATH", ":".join(map(str, roots)))
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{tmp_path / 'install/robot'}:/opt/ros/none")
    name = "meshes/a.stl" if where == "below" else "package://robot/meshes/a.stl"
    solid = f'<mesh filename="{name}" scale="0.001 0.001 0.001"/>'
    arm = build_arm(_shaped(folder / "a.urdf", l2=solid), tip="l5", joints=_NAMES)
    assert arm.model.notes == ()
    (capsule,) = arm.model.links[1].capsules
    assert 0.02 * 2.0**0.5 - 1e-6 < capsule.radius < 0.04


@pytest.mark.parametrize("about", ["", "<package><name>other</name></package>", "\xff<name>"])
def test_a_package_of_another_name_is_not_taken(tmp_path: Path, about: str) -> None:
    """Neither a folder without a name for it, nor one whose package.xml says another."""
    _mesh(tmp_path / "clone/meshes/a.stl", scale=0.001)
    (tmp_path / "clone/package.xml").write_text(about)
    assert find_mesh(tmp_path / "clone/a.urdf", "package://robot/meshes/a.stl") is None
    assert find_mesh(tmp_path / "clone/a.urdf", "package://clone/../secret.stl") is None


def test_a_missing_mesh_is_a_note(tmp_path: Path) -> None:
    """The arm loads without the shape; broken meshes and other files are missing too."""
    (tmp_path / "broken.stl").write_text("no mesh")
    (tmp_path / "secret.txt").write_text("solid")
    for name in ("package://robot/a.stl", "broken.stl", "secret.txt", "../a.stl", "/a.stl", ""):
        path = _shaped(tmp_path / "a.urdf", l2=f'<mesh filename="{name}"/>')
        arm = build_arm(path, tip="l5", joints=_NAMES)
        assert len(arm.model.notes) == 1
        assert "l2" in arm.model.notes[0]
        assert arm.model.links[1].capsules == ()
    assert find_mesh(tmp_path / "a.urdf", "package://robot/../../a.stl") is None


@pytest.mark.parametrize(
    ("mesh", "remedy"),
    [
        ("package://robot/meshes/a.stl", "no such file; put the folder 'robot' above or beside"),
        ("meshes/a.stl", "no such file below the folder"),
        ("../a.stl", "package://NAME/"),
        ("file:///tmp/a.stl", "package://NAME/"),
        ("a.step", "save it as one of .stl, .obj"),
        ("broken.stl", "it cannot be read, save it as .stl"),
    ],
)
def test_the_first_missing_mesh_is_named_with_a_remedy(
    tmp_path: Path, mesh: str, remedy: str
) -> None:
    """The file as the description names it, why it is not there, and what to do."""
    (tmp_path / "broken.stl").write_text("no mesh")
    solids = {"l2": f'<mesh filename="{mesh}"/>', "l3": '<mesh filename="other.stl"/>'}
    arm = build_arm(_shaped(tmp_path / "a.urdf", **solids), tip="l5", joints=_NAMES)
    (note,) = arm.model.notes
    assert "for l2, l3: " in note
    assert f"{mesh!r}: " in note
    assert remedy in note
    assert "other.stl" not in note


@pytest.mark.parametrize("there", [False, True])
def test_a_mesh_that_wants_another_package_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, there: bool
) -> None:
    """COLLADA is read by pycollada, which may be missing; where it is there, the file is broken."""
    monkeypatch.setattr("mitt.io.meshes.find_spec", lambda _: there or None)
    (tmp_path / "broken.dae").write_text("no mesh")
    path = _shaped(tmp_path / "a.urdf", l2='<mesh filename="broken.dae"/>')
    (note,) = build_arm(path, tip="l5", joints=_NAMES).model.notes
    also = "" if there else "pip install pycollada, or "
    assert note.endswith(f"it cannot be read, {also}save it as .stl")


def test_a_missing_mesh_of_an_mjcf_is_named(tmp_path: Path) -> None:
    """With the folder that the file names for its meshes."""
    path = tmp_path / "two.xml"
    mesh = '<geom type="mesh" mesh="m"/>'
    asset = '<compiler meshdir="parts"/><asset><mesh name="m" file="a.stl"/></asset>'
    text = MJCF.replace("</custom>", f"</custom>{asset}")
    path.write_text(
        text.replace('<body name="two" pos="0 0 0.4">', f'{mesh}<body name="two" pos="0 0 0.4">')
    )
    (note,) = build_arm(path, tip="two", joints=["a", "b"]).model.notes
    assert "for one: " in note
    assert "'parts/a.stl': no such file below the folder" in note


def test_a_gripper_makes_room_for_the_hand(tmp_path: Path) -> None:
    """What the file has beyond the plate of a mounted hand is left out; bare, it stays."""
    path = _shaped(
        tmp_path / "a.urdf",
        l5='<cylinder radius="0.03" length="0.1"/>',
        l4='<sphere radius="0.1"/>',
    )
    bare = build_arm(path, tip="l5", joints=_NAMES)
    armed = build_arm(path, tip="l5", joints=_NAMES, hand=HandModel())
    assert len(bare.model.links[4].capsules) == 1
    assert armed.model.links[4].capsules == ()
    assert len(armed.model.links[3].capsules) == 1


@pytest.mark.parametrize("kind", ["cylinder", "capsule", "mesh"])
def test_a_link_through_the_plate_is_cut_there(tmp_path: Path, kind: str) -> None:
    """What is behind the plate stays, but for the rim of its end; nothing reaches beyond."""
    plate = -HandModel().catch_offset
    low, high, radius = plate - 0.28, plate + 0.12, 0.04
    solid = f'<{kind} radius="{radius}" length="{high - low}"/>'
    if kind == "mesh":
        trimesh.creation.cylinder(radius, high - low).export(tmp_path / "a.stl")
        solid = '<mesh filename="a.stl"/>'
    shape = f'<collision><origin xyz="0 0 {0.5 * (low + high)}"/><geometry>{solid}</geometry>'
    path = urdf(tmp_path / "a.urdf")
    link = '<link name="l5">'
    path.write_text(path.read_text().replace(link, f"{link}{shape}</collision>"))
    arm = build_arm(path, tip="l5", joints=_NAMES, hand=HandModel())
    (capsule,) = arm.model.links[4].capsules
    bottom, top = sorted([capsule.start, capsule.end], key=lambda x: x[2])
    assert np.allclose([*bottom[:2], *top[:2]], 0.0, atol=0.005)
    assert bottom[2] - capsule.radius < low + 1e-6
    assert plate - 0.01 < top[2] + capsule.radius < plate + 1e-6
    assert 0.9999 * radius < capsule.radius < 1.1 * radius


@pytest.mark.parametrize("height", [-0.25, -0.11, -0.06, 0.05, 0.11])
def test_a_ball_at_the_plate_is_cut_there(tmp_path: Path, height: float) -> None:
    """As deep behind it as it was; a ball before it is no part of the arm."""
    plate, radius = -HandModel().catch_offset, 0.1
    shape = (
        f'<collision><origin xyz="0.02 0 {plate + height}"/><geometry>'
        f'<sphere radius="{radius}"/></geometry></collision>'
    )
    path = urdf(tmp_path / "a.urdf")
    path.write_text(path.read_text().replace('<link name="l5">', f'<link name="l5">{shape}'))
    arm = build_arm(path, tip="l5", joints=_NAMES, hand=HandModel())
    found = arm.model.links[4].capsules
    assert len(found) == (height < radius)
    for capsule in found:
        assert np.allclose(capsule.start, capsule.end)
        assert capsule.start[2] - capsule.radius == pytest.approx(plate + height - radius)
        assert capsule.start[2] + capsule.radius == pytest.approx(plate + min(height + radius, 0.0))


@pytest.mark.thorough
def test_shapes_that_never_meet_are_not_watched(tmp_path: Path) -> None:
    """Those of neighbours but one, a little apart in all poses; others are watched."""
    small = '<sphere radius="0.05"/>'
    path = _shaped(tmp_path / "a.urdf", l1=small, l3=small, l4=small)
    text = path.read_text().split("<joint ")
    text[2] = text[2].replace('lower="-2" upper="2.5"', 'lower="-0.07" upper="0.07"')
    text[2] = text[2].replace('xyz="0.1 0 0.4"', 'xyz="0.1 0 0.0"')
    text[3] = text[3].replace('xyz="0.1 0 0.4"', 'xyz="0.05 0 0.0"')
    path.write_text("<joint ".join(text))
    arm = build_arm(path, tip="l5", joints=_NAMES)
    shapes = shapes_of(arm, Surroundings())
    carriers = [tuple(shapes.table["link"][pair].tolist()) for pair in shapes.pairs]
    assert (0, 2) not in carriers
    ends = shapes.ends
    place_shapes(arm.bodies, arm.q_ready, shapes.table, ends)
    rows = {int(row["link"]): k for k, row in enumerate(shapes.table)}
    assert 0.01 < gap(shapes.table, ends, rows[0], rows[2]) < 0.1
    assert (0, 3) in carriers


@pytest.mark.parametrize(
    "solid",
    [
        '<sphere radius="-0.1"/>',
        '<sphere radius="inf"/>',
        '<sphere radius="nan"/>',
        '<box size="1e200 1 1"/>',
        '<box size="0.1 -0.1 0.1"/>',
        '<cylinder radius="-0.1" length="0.1"/>',
        '<cylinder radius="0.1" length="101"/>',
        '<mesh filename="a.stl" scale="1e4 1 1"/>',
        '<mesh filename="a.stl" scale="nan 1 1"/>',
    ],
)
def test_sizes_that_no_link_has_are_refused(tmp_path: Path, solid: str) -> None:
    """Negative, endless and in millimetres; one line."""
    _mesh(tmp_path / "a.stl")
    with pytest.raises(FileError, match=r"100 m") as caught:
        build_arm(_shaped(tmp_path / "a.urdf", l2=solid), tip="l5", joints=_NAMES)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("radius", [0.0, -0.1, np.nan, np.inf])
def test_a_capsule_has_a_size(radius: float) -> None:
    """A radius above zero and finite ends."""
    with pytest.raises(ModelError, match="radius above 0 m"):
        Capsule(start=(0.0, 0.0, 0.0), end=(0.0, 0.0, 1.0), radius=radius)
    with pytest.raises(ModelError, match="finite ends"):
        Capsule(start=(0.0, 0.0, 0.0), end=(0.0, np.nan, 1.0), radius=1.0)


def test_a_mesh_is_read_once_and_all_have_a_bound(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Links may share a mesh; those of one file are bounded together."""
    for name in ("a.stl", "b.stl"):
        _mesh(tmp_path / name)
    size = (tmp_path / "a.stl").stat().st_size
    monkeypatch.setattr("mitt.io.meshes._MAX_TOTAL", int(1.5 * size))
    one, two = ('<mesh filename="a.stl"/>', '<mesh filename="b.stl"/>')
    arm = build_arm(_shaped(tmp_path / "a.urdf", l1=one, l2=one, l3=one), tip="l5", joints=_NAMES)
    assert [len(x.capsules) for x in arm.model.links[:3]] == [1, 1, 1]
    with pytest.raises(FileError, match="bytes together"):
        build_arm(_shaped(tmp_path / "a.urdf", l1=one, l2=two), tip="l5", joints=_NAMES)


def _gap(points: Array, capsule: object) -> Array:
    """Return how far points are outside a capsule [m]; negative inside."""
    start, end = np.array(capsule.start), np.array(capsule.end)  # type: ignore[attr-defined]
    way = end - start
    share = np.clip((points - start) @ way / max(float(way @ way), 1e-30), 0.0, 1.0)
    nearest = start + share[:, None] * way
    return np.asarray(
        np.linalg.norm(points - nearest, axis=1) - capsule.radius  # type: ignore[attr-defined]
    )


@given(seed=st.integers(0, 2**31), count=st.integers(1, 60), radius=st.floats(0.0, 0.1))
def test_every_ball_is_inside(seed: int, count: int, radius: float) -> None:
    """Whatever the points: on a line, in a plane, all in one place."""
    rng = np.random.default_rng(seed)
    points = rng.standard_normal((count, 3)) * rng.choice([0.0, 0.01, 0.1, 1.0], 3)
    points = points @ np.linalg.qr(rng.standard_normal((3, 3)))[0] + rng.standard_normal(3)
    found = capsules_about(points, radius)
    assert np.min([_gap(points, x) + radius for x in found], axis=0).max() < 1e-8


@given(seed=st.integers(0, 2**31))
def test_the_convex_hull_is_inside(seed: int) -> None:
    """Mixtures of the points too, whether one capsule holds them or two."""
    rng = np.random.default_rng(seed)
    tall = rng.uniform(0.1, 1.0)
    points = rng.standard_normal((30, 3)) * (0.02, 0.02, 0.02) + rng.choice([0.0, tall], (30, 1))
    points[:10] += rng.standard_normal(3) * (0.3, 0.0, 0.0)
    found = capsules_about(points)
    inside = rng.dirichlet(np.full(30, 0.1), 400) @ points
    assert np.min([_gap(inside, x) for x in found], axis=0).max() < 1e-8


def test_shapes_far_apart_do_not_get_one_capsule(tmp_path: Path) -> None:
    """However many there are: a torso, and another arm beside it, leave the space between free."""
    rng, boxes = np.random.default_rng(2), ""
    places = rng.uniform(-0.1, 0.1, (12, 3))
    places[6:, 0] += 2.0
    for x, y, z in places:
        boxes += f'<collision><origin xyz="{x} {y} {z}"/><geometry><box size=".04 .04 .04"/>'
        boxes += "</geometry></collision>"
    path = urdf(tmp_path / "a.urdf")
    path.write_text(path.read_text().replace('<link name="l0">', f'<link name="l0">{boxes}'))
    found = build_arm(path, tip="l5", joints=_NAMES).model.base_capsules
    assert 2 <= len(found) <= 6
    corners = np.array(list(product((-0.02, 0.02), repeat=3)))
    all_corners = np.vstack([p + corners for p in places])
    assert np.min([_gap(all_corners, x) for x in found], axis=0).max() < 1e-8
    between = np.array([[1.0, 0.0, 0.0], [0.6, 0.2, 0.0], [1.4, 0.0, 0.2]])
    assert np.min([_gap(between, x) for x in found]) > 0.1


@pytest.mark.parametrize(("radius", "length"), [(0.05, 0.4), (0.1, 0.1)])
def test_a_capsule_is_found_again(radius: float, length: float) -> None:
    """Points on its surface give it back to a few per cent of its volume."""
    rng = np.random.default_rng(1)
    sphere = rng.standard_normal((2000, 3))
    sphere *= radius / np.linalg.norm(sphere, axis=1)[:, None]
    points = sphere + np.sign(sphere[:, :1]) * (0.5 * length, 0.0, 0.0)
    found = capsules_about(points)
    assert len(found) == 1
    expected = np.pi * radius**2 * (length + 4.0 / 3.0 * radius)
    assert expected < volume(found[0]) * 1.02
    assert volume(found[0]) < 1.06 * expected


@given(seed=st.integers(0, 2**31), count=st.integers(1, 60), flat=st.booleans())
def test_what_is_behind_a_plane_is_held(seed: int, count: int, flat: bool) -> None:
    """Mixtures of points that lie behind it are mixtures of what is kept, which lies behind it."""
    rng = np.random.default_rng(seed)
    points = rng.standard_normal((count, 3)) * (1.0, 0.0 if flat else 1.0, 1.0)
    normal = rng.standard_normal(3)
    normal /= np.linalg.norm(normal)
    kept = behind(points, points @ normal)
    assert np.all(kept @ normal < 1e-9)
    inside = rng.dirichlet(np.full(count, 0.2), 200) @ points
    inside = inside[inside @ normal <= 0.0]
    if len(inside):
        ways = rng.standard_normal((50, 3))
        assert np.all((inside @ ways.T).max(axis=0) <= (kept @ ways.T).max(axis=0) + 1e-9)
