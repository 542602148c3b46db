"""Reading files and numbers that somebody else wrote, whatever their kind, size or nesting.

Only regular files are read: a device has no end and a pipe may never begin. At most as many bytes
as are wanted are taken, whatever size the file claims to have. A TOML file is looked through before
it is parsed, because the standard parser needs memory that grows with the square of a dotted key.
"""

import hashlib
import json
import os
import re
import stat
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from itertools import zip_longest
from pathlib import Path
from typing import Any

from mitt.core import checks
from mitt.core.errors import FileError, InputError
from mitt.numerals import real_of

#: Largest TOML and JSON file that is read [bytes]; JSON may take twenty times as much memory.
MAX_TOML_BYTES = 1_000_000
MAX_JSON_BYTES = 10_000_000

#: Most parts of a dotted key, levels of brackets, and characters of a key.
_MOST_PARTS = 16
_MOST_LEVELS = 16
_LONGEST_KEY = 256

#: What TOML is made of, as far as keys and nesting go. Strings that do not end run to the end of
#: their line or of the file, so that each character is looked at once.
_PIECE = re.compile(
    r'"""(?:[^\\]|\\.)*?(?:"""|\Z)|\'\'\'.*?(?:\'\'\'|\Z)|"(?:[^"\\\n]|\\.)*"?|\'[^\'\n]*\'?'
    r"|#[^\n]*|[ \t]+|[\w+-]+|.",
    re.DOTALL,
)


#: Where what comes with mitt is.
_PACKAGE = Path(__file__).parents[1]

#: Digests of what is read, by its name, where somebody wants to know.
_noted: ContextVar[dict[str, str] | None] = ContextVar("noted", default=None)


@contextmanager
def noted() -> Iterator[dict[str, str]]:
    """Note the SHA-256 of each file that is read in the block, by its name, in their order.

    That is what makes an arm, for one: its file, the description, the meshes and the limits. What
    comes with mitt is known by its version.
    """
    found: dict[str, str] = {}
    token = _noted.set(found)
    try:
        yield found
    finally:
        _noted.reset(token)


def changed_file(was: Mapping[str, str], now: Mapping[str, str]) -> str:
    """Return the name of the first file that holds something else than before; nothing if none."""
    pairs = zip_longest(was.items(), now.items(), fillvalue=("", ""))
    return next((b[0] or a[0] for a, b in pairs if a[1] != b[1]), "")


def reals_of(name: str, text: str, count: int, *, most: float) -> tuple[float, ...]:
    """Return numbers that a user's text says with commas between them.

    Args:
        name: What an error calls it.
        text: The text.
        count: How many there are.
        most: Largest magnitude of one.

    Raises:
        InputError: They are not as many, or too large.
    """
    read = [real_of(x) for x in text.split(",")]
    numbers = tuple(x for x in read if x is not None)
    if len(numbers) != len(read) or len(numbers) != count:
        raise InputError(name, f"{count} numbers with commas between them", repr(text))
    if not all(abs(x) <= most for x in numbers):
        raise InputError(name, f"numbers from -{most:g} to {most:g}", repr(text))
    return numbers


def read_bytes(path: Path, *, max_bytes: int, wanted: str = "a readable file") -> bytes:
    """Return what a regular file holds.

    Args:
        path: The file.
        max_bytes: Most bytes that it may have.
        wanted: What an error calls it.

    Raises:
        InputError: It is no path.
        FileError: It cannot be read, is no regular file or is too large.
    """
    path = checks.path("file", path)
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)  # no waiting for a pipe
        with os.fdopen(handle, "rb") as file:
            regular = stat.S_ISREG(os.fstat(handle).st_mode)
            content = file.read(max_bytes + 1) if regular else b""
    except OSError as error:
        raise FileError(str(path), wanted, error.strerror or "an error") from None
    if not regular:
        raise FileError(str(path), wanted, "a device, a pipe or a folder")
    if len(content) > max_bytes:
        raise FileError(str(path), f"at most {max_bytes} bytes", "more")
    if (notes := _noted.get()) is not None and not path.is_relative_to(_PACKAGE):
        notes[str(path)] = hashlib.sha256(content).hexdigest()
    return content


def read_text(path: Path, *, max_bytes: int, wanted: str = "a readable text file") -> str:
    """Return what a regular file holds as text; see :func:`read_bytes`.

    Raises:
        FileError: It cannot be read, or is no UTF-8.
    """
    try:
        return read_bytes(path, max_bytes=max_bytes, wanted=wanted).decode("utf-8")
    except UnicodeDecodeError as error:
        raise FileError(str(path), "UTF-8 text", f"a bad byte at {error.start}") from None


def read_toml(path: Path, *, wanted: str = "TOML") -> dict[str, Any]:
    """Return what a TOML file says.

    Raises:
        FileError: The file cannot be read, is too large or too deeply nested, or is no TOML.
    """
    text = read_text(path, max_bytes=MAX_TOML_BYTES, wanted="a readable TOML file")
    try:
        _check_nesting(text)
        return tomllib.loads(text.removeprefix("\ufeff"))
    except (ValueError, RecursionError) as error:
        raise FileError(str(path), wanted, str(error)[:120]) from None


def read_json(path: Path, *, max_bytes: int = MAX_JSON_BYTES) -> Any:  # noqa: ANN401 (any JSON value)
    """Return what a JSON file says; NaN, infinity and repeated keys are refused.

    Raises:
        FileError: The file is missing, too large, cut short or no JSON.
    """
    text = read_text(path, max_bytes=max_bytes)
    try:
        return json.loads(text, parse_constant=_refuse, object_pairs_hook=_unique)
    except (ValueError, RecursionError) as error:
        raise FileError(str(path), "complete JSON", str(error)[:120]) from error


def _refuse(constant: str) -> None:
    """Refuse a constant that JSON does not have."""
    raise ValueError(f"the constant {constant}")


def _unique(pairs: list[tuple[str, object]]) -> dict[str, object]:
    """Return an object whose keys are all different."""
    found = dict(pairs)
    if len(found) != len(pairs):
        raise ValueError("a repeated key")
    return found


def shipped(kind: str) -> tuple[str, ...]:
    """Return the names of the files of a kind that come with mitt: ``limits``, ``cells``, ..."""
    return tuple(sorted(p.stem for p in (_PACKAGE / "data" / kind).iterdir()))


def shipped_path(kind: str, name: str, suffix: str = ".toml") -> Path:
    """Return where a file is that comes with mitt."""
    return _PACKAGE / "data" / kind / f"{name}{suffix}"


def data_path(name: str) -> Path:
    """Return where a single file is that comes with mitt."""
    return _PACKAGE / "data" / name


def _check_nesting(text: str) -> None:
    """Refuse keys of too many parts or characters, and brackets too deep in one another.

    Raises:
        ValueError: There are some.
    """
    level, parts, longest = 0, 1, 0
    for piece in _PIECE.findall(text):
        if piece in "[{":
            level, parts, longest = level + 1, 1, 0
        elif piece == ".":
            parts += 1
        elif piece[0] in "\"'" or piece[0].isalnum() or piece[0] in "_-+":
            longest = max(longest, len(piece))
        elif not piece.isspace() or "\n" in piece:
            if piece == "=" and longest > _LONGEST_KEY:
                raise ValueError(f"a key of {longest} characters, at most {_LONGEST_KEY}")
            level -= piece in "]}"
            parts, longest = 1, 0
        if parts > _MOST_PARTS:
            raise ValueError(f"a dotted key of more than {_MOST_PARTS} parts")
        if level > _MOST_LEVELS:
            raise ValueError(f"more than {_MOST_LEVELS} levels of brackets")
