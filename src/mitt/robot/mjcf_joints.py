"""What an MJCF file says of its joints: names, ranges, torques, speeds, and what joins them.

A joint, body or site without a name is called by its number. The elements and what they mean: the
XML reference of MuJoCo's documentation.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import mujoco
import numpy as np

from mitt.errors import FileError
from mitt.robot.stated import LINK, Mimic
from mitt.signals import Array

HINGE, SLIDE = int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)
BALL = int(mujoco.mjtJoint.mjJNT_BALL)
"""Kinds of joints that turn about one axis, slide, and turn freely."""
AT_JOINT = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
"""How actuators reach a joint; the frame of the torque is the same for one axis."""
MOTOR = int(mujoco.mjtBias.mjBIAS_NONE)
"""What actuators add to their control times their gain: nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Names:
    """Names of joints, bodies and sites, each by its number; none of a joint is that of another."""

    joints: tuple[str, ...]
    bodies: tuple[str, ...]
    sites: tuple[str, ...]


def names_of(m: mujoco.MjModel) -> Names:
    """Return what everything is called; frames that are called as a joint is end with ``LINK``."""
    joints = _called(m.joint, m.njnt, "joint")
    taken = frozenset(joints)
    bodies, sites = (
        tuple(x + LINK if x in taken else x for x in names)
        for names in (_called(m.body, m.nbody, "body"), _called(m.site, m.nsite, "site"))
    )
    return Names(joints=joints, bodies=bodies, sites=sites)


def _called(of: Callable[[int], Any], count: int, kind: str) -> tuple[str, ...]:
    """Return names, new ones where there are none."""
    given = [str(of(k).name) for k in range(count)]
    taken = frozenset(given)
    out = []
    for k, name in enumerate(given):
        new = f"{kind} {k}"
        while new in taken:
            new += " unnamed"
        out.append(name or new)
    return tuple(out)


def ranges_of(m: mujoco.MjModel, names: Names) -> dict[str, tuple[float, float]]:
    """Return the joints' ranges; a hinge without one turns once about zero."""
    out = {}
    for k in range(m.njnt):
        if m.jnt_limited[k]:
            out[names.joints[k]] = (float(m.jnt_range[k, 0]), float(m.jnt_range[k, 1]))
        elif m.jnt_type[k] == HINGE:
            out[names.joints[k]] = (-np.pi, np.pi)
    return out


def torques_of(m: mujoco.MjModel, names: Names) -> tuple[dict[str, float], dict[str, str]]:
    """Return the joints' largest torques, the least that joint and actuator allow.

    And, by joint, what is written in the place of one: ranges that allow nothing one way.
    """
    bounds: dict[str, list[float]] = {}
    for k in range(m.njnt):
        if m.jnt_type[k] in (HINGE, SLIDE) and m.jnt_actfrclimited[k]:
            bounds.setdefault(names.joints[k], []).append(_width(m.jnt_actfrcrange[k]))
    for a in range(m.nu):
        if int(m.actuator_trntype[a]) not in AT_JOINT:
            continue
        name, gear = names.joints[m.actuator_trnid[a, 0]], abs(float(m.actuator_gear[a, 0]))
        if m.actuator_forcelimited[a]:
            bounds.setdefault(name, []).append(gear * _width(m.actuator_forcerange[a]))
        motor = int(m.actuator_biastype[a]) == MOTOR
        if motor and m.actuator_ctrllimited[a]:
            gain = abs(float(m.actuator_gainprm[a, 0]))
            bounds.setdefault(name, []).append(gear * gain * _width(m.actuator_ctrlrange[a]))
    torques = {name: min(x) for name, x in bounds.items() if min(x) > 0.0}
    one_way = "a range of force or control that is not about 0"
    return torques, {name: one_way for name in bounds if name not in torques}


def _width(ends: Array) -> float:
    """Return what a range allows both ways."""
    return float(min(-ends[0], ends[1]))


def speeds_of(path: Path, root: Element) -> dict[str, float]:
    """Return the joints' largest speeds [rad/s or m/s], as the file's own numbers say."""
    out = {}
    for numeric in root.iter("numeric"):
        name, given = numeric.get("name", ""), numeric.get("data", "")
        if not name.startswith("velocity_limit_"):
            continue
        try:
            limit = float(given)
        except ValueError:
            limit = 0.0
        if not 0.0 < limit < np.inf:
            raise FileError(f"{path} {name}", "a number above 0", repr(given[:60]))
        out[name.removeprefix("velocity_limit_")] = limit
    return out


def loops_of(m: mujoco.MjModel, names: Names) -> tuple[tuple[str, str], ...]:
    """Return the pairs of bodies that an equality joins."""
    kinds = (mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD)
    out = []
    for k in np.flatnonzero(np.isin(m.eq_type, [int(x) for x in kinds])):
        ends = [int(m.eq_obj1id[k]), int(m.eq_obj2id[k])]
        if int(m.eq_objtype[k]) == int(mujoco.mjtObj.mjOBJ_SITE):
            ends = [int(m.site_bodyid[x]) for x in ends]
        out.append((names.bodies[ends[0]], names.bodies[ends[1]]))
    return tuple(out)


def mimics_of(m: mujoco.MjModel, names: Names) -> tuple[dict[str, Mimic], tuple[str, ...]]:
    """Return the joints that an equality makes follow others, and notes of what is not kept.

    A joint's value less its initial one is a polynomial of the other's less its initial one; what
    is not straight is taken for its tangent. A joint that is joined to none follows itself, with no
    slope.
    """
    out, notes = {}, []
    for k in np.flatnonzero(m.eq_type == int(mujoco.mjtEq.mjEQ_JOINT)):
        if not m.eq_active0[k]:
            continue
        joint, other = int(m.eq_obj1id[k]), int(m.eq_obj2id[k])
        here = float(m.qpos0[m.jnt_qposadr[joint]])
        there = float(m.qpos0[m.jnt_qposadr[other]]) if other >= 0 else 0.0
        offset, slope = (float(x) for x in m.eq_data[k, :2])
        slope = slope if other >= 0 else 0.0
        name = names.joints[joint]
        out[name] = Mimic(joint=names.joints[other if other >= 0 else joint], multiplier=slope,
                          offset=here + offset - slope * there)  # fmt: skip
        if other >= 0 and np.any(m.eq_data[k, 2:5] != 0.0):
            notes.append(f"joint {name!r} follows {names.joints[other]!r} along a curve: taken for"
                         " its tangent")  # fmt: skip
    return out, tuple(notes)
