"""Values of the wrong length, shape and type, given to every public function.

Public is what :data:`mitt.__all__` names, what those functions return, and the classes that the
documentation names for a control loop of one's own. Their methods are found by introspection, and
so are their parameters: a parameter for which no example is known is a fault of this list.

A call ends in one of two ways: an error of mitt of one line, or a result. Where the value is only
another form of the right one (a list, another type of the same numbers, write-protected, with
gaps), the result is the one for the right value. And no call compiles anything.
"""

import inspect
import pickle
from collections.abc import Callable, Iterator
from copy import copy, deepcopy
from dataclasses import dataclass, field, fields, is_dataclass
from enum import Enum
from typing import Any, Final

import numpy as np
from numba.core import event

import mitt
from mitt.catcher import Catcher, CatcherSettings
from mitt.errors import MittError
from mitt.flight import forecast
from mitt.generator.design import default_design
from mitt.generator.flights import Flight
from mitt.generator.generators import Direct, Unoptimised, refining
from mitt.generator.mapping import DirectMap, unlearned
from mitt.generator.several import Several
from mitt.rivals.quintic import make_quintic
from mitt.robot.arm import Arm
from mitt.robot.load import load_arm
from mitt.signals import ArmState, Frame, Senses, Sighting
from mitt.vision.camera import fixed_rig
from mitt.vision.eyes import Eyes
from mitt.vision.filter import BallFilter
from mitt.world.scene import Scene
from mitt.world.simulation import World
from mitt.world.throws import Throw

Value = Any

#: Numbers of an example: multiples of 1/64, so that float16 and float32 hold them exactly.
_R, _DR, _DDR = (np.array(x) for x in ((2.5, 0.125, 0.5), (-5.5, 0.0, 2.0), (0.25, 0.0, -9.75)))
#: Methods that cost much or draw figures; their checks are those of others.
_LEFT_OUT: Final = frozenset(("told",))
#: Kinds of arrays that hold the same numbers.
_TYPES: Final = ("f2", "f4", ">f8", "g")


@dataclass(slots=True)
class Count:
    """What became of the calls.

    Attributes:
        calls: Calls made.
        refused: Those that ended in an error of mitt.
        functions: Functions called.
        faults: Those that ended otherwise, in words.
    """

    calls: int = 0
    refused: int = 0
    functions: set[str] = field(default_factory=set)
    faults: list[str] = field(default_factory=list)


def ball_of(**changed: Value) -> "mitt.BallState":
    """Return an estimate of a ball in flight."""
    values: dict[str, Value] = {
        "t": 0.25, "tracked": True, "r_o": _R, "dr_o": _DR, "ddr_o": _DDR, "drag": 0.03125,
        "covariance": 2.0**-16 * np.eye(6), "t_seen": 0.25, "t_first": 0.125, "led": False,
    }  # fmt: skip
    return mitt.BallState(**(values | changed))


class Examples:
    """Objects whose methods are called, and a right value for each parameter."""

    def __init__(self, f: DirectMap | None = None) -> None:
        """Build them around a map, an unlearned one by default."""
        arm = load_arm("wam") if f is None else f.arm
        self.f = f = unlearned(arm, default_design(arm)) if f is None else f
        self.arm = arm
        n, links = arm.n, len(arm.model.links)
        q = np.round(64.0 * arm.q_ready) / 64.0
        self.values: dict[str, Value] = {
            "q": q, "dq": 0.0 * q, "ddq": 0.0 * q, "q_o": q, "x": q, "tau": np.ones(links),
            "tau_drive": np.ones(links), "dq_drive": np.zeros(links), "share": np.ones(links),
            "motion": np.array([[q, 0.0 * q, 0.0 * q]]), "r_o": _R, "t": 0.25, "mass": 0.125,
            "path": np.array([[_R, _DR, _DDR]]), "alpha": f.alpha.copy(), "angle": 0.5,
            "at": np.array([0.0, 0.0, 0.125]), "inertia": np.zeros((3, 3)), "seed": 3,
            "ball": ball_of(), "state": ball_of(), "senses": self._senses(q),
            "sighting": Sighting(t=0.25, found=True, r_o=_R, covariance=2.0**-20 * np.eye(3)),
            "frames": (), "least": 0.0,
        }  # fmt: skip
        self.special: dict[str, dict[str, Value]] = {
            "DirectMap.virtual": {"ball": np.array([_R, _DR, _DDR])},
            "DirectMap.motion": {"ball": np.array([_R, _DR, _DDR])},
            "Arm.active": {"x": np.ones(links)},
            "Limits": {"dq": np.zeros(links)},
            "CatchBasis": {"q": q[:3], "dq": np.zeros(3), "ddq": np.zeros(3)},
            "World": {"ball": Throw(r=_R, dr=_DR), "command": self._command(n)},
        }

    def _senses(self, q: Value) -> Senses:
        """Return what reaches a catcher in a tick without images."""
        return Senses(t=0.25, arm=ArmState(t=0.25, q=q, dq=0.0 * q))

    def _command(self, n: int) -> "mitt.Command":
        """Return a command of no torque."""
        return mitt.Command(t=0.25, told=np.zeros((4, n)), hand=0.0)

    def objects(self) -> dict[str, Value]:
        """Return the objects by what they are; those with a memory are copied for each call."""
        f, arm, eyes = self.f, self.arm, Eyes(fixed_rig())
        direct = Direct(f)
        settings = CatcherSettings()
        return {
            "arm": arm, "arm.model": arm.model, "arm.limits": arm.limits, "map": f,
            "map.basis": f.basis, "direct": direct, "refining": refining(f),
            "several": Several((direct,)), "unoptimised": Unoptimised(f),
            "rival": make_quintic(f), "filter": BallFilter(), "eyes": eyes,
            "catcher": Catcher(arm, direct, eyes, settings=settings),
        }  # fmt: skip

    def example(self, kind: str, method: str, name: str) -> Value:
        """Return a right value for a parameter of a class's method; KeyError without one."""
        special = self.special.get(kind, {}) | self.special.get(f"{kind}.{method}", {})
        return special[name] if name in special else self.values[name]

    def constructors(self) -> dict[str, tuple[Callable[..., Value], dict[str, Value]]]:
        """Return what makes a value, and right arguments for it."""
        f, q, ball = self.f, self.values["q"], ball_of()
        pixels, eye = np.zeros((128, 128), np.uint8), np.eye(3)
        design = {name: getattr(f.design, name) for name in ("catch_joint", "q_catch", "kappa",
                  "inward", "order", "free")}  # fmt: skip
        return {
            "BallState": (mitt.BallState, {x.name: getattr(ball, x.name) for x in fields(ball)}),
            "ArmState": (ArmState, {"t": 0.25, "q": q, "dq": 0.0 * q}),
            "Sighting": (Sighting, {"t": 0.25, "found": True, "r_o": _R, "covariance": eye}),
            "Frame": (Frame, {"t": 0.25, "camera": 0, "number": 1, "pixels": pixels}),
            "Senses": (Senses, {"t": 0.25, "arm": ArmState(t=0.25, q=q, dq=q)}),
            "Throw": (Throw, {"r": _R, "dr": _DR}),
            "MapDesign": (mitt.MapDesign, design),
            "DirectMap": (DirectMap, {x.name: getattr(f, x.name) for x in fields(f)}),
            "Flight": (Flight, {"t": np.zeros(1), "ball": np.array([[_R, _DR, _DDR]]),
                                "seen": np.array([_R, _DR, _DDR])}),
            "forecast": (forecast, {"state": ball, "t": 0.375, "accel_density": 0.5,
                                    "drag_sigma": 0.0}),
        }  # fmt: skip

    def refusals(self) -> dict[str, tuple[Callable[..., Value], dict[str, Value]]]:
        """Return functions that take long with right values: wrong ones are refused before."""
        f, arm = self.f, self.arm
        eyes, settings = Eyes(fixed_rig()), CatcherSettings()
        parts = {"arm": arm, "generator": Direct(f), "eyes": eyes, "settings": settings}
        return {
            "learn": (mitt.learn, {"arm": arm, "design": f.design, "seed": 1}),
            "simulate": (mitt.simulate, {"f": f, "throws": 1, "seed": 0, "scene": Scene(),
                                         "pixels": False}),
            "load_arm": (load_arm, {"name_or_path": "wam"}),
            "Catcher": (Catcher, parts),
            "Arm": (Arm, {"model": arm.model, "limits": arm.limits}),
            "World": (World, {"scene": Scene(), "arm": arm.model}),
        }  # fmt: skip


def same_numbers(value: Value) -> Iterator[Value]:
    """Yield other forms of a right array or number."""
    if isinstance(value, np.ndarray) and value.dtype == np.float64:
        yield value.tolist()
        yield from (value.astype(kind) for kind in _TYPES)
        locked = value.copy()
        locked.flags.writeable = False
        yield locked
        yield np.repeat(value, 2, axis=-1)[..., ::2]
        yield np.asfortranarray(value)
        yield value[..., ::-1].copy()[..., ::-1]
        if np.isfinite(value).all() and np.array_equal(value, np.rint(value)):
            yield value.astype(np.int32)
    elif isinstance(value, float):
        yield from (np.float64(value), np.array(value))
        if np.float32(value) == value:
            yield np.float32(value)


def wrong_shapes(value: Value) -> Iterator[Value]:
    """Yield arrays of the wrong length or number of axes."""
    if isinstance(value, np.ndarray) and value.dtype == np.float64:
        last = value.shape[-1]
        yield value[..., : last - 1].copy()
        yield np.concatenate([value, value[..., :1]], axis=-1)
        yield value[..., :0].copy()
        yield np.zeros((*value.shape[:-1], 200))
        yield np.float64(1.0)
        yield np.zeros(())
        if value.ndim > 1:
            yield value.ravel()
            yield value[0]


def nonsense(value: Value) -> Iterator[Value]:
    """Yield what is no value of this kind at all."""
    yield from (None, "text", b"text", object(), {}, [[1.0], [2.0, 3.0]], lambda: 0)
    yield from (np.array(["a", "b", "c"]), np.array([None, 1.0, 2.0]), np.array([1j, 2j, 3j]))
    yield np.array([True, False, True])
    if not isinstance(value, np.ndarray):
        yield from (np.zeros(4), [1, 2])


def absurd(value: Value) -> Iterator[Value]:
    """Yield numbers of the right shape that are none, or none that could be meant."""
    for x in (np.nan, np.inf, -np.inf, 1e300, -1e18, 5e-324):
        if isinstance(value, np.ndarray) and value.dtype == np.float64:
            yield np.full_like(value, x)
            one = value.copy()
            one.flat[-1] = x
            yield one
        elif isinstance(value, float):
            yield x


def same(a: Value, b: Value) -> bool:
    """Say whether two results are equal, arrays number by number."""
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return np.array_equal(np.asarray(a), np.asarray(b), equal_nan=np.asarray(a).dtype != object)
    if isinstance(a, tuple | list):
        return len(a) == len(b) and all(same(x, y) for x, y in zip(a, b, strict=True))
    if is_dataclass(a) and not isinstance(a, type):
        return all(same(getattr(a, x.name), getattr(b, x.name)) for x in fields(a) if x.compare)
    if isinstance(a, float):
        return bool(a == b or (a != a and b != b))
    plain = isinstance(a, bool | int | str | Enum | None.__class__)
    return a == b if plain else type(a) is type(b)


def methods(thing: Value) -> Iterator[tuple[str, list[inspect.Parameter]]]:
    """Yield the public methods of an object's class that take something, with what they take."""
    for name, method in inspect.getmembers(type(thing), inspect.isfunction):
        taken = list(inspect.signature(method).parameters.values())[1:]
        if not name.startswith("_") and taken and name not in _LEFT_OUT:
            yield name, taken


def sweep(examples: Examples) -> Count:
    """Call every public function with wrong values, one parameter at a time."""
    count = Count()
    for place, thing in examples.objects().items():
        kind = type(thing).__name__
        for name, taken in methods(thing):
            right = {}
            for parameter in taken:
                try:
                    right[parameter.name] = examples.example(kind, name, parameter.name)
                except KeyError:
                    if parameter.default is inspect.Parameter.empty:
                        count.faults.append(f"{place}.{name}: no example for {parameter.name}")
            if len(right) >= sum(p.default is inspect.Parameter.empty for p in taken):
                _sweep(f"{place}.{name}", _bound(thing, name), right, count)
    for name, (make, right) in examples.constructors().items():
        _sweep(name, make, right, count)
    for name, (call, right) in examples.refusals().items():
        for wanted, value in right.items():
            for wrong in nonsense(value):
                if not (wrong is None and wanted in ("design", "scene")):
                    _call(f"{name}({wanted})", call, right | {wanted: wrong}, count, must=True)
    return count


def _bound(thing: Value, name: str) -> Callable[..., Value]:
    """Return a method of a fresh copy of an object, so that no call changes the next one."""
    if isinstance(thing, Arm | DirectMap):
        return getattr(thing, name)  # type: ignore[no-any-return]

    def call(**given: Value) -> Value:
        return getattr(deepcopy(thing), name)(**given)

    return call


def _sweep(name: str, call: Callable[..., Value], right: dict[str, Value], count: Count) -> None:
    """Call a function with each of its values replaced by others."""
    count.functions.add(name)
    try:
        answer = call(**right)
    except MittError as error:
        count.faults.append(f"{name}: refuses the example: {error}")
        return
    with event.install_recorder("numba:compile") as compiled:
        for wanted, value in right.items():
            label = f"{name}({wanted})"
            for form in same_numbers(value):
                given = _call(label, call, right | {wanted: form}, count)
                if given is not _REFUSED and not same(answer, given):
                    count.faults.append(f"{label} of {_said(form)}: another answer: {given}"[:300])
            for form in absurd(value):
                _call(label, call, right | {wanted: form}, count)
            ignored = wanted in _IGNORED.get(name, ())
            for form in (*wrong_shapes(value), *nonsense(value)):
                if not _fits(name, wanted, form):
                    _call(label, call, right | {wanted: form}, count, must=not ignored)
    if compiled.buffer:
        count.faults.append(f"{name}: compiled {compiled.buffer[0][1].data}")


_REFUSED: Final = object()
"""Stands for the result of a call that was refused."""

_IGNORED: Final = {
    "unoptimised.adapt": ("ball", "q", "dq"), "unoptimised.unsettled": ("ball", "q"),
    "unoptimised.returns": ("ball",), "unoptimised.waiting": ("ball",),
    "direct.unsettled": ("q",), "refining.unsettled": ("q",), "several.unsettled": ("q",),
    "rival.unsettled": ("q",), "direct.refined": (), "direct.certificate": ("ball",),
    "refining.certificate": (), "forecast": (), "catcher.again": ("generator",),
}  # fmt: skip
"""Parameters that a function has because others of its kind do, and does not look at."""


def _fits(name: str, wanted: str, value: Value) -> bool:
    """Say whether a value that is wrong elsewhere is right here."""
    if value is None:
        return wanted in ("alpha", "least") or (name == "eyes.step" and wanted == "frames")
    if name == "ArmState":  # the catcher knows how many joints there are
        return False
    shape = np.shape(value) if isinstance(value, np.ndarray | np.floating) else None
    if wanted == "share" and name == "arm.by_joint":
        return False
    if name in ("arm.torques", "map.motions") and shape is not None:
        return False
    return shape is not None and wanted in ("t", "mass", "drag", "least") and shape == ()


def _call(
    name: str, call: Callable[..., Value], given: dict[str, Value], count: Count, *,
    must: bool = False,
) -> Value:  # fmt: skip
    """Make a call; note what ends neither in a result nor in an error of one line."""
    count.calls += 1
    wanted = name[name.rindex("(") + 1 : -1]
    said = f"{name} of {_said(given[wanted])}"
    try:
        result = call(**given)
    except MittError as error:
        count.refused += 1
        if "\n" in str(error):
            count.faults.append(f"{said}: more than one line: {error}")
        return _REFUSED
    except Exception as error:
        count.faults.append(f"{said}: {type(error).__name__}: {str(error)[:200]}")
        return _REFUSED
    if must:
        count.faults.append(f"{said}: was taken")
    return result


def _said(value: Value) -> str:
    """Return what a report says of a value."""
    if isinstance(value, np.ndarray):
        return f"{value.dtype} {value.shape} {value.ravel()[-1:]}"
    return repr(value)[:60]


def copies(thing: Value) -> Iterator[Value]:
    """Yield copies of an object: shallow, deep, and through a pickle."""
    yield copy(thing)
    yield deepcopy(thing)
    yield pickle.loads(pickle.dumps(thing))  # noqa: S301
