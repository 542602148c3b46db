"""What can go wrong, each with what was wanted, what was given and what to do.

Outcomes of a throw (unreachable, lost ball, a solver that stopped early) are a ``status``
of a result; only a caller's mistake or a broken file raises.
"""

import os
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from difflib import get_close_matches
from importlib.util import find_spec

#: Characters that a message keeps of either end of a very long name or value.
_HALF = 150


class MittError(Exception):
    """Base of every error that mitt raises on purpose; its text is one line that can be printed."""

    def __init__(self, text: str) -> None:
        """Take the text; what would end a line or steer a terminal is written as an escape."""
        super().__init__(printable(" ".join(text.split())))

    def __reduce__(self) -> tuple[Callable[..., "MittError"], tuple[object, ...]]:
        """Say how to make the same error in another process, whatever its constructor takes."""
        data = {name: _plain(value) for name, value in vars(self).items()}
        return _restored, (type(self), tuple(map(_plain, self.args)), data)


class ShapeError(MittError, ValueError):
    """An array has the wrong shape."""

    def __init__(self, name: str, wanted: str, given: tuple[int, ...], *, do: str = "") -> None:
        """Name the array, the shape wanted, the shape given and, where it helps, what to do."""
        self.name, self.wanted, self.given = name, wanted, given
        text = f"{name} must have shape {wanted}, not {given}"
        super().__init__(f"{text}; {do}" if do else text)


class InputError(MittError, ValueError):
    """A value that a user gave cannot be used."""

    def __init__(self, name: str, wanted: str, given: object, *, do: str = "") -> None:
        """Name the input, what was wanted, what was given and, where it helps, what to do."""
        self.name, self.wanted, self.given = name, wanted, given
        text = f"{_short(name)}: wanted {wanted}, got {_short(str(given))}"
        super().__init__(f"{text}; {do}" if do else text)


class FileError(InputError):
    """A file is missing, cut short, or does not say what it should."""


class ModelError(InputError):
    """An arm, a hand or a map that cannot be built from its description."""


class UnknownNameError(InputError, KeyError):
    """A name that is not among those available."""

    def __init__(self, kind: str, given: str, available: Iterable[str], *, do: str = "") -> None:
        """List the names that are available; say which may be meant, and what to do."""
        self.available = tuple(available)
        do = " ".join(x for x in (meant(given, self.available), do) if x)
        super().__init__(kind, f"one of {', '.join(self.available)}", repr(given), do=do)

    def __str__(self) -> str:
        """Show the message itself; KeyError would quote it."""
        return str(self.args[0])


class MissingPackageError(InputError, ImportError):  # type: ignore[misc]  # both have a name
    """A package that only some of mitt needs is not installed."""

    def __init__(self, name: str, package: str, extra: str) -> None:
        """Say what needs which package, and the extra that has it."""
        wanted = f"the package {package}"
        super().__init__(name, wanted, "a Python without it", do=f"install mitt[{extra}]")


def check_package(name: str, module: str, package: str, extra: str) -> None:
    """Refuse to go on without a package of an extra; it is looked for, not loaded.

    Raises:
        MissingPackageError: It is not installed.
    """
    there = sys.modules[module] if module in sys.modules else find_spec(module)
    if there is None:
        raise MissingPackageError(name, package, extra)


def meant(given: str, known: Iterable[str]) -> str:
    """Return in words which of the known names was meant; nothing where none is near."""
    names = {x.lower(): x for x in known}
    near = get_close_matches(given.lower(), names, n=1)
    near = near or [x for x in names if given and given.lower() in x.split("-")]
    return f"did you mean {names[near[0]]!r}?" if near else ""


def printable(text: str) -> str:
    """Return a text in one line whose characters can all be printed, others as escapes."""
    if text.isprintable():
        return text
    return "".join(x if x.isprintable() else x.encode("unicode_escape").decode() for x in text)


def _short(text: str) -> str:
    """Return a text, the middle of a very long one left out."""
    return text if len(text) <= 2 * _HALF else f"{text[:_HALF]} ... {text[-_HALF:]}"


def _restored(
    kind: type[MittError], args: tuple[object, ...], data: dict[str, object]
) -> MittError:
    """Return an error with its text and its data, past its constructor."""
    error = kind.__new__(kind, *args)
    error.__dict__.update(data)
    return error


def _plain(value: object) -> object:
    """Return a value that any process can read: itself, or else its text."""
    if isinstance(value, tuple):
        return tuple(map(_plain, value))
    if isinstance(value, list):
        return [_plain(inner) for inner in value]
    if isinstance(value, dict):
        return {str(key): _plain(inner) for key, inner in value.items()}
    return value if value is None or type(value) in (bool, int, float, str) else str(value)


class StoppedError(MittError):
    """A throw was stopped, and whoever asked for it wanted to be told by an exception.

    Attributes:
        index: Number of the throw.
        stopped_by: Why, and what the catcher estimated, read and commanded then, as it stands in
            ``result.json``.
    """

    def __init__(self, index: int, why: str, stopped_by: Mapping[str, object]) -> None:
        """Name the throw and the reason."""
        self.index, self.stopped_by = index, dict(stopped_by)
        super().__init__(f"throw {index} was stopped: {why}")


@contextmanager
def heard() -> Iterator[list[str]]:
    """Hear what a library in C or C++ writes to the error stream instead of letting it through.

    Yields:
        A list that holds the text once the block is left.
    """
    said: list[str] = []
    sys.stderr.flush()
    with tempfile.TemporaryFile() as stream:
        before = os.dup(2)
        os.dup2(stream.fileno(), 2)
        try:
            yield said
        finally:
            os.dup2(before, 2)
            os.close(before)
            stream.seek(0)
            said.append(stream.read(2000).decode(errors="replace"))


@contextmanager
def answered_by(name: str) -> Iterator[None]:
    """Raise any exception of the block as an InputError of the package that adds something.

    Args:
        name: What it adds, as ``generator 'mine'``.
    """
    try:
        yield
    except Exception as error:
        said = str(error) if isinstance(error, MittError) else f"{type(error).__name__}: {error}"
        raise InputError(
            name, "an answer of the package that adds it", said, do="repair that package"
        ) from error
