"""What compiled code can ask of the machine beyond Python: no count of references, early reads.

Numba counts each array that a kernel takes out of a tuple or cuts out of another array, up and down
again, by atomic instructions: 7 % of a trial. A lent array has no owner, and neither has what is
cut out of it: there is nothing to count. Who lends must keep the array until the kernel returns,
as every caller of a kernel does, and must not return it.
"""

from collections.abc import Callable, Sequence
from typing import TypeAlias

from llvmlite import ir  # type: ignore[import-untyped]
from numba import types
from numba.core import cgutils
from numba.core.base import BaseContext
from numba.core.typing import Context, Signature
from numba.extending import intrinsic

Typed: TypeAlias = tuple[
    Signature, Callable[[BaseContext, ir.IRBuilder, Signature, Sequence[ir.Value]], ir.Value]
]
"""What Numba wants of an intrinsic: its types, and what writes its code."""


@intrinsic
def lent(_: Context, value: types.Type) -> Typed:
    """Return an array, or a tuple of arrays and others, in which no array has an owner."""

    def write(
        context: BaseContext, builder: ir.IRBuilder, signature: Signature, given: Sequence[ir.Value]
    ) -> ir.Value:
        return _disown(context, builder, signature.return_type, given[0])

    return value(value), write


@intrinsic
def fetch(_: Context, array: types.Array, index: types.Integer) -> Typed:
    """Begin to read a number of a vector that will be wanted soon; nothing waits for it.

    Any index will do: memory that is not there is not read.
    """

    def write(
        context: BaseContext, builder: ir.IRBuilder, signature: Signature, given: Sequence[ir.Value]
    ) -> ir.Value:
        data = context.make_array(signature.args[0])(context, builder, given[0]).data
        place = builder.bitcast(builder.gep(data, [given[1]]), cgutils.voidptr_t)
        kind = ir.FunctionType(ir.VoidType(), [cgutils.voidptr_t] + 3 * [cgutils.int32_t])
        read = builder.module.declare_intrinsic("llvm.prefetch", [cgutils.voidptr_t], kind)
        builder.call(read, [place] + [cgutils.int32_t(k) for k in (0, 3, 1)])
        return context.get_dummy_value()

    return types.void(array, index), write


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
