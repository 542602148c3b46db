"""Other forms of right values, and values that are wrong."""

from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any, Final

import numpy as np

Value = Any

#: Kinds of arrays that hold the same numbers.
_TYPES: Final = ("f2", "f4", ">f8", "g")


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
        if float(np.float32(value)) == value:
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


def said(value: Value) -> str:
    """Return what a report says of a value."""
    if isinstance(value, np.ndarray):
        return f"{value.dtype} {value.shape} {value.ravel()[-1:]}"
    return repr(value)[:60]
