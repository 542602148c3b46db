"""What can go wrong, each with what was wanted, what was given and what to do.

Outcomes of a throw (unreachable, lost ball, a solver that stopped early) are a ``status``
of a result; only a caller's mistake or a broken file raises.
"""

import os
import sys
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager


class MittError(Exception):
    """Base of every error that mitt raises on purpose; its text is one line."""


class ShapeError(MittError, ValueError):
    """An array has the wrong shape."""

    def __init__(self, name: str, wanted: str, given: tuple[int, ...]) -> None:
        """Name the array, the shape wanted and the shape given."""
        self.name, self.wanted, self.given = name, wanted, given
        super().__init__(f"{name} must have shape {wanted}, not {given}")


class InputError(MittError, ValueError):
    """A value that a user gave cannot be used."""

    def __init__(self, name: str, wanted: str, given: object, *, do: str = "") -> None:
        """Name the input, what was wanted, what was given and, where it helps, what to do."""
        self.name, self.wanted, self.given = name, wanted, given
        text = f"{name}: wanted {wanted}, got {given}"
        super().__init__(" ".join(f"{text}; {do}".split()) if do else " ".join(text.split()))


class FileError(InputError):
    """A file is missing, cut short, or does not say what it should."""


class ModelError(InputError):
    """An arm, a hand or a map that cannot be built from its description."""


class UnknownNameError(InputError, KeyError):
    """A name that is not among those available."""

    def __init__(self, kind: str, given: str, available: Iterable[str]) -> None:
        """List the names that are available."""
        self.available = tuple(available)
        super().__init__(kind, f"one of {', '.join(self.available)}", repr(given))

    def __str__(self) -> str:
        """Show the message itself; KeyError would quote it."""
        return str(self.args[0])


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
