"""MuJoCo as compiled code calls and reads it, contacts included, without a detour through Python.

``mj_step1``, ``mj_step2`` and ``mj_contactForce`` are called by name in the library that the
package ``mujoco`` has loaded; model and data are handed over by address. What Python's views do
not show to compiled code (how many contacts there are, and their table) is read where the
package's own description of its structures says that it lies. :func:`plant_of` compares three of
these places with what Python says; ``tests/world/test_engine.py`` compares the table of contacts.

An error that MuJoCo itself calls fatal (memory that runs out) ends the process here, as it does
for every program in C; warnings are counted in the data, as ever.
"""

import ctypes
from collections.abc import Sequence
from functools import lru_cache, partial
from math import prod
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np
from mujoco.introspect.ast_nodes import ArrayType, PointerType, ValueType
from mujoco.introspect.structs import STRUCTS
from numba import types
from numpy.typing import NDArray

from mitt.core.arm.kinematics import Vec
from mitt.core.errors import ModelError
from mitt.core.kernels import Record, kernel, record_of
from mitt.core.signals import Array
from mitt.lab.world.drives import Drives, FingerServo, fresh_brakes, fresh_drives
from mitt.lab.world.hand_bodies import ARM, BALL, FLOOR, HAND
from mitt.lab.world.rubber import Rubber, no_rubber
from mitt.lab.world.scene import Actuation

#: Contacts that compiled code looks at; a hand full of ball has nine.
MOST = 256

#: What touches what, as bits of the result of :func:`survey`.
BALL_HAND = 1
BALL_ARM = 2
BALL_FLOOR = 4
SELF = 8
ARM_FLOOR = 16
BALL_ANY = BALL_HAND | BALL_ARM | BALL_FLOOR

#: What ``Plant.state`` is at the release of a ball.
_RELEASED = {
    "ticks": 0,
    "steps": 1,
    "seen": 0,
    "broken": False,
    "prescribed": False,
    "force": 0.0,
    "peak": 0.0,
    "load": 0.0,
    "pressing": 0.0,
    "touched": -1.0,
    "braked": -1.0,
    "stopped": -1.0,
}

# The library is in the process already; this makes its names known to compiled code.
_PATH = next(path for path in Path(mujoco.__file__).parent.glob("*mujoco*.[sd]*"))
_LIBRARY = ctypes.CDLL(str(_PATH), mode=ctypes.RTLD_GLOBAL)

_at = types.intp
step1 = types.ExternalFunction("mj_step1", types.void(_at, _at))
"""Positions and velocities, and all that follows from them: (model, data)."""
step2 = types.ExternalFunction("mj_step2", types.void(_at, _at))
"""Forces, and the step: (model, data)."""
contact_force = types.ExternalFunction("mj_contactForce", types.void(_at, _at, types.intc, _at))
"""Force and torque of a contact in its own frame: (model, data, contact, result of 6)."""

_PLAIN = {
    "int": ctypes.c_int,
    "uint64_t": ctypes.c_uint64,
    "size_t": ctypes.c_size_t,
    "uintptr_t": ctypes.c_void_p,
    "mjtSize": ctypes.c_int64,
    "mjtBool": ctypes.c_bool,
    "mjtNum": ctypes.c_double,
}


class Plant(NamedTuple):
    """A plant as compiled code reads it, in MuJoCo's own memory where nothing else is said.

    Attributes:
        address: Addresses of model and data, shape (2,).
        contacts: Number of contacts, shape (1,).
        geoms: The two geoms of each contact, shape (MOST, 2).
        step: Length of a step [s], shape (1,).
        qpos: Positions, shape (nq,).
        qvel: Velocities, shape (nv,).
        ctrl: Motor torques of arm and fingers [N m], shape (n + f,).
        passive: Friction and drag [N m, N], MuJoCo's ``qfrc_applied``, shape (nv,).
        qacc: Accelerations, shape (nv,).
        constraint: Forces and torques of contacts and stops, shape (nv,).
        place: Catch point [m], shape (3,).
        anchor: A point on each joint's axis [m], shape (j, 3).
        axis: Unit axes of the joints, shape (j, 3).
        slides: Copy: whether a joint of the arm is prismatic, shape (n,).
        kinds: Copy: kind of each geom, shape (g,).
        touching: Own: whether a geom touches the ball, shape (g,).
        wrench: Own: scratch, force and torque of a contact, shape (6,).
        state: Own: single numbers, shape (1,):
            ticks: Ticks since release; steps: simulation steps in the next tick.
            seen: Contacts in the last tick, bits of :func:`survey`.
            broken: Whether the physics broke down, or a command was not finite.
            prescribed: Whether the ball follows a path; not after it has touched anything.
            force, peak: Largest contact force on the ball in the last tick, and in the trial [N];
            of a hand without fingers the resultant of all its contacts.
            load: Largest load on the hand in the trial [N]: the resultant of all contacts of a ball
            that it touches, or one of them where that is larger, as between two fingers.
            pressing: Largest contact force on the ball in the last step [N].
            touched: Time of the first contact of ball and hand [s]; negative before.
            braked: When the brakes were commanded to engage [s]; negative before.
            stopped: When the catcher stopped [s]; negative before.
        first: Own: r_o, dr_o, position, velocity at the first contact [m, m/s], shape (4, 3).
        flight: Own: position and velocity of the ball at the end of a step if it flies freely
            [m, m/s], shape (2, 3).
        ball_mass, ball_drag: Mass [kg] and drag coefficient [1/m] of the ball.
        ball_lift, ball_radius: Lift constant, of :mod:`mitt.core.ball.spin`, and radius [m].
        rubber: That of a paddle.
        friction: Viscous [N m s/rad] and dry [N m] friction of each joint, shape (2, n).
        fingers: The servo of each finger.
        drives: The arm's drives.
        brakes: As of :func:`mitt.lab.world.drives.brakes_of`, shape (n,).
        fine: Copy: simulation steps in a tick where a contact may begin; elsewhere one is enough.
    """

    address: NDArray[Any]
    contacts: NDArray[Any]
    geoms: NDArray[Any]
    step: NDArray[Any]
    qpos: NDArray[Any]
    qvel: NDArray[Any]
    ctrl: NDArray[Any]
    passive: NDArray[Any]
    qacc: NDArray[Any]
    constraint: NDArray[Any]
    place: NDArray[Any]
    anchor: NDArray[Any]
    axis: NDArray[Any]
    slides: NDArray[Any]
    kinds: NDArray[Any]
    touching: NDArray[Any]
    wrench: Array
    state: Record
    first: Array
    flight: Array
    ball_mass: float
    ball_drag: float
    ball_lift: float
    ball_radius: float
    rubber: Rubber
    friction: Array
    fingers: FingerServo
    drives: Drives
    brakes: Record
    fine: int


def plant_of(
    model: mujoco.MjModel, data: mujoco.MjData, site: int, joints: int, *, fine: int = 2
) -> Plant:
    """Return a simulation as compiled code reads it, with nothing yet of what is its own.

    Args:
        model: The model. The arrays own it and ``data``: neither is freed while one of them is
            held.
        data: Its state.
        site: The catch point's site.
        joints: Number n of joints of the arm.
        fine: As of ``Plant``.

    Raises:
        ModelError: MuJoCo's structures are not as its package describes them.
    """
    at, option = data._address, model._address + _offset("mjModel", "opt")
    owner = model, data
    counts = _view(owner, at + _offset("mjData", "ncon"), "<i4", (1,))
    table = _view(owner, at + _offset("mjData", "contact"), "<u8", (1,))
    seen = _view(owner, at + _offset("mjData", "qpos"), "<u8", (1,))
    step = _view(owner, option + _offset("mjOption", "timestep"), "<f8", (1,))
    if step[0] != model.opt.timestep or counts[0] != data.ncon or seen[0] != data.qpos.ctypes.data:
        raise ModelError("mujoco", "structures as its package describes them", mujoco.__version__)
    one = ctypes.sizeof(_mirror("mjContact", "efc_address"))
    geoms = _view(owner, int(table[0]) + _offset("mjContact", "geom"), "<i4", (MOST, 2), (one, 4))
    slides = model.jnt_type[:joints] == mujoco.mjtJoint.mjJNT_SLIDE
    joint = mujoco.mjtTrn.mjTRN_JOINT
    show = partial(owned, owner)
    return Plant(
        address=np.array([model._address, at]),
        contacts=counts,
        geoms=geoms,
        step=step,
        qpos=show(data.qpos),
        qvel=show(data.qvel),
        ctrl=show(data.ctrl[: int(np.sum(model.actuator_trntype == joint))]),
        passive=show(data.qfrc_applied),
        qacc=show(data.qacc),
        constraint=show(data.qfrc_constraint),
        place=show(data.site_xpos[site]),
        anchor=show(data.xanchor),
        axis=show(data.xaxis),
        slides=np.ascontiguousarray(slides),
        kinds=model.geom_contype.copy(),
        touching=np.zeros(model.ngeom, np.bool_),
        wrench=np.zeros(6),
        state=record_of(_RELEASED, _RELEASED),
        first=np.zeros((4, 3)),
        flight=np.zeros((2, 3)),
        ball_mass=0.0,
        ball_drag=0.0,
        ball_lift=0.0,
        ball_radius=0.0,
        rubber=no_rubber(show(data.site_xmat[site])),
        friction=np.zeros((2, joints)),
        fingers=FingerServo(0.0, 0.0, 0.0, 0.0),
        drives=fresh_drives(Actuation(), np.zeros(joints)),
        brakes=fresh_brakes(joints),
        fine=fine,
    )


def released(
    plant: Plant,
    *,
    ball: tuple[float, float, float, float],
    rubber: Rubber,
    friction: Array,
    fingers: FingerServo,
    drives: Drives,
    brakes: Record,
) -> Plant:
    """Return a plant with what is its own at the release of a ball.

    Args:
        plant: The plant.
        ball: Mass [kg], drag coefficient [1/m], lift constant and radius [m] of the ball.
        rubber: As of ``Plant``.
        friction: As of ``Plant``, as are ``fingers``.
        fingers: See ``friction``.
        drives: Drives; nothing was commanded yet, and so their mean torque is set to zero.
        brakes: As of ``Plant``, before anything has moved; copied.
    """
    drives.mean[:] = 0.0
    return plant._replace(
        state=record_of(_RELEASED, _RELEASED),
        first=np.zeros((4, 3)),
        ball_mass=float(ball[0]),
        ball_drag=float(ball[1]),
        ball_lift=float(ball[2]),
        ball_radius=float(ball[3]),
        rubber=rubber,
        friction=friction,
        fingers=fingers,
        drives=drives,
        brakes=brakes.copy(),
    )


def owned(owner: object, memory: NDArray[Any]) -> NDArray[Any]:
    """Return an array that shows the same memory and keeps the owner of that alive.

    MuJoCo's own arrays do not: they show memory that is freed with model or data.

    Args:
        owner: What frees the memory when it is collected.
        memory: Contiguous.
    """
    return _view(owner, memory.ctypes.data, memory.dtype.str, memory.shape)


def stop_clocks() -> None:
    """Keep MuJoCo from timing each part of each step, which takes a tenth of the step.

    The package gives it a clock when it is imported. One that somebody else has set is left alone.
    """
    if mujoco.get_mjcb_time() is None:
        ctypes.c_void_p.in_dll(_LIBRARY, "mjcb_time").value = None


@kernel
def survey(plant: Plant, felt: bool) -> tuple[int, float]:
    """Sort the contacts of one step, and write which geoms touch the ball.

    Args:
        plant: The plant; its ``touching`` is overwritten.
        felt: Whether forces are known, as they are after a step.

    Returns:
        Bits of what touches what, and the largest contact force on the ball [N].
    """
    address, geoms, kinds, touching = plant.address, plant.geoms, plant.kinds, plant.touching
    found, largest, force = 0, 0.0, plant.wrench
    touching[:] = False
    for c in range(min(plant.contacts[0], MOST)):
        first, second = geoms[c, 0], geoms[c, 1]
        both = kinds[first] | kinds[second]
        if both & BALL:
            if kinds[first] == BALL:
                first = second
            touching[first] = True
            found |= BALL_HAND if both & HAND else (BALL_ARM if both & ARM else BALL_FLOOR)
            if felt:
                contact_force(address[0], address[1], c, force.ctypes.data)
                size = np.sqrt(force[0] ** 2 + force[1] ** 2 + force[2] ** 2)
                largest = max(largest, size)
        elif both & FLOOR:
            found |= ARM_FLOOR
        elif both & ARM:
            found |= SELF
    return found, largest


@kernel
def tip_velocity(plant: Plant, out: Array) -> None:
    """Write the velocity of the catch point [m/s], shape (3,), from those of the joints."""
    place, dq = plant.place, plant.qvel
    out[:] = 0.0
    for i in range(len(plant.slides)):
        x, y, z = moved_by(plant, i, (place[0], place[1], place[2]))
        out[0] += dq[i] * x
        out[1] += dq[i] * y
        out[2] += dq[i] * z


@kernel
def moved_by(plant: Plant, i: int, place: Vec) -> Vec:
    """Return the velocity of a point of the tool for one of a joint: [m/rad], or 1 of a slide."""
    anchor, axis = plant.anchor, plant.axis
    ax, ay, az = axis[i, 0], axis[i, 1], axis[i, 2]
    if plant.slides[i]:
        return ax, ay, az
    rx, ry, rz = place[0] - anchor[i, 0], place[1] - anchor[i, 1], place[2] - anchor[i, 2]
    return ay * rz - az * ry, az * rx - ax * rz, ax * ry - ay * rx


def hand_names(model: mujoco.MjModel) -> tuple[str | None, ...]:
    """Return the names of the geoms of the hand, None for any other geom."""
    kinds = model.geom_contype == HAND
    return tuple(model.geom(g).name if kinds[g] else None for g in range(model.ngeom))


def names_touching(names: tuple[str | None, ...], touching: NDArray[np.bool_]) -> frozenset[str]:
    """Return the names of the hand's geoms, of :func:`hand_names`, that touch the ball, (g,)."""
    found = (names[g] for g in np.flatnonzero(touching).tolist())
    return frozenset(name for name in found if name is not None)


class _Owned:
    """Memory that belongs to another object, as NumPy takes it over; it keeps its owner alive."""

    def __init__(self, owner: object, interface: dict[str, object]) -> None:
        """Take the owner, and where its memory lies and what it holds."""
        self._owner, self.__array_interface__ = owner, interface


def _view(
    owner: object,
    address: int,
    kind: str,
    shape: Sequence[int],
    strides: tuple[int, ...] | None = None,
) -> NDArray[Any]:
    """Return memory of an owner at an address as an array, which keeps the owner alive."""
    interface: dict[str, object] = {
        "version": 3,
        "typestr": kind,
        "shape": tuple(shape),
        "strides": strides,
        "data": (address, False),
    }
    return np.asarray(_Owned(owner, interface))


def _offset(name: str, field: str) -> int:
    """Return where in a structure a field lies [bytes]."""
    mirror = _mirror(name, field)
    return int(vars(mirror)[field].offset)


@lru_cache(maxsize=16)
def _mirror(name: str, last: str | None = None) -> type[Any]:
    """Return one of MuJoCo's structures, up to a field, as ctypes lays it out."""
    fields = []
    for field in STRUCTS[name].fields:
        fields.append((field.name, _kind(field.type)))
        if field.name == last:
            break
    return type(name, (ctypes.Structure,), {"_fields_": fields})


def _kind(kind: ValueType | PointerType | ArrayType) -> type[Any]:
    """Return the ctypes of a field."""
    if isinstance(kind, PointerType):
        return ctypes.c_void_p
    if isinstance(kind, ArrayType):
        block: type[Any] = _kind(kind.inner_type) * prod(kind.extents)
        return block
    if kind.name in _PLAIN:
        return _PLAIN[kind.name]
    return _mirror(kind.name) if kind.name in STRUCTS else ctypes.c_int  # an enumeration
