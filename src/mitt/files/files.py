"""Files written whole or not at all, inside the folder that was named."""

import fcntl
import hashlib
import json
import os
import re
import secrets
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from mitt import checks
from mitt.errors import FileError, InputError
from mitt.reading import MAX_JSON_BYTES, read_text

_FILE, _FOLDER = "a file that can be written", "a folder that can be written"

LOCK = ".lock"
"""File that keeps a second run out of a folder; alone it does not make the folder full."""

#: Characters of a name that a file keeps.
_LONGEST = 100


@contextmanager
def _reported(path: Path, wanted: str) -> Iterator[None]:
    """Turn an error of the system into a file error."""
    try:
        yield
    except OSError as error:
        reason = error.strerror or type(error).__name__
        raise FileError(str(path), wanted, reason) from error


def write_atomically(path: Path, write: Callable[[Path], object]) -> None:
    """Let ``write`` fill a temporary file beside ``path``, then put it in its place.

    Raises:
        FileError: The file cannot be written; what stood there before is untouched.
    """
    path = checks.path("file", path)
    with _reported(path, _FILE):
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary = temporary_beside(path)
        try:
            write(temporary)
            os.replace(temporary, path)
        finally:
            temporary.unlink(missing_ok=True)


def temporary_beside(path: Path) -> Path:
    """Make an empty file beside another, with the rights that any new file of the user gets."""
    temporary = path.parent / f".{path.name}.{secrets.token_hex(4)}"
    os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY | os.O_CLOEXEC, 0o666))
    return temporary


def file_name(text: str) -> str:
    """Return what a file can be called after a name from elsewhere: never a path, never hidden.

    Letters, digits, dots, dashes and underlines stay; a name that is changed gets a part that
    tells it from another that would read the same.
    """
    name = re.sub(r"[^A-Za-z0-9._-]", "_", text.replace("%", "pc"))[:_LONGEST]
    name = re.sub(r"^\.", "_", name)
    if name == text and name:
        return name
    return f"{name}-{hashlib.sha256(text.encode(errors='surrogatepass')).hexdigest()[:6]}"


def write_text(path: Path, text: str) -> None:
    """Write a text file atomically.

    Raises:
        FileError: It cannot be written, or the text is none that UTF-8 has.
    """
    try:
        content = text.encode()
    except UnicodeEncodeError as error:
        raise FileError(str(path), "text in UTF-8", error) from None
    write_atomically(path, lambda temporary: temporary.write_bytes(content))


def write_json(path: Path, value: object) -> None:
    """Write JSON atomically; NaN and infinity are refused."""
    write_text(path, json.dumps(value, indent=1, allow_nan=False) + "\n")


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


def make_folder(folder: Path) -> None:
    """Make an output folder before the work is done, so that no work is done for nothing.

    Raises:
        FileError: It cannot be made or written.
    """
    with _reported(folder, _FOLDER):
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Keep a second run out of an output folder; the lock goes with the process that holds it.

    Raises:
        InputError: Another run has it.
        FileError: The folder cannot be made or written.
    """
    make_folder(folder)
    with _reported(folder, _FOLDER):
        flags = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW
        handle = os.open(folder / LOCK, flags, 0o666)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise InputError("--out", "a folder that no other run writes to",
                             f"{folder}, where one is running") from None  # fmt: skip
        yield
    finally:
        os.close(handle)


def check_folder(folder: Path, *, overwrite: bool) -> None:
    """Refuse a folder that cannot be used, without touching anything.

    Raises:
        InputError: It or one above it is a file, or it has files in it and ``overwrite`` was not
            said.
        FileError: It cannot be read or written.
    """
    with _reported(folder, "a folder that can be read"):
        above = next(x for x in (folder, *folder.absolute().parents) if x.exists())
        if not above.is_dir():
            raise InputError("--out", "a folder", f"{above}, which is a file")
        if not os.access(above, os.W_OK):
            raise FileError(str(above), "a folder that can be written", "one that cannot")
        if not overwrite and not is_free(folder):
            raise InputError("--out", "a new or empty folder", f"{folder}, which has files in it",
                             do="choose another or say --overwrite")  # fmt: skip


def is_free(folder: Path) -> bool:
    """Say whether a folder has nothing in it, or is not there."""
    return not os.path.lexists(folder) or (
        folder.is_dir() and all(path.name == LOCK for path in folder.iterdir())
    )
