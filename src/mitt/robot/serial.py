"""A serial arm out of what a description file states: which joints move, which are held where."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import pinocchio as pin

from mitt.errors import InputError, ModelError, UnknownNameError
from mitt.robot.arm import Arm
from mitt.robot.basket import Hand, mounting
from mitt.robot.carried import carried_shapes, frame_of, joints_to
from mitt.robot.description import ArmModel, Link, rotation, transform
from mitt.robot.inertia import mended_inertia
from mitt.robot.limit_sets import LimitSet
from mitt.robot.limits import Limits, joint_level
from mitt.robot.stated import LeftOut, Stated
from mitt.robot.units import WIDEST, check_range, check_set, doubts, slides
from mitt.signals import Array

Mount = Literal["catch", "plate"]
"""What of a hand is at the tip of an arm: its catch point, or its plate."""
MOUNTS: tuple[Mount, ...] = ("catch", "plate")


@dataclass(frozen=True, slots=True, kw_only=True)
class Wanted:
    """What is wanted of an arm from a file; see :func:`mitt.robot.load.load_arm`."""

    name: str
    tip: str
    joints: tuple[str, ...]
    held: Mapping[str, float]
    ready: Sequence[float] | None
    limits: LimitSet | None
    hand: Hand | None
    turn: float
    mount: Mount = "catch"


def serial_arm(stated: Stated, wanted: Wanted) -> Arm:
    """Return the chain of joints from the base to the tip, all but the active ones held.

    A held joint with a torque and a speed has to bear its load; one without is locked, and the
    arm's notes say so. Joints beside the chain, as those of grippers, are locked as well.

    Raises:
        UnknownNameError: No such joint or frame.
        ModelError: The chain is none, or a limit of an active joint is missing.
    """
    chain = _chain(stated, wanted)
    own = {"torque": stated.torque, "speed": stated.speed}
    set_notes = () if wanted.limits is None else wanted.limits.notes(chain, own)
    stated, limits = bounded(stated, wanted.limits, chain)
    for name in wanted.joints:
        check_active(stated, name)
    for first, second in stated.loops:
        _check_loop(stated, chain, first, second)
    loads = [x for x in chain if x in wanted.joints or _bears(stated, x)]
    values = dict(wanted.held)
    if wanted.ready is not None:
        values |= dict(zip(wanted.joints, wanted.ready, strict=True))
    q = stated.neutral(values)
    kept = {stated.model.getJointId(name) for name in loads}
    rest = [k for k in range(1, stated.model.njoints) if k not in kept]
    model = pin.buildReducedModel(stated.model, rest, q)
    mended = _mend_inertias(model)
    at = {name: q[stated.model.joints[stated.model.getJointId(name)].idx_q] for name in loads}
    tool = plate = _tool(model, wanted)
    if wanted.hand is not None:
        tool = plate @ mounting(wanted.hand)[1]
    shapes = carried_shapes(stated, model, None if wanted.hand is None else plate)
    links = tuple(
        replace(_link(model, k, stated, None if name in wanted.joints else float(at[name])),
                capsules=shapes[k])
        for k, name in enumerate(loads, start=1)
    )  # fmt: skip
    locked = [name for name in chain if name not in loads]
    notes = (
        stated.notes
        + set_notes
        + mended
        + doubts(stated, links, tool)
        + _left_out_notes(stated, loads, wanted.joints)
        + tuple(_locked_note(stated, x) for x in locked)
    )
    description = ArmModel(
        name=wanted.name, links=links, tool=tool, hand=wanted.hand,
        q_ready=_ready(links, wanted), base_capsules=shapes[0], mount=np.eye(4), notes=notes,
    )  # fmt: skip
    return Arm(description, _limits(stated, loads, wanted.limits, limits))


def _bears(stated: Stated, name: str) -> bool:
    """Say whether it is known what a held joint can bear, and what it carries."""
    return name in stated.torque and name in stated.speed and _mass(stated, name) > 0.0


def _mass(stated: Stated, name: str) -> float:
    """Return the mass of the body behind a joint [kg]."""
    return float(stated.model.inertias[stated.model.getJointId(name)].mass)


def _mend_inertias(model: pin.Model) -> tuple[str, ...]:
    """Mend the rounded inertias of a model's bodies in their place, and return notes of it."""
    notes = []
    for k in range(1, model.njoints):
        body = model.inertias[k]
        if not 0.0 < body.mass < np.inf:
            continue  # which a link refuses
        frames = (x for x in model.frames if x.parentJoint == k)
        name = next((x.name for x in frames if x.type == pin.FrameType.BODY), "")
        where = f"link {name!r} behind joint {model.names[k]!r}"
        inertia, note = mended_inertia(where, float(body.mass), np.array(body.inertia))
        if note:
            model.inertias[k] = pin.Inertia(float(body.mass), np.array(body.lever), inertia)
            notes.append(note)
    return tuple(notes)


def _left_out_notes(stated: Stated, loads: Sequence[str], active: Sequence[str]) -> tuple[str, ...]:
    """Return a note of what the file states of the joints and no drive is asked for."""
    words = []
    for name in loads:
        lost = stated.left_out.get(name, LeftOut())
        if not lost.words or (name not in active and not lost.others):
            continue
        most = lost.friction + lost.damping * stated.speed[name]
        share = (
            f" ({most:.4g} of {stated.torque[name]:.4g} N m at its largest speed)" if most else ""
        )
        words.append(f"{name} {lost.words}{share}")
    if not words:
        return ()
    rest = f"; {len(words) - 4} more joints" if len(words) > 4 else ""
    return (f"stated in the file and not counted in what drives give: {'; '.join(words[:4])}{rest};"
            " what matters goes into a limits file (--limits FILE.toml)",)  # fmt: skip


def _locked_note(stated: Stated, name: str) -> str:
    """Return why a held joint is taken as rigid, and where what is missing can be stated."""
    missing = [x for x in stated.missing(name) if x != "range"]
    missing += [] if _mass(stated, name) > 0.0 else ["mass"]
    remedy = f"; {stated.remedy(name)}" if stated.missing(name) else ""
    return f"held joint {name!r}: no {' and no '.join(missing)} known; taken as rigid{remedy}"


def bounded(
    stated: Stated, limits: LimitSet | None, chain: Sequence[str]
) -> tuple[Stated, Mapping[str, Mapping[str, float]]]:
    """Return what a file states with the bounds of a set, and these by kind and joint.

    Raises:
        ModelError: The set is of another arm, in degrees, or its ranges do not meet the file's.
    """
    if limits is None:
        return stated, {}
    bounds = limits.fitted(chain)
    check_set(stated.model, limits.name, bounds)
    return _tightened(stated, bounds), bounds


def _chain(stated: Stated, wanted: Wanted) -> list[str]:
    """Return the joints between base and tip that turn or slide, from the base outwards."""
    model = stated.model
    known = list(model.names)[1:]
    for kind, names in (("joint", wanted.joints), ("held joint", tuple(wanted.held))):
        for joint in names:
            if joint not in known:
                raise UnknownNameError(kind, joint, known)
    both = [x for x in wanted.joints if x in wanted.held]
    if both:
        raise InputError("held", "joints that are not active", ", ".join(both))
    chain = joints_to(model, wanted.tip)
    for name in chain:
        joint = model.joints[model.getJointId(name)]
        if joint.nv != 1:
            raise ModelError(f"joint {name!r}", "one axis, on a base that stands still",
                             joint.shortname(), do="make the joint fixed in the file")  # fmt: skip
        mimic = stated.mimics.get(name)
        if name in wanted.joints and mimic is not None:
            raise ModelError(f"joint {name!r}", "an active joint with a drive of its own",
                             f"one that mimics {mimic.joint!r}")  # fmt: skip
        if mimic is not None and mimic.joint in wanted.joints:
            raise ModelError(f"joint {name!r}", "joints between base and tip that do not follow"
                             " an active one", f"one that mimics {mimic.joint!r}")  # fmt: skip
    beside = [x for x in wanted.joints if x not in chain]
    if beside or len(set(wanted.joints)) < len(wanted.joints):
        given = f"{', '.join(beside)} beside it" if beside else ", ".join(wanted.joints)
        raise ModelError("joints", f"different joints from the base to {wanted.tip!r}:"
                         f" {', '.join(chain) or 'none moves it'}", given)  # fmt: skip
    for name, value in wanted.held.items():
        low, high = stated.ranges.get(name, (-np.inf, np.inf))
        if not low <= value <= high:
            raise InputError(f"held {name}", f"an angle in {low:.4g}..{high:.4g}", f"{value:g}",
                             do="angles are in rad")  # fmt: skip
    return chain


def _tightened(stated: Stated, limits: Mapping[str, Mapping[str, float]]) -> Stated:
    """Return what a file states with the bounds of a set: its torques and speeds, both ranges."""
    ranges = dict(stated.ranges)
    for name, low in limits.get("lower", {}).items():
        high = limits["upper"][name]
        own = ranges.get(name, (-np.inf, np.inf))
        ranges[name] = max(low, own[0]), min(high, own[1])
        if not ranges[name][0] < ranges[name][1]:
            raise ModelError(f"limits of joint {name!r}", "a range that meets that of the file,"
                             f" {own[0]:.4g}..{own[1]:.4g}", f"{low:.4g}..{high:.4g}")  # fmt: skip
    torque = {**stated.torque, **limits.get("torque", {})}
    speed = {**stated.speed, **limits.get("speed", {})}
    return replace(stated, ranges=ranges, torque=torque, speed=speed)


_LIMITS = {"range": "a range", "torque": "an effort limit above 0",
           "speed": "a velocity limit above 0"}  # fmt: skip


def check_active(stated: Stated, name: str) -> None:
    """Refuse an active joint whose range, torque or speed is missing, or a range in degrees.

    Raises:
        ModelError: As said; it names what is missing and where to state it.
    """
    where = f"joint {name!r}"
    missing = stated.missing(name)
    if missing:
        wanted = " and ".join(_LIMITS[kind] for kind in missing)
        others = stated.left_out.get(name, LeftOut()).others
        given = stated.unusable.get(name) or ", ".join(("none", *others))
        raise ModelError(where, wanted, given, do=stated.remedy(name))
    if not slides(stated.model, name):
        check_range(where, *stated.ranges[name])


def _check_loop(stated: Stated, chain: Sequence[str], first: str, second: str) -> None:
    """Refuse a file that joins two bodies which joints of the chain move against one another."""
    model, carriers = stated.model, []
    for name in (first, second):
        above = model.supports[frame_of(model, name).parentJoint]
        carriers.append([model.names[k] for k in above if model.names[k] in chain])
    if carriers[0] != carriers[1]:
        raise ModelError(stated.place, "an arm without closed chains", f"{first!r} joined to"
                         f" {second!r}", do="take the equality out of the file")  # fmt: skip


def _tool(model: pin.Model, wanted: Wanted) -> Array:
    """Return the frame of the tool plate, at the tip or behind it, turned about its z axis."""
    tool = frame_of(model, wanted.tip).placement.homogeneous
    tool = tool @ transform(rotation(np.array([0.0, 0.0, 1.0]), wanted.turn))
    if wanted.hand is None or wanted.mount == "plate":
        return np.asarray(tool)
    return np.asarray(tool @ transform(p=np.array([0.0, 0.0, -mounting(wanted.hand)[0]])))


def _ready(links: Sequence[Link], wanted: Wanted) -> Array:
    """Return the ready pose of the active joints, from the base outwards [rad], shape (n,)."""
    active = [x for x in links if x.held is None]
    if wanted.ready is not None:
        given = dict(zip(wanted.joints, wanted.ready, strict=True))
        return np.array([given[x.name] for x in active])
    return np.array([0.0 if x.q_min < 0.0 < x.q_max else 0.5 * (x.q_min + x.q_max) for x in active])


def _link(model: pin.Model, k: int, stated: Stated, held: float | None) -> Link:
    """Read joint ``k`` and the body behind it."""
    name, inertia = model.names[k], model.inertias[k]
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model), np.zeros(model.nv))
    subspace = np.asarray(data.joints[k].S).reshape(6)
    sliding = bool(np.linalg.norm(subspace[:3]) > 0.5)
    low, high = stated.ranges.get(name, (-WIDEST, WIDEST))
    return Link(
        name=name,
        placement=model.jointPlacements[k].homogeneous,
        axis=subspace[:3] if sliding else subspace[3:],
        prismatic=sliding,
        q_min=low if held is None else max(low, -WIDEST),
        q_max=high if held is None else min(high, WIDEST),
        mass=float(inertia.mass),
        com=np.array(inertia.lever),
        inertia=np.array(inertia.inertia),
        armature=float(model.armature[model.joints[k].idx_v]),
        held=held,
    )


def _limits(
    stated: Stated,
    names: Sequence[str],
    given: LimitSet | None,
    bounds: Mapping[str, Mapping[str, float]],
) -> Limits:
    """Return the limits of the links; a joint that a set does not bound has no such bound."""
    more = {
        kind: np.array([bounds[kind].get(name, np.inf) for name in names])
        for kind in ("acceleration", "jerk", "torque_rate")
        if kind in bounds
    }
    limits = joint_level(
        "model" if given is None else given.name,
        tau=np.array([stated.torque[name] for name in names]),
        speed=np.array([stated.speed[name] for name in names]),
        **more,
    )
    return limits if given is None else replace(limits, force=given.force)
