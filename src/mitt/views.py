"""Parts of an array in another shape, in Python and in compiled code.

Numba's own ``reshape`` calls a library and counts references, which together take a third of a
tick. In compiled code a view has no owner, so it may only show what the caller of the kernel holds:
an argument, or a part of one (tests/test_views.py reads the source). In plain Python a view keeps
alive what it shows.
"""

from collections.abc import Callable, Sequence
from math import prod
from typing import Any, TypeAlias

from llvmlite import ir
from numba import carray, types
from numba.core import config
from numba.core.base import BaseContext
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
