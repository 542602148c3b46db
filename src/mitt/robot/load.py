"""Arms by name or from a URDF or MJCF file."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from mitt import checks
from mitt.errors import InputError, ModelError, UnknownNameError
from mitt.robot.arm import Arm
from mitt.robot.basket import Hand, checked_hand, hand_named, mounting
from mitt.robot.carried import joints_to, links_of
from mitt.robot.described import check_described, read_described
from mitt.robot.description import ArmModel, rotation, transform
from mitt.robot.limit_sets import LimitSet
from mitt.robot.limits import Limits
from mitt.robot.serial import MOUNTS, Mount, Wanted, serial_arm
from mitt.robot.wam import LIMIT_SETS, wam, wam_limits


def load_arm(
    name_or_path: str | Path = "wam",
    *,
    tip: str | None = None,
    joints: Sequence[str] | None = None,
    held: Mapping[str, float] | None = None,
    ready: Sequence[float] | None = None,
    limits: str | LimitSet | None = None,
    hand: Hand | str | None = None,
    hand_turn: float = 0.0,
    hand_mount: Mount = "catch",
    encoder_step: float | Sequence[float] | None = None,
) -> Arm:
    """Return an arm by name (``wam``) or from a URDF (``.urdf``) or MJCF (``.xml``) file.

    Args:
        name_or_path: Name or file.
        tip: Frame of the file whose origin is the catch point and whose z axis is the normal
            of the palm; only for files.
        joints: Active joints of the file, the others held; of the WAM j1, j2 and j4 if left out.
        held: Angles at which joints are held [rad]; any other is held at 0, or at the end of its
            range that is nearest to it.
        ready: Ready pose of the active joints, in their order [rad]; 0 if left out, or the middle
            of a range that 0 is not in.
        limits: Limit set: ``paper``, ``wam-48v``, ``wam-80v`` for the WAM; for files ``model``,
            what the file states, or a set that goes before it.
        hand: A hand, or the name of one of ``mitt.robot.basket.HANDS``; with ``none`` nothing is
            mounted, and the tip is the catch point. If left out, the WAM has the three-finger hand,
            and a file is taken to contain what the arm carries, as with ``none``.
        hand_turn: How far the hand is turned about the z axis of the tip [rad].
        hand_mount: For files: whether the hand's catch point or its plate is at the tip.
        encoder_step: Resolution of the encoders of the active joints [rad], one for all or one a
            joint; the WAM's own, or ``description.ENCODER_STEP`` for files, if left out.

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
    path = checks.path("arm", name_or_path)
    names = _names(joints)
    turn = checks.number("hand_turn", hand_turn, finite=True)
    checks.one_of("hand_mount", hand_mount, MOUNTS)
    held = _angles(held)
    if str(name_or_path) == "wam":
        if tip is not None:
            raise ModelError("arm wam", "no tip: it is fixed", tip)
        model, set_of = _wam(mounted, names, held, turn), _wam_limits(limits)
        return Arm(_with_encoders(_with_ready(model, names, ready), encoder_step), set_of)
    arm = _from_file(path, tip, names, ready, limits, (held, mounted, turn, hand_mount))
    arm.model.check_ranges()
    return arm if encoder_step is None else with_encoders(arm, encoder_step)


def _from_file(
    path: Path,
    tip: str | None,
    names: tuple[str, ...],
    ready: Sequence[float] | None,
    limits: str | LimitSet | None,
    rest: tuple[Mapping[str, float], Hand | None, float, Mount],
) -> Arm:
    """Return an arm from a description file; arguments as of :func:`load_arm`."""
    check_described(path)
    if isinstance(limits, str) and limits != "model":
        wanted = ("model",) if limits in LIMIT_SETS else ("model", *LIMIT_SETS)
        raise UnknownNameError("limits of an arm from a file", limits, wanted)
    if ready is not None and names:
        ready = checks.vector("ready", ready, len(names), finite=True).tolist()
    stated = read_described(path)
    if tip is None:
        links = ", ".join(links_of(stated.model)) or "none"
        raise ModelError(str(path), "tip and joints (--tip, --joints)", "no tip",
                         do="name as tip the link or site of the palm, and the active joints;"
                         f" links of the file: {links}")  # fmt: skip
    if not names:
        chain = ", ".join(joints_to(stated.model, tip)) or "none"
        raise ModelError(str(path), "tip and joints (--tip, --joints)", "no joints",
                         do=f"name the active joints; joints from the base to {tip!r}:"
                         f" {chain}")  # fmt: skip
    given = limits if isinstance(limits, LimitSet) else None
    held, hand, turn, mount = rest
    return serial_arm(
        stated,
        Wanted(name=path.stem, tip=tip, joints=names, held=held, ready=ready, limits=given,
               hand=hand, turn=turn, mount=mount),
    )  # fmt: skip


def with_encoders(arm: Arm, step: float | Sequence[float]) -> Arm:
    """Return an arm whose active joints have encoders of another resolution [rad]."""
    return Arm(_with_encoders(arm.model, step), arm.limits)


def _names(joints: Sequence[str] | None) -> tuple[str, ...]:
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


def _wam(
    hand: Hand | None, names: tuple[str, ...], held: Mapping[str, float], turn: float
) -> ArmModel:
    """Return the WAM with all but the named joints held; joint 3 where none is named."""
    full = wam(hand, held_3=None)
    known = full.names
    for kind, given in (("joint", names), ("held joint", tuple(held))):
        for name in given:
            if name not in known:
                raise UnknownNameError(kind, name, known)
    active = names or tuple(x for x in known if x != "j3")
    both = [x for x in active if x in held]
    if both or len(set(active)) < len(active):
        raise InputError("joints", "different joints, none of them held", ", ".join(active))
    angles = {**dict(zip(known, full.q_ready, strict=True)), **held}
    links = tuple(
        x if x.name in active else replace(x, held=float(angles[x.name])) for x in full.links
    )
    for x in links:
        if x.held is not None and not x.q_min <= x.held <= x.q_max:
            raise InputError(f"held {x.name}", f"an angle in {x.q_min:g}..{x.q_max:g}", x.held,
                             do="angles are in rad")  # fmt: skip
    q_ready = np.array([q for x, q in zip(known, full.q_ready, strict=True) if x in active])
    about_z = transform(rotation(np.array([0.0, 0.0, 1.0]), turn)) if turn else np.eye(4)
    tool = full.tool @ about_z @ mounting(hand)[1]
    return replace(full, links=links, q_ready=q_ready, tool=tool)


def _wam_limits(limits: str | LimitSet | None) -> Limits:
    """Return limits of the WAM."""
    if isinstance(limits, LimitSet):
        raise ModelError("limits of the wam", f"one of {', '.join(LIMIT_SETS)}", limits.name)
    return wam_limits("paper" if limits is None else checks.instance("limits", limits, str))


def _with_ready(model: ArmModel, names: tuple[str, ...], ready: Sequence[float] | None) -> ArmModel:
    """Return an arm with another ready pose, given in the order of the names."""
    if ready is None:
        return model
    order = names or model.names
    given = dict(zip(order, checks.vector("ready", ready, len(order), finite=True), strict=True))
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
