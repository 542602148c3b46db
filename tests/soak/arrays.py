"""Values of the wrong length, shape and type, given to every public function.

Public is what :data:`mitt.__all__` names, what those functions return, and the classes that the
documentation names for a control loop of one's own. Their methods are found by introspection, and
so are their parameters: a parameter for which no example is known is a fault of this list.

A call ends in one of two ways: an error of mitt of one line, or a result. Where the value is only
another form of the right one (a list, another type of the same numbers, write-protected, with
gaps), the result is the one for the right value. And no call compiles anything.
"""

import inspect
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from copy import copy, deepcopy
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numba.core import event

from mitt.core.arm.arm import Arm
from mitt.core.errors import MittError
from mitt.core.map.mapping import DirectMap
from soak.examples import Examples
from soak.values import Value, absurd, nonsense, said, same, same_numbers, wrong_shapes

#: Methods that ask for a certain state, for a simulation of their own, or for what is known so far.
_LEFT_OUT: Final = frozenset(("with_flight", "recover", "move", "consider"))
#: Threads of a soak.
_THREADS = 4


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
                if not (wrong is None and wanted in ("design", "scene", "eyes", "settings")):
                    _call(f"{name}({wanted})", call, right | {wanted: wrong}, count, must=True)
    return count


def _bound(thing: Value, name: str) -> Callable[..., Value]:
    """Return a method of a fresh copy of an object, so that no call changes the next one."""
    if isinstance(thing, Arm | DirectMap):
        return _method(thing, name)

    def call(**given: Value) -> Value:
        return _method(deepcopy(thing), name)(**given)

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
                    count.faults.append(f"{label} of {said(form)}: another answer: {given}"[:300])
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
    "unoptimised.adapt": ("ball", "q", "dq"),
    "unoptimised.unsettled": ("ball", "q"),
    "unoptimised.returns": ("ball",),
    "unoptimised.waiting": ("ball",),
    "direct.unsettled": ("q",),
    "refining.unsettled": ("q",),
    "family.unsettled": ("q",),
    "rival.unsettled": ("q",),
    "forecast": (),
}
"""Parameters that a function has because others of its kind do, and does not look at."""


def _fits(name: str, wanted: str, value: Value) -> bool:
    """Say whether a value that is wrong elsewhere is right here."""
    if value is None:
        left_out = ("alpha", "least", "ddr_o", "t_seen", "t_first", "q_rest")
        at_rest = wanted == "dq" and name.endswith(".verdict")
        own = {"eyes.step": "frames", "catcher.take_over": "t"}.get(name) == wanted
        return wanted in left_out or at_rest or own
    if name == "ArmState":  # the catcher knows how many joints there are
        return False
    shape = np.shape(value) if isinstance(value, np.ndarray | np.floating) else None
    if wanted == "share" and name == "arm.by_joint":
        return False
    if name in ("arm.torques", "map.motions") and shape is not None:
        return False
    return shape is not None and wanted in ("t", "mass", "drag", "least") and shape == ()


def _call(
    name: str,
    call: Callable[..., Value],
    given: dict[str, Value],
    count: Count,
    *,
    must: bool = False,
) -> Value:
    """Make a call; note what ends neither in a result nor in an error of one line."""
    count.calls += 1
    wanted = name[name.rindex("(") + 1 : -1]
    label = f"{name} of {said(given[wanted])}"
    try:
        result = call(**given)
    except MittError as error:
        count.refused += 1
        if "\n" in str(error):
            count.faults.append(f"{label}: more than one line: {error}")
        return _REFUSED
    except Exception as error:
        count.faults.append(f"{label}: {type(error).__name__}: {str(error)[:200]}")
        return _REFUSED
    if must:
        count.faults.append(f"{label}: was taken")
    return result


def soak(calls: int, *, seed: int, f: DirectMap | None = None) -> Count:
    """Call public functions with several wrong values at once, on copies, from several threads."""
    examples, found = Examples(f), Count()
    jobs = [job for job in _jobs(examples) if job[0] not in _SLOW]

    def run(k: int) -> Count:
        return _drawn(jobs, calls // _THREADS, np.random.default_rng((seed, k)))

    with ThreadPoolExecutor(_THREADS) as pool:
        for count in pool.map(run, range(_THREADS)):
            found.calls += count.calls
            found.refused += count.refused
            found.functions |= count.functions
            found.faults += count.faults
    return found


_Job = tuple[str, Value, str, dict[str, Value]]
"""What is called: its label, the object, the method's name, and right values."""

_SLOW: Final = frozenset(("rival.adapt", "rival.verdict"))
"""Functions of some milliseconds."""


def _jobs(examples: Examples) -> list[_Job]:
    """Return the methods of all objects, with a right value for each parameter."""
    jobs: list[_Job] = []
    for place, thing in examples.objects().items():
        kind = type(thing).__name__
        for name, taken in methods(thing):
            right = {
                p.name: examples.example(kind, name, p.name)
                for p in taken
                if p.default is inspect.Parameter.empty
            }
            jobs.append((f"{place}.{name}", thing, name, right))
    return jobs


def _drawn(jobs: list[_Job], calls: int, rng: np.random.Generator) -> Count:
    """Make calls with values that are drawn; objects go on from call to call, or are copied."""
    count, mine = Count(), dict[int, Value]()
    for k in range(calls):
        label, thing, name, right = jobs[rng.integers(len(jobs))]
        if id(thing) not in mine or rng.random() < 0.1:
            again = copy if rng.random() < 0.5 else deepcopy
            mine[id(thing)] = again(mine.get(id(thing), thing))
        given = {key: _any_form(value, rng) for key, value in right.items()}
        count.functions.add(label)
        count.calls += 1
        try:
            _method(mine[id(thing)], name)(**given)
        except MittError as error:
            count.refused += 1
            if "\n" in str(error):
                count.faults.append(f"call {k}, {label}: more than one line")
        except Exception as error:
            values = {key: said(value) for key, value in given.items()}
            text = f"{type(error).__name__}: {str(error)[:200]}"
            count.faults.append(f"call {k}, {label} of {values}: {text}")
    return count


def _any_form(value: Value, rng: np.random.Generator) -> Value:
    """Return a value as it is, in another form, absurd, of another shape, or nonsense."""
    kind = rng.integers(8)
    made = (same_numbers, absurd, wrong_shapes, nonsense)[kind - 4](value) if kind > 3 else ()
    forms = list(made)
    return forms[rng.integers(len(forms))] if forms else value


def _method(thing: Value, name: str) -> Callable[..., Value]:
    """Return a method of an object by its name."""
    return getattr(thing, name)  # type: ignore[no-any-return]
