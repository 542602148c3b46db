"""How compiled code reads arrays: parts in another shape, no references counted.

numba keeps alive each array that a kernel takes out of a tuple or cuts out of another array, by two
atomic additions, and a ``reshape`` of its is a call into a library: together a tenth of a tick.
A lent array has no owner, and neither has what is cut out of it; a view is lent from the start. Who
lends must keep the array until the kernel returns, as every caller of a kernel does, and must not
return it: kernels lend their arguments, never an array that they have made themselves. A function
that hands out views is a ``register_jitable``: part of the compiled code that calls it, and plain
Python elsewhere, where views do keep alive what they show.
"""

from collections.abc import Callable, Sequence
from math import prod
from typing import Any, TypeAlias

from llvmlite import ir
from numba import carray, types
from numba.core import cgutils, config
from numba.core.base import BaseContext
from numba.core.errors import TypingError
from numba.core.typing import Context, Signature
from numba.extending import intrinsic, overload
from numpy.typing import NDArray

Typed: TypeAlias = tuple[
    Signature, Callable[[BaseContext, ir.IRBuilder, Signature, Sequence[ir.Value]], ir.Value]
]
"""What numba wants of an intrinsic: its types, and what writes its code."""
Body: TypeAlias = Callable[..., Any]
"""What numba is to compile in the place of a function."""


def view(v: NDArray[Any], start: int, shape: tuple[int, ...]) -> NDArray[Any]:
    """Return the numbers of an array from an index on as an array of another shape.

    Args:
        v: Contiguous, row by row; compiled code sees to it that it lives as long as the result.
        start: Index of the first number, all numbers of ``v`` counted in one row.
        shape: Of the result.
    """
    return v.reshape(-1)[start : start + prod(shape)].reshape(shape)


@intrinsic
def _address(_: Context, v: types.Type, start: types.Type) -> Typed:
    """Return where a number of an array lies."""

    def write(
        context: BaseContext, builder: ir.IRBuilder, signature: Signature, given: Sequence[ir.Value]
    ) -> ir.Value:
        array = context.make_array(signature.args[0])(context, builder, given[0])
        return builder.gep(array.data, [given[1]])

    del start  # of whatever kind, it is cast to the one that the signature names
    return types.CPointer(v.dtype)(v, types.intp), write


@overload(view)
def _compiled_view(v: types.Type, start: types.Type, shape: types.Type) -> Body | None:
    """Return what :func:`view` is in compiled code; None says that these types have no view."""
    del start, shape
    if not (isinstance(v, types.Array) and v.layout == "C"):
        return None
    if config.BOUNDSCHECK:
        return _checked_view
    return _plain_view


def _plain_view(v: types.Type, start: types.Type, shape: types.Type) -> NDArray[Any]:
    """See :func:`view`."""
    shown: NDArray[Any] = carray(_address(v, start), shape)
    return shown


def _checked_view(v: types.Type, start: types.Type, shape: types.Type) -> NDArray[Any]:
    """As :func:`view`, where numba is asked to check bounds."""
    count = 1
    for side in shape:
        count *= side
    if start < 0 or start + count > v.size:
        raise IndexError("a view reaches beyond its array")
    shown: NDArray[Any] = carray(_address(v, start), shape)
    return shown


@intrinsic
def lent(_: Context, value: types.Type) -> Typed:
    """Return an array, or a tuple of arrays and numbers, in which no array has an owner."""
    if not _can_be_lent(value):
        raise TypingError(f"only arrays, numbers and tuples of them can be lent, not {value}")

    def write(
        context: BaseContext, builder: ir.IRBuilder, signature: Signature, given: Sequence[ir.Value]
    ) -> ir.Value:
        return _disown(context, builder, signature.return_type, given[0])

    return value(value), write


def _can_be_lent(kind: types.Type) -> bool:
    """Say whether a value has no owners but those of arrays: others would be freed too early."""
    if isinstance(kind, types.BaseTuple):
        return all(_can_be_lent(part) for part in kind)
    return isinstance(kind, types.Array | types.Number | types.Boolean | types.NoneType)


def _disown(
    context: BaseContext, builder: ir.IRBuilder, kind: types.Type, value: ir.Value
) -> ir.Value:
    """Return a value without the owners of its arrays."""
    if isinstance(kind, types.Array):
        array = context.make_array(kind)(context, builder, value)
        array.meminfo = cgutils.get_null_value(array.meminfo.type)
        array.parent = cgutils.get_null_value(array.parent.type)
        return array._getvalue()
    if isinstance(kind, types.BaseTuple):
        for k, part in enumerate(kind):
            item = _disown(context, builder, part, builder.extract_value(value, k))
            value = builder.insert_value(value, item, k)
    return value
