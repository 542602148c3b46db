"""Calculations in pieces: a robot waits for its next command while a verdict is worked out.

A calculation asks for each of its pieces by a name. One that is known is given at once; one that is
not is worked out, as long as there are pieces left to be worked out now. Where none is left the
calculation ends here with :class:`Unfinished`, and is begun anew in the next tick: it then goes on
from where it was, as what it asked for so far is known. So it is written as if it were done at
once, its steps are counted, not timed, and what is known can be copied and kept in a file.
"""

from collections.abc import Callable
from math import inf
from typing import Any, ParamSpec, TypeVar, final

_P = ParamSpec("_P")
_T = TypeVar("_T")


class Unfinished(Exception):  # noqa: N818 (no fault: it is gone on with)
    """No piece is left to be worked out now."""


@final
class Pieces:
    """The pieces of one calculation.

    Attributes:
        left: How many may still be worked out now.
    """

    def __init__(self, left: float = inf) -> None:
        """Begin with none that is known."""
        self.left = self._granted = left
        self._known = dict[str, Any]()

    def of(self, name: str, work: Callable[_P, _T], /, *args: _P.args, **kwargs: _P.kwargs) -> _T:
        """Return a piece.

        Args:
            name: Of the piece, one of its own.
            work: Works it out.
            args: What that is given; the same each time.
            kwargs: The same.

        Raises:
            Unfinished: It is not known, and none is left.
        """
        if name not in self._known and self.left < 1:
            raise Unfinished
        self.left -= name not in self._known
        return self.whole(name, work, *args, **kwargs)

    def grant(self, count: float) -> None:
        """Let so many more be worked out now."""
        self.left = self._granted = count

    def rest(self) -> None:
        """End here unless nothing was worked out since the last grant: what follows takes long.

        Raises:
            Unfinished: Something was.
        """
        if self.left < self._granted:
            raise Unfinished

    def whole(
        self, name: str, work: Callable[_P, _T], /, *args: _P.args, **kwargs: _P.kwargs
    ) -> _T:
        """Return what is made of pieces, and is none itself; as :meth:`of`."""
        if name not in self._known:
            self._known[name] = work(*args, **kwargs)
        value: _T = self._known[name]
        return value
