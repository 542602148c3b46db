"""The 4-DOF Barrett WAM from its published figures, and the WAM with its wrist.

Kinematics, masses, inertias: ``config/wam4.conf`` of BarrettTechnology/libbarrett, commit 109faf6
("inertial specifications, Sept 2008"). Joint ranges and drives: WAM User's Manual D1001 AH.00,
tables 4 and 6. The tool plate is at 0.35 m (0.90 m above the shoulder when upright, as the paper's
Table 1 says); libbarrett's own is at 0.36 m.

The inertias are given in the Denavit-Hartenberg frame of each link, which lies *behind* the
joint's rotation; here a link's frame is the one right after that rotation, so the constant
part of the D-H step moves the figures into it.
"""

from dataclasses import dataclass, replace

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.arm.description import ArmModel, Capsule, Hand, JointBrake, Link, rotation, transform
from mitt.core.arm.limits import Limits, joint_level
from mitt.core.errors import UnknownNameError
from mitt.core.signals import Array

#: Motor (Spec-Hardware page of UW-Advanced-Robotics-Lab/lab-wiki, quoting Barrett).
_TORQUE_CONSTANT = 0.457  # N m/A
_RESISTANCE = 3.473  # ohm
_NO_LOAD_48V = 100.218  # rad/s
_CONTINUOUS = 1.490  # N m
_PEAK = 1.966  # N m
#: Encoder counts a motor turn.
_COUNTS = 4096

#: Idealised arm of the set ``paper``: peak torques quoted from the WAM manual [N m], and the joint
#: speeds that matching a 6 m/s ball needs [rad/s], a choice of this project: no real WAM.
_PAPER_TAU = np.array([77.3, 160.6, 95.6, 29.4])
_PAPER_SPEED = np.array([8.0, 8.0, 10.0, 20.0])

#: Supply voltages of the motor-level sets [V]; 80 V is how TU Darmstadt runs its arm.
_VOLTS = {"wam-48v": 48.0, "wam-80v": 80.0}

#: Rows M1..M4 of motor speed = TRANSMISSION @ joint speed; joints 2 and 3 share a differential.
TRANSMISSION = np.array(
    [
        [-42.0, 0.0, 0.0, 0.0],
        [0.0, 28.25, -16.8155, 0.0],
        [0.0, -28.25, -16.8155, 0.0],
        [0.0, 0.0, 0.0, -18.0],
    ]
)


@dataclass(frozen=True, slots=True)
class _Row:
    """One row of the table, in the sources' own units (mm, 1e-6 kg m^2)."""

    twist: float
    a: float
    d: float
    q_min: float
    q_max: float
    mass: float
    com_mm: tuple[float, float, float]
    inertia_e6: tuple[float, float, float, float, float, float]
    armature: float
    capsules: tuple[Capsule, ...] = ()


# Twist, a, d, range; mass, com, (Ixx, Iyy, Izz, Ixy, Ixz, Iyz); rotor inertia at the joint.
# The differential couples the speeds of joints 2 and 3 but not their rotor inertia:
# 28.25 (-16.8155) + (-28.25)(-16.8155) = 0, so it stays diagonal.
# Capsules (link frame): choices of this project; the two 45 mm offsets let the forearm fold back
# beside the upper arm over the whole range of joint 4, so their radii add up to less than 90 mm.
_TABLE = (
    _Row(
        -np.pi / 2, 0.0, 0.0, -2.6, 2.6, 10.76768767, (-4.43, 121.89, -0.66),
        (134880.33, 113283.69, 90463.30, -2130.41, -124.85, 685.55), 0.2052,
    ),
    _Row(
        np.pi / 2, 0.0, 0.0, -2.0, 2.0, 3.87493756, (-2.37, 31.06, 15.42),
        (21409.58, 13778.75, 15589.06, 271.72, 24.61, -1819.20), 0.1888,
    ),
    _Row(
        -np.pi / 2, 0.045, 0.55, -2.8, 2.8, 1.80228141, (-38.26, 207.51, 0.03),
        (59110.77, 3245.50, 59270.43, -2496.12, 7.38, -17.67), 0.0669,
        (Capsule(start=(0.0, 0.0, 0.10), end=(0.0, 0.0, 0.45), radius=0.044),),
    ),
    _Row(
        np.pi / 2, -0.045, 0.0, -0.9, 3.1, 1.06513649, (10.95, -0.03, 140.54),
        (18485.77, 18916.58, 1975.17, 2.19, -1608.68, 5.15), 0.0346,
        (Capsule(start=(-0.045, -0.10, 0.0), end=(-0.045, -0.31, 0.0), radius=0.042),),
    ),
)  # fmt: skip
#: How far the tool plate is beyond the frame of joint 4 [m]: 0.90 m above the shoulder upright,
#: as the paper's Table 1 says.
_TOOL_PLATE = 0.35

#: What carries the arm: from the base plate up to below the shoulder.
_BASE = Capsule(start=(0.0, 0.0, -0.33), end=(0.0, 0.0, -0.22), radius=0.10)


#: Motor turns that one joint's turn alone takes of a motor that moves it, joints 1 to 4.
_RATIO = np.abs(TRANSMISSION).max(axis=0)

#: Holding brakes: a choice of this project, as strong as the ``paper`` set's largest torques; the
#: WAM's own are optional. In its idle mode the motor amplifiers brake by themselves (WAM User's
#: Manual D1001 AH.00, section 7.5: in MODE_IDLE motors ignore torques "and apply braking"); taken
#: to short the windings: K_t^2 N^2 / R of each motor that moves the joint.
_BRAKE_TORQUE = _PAPER_TAU
_BRAKE_DAMPING = _TORQUE_CONSTANT**2 / _RESISTANCE * (TRANSMISSION**2).sum(axis=0)

#: The wrist, joints 5 to 7, and the link that carries it (``config/wam7w.conf`` of libbarrett);
#: rotors of 1.472e-5 and 1.349e-6 kg m^2 (as for the motors above), two of them turn joint 6.
_WRIST = (
    _Row(
        np.pi / 2, -0.045, 0.0, -0.9, 3.1, 2.17266212, (5.53408, 0.06822, 119.27695),
        (10674.91, 10586.59, 2820.36, 45.03, -1355.57, -110.02), 0.0346,
        (Capsule(start=(-0.045, -0.10, 0.0), end=(-0.045, -0.25, 0.0), radius=0.042),),
    ),
    _Row(
        -np.pi / 2, 0.0, 0.3, -4.76, 1.24, 0.35655692, (0.05483, 28.86286, 1.48493),
        (371.12, 194.34, 382.09, -0.08, -0.03, -16.13), 0.00277,
    ),
    _Row(
        np.pi / 2, 0.0, 0.0, -1.57, 1.57, 0.40915886, (-0.05923, -16.86123, 24.19052),
        (548.89, 238.46, 451.33, 0.19, -0.10, -44.30), 0.00277,
    ),
    _Row(
        0.0, 0.0, 0.0609, -3.0, 3.0, 0.0754827, (0.14836, 0.07252, -3.35185),
        (39.11, 38.77, 76.14, 0.19, 0.0, 0.0), 0.0003,
    ),
)  # fmt: skip
#: Ratios of its joints, and its idealised torques [N m] and speeds [rad/s]: the continuous torques
#: of its motors (0.356 and 0.091 N m), and half of their speeds without load.
_WRIST_RATIO = np.array([9.7, 9.7, 14.93])
_WRIST_TAU = np.array([6.9, 6.9, 1.36])
_WRIST_SPEED = np.array([9.9, 9.9, 19.0])

LIMIT_SETS = ("paper", *_VOLTS)


def wam(hand: Hand | None, *, held_3: float | None = 0.0) -> ArmModel:
    """Return the WAM with a hand, or none; joint 3 held at ``held_3`` [rad], active where None."""
    links = tuple(
        _link(k, row, held_3 if k == 2 else None, _behind(k)) for k, row in enumerate(_TABLE)
    )
    q_ready = np.array([0.0, np.pi / 4, 0.0, 0.0])  # section 4.1 of the paper
    return ArmModel(
        name="wam",
        links=links,
        tool=_step(_TABLE[3]) @ transform(p=np.array([0.0, 0.0, _TOOL_PLATE])),
        hand=hand,
        q_ready=q_ready if held_3 is None else np.delete(q_ready, 2),
        base_capsules=(_BASE,),
        mount=np.eye(4),
    )


def wrist_wam(hand: Hand | None) -> Arm:
    """Return the WAM with its wrist and idealised limits; joints 3, 5 and 7 are held straight.

    Joints 2, 4 and 6 are parallel, so that 6 can keep the pitch of the hand.
    """
    rows, held = (*_TABLE[:3], *_WRIST), (2, 4, 6)
    ratio = np.concatenate([_RATIO, _WRIST_RATIO])
    tau = np.concatenate([_PAPER_TAU, _WRIST_TAU])
    links = []
    for k, row in enumerate(rows):
        placement = np.eye(4) if k == 0 else _step(rows[k - 1])
        link = _link(min(k, 3), row, 0.0 if k in held else None, placement)
        step = 2.0 * np.pi / (_COUNTS * float(ratio[k]))
        brake = link.brake if k < 4 else JointBrake(torque=float(tau[k]), damping=0.1)
        links.append(replace(link, name=f"j{k + 1}", encoder_step=step, brake=brake))
    model = ArmModel(
        name="wam",
        links=tuple(links),
        tool=_step(rows[-1]),
        hand=hand,
        q_ready=np.array([0.0, np.pi / 4, 0.0, 0.0]),
        base_capsules=(_BASE,),
        mount=np.eye(4),
    )
    speed = np.concatenate([_PAPER_SPEED, _WRIST_SPEED])
    return Arm(model, joint_level("paper", tau=tau, speed=speed))


def wam_limits(name: str) -> Limits:
    """Return a named limit set: ``paper``, ``wam-48v`` or ``wam-80v``."""
    if name == "paper":
        return joint_level(name, tau=_PAPER_TAU, speed=_PAPER_SPEED)
    if name not in _VOLTS:
        raise UnknownNameError("limits", name, LIMIT_SETS)
    count = len(TRANSMISSION)
    return Limits(
        name=name,
        transmission=TRANSMISSION,
        tau_peak=np.full(count, _PEAK),
        tau_stall=np.full(count, _TORQUE_CONSTANT * _VOLTS[name] / _RESISTANCE),
        dq_max=np.full(count, _NO_LOAD_48V * _VOLTS[name] / 48.0),
        tau_rms=np.full(count, _CONTINUOUS),
    )


def _step(row: _Row) -> Array:
    """Return the constant part Tz(d) Tx(a) Rx(twist) of a row's D-H step, shape (4, 4)."""
    return transform(rotation(np.array([1.0, 0.0, 0.0]), row.twist), np.array([row.a, 0.0, row.d]))


def _behind(k: int) -> Array:
    """Return the frame of joint ``k`` in the frame of the link before it, shape (4, 4)."""
    return np.eye(4) if k == 0 else _step(_TABLE[k - 1])


def _link(k: int, row: _Row, held: float | None, placement: Array) -> Link:
    """Move a row's mass properties from its D-H frame into the link's frame."""
    T = _step(row)
    xx, yy, zz, xy, xz, yz = (1e-6 * x for x in row.inertia_e6)
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return Link(
        name=f"j{k + 1}",
        placement=placement,
        axis=np.array([0.0, 0.0, 1.0]),
        q_min=row.q_min,
        q_max=row.q_max,
        mass=row.mass,
        com=T[:3, :3] @ (1e-3 * np.array(row.com_mm)) + T[:3, 3],
        inertia=T[:3, :3] @ inertia @ T[:3, :3].T,
        armature=row.armature,
        capsules=row.capsules,
        held=held,
        encoder_step=2.0 * np.pi / (_COUNTS * float(_RATIO[k])),
        brake=JointBrake(torque=float(_BRAKE_TORQUE[k]), damping=float(_BRAKE_DAMPING[k])),
    )
