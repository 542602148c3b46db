"""Values that are wrong in the place of a right one, by what the right one is.

Those of :func:`refused` can be meant by nobody: they have to end in an error. Those of
:func:`doubtful` may have an answer.
"""

from collections.abc import Iterator, Mapping
from enum import Enum
from pathlib import Path
from typing import Any, Final

import numpy as np

HUGE: Final = 10**400
CONTROL: Final = "one\ntwo\x1b[31m\x00\u2028three\x7f"
"""A text that would write over a terminal, or end a line."""

_STRANGERS: Final = (
    object(),
    lambda: 0,
    1j,
    type,
    Ellipsis,
    np.datetime64("2026-01-01"),
    np.array(["a", "b"]),
    np.array([1j, 2j]),
    np.array([None, 1.0]),
    range(0),
)
_NOT_FINITE: Final = (np.nan, np.inf, -np.inf)


def refused(value: Any) -> Iterator[Any]:  # noqa: ANN401
    """Yield what nobody can mean in the place of a value."""
    yield from _STRANGERS
    if isinstance(value, np.ndarray):
        yield from _arrays(value)
    elif isinstance(value, bool):
        yield from (1, 0, 1.0, "yes", "", np.nan, [], np.array([True, False]))
    elif isinstance(value, int):
        yield from (1.5, 2.0, "3", "", np.nan, np.inf, True, [], [1], np.zeros(3), b"3")
    elif isinstance(value, float):
        yield from (*_NOT_FINITE, HUGE, -HUGE, "1.0", "", True, [1.0], np.zeros(3), {}, b"1")
    elif isinstance(value, str):
        yield from (b"bytes", 3, True, [], ["wam"], {}, np.nan, np.zeros(3))
    elif isinstance(value, Path):
        yield from (3, True, 1.5, [], {}, b"", "", "a\x00b", Path("a\x00b"), np.zeros(3))
    elif isinstance(value, Mapping):
        yield from (3, "text", CONTROL, [1], True, {1: 2.0}, {"x\n": np.nan}, {CONTROL: HUGE})
    elif isinstance(value, tuple | list):
        yield from (3, "text", CONTROL, True, 1.5, [object()], (None,), {"a": 1}, [[[]]])
        if value and isinstance(value[0], float):
            yield from ([*value, 1.0], value[:-1], [np.nan] * len(value), [HUGE] * len(value))
    else:
        yield from ("text", CONTROL, 3, 1.5, True, [], [1], {}, {"a": 1}, np.zeros(3), type(value))


def doubtful(value: Any) -> Iterator[Any]:  # noqa: ANN401
    """Yield what might be an answerable question, or not."""
    if isinstance(value, np.ndarray) and value.dtype.kind == "f":
        yield from (np.full_like(value, x) for x in (1e300, -1e18, 5e-324, 90.0))
    elif isinstance(value, bool):
        pass
    elif isinstance(value, int):
        yield from (0, -1, -HUGE, HUGE, 2**63, 10**9)
    elif isinstance(value, float):
        yield from (0.0, -1.0, 1e300, -1e300, 5e-324, 90.0)
    elif isinstance(value, str):
        yield from ("", CONTROL, "x" * 100_000, "nobody", "../..", "\ud800")
    elif isinstance(value, Path):
        yield from (
            Path("/nonexistent/file.toml"),
            Path("x" * 5000),
            Path("/"),
            "",
            "nobody",
            Path(CONTROL.replace("\x00", "")),
            "\ud800.toml",
        )
    elif isinstance(value, tuple | list):
        yield from ((), [], ["nobody"], [CONTROL], [value] * 3, [*value, *value])
    elif isinstance(value, Mapping):
        yield from ({"nobody": 1.0}, {CONTROL: 1.0})
    elif isinstance(value, Enum):
        yield from type(value)


def _arrays(value: np.ndarray[Any, Any]) -> Iterator[Any]:
    """Yield what is no array like this one."""
    yield from ("text", {}, True, [[1.0], [2.0, 3.0]], [HUGE] * len(np.atleast_1d(value)))
    yield from (np.zeros(0), np.zeros(value.shape, bool), np.array(b"x"), value.astype(complex))
    yield value.astype("datetime64[s]") if value.dtype.kind == "f" else value.astype(float)
    yield np.zeros((*value.shape, 2), value.dtype)
    if value.dtype.kind != "f":
        return
    yield from (value[..., :-1].copy(), np.concatenate([value, value], axis=-1))
    yield from (np.zeros((*value.shape[:-1], 1000)), np.float64(1.0))
    for x in _NOT_FINITE:
        one = value.copy()
        one.flat[-1] = x
        yield from (one, np.full_like(value, x))
