"""The arm for programs that draw it: a URDF of the arm as it is driven, and how its frames move.

| frame              | where                                                                  |
|--------------------|------------------------------------------------------------------------|
| `world`            | the frame of all points                                                |
| `link_NAME`        | the link behind the joint of that name                                 |
| `hand`             | on the tool plate, z along the normal of palm or opening               |
| `finger_0`, ...    | fingers, at the angle at which the hand was commanded to close         |
| `catch_point`      | in the hand, as `hand`                                                 |

Held joints are fixed. Shapes are capsules: a cylinder and a ball at each end, as a URDF has no
capsule that all programs know.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from xml.etree.ElementTree import Element, SubElement, indent, tostring  # written, never parsed

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.arm.basket import Basket
from mitt.core.arm.description import (
    ArmModel,
    Capsule,
    Hand,
    Inertial,
    joint_motion,
    rotation,
    transform,
)
from mitt.core.arm.hands import HandModel
from mitt.core.signals import Array

WORLD = "world"
HAND = "hand"
CATCH_POINT = "catch_point"
"""Names of frames."""
#: Colours of links, of what stands still and of fingers, as red, green, blue, opacity.
_COLOURS = {"metal": "0.84 0.85 0.88 1", "dark": "0.36 0.39 0.44 1", "finger": "0.59 0.62 0.67 1"}
#: Torque [N m] and speed [rad/s] that a URDF has to state of a finger, whose servo has others.
_FINGER = (1.0, 10.0)
#: Sides of a basket's ring.
_SIDES = 12


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkFrame:
    """A frame on the one that carries it.

    Attributes:
        name: Its name.
        parent: Name of the frame that carries it.
        place: Its origin at joint value zero, in the parent's frame [m], (3,).
        turn: Its attitude there, a quaternion x, y, z, w, (4,).
        axis: Unit axis of the joint in the frame, (3,); all zero where it is fixed.
        slides: Whether the joint slides [m] instead of turning [rad].
        follows: Which active joint it follows, from 0; their number for the closing of the hand.
    """

    name: str
    parent: str
    place: tuple[float, ...]
    turn: tuple[float, ...]
    axis: tuple[float, ...] = (0.0, 0.0, 0.0)
    slides: bool = False
    follows: int = 0

    @property
    def moves(self) -> bool:
        """Whether it has a joint."""
        return any(self.axis)

    def poses(self, values: Array) -> Array:
        """Return origin [m] and attitude (x, y, z, w) for joint values (k,), shape (k, 7)."""
        axis, out = np.array(self.axis), np.empty((len(values), 7))
        out[:, :3], out[:, 3:] = self.place, self.turn
        if self.slides:
            way = _product(_product(out[:, 3:], np.array([*axis, 0.0])), _inverse(out[:, 3:]))
            out[:, :3] += values[:, None] * way[:, :3]
        elif self.moves:
            half = 0.5 * values[:, None]
            out[:, 3:] = _product(out[:, 3:], np.hstack((np.sin(half) * axis, np.cos(half))))
        return out


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Part:
    """A joint and the link behind it."""

    name: str
    child: str
    parent: str
    T: Array
    axis: Array | None = None
    slides: bool = False
    follows: int = 0
    bounds: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    inertial: Inertial | None = None
    shapes: tuple[Capsule, ...] = ()
    colour: str = "metal"

    @property
    def frame(self) -> LinkFrame:
        """Its frame."""
        R = self.T[:3, :3]
        axis = np.zeros(3) if self.axis is None else self.axis
        return LinkFrame(
            name=self.child,
            parent=self.parent,
            place=_plain(self.T[:3, 3]),
            turn=_plain(quaternion(R)),
            axis=_plain(axis),
            slides=self.slides,
            follows=self.follows,
        )


def frames_of(arm: Arm) -> tuple[LinkFrame, ...]:
    """Return the frames of an arm and its hand, each behind the one that carries it."""
    return tuple(part.frame for part in _parts(arm))


def urdf_of(arm: Arm) -> str:
    """Return the URDF of an arm with its hand, as it is driven: held joints are fixed.

    Ranges, largest torques and speeds are those of the arm's limits; masses and shapes those of
    its model.
    """
    root = Element("robot", name=arm.model.name)
    for name, rgba in _COLOURS.items():
        SubElement(SubElement(root, "material", name=name), "color", rgba=rgba)
    _add_shapes(SubElement(root, "link", name=WORLD), arm.model.base_capsules, "dark")
    for part in _parts(arm):
        _add_joint(root, part)
        link = SubElement(root, "link", name=part.child)
        if part.inertial is not None:
            _add_inertial(link, part.inertial)
        _add_shapes(link, part.shapes, part.colour)
    indent(root)
    return '<?xml version="1.0"?>\n' + tostring(root, encoding="unicode") + "\n"


def _parts(arm: Arm) -> list[_Part]:
    """Return joints and links from the base outwards, then the hand's."""
    model, out, before, T = arm.model, list[_Part](), WORLD, arm.model.mount
    active = 0
    for k, link in enumerate(model.links):
        at, child = T @ link.placement, f"link_{link.name}"
        body = Inertial(link.mass, link.com, link.inertia)
        if link.held is not None:
            out.append(
                _Part(
                    name=link.name,
                    child=child,
                    parent=before,
                    inertial=body,
                    T=at @ joint_motion(link, link.held),
                    shapes=link.capsules,
                )
            )
        else:
            most = float(arm.tau_max[active]), float(arm.dq_max[active])
            out.append(
                _Part(
                    name=link.name,
                    child=child,
                    parent=before,
                    T=at,
                    axis=link.axis,
                    slides=link.prismatic,
                    follows=active,
                    inertial=body,
                    bounds=(link.q_min, link.q_max, *most),
                    shapes=link.capsules or _stick(model, k),
                )
            )
            active += 1
        before, T = child, np.eye(4)
    return out + _hand_parts(model, before, active)


def _stick(model: ArmModel, k: int) -> tuple[Capsule, ...]:
    """Return a rod from a joint to the next one, for a link that has no shape of its own."""
    after = model.links[k + 1].placement if k + 1 < len(model.links) else model.tool
    return (_rod(np.zeros(3), after[:3, 3], 0.03),)


def _hand_parts(model: ArmModel, last: str, active: int) -> list[_Part]:
    """Return the hand, its fingers and the catch point."""
    hand = model.hand
    body = (
        None if hand is None else Inertial(hand.mass, np.array([0.0, 0.0, hand.com]), hand.inertia)
    )
    offset = 0.0 if hand is None else hand.catch_offset
    out = [
        _Part(
            name="to_hand",
            child=HAND,
            parent=last,
            T=model.tool,
            inertial=body,
            shapes=_hand_shapes(hand),
            colour="dark",
        ),
        _Part(
            name="to_catch_point",
            child=CATCH_POINT,
            parent=HAND,
            T=transform(p=np.array([0.0, 0.0, offset])),
        ),
    ]
    if not isinstance(hand, HandModel):
        return out
    finger = hand.finger
    points = [
        np.array([x - finger.base_radius, 0.0, z - finger.base_height])
        for x, z in finger.points(0.0)
    ]
    rods = tuple(_rod(a, b, finger.thickness) for a, b in pairwise(points))
    for k in range(hand.fingers):
        R = rotation(np.array([0.0, 0.0, 1.0]), hand.yaw + 2.0 * np.pi * k / hand.fingers)
        base = R @ np.array([finger.base_radius, finger.offset, finger.base_height])
        out.append(
            _Part(
                name=f"to_finger_{k}",
                child=f"finger_{k}",
                parent=HAND,
                T=transform(R, base),
                axis=np.array([0.0, -1.0, 0.0]),
                follows=active,
                bounds=(0.0, hand.drive.closed, *_FINGER),
                shapes=rods,
                colour="finger",
            )
        )
    return out


def _hand_shapes(hand: Hand | None) -> tuple[Capsule, ...]:
    """Return what stands still on the tool plate, as it looks."""
    if isinstance(hand, HandModel):
        return (_rod(np.zeros(3), np.array([0.0, 0.0, hand.palm_height - 0.03]), 0.03),)
    if not isinstance(hand, Basket):
        return ()
    around = 2.0 * np.pi * np.arange(_SIDES + 1) / _SIDES
    ring = np.column_stack(
        (
            hand.net_radius * np.cos(around),
            hand.net_radius * np.sin(around),
            np.full(_SIDES + 1, hand.ring_height),
        )
    )
    out = [_rod(a, b, hand.ring_thickness) for a, b in pairwise(ring)]
    for angle in 2.0 * np.pi * np.arange(hand.struts) / hand.struts:
        side = np.array([np.cos(angle), np.sin(angle), 0.0])
        foot = hand.flange * side
        knee = (hand.ring_radius + hand.clear) * side + [0.0, 0.0, hand.floor]
        top = hand.net_radius * side + [0.0, 0.0, hand.ring_height]
        out += [_rod(a, b, hand.strut) for a, b in pairwise((foot, knee, top))]
    return tuple(out)


def _rod(start: Array, end: Array, radius: float) -> Capsule:
    """Return a capsule between two points [m], shape (3,) each."""
    a, b = ((float(x), float(y), float(z)) for x, y, z in (start, end))
    return Capsule(start=a, end=b, radius=radius)


def _add_joint(root: Element, part: _Part) -> None:
    """Add a joint to a URDF."""
    kind = "fixed" if part.axis is None else "prismatic" if part.slides else "revolute"
    joint = SubElement(root, "joint", name=part.name, type=kind)
    SubElement(joint, "parent", link=part.parent)
    SubElement(joint, "child", link=part.child)
    _add_origin(joint, part.T)
    if part.axis is not None:
        lower, upper, effort, velocity = map(repr, map(float, part.bounds))
        SubElement(joint, "axis", xyz=_numbers(part.axis))
        SubElement(joint, "limit", lower=lower, upper=upper, effort=effort, velocity=velocity)


def _add_inertial(link: Element, body: Inertial) -> None:
    """Add mass properties to a link."""
    inertial = SubElement(link, "inertial")
    _add_origin(inertial, transform(p=body.com))
    SubElement(inertial, "mass", value=repr(float(body.mass)))
    rows = {
        "ixx": (0, 0),
        "ixy": (0, 1),
        "ixz": (0, 2),
        "iyy": (1, 1),
        "iyz": (1, 2),
        "izz": (2, 2),
    }
    SubElement(
        inertial, "inertia", {key: repr(float(body.inertia[at])) for key, at in rows.items()}
    )


def _add_shapes(link: Element, capsules: Sequence[Capsule], colour: str) -> None:
    """Add what is seen of a link."""
    for capsule in capsules:
        start, end, radius = np.array(capsule.start), np.array(capsule.end), repr(capsule.radius)
        length = float(np.linalg.norm(end - start))
        solids = [(transform(p=end), "sphere", {"radius": radius})]
        if length > 1e-6:
            T = transform(_along((end - start) / length), 0.5 * (start + end))
            solids += [
                (transform(p=start), "sphere", {"radius": radius}),
                (T, "cylinder", {"radius": radius, "length": repr(length)}),
            ]
        for T, kind, sizes in solids:
            visual = SubElement(link, "visual")
            _add_origin(visual, T)
            SubElement(SubElement(visual, "geometry"), kind, sizes)
            SubElement(visual, "material", name=colour)


def _along(z: Array) -> Array:
    """Return a rotation whose z axis is a unit vector, shape (3, 3)."""
    x = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
    x /= np.linalg.norm(x)
    return np.column_stack((x, np.cross(z, x), z))


def _add_origin(element: Element, T: Array) -> None:
    """Add where a frame is."""
    angles = _numbers(_roll_pitch_yaw(T[:3, :3]))
    SubElement(element, "origin", xyz=_numbers(T[:3, 3]), rpy=angles)


def _roll_pitch_yaw(R: Array) -> Array:
    """Return roll, pitch and yaw about fixed axes (REP 103) of a rotation [rad], shape (3,).

    Roll is taken from what yaw leaves, so that both agree where only their sum is known.
    """
    yaw = np.arctan2(R[1, 0], R[0, 0])
    rest = rotation(np.array([0.0, 0.0, 1.0]), -yaw) @ R
    return np.array([np.arctan2(-rest[1, 2], rest[1, 1]), np.arctan2(-rest[2, 0], rest[0, 0]), yaw])


def quaternion(R: Array) -> Array:
    """Return the unit quaternion x, y, z, w of a rotation matrix, shape (4,).

    I. Y. Bar-Itzhack, J. Guidance, Control, and Dynamics 23 (2000), 1085: an eigenvector, well
    conditioned for all rotations.
    """
    K = np.empty((4, 4))
    K[:3, :3] = R + R.T - np.trace(R) * np.eye(3)
    K[3, :3] = K[:3, 3] = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    K[3, 3] = np.trace(R)
    out: Array = np.linalg.eigh(K)[1][:, -1]
    return out if out[3] >= 0.0 else -out


def _product(a: Array, b: Array) -> Array:
    """Return products of quaternions x, y, z, w, shapes (..., 4)."""
    u, v, s, t = a[..., :3], b[..., :3], a[..., 3:], b[..., 3:]
    scalar = s * t - np.sum(u * v, axis=-1, keepdims=True)
    out: Array = np.concatenate((s * v + t * u + np.cross(u, v), scalar), axis=-1)
    return out


def _inverse(a: Array) -> Array:
    """Return the inverse of unit quaternions."""
    return np.asarray(a * np.array([-1.0, -1.0, -1.0, 1.0]))


def _numbers(values: Array) -> str:
    """Return numbers with all digits; those that are zero but for rounding as zero."""
    return " ".join(repr(float(x)) if abs(x) > 1e-15 else "0" for x in values)


def _plain(values: Array) -> tuple[float, ...]:
    """Return an array as a tuple."""
    return tuple(float(x) for x in values)
