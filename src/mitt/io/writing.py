"""Files written whole or not at all, inside the folder that was named.

In the folder of a run only what mitt wrote there, and can prove that it wrote, is replaced. The
proof is threefold: the folder says whose it is in a file of our schema, a file in it is called as
one of that command is, and where its kind tells who wrote it, it is one of ours. A link is never
ours and never followed. Whatever else lies in the folder stays there; where it stands in the way
of what will be written, the folder is refused before anything is touched.
"""

import fcntl
import hashlib
import json
import os
import re
import secrets
import stat
import tempfile
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import count
from math import isfinite
from pathlib import Path

import numpy as np

from mitt.core import checks
from mitt.core.errors import FileError, InputError

_FILE = "a file that can be written"
_FOLDER = "a folder that can be written"

LOCK = ".lock"
"""File that keeps a second run out of a folder; alone it does not make the folder full."""

#: A key that TOML takes without quotes.
_BARE = re.compile(r"[A-Za-z0-9_-]+")
#: How a file of ours begins, by its suffix.
_BEGINNINGS = {
    ".json": re.compile(rb'\{\s*"schema":\s*"mitt\.'),
    ".jsonl": re.compile(rb'\{\s*"schema":\s*"mitt\.'),
    ".html": re.compile(rb"<!doctype html>.*<title>mitt: ", re.DOTALL),
    ".mcap": re.compile(rb"\x89MCAP0\r\n\x01.{12}ros2.{4}mitt", re.DOTALL),
    ".toml": re.compile(rb"# (mitt design: |mitt measure: |Cameras as mitt calibrate found them)"),
    ".png": re.compile(rb"\x89PNG.*tEXtSoftware\x00mitt", re.DOTALL),
    ".mkv": re.compile(rb"\x1aE\xdf\xa3.*mitt", re.DOTALL),
}
#: What a temporary file of a run that was killed has about its name.
_TEMPORARY = re.compile(r"\.(.+)\.[a-z0-9_]{8}")
#: Pages of replays are made by the viewer and do not say who wanted them.
_REPLAYS = "replays/"


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


def check_own(name: str, path: Path) -> None:
    """Refuse to replace a link, or what mitt did not write as far as its kind tells.

    Args:
        name: What an error calls the file, as the option that names it.
        path: The file; where nothing is, nothing is replaced.

    Raises:
        InputError: Something else is in the way.
    """
    if not os.path.lexists(path) or (path.is_file() and not path.is_symlink() and wrote(path)):
        return
    raise _in_the_way(name, path)


def _in_the_way(name: str, path: Path) -> InputError:
    """Return the error of a file that is not replaced."""
    what = "a link" if path.is_symlink() else "which mitt did not write"
    return InputError(
        name,
        "a place that is free, or a file of mitt",
        f"{path}, {what}",
        do="move that away, or choose another name for the output",
    )


def own_file(path: Path, schema: str) -> int:
    """Open a file of ours to go on with, or make it; return its descriptor, to append to.

    It is locked as long as the descriptor is open.

    Args:
        path: The file: regular, empty or beginning with the schema; never reached by a link.
        schema: What JSON on its first line says that it is.

    Raises:
        BlockingIOError: Another process has it open so.
        InputError: It is another file.
        FileError: It cannot be made or written.
    """
    flags = os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
    stated = re.compile(rb'\{"schema": "%b"' % re.escape(schema).encode())
    if path.is_symlink():
        raise _in_the_way("--out", path)
    with _reported(path, _FILE):
        path.parent.mkdir(parents=True, exist_ok=True)
        handle = os.open(path, flags, 0o644)
    try:
        whole = os.fstat(handle)
        ours = whole.st_size == 0 or stated.match(os.pread(handle, 200, 0))
        if not stat.S_ISREG(whole.st_mode) or not ours:
            raise _in_the_way("--out", path)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise
        except OSError as error:
            raise FileError(str(path), _FILE, error.strerror or "no lock") from error
    except BaseException:
        os.close(handle)
        raise
    return handle


def remove_own(path: Path, handle: int) -> None:
    """Remove a file that :func:`own_file` opened, unless another file has taken its name since."""
    with suppress(OSError):
        if os.path.samestat(os.lstat(path), os.fstat(handle)):
            path.unlink()


def file_name(text: str) -> str:
    """Return what a file can be called after a name from elsewhere: never a path, never hidden.

    Letters, digits, dots, dashes and underlines stay, 100 characters at most; a name that is
    changed gets a part that tells it from another that would read the same.
    """
    name = re.sub(r"[^A-Za-z0-9._-]", "_", text.replace("%", "pc"))[:100]
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
    write_bytes(path, content)


def write_json(path: Path, value: object) -> None:
    """Write JSON atomically; NaN and infinity are refused."""
    write_text(path, json.dumps(value, indent=1, allow_nan=False) + "\n")


def json_digest(content: Mapping[str, object]) -> str:
    """Return the SHA-256 of JSON content, whatever the order of its keys."""
    canonical = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(canonical.encode()).hexdigest()


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file atomically."""
    write_atomically(path, lambda temporary: temporary.write_bytes(content))


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
            raise InputError(
                "--out", "a folder that no other run writes to", f"{folder}, where one is running"
            ) from None
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
            raise InputError(
                "--out",
                "a new or empty folder",
                f"{folder}, which has files in it",
                do="choose another or say --overwrite",
            )


def is_free(folder: Path) -> bool:
    """Say whether a folder has nothing in it, or is not there."""
    return not os.path.lexists(folder) or (
        folder.is_dir() and all(path.name == LOCK for path in folder.iterdir())
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Leaves:
    """What a command leaves in its folder.

    Attributes:
        command: The command.
        schema: What the file says that tells whose folder it is.
        manifests: Names of that file, one of which is there.
        names: All that is left, as seen from the folder: patterns of whole names.
    """

    command: str
    schema: str
    manifests: tuple[str, ...]
    names: tuple[str, ...]

    def owns(self, folder: Path) -> bool:
        """Say whether a folder says that it is one of this command."""
        stated = re.compile(rb'\{\s*"schema":\s*"%b"' % re.escape(self.schema).encode())
        return any(stated.match(_head(folder / name)) for name in self.manifests)

    def calls(self, name: str) -> bool:
        """Say whether a file of this command may be called so."""
        return any(re.fullmatch(pattern, name) for pattern in self.names)

    @property
    def folders(self) -> tuple[str, ...]:
        """Folders in the folder."""
        found = (name.partition("/")[0] for name in self.names if "/" in name)
        return tuple(dict.fromkeys(found))


def claim_folder(
    folder: Path,
    leaves: Leaves,
    *,
    overwrite: bool,
    keep: Collection[Path] = (),
    made: Callable[[str], bool] | None = None,
) -> None:
    """Make an output folder, or clear our own files out of an existing one.

    What tells whose folder it is goes last, so that a process that dies leaves a folder of ours.

    Args:
        folder: The folder.
        leaves: What the command leaves there.
        overwrite: Whether a folder with files in it may be used.
        keep: Files that stay, as they are read.
        made: Says of a name whether that run made it, where the folder knows; any is if left out.

    Raises:
        InputError: The folder has files in it and ``overwrite`` was not said, or something that
            is not ours is in the way.
        FileError: It cannot be made or written.
    """
    check_folder(folder, overwrite=overwrite)
    ours = _ours(folder, leaves, made)
    make_folder(folder)
    kept = [path for path in keep if path.exists()]
    try:
        for name in sorted(ours, key=lambda name: name in leaves.manifests):
            if not any((folder / name).samefile(path) for path in kept):
                (folder / name).unlink()
        for name in leaves.folders:
            if (folder / name).is_dir() and not any((folder / name).iterdir()):
                (folder / name).rmdir()
    except OSError as error:
        wanted = "a folder that can be written"
        raise FileError(str(folder), wanted, error.strerror or "an error") from error


def check_ours(folder: Path, leaves: Leaves) -> None:
    """Refuse a folder in which what will be written would replace what is not ours.

    Raises:
        InputError: Something is in the way.
    """
    _ours(folder, leaves, None)


def clear_temporary(folder: Path, leaves: Leaves) -> None:
    """Remove what a killed run of this folder left half written."""
    for name in _names(folder, leaves):
        if name not in leaves.folders and _is_temporary(name, leaves):
            (folder / name).unlink(missing_ok=True)


def _ours(folder: Path, leaves: Leaves, made: Callable[[str], bool] | None) -> list[str]:
    """Return the files of a folder that are ours; refuse what else is in the way."""
    owned = leaves.owns(folder) or not leaves.manifests
    ours = []
    for name in _names(folder, leaves):
        path = folder / name
        plain = path.is_file() and not path.is_symlink()
        if name in leaves.folders:
            ok = path.is_dir() and not path.is_symlink()
        elif leaves.calls(name):
            ok = owned and plain and wrote(path, name) and (made is None or made(name))
            ours.append(name)
        else:
            ok = True
            ours += [name] if owned and plain and _is_temporary(name, leaves) else []
        if not ok:
            what = "a link" if path.is_symlink() else f"which {leaves.command} did not write there"
            raise InputError(
                "--out",
                f"a folder for {leaves.command}",
                f"{path}, {what}",
                do="choose another folder, or move that away",
            )
    return ours


def _is_temporary(name: str, leaves: Leaves) -> bool:
    """Say whether a name is that of a file of the command that was never whole."""
    folder, slash, last = name.rpartition("/")
    found = _TEMPORARY.fullmatch(last)
    return found is not None and leaves.calls(f"{folder}{slash}{found[1]}")


def _names(folder: Path, leaves: Leaves) -> Iterator[str]:
    """Yield what is in a folder and in those of its folders that may be ours."""
    if not folder.is_dir():
        return
    for name in sorted(os.listdir(folder)):
        yield name
        inner = folder / name
        if name in leaves.folders and inner.is_dir() and not inner.is_symlink():
            yield from (f"{name}/{x}" for x in sorted(os.listdir(inner)))


def wrote(path: Path, name: str = "") -> bool:
    """Say whether mitt wrote a file, as far as its kind tells; of tables it does not.

    Args:
        path: The file.
        name: What it is called as seen from its folder.
    """
    begins = _BEGINNINGS.get(path.suffix)
    return begins is None or name.startswith(_REPLAYS) or bool(begins.match(_head(path)))


def _head(path: Path) -> bytes:
    """Return how a file begins; nothing where it is a link, no file, or cannot be read."""
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC | os.O_NOFOLLOW)
        with os.fdopen(handle, "rb") as file:
            return file.read(2000)
    except OSError:
        return b""


def overlaps(path: Path, other: Path) -> bool:
    """Say whether a file to be written is another, or one that is there in another, a folder."""
    try:
        if path.exists() and other.is_dir():
            return path.parent.samefile(other)
        return path.samefile(other) if path.exists() else path.absolute() == other.absolute()
    except (OSError, ValueError):  # no such file, or no name of one
        return False


def new_folder(folder: Path) -> Path:
    """Return a folder that has no files in it: this one, or with -2, -3, ... at its name."""
    names = (folder if k == 1 else folder.with_name(f"{folder.name}-{k}") for k in count(1))
    return next(path for path in names if is_free(path))
