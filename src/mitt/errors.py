"""What can go wrong, each with what was wanted, what was given and what to do.

Outcomes of a throw (unreachable, lost ball, a solver that stopped early) are a ``status``
of a result; only a caller's mistake or a broken file raises.
"""

from collections.abc import Iterable


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


class Terminated(KeyboardInterrupt):
    """SIGTERM arrived: what is finished is kept, as for an interrupt from the keyboard."""
