"""MuJoCo as compiled code calls and reads it, without a detour through Python.

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

from mitt.errors import ModelError

#: Contacts that compiled code looks at; a hand full of ball has nine.
MOST = 256

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
        ctrl: Motor torques [N m], shape (nu,).
        passive: Friction and drag [N m, N], MuJoCo's ``qfrc_applied``, shape (nv,).
        qacc: Accelerations, shape (nv,).
        constraint: Forces and torques of contacts and stops, shape (nv,).
        place: Catch point [m], shape (3,).
        anchor: A point on each joint's axis [m], shape (j, 3).
        axis: Unit axes of the joints, shape (j, 3).
        slides: Copy: whether a joint of the arm is prismatic, shape (n,).
        kinds: Copy: kind of each geom, shape (g,).
        touching: Own: whether a geom touches the ball, shape (g,).
        state: Own: as in :mod:`mitt.world.motion`.
        drives: Own: as in :mod:`mitt.world.drives`.
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
    state: NDArray[Any]
    drives: NDArray[Any]


def plant_of(model: mujoco.MjModel, data: mujoco.MjData, site: int, joints: int) -> Plant:
    """Return a simulation as compiled code reads it, with empty ``state`` and ``drives``.

    Args:
        model: The model. The arrays own it and ``data``: neither is freed while one of them is
            held.
        data: Its state.
        site: The catch point's site.
        joints: Number n of joints of the arm.

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
    show = partial(owned, owner)
    return Plant(
        address=np.array([model._address, at]),
        contacts=counts,
        geoms=geoms,
        step=step,
        qpos=show(data.qpos),
        qvel=show(data.qvel),
        ctrl=show(data.ctrl),
        passive=show(data.qfrc_applied),
        qacc=show(data.qacc),
        constraint=show(data.qfrc_constraint),
        place=show(data.site_xpos[site]),
        anchor=show(data.xanchor),
        axis=show(data.xaxis),
        slides=np.ascontiguousarray(slides),
        kinds=model.geom_contype.copy(),
        touching=np.zeros(model.ngeom, np.bool_),
        state=np.zeros(0),
        drives=np.zeros((0, 0)),
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
        "version": 3, "typestr": kind, "shape": tuple(shape), "strides": strides,
        "data": (address, False),
    }  # fmt: skip
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
