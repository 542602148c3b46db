"""Checks at public entry points, made before compiled code sees a value.

Compiled code reads beyond an array that is too short and is compiled again for another type. So
each function here returns one type only: ``float``, ``int``, ``bool``, or a writable array of
float64 in C order (the given array if it is one already, else a copy). Other values raise a
:class:`mitt.core.errors.MittError` of one line.
"""

import os
from collections.abc import Iterable, Mapping, Sequence
from math import inf, isfinite
from operator import index
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from mitt.core.errors import InputError, ShapeError, UnknownNameError

_Kind = TypeVar("_Kind")

#: Largest text of a refused value in a message [characters].
_MOST = 60
#: Relative error of a covariance that is rounding.
_ROUNDED = 1e-6
#: Longest name of a file and longest path that systems take [bytes].
_LONGEST_NAME = 255
_LONGEST_PATH = 4000


def array(
    name: str, value: object, shape: Sequence[int | None], *, finite: bool = False
) -> NDArray[np.float64]:
    """Return a value as an array of float64.

    Args:
        name: What an error calls it.
        value: Given by a user.
        shape: Wanted; None where an axis may have any length.
        finite: Whether NaN and infinity are refused.

    Raises:
        InputError: It is not made of real numbers, or not finite.
        ShapeError: It has another shape.
    """
    given = value
    if not (isinstance(given, np.ndarray) and given.dtype == np.float64 and given.flags.carray):
        given = _numbers(name, value)
    if given.shape != shape and (
        len(given.shape) != len(shape)
        or any(
            wanted is not None and wanted != side
            for wanted, side in zip(shape, given.shape, strict=True)
        )
    ):
        sides = ", ".join("K" if side is None else str(side) for side in shape)
        raise ShapeError(name, f"({sides},)" if len(shape) == 1 else f"({sides})", given.shape)
    if type(given) is not np.ndarray:
        given = np.array(given, order="C")
    if finite and not np.isfinite(given).all():
        raise InputError(name, "finite numbers", "NaN or infinity")
    return given


def covariance(name: str, value: object, n: int) -> NDArray[np.float64]:
    """Return a value as a covariance of ``n`` numbers; see :func:`array`.

    Raises:
        InputError: It is not finite, not symmetric, or some sum of the numbers would have a
            negative variance, beyond what rounding makes of 0.
        ShapeError: It has another shape.
    """
    given = array(name, value, (n, n), finite=True)
    if not given.any() or _is_definite(given):
        return given
    sigma = np.sqrt(np.maximum(given.diagonal(), 0.0))
    known = sigma == 0.0  # exactly, so it varies with nothing
    sigma[known] = 1.0
    share = given / np.outer(sigma, sigma)
    even = np.abs(share - share.T).max() <= _ROUNDED and not given[known].any()
    if not even or np.linalg.eigvalsh(share)[0] < -_ROUNDED:
        raise InputError(name, "a symmetric, positive semidefinite matrix", "another")
    return given


def _is_definite(matrix: NDArray[np.float64]) -> bool:
    """Say whether a matrix is symmetric and positive definite, to the bit."""
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        return False
    return bool((matrix == matrix.T).all())


def vector(name: str, value: object, n: int, *, finite: bool = False) -> NDArray[np.float64]:
    """Return a value as an array of ``n`` numbers; see :func:`array`."""
    return array(name, value, (n,), finite=finite)


def rows(name: str, value: object, width: int) -> NDArray[np.float64]:
    """Return a value as an array of shape (..., ``width``), of at least one axis, without NaN."""
    given = _numbers(name, value)
    if given.ndim == 0 or given.shape[-1] != width:
        raise ShapeError(name, f"(..., {width})", given.shape)
    return numbers(name, given)


def numbers(name: str, value: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return an array that has no NaN in it; infinity passes, as the share of a limit of 0."""
    if np.isnan(value).any():
        raise InputError(name, "numbers", "NaN")
    return value


def number(
    name: str,
    value: object,
    *,
    finite: bool = False,
    least: float | None = None,
    most: float | None = None,
) -> float:
    """Return a real number, within bounds if there are any.

    Args:
        name: What an error calls it.
        value: Given by a user.
        finite: Whether NaN and infinity are refused; bounds refuse NaN, and what is beyond them.
        least: Least number, if there is one.
        most: Largest number, if there is one.

    Raises:
        InputError: It is no real number, or out of bounds.
    """
    if least is not None or most is not None:
        low, high = -inf if least is None else least, inf if most is None else most
        given = _real(name, value, finite=finite)
        if low <= given <= high:
            return given
        wanted = f"a number from {low:g} to {high:g}" if most is not None else f"at least {low:g}"
        raise InputError(name, wanted, shown(value))
    return _real(name, value, finite=finite)


def _real(name: str, value: object, *, finite: bool) -> float:
    """Return a real number; infinity and NaN pass unless ``finite`` is wanted."""
    if isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool):
        try:
            given = float(value)
        except OverflowError:
            raise InputError(name, "a number", "an integer too large for one") from None
        if not finite or isfinite(given):
            return given
    elif isinstance(value, np.ndarray) and value.ndim == 0 and value.dtype.kind in "fiu":
        return _real(name, value[()], finite=finite)
    raise InputError(name, "a finite number" if finite else "a number", shown(value))


def whole(name: str, value: object, *, least: int | None = None, most: int | None = None) -> int:
    """Return an integer within bounds.

    Raises:
        InputError: It is none, or out of bounds.
    """
    try:
        given = index(value) if not isinstance(value, bool) else None  # type: ignore[arg-type]
    except TypeError:
        given = None
    low, high = -inf if least is None else least, inf if most is None else most
    if given is not None and low <= given <= high:
        return given
    wanted = "an integer"
    if least is not None:
        wanted += f" of at least {least}" if most is None else f" in {least}..{most}"
    raise InputError(name, wanted, shown(value))


def flag(name: str, value: object) -> bool:
    """Return a truth value.

    Raises:
        InputError: It is none.
    """
    if isinstance(value, bool | np.bool_):
        return bool(value)
    raise InputError(name, "True or False", shown(value))


def text(name: str, value: object) -> str:
    """Return a text.

    Raises:
        InputError: It is none.
    """
    if isinstance(value, str):
        return str(value)
    raise InputError(name, "a text", shown(value))


def one_of(name: str, value: object, known: Iterable[str]) -> str:
    """Return a text that is one of those known.

    Raises:
        UnknownNameError: It is none of them.
    """
    known = tuple(known)
    if isinstance(value, str) and value in known:
        return value
    raise UnknownNameError(name, value if isinstance(value, str) else shown(value), known)


def path(name: str, value: object) -> Path:
    """Return a path that a file could have, whether or not one is there.

    Raises:
        InputError: It is no path: of another type, an empty text, too long, or not to be written as
            one. ``Path("")`` is the working folder, as ``.`` is.
    """
    if not isinstance(value, str | Path):
        raise InputError(name, "a path", shown(value))
    if not str(value):
        raise InputError(name, "a path", "an empty text")
    try:
        parts = [os.fsencode(part) for part in Path(value).parts]
    except UnicodeEncodeError:
        raise InputError(name, "a path", "characters that no path can have") from None
    if b"\0" in b"".join(parts):
        raise InputError(name, "a path", "a NUL in it")
    if max(map(len, parts), default=0) > _LONGEST_NAME or sum(map(len, parts)) > _LONGEST_PATH:
        raise InputError(name, f"a path of names of at most {_LONGEST_NAME} bytes", "a longer one")
    return Path(value)


def mapping(name: str, value: object) -> Mapping[object, object]:
    """Return a mapping, as a dictionary is.

    Raises:
        InputError: It is none.
    """
    if not isinstance(value, Mapping):
        raise InputError(name, "a mapping, as {name: value}", shown(value))
    return value


def instance(name: str, value: object, kind: type[_Kind]) -> _Kind:
    """Return a value that is of a class.

    Raises:
        InputError: It is of another.
    """
    if not isinstance(value, kind):
        raise InputError(name, _one(kind.__name__), shown(value))
    return value


def image(name: str, value: object, shape: tuple[int, int] | None = None) -> NDArray[np.uint8]:
    """Return an image of grey values; it may be a window or write-protected.

    Args:
        name: What an error calls it.
        value: Given by a user.
        shape: Rows and columns wanted [px]; any where None.

    Raises:
        InputError: It is no array of uint8.
        ShapeError: It has another shape, or no pixel.
    """
    if not isinstance(value, np.ndarray) or value.dtype != np.uint8:
        given = f"dtype {value.dtype}" if isinstance(value, np.ndarray) else shown(value)
        raise InputError(
            name,
            "an array of uint8",
            given,
            do="scale grey values to 0..255 and use astype(np.uint8)",
        )
    pixels: NDArray[np.uint8] = value
    if pixels.ndim != 2 or pixels.size == 0 or (shape is not None and pixels.shape != shape):
        wanted = "(height, width)" if shape is None else str(shape)
        raise ShapeError(name, wanted, pixels.shape)
    return pixels


def shown(value: object) -> str:
    """Return what an error says of a value: its type, and the value where that is short."""
    kind = type(value).__name__
    if isinstance(value, np.ndarray):
        return f"an array of {value.dtype}, shape {value.shape}"
    if value is None or isinstance(value, bool | int | float | str):
        try:
            text = repr(value)
        except ValueError:  # an integer of thousands of digits
            return f"a huge {kind}"
        return text if len(text) <= _MOST else f"{text[:_MOST]}..."
    return _one(kind)


def _numbers(name: str, value: object) -> NDArray[np.float64]:
    """Return a value as an array of float64 in C order, whatever its shape."""
    try:
        given: NDArray[Any] = np.asarray(value)
    except Exception as error:  # what a value's own conversion raises is unknown
        why = f" ({str(error)[:_MOST]})" if str(error) else ""
        raise InputError(name, "an array of numbers", shown(value) + why) from None
    if given.dtype.kind not in "fiu":
        raise InputError(name, "an array of numbers", shown(given))
    with np.errstate(over="ignore"):
        return np.array(given, dtype=np.float64, order="C")


def _one(noun: str) -> str:
    """Return a noun with its article."""
    return f"{'an' if noun[0].lower() in 'aeiou' else 'a'} {noun}"
