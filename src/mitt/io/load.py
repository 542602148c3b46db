"""Arms by name or from a URDF or MJCF file.

Of a file, the chain of joints from the base to the tip becomes the arm; which of them move, and
where the others are held, is said by name. What a limit set says goes before what the file states.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from mitt.core import checks
from mitt.core.arm.arm import Arm
from mitt.core.arm.basket import hand_named
from mitt.core.arm.description import (
    ArmModel,
    Hand,
    Inertial,
    Link,
    checked_hand,
    mended_inertia,
    mounting,
    rotation,
    transform,
)
from mitt.core.arm.limits import KINDS, Limits, LimitSet, joint_level
from mitt.core.errors import InputError, ModelError, UnknownNameError
from mitt.core.signals import Array
from mitt.io.description_files import LeftOut, Seat, Stated, check_suffix
from mitt.io.meshes import carried_shapes
from mitt.io.mjcf import read_mjcf
from mitt.io.reading import shipped, shipped_path
from mitt.io.units import WIDEST, check_range, check_set, doubts
from mitt.io.urdf import read_urdf
from mitt.io.wam import LIMIT_SETS, wam, wam_limits

Mount = Literal["catch", "plate"]
"""What of a hand is at the tip of an arm: its catch point, or its plate."""
_MOUNTS: tuple[Mount, ...] = ("catch", "plate")
_Z = np.array([0.0, 0.0, 1.0])
TIP_AXES = {
    "x": np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]),
    "-x": np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]),
    "y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
    "-y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
    "z": np.eye(3),
    "-z": np.diag([1.0, -1.0, -1.0]),
}
"""Axes of a tip that a hand may point along, and the turns that bring its z axis there."""
_READERS = {".urdf": read_urdf, ".xml": read_mjcf, ".mjcf": read_mjcf}
#: What else may be named as an arm; an arm file is read by :func:`mitt.load_arm`.
_FILES = ("an arm file (.toml)", "a URDF (.urdf)", "an MJCF (.xml)")
#: Kinds of bounds that a description states, too.
_STATED = ("lower", "upper", "torque", "speed")
#: How an error calls what an active joint needs.
_LIMITS = {
    "range": "a range",
    "torque": "an effort limit above 0",
    "speed": "a velocity limit above 0",
    "mass": "a mass above 0 behind it",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class _Wanted:
    """What is wanted of an arm; see :func:`build_arm`. Tip and limit set are for files alone."""

    name: str
    joints: tuple[str, ...]
    held: Mapping[str, float]
    ready: Sequence[float] | None
    hand: Hand | None
    turn: float
    mount: Mount
    tip: str = ""
    axis: str = "z"
    limits: LimitSet | None = None


def build_arm(
    name_or_path: str | Path = "wam",
    *,
    tip: str | None = None,
    joints: Sequence[str] | None = None,
    held: Mapping[str, float] | None = None,
    ready: Sequence[float] | None = None,
    limits: str | LimitSet | None = None,
    hand: Hand | str | None = None,
    hand_turn: float = 0.0,
    hand_mount: Mount | None = None,
    encoder_step: float | Sequence[float] | None = None,
) -> Arm:
    """Return an arm by name or from a URDF (``.urdf``) or MJCF (``.xml``) file.

    The arguments are those of :func:`mitt.io.arm_file.load_arm`, but for ``limits``: a name of
    the WAM's, ``model``, what the file states, or a set that goes before it; if left out, what the
    file states.

    Raises:
        UnknownNameError: No such arm, joint, frame, hand or limit set.
        FileError: The file cannot be read or parsed.
        ModelError: What it describes is no arm that can be used.
    """
    if tip is not None:
        checks.instance("tip", tip, str)
    if hand is None:
        hand = "three-finger" if str(name_or_path) == "wam" else "none"
    mounted = hand_named(hand) if isinstance(hand, str) else checked_hand(hand)
    ships = is_shipped(name_or_path)
    mount = hand_mount if hand_mount is not None else "plate" if ships else "catch"
    path = described(name_or_path)
    names = checked_joints(joints)
    turn = checks.number("hand_turn", hand_turn, finite=True)
    checks.one_of("hand_mount", mount, _MOUNTS)
    wanted = _Wanted(
        name=path.stem,
        joints=names,
        held=_angles(held),
        ready=ready,
        hand=mounted,
        turn=turn,
        mount=mount,
    )
    if str(name_or_path) == "wam":
        if tip is not None:
            raise ModelError("arm wam", "no tip: it is fixed", tip)
        model, set_of = _wam(wanted), _wam_limits(limits)
        return Arm(_with_encoders(_with_ready(model, wanted), encoder_step), set_of)
    arm = _from_file(path, tip, limits, wanted, ships=ships)
    arm.model.check_ranges()
    return arm if encoder_step is None else with_encoders(arm, encoder_step)


def with_encoders(arm: Arm, step: float | Sequence[float]) -> Arm:
    """Return an arm whose active joints have encoders of another resolution [rad]."""
    return Arm(_with_encoders(arm.model, step), arm.limits)


def with_hand(arm: Arm, hand: Hand) -> Arm:
    """Return an arm that carries another hand, mounted on the same plate."""
    model = arm.model
    plate = model.tool @ np.linalg.inv(mounting(model.hand)[1])
    return Arm(replace(model, hand=hand, tool=plate @ mounting(hand)[1]), arm.limits)


def arm_names() -> tuple[str, ...]:
    """Return the names of all arms that come with mitt, the WAM first."""
    return ("wam", *shipped("arms"))


def is_shipped(name_or_path: str | Path) -> bool:
    """Say whether an arm is one whose description comes with mitt, by its name."""
    return str(name_or_path) in shipped("arms")


def described(name_or_path: str | Path) -> Path:
    """Return the description file of an arm that ships, by its name; any other as it is."""
    path = checks.path("arm", name_or_path)
    return shipped_path("arms", str(path), ".urdf") if is_shipped(path) else path


def is_described(path: Path) -> bool:
    """Say whether a name is that of a description file."""
    return path.suffix.lower() in _READERS


def check_described(path: Path) -> None:
    """Refuse a name that is not that of a description file.

    Raises:
        UnknownNameError: It is neither a URDF nor an MJCF.
        FileError: It is another kind of description.
    """
    check_suffix(path)
    if not is_described(path):
        files = [x for x in _FILES if path.suffix != ".toml" or ".toml" not in x]
        raise UnknownNameError(
            "arm", str(path), (*arm_names(), *files), do="a file is named by its path"
        )


def read_described(path: Path) -> Stated:
    """Read a description file.

    Raises:
        UnknownNameError: It is neither a URDF nor an MJCF by its name.
        FileError: It cannot be read.
    """
    path = checks.path("path", path)
    check_described(path)
    return _READERS[path.suffix.lower()](path)


def _from_file(
    path: Path, tip: str | None, limits: str | LimitSet | None, wanted: _Wanted, *, ships: bool
) -> Arm:
    """Return an arm from a description file; arguments as of :func:`build_arm`.

    Of one that ships, the tip is the flange and all joints are active, where nothing is said.
    """
    names, ready = wanted.joints, wanted.ready
    check_described(path)
    if isinstance(limits, str) and limits != "model":
        raise UnknownNameError(
            "limits",
            limits,
            ("model", *shipped("limits"), "a .toml file"),
            do=f"{', '.join(LIMIT_SETS)} are of the WAM; leave them out for the arm's own",
        )
    stated = read_described(path)
    tip, axis = (None, "z") if tip is None else _frame_and_axis(stated, tip)
    if ships:
        tip = stated.tree.flange if tip is None else tip
        names = names or tuple(stated.tree.joints_to(tip))
    if tip is None:
        links = ", ".join(stated.tree.links) or "none"
        raise ModelError(
            str(path),
            "tip and joints (--tip, --joints)",
            "no tip",
            do="name as tip the link or site of the palm, and the active joints;"
            f" links of the file: {links}",
        )
    if not names:
        chain = ", ".join(stated.tree.joints_to(tip)) or "none"
        raise ModelError(
            str(path),
            "tip and joints (--tip, --joints)",
            "no joints",
            do=f"name the active joints; joints from the base to {tip!r}: {chain}",
        )
    if ready is not None:
        ready = checks.vector("ready", ready, len(names), finite=True).tolist()
    given = limits if isinstance(limits, LimitSet) else None
    wanted = replace(wanted, tip=tip, axis=axis, joints=names, ready=ready, limits=given)
    return _serial_arm(stated, wanted)


def _frame_and_axis(stated: Stated, tip: str) -> tuple[str, str]:
    """Return the frame that a tip names, and which of its axes a hand points along."""
    frame, _, axis = tip.rpartition(":")
    return (frame, axis) if frame and tip not in stated.tree and axis in TIP_AXES else (tip, "z")


def _serial_arm(stated: Stated, wanted: _Wanted) -> Arm:
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
    seats = stated.tree.seats(loads, q)
    tool = plate = _tool(seats[stated.tree.place(wanted.tip)].pose, wanted)
    if wanted.hand is not None:
        tool = plate @ mounting(wanted.hand)[1]
    shapes = carried_shapes(stated, seats, len(loads), None if wanted.hand is None else plate)
    bodies = [_body(stated, seats, k) for k in range(1, len(loads) + 1)]
    links = tuple(
        replace(
            _link(stated, seats, name, body, None if name in wanted.joints else q[name]),
            capsules=capsules,
        )
        for name, (body, _), capsules in zip(loads, bodies, shapes[1:], strict=True)
    )
    notes = (
        stated.notes
        + set_notes
        + tuple(note for _, note in bodies if note)
        + doubts(stated, links, tool)
        + _left_out_notes(stated, loads, wanted.joints)
        + tuple(_locked_note(stated, x) for x in chain if x not in loads)
        + tuple(_follower_notes(stated, chain, wanted.joints))
    )
    description = ArmModel(
        name=wanted.name,
        links=links,
        tool=tool,
        hand=wanted.hand,
        q_ready=_ready(links, wanted),
        base_capsules=shapes[0],
        mount=np.eye(4),
        notes=notes,
    )
    return Arm(description, _limits(stated, loads, wanted.limits, limits))


def _bears(stated: Stated, name: str) -> bool:
    """Say whether it is known what a held joint can bear, and what it carries."""
    return set(stated.missing(name)) <= {"range"}


def _body(stated: Stated, seats: Sequence[Seat], k: int) -> tuple[Inertial, str]:
    """Return all that joint ``k`` of the chain carries as one body, and a note if it was mended."""
    carried = [
        (part, pose)
        for part, (carrier, pose) in zip(stated.tree.parts, seats, strict=True)
        if carrier == k
    ]
    body = Inertial(0.0, np.zeros(3), np.zeros((3, 3)))
    for part, pose in carried:
        if part.mass != 0.0 or part.inertia.any():
            own = Inertial(part.mass, part.com, part.inertia).moved(pose)
            body = body.joined(own) if body.mass or body.inertia.any() else own
    if not 0.0 < body.mass < np.inf:
        return body, ""  # which a link refuses
    link = next((part.name for part, _ in carried if part.kind == "link"), "")
    where = f"link {link!r} behind joint {carried[0][0].name!r}"
    inertia, note = mended_inertia(where, body.mass, body.inertia)
    return (body._replace(inertia=inertia) if note else body), note


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
    return (
        f"stated in the file and not counted in what drives give: {'; '.join(words[:4])}{rest};"
        " what matters goes into a limits file (--limits FILE.toml)",
    )


def _locked_note(stated: Stated, name: str) -> str:
    """Return why a held joint is taken as rigid, and where what is missing can be stated."""
    missing = [x for x in stated.missing(name) if x != "range"]
    return (
        f"held joint {name!r}: no {' and no '.join(missing)} known; taken as rigid;"
        f" {stated.remedy(name)}"
    )


def _follower_notes(stated: Stated, chain: Sequence[str], active: Sequence[str]) -> Iterator[str]:
    """Yield a note of each joint beside the chain that an active joint moves, as of a linkage."""
    for name in stated.mimics:
        leader = name
        for _ in stated.mimics:  # once for each, so that a joint may follow one that follows
            leader = stated.mimics[leader].joint if leader in stated.mimics else leader
        if name not in chain and leader in active and name in stated.tree.joints:
            yield (
                f"joint {name!r} beside the chain mimics {leader!r}, an active joint: what is"
                f" behind it ({_carried(stated, name):.3g} kg) is taken as rigid, and does not"
                " turn with it"
            )


def _carried(stated: Stated, name: str) -> float:
    """Return the mass of all that is behind a joint [kg]."""
    parts = stated.tree.parts
    behind = {next(k for k, x in enumerate(parts) if x.name == name and x.kind != "link")}
    for k, part in enumerate(parts):
        if k and part.before in behind:
            behind.add(k)
    return sum(parts[k].mass for k in behind)


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
    check_set(stated.tree, limits.name, bounds)
    return _tightened(stated, bounds), bounds


def _chain(stated: Stated, wanted: _Wanted) -> list[str]:
    """Return the joints between base and tip that turn or slide, from the base outwards."""
    _check_names(wanted, stated.tree.joints)
    both = [x for x in wanted.joints if x in wanted.held]
    if both:
        raise InputError("held", "joints that are not active", ", ".join(both))
    chain = stated.tree.joints_to(wanted.tip)
    for name in chain:
        kind = stated.tree.joint(name).kind
        if kind not in ("hinge", "slide"):
            raise ModelError(
                f"joint {name!r}",
                "one axis, on a base that stands still",
                f"a {kind} joint",
                do="make the joint fixed in the file",
            )
        mimic = stated.mimics.get(name)
        if name in wanted.joints and mimic is not None:
            raise ModelError(
                f"joint {name!r}",
                "an active joint with a drive of its own",
                f"one that mimics {mimic.joint!r}",
            )
        if mimic is not None and mimic.joint in wanted.joints:
            raise ModelError(
                f"joint {name!r}",
                "joints between base and tip that do not follow an active one",
                f"one that mimics {mimic.joint!r}",
            )
    beside = [x for x in wanted.joints if x not in chain]
    if beside or len(set(wanted.joints)) < len(wanted.joints):
        given = f"{', '.join(beside)} beside it" if beside else ", ".join(wanted.joints)
        raise ModelError(
            "joints",
            f"different joints from the base to {wanted.tip!r}:"
            f" {', '.join(chain) or 'none moves it'}",
            given,
        )
    for name, value in wanted.held.items():
        low, high = stated.ranges.get(name, (-np.inf, np.inf))
        if not low <= value <= high:
            raise InputError(
                f"held {name}",
                f"an angle in {low:.4g}..{high:.4g}",
                f"{value:g}",
                do="angles are in rad",
            )
    return chain


def _tightened(stated: Stated, limits: Mapping[str, Mapping[str, float]]) -> Stated:
    """Return what a file states with the bounds of a set: its torques and speeds, both ranges."""
    ranges = dict(stated.ranges)
    for name, low in limits.get("lower", {}).items():
        high = limits["upper"][name]
        own = ranges.get(name, (-np.inf, np.inf))
        ranges[name] = max(low, own[0]), min(high, own[1])
        if not ranges[name][0] < ranges[name][1]:
            raise ModelError(
                f"limits of joint {name!r}",
                f"a range that meets that of the file, {own[0]:.4g}..{own[1]:.4g}",
                f"{low:.4g}..{high:.4g}",
            )
    torque = {**stated.torque, **limits.get("torque", {})}
    speed = {**stated.speed, **limits.get("speed", {})}
    return replace(stated, ranges=ranges, torque=torque, speed=speed)


def check_active(stated: Stated, name: str) -> None:
    """Refuse an active joint without range, torque, speed or mass, or with a range in degrees.

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
    if stated.tree.joint(name).kind == "hinge":
        check_range(where, *stated.ranges[name])


def _check_loop(stated: Stated, chain: Sequence[str], first: str, second: str) -> None:
    """Refuse a file that joins two bodies which joints of the chain move against one another."""
    carriers = [[x for x in stated.tree.joints_to(name) if x in chain] for name in (first, second)]
    if carriers[0] != carriers[1]:
        raise ModelError(
            stated.place,
            "an arm without closed chains",
            f"{first!r} joined to {second!r}",
            do="take the equality out of the file",
        )


def _tool(tip: Array, wanted: _Wanted) -> Array:
    """Return the frame of the tool plate, at the tip or behind it, turned about its z axis."""
    tool = tip @ transform(TIP_AXES[wanted.axis] @ rotation(_Z, wanted.turn))
    if wanted.hand is None or wanted.mount == "plate":
        return np.asarray(tool)
    return np.asarray(tool @ transform(p=np.array([0.0, 0.0, -mounting(wanted.hand)[0]])))


def _ready(links: Sequence[Link], wanted: _Wanted) -> Array:
    """Return the ready pose of the active joints, from the base outwards [rad], shape (n,)."""
    active = [x for x in links if x.held is None]
    if wanted.ready is not None:
        given = dict(zip(wanted.joints, wanted.ready, strict=True))
        return np.array([given[x.name] for x in active])
    return np.array([0.0 if x.q_min < 0.0 < x.q_max else 0.5 * (x.q_min + x.q_max) for x in active])


def _link(
    stated: Stated, seats: Sequence[Seat], name: str, body: Inertial, held: float | None
) -> Link:
    """Return a joint of the chain and the body behind it."""
    joint = stated.tree.joint(name)
    low, high = stated.ranges.get(name, (-WIDEST, WIDEST))
    return Link(
        name=name,
        placement=seats[joint.before].pose @ joint.placement,
        axis=joint.axis,
        prismatic=joint.kind == "slide",
        q_min=low if held is None else max(low, -WIDEST),
        q_max=high if held is None else min(high, WIDEST),
        armature=joint.armature,
        held=held,
        **body._asdict(),
    )


def _limits(
    stated: Stated,
    names: Sequence[str],
    given: LimitSet | None,
    bounds: Mapping[str, Mapping[str, float]],
) -> Limits:
    """Return the limits of the links; a joint that a set does not bound has no such bound."""
    more: dict[str, Any] = {
        kind: np.array([bounds[kind].get(name, np.inf) for name in names])
        for kind in KINDS
        if kind in bounds and kind not in _STATED
    }
    limits = joint_level(
        "model" if given is None else given.name,
        tau=np.array([stated.torque[name] for name in names]),
        speed=np.array([stated.speed[name] for name in names]),
    )
    limits = replace(limits, **more)
    return limits if given is None else replace(limits, force=given.force)


def checked_joints(joints: Sequence[str] | None) -> tuple[str, ...]:
    """Return names of joints; none where they were left out."""
    if joints is None:
        return ()
    if isinstance(joints, str) or not isinstance(joints, Sequence):
        raise InputError("joints", "a list of names", checks.shown(joints))
    return tuple(checks.instance("joints", joint, str) for joint in joints)


def _angles(held: Mapping[str, float] | None) -> dict[str, float]:
    """Return angles [rad] by joint; none where they were left out."""
    given = {} if held is None else checks.mapping("held", held)
    return {
        checks.text("held", name): checks.number(f"held {name}", angle, finite=True)
        for name, angle in given.items()
    }


def _check_names(wanted: _Wanted, known: Sequence[str]) -> None:
    """Refuse joints that the arm does not have."""
    for kind, names in (("joint", wanted.joints), ("held joint", tuple(wanted.held))):
        for name in names:
            if name not in known:
                raise UnknownNameError(kind, name, known)


def _wam(wanted: _Wanted) -> ArmModel:
    """Return the WAM with all but the named joints held; joint 3 where none is named."""
    full, hand, held = wam(wanted.hand, held_3=None), wanted.hand, wanted.held
    known = full.names
    _check_names(wanted, known)
    active = wanted.joints or tuple(x for x in known if x != "j3")
    both = [x for x in active if x in held]
    if both or len(set(active)) < len(active):
        raise InputError("joints", "different joints, none of them held", ", ".join(active))
    angles = {**dict(zip(known, full.q_ready, strict=True)), **held}
    links = tuple(
        x if x.name in active else replace(x, held=float(angles[x.name])) for x in full.links
    )
    for x in links:
        if x.held is not None and not x.q_min <= x.held <= x.q_max:
            raise InputError(
                f"held {x.name}",
                f"an angle in {x.q_min:g}..{x.q_max:g}",
                x.held,
                do="angles are in rad",
            )
    q_ready = np.array([q for x, q in zip(known, full.q_ready, strict=True) if x in active])
    about_z = transform(rotation(_Z, wanted.turn)) if wanted.turn else np.eye(4)
    tool = full.tool @ about_z @ mounting(hand)[1]
    return replace(full, links=links, q_ready=q_ready, tool=tool)


def _wam_limits(limits: str | LimitSet | None) -> Limits:
    """Return limits of the WAM."""
    if isinstance(limits, LimitSet):
        raise ModelError("limits of the wam", f"one of {', '.join(LIMIT_SETS)}", limits.name)
    return wam_limits("paper" if limits is None else checks.instance("limits", limits, str))


def _with_ready(model: ArmModel, wanted: _Wanted) -> ArmModel:
    """Return an arm with another ready pose, given in the order of the names."""
    if wanted.ready is None:
        return model
    order = wanted.joints or model.names
    ready = checks.vector("ready", wanted.ready, len(order), finite=True)
    given = dict(zip(order, ready, strict=True))
    return replace(model, q_ready=np.array([given[x] for x in model.names]))


def _with_encoders(model: ArmModel, step: float | Sequence[float] | None) -> ArmModel:
    """Return an arm whose active joints have encoders of a resolution [rad], if one is given."""
    if step is None:
        return model
    one = isinstance(step, int | float)
    steps = np.full(len(model.active), step) if one else checks.array("encoder_step", step, (None,))
    if len(steps) != len(model.active):
        wanted = f"one number, or one for each of {len(model.active)} joints"
        raise ModelError("encoder_step", wanted, f"{len(steps)}")
    links = list(model.links)
    for k, x in zip(model.active, steps, strict=True):
        links[k] = replace(links[k], encoder_step=float(x))
    return replace(model, links=tuple(links))
