"""What other packages add to a cell, and mitt's own of the same kind: drivers, trackers.

Those of mitt are the modules of a folder, the others are entry points. Each runs in a process of
its own, as its maker's client may hang or crash.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from pkgutil import iter_modules
from typing import Any, final

from mitt.core import checks
from mitt.core.arm.arm import Arm
from mitt.core.errors import InputError, MissingPackageError, MittError, UnknownNameError
from mitt.io.cell import Cell


@final
class Plugins:
    """All of one kind, by their names.

    Attributes:
        kind: What they are, in a word.
        group: Group of their entry points.
    """

    def __init__(
        self,
        kind: str,
        group: str,
        checks_group: str,
        *,
        key: str,
        folder: str,
        others: Sequence[str] = (),
    ) -> None:
        """Take what they are.

        Args:
            kind: In a word.
            group: Group of their entry points.
            checks_group: Group of what says whether one can be made.
            key: Key of a cell's file that names one.
            folder: The package of mitt's own, a module each: ``NAME_kind`` makes the one that is
                called NAME, ``check_NAME`` says whether it can be made.
            others: Names that the key may have besides.
        """
        self.kind, self.group, self._checks = kind, group, checks_group
        self._key, self._folder, self._others = key, folder, others

    def load(self, name: str) -> Any:  # noqa: ANN401 (whatever the package has there)
        """Return what makes one of them.

        Raises:
            UnknownNameError: None is called that.
            InputError: It does not load.
        """
        return self._load(name, self.group)

    def made(self, name: str, wanted: type, *given: object) -> Any:  # noqa: ANN401
        """Return one that was made; what its maker's client raises goes through.

        Raises:
            UnknownNameError: None is called that.
            InputError: It does not load, a library is missing, or it is none of its kind.
        """
        make = self.load(name)
        with self._libraries(name):
            return checks.instance(wanted.__name__.lower(), make(*given), wanted)

    def check(self, name: str, cell: Cell, arm: Arm) -> list[str]:
        """Return what one of them asks of what it connects to, a line each.

        It is loaded, and its check is called if it has one; nothing is connected.

        Raises:
            UnknownNameError: None is called that.
            InputError: It does not load, a library is missing, or the check refuses the cell.
        """
        self.load(name)
        if name not in self._entries(self._checks):
            return []
        check, what = self._load(name, self._checks), f"{self.kind} {name!r}"
        with self._libraries(name):
            try:
                return [checks.text(self.kind, line) for line in check(cell, arm)]
            except InputError:  # it is about the cell
                raise
            except MittError as error:
                raise InputError(what, "a cell that its check takes", error) from error

    def _entries(self, group: str) -> dict[str, EntryPoint]:
        """Return the entry points of a group by their names; mitt's own go first."""
        own = self._own("check_{}" if group == self._checks else f"{{}}_{self.kind}", group)
        return {entry.name: entry for entry in (*entry_points(group=group), *own)}

    def _own(self, called: str, group: str) -> list[EntryPoint]:
        """Return those of mitt as entry points of a group, whose functions are ``called`` so."""
        modules = iter_modules(import_module(self._folder).__path__)
        places = {x.name: f"{self._folder}.{x.name}:{called.format(x.name)}" for x in modules}
        return [EntryPoint(name, place, group) for name, place in places.items()]

    def _load(self, name: str, group: str) -> Any:  # noqa: ANN401
        """Return what an entry point stands for."""
        added = self._entries(group)
        if name not in added:
            raise UnknownNameError(
                self._key,
                name,
                (*self._others, *sorted(added)),
                do=f"other {self.kind}s come with packages: pip install it into the Python of mitt",
            )
        entry, where = added[name], f"{self.kind} {name!r}"
        try:
            return entry.load()
        except (ImportError, AttributeError) as error:
            if isinstance(error, ImportError) and not entry.module.startswith(error.name or ""):
                raise _lacking(where, error) from error
            raise InputError(
                where, f"the entry point {entry.value} to load", error, do="repair that package"
            ) from error

    @contextmanager
    def _libraries(self, name: str) -> Iterator[None]:
        """Name a library that is needed and not installed."""
        try:
            yield
        except MissingPackageError:  # of mitt's own: it names the extra
            raise
        except ImportError as error:
            raise _lacking(f"{self.kind} {name!r}", error) from error


def given_options(place: str, given: Mapping[str, Any], known: Mapping[str, Any]) -> dict[str, Any]:
    """Return options, with what is left out as in ``known``; ``place`` is their table.

    Raises:
        InputError: One is not known, or of another kind.
    """
    for key, value in given.items():
        if key not in known:
            raise InputError(f"{place}.{key}", f"one of {', '.join(known)}", "another")
        if type(value) is not type(known[key]):
            raise InputError(f"{place}.{key}", type(known[key]).__name__, repr(value)[:60])
    return {**known, **given}


def _lacking(where: str, error: ImportError) -> InputError:
    """Return the error of a library that is not there."""
    missing = error.name or str(error)
    return InputError(
        where,
        f"the library {missing}",
        "a Python without it",
        do=f"pip install what has {missing}, into the Python of mitt",
    )
