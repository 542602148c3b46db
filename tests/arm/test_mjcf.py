"""MJCF as MuJoCo Menagerie writes it: classes, defaults, actuators, keyframes, meshes."""

import os
from pathlib import Path

import mujoco
import numpy as np
import pytest
import trimesh

from mitt.core.errors import MittError
from mitt.io.load import build_arm
from mitt.io.mjcf import read_mjcf

ARM = """<mujoco model="small">
<compiler angle="radian" meshdir="assets" autolimits="true"/>
<default><default class="arm"><joint axis="0 0 1" range="-2.8 2.8" armature="0.1" damping="1"/>
 <general biastype="affine" ctrlrange="-2.8 2.8" forcerange="-87 87"/>
 <default class="small"><joint range="-2 1"/><general forcerange="-12 12"/></default>
 <default class="visual"><geom type="mesh" contype="0" conaffinity="0"/></default>
</default></default>
<asset><mesh name="l0" file="l0.obj"/><mesh file="l1.stl" scale="0.001 0.001 0.001"/>
 <texture name="t" type="2d" file="t.png"/><material name="m" texture="t"/></asset>
<custom><numeric name="velocity_limit_a" data="2"/><numeric name="velocity_limit_b" data="3"/>
 <numeric name="velocity_limit_c" data="4"/></custom>
<worldbody><light name="top" pos="0 0 2"/><camera name="side" pos="1 0 0"/>
<body name="base" childclass="arm"><geom class="visual" mesh="l0" material="m"/>
 <inertial mass="3" pos="0 0 0.1" diaginertia="0.01 0.01 0.01"/>
 <body name="one" pos="0 0 0.3"><joint name="a"/><geom class="visual" mesh="l1"/>
  <inertial mass="2" pos="0 0.02 0.1" fullinertia="0.02 0.02 0.01 0.001 0 0"/>
  <body name="two" pos="0.1 0 0.3" quat="1 1 0 0"><joint name="b" class="small" pos="0 0 0.05"/>
   <inertial mass="1" pos="0 0 0.1" quat="1 0.2 0 0" diaginertia="0.01 0.011 0.012"/>
   <body name="three" pos="0 0.1 0.3" euler="0 1.2 0"><joint name="c"/>
    <inertial mass="1" pos="0 0 0.1" diaginertia="0.01 0.01 0.01"/><site name="tcp" pos="0 0 0.2"/>
    <body name="left"><joint name="f" type="slide" axis="0 1 0" range="0 0.04"/>
     <inertial mass="0.1" pos="0 0 0" diaginertia="1e-4 1e-4 1e-4"/></body>
    <body name="right"><joint name="g" type="slide" axis="0 -1 0" range="0 0.04"/>
     <inertial mass="0.1" pos="0 0 0" diaginertia="1e-4 1e-4 1e-4"/></body>
   </body></body></body></body></worldbody>
<actuator><general class="arm" name="a1" joint="a" gainprm="4500" biasprm="0 -4500 -450"/>
 <general class="small" name="b1" joint="b" gainprm="450" biasprm="0 -450 -45"/>
 <motor name="c1" joint="c" ctrlrange="-5 5" gear="2"/></actuator>
<equality><joint joint1="f" joint2="g" polycoef="0 1 0 0 0"/></equality>
<contact><exclude body1="base" body2="one"/></contact>
<keyframe><key name="home" qpos="0.1 -0.5 0.2 0 0" ctrl="0.1 0 0"/></keyframe>
</mujoco>"""
_NAMES = ["a", "b", "c"]


def _written(path: Path, *changes: tuple[str, str]) -> Path:
    """Write the arm with changes."""
    text = ARM
    for before, after in changes:
        assert before in text
        text = text.replace(before, after)
    path.write_text(text)
    return path


def test_classes_and_actuators_give_the_limits(tmp_path: Path) -> None:
    """Ranges of classes, torques of forcerange or of a motor's range by its gear."""
    arm = build_arm(_written(tmp_path / "a.xml"), tip="tcp", joints=_NAMES)
    assert arm.q_min.tolist() == [-2.8, -2.0, -2.8]
    assert arm.q_max.tolist() == [2.8, 1.0, 2.8]
    assert arm.tau_max.tolist() == [87.0, 12.0, 10.0]
    assert arm.dq_max.tolist() == [2.0, 3.0, 4.0]
    assert [x.armature for x in arm.model.links] == [0.1, 0.1, 0.1]


@pytest.mark.parametrize("ref", ["", ' ref="0.7"', ' ref="0.2" type="slide"'])
def test_the_arm_moves_as_mujoco_moves_it(tmp_path: Path, ref: str) -> None:
    """Position of the site and inverse dynamics agree with MuJoCo on the same file."""
    joint = '<joint name="b" class="small" pos="0 0 0.05"'
    path = _written(tmp_path / "a.xml", (joint, joint + ref))
    arm = build_arm(path, tip="tcp", joints=_NAMES)
    spec = mujoco.MjSpec.from_string(path.read_text())
    for geom in list(spec.geoms):
        spec.delete(geom)
    for thing in (*spec.meshes, *spec.materials, *spec.textures, *spec.keys):
        spec.delete(thing)
    model = spec.compile()
    model.opt.disableflags = int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    model.dof_damping[:] = 0.0
    data = mujoco.MjData(model)
    rng = np.random.default_rng(3)
    for _ in range(5):
        q, dq, ddq = rng.uniform(-1.0, 1.0, (3, 3))
        data.qpos[:3], data.qvel[:3], data.qacc[:3] = q, dq, ddq
        mujoco.mj_inverse(model, data)
        assert np.allclose(arm.position(q), data.site("tcp").xpos, atol=1e-12)
        assert np.allclose(arm.inverse_dynamics(q, dq, ddq), data.qfrc_inverse[:3], atol=1e-9)


@pytest.mark.parametrize(
    ("before", "after", "wanted"),
    [
        (' forcerange="-12 12"', ' forcelimited="false"', "effort limit"),
        ("velocity_limit_b", "other", "velocity_limit_JOINT"),
        (
            '<joint joint1="f" joint2="g" polycoef="0 1 0 0 0"/>',
            '<connect body1="one" body2="three" anchor="0 0 0"/>',
            "closed chains",
        ),
        ('<geom class="visual" mesh="l0" material="m"/>', "<freejoint/>", "base that stands still"),
        ('<joint name="a"/>', '<joint name="a" type="ball" range="0 1"/>', "one axis"),
        (
            '<inertial mass="2" pos="0 0.02 0.1" fullinertia="0.02 0.02 0.01 0.001 0 0"/>',
            "",
            "<inertial>",
        ),
        (
            '<geom class="visual" mesh="l1"/>',
            '<geom type="sphere" size="0.1" pos="200 0 0"/>',
            "shapes within 100 m",
        ),
        ('class="small" pos', 'class="big" pos', "an MJCF arm"),
    ],
)
def test_what_cannot_be_is_refused(tmp_path: Path, before: str, after: str, wanted: str) -> None:
    """One line each."""
    changes = [(before, after)]
    if "freejoint" in after or "ball" in after:
        changes.append(('<key name="home" qpos="0.1 -0.5 0.2 0 0" ctrl="0.1 0 0"/>', ""))
    path = _written(tmp_path / "a.xml", *changes)
    with pytest.raises(MittError, match=wanted) as caught:
        build_arm(path, tip="tcp", joints=_NAMES)
    assert "\n" not in str(caught.value)


_PARSED = "<worldbody>"


@pytest.mark.parametrize(
    ("before", "after", "wanted"),
    [
        ("<asset>", '<include file="x.xml"/><asset>', "mj_saveLastXML"),
        (_PARSED, f'{_PARSED}<flexcomp name="f" type="mesh" file="x.obj"/>', "flexible"),
        ("<asset>", '<asset><model name="m" file="x.xml"/>', "one file"),
        (_PARSED, f'{_PARSED}<attach model="m" body="b" prefix="p"/>', "one file"),
        ("<asset>", '<extension><plugin plugin="x"/></extension><asset>', "plugins"),
        (
            _PARSED,
            f'{_PARSED}<replicate count="400"><replicate count="400"><site/></replicate>'
            "</replicate>",
            "100000 elements",
        ),
        (_PARSED, f'{_PARSED}<replicate count="1e9"><site/></replicate>', "whole numbers"),
        (_PARSED, f'{_PARSED}<composite type="cable" count="99999 9 1"/>', "100000 elements"),
    ],
)
def test_other_files_and_endless_copies_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, before: str, after: str, wanted: str
) -> None:
    """One line each, before MuJoCo sees the file."""
    monkeypatch.setattr(mujoco.MjSpec, "from_string", lambda _: pytest.fail("parsed"))
    with pytest.raises(MittError, match=wanted) as caught:
        build_arm(_written(tmp_path / "a.xml", (before, after)), tip="tcp", joints=_NAMES)
    assert "\n" not in str(caught.value)


def test_files_outside_its_folder_are_left_out_with_a_note(tmp_path: Path) -> None:
    """Meshes above the file as those of a URDF; neither they nor anything else is opened."""
    pipe = tmp_path / "parts" / "pipe"
    pipe.parent.mkdir()
    os.mkfifo(pipe)
    end = os.open(pipe, os.O_RDWR | os.O_NONBLOCK)
    os.write(end, b"unread")
    folder = tmp_path / "own"
    folder.mkdir()
    for meshdir in ("../parts", str(pipe.parent), "../own/../parts"):
        path = _written(
            folder / "a.xml",
            ('meshdir="assets"', f'meshdir="{meshdir}" texturedir="../parts"'),
            ('file="l0.obj"', 'file="pipe"'),
            ('file="l1.stl"', 'name="l1" file="pipe"'),
            ('file="t.png"', 'file="pipe"'),
            (
                "</asset>",
                '<hfield name="h" size="1 1 1 1" file="pipe"/></asset><deformable>'
                '<skin file="pipe"/></deformable>',
            ),
        )
        (note,) = (x for x in build_arm(path, tip="tcp", joints=_NAMES).model.notes if "mesh" in x)
        assert "for base, one: " in note
        assert "save it as one of" in note
        path.write_text(path.read_text().replace('"pipe"', '"pipe.stl"'))
        (note,) = (x for x in build_arm(path, tip="tcp", joints=_NAMES).model.notes if "mesh" in x)
        assert "put it below the folder of the file" in note
    assert os.read(end, 100) == b"unread"
    os.close(end)


def test_comments_are_passed_over_as_mujoco_does(tmp_path: Path) -> None:
    """Two hyphens in one, elements that are commented out, and the line of an error behind it."""
    comment = "<!-- ---- arm ----\n-- <include file='x.xml'/> -->"
    text = ARM.replace("<worldbody>", f"<worldbody>{comment}")
    mujoco.MjSpec.from_string(text)
    (tmp_path / "a.xml").write_text(text)
    plain = read_mjcf(_written(tmp_path / "b.xml"))
    assert read_mjcf(tmp_path / "a.xml").tree.joints == plain.tree.joints
    (tmp_path / "c.xml").write_text(f"<mujoco>\n{comment}\n<worldbody></mujoco>")
    with pytest.raises(MittError, match="line 4"):
        read_mjcf(tmp_path / "c.xml")
    (tmp_path / "d.xml").write_text("<!DOC<!-- -->TYPE x [<!ENTITY a 'b'>]><mujoco/>")
    with pytest.raises(MittError):
        read_mjcf(tmp_path / "d.xml")


def test_a_loop_of_the_gripper_alone_does_no_harm(tmp_path: Path) -> None:
    """Fingers that an equality joins stay at their neutral place."""
    joined = '<connect body1="left" body2="right" anchor="0 0 0"/>'
    path = _written(
        tmp_path / "a.xml", ('<joint joint1="f" joint2="g" polycoef="0 1 0 0 0"/>', joined)
    )
    assert build_arm(path, tip="tcp", joints=_NAMES).names == ("a", "b", "c")


def test_geoms_become_capsules(tmp_path: Path) -> None:
    """Those that may touch something before those that are only seen; a missing mesh is a note."""
    solid = (
        '<geom type="capsule" fromto="0 0 0 0 0 0.25" size="0.04"/>'
        '<geom type="box" size="1 1 1" contype="0" conaffinity="0"/>'
    )
    path = _written(tmp_path / "a.xml", ('<geom class="visual" mesh="l1"/>', solid))
    arm = build_arm(path, tip="tcp", joints=_NAMES)
    (capsule,) = arm.model.links[0].capsules
    ends = sorted([capsule.start, capsule.end], key=lambda x: x[2])
    assert np.allclose(ends, [[0.0, 0.0, 0.0], [0.0, 0.0, 0.25]], atol=1e-6)
    assert capsule.radius == pytest.approx(0.04, abs=1e-6)
    (missing,) = (x for x in arm.model.notes if "no mesh" in x)
    assert "base" in missing


def test_what_names_a_mesh_may_stay(tmp_path: Path) -> None:
    """Pairs and exclusions of contact, and sensors, do not matter here."""
    named = '<geom class="visual" mesh="l1" name="g1"/><geom name="g2" size="0.1" mass="0"/>'
    more = (
        '<pair geom1="g1" geom2="g2"/></contact><sensor><distance geom1="g1" geom2="g2"'
        ' cutoff="1"/></sensor>'
    )
    path = _written(
        tmp_path / "a.xml", ('<geom class="visual" mesh="l1"/>', named), ("</contact>", more)
    )
    assert build_arm(path, tip="tcp", joints=_NAMES).names == ("a", "b", "c")


def test_a_joint_without_a_name_is_called_by_its_number(tmp_path: Path) -> None:
    """In the arm, in ranges and torques alike."""
    path = _written(
        tmp_path / "a.xml",
        (
            '<joint name="b" class="small" pos="0 0 0.05"/>',
            '<joint class="small" actuatorfrcrange="-9 9"/>',
        ),
        ('<general class="small" name="b1" joint="b" gainprm="450" biasprm="0 -450 -45"/>', ""),
        ("velocity_limit_b", "velocity_limit_joint 1"),
    )
    arm = build_arm(path, tip="tcp", joints=["a", "joint 1", "c"])
    assert arm.names == ("a", "joint 1", "c")
    assert arm.q_max.tolist() == [2.8, 1.0, 2.8]
    assert arm.tau_max.tolist() == [87.0, 9.0, 10.0]
    path.write_text(path.read_text().replace('name="two"', 'name="joint 1"'))
    assert build_arm(path, tip="tcp", joints=["a", "joint 1", "c"]).n == 3


def test_a_joint_that_follows_another_is_read(tmp_path: Path) -> None:
    """By its line; along a curve with a note; it cannot be active."""
    equality = '<joint joint1="f" joint2="g" polycoef="0 1 0 0 0"/>'
    for change, multiplier, offset, notes in (
        ('<joint joint1="b" joint2="a" polycoef="0.1 -0.5 0 0 0"/>', -0.5, 0.1, 0),
        ('<joint joint1="b" joint2="a" polycoef="0.1 -0.5 0.2 0 0"/>', -0.5, 0.1, 1),
        ('<joint joint1="b" polycoef="0.3 0 0 0 0"/>', 0.0, 0.3, 0),
    ):
        path = _written(tmp_path / "a.xml", (equality, change))
        stated = read_mjcf(path)
        assert stated.mimics["b"].multiplier == multiplier
        assert stated.mimics["b"].offset == offset
        assert sum("tangent" in x for x in stated.notes) == notes
        with pytest.raises(MittError, match="a drive of its own"):
            build_arm(path, tip="tcp", joints=_NAMES)
    off = '<joint joint1="b" joint2="a" active="false"/>'
    assert read_mjcf(_written(tmp_path / "a.xml", (equality, off))).mimics == {}


_WELDED = '<site name="tcp" pos="0 0 0.2"/>'


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (_WELDED, f'{_WELDED}<body name="tool"><geom type="mesh" mesh="l1"/></body>'),
        (_WELDED, f'{_WELDED}<body name="tool"><geom type="mesh" mesh="l1" mass="2"/></body>'),
        ('angle="radian"', 'angle="radian" inertiafromgeom="true"'),
    ],
)
def test_mass_that_meshes_would_give_is_not_lost(tmp_path: Path, before: str, after: str) -> None:
    """Of a body welded to one that moves, and where meshes go before what is stated."""
    with pytest.raises(MittError, match="<inertial>") as caught:
        build_arm(_written(tmp_path / "a.xml", (before, after)), tip="tcp", joints=_NAMES)
    assert "\n" not in str(caught.value)


def test_meshes_that_give_no_mass_need_no_inertial(tmp_path: Path) -> None:
    """Those of a base that stands still, without density, or of a group that does not count."""
    base = '<inertial mass="3" pos="0 0 0.1" diaginertia="0.01 0.01 0.01"/>'
    solid = '<geom type="sphere" size="0.1" mass="0.5"/>'
    light = "".join(
        f'<body name="t{k}"><geom type="mesh" mesh="l1" {x}/>{solid}</body>'
        for k, x in enumerate(('mass="0"', 'density="0"', 'group="4"'))
    )
    path = _written(
        tmp_path / "a.xml",
        (base, ""),
        (_WELDED, _WELDED + light),
        ('angle="radian"', 'angle="radian" inertiagrouprange="0 3"'),
    )
    arm = build_arm(path, tip="tcp", joints=_NAMES)
    assert arm.model.links[2].mass == pytest.approx(1.0 + 0.2 + 1.5)


def test_meshes_of_an_mjcf_lie_where_they_lie(tmp_path: Path) -> None:
    """In meshdir, scaled, moved by the geom."""
    (tmp_path / "assets").mkdir()
    box = trimesh.creation.box(extents=[400.0, 40.0, 40.0])
    box.export(tmp_path / "assets" / "l1.stl")
    at = '<geom class="visual" mesh="l1" pos="0.1 0 0" quat="1 0 0 1"/>'
    path = _written(tmp_path / "a.xml", ('<geom class="visual" mesh="l1"/>', at))
    arm = build_arm(path, tip="tcp", joints=_NAMES)
    (capsule,) = arm.model.links[0].capsules
    ends = np.array([capsule.start, capsule.end])
    assert np.allclose(ends[:, [0, 2]], [[0.1, 0.0], [0.1, 0.0]], atol=1e-6)
    assert np.ptp(ends[:, 1]) > 0.3
    assert np.abs(ends[:, 1]).max() + capsule.radius > 0.2
