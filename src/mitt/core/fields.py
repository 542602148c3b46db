"""Fields of settings that a user makes, checked when they are made, and shown in one line.

A class of settings is a frozen dataclass, mostly a :class:`Settings`. The annotation of a field
says what it may be, and which numbers: ``Annotated[float, Range(0.0, 10.0)]``.
"""

from collections.abc import Iterable, Mapping
from dataclasses import MISSING, fields
from enum import Enum
from functools import cache
from math import inf
from types import NoneType
from typing import Annotated, Any, NamedTuple, get_args, get_origin, get_type_hints

import numpy as np

from mitt.core import checks
from mitt.core.errors import InputError


class Range(NamedTuple):
    """Least and largest number of a field, in the field's unit.

    Choices of this project, far beyond what arms, hands, balls and cameras are like; what stands in
    a denominator is above 0. ``rises``: a pair of numbers is itself a range, from low to high.
    """

    least: float
    most: float
    rises: bool = True


#: Of a field that states none.
_FINITE = Range(-1e300, 1e300)
#: Characters of a line that shows a value, and entries of a row that are shown one by one.
_LONGEST = 150
_FEW = 6


def check(settings: object) -> None:
    """Hold each field to its annotation and its range; call it in ``__post_init__``.

    Arrays are left to the class, which knows their shapes.

    Args:
        settings: A dataclass, whose fields are replaced by what :mod:`mitt.core.checks` returns.

    Raises:
        InputError: A field is not what it may be; the message names it.
    """
    kind: type[Any] = type(settings)
    hints = _hints(kind)  # type: ignore[arg-type]  # classes are hashable
    for field in fields(settings):  # type: ignore[arg-type]  # mypy wants to know the class
        value = getattr(settings, field.name)
        name = f"{kind.__name__}.{field.name}"
        kept = _checked(name, value, hints[field.name], _FINITE)
        object.__setattr__(settings, field.name, kept)


def brief(value: Any) -> str:  # noqa: ANN401
    """Return one line that says what a dataclass is: its class, and what was not left out.

    To be a class's ``__repr__``.
    """
    told = []
    for field in fields(value):
        own, default = getattr(value, field.name), field.default
        if field.default_factory is not MISSING:
            default = field.default_factory()
        if field.repr and not (default is not MISSING and _same(own, default)):
            told.append((field.name, own))
    return line(type(value).__name__, told)


class Settings:
    """A base of settings whose fields are checked when they are made; ``repr=False`` goes with it.

    Raises:
        InputError: A field is not what it may be; the message names it.
    """

    __slots__ = ()
    __repr__ = brief

    def __post_init__(self) -> None:
        """Refuse what cannot be."""
        check(self)


def line(name: str, told: Iterable[tuple[str, object]]) -> str:
    """Return a class's name and fields in one line, cut where it is full."""
    text = ""
    for field, value in told:
        text += f"{', ' if text else ''}{field}={_text(value)}"
        if len(name) + len(text) > _LONGEST:
            text = f"{text[: _LONGEST - len(name)]}..."
            break
    return f"{name}({text})"


def _same(a: object, b: object) -> bool:
    """Say whether a value is what a field has if it is left out."""
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return np.array_equal(a, b)  # type: ignore[arg-type]  # of whatever kind
    return type(a) is type(b) and a == b


def _text(value: object) -> str:
    """Return a few words for a value."""
    if isinstance(value, np.ndarray):
        few = value.ndim == 1 and value.size <= _FEW and value.dtype.kind in "fiu"
        row = ", ".join(f"{x:.4g}" for x in value.tolist()) if few else ""
        return f"[{row}]" if few else f"array{value.shape}"
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, str | bool | int | None):
        return checks.shown(value)
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, Mapping):
        return f"{len(value)} entries"
    if isinstance(value, tuple | list):
        plain = len(value) <= _FEW and all(isinstance(x, str | int | float) for x in value)
        return f"({', '.join(map(_text, value))})" if plain else f"<{len(value)}>"
    return f"{type(value).__name__}(...)"


@cache
def _hints(kind: type) -> dict[str, Any]:
    """Return what the fields of a class may be."""
    return get_type_hints(kind, include_extras=True)


def _checked(name: str, value: object, hint: Any, bounds: Range) -> object:  # noqa: ANN401
    """Return a value as an annotation has it."""
    if get_origin(hint) is Annotated:
        kind, bounds = get_args(hint)
        return _checked(name, value, kind, bounds)
    low, high = bounds.least, bounds.most
    choices = [x for x in get_args(hint) if x is not NoneType]
    if NoneType in get_args(hint) and value is None:
        return None
    if get_origin(hint) is np.ndarray:
        return value
    if get_origin(hint) is tuple:
        return _row(name, value, get_args(hint), bounds)
    if choices:  # of several kinds a row is meant by a row
        rows = [x for x in choices if get_origin(x) is tuple]
        plain = [x for x in choices if get_origin(x) is not tuple]
        one = rows[0] if rows and isinstance(value, tuple | list) else (plain or rows)[0]
        return _checked(name, value, one, bounds)
    if hint is bool:
        return checks.flag(name, value)
    if hint is int:
        return checks.whole(name, value, least=int(max(low, -(2**63))), most=int(min(high, 2**63)))
    if hint is float:
        return checks.number(name, value, finite=high < inf, least=low, most=high)
    return checks.instance(name, value, hint)


def _row(name: str, value: object, kinds: tuple[Any, ...], bounds: Range) -> Any:  # noqa: ANN401
    """Return a row of values, of one kind or of a kind each."""
    if not isinstance(value, tuple | list):
        raise InputError(name, "a tuple", checks.shown(value))
    if kinds[-1] is Ellipsis:
        kinds = kinds[:1] * len(value)
    if len(value) != len(kinds):
        raise InputError(name, f"{len(kinds)} values", f"{len(value)}")
    kept: tuple[Any, ...] = tuple(
        _checked(name, x, kind, bounds) for x, kind in zip(value, kinds, strict=True)
    )
    if bounds.rises and kinds == (float, float) and kept[0] > kept[1]:
        raise InputError(name, "a range from low to high", f"{kept[0]:g} to {kept[1]:g}")
    return kept
