"""Dataclasses as plain JSON and back, to the bit, by the types that their fields state.

A file names no class: the reader says what it wants, and takes nothing else. Numbers keep every
digit; infinity, which JSON lacks, is the text "inf". NaN is refused both ways.
"""

from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from functools import lru_cache
from math import inf, isfinite, isnan
from types import NoneType, UnionType
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

from mitt.errors import InputError

_Kind = TypeVar("_Kind")
_ENDLESS = {"inf": inf, "-inf": -inf}
#: Most numbers of one array that is read.
_MOST = 1_000_000


def to_plain(value: object) -> Any:  # noqa: ANN401 (any JSON value)
    """Return a dataclass, and what it is made of, as values that JSON has."""
    if is_dataclass(value) and not isinstance(value, type):
        return {x.name: to_plain(getattr(value, x.name)) for x in fields(value) if x.init}
    if isinstance(value, np.ndarray):
        return to_plain(value.tolist())
    if isinstance(value, Mapping):
        return {str(name): to_plain(x) for name, x in value.items()}
    if isinstance(value, tuple | list):
        return [to_plain(x) for x in value]
    if isinstance(value, float) and not isfinite(value):
        if isnan(value):
            raise InputError("a number to be written", "no NaN", "NaN")
        return "inf" if value > 0 else "-inf"
    return value.item() if isinstance(value, np.generic) else value


def from_plain(kind: type[_Kind], raw: object, *, place: str = "the file") -> _Kind:
    """Return a value of a class from what :func:`to_plain` made of it.

    Raises:
        MittError: It says something else; the class itself may refuse its numbers.
    """
    value: _Kind = _value(kind, raw, place)
    return value


@lru_cache(maxsize=64)
def _hints(kind: type) -> dict[str, Any]:
    """Return the types of a dataclass's fields."""
    return get_type_hints(kind)


def _value(kind: Any, raw: Any, place: str) -> Any:  # noqa: ANN401 (what a type states)
    """Return a value of a stated type."""
    origin, inner = get_origin(kind), get_args(kind)
    if origin in (Union, UnionType):
        return _one_of(inner, raw, place)
    if kind is NoneType and raw is None:
        return None
    if origin is np.ndarray or kind is np.ndarray:
        return _array(raw, place)
    if origin is tuple and isinstance(raw, list):
        kinds = inner[:1] * len(raw) if inner[-1] is ... else inner
        if len(kinds) == len(raw):
            pairs = zip(kinds, raw, strict=True)
            return tuple(_value(one, x, f"{place}[{k}]") for k, (one, x) in enumerate(pairs))
    if is_dataclass(kind) and isinstance(raw, dict):
        return _dataclass(kind, raw, place)
    if kind is float and (found := _number(raw)) is not None:
        return found
    if kind in (str, bool, int) and type(raw) is kind:
        return raw
    name = getattr(kind, "__name__", str(kind))
    raise InputError(place, f"a value of type {name}", type(raw).__name__)


def _one_of(kinds: tuple[Any, ...], raw: Any, place: str) -> Any:  # noqa: ANN401
    """Return a value of the first type that takes it."""
    if raw is None and NoneType in kinds:
        return None
    rest = [kind for kind in kinds if kind is not NoneType]
    for kind in rest[:-1]:
        try:
            return _value(kind, raw, place)
        except InputError:
            continue
    return _value(rest[-1], raw, place)


def _number(raw: object) -> float | None:
    """Return a number, infinity included; None where it is none."""
    if isinstance(raw, int | float) and not isinstance(raw, bool):
        return float(raw) if abs(raw) <= 1e300 else None
    return _ENDLESS.get(raw) if isinstance(raw, str) else None


def _array(raw: object, place: str) -> Any:  # noqa: ANN401
    """Return numbers in nested lists as an array."""
    flat: list[float] = []

    def walk(x: object, depth: int) -> object:
        if isinstance(x, list) and depth < 4:
            return [walk(y, depth + 1) for y in x]
        number = _number(x)
        if number is None or len(flat) >= _MOST:
            raise InputError(place, "numbers in lists", type(x).__name__)
        flat.append(number)
        return number

    try:
        return np.array(walk(raw, 0), dtype=np.float64)
    except ValueError as error:
        raise InputError(place, "lists of equal lengths", error) from None


def _dataclass(kind: Any, raw: dict[str, Any], place: str) -> Any:  # noqa: ANN401
    """Return a dataclass; a field that is missing takes its default."""
    known = {x.name: x for x in fields(kind) if x.init}
    for name in raw:
        if name not in known:
            raise InputError(f"{place}.{name[:60]}", f"one of {', '.join(known)}", "another")
    given = {}
    for name, x in known.items():
        if name in raw:
            given[name] = _value(_hints(kind)[name], raw[name], f"{place}.{name}")
        elif x.default is MISSING and x.default_factory is MISSING:
            raise InputError(f"{place}.{name}", "a value", "none")
    return kind(**given)
