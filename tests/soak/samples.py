"""Samples: a valid file for every reader of ``mitt catch``, and the command that reads it."""

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mitt.core.map.learn import Learned
from mitt.core.map.map_design import default_design
from mitt.core.map.mapping import unlearned
from mitt.io.load import build_arm
from mitt.io.maps import save_map

#: Where the outputs would go; nothing is written by a check.
_OUT = "never-written"


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """A file, and how it is read.

    Attributes:
        name: Name of the reader.
        path: Where the file is.
        valid: What a valid one holds.
        command: Words of the command line that read it.
        mend: Makes a mutant pass a first check, so that it gets further in.
        each: It is read in one of so many rounds; more than 1 for what takes long.
    """

    name: str
    path: Path
    valid: bytes
    command: tuple[str, ...]
    mend: Callable[[bytes], bytes] = bytes
    each: int = 1


def _check(path: Path, *words: str) -> tuple[str, ...]:
    """Return a command that checks its input, ``words`` and a folder that it would write."""
    return (*words, "--check", "--out", str(path.parent / _OUT))


SCENE = b"""floor = -1.0
[ball]
radius = 0.04
mass = 0.07
drag = 0.04
brightness = 160.0
[mismatch]
mass = 0.05
viscous = 0.1
coulomb = 0.5
drag = 0.1
[sensing]
point_noise = 0.001
latency = 1
encoder_step = 0.0
[contact]
friction = 1.0
settle = 0.004
"""

THROWS = b"""x,y,z,vx,vy,vz
3.5,0.1,0.4,-5.5,0.0,2.0
3.4,-0.1,0.5,-5.6,0.1,1.9
3.3,0.0,0.45,-5.4,-0.1,2.1
"""

URDF = b"""<robot name="two">
 <link name="base"/>
 <link name="l1"><inertial><origin xyz="0 0 0.2"/><mass value="2.0"/>
  <inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
 <link name="l2"><inertial><origin xyz="0 0 0.2"/><mass value="1.5"/>
  <inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
 <link name="l3"><inertial><origin xyz="0 0 0.1"/><mass value="1.0"/>
  <inertia ixx="0.01" iyy="0.01" izz="0.005" ixy="0" ixz="0" iyz="0"/></inertial></link>
 <joint name="j1" type="revolute"><parent link="base"/><child link="l1"/>
  <axis xyz="0 0 1"/><limit lower="-2.5" upper="2.5" effort="80" velocity="8"/></joint>
 <joint name="j2" type="revolute"><parent link="l1"/><child link="l2"/><origin xyz="0 0 0.4"/>
  <axis xyz="0 1 0"/><limit lower="-2.0" upper="2.0" effort="80" velocity="8"/></joint>
 <joint name="j3" type="revolute"><parent link="l2"/><child link="l3"/><origin xyz="0 0 0.4"/>
  <axis xyz="0 1 0"/><limit lower="-2.5" upper="2.5" effort="60" velocity="12"/></joint>
</robot>
"""

MJCF = b"""<mujoco model="two"><compiler angle="radian"/><custom>
 <numeric name="velocity_limit_j1" data="8"/><numeric name="velocity_limit_j2" data="8"/>
 <numeric name="velocity_limit_j3" data="12"/></custom><worldbody>
 <body name="l1"><joint name="j1" axis="0 0 1" range="-2.5 2.5" actuatorfrcrange="-80 80"/>
  <inertial pos="0 0 0.2" mass="2.0" diaginertia="0.02 0.02 0.01"/>
  <body name="l2" pos="0 0 0.4"><joint name="j2" axis="0 1 0" range="-2 2"
   actuatorfrcrange="-80 80"/>
   <inertial pos="0 0 0.2" mass="1.5" diaginertia="0.02 0.02 0.01"/>
   <body name="l3" pos="0 0 0.4"><joint name="j3" axis="0 1 0" range="-2.5 2.5"
    actuatorfrcrange="-60 60"/>
    <inertial pos="0 0 0.1" mass="1.0" diaginertia="0.01 0.01 0.005"/>
    <geom type="capsule" fromto="0 0 0 0 0 0.2" size="0.03"/></body></body></body>
</worldbody></mujoco>
"""

_ARM = ("--tip", "l3", "--joints", "j1,j2,j3")


def _flights() -> bytes:
    """Return two recorded flights, as a file."""
    rows = ["flight,t_s,x_m,y_m,z_m"]
    for flight in (1, 2):
        for k in range(40):
            t = 0.012 * k
            rows.append(
                f"{flight},{t:.4f},{3.0 - 5.0 * t:.4f},{0.1 * t:.4f},"
                f"{0.3 + 3.0 * t - 4.9 * t * t:.4f}"
            )
    return "\n".join(rows).encode()


def no_learning() -> Learned:
    """Return the map of the WAM with alpha = 0, as if it had been learned."""
    arm = build_arm("wam")
    f = unlearned(arm, default_design(arm))
    f = replace(f, region=np.array([arm.q_min, arm.q_max]))
    return Learned(map=f, maps=(f,), steps=(), flights=0, left_out=0, status="converged")


def _map(folder: Path) -> bytes:
    """Return a map, as a file."""
    path = folder / "valid.map.json"
    save_map(path, no_learning(), version="0")
    return path.read_bytes()


def _signed(data: bytes) -> bytes:
    """Return a map with the checksum that its content has, where it is JSON at all."""
    try:
        content = json.loads(data)
        stated = {key: value for key, value in content.items() if key != "checksum"}
    except (ValueError, AttributeError, RecursionError):
        return data
    canonical = json.dumps(stated, sort_keys=True, separators=(",", ":"))
    return json.dumps(
        stated | {"checksum": hashlib.sha256(canonical.encode()).hexdigest()}
    ).encode()


def _catch(option: str, name: str, valid: bytes) -> Callable[[Path], Sample]:
    """Return what makes a sample that ``mitt catch`` reads."""

    def sample(folder: Path) -> Sample:
        path = folder / name
        return Sample(
            name=option[2:],
            path=path,
            valid=valid,
            command=_check(path, "catch", option, str(path)),
        )

    return sample


def _arm(name: str, valid: bytes) -> Callable[[Path], Sample]:
    """Return what makes a sample of an arm's description."""

    def sample(folder: Path) -> Sample:
        path = folder / name
        return Sample(
            name=name,
            path=path,
            valid=valid,
            command=_check(path, "catch", "--arm", str(path), *_ARM),
        )

    return sample


def _learned(folder: Path) -> Sample:
    """Return the sample of a learned map."""
    path = folder / "map.json"
    return Sample(
        name="map",
        path=path,
        valid=_map(folder),
        command=_check(path, "catch", "--map", str(path)),
        mend=_signed,
    )


#: What ``mitt catch`` reads.
CATCHING: tuple[Callable[[Path], Sample], ...] = (
    _catch("--scene", "scene.toml", SCENE),
    _catch("--throws-file", "throws.csv", THROWS),
    _catch("--flights", "flights.csv", _flights()),
    _learned,
    _arm("arm.urdf", URDF),
    _arm("arm.xml", MJCF),
)
