"""Arms by name or from a URDF or MJCF file."""

from collections.abc import Sequence
from dataclasses import replace
from math import hypot
from pathlib import Path

import numpy as np
import pinocchio as pin
from defusedxml import DefusedXmlException, ElementTree

from mitt import checks
from mitt.errors import FileError, InputError, ModelError, UnknownNameError, heard
from mitt.reading import read_text
from mitt.robot.arm import Arm
from mitt.robot.description import ArmModel, Link, transform
from mitt.robot.hands import HandModel
from mitt.robot.limits import Limits, joint_level
from mitt.robot.wam import LIMIT_SETS, wam, wam_limits

#: Largest description file read [byte]; real ones stay below 1 MB.
_MAX_BYTES = 5_000_000
#: Elements in one another; more would be too many for the parsers behind Pinocchio.
_MOST_LEVELS = 100
_HOW = "state them in the file (MJCF: actuatorfrcrange, numeric velocity_limit_JOINT)"


def load_arm(
    name_or_path: str | Path = "wam",
    *,
    tip: str | None = None,
    joints: Sequence[str] | None = None,
    limits: str | None = None,
    hand: HandModel | None = None,
    encoder_step: float | Sequence[float] | None = None,
) -> Arm:
    """Return an arm by name (``wam``) or from a URDF (``.urdf``) or MJCF (``.xml``) file.

    Args:
        name_or_path: Name or file.
        tip: Frame of the file whose origin is the catch point and whose z axis is the normal
            of the palm; only for files.
        joints: Active joints of the file, the others held at their neutral position.
        limits: Limit set: ``paper``, ``wam-48v``, ``wam-80v`` for the WAM, ``model`` for files.
        hand: For files: a hand to be mounted so that its catch point is at the tip; without
            one the file is taken to contain what the arm carries.
        encoder_step: Resolution of the encoders of the active joints [rad], one for all or one a
            joint; the WAM's own, or ``description.ENCODER_STEP`` for files, if left out.

    Raises:
        UnknownNameError: No such arm, joint, frame or limit set.
        FileError: The file cannot be read or parsed.
        ModelError: What it describes is no arm that can be used.
    """
    for name, value in (("tip", tip), ("limits", limits)):
        if value is not None:
            checks.instance(name, value, str)
    if hand is not None:
        checks.instance("hand", hand, HandModel)
    if not isinstance(name_or_path, str | Path):
        raise InputError("arm", "a name or a path", checks.shown(name_or_path))
    if str(name_or_path) == "wam":
        if tip is not None or joints is not None:
            raise ModelError("arm wam", "no tip and no joints: they are fixed", f"{tip}, {joints}")
        model = _with_encoders(wam(hand or HandModel()), encoder_step)
        return Arm(model, wam_limits(limits or "paper"))
    path = Path(name_or_path)
    if path.suffix not in (".urdf", ".xml", ".mjcf"):
        raise UnknownNameError("arm", str(name_or_path), ("wam", "a .urdf file", "an .xml MJCF"))
    if limits not in (None, "model"):
        wanted = ("model",) if limits in LIMIT_SETS else ("model", *LIMIT_SETS)
        raise UnknownNameError("limits of an arm from a file", str(limits), wanted)
    if tip is None or not joints:
        raise ModelError(str(path), "tip and joints", f"tip={tip}, joints={joints}",
                         do="name the frame of the catch point and the active joints")  # fmt: skip
    if isinstance(joints, str) or not isinstance(joints, Sequence):
        raise InputError("joints", "a list of names", checks.shown(joints))
    names = tuple(checks.instance("joints", joint, str) for joint in joints)
    arm = _from_pinocchio(_parse(path), path.stem, tip, names, hand)
    model = _with_encoders(arm.model, encoder_step)
    return arm if model is arm.model else Arm(model, arm.limits)


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


def _parse(path: Path) -> pin.Model:
    """Read a description file into Pinocchio, refusing what it would silently accept."""
    text = read_text(path, max_bytes=_MAX_BYTES)
    _check_numbers(path, text)
    build = pin.buildModelFromUrdf if path.suffix == ".urdf" else pin.buildModelFromMJCF
    with heard() as said:
        try:
            model, failed = build(str(path)), None
        except (ValueError, RuntimeError, IndexError, KeyError) as error:
            failed = error
    if failed is None:
        return _with_speeds(model, path, text)
    reason = f"{''.join(said)} {failed}".split() or ["a parse error"]
    raise FileError(str(path), "a URDF or MJCF arm", " ".join(reason)[:200]) from failed


def _with_speeds(model: pin.Model, path: Path, text: str) -> pin.Model:
    """Read the velocity limits of an MJCF: MuJoCo has none, so they stand among its own numbers.

    ``<custom><numeric name="velocity_limit_JOINT" data="8.0"/></custom>`` [rad/s or m/s]; what is
    no limit above 0 is refused later, with the name of its joint.
    """
    stated = {
        x.get("name", ""): x.get("data", "") for x in ElementTree.fromstring(text).iter("numeric")
    }
    for joint in list(model.names)[1:]:
        given = stated.get(f"velocity_limit_{joint}")
        if given is None:
            continue
        try:
            limit = float(given)
        except ValueError:
            limit = 0.0
        if not 0.0 < limit < np.inf:
            raise FileError(f"{path} velocity_limit_{joint}", "a number above 0", repr(given[:60]))
        at = model.joints[model.getJointId(joint)].idx_v
        model.lowerVelocityLimit[at], model.upperVelocityLimit[at] = -limit, limit
    return model


def _check_numbers(path: Path, text: str) -> None:
    """Refuse malformed XML, and masses and inertias of a URDF that are no numbers.

    Pinocchio takes a link whose mass does not parse for one without mass.
    """
    try:
        root = ElementTree.fromstring(text, forbid_dtd=True)
    except (ElementTree.ParseError, DefusedXmlException, ValueError) as error:
        raise FileError(str(path), "well-formed XML", error) from error
    level = [root]
    for _ in range(_MOST_LEVELS):
        level = [child for element in level for child in element]
    if level:
        raise FileError(str(path), f"at most {_MOST_LEVELS} elements in one another", "more")
    if root.find(".//include") is not None:
        raise FileError(str(path), "one file", "one that includes others", do="join them")
    for element in root.iter():
        file = element.attrib.get("file", "")
        if file.startswith(("/", "~", "\\")) or ".." in Path(file).parts:
            raise FileError(str(path), "meshes below its own folder", repr(file[:60]))
    for axis in root.iter("axis"):
        given = axis.attrib.get("xyz", "1 0 0")
        try:
            size = hypot(*(float(x) for x in given.split()))
        except ValueError:
            size = 0.0
        if not 1e-6 < size < 1e6:
            raise FileError(str(path), "joint axes with a direction", repr(given[:60]))
    for inertial in root.iter("inertial"):
        for element in (x for x in inertial if x.tag in ("mass", "inertia")):
            for key, value in element.attrib.items():
                try:
                    finite = np.isfinite(float(value))
                except ValueError:
                    finite = False
                if not finite:
                    raise FileError(str(path), f"a number for {element.tag} {key}", repr(value))


def _from_pinocchio(
    full: pin.Model, name: str, tip: str, joints: tuple[str, ...], hand: HandModel | None
) -> Arm:
    """Lock all but the active joints and read what is left as a serial chain."""
    known = list(full.names)[1:]
    for joint in joints:
        if joint not in known:
            raise UnknownNameError("joint", joint, known)
    _frame(full, tip)
    locked = [full.getJointId(k) for k in known if k not in joints]
    model = pin.buildReducedModel(full, locked, pin.neutral(full))
    frame = _frame(model, tip)
    if list(model.parents)[1:] != list(range(model.njoints - 1)) or (
        frame.parentJoint != model.njoints - 1
    ):
        raise ModelError("joints", f"joints one behind the other from the base to {tip!r}", joints)
    links = tuple(_link(model, k) for k in range(1, model.njoints))
    tool = frame.placement.homogeneous
    if hand is not None:
        tool = tool @ transform(p=np.array([0.0, 0.0, -hand.catch_offset]))
    q_min, q_max = np.array([x.q_min for x in links]), np.array([x.q_max for x in links])
    middle = 0.5 * (q_min + q_max)
    description = ArmModel(
        name=name,
        links=links,
        tool=tool,
        hand=hand,
        q_ready=np.where((q_min < 0.0) & (q_max > 0.0), 0.0, middle),
        base_capsules=(),
        mount=np.eye(4),
    )
    return Arm(description, _limits(model))


def _frame(model: pin.Model, tip: str) -> pin.Frame:
    """Return the frame of a name, the body where a joint is called the same."""
    named = [frame for frame in model.frames if frame.name == tip]
    if not named:
        raise UnknownNameError("tip", tip, (frame.name for frame in model.frames))
    bodies = [frame for frame in named if frame.type == pin.FrameType.BODY]
    return (bodies or named)[0]


def _link(model: pin.Model, k: int) -> Link:
    """Read joint ``k`` and the body behind it."""
    name, joint, inertia = model.names[k], model.joints[k], model.inertias[k]
    if joint.nq != 1 or joint.nv != 1:
        raise ModelError(f"joint {name!r}", "a hinge or slide with a range", joint.shortname(),
                         do="give a continuous joint limits, or hold it")  # fmt: skip
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model), np.zeros(model.nv))
    subspace = np.asarray(data.joints[k].S).reshape(6)
    sliding = bool(np.linalg.norm(subspace[:3]) > 0.5)
    at = joint.idx_v
    return Link(
        name=name,
        placement=model.jointPlacements[k].homogeneous,
        axis=subspace[:3] if sliding else subspace[3:],
        prismatic=sliding,
        q_min=float(model.lowerPositionLimit[at]),
        q_max=float(model.upperPositionLimit[at]),
        mass=float(inertia.mass),
        com=np.array(inertia.lever),
        inertia=np.array(inertia.inertia),
        armature=float(model.armature[at]),
    )


def _limits(model: pin.Model) -> Limits:
    """Read the torque and speed limits that the file states."""
    tau, speed = np.array(model.upperEffortLimit), np.array(model.upperVelocityLimit)
    for k, joint in enumerate(list(model.names)[1:]):
        if not (0.0 < tau[k] < np.inf and 0.0 < speed[k] < np.inf):
            given = f"{tau[k]:g} and {speed[k]:g}"
            wanted = "an effort and a velocity limit above 0"
            raise ModelError(f"joint {joint!r}", wanted, given, do=_HOW)
    return joint_level("model", tau=tau, speed=speed)
