"""A cell's file with what was measured in it: its own text, a few values changed or added."""

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path

from mitt.core.errors import FileError
from mitt.io.writing import toml_text, write_text

#: How the file begins, by which mitt knows it for one of its own.
BEGINS = "# mitt measure: "

Values = Mapping[str, Mapping[str, float | list[float]]]
"""Values by table and key."""


def measured_text(text: str, values: Values, *, place: str) -> str:
    """Return the text of a TOML file with other values of some keys; the rest stays as it is.

    Args:
        text: The file.
        values: What is to be in it.
        place: What an error calls the file.

    Raises:
        FileError: Its tables or keys are written in a way that is not followed here.
    """
    wanted = tomllib.loads(text)
    lines = text.splitlines()
    for table, keys in values.items():
        wanted.setdefault(table, {})
        for key, value in keys.items():
            wanted[table][key] = value
            _set(lines, table, key, toml_text({key: value}).strip())
    out = "\n".join(lines) + "\n"
    try:
        same = tomllib.loads(out) == wanted
    except tomllib.TOMLDecodeError:
        same = False
    if not same:
        names = ", ".join(f"{t}.{k}" for t, keys in values.items() for k in keys)
        do = "write these keys so, or enter the values by hand"
        raise FileError(place, f"{names} in tables, each key on a line of its own", "others", do=do)
    return out


def _set(lines: list[str], table: str, key: str, said: str) -> None:
    """Let a line say a key of a table: in the place of the one that does, or as its first."""
    head = re.compile(rf"\s*\[\s*{re.escape(table)}\s*\]\s*(#.*)?$")
    first = next((k for k, line in enumerate(lines) if head.match(line)), None)
    if first is None:
        lines += ["", f"[{table}]", said]
        return
    ends = (k for k in range(first + 1, len(lines)) if lines[k].lstrip().startswith("["))
    end = next(ends, len(lines))
    there = re.compile(rf"\s*{re.escape(key)}\s*=\s*[^#]*?(\s*#.*)?$")
    for k in range(first + 1, end):
        if found := there.match(lines[k]):
            lines[k] = said + (found[1] or "")
            return
    lines.insert(first + 1, said)


def write_measured(path: Path, text: str, *, about: str) -> None:
    """Write the text of a measured cell, and first what it is.

    Raises:
        FileError: It cannot be written.
    """
    own = text.startswith(BEGINS)
    body = text.split("\n", 1)[1] if own else text
    write_text(path, f"{BEGINS}{about}\n{body}")
