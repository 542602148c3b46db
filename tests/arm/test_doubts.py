"""What a description states and no arm can have: refused, mended or doubted, in one line each."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from arm.test_load import urdf

from mitt.core.arm.description import Link, checked_inertia, mended_inertia, transform
from mitt.core.arm.limits import LimitSet
from mitt.core.errors import MittError, ModelError
from mitt.core.signals import Array
from mitt.io.load import build_arm

_NAMES = ["j1", "j2", "j4"]
_JOINTS = ["yaw", "pitch", "elbow"]
_INERTIAL = '<inertial pos="0 0 0.2" mass="{mass}" diaginertia="{moments}"/>'
_ARM = """<mujoco><compiler angle="radian" autolimits="true"/>{more}<worldbody>{world}
<body name="base"><body name="one"><inertial pos="0 0 0.1" mass="4" diaginertia=".02 .02 .02"/>
<joint name="yaw" axis="0 0 1" range="-2.5 2.5"/><body name="two" pos="0 0 0.1">
<inertial pos="0 0 0.2" mass="3" diaginertia=".05 .05 .01"/>
<joint name="pitch" axis="0 1 0" range="-1.2 2"/><body name="three" pos="0 0 0.5">{inertial}
<joint name="elbow" axis="0 1 0" range="-0.5 2.9" {joint}/>{geom}<site name="palm" pos="0 0 0.4"/>
</body></body></body></body></worldbody>
<custom><numeric name="velocity_limit_yaw" data="8"/><numeric name="velocity_limit_pitch" data="8"/>
<numeric name="velocity_limit_elbow" data="6"/></custom><actuator>
<motor joint="yaw" ctrlrange="-120 120"/><motor joint="pitch" ctrlrange="-180 180"/>
<motor {target} ctrlrange="-60 60"/></actuator>{end}</mujoco>"""


def _mjcf(path: Path, **parts: str) -> Path:
    """Write an arm of three joints with some parts of it changed."""
    whole = {
        "more": "",
        "world": "",
        "joint": "",
        "geom": "",
        "end": "",
        "target": 'joint="elbow"',
        "inertial": _INERTIAL.format(mass="1.5", moments=".02 .02 .004"),
    }
    path.write_text(_ARM.format(**(whole | parts)))
    return path


def _notes(path: Path) -> tuple[str, ...]:
    """Return the notes of an arm of three joints."""
    return build_arm(path, tip="palm", joints=_JOINTS).model.notes


def _in_mujoco(mass: float, inertia: Array) -> None:
    """Compile a body; ValueError where MuJoCo refuses it."""
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body()
    body.add_joint()
    body.explicitinertial, body.mass = True, mass
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = inertia
    body.fullinertia = [xx, yy, zz, xy, xz, yz]
    spec.compile()


@pytest.mark.parametrize("scale", [1.0, 1e-3, 1e-6, 1e-9])
def test_mujoco_takes_what_a_link_takes(scale: float) -> None:
    """Moments at, above and below the bound, turned anyhow: one check, and MuJoCo has the same."""
    rng = np.random.default_rng(7)
    taken = 0
    for share in (1.2, 1.0 + 1e-6, 1.0 + 1e-12, 1.0, 1.0 - 1e-12, 0.9):
        for _ in range(20):
            axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
            a, b = rng.uniform(0.1, 1.0, 2)
            inertia = axes @ np.diag([a, b, share * (a + b)]) @ axes.T * scale
            try:
                kept = checked_inertia("body", inertia)
            except ModelError:
                assert share > 1.0
                continue
            taken += 1
            _in_mujoco(0.1, kept)
            assert np.allclose(kept, inertia, rtol=0.0, atol=1e-8 * scale)
    assert taken == 80


@pytest.mark.parametrize(
    "moments",
    [
        (1.4e-6, 2e-7, 8e-7),
        (0.0, 0.0, 0.0),
        (0.0, 1e-3, 1e-3),
        (-1e-9, 1e-6, 1e-6),
        (1e-20, 1e-20, 1e-20),
        (0.0, 0.0, 5e-7),
    ],
)
@pytest.mark.parametrize("mass", [1e-6, 0.02, 1.5])
def test_what_a_file_rounds_is_mended_and_said(
    tmp_path: Path, moments: tuple[float, float, float], mass: float
) -> None:
    """The largest moment stays, or the body is small; the note names the link. MuJoCo takes it."""
    inertia, note = mended_inertia("link 'fore'", mass, np.diag(moments))
    _in_mujoco(mass, inertia)
    assert note.startswith("link 'fore': no body has the principal moments")
    again, silent = mended_inertia("link 'fore'", mass, inertia)
    assert silent == ""
    assert np.allclose(again, inertia, rtol=1e-6)
    if mass != 1e-6:
        text = _INERTIAL.format(mass=mass, moments=" ".join(map(str, moments)))
        assert "body 'three'" in "".join(_notes(_mjcf(tmp_path / "a.xml", inertial=text)))


@pytest.mark.parametrize("full", ["0.02 0.02 0.02 0.05 0 0", "1 0.1 0.1 0 0 0", "-1 1 1 0 0 0"])
@pytest.mark.parametrize("mjcf", [True, False])
def test_what_no_body_can_have_is_refused_by_name(tmp_path: Path, full: str, mjcf: bool) -> None:
    """Products that are too large, moments beyond the bound or below 0, of both kinds of files."""
    xx, yy, zz, xy, xz, yz = full.split()
    if mjcf:
        text = f'<inertial pos="0 0 0.2" mass="1" fullinertia="{full}"/>'
        path, tip, joints = _mjcf(tmp_path / "a.xml", inertial=text), "palm", _JOINTS
    else:
        path, tip, joints = urdf(tmp_path / "a.urdf"), "l5", _NAMES
        base, before, rest = path.read_text().split("<inertia ", 2)
        before, after = f"{base}<inertia {before}", rest.split("/>", 1)[1]
        path.write_text(
            f'{before}<inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="{xy}" ixz="{xz}"'
            f' iyz="{yz}"/>{after}'
        )
    with pytest.raises(MittError, match=r"(body 'three'|link 'l.'|joint).*principal moments"):
        build_arm(path, tip=tip, joints=joints)


def test_a_mass_below_zero_is_refused_also_where_it_is_carried(tmp_path: Path) -> None:
    """Of a body that is fixed to another one; and of a link made by hand."""
    child = '<body><inertial pos="0 0 0" mass="-0.1" diaginertia="1e-3 1e-3 1e-3"/></body>'
    with pytest.raises(MittError, match=r"at least 0 kg, got -0\.1"):
        _notes(_mjcf(tmp_path / "a.xml", geom=child))
    with pytest.raises(ModelError, match="principal moments"):
        Link(
            name="x",
            placement=transform(),
            axis=np.array([0.0, 0.0, 1.0]),
            q_min=-1.0,
            q_max=1.0,
            mass=1.0,
            com=np.zeros(3),
            inertia=np.diag((1.0, 0.1, 0.1)),
        )


_GEOMS: dict[str, tuple[str, Callable[[Array], Array]]] = {
    "sphere": ("0.1", lambda u: 0.1 * u),
    "capsule": ("0.05 0.2", lambda u: 0.05 * u + (0.0, 0.0, 0.2) * np.sign(u[:, 2:])),
    "cylinder": (
        "0.05 0.2",
        lambda u: np.column_stack(
            (0.05 * u[:, :2] / np.linalg.norm(u[:, :2], axis=1)[:, None], 0.2 * np.sign(u[:, 2]))
        ),
    ),
    "ellipsoid": ("0.05 0.1 0.3", lambda u: u * (0.05, 0.1, 0.3)),
    "box": ("0.05 0.1 0.3", lambda u: u / np.abs(u).max(axis=1)[:, None] * (0.05, 0.1, 0.3)),
}


@pytest.mark.parametrize("kind", _GEOMS)
def test_capsules_hold_every_solid_of_an_mjcf(tmp_path: Path, kind: str) -> None:
    """Points of its surface are inside, on a link and on what stands still; none stands far out."""
    size, surface = _GEOMS[kind]
    geom = f'<geom type="{kind}" size="{size}" pos="0.02 0.1 0.1" quat="1 0.5 0.2 0.1"/>'
    arm = build_arm(_mjcf(tmp_path / "a.xml", geom=geom, world=geom), tip="palm", joints=_JOINTS)
    u = np.random.default_rng(0).normal(size=(2000, 3))
    points = surface(u / np.linalg.norm(u, axis=1)[:, None])
    turn = np.zeros(9)
    quaternion = np.array((1.0, 0.5, 0.2, 0.1))
    mujoco.mju_quat2Mat(turn, quaternion / np.linalg.norm(quaternion))
    points = points @ turn.reshape(3, 3).T + (0.02, 0.1, 0.1)
    for capsules in (arm.model.links[2].capsules, arm.model.base_capsules):
        assert capsules
        assert _outside(points, capsules).max() < 1e-6
        assert _outside(points, capsules).min() > -0.35
    assert arm.model.notes == ()


def _outside(points: Array, capsules: Any) -> Array:  # noqa: ANN401 (a tuple of capsules)
    """Return how far points are outside of the nearest capsule [m], shape (k,)."""
    gaps = []
    for c in capsules:
        a, along = np.array(c.start), np.subtract(c.end, c.start)
        share = np.clip((points - a) @ along / max(float(along @ along), 1e-12), 0.0, 1.0)
        gaps.append(np.linalg.norm(points - a - share[:, None] * along, axis=1) - c.radius)
    return np.asarray(np.min(gaps, axis=0))


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ({"joint": 'damping="8" frictionloss="10"'}, ("elbow", "damping 8", "58 of 60 N m")),
        ({"joint": 'stiffness="50"'}, ("elbow", "a spring of 50 N m/rad")),
        ({"joint": 'damping="0.1 0.2"'}, ("elbow", "damping")),
        ({"world": '<geom name="floor" type="plane" size="1 1 1"/>'}, ("planes (floor)",)),
        ({"more": '<option gravity="0 -9.81 0"/>'}, ("gravity 0 -9.81 0", "z up")),
        ({"more": '<option gravity="0 0 0"/>'}, ("gravity 0 0 0",)),
        ({"more": '<option><flag gravity="disable"/></option>'}, ("gravity 0 0 0",)),
        (
            {"inertial": _INERTIAL.format(mass="1.5", moments="1e-9 1e-9 1e-9")},
            ("small inertias", "elbow 1e-09 kg m^2 for 1.5 kg"),
        ),
        (
            {
                "inertial": _INERTIAL.format(mass="1.5", moments=".02 .02 .004").replace(
                    "0.2", "200"
                )
            },
            ("centres of mass", "elbow 200 m", "write metres"),
        ),
        ({"more": '<option density="1.2"/>'}, ("fluid",)),
        (
            {
                "end": '<tendon><fixed name="t" stiffness="3">'
                '<joint joint="elbow" coef="1"/></fixed>'
                "</tendon>"
            },
            ("elbow a tendon",),
        ),
        (
            {
                "more": '<asset><hfield name="hills" nrow="2" ncol="2" size="1 1 1 1"/></asset>',
                "world": '<geom type="hfield" hfield="hills"/>',
            },
            ("height field 'hills'",),
        ),
    ],
)
def test_what_is_left_out_of_an_mjcf_is_named(
    tmp_path: Path, parts: dict[str, str], words: tuple[str, ...]
) -> None:
    """One note, in the words of the file; nothing of a file that states no such thing."""
    assert _notes(_mjcf(tmp_path / "a.xml")) == ()
    (note,) = _notes(_mjcf(tmp_path / "b.xml", **parts))
    for word in words:
        assert word in note


@pytest.mark.parametrize(
    ("element", "word"),
    [
        ('<dynamics damping="0.7" friction="2"/>', "damping 0.7, dry friction 2 (5.5 of 50 N m"),
        ('<dynamics damping="0" friction="2"/>', "dry friction 2"),
        ('<safety_controller k_velocity="1" soft_lower_limit="-1"/>', "safety_controller"),
        ('<dynamics rotor_inertia="0.3"/>', "rotor_inertia 0.3"),
    ],
)
def test_what_is_left_out_of_a_urdf_is_named(tmp_path: Path, element: str, word: str) -> None:
    """With the torque that friction takes at the largest speed."""
    path = urdf(tmp_path / "a.urdf")
    path.write_text(path.read_text().replace("</joint>", f"{element}</joint>", 1))
    (note,) = build_arm(path, tip="l5", joints=_NAMES).model.notes
    assert f"j1 {word}" in note


@pytest.mark.parametrize(
    ("before", "after", "word"),
    [
        (
            'lower="-2" upper="2.5"',
            'lower="-0.1" upper="0.1"',
            "narrow ranges: j1.*-5.73..5.73 rad",
        ),
        ('velocity="5"', 'velocity="0.05"', "small speed limits: j1 0.05 rad/s"),
        ('effort="50"', 'effort="1e9"', "large torque limits.*j1 1e.09 N m"),
        ('effort="50"', 'effort="50000"', "large torque limits.*j1 5e.04 N m"),
        ('effort="50"', 'effort="0.05"', "small torque limits.*j1 0.05 N m"),
        ('xyz="0.1 0 0.4"', 'xyz="0.1 0 0.4" rpy="0 90 0"', "large angles: rpy '0 90 0' of joint"),
    ],
)
def test_limits_of_a_file_are_doubted_both_ways(
    tmp_path: Path, before: str, after: str, word: str
) -> None:
    """One note each; none of the arm as it is."""
    path = urdf(tmp_path / "a.urdf")
    assert build_arm(path, tip="l5", joints=_NAMES).model.notes == ()
    assert before in path.read_text()
    path.write_text(path.read_text().replace(before, after))
    (note,) = build_arm(path, tip="l5", joints=_NAMES).model.notes
    assert re.search(word, note)


def test_a_range_in_radians_that_was_read_as_one_in_degrees_is_told_so(tmp_path: Path) -> None:
    """Commands keep more to its ends than there is; the angle unit of an MJCF is degrees."""
    path = _mjcf(tmp_path / "a.xml")
    path.write_text(path.read_text().replace('angle="radian"', ""))
    with pytest.raises(ModelError, match=r"if -2.5..2.5 rad are meant for yaw, .*angle=.radian"):
        _notes(path)


@pytest.mark.parametrize("value", ["inf", "-inf", "1e400", "0", "-5"])
@pytest.mark.parametrize("key", ["effort", "velocity"])
def test_a_limit_that_is_none_is_asked_for_in_one_line(
    tmp_path: Path, key: str, value: str
) -> None:
    """It shows what stands there; a limits file may state it instead."""
    path = urdf(tmp_path / "a.urdf")
    before = {"effort": 'effort="50"', "velocity": 'velocity="5"'}[key]
    path.write_text(path.read_text().replace(before, f'{key}="{value}"'))
    with pytest.raises(ModelError, match=f"got {key} {value}; state <limit> {key}") as caught:
        build_arm(path, tip="l5", joints=_NAMES)
    assert "urdfdom" not in str(caught.value)


@pytest.mark.parametrize(
    ("parts", "word"),
    [
        ({"target": 'joint="elbow" forcerange="0 50"'}, "not about 0"),
        (
            {
                "target": 'tendon="t"',
                "end": '<tendon><fixed name="t"><joint joint="elbow" coef="1"/></fixed></tendon>',
            },
            "an actuator at a tendon",
        ),
    ],
)
def test_a_torque_that_an_mjcf_states_otherwise_is_said(
    tmp_path: Path, parts: dict[str, str], word: str
) -> None:
    """One way only, or by a tendon."""
    with pytest.raises(ModelError, match=f"effort limit above 0, got .*{word}"):
        _notes(_mjcf(tmp_path / "a.xml", **parts))


def test_a_gear_and_the_parents_frame_count(tmp_path: Path) -> None:
    """The torque of a motor is its control by its gear, in whichever frame of the joint."""
    for target, torque in (('joint="elbow" gear="2"', 120.0), ('jointinparent="elbow"', 60.0)):
        arm = build_arm(_mjcf(tmp_path / "a.xml", target=target), tip="palm", joints=_JOINTS)
        assert arm.tau_max[2] == torque


@pytest.mark.parametrize(
    ("metre", "kilogram", "word"),
    [
        (1000.0, 1.0, "if lengths are in mm"),
        (1.0, 1000.0, "if masses are in grams"),
        (1.0, 1e-3, "if masses are in grams"),
    ],
)
def test_lengths_and_masses_in_other_units_are_doubted(
    tmp_path: Path, metre: float, kilogram: float, word: str
) -> None:
    """Millimetres, grams and tonnes."""
    text = _ARM
    for given in ('pos="0 0 0.1"', 'pos="0 0 0.5"', 'pos="0 0 0.4"'):
        size = metre * float(given.split()[2].strip('"'))
        text = text.replace(given, f'pos="0 0 {size}"')
    for given in ('mass="4"', 'mass="3"'):
        text = text.replace(given, f'mass="{kilogram * float(given[6:-1])}"')
    path = tmp_path / "a.xml"
    inertial = _INERTIAL.format(mass=1.5 * kilogram, moments=".02 .02 .004")
    path.write_text(
        text.format(
            more="", world="", joint="", geom="", end="", inertial=inertial, target='joint="elbow"'
        )
    )
    assert any(word in note for note in _notes(path))


@pytest.mark.parametrize(
    ("scale", "word"),
    [
        (1.0, ""),
        (1e3, "large shapes"),
        (1e2, "large shapes"),
        (1.0 / 0.0254, "large shapes"),
        (1e-3, "small shapes"),
    ],
)
@pytest.mark.parametrize("size", [0.03, 0.095, 0.3])
def test_shapes_are_held_against_the_length_of_the_arm(
    tmp_path: Path, scale: float, word: str, size: float
) -> None:
    """Small parts in millimetres, centimetres or inches too, of which none is 100 m long."""
    half = 0.5 * scale * size
    geom = f'<geom type="box" size="{half} {half} {half}"/>'
    path = _mjcf(tmp_path / "a.xml", geom=geom)
    if half >= 100.0:
        with pytest.raises(MittError, match="check units and scale"):
            _notes(path)
        return
    notes = [x for x in _notes(path) if "shapes" in x]
    assert [x.partition(" for")[0] for x in notes] == ([word] if word else [])
    assert all("elbow" in x for x in notes)


@pytest.mark.parametrize(
    ("mass", "moments", "doubted"),
    [("1.5", "1 1 1", True), ("0.5", ".15 .15 .15", True), ("1.5", ".02 .02 .004", False)],
)
def test_inertias_are_held_against_mass_and_size(
    tmp_path: Path, mass: str, moments: str, *, doubted: bool
) -> None:
    """A placeholder of 1 kg m^2, or one that is too wide for a link of 10 cm."""
    parts = {
        "inertial": f'<inertial pos="0 0 0.02" mass="{mass}" diaginertia="{moments}"/>',
        "geom": '<geom type="sphere" size="0.05"/>',
    }
    notes = _notes(_mjcf(tmp_path / "a.xml", **parts))
    assert any("large inertias" in x for x in notes) == doubted


@pytest.mark.parametrize("follows", ["yaw", "finger"])
def test_a_linkage_beside_the_chain_is_said(tmp_path: Path, follows: str) -> None:
    """What an active joint moves besides the chain is rigid; a gripper's own joints are not."""
    path = _shaped_with_side_link(tmp_path / "a.xml", follows)
    said = [x for x in _notes(path) if "mimics" in x]
    assert len(said) == (follows == "yaw")
    assert all("'side'" in x and "'yaw'" in x and "2.5 kg" in x for x in said)


def _shaped_with_side_link(path: Path, follows: str) -> Path:
    """Write an arm with a link of 2 kg beside its chain, and one of 0.5 kg on that."""
    inertial = '<inertial pos="0 0 0" mass="{}" diaginertia=".01 .01 .01"/>'
    inner = f'<body><joint name="finger"/>{inertial.format(0.5)}</body>'
    side = f'<body name="beside"><joint name="side"/>{inertial.format(2)}{inner}</body>'
    equality = f'<equality><joint joint1="side" joint2="{follows}"/></equality>'
    return _mjcf(path, geom=side, end=equality)


_GOOD = '<robot name="a"><link name="l0"/></robot>'
_XACRO = "expand it first: xacro"


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.urdf.xacro", _GOOD, ("xacro file", _XACRO)),
        ("a.urdf", '<robot name="a"><xacro:macro name="m"/></robot>', ("xacro", _XACRO)),
        (
            "a.urdf",
            '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:include/></robot>',
            ("xacro", _XACRO),
        ),
        ("a.urdf", '<robot><link name="${prefix}l0"/></robot>', ("name='${prefix}l0'", _XACRO)),
        ("a.urdf", '<robot><link name="$(arg p)l0"/></robot>', ("$(arg p)", _XACRO)),
        ("a.urdf", "", ("an empty file",)),
        ("a.urdf", " \n", ("an empty file",)),
        ("a.xml", "", ("an empty file", "MJCF")),
        ("a.urdf", "<mujoco/>", ("an MJCF", "name it .xml")),
        ("a.xml", _GOOD, ("a URDF", "name it .urdf")),
        ("a.urdf", '<sdf version="1.9"/>', ("an SDF",)),
        ("a.sdf", '<sdf version="1.9"/>', ("an SDF",)),
        ("a.urdf", "#usda 1.0", ("a USD file",)),
        ("a.usd", "PXR-USDC", ("a USD file",)),
        ("a.urdf", "<!DOCTYPE html><html/>", ("a DOCTYPE",)),
        ("a.urdf", "solid arm", ("a mesh in STL",)),
        ("a.urdf", "version https://git-lfs", ("Git LFS",)),
        ("a.urdf", '<robot><link name="l0"></robot>', ("well-formed XML", "line 1")),
        ("a.urdf", "<robot/>", ("links", "none")),
        ("a.urdf", '<robot><link name="a"/><link name="a"/></robot>', ("two 'a'",)),
    ],
)
def test_another_kind_of_file_is_named_in_one_line(
    tmp_path: Path, name: str, content: str, words: tuple[str, ...]
) -> None:
    """What it is and what to do; never the source of a parser."""
    path = tmp_path / name
    path.write_text(content)
    with pytest.raises(MittError) as caught:
        build_arm(path, tip="l5", joints=_NAMES)
    text = str(caught.value)
    for word in (str(path), *words):
        assert word in text
    assert ".cpp" not in text
    assert "\n" not in text


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ('xyz="0.1 0 0.4"', 'xyz="0.1,0,0.4"', ("3 numbers for origin xyz", "by spaces")),
        ('xyz="0.1 0 0.4"', 'xyz="0 0"', ("3 numbers for origin xyz", "'0 0'")),
        ('xyz="0.1 0 0.4"', 'xyz="0 0 nan"', ("3 numbers for origin xyz",)),
        ('mass value="', 'mass value="1,', ("a number for mass value", "points for decimals")),
        (
            '<child link="l1"/>',
            '<child link="l1"/><dynamics damping="low"/>',
            ("a number for dynamics damping", "'low'"),
        ),
        ('<child link="l1"/>', "", ("joint 'j1'", "a link of the file as its child, got ''")),
        ('name="j1" type="revolute"', 'name="j1"', ("joint 'j1'", "one of the types", "''")),
        ('name="j1" type="revolute"', 'type="revolute"', ("joints with names",)),
        ('<child link="l1"/>', '<child link="l1"/><mimic/>', ("no mimic joint specified",)),
        ('name="j1" type="revolute"', 'name="j1" type="hinge"', ("one of the types", "'hinge'")),
        ('name="j1" type="revolute"', 'name="j2" type="revolute"', ("two 'j2'",)),
        ('axis xyz="', 'axis xyz="1,', ("joint axes with a direction", "by spaces")),
        ('axis xyz="', 'axis xyz="1 ', ("joint axes with a direction",)),
    ],
)
def test_a_broken_urdf_is_told_in_our_words(
    tmp_path: Path, before: str, after: str, words: tuple[str, ...]
) -> None:
    """The link or the joint, the attribute and what stands there."""
    path = urdf(tmp_path / "a.urdf")
    text = path.read_text()
    assert before in text, text[:900]
    path.write_text(text.replace(before, after, 1))
    with pytest.raises(MittError) as caught:
        build_arm(path, tip="l5", joints=_NAMES)
    for word in words:
        assert word in str(caught.value)
    assert ".cpp" not in str(caught.value)


def test_a_file_is_read_in_its_own_encoding_and_by_its_name_in_capitals(tmp_path: Path) -> None:
    """ISO-8859-1 and UTF-16 as declared, a byte order mark; a lie is one line."""
    text = urdf(tmp_path / "a.urdf").read_text().replace("<robot", "<!-- Grüße --><robot", 1)
    text = text[text.index("<!--") :]
    for name, encoding in (("B.URDF", "iso-8859-1"), ("c.Urdf", "utf-16"), ("d.urdf", "utf-8-sig")):
        path = tmp_path / name
        declared = "utf-8" if encoding == "utf-8-sig" else encoding
        path.write_bytes(f'<?xml version="1.0" encoding="{declared}"?>{text}'.encode(encoding))
        assert build_arm(path, tip="l5", joints=_NAMES).names == ("j1", "j2", "j4")
    path.write_bytes(f'<?xml version="1.0"?>{text}'.encode("iso-8859-1"))
    with pytest.raises(MittError, match=r"a bad byte.*save it as UTF-8"):
        build_arm(path, tip="l5", joints=_NAMES)


def _set(**bounds: float) -> LimitSet:
    """Return a set with the same bounds for all five joints of test_load's arm."""
    joints = tuple(f"j{k}" for k in range(1, 6))
    return LimitSet(name="own", joints=joints, bounds={k: np.full(5, x) for k, x in bounds.items()})


@pytest.mark.parametrize(
    ("bounds", "wanted"),
    [
        ({"lower": -170.0, "upper": 170.0}, "within"),
        ({"lower": 10.0, "upper": 170.0}, "within"),  # and not "a range that meets the file's"
        ({"speed": 180.0}, r"write radians, 3\.142"),
    ],
)
def test_a_limit_set_in_degrees_is_refused(
    tmp_path: Path, bounds: dict[str, float], wanted: str
) -> None:
    """One line that names set, joint and degrees, though the file has ranges and speeds itself."""
    path = urdf(tmp_path / "a.urdf")
    with pytest.raises(ModelError, match=wanted) as caught:
        build_arm(path, tip="l5", joints=_NAMES, limits=_set(**bounds))
    text = str(caught.value)
    assert "limits own of joint 'j1'" in text
    assert "degrees" in text
    assert "\n" not in text


def test_a_sliding_joint_has_metres(tmp_path: Path) -> None:
    """Its numbers say nothing of degrees."""
    path = urdf(tmp_path / "a.urdf", kind="prismatic")
    own = LimitSet(name="own", joints=("j2",), bounds={"speed": np.array([180.0])})
    arm = build_arm(path, tip="l5", joints=_NAMES, limits=own)
    assert arm.dq_max.tolist() == [5.0, 180.0, 5.0]
    assert not any("degrees" in x for x in arm.model.notes)


@pytest.mark.parametrize(("speed", "doubted"), [("19", False), ("30", True), ("180", True)])
def test_a_large_speed_of_a_file_is_doubted(tmp_path: Path, speed: str, doubted: bool) -> None:
    """The note names the joints that move, two of them at most, and says what it would be."""
    path = urdf(tmp_path / "a.urdf")
    path.write_text(path.read_text().replace('velocity="5"', f'velocity="{speed}"'))
    notes = build_arm(path, tip="l5", joints=_NAMES).model.notes
    assert len(notes) == doubted
    for note in notes:
        assert f"j1 {speed} rad/s, j2 {speed} rad/s and 1 more" in note
        assert f"degrees, write radians (j1 {np.radians(float(speed)):.4g})" in note


def test_a_set_settles_the_doubt(tmp_path: Path) -> None:
    """It goes before the speeds of the file."""
    path = urdf(tmp_path / "a.urdf")
    path.write_text(path.read_text().replace('velocity="5"', 'velocity="180"'))
    arm = build_arm(path, tip="l5", joints=_NAMES, limits=_set(speed=3.0))
    assert arm.model.notes == ()
