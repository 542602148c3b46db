"""Parts of an array in another shape, for compiled code: no copies, no references counted.

numba's own slices keep alive what they show, which costs two atomic additions each, and its
``reshape`` a call into a library. What shows a part of a vector here does not keep it alive:
kernels take views of their arguments alone, never of an array that they have made themselves.
A function that hands out views is a ``register_jitable``: part of the compiled code that calls it,
and plain Python elsewhere, where views do keep alive what they show.
"""

from collections.abc import Callable, Sequence
from math import prod
from typing import Any, TypeAlias

from llvmlite.ir import IRBuilder, Value
from numba import carray, types
from numba.core.base import BaseContext
from numba.core.typing.templates import Signature
from numba.extending import intrinsic, overload
from numpy.typing import NDArray

_Lower: TypeAlias = Callable[[BaseContext, IRBuilder, Signature, Sequence[Value]], Value]


def view(v: NDArray[Any], start: int, shape: tuple[int, ...]) -> NDArray[Any]:
    """Return the numbers of an array from an index on as an array of another shape.

    Args:
        v: Contiguous, row by row; compiled code sees to it that it lives as long as the result.
        start: Index of the first number, all numbers of ``v`` counted in one row.
        shape: Of the result.
    """
    return v.reshape(-1)[start : start + prod(shape)].reshape(shape)


@intrinsic
def _address(_: BaseContext, v: types.Type, start: types.Type) -> tuple[Signature, _Lower]:
    """Return where a number of an array lies."""

    def lower(
        context: BaseContext, builder: IRBuilder, signature: Signature, args: Sequence[Value]
    ) -> Value:
        array = context.make_array(signature.args[0])(context, builder, args[0])
        return builder.gep(array.data, [args[1]])

    del start  # of whatever kind, it is cast to the one that the signature names
    return types.CPointer(v.dtype)(v, types.intp), lower


@overload(view)
def _compiled(
    v: types.Type, start: types.Type, shape: types.Type
) -> Callable[[types.Type, types.Type, types.Type], Value] | None:
    """Return what :func:`view` is in compiled code; None says that these types have no view."""
    del start, shape
    if not (isinstance(v, types.Array) and v.layout == "C"):
        return None

    def impl(v: types.Type, start: types.Type, shape: types.Type) -> Value:
        return carray(_address(v, start), shape)

    return impl
