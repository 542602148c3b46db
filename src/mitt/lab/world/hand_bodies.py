"""Hands as MuJoCo bodies on the tool plate: fingers about a soft palm, or a basket with a net.

Nothing holds the ball but contact and friction: no weld, no adhesion. The hand has a dished palm
and fingers with motors. The basket is a ring on struts, as hard as the ball, and a net of cords
that damps: they do not move, they give way as a net does because their contact is soft, a spring
and a damper along each cord's normal, about 15 mm deep at 5 m/s. A ball that goes deeper than its
own radius, one of 20 mm at 6 m/s, is through.
"""

from collections.abc import Sequence

import mujoco
import numpy as np

from mitt.core.arm.basket import Basket
from mitt.core.arm.description import Hand, checked_inertia, rotation, steiner
from mitt.core.arm.hands import Finger, HandModel
from mitt.core.arm.tools import Jaw, Paddle, Suction
from mitt.core.errors import ModelError
from mitt.core.signals import Array

#: Who may touch whom: a bit for each kind of geom. Two geoms meet if the one's kind is among
#: those that the other meets.
BALL = 1
HAND = 2
ARM = 4
FLOOR = 8

#: Stops and contacts settle within 4 ms, eight simulation steps, critically damped.
STIFF = (0.004, 1.0)

#: Sliding (rubber on plastic), torsional [m] and rolling [m] friction of hand and ball.
FRICTION = (1.0, 0.01, 1e-4)

#: The net's contact, in MuJoCo's direct form (-stiffness, -damping per kilogram) [1/s^2, 1/s]: a
#: ball of 5 m/s is stopped within 20 mm, and 100 m/s^2 push it 20 mm deep. Choices of this project.
NET = (-5000.0, -300.0)
#: Sliding (nylon), torsional [m] and rolling [m] friction of ball and net: choices, as of the hand.
NET_FRICTION = (0.5, 0.01, 1e-4)

#: Parts that never reach the arm's last links: their names begin so.
SMALL_PARTS = ("finger", "rim", "cord")

_PALM = (0.17, 0.18, 0.21, 1.0)
_METAL = (0.72, 0.74, 0.78, 1.0)
_CORD = (0.93, 0.93, 0.90, 1.0)


def add_tool(spec: mujoco.MjSpec, plate: mujoco.MjsBody, hand: Hand) -> tuple[str, ...]:
    """Add what an arm carries to its tool plate; return the names of its fingers' joints."""
    match hand:
        case HandModel():
            return add_hand(spec, plate, hand)
        case Suction():
            return add_suction(spec, plate, hand)
        case Jaw():
            return add_jaw(spec, plate, hand)
        case Basket():
            add_basket(plate, hand)
        case Paddle():
            add_paddle(plate, hand)
    return ()


def add_hand(spec: mujoco.MjSpec, plate: mujoco.MjsBody, hand: HandModel) -> tuple[str, ...]:
    """Add a hand to the tool plate.

    Args:
        spec: Model that is being built, angles in radians.
        plate: The tool plate, z along the palm normal.
        hand: The hand.

    Returns:
        Names of the finger joints, which are those of their motors too.
    """
    palm = plate.add_body(name="palm")
    _add_palm_geoms(palm, hand)
    names = tuple(f"finger{k}" for k in range(hand.fingers))
    placed = []
    for k, name in enumerate(names):
        R = rotation(np.array([0.0, 0.0, 1.0]), hand.yaw + 2.0 * np.pi * k / hand.fingers)
        base = R @ np.array([hand.finger.base_radius, hand.finger.offset, hand.finger.base_height])
        _add_finger(spec, palm.add_body(name=name, pos=base, quat=_quaternion(R)), name, hand)
        mass, com, inertia = finger_inertial(hand.finger)
        placed.append((mass, base + R @ com, R @ inertia @ R.T))
    set_inertial(palm, *_rest(hand, placed))
    return names


def finger_inertial(finger: Finger) -> tuple[float, Array, Array]:
    """Return mass, centre of mass (3,) and inertia about it (3, 3) of a finger, open.

    In the finger's frame: x outward, z along the palm normal, origin at the joint.
    """
    points = np.array(finger.points(0.0))
    points = np.column_stack((points[:, 0], np.zeros(3), points[:, 1]))
    points = points - points[0]
    rods = []
    for start, end in ((points[0], points[1]), (points[1], points[2])):
        length = float(np.linalg.norm(end - start))
        mass = finger.mass * length / (finger.proximal + finger.distal)
        along = np.outer(end - start, end - start) / length**2
        across = mass * (3.0 * finger.thickness**2 + length**2) / 12.0
        spin = 0.5 * mass * finger.thickness**2
        rods.append((mass, 0.5 * (start + end), across * (np.eye(3) - along) + spin * along))
    com = sum(m * p for m, p, _ in rods) / finger.mass
    inertia = sum(i + steiner(m, p - com) for m, p, i in rods)
    return finger.mass, np.asarray(com), np.asarray(inertia)


def _quaternion(R: Array) -> Array:
    """Return the unit quaternion (w, x, y, z) of a rotation matrix, shape (4,)."""
    out = np.zeros(4)
    mujoco.mju_mat2Quat(out, np.ascontiguousarray(R).reshape(9))
    return out


def set_inertial(body: mujoco.MjsBody, mass: float, com: Array, inertia: Array) -> None:
    """Give a body its mass [kg], centre of mass [m] and inertia about it [kg m^2]."""
    body.explicitinertial = True
    body.mass, body.ipos = mass, com
    i = inertia
    body.fullinertia = [i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]]


def _rest(hand: HandModel, fingers: list[tuple[float, Array, Array]]) -> tuple[float, Array, Array]:
    """Return what the palm must weigh so that palm and open fingers make up the whole hand.

    Raises:
        ModelError: The fingers are more than the hand leaves room for.
    """
    do = "give the whole hand, or lighter fingers"
    whole_com = np.array([0.0, 0.0, hand.com])
    mass = hand.mass - sum(m for m, _, _ in fingers)
    if not mass > 0.0:
        raise ModelError(
            "HandModel.mass",
            f"more than its {hand.fingers} fingers weigh",
            f"{hand.mass:g} kg",
            do=do,
        )
    com = (hand.mass * whole_com - sum(m * p for m, p, _ in fingers)) / mass
    inertia = hand.inertia - sum(i + steiner(m, p - whole_com) for m, p, i in fingers)
    own = np.asarray(inertia - steiner(mass, com - whole_com))
    return (
        mass,
        np.asarray(com),
        checked_inertia("HandModel.inertia, of its palm alone", own, do=do),
    )


def _add_palm_geoms(palm: mujoco.MjsBody, hand: HandModel) -> None:
    """Add flange and the palm's dish: a pad, and a rim that keeps a small ball from rolling out.

    The rim stays below a 40 mm ball at the catch point by 5 mm, the error of a good catch. It has a
    gap opposite the first finger, 45 degrees to either side: a ball that is faster than the hand
    (kappa > 1) comes in there, across the palm.
    """
    top, radius, thickness, rim_height, sides = hand.palm_height, 0.04, 0.02, 0.005, 6
    stem = top - thickness
    _disc(palm, "flange", radius, thickness=stem, middle=stem / 2)
    _disc(palm, "pad", radius, thickness=thickness, middle=top - thickness / 2)
    entry = hand.yaw + np.pi
    corners = entry + np.linspace(np.pi / 4, 2.0 * np.pi - np.pi / 4, sides + 1)
    ring = np.column_stack((np.cos(corners), np.sin(corners))) * 0.034
    for k in range(sides):
        ends = [*ring[k], top + rim_height, *ring[k + 1], top + rim_height]
        _rod(palm, f"rim{k}", 0.007, ends, rgba=_PALM)


def _add_finger(spec: mujoco.MjSpec, body: mujoco.MjsBody, name: str, hand: HandModel) -> None:
    """Add one finger with its joint, its motor and its two rods."""
    finger = hand.finger
    joint = body.add_joint(
        name=name,
        type=mujoco.mjtJoint.mjJNT_HINGE,
        axis=[0.0, -1.0, 0.0],
        armature=finger.armature,
    )
    joint.limited, joint.range, joint.solref_limit = True, [-0.05, hand.drive.closed + 0.05], STIFF
    spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT).set_to_motor()
    set_inertial(body, *finger_inertial(finger))
    spec.add_exclude(bodyname1="palm", bodyname2=name)
    base, knuckle, tip = finger.points(0.0)
    ends = [[p[0] - base[0], 0.0, p[1] - base[1]] for p in (base, knuckle, tip)]
    _rod(body, f"{name}/proximal", finger.thickness, [*ends[0], *ends[1]])
    _rod(body, f"{name}/distal", finger.thickness, [*ends[1], *ends[2]])


def _geom(
    body: mujoco.MjsBody, name: str, kind: mujoco.mjtGeom, size: list[float], rgba: Sequence[float]
) -> mujoco.MjsGeom:
    """Add one shape of a hand, and return it."""
    geom = body.add_geom(name=name, type=kind, size=size, mass=0.0, rgba=rgba)
    geom.contype, geom.conaffinity = HAND, BALL | HAND | ARM
    geom.condim, geom.friction, geom.solref = 4, FRICTION, STIFF
    return geom


def _disc(
    body: mujoco.MjsBody, name: str, radius: float, *, thickness: float, middle: float
) -> mujoco.MjsGeom:
    """Add a cylinder about z, its middle so high."""
    kind = mujoco.mjtGeom.mjGEOM_CYLINDER
    geom = _geom(body, name, kind, [radius, thickness / 2, 0.0], _PALM)
    geom.pos = [0.0, 0.0, middle]
    return geom


def add_basket(plate: mujoco.MjsBody, basket: Basket) -> None:
    """Add a basket to the tool plate.

    Args:
        plate: The tool plate, z along the opening's normal.
        basket: The basket.
    """
    body = plate.add_body(name="basket")
    set_inertial(body, basket.mass, np.array([0.0, 0.0, basket.com]), basket.inertia)
    _add_frame(body, basket)
    _add_net(body, basket)


def _circle(radius: float, height: float, count: int) -> Array:
    """Return the corners of a regular polygon about the axis [m], (count, 3), from x on."""
    angles = 2.0 * np.pi * np.arange(count) / count
    x, y = radius * np.cos(angles), radius * np.sin(angles)
    return np.column_stack((x, y, np.full(count, height)))


def _add_frame(body: mujoco.MjsBody, b: Basket) -> None:
    """Add flange, struts and ring."""
    thick = 0.125 * b.flange
    _disc(body, "flange", b.flange, thickness=2.0 * thick, middle=thick)
    around = b.ring_radius + b.clear
    side = np.array([1.0 if b.tilt > 0.0 else -1.0, 1.0, 1.0])  # a strut where the bracket joins
    feet, knees, ends = (
        side * _circle(radius, height, b.struts)
        for radius, height in ((b.flange, thick), (around, b.floor), (b.net_radius, b.ring_height))
    )
    for k in range(b.struts):
        for name, pair in (("foot", [*feet[k], *knees[k]]), ("strut", [*knees[k], *ends[k]])):
            _rod(body, f"{name}{k}", b.strut, pair)
    corners = _circle(b.net_radius, b.ring_height, b.cords)
    for k in range(b.cords):
        pair = [*corners[k], *corners[(k + 1) % b.cords]]
        _rod(body, f"ring{k}", b.ring_thickness, pair)
    if b.tilt:
        plate = np.linalg.inv(b.mount)[:3, 3]
        points = np.linspace((feet, knees), (knees, ends), 20).reshape(-1, 3)
        near = points[np.argmin(np.linalg.norm(points - plate, axis=1))]
        _rod(body, "bracket", 2.0 * b.strut, [*plate, *near])


def _add_net(body: mujoco.MjsBody, b: Basket) -> None:
    """Add cords down from the ring and across the bottom."""
    top = _circle(b.net_radius, b.ring_height, b.cords)
    bottom = _circle(b.net_radius, b.floor, b.cords)
    half = b.cords // 2
    sides = [[*top[k], *bottom[k]] for k in range(b.cords)]
    across = [[*bottom[k], *bottom[k + half]] for k in range(half)]
    for k, ends in enumerate(sides + across):
        cord = _rod(body, f"cord{k}", b.cord, ends, rgba=_CORD)
        cord.priority, cord.solref, cord.friction = 2, NET, NET_FRICTION


def add_suction(spec: mujoco.MjSpec, plate: mujoco.MjsBody, cup: Suction) -> tuple[str, ...]:
    """Add a suction cup to the tool plate: a tube, and a lip on bellows that pulls what it touches.

    The pull is MuJoCo's adhesion: a force along the normals of the contacts that there are. Its
    motor is the last of all, 0 to 1.

    Returns:
        The name of the bellows' joint, which is that of its motor too.
    """
    body, lip = plate.add_body(name="suction"), 0.03
    moving = 0.03
    set_inertial(body, cup.mass - moving, np.array([0.0, 0.0, cup.com]), cup.inertia)
    _disc(body, "flange", 0.03, thickness=0.02, middle=0.01)
    tube = cup.length - lip - cup.bellows
    _rod(body, "tube", 0.012, [0.0, 0.0, 0.0, 0.0, 0.0, tube])
    end = body.add_body(name="finger0", pos=[0.0, 0.0, cup.length - lip])
    set_inertial(end, moving, np.array([0.0, 0.0, 0.5 * lip]), _small(moving, cup.radius))
    joint = end.add_joint(name="finger0", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0.0, 0.0, -1.0])
    joint.limited, joint.range, joint.solref_limit = True, [0.0, cup.bellows], STIFF
    spec.add_actuator(
        name="finger0", target="finger0", trntype=mujoco.mjtTrn.mjTRN_JOINT
    ).set_to_motor()
    pad = _disc(end, "finger0/lip", cup.radius, thickness=lip, middle=0.5 * lip)
    pad.conaffinity, pad.friction = BALL, (cup.friction, 0.02, 1e-4)
    pad.priority = 2
    seal = spec.add_actuator(name="seal", target="finger0", trntype=mujoco.mjtTrn.mjTRN_BODY)
    seal.set_to_adhesion(cup.pull)
    seal.ctrllimited, seal.ctrlrange = True, [0.0, 1.0]
    return ("finger0",)


def add_jaw(spec: mujoco.MjSpec, plate: mujoco.MjsBody, jaw: Jaw) -> tuple[str, ...]:
    """Add a jaw to the tool plate: a body, and two fingers that slide towards each other.

    Returns:
        Names of the fingers' joints, which are those of their motors too.
    """
    body, names = plate.add_body(name="jaw"), ("finger0", "finger1")
    moving = 0.05
    set_inertial(body, jaw.mass - 2.0 * moving, np.array([0.0, 0.0, jaw.com]), jaw.inertia)
    high = jaw.length - jaw.finger
    _disc(body, "flange", 0.045, thickness=high - 0.01, middle=0.5 * high - 0.005)
    for side, name in zip((1.0, -1.0), names, strict=True):
        thick = 0.25 * jaw.width
        finger = body.add_body(name=name, pos=[side * (0.5 * jaw.opening + thick), 0.0, high])
        set_inertial(finger, moving, np.array([0.0, 0.0, 0.5 * jaw.finger]), _small(moving, 0.03))
        axis = [-side, 0.0, 0.0]
        joint = finger.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
        joint.limited, joint.range = True, [0.0, 0.5 * jaw.opening]
        joint.solref_limit, joint.armature = STIFF, 0.2
        spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT).set_to_motor()
        size = [thick, 0.5 * jaw.width, 0.5 * jaw.finger]
        geom = _geom(finger, f"{name}/pad", mujoco.mjtGeom.mjGEOM_BOX, size, _METAL)
        geom.pos, geom.friction = [0.0, 0.0, 0.5 * jaw.finger], (jaw.friction, 0.02, 1e-4)
        geom.priority = 2
    spec.add_exclude(bodyname1=names[0], bodyname2=names[1])
    return names


def add_paddle(plate: mujoco.MjsBody, paddle: Paddle) -> None:
    """Add a paddle to the tool plate: a handle, and a disc whose upper side is the face."""
    body = plate.add_body(name="paddle")
    set_inertial(body, paddle.mass, np.array([0.0, 0.0, paddle.com]), paddle.inertia)
    thick = paddle.thickness
    _rod(body, "handle", 0.015, [0.0, 0.0, 0.015, 0.0, 0.0, paddle.length - thick - 0.015])
    _disc(body, "face", paddle.radius, thickness=thick, middle=paddle.length - 0.5 * thick)


def _small(mass: float, size: float) -> Array:
    """Return the inertia of a small block [kg m^2], shape (3, 3)."""
    return np.asarray(mass * size**2 / 6.0 * np.eye(3))


def _rod(
    body: mujoco.MjsBody,
    name: str,
    radius: float,
    ends: Sequence[float],
    rgba: Sequence[float] = _METAL,
) -> mujoco.MjsGeom:
    """Add a capsule between two points."""
    geom = _geom(body, name, mujoco.mjtGeom.mjGEOM_CAPSULE, [radius, 0.0, 0.0], rgba)
    geom.fromto = list(ends)
    return geom
