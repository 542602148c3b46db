"""How kernels are compiled and kept, and how they take arrays: views and handles.

**Compiled once.** By itself Numba optimises a kernel and makes machine code of it, links it into
each kernel that calls it, and optimises both again, up to the top. Here a :func:`kernel` that
kernels call is typed and written as LLVM's code, no more: it is linked into what Python calls, and
that is optimised once and made machine code. A :func:`big_kernel`, which takes microseconds, is
machine code by itself, and others call it by its address: so no part of a tick is compiled twice,
and two processes can compile different parts.

**Kept.** Numba recompiles a cached kernel when its own file changes, but not when a kernel that it
calls has changed in another file. Here the folder of a cached kernel is named after a hash of its
file and of every file of mitt that it imports, directly or not. So the cache is right however mitt
is started, and versions, clones and environments share what they have in common.

**Not counted.** Numba counts who holds an array at each step that names it, which took a quarter
of a throw. Kernels that make no arrays hold none: what calls them does. Their counting is taken
out where they become machine code (``_Whole``). ``a[:] = b`` makes an array where the two might
overlap; :func:`copy` does not.

**Views.** Numba's own ``reshape`` calls a library. In compiled code a :func:`view` has no owner, so
it may only show what the caller of the kernel holds: an argument, or a part of one
(tests/test_kernels.py reads the source). In plain Python a view keeps alive what it shows.

**Handles.** Numba passes a named tuple to compiled code array by array, which costs more than a
tick. A :class:`Handle` holds the same arrays behind one pointer: the named tuple is for Python, its
handle for kernels, both have the same fields by the same names, and what one writes into an array
the other reads. Array types hold no lengths, so one compilation serves arrays of any length. Arrays
and handle keep the memory alive, each by itself.
"""

import hashlib
import logging
import os
import re
import shutil
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, lru_cache
from importlib import import_module
from math import prod
from pathlib import Path
from types import FunctionType
from typing import Any, Final, TypeAlias

import numpy as np
from llvmlite import binding, ir
from numba import __version__, config, njit, types
from numba.core import cgutils
from numba.core.base import BaseContext
from numba.core.caching import CacheImpl, CompileResultCacheImpl, FunctionCache, _CacheLocator
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, CompileResult
from numba.core.typing import Context, Signature
from numba.experimental import structref
from numba.extending import lower_builtin, type_callable
from numba.np.arrayobj import load_item, populate_array, store_item
from numba.np.numpy_support import as_dtype
from numpy.typing import NDArray

PACKAGE: Final = Path(__file__).parents[1]
"""Folder of mitt's source."""

_KEPT: Final = 8
"""Versions of a file whose compiled code is kept beside that of the present one."""

_IMPORT = re.compile(
    r"^[ \t]*(?:from[ \t]+(mitt[\w.]*)[ \t]+import[ \t]+(\([^)]*\)|[^\n]*)"
    r"|import[ \t]+(mitt[\w.]*))",
    re.MULTILINE,
)


def imports_of(source: str) -> list[str]:
    """Return the modules of mitt that a source may import, as dotted names.

    A name after ``import`` may be a module or not; both readings are returned.
    """
    found = []
    for module, names, plain in _IMPORT.findall(source):
        if module != "mitt":  # which imports what a user asks for
            found.append(module or plain)
        found += [f"{module}.{name}" for name in re.findall(r"\b\w+\b", names)]
    return found


@cache
def _read(file: Path) -> tuple[bytes, tuple[Path, ...]]:
    """Return the hash of a source file and the files of mitt that it imports."""
    text = file.read_bytes()
    imported = []
    for name in imports_of(text.decode("utf-8")):
        place = PACKAGE.joinpath(*name.split(".")[1:])
        imported += [p for p in (place.with_suffix(".py"), place / "__init__.py") if p.is_file()]
    return hashlib.sha256(text).digest(), tuple(imported)


@cache
def stamp_of(file: Path) -> bytes:
    """Return a hash of a source file and of all that it imports from mitt."""
    seen, todo = {file}, [file]
    while todo:
        for other in _read(todo.pop())[1]:
            if other not in seen:
                seen.add(other)
                todo.append(other)
    return hashlib.sha256(b"".join(sorted(_read(f)[0] for f in seen))).digest()


def _is_writable(folder: Path) -> bool:
    """Tell whether files can be made in a folder, which is made if it is not there."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True


@cache
def cache_folder() -> Path | None:
    """Return where compiled kernels are kept; None where no folder is writable.

    The first that can be written to of: ``NUMBA_CACHE_DIR``, the user's cache folder
    (``XDG_CACHE_HOME`` or ``~/.cache``), the Python environment.
    """
    if config.CACHE_DIR:
        folders = [Path(config.CACHE_DIR)]
    else:
        user = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
        folders = [Path(user) / "mitt" / "kernels", Path(sys.prefix) / "kernels"]
    found = next((folder for folder in folders if _is_writable(folder)), None)
    if found is None:
        logging.getLogger("mitt").warning(
            "no folder for compiled kernels can be written to: each process compiles anew; "
            "set NUMBA_CACHE_DIR"
        )
    return found


def _folder_of(file: Path, cache: Path) -> Path:
    """Return where the compiled kernels of a file are kept, below the cache's folder.

    Code that checks bounds (``NUMBA_BOUNDSCHECK``) is kept apart.
    """
    how = f"numba-{__version__}{'-checked' if config.BOUNDSCHECK else ''}"
    name = file.relative_to(PACKAGE) if file.is_relative_to(PACKAGE) else Path(file.name)
    folder = f"{'.'.join(name.with_suffix('').parts)}-{stamp_of(file).hex()[:16]}"
    return cache / how / folder


def is_cold() -> bool:
    """Tell whether no kernel of this source has been compiled yet."""
    cache = cache_folder()
    return cache is None or not any(
        _folder_of(PACKAGE / "core" / "catcher" / "tick.py", cache).glob("tick.tick*.nbc")
    )


def _delete_old(folder: Path) -> None:
    """Delete what other versions of a file compiled to, but for those compiled last."""
    others = {}
    for other in folder.parent.glob(folder.name[:-16] + "?" * 16):
        with suppress(OSError):  # another process may do the same
            others[other] = other.stat().st_mtime
    for other in sorted(others, key=others.__getitem__)[:-_KEPT]:
        shutil.rmtree(other, ignore_errors=True)


class _KernelLocator(_CacheLocator):  # type: ignore[misc]
    """Tells Numba where a kernel of mitt is kept and when it has to be compiled anew."""

    def __init__(self, file: Path, line: int, cache: Path) -> None:
        """Take where the kernel stands and where the cache is."""
        self._file, self._line = file, line
        self._folder = _folder_of(file, cache)

    def get_cache_path(self) -> str:
        """Return the folder of this kernel's compiled code."""
        return str(self._folder)

    def ensure_cache_path(self) -> None:
        """Make the folder; one of a new version lets the oldest go."""
        if not self._folder.exists():
            _delete_old(self._folder)
        super().ensure_cache_path()

    def get_source_stamp(self) -> bytes:
        """Return what changes with the kernel's source and that of the kernels it calls."""
        return stamp_of(self._file)

    def get_disambiguator(self) -> str:
        """Return what tells kernels of one name in one file apart."""
        return str(self._line)

    @classmethod
    def from_function(cls, py_func: Callable[..., Any], py_file: str) -> "_KernelLocator | None":
        """Return a locator for a function that :func:`kernel` compiles; None for any other."""
        file, folder = Path(py_file), cache_folder()
        if folder is None or py_func not in _kernels:
            return None
        return cls(file, py_func.__code__.co_firstlineno, folder)


CacheImpl._locator_classes.insert(0, _KernelLocator)

_kernels: set[Callable[..., Any]] = set()
_compiled: dict[Callable[..., Any], Callable[[tuple[types.Type, ...]], CompileResult]] = {}
_INNER: Final = "_inner"
#: Kernels, itself and what it calls, up to which a kernel has no file of its own for other kernels:
#: it compiles about as fast as it is read.
_FEW: Final = 3


def _general(kind: types.Type) -> types.Type:
    """Return the type for which a kernel is compiled when another kernel calls it.

    The type of a constant holds its value: each value would be compiled anew.
    """
    if isinstance(kind, types.IntegerLiteral | types.BooleanLiteral):
        return types.unliteral(kind)
    if isinstance(kind, types.Tuple | types.UniTuple):
        return types.Tuple.from_types([_general(part) for part in kind])
    return kind


def kernel(function: Callable[..., Any]) -> Any:  # noqa: ANN401
    """Compile a function when it is first called: typed once, optimised with what calls it.

    For other kernels it is compiled for the types of its arguments, not for the values of
    constants, to code that is linked into the caller's: that is ``inner``. For Python a wrapper is
    put around the same code, and the whole is optimised and made machine code. A kernel may not
    call itself.
    """
    return _kernel(function, _Linking)


def big_kernel(function: Callable[..., Any]) -> Any:  # noqa: ANN401
    """As :func:`kernel`, for what takes microseconds: made machine code once, called by address."""
    return _kernel(function, _Apart)


def _kernel(function: Callable[..., Any], how: type[Compiler]) -> Any:  # noqa: ANN401
    """Return the dispatcher for Python, which holds that for kernels as ``inner``."""
    outer = _dispatcher(function, _Wrapping)
    inner = _dispatcher(_renamed(function), how, no_cpython_wrapper=True)
    if how is _Linking and cache_folder() is not None:
        inner._cache = _LinkedCache(inner.py_func)
    template = inner.get_call_template

    def compiled(args: tuple[types.Type, ...]) -> CompileResult:
        """Return what a kernel is for kernels."""
        inner.compile(args)
        made = inner.overloads[args]
        made.library._reload_init.update(made.reload_init)  # Numba does not, for one from the cache
        if how is _Apart:
            name = _Symbol(function.__module__, function.__qualname__, args)
            made.library._reload_init.add(name)
            address = made.codegen._engine.get_function_address(made.fndesc.llvm_func_name)
            binding.add_symbol(str(name), address)
        return made

    def general_template(args: Sequence[types.Type], kws: Mapping[str, types.Type]) -> Any:  # noqa: ANN401
        """Compile for general types before the call is typed."""
        known = {name: _general(kind) for name, kind in kws.items()}
        found = template([_general(kind) for kind in args], known)
        compiled(tuple(found[2]))
        return found

    _compiled[function] = compiled
    outer.get_call_template, outer.get_overload = general_template, inner.get_overload
    outer.inner = inner
    return outer


def _dispatcher(function: Callable[..., Any], how: type[Compiler], **options: bool) -> Any:  # noqa: ANN401
    """Return what compiles a function when it is called."""
    _kernels.add(function)
    kept = cache_folder() is not None
    return njit(cache=kept, no_cfunc_wrapper=True, pipeline_class=how, **options)(function)


@dataclass(frozen=True, slots=True)
class _Symbol:
    """By what name the machine code of a big kernel is called, in any process."""

    module: str
    name: str
    args: tuple[types.Type, ...]

    def __str__(self) -> str:
        """Return the name."""
        kinds = hashlib.sha256(str(self.args).encode()).hexdigest()[:16]
        return f"{self.module}.{self.name}.{kinds}"

    def __call__(self) -> None:
        """Load or compile the kernel: Numba calls this before it loads what calls the kernel."""
        _compiled[vars(import_module(self.module))[self.name].py_func](self.args)


class _Linked(JITCodeLibrary):  # type: ignore[misc]
    """Code of one kernel as Numba wrote it, for what calls it; the machine never gets it."""

    own: binding.ModuleRef
    _final_module: binding.ModuleRef
    _shared_module: binding.ModuleRef | None
    _linking_libraries: list[JITCodeLibrary]

    def finalize(self) -> None:
        """Keep the code; the machine gets the names of environments, which Numba fills."""
        self.own = self._final_module
        names = [v.name for v in self.own.global_variables if v.name.startswith("_ZN08NumbaEnv")]
        stub = str(self._codegen._create_empty_module(self.name))
        for name in names:
            stub += f"\n@{name} = common local_unnamed_addr global i8* null"
        self._final_module = binding.parse_assembly(stub)
        for function in self.own.functions:
            if not function.is_declaration and function.linkage == binding.Linkage.external:
                function.linkage = "linkonce_odr"
        for library in self._linking_libraries:
            self._reload_init.update(library._reload_init)
        self._finalize_final_module()

    def _get_module_for_linking(self) -> binding.ModuleRef:
        """Return the code of this kernel and of all that it calls, for the cache."""
        if self._shared_module is None:
            self._shared_module = self.own.clone()
            for part in _parts(self._linking_libraries):
                self._shared_module.link_in(part, preserve=True)
        return self._shared_module


_COUNTS: Final = ("NRT_incref", "NRT_decref")
"""Numba's functions that count who holds an array."""
_HARMLESS: Final = {*_COUNTS, "NRT_MemInfo_data_fast", "NRT_MemInfo_call_dtor"}
"""Functions for memory that make none; the last is called where nobody holds an array any more."""


def _memory(code: binding.ModuleRef) -> dict[str, binding.ValueRef]:
    """Return Numba's functions for memory in code, by name."""
    return {f.name: f for f in code.functions if f.name.startswith("NRT_")}


def _rename(code: binding.ModuleRef, prefix: str) -> list[str]:
    """Rename the functions that count in code; return their names before."""
    found = {name: f for name, f in _memory(code).items() if name in _COUNTS}
    for name, function in found.items():
        function.name = prefix + name
    return list(found)


def _define(code: binding.ModuleRef, name: str, body: str = "") -> None:
    """Define a function of an array's owner in code, which is put where it is called."""
    text = f"define void @{name}(i8* %0) alwaysinline {{ {body} ret void }}"
    declared = "" if name in _COUNTS else "".join(f"declare void @{x}(i8*) " for x in _COUNTS)
    code.link_in(binding.parse_assembly(declared + text))


class _Whole(JITCodeLibrary):  # type: ignore[misc]
    """Machine code of a kernel and of all that is linked into it, optimised once.

    Where the kernels make no arrays and return none, what counts who holds an array is taken out
    of their code: who calls them holds what they are given, so the counts end as they began. A
    wrapper for Python goes on to count.
    """

    wraps: bool = False
    returns_arrays: bool = False
    _final_module: binding.ModuleRef
    _linking_libraries: list[JITCodeLibrary]

    def finalize(self) -> None:
        """Link each kernel once, however often it is called, then optimise."""
        code, parts = self._final_module, _parts(self._linking_libraries)
        for library in self._linking_libraries:
            self._reload_init.update(library._reload_init)
        self._linking_libraries = []
        own = _rename(code, "held_") if self.wraps else []
        asked = set().union(*(_memory(part) for part in (parts if self.wraps else [code, *parts])))
        idle = _COUNTS if asked <= _HARMLESS and not self.returns_arrays else ()
        for name in idle:
            _define(code, name)
        for part in parts:
            code.link_in(part, preserve=True)
        for name in idle:
            code.get_function(name).linkage = "internal"
            code.get_function(name).name = f"idle_{name}"
        for name in own:
            _define(code, f"held_{name}", f"call void @{name}(i8* %0)")
            code.get_function(f"held_{name}").linkage = "internal"
        super().finalize()


def _below(libraries: Sequence[JITCodeLibrary]) -> list[JITCodeLibrary]:
    """Return libraries, and what they call in turn, each once."""
    found, todo = [], list(libraries)
    while todo:
        library = todo.pop()
        if library not in found:
            found.append(library)
            todo += library._linking_libraries if isinstance(library, _Linked) else []
    return found


def _parts(libraries: Sequence[JITCodeLibrary]) -> list[binding.ModuleRef]:
    """Return the code of libraries, and of what they call in turn."""
    return [
        x.own if isinstance(x, _Linked) else x._get_module_for_linking() for x in _below(libraries)
    ]


def _library(
    kind: type[JITCodeLibrary], context: BaseContext, function: Callable[..., Any]
) -> JITCodeLibrary:
    """Return an empty library of a kind for the code of a function."""
    library = kind(context.codegen(), function.__qualname__)
    library.enable_object_caching()
    return library


class _LinkedImpl(CompileResultCacheImpl):  # type: ignore[misc]
    """Says which kernels are kept for other kernels."""

    def check_cachable(self, cres: CompileResult) -> bool:
        """Keep what takes longer to compile than to read: what calls some kernels in turn."""
        kernels = sum(library.name.endswith(_INNER) for library in _below([cres.library]))
        return kernels > _FEW and bool(super().check_cachable(cres))


class _LinkedCache(FunctionCache):  # type: ignore[misc]
    """Where kernels are kept for other kernels."""

    _impl_class = _LinkedImpl


def _with_dtypes(made: CompileResult) -> CompileResult:
    """Note the types of the arrays that a kernel returns, which Python is to be told.

    They stand with the kernel's constants, which its wrapper shares: the first of both that is
    read from the cache decides what these are. One that comes from there is another object, which
    Numba would note again.
    """
    answer, constants = made.signature.return_type, made.environment.consts
    for kind in answer if isinstance(answer, types.BaseTuple) else (answer,):
        if isinstance(kind, types.Array):
            dtype = as_dtype(kind.dtype)
            known = [k for k, x in enumerate(constants) if isinstance(x, np.dtype) and x == dtype]
            noted = known[0] if known else len(constants)
            constants[noted : noted + 1] = [dtype]
    return made


def _holds_arrays(context: BaseContext, made: CompileResult) -> bool:
    """Tell whether a kernel returns arrays or handles, which who calls it has to hold."""
    return bool(context.data_model_manager[made.signature.return_type].contains_nrt_meminfo())


class _Linking(Compiler):  # type: ignore[misc]
    """Compiles a kernel for other kernels: they link its code."""

    def compile_extra(self, func: Callable[..., Any]) -> CompileResult:
        """Compile a function into a library that is linked."""
        self.state.library = _library(_Linked, self.state.targetctx, func)
        return _with_dtypes(super().compile_extra(func))


class _Apart(Compiler):  # type: ignore[misc]
    """Compiles a big kernel for other kernels: they link a call of its symbol."""

    def compile_extra(self, func: Callable[..., Any]) -> CompileResult:
        """Compile a function to machine code, and write the call."""
        args, context = tuple(self.state.args), self.state.targetctx
        self.state.library = _library(_Whole, context, func)
        made = _with_dtypes(super().compile_extra(func))
        if _holds_arrays(context, made):
            raise TypeError(f"{func.__name__}: wanted a big kernel that returns no array, got one")
        module, fndesc = ir.Module(), made.fndesc
        kind = context.call_conv.get_function_type(fndesc.restype, fndesc.argtypes)
        name = _Symbol(func.__module__, func.__qualname__.removesuffix(_INNER), args)
        far = ir.Function(module, kind, str(name))
        near = ir.Function(module, kind, fndesc.llvm_func_name)
        near.linkage = "linkonce_odr"
        near.attributes.add("alwaysinline")
        builder = ir.IRBuilder(near.append_basic_block())
        builder.ret(builder.call(far, near.args))
        made.library._shared_module = binding.parse_assembly(str(module))
        return made


class _Wrapping(Compiler):  # type: ignore[misc]
    """Compiles a kernel for Python: a wrapper around what it is for other kernels."""

    def compile_extra(self, func: Callable[..., Any]) -> CompileResult:
        """Compile a wrapper and link what it calls."""
        made, context = _compiled[func](tuple(self.state.args)), self.state.targetctx
        _with_dtypes(made)
        library = _library(_Whole, context, func)
        library.wraps, library.returns_arrays = True, _holds_arrays(context, made)
        library.add_linking_library(made.library)
        context.create_cpython_wrapper(library, made.fndesc, made.environment, None)
        entry = context.get_executable(library, made.fndesc, made.environment)
        needed = [*library._reload_init]
        return made._replace(library=library, entry_point=entry, metadata=None, reload_init=needed)


def _renamed(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return the same function by another name, so that its compiled code is kept beside."""
    code, name = function.__code__, f"{function.__qualname__}{_INNER}"
    other = FunctionType(
        code, function.__globals__, name, function.__defaults__, function.__closure__
    )
    other.__qualname__, other.__module__ = name, function.__module__
    other.__kwdefaults__ = function.__kwdefaults__
    return other


def view(v: NDArray[Any], start: int, shape: tuple[int, ...]) -> NDArray[Any]:
    """Return the numbers of an array from an index on as an array of another shape.

    Args:
        v: Contiguous, row by row; compiled code sees to it that it lives as long as the result.
        start: Index of the first number, all numbers of ``v`` counted in one row.
        shape: Of the result.
    """
    return v.reshape(-1)[start : start + prod(shape)].reshape(shape)


@type_callable(view)
def _type_of_view(_: Context) -> Callable[..., types.Type | None]:
    """Return what tells the type of a view; None says that there is none."""

    def kind(v: types.Type, start: types.Type, shape: types.Type) -> types.Type | None:
        whole = isinstance(start, types.Integer) and isinstance(shape, types.BaseTuple)
        if whole and isinstance(v, types.Array) and v.layout == "C":
            return types.Array(v.dtype, len(shape), "C", readonly=not v.mutable)
        return None

    return kind


@lower_builtin(view, types.Array, types.Integer, types.BaseTuple)
def _write_view(
    context: BaseContext, builder: ir.IRBuilder, signature: Signature, given: Sequence[ir.Value]
) -> ir.Value:
    """Write the code of :func:`view`: an array without an owner."""
    of, at, sides = signature.args
    array = context.make_array(of)(context, builder, given[0])
    start = context.cast(builder, given[1], at, types.intp)
    shape = [
        context.cast(builder, side, kind, types.intp)
        for side, kind in zip(cgutils.unpack_tuple(builder, given[2]), sides, strict=True)
    ]
    size = context.get_constant(types.intp, context.get_abi_sizeof(array.data.type.pointee))
    count, strides = context.get_constant(types.intp, 1), []
    for side in reversed(shape):
        strides.append(builder.mul(count, size))
        count = builder.mul(count, side)
    if config.BOUNDSCHECK:
        beyond = builder.icmp_signed(">", builder.add(start, count), array.nitems)
        with builder.if_then(
            builder.or_(builder.icmp_signed("<", start, count.type(0)), beyond), likely=False
        ):
            context.call_conv.return_user_exc(
                builder, IndexError, ("a view reaches beyond its array",)
            )
    shown = context.make_array(signature.return_type)(context, builder)
    data = builder.gep(array.data, [start])
    populate_array(shown, data, shape, strides[::-1], size, meminfo=None)
    return shown._getvalue()


def copy(values: NDArray[Any], into: NDArray[Any]) -> None:
    """Copy an array into another of the same shape, which it does not overlap.

    Compiled code looks at the shapes where Numba is asked to check bounds.
    """
    into[...] = values


@type_callable(copy)
def _type_of_copy(_: Context) -> Callable[..., types.Type | None]:
    """Return what tells whether a copy can be made: of as many dimensions."""

    def kind(values: types.Type, into: types.Type) -> types.Type | None:
        arrays = isinstance(values, types.Array) and isinstance(into, types.Array)
        return types.none if arrays and values.ndim == into.ndim and into.mutable else None

    return kind


@lower_builtin(copy, types.Array, types.Array)
def _write_copy(
    context: BaseContext, builder: ir.IRBuilder, signature: Signature, given: Sequence[ir.Value]
) -> ir.Value:
    """Write the code of :func:`copy`: one number after the other."""
    of, to = signature.args
    values, into = (
        context.make_array(kind)(context, builder, array)
        for kind, array in zip(signature.args, given, strict=True)
    )
    sides = cgutils.unpack_tuple(builder, into.shape)
    if config.BOUNDSCHECK:
        others = cgutils.unpack_tuple(builder, values.shape)
        for side, other in zip(sides, others, strict=True):
            with builder.if_then(builder.icmp_signed("!=", side, other), likely=False):
                context.call_conv.return_user_exc(
                    builder, IndexError, ("a copy into an array of another shape",)
                )
    with cgutils.loop_nest(builder, sides, context.get_value_type(types.intp)) as at:
        read = cgutils.get_item_pointer(context, builder, of, values, at)
        write = cgutils.get_item_pointer(context, builder, to, into, at)
        number = context.cast(builder, load_item(context, builder, of, read), of.dtype, to.dtype)
        store_item(context, builder, to, number, write)
    return context.get_dummy_value()


Record = NDArray[np.void]
"""Array of records."""
Fields: TypeAlias = Any
"""One record: its fields are attributes in kernels, and keys in Python."""


@structref.register
class _StructType(types.StructRef):  # type: ignore[misc]
    """The type of a handle: names and types of its fields."""


class Handle(structref.StructRefProxy):  # type: ignore[misc]
    """The same arrays as those of a named tuple, for kernels; Python does not look into it."""


structref.define_boxing(_StructType, Handle)


def define(handle: type[Handle], of: type[tuple[Any, ...]]) -> None:
    """Let kernels make handles of a class from the fields of a named tuple's class.

    For a named tuple ``Thing``::

        class ThingHandle(Handle): ...
        define(ThingHandle, Thing)

        @kernel
        def thing_handle(thing):
            return ThingHandle(*thing)
    """
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
