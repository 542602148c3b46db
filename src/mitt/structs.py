"""Named tuples of arrays that compiled code takes as one argument.

Numba passes a named tuple to compiled code array by array, which costs more than a tick. A handle
holds the same arrays behind one pointer: the named tuple is for Python, its handle for kernels,
both have the same fields by the same names, and what one writes into an array the other reads.
Array types hold no lengths, so one compilation serves arrays of any length. Arrays and handle keep
the memory alive, each by itself.

To make a handle for a named tuple ``Thing``:

    class ThingHandle(Handle): ...
    define(ThingHandle, Thing)

    @kernel
    def thing_handle(thing):
        return ThingHandle(*thing)
"""

from functools import lru_cache
from typing import Any

import numpy as np
from numba import types
from numba.experimental import structref
from numpy.typing import NDArray

Record = NDArray[np.void]


@structref.register
class _StructType(types.StructRef):  # type: ignore[misc]
    """The type of a handle: names and types of its fields."""


class Handle(structref.StructRefProxy):  # type: ignore[misc]
    """The same arrays as those of a named tuple, for kernels; Python does not look into it."""


structref.define_boxing(_StructType, Handle)


def define(handle: type[Handle], of: type[tuple[Any, ...]]) -> None:
    """Let kernels make handles of a class from the fields of a named tuple's class."""
    structref.define_constructor(handle, _StructType, of._fields)  # type: ignore[attr-defined]


@lru_cache(maxsize=8)
def _layout(fields: tuple[tuple[str, type], ...]) -> np.dtype[np.void]:
    """Return the layout of a record, aligned as compiled code likes it."""
    return np.dtype(list(fields), align=True)


def record_of(values: dict[str, bool | float], like: dict[str, bool | float]) -> Record:
    """Return a record of single numbers, shape (1,).

    Args:
        values: The numbers by name.
        like: The same names; a field has the type that its number has here, whatever is given.
    """
    record = np.zeros(1, _layout(tuple((name, type(x)) for name, x in like.items())))
    record[0] = tuple(values[name] for name in like)
    return record
