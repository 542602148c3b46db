"""Tables as TOML text, every digit kept; the standard library only reads TOML."""

import json
import re
from collections.abc import Mapping
from math import isfinite

import numpy as np

from mitt.errors import InputError

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def toml_text(table: Mapping[str, object], *, name: str = "") -> str:
    """Return a table as TOML: its own keys first, then the tables in it.

    Args:
        table: Texts, truth values, finite numbers, lists of them, and further tables; None is left
            out.
        name: What the table is called; the file itself if left out.

    Raises:
        InputError: A value is none that TOML files of ours have.
    """
    own = {k: x for k, x in table.items() if x is not None and not isinstance(x, Mapping)}
    lines = [f"{_key(k)} = {_value(k, x)}" for k, x in own.items()]
    if name and lines:
        lines.insert(0, f"\n[{name}]")
    inner = [
        toml_text(x, name=f"{name}.{_key(k)}" if name else _key(k))
        for k, x in table.items()
        if isinstance(x, Mapping)
    ]
    return "".join([*(f"{line}\n" for line in lines), *inner])


def _key(key: str) -> str:
    """Return a key, quoted where it has to be."""
    return key if _BARE.fullmatch(key) else _quoted(key)


def _quoted(text: str) -> str:
    """Return a text in quotes: TOML takes what JSON writes, but for one control character."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _value(key: str, value: object) -> str:
    """Return a value as TOML writes it."""
    if isinstance(value, bool | np.bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _quoted(value)
    if isinstance(value, int | np.integer):
        return repr(int(value))
    if isinstance(value, float | np.floating) and isfinite(value):
        return repr(float(value))
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_value(key, x) for x in value) + "]"
    raise InputError(key, "a text, a truth value, a finite number or a list", repr(value)[:60])
