"""The words of a command line, held to the options of their command before anything reads them.

What is wrong is told as everything else is: what was wanted, what was given, what to do.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, dataclass, fields
from typing import Any, Literal, get_args, get_origin, get_type_hints

from tyro.conf import Positional

from mitt.errors import InputError, UnknownNameError, meant

_INTEGER = re.compile(r"[+-]?\d+")


@dataclass(frozen=True, slots=True, kw_only=True)
class Option:
    """One option of a command.

    Attributes:
        name: As it is said, with its dashes; what stands for its value where it has none.
        field: Name of its field.
        value: What stands for its value in a text; nothing where it takes none.
        text: What its annotation says of it.
        kind: ``bool``, ``int``, ``float`` or ``str``; a path is a text as well.
        choices: The values that it takes, where it takes some alone.
        default: Its value where it is not said.
        required: Whether it has to be said.
        positional: Whether it is said by its place.
        many: Whether several values may be said by their place.
    """

    name: str
    field: str
    value: str
    text: str
    kind: type
    choices: tuple[str, ...]
    default: object
    required: bool
    positional: bool
    many: bool

    def check(self, given: str) -> None:
        """Refuse a value that is none.

        Raises:
            InputError: It is none.
        """
        if self.choices and given not in self.choices:
            raise UnknownNameError(self.name, given, self.choices)
        if self.kind is int and not _INTEGER.fullmatch(given):
            raise InputError(self.name, "a whole number", repr(given))
        if self.kind is float and not _is_number(given):
            raise InputError(self.name, "a number", repr(given))


def options_of(options: Callable[..., object]) -> list[Option]:
    """Return the options of a command, by the class that holds them."""
    hints, found = get_type_hints(options, include_extras=True), []
    for field in fields(options):  # type: ignore[arg-type]  # it is a dataclass
        hint = hints[field.name]
        positional, about = False, None
        while hasattr(hint, "__metadata__"):  # Positional[Annotated[...]] is one in another
            positional = positional or Positional in hint.__metadata__
            about = next((x for x in hint.__metadata__ if x is not Positional), about)
            hint = hint.__origin__
        kinds = [x for x in get_args(hint) or (hint,) if x is not type(None)]
        choices = _choices(hint)
        many = get_origin(hint) is tuple
        called = f"--{((about and about.name) or field.name).replace('_', '-')}"
        value = (about and about.metavar) or (choices and f"{{{','.join(choices)}}}") or ""
        kind = str if choices or kinds[0] not in (bool, int, float) else kinds[0]
        found.append(Option(
            name=value if positional else called, field=field.name, value=value,
            text=(about and about.help) or "", kind=kind, choices=choices,
            default=field.default, required=field.default is MISSING, positional=positional,
            many=many,
        ))  # fmt: skip
    return found


def check_words(words: Sequence[str], commands: Mapping[str, Callable[..., object]]) -> None:
    """Refuse words that are no command with options of its own.

    Args:
        words: The command and what follows it.
        commands: Options of each command, by its name.

    Raises:
        InputError: A word cannot be; UnknownNameError: a command or an option is none.
    """
    name = words[0]
    if name not in commands:
        raise UnknownNameError("command", name, commands)
    options = options_of(commands[name])
    places = [x for x in options if x.positional]
    said, placed, rest = dict[str, str](), list[str](), list(words[1:])
    while rest:
        word = rest.pop(0)
        if not word.startswith("-") or _is_number(word):
            placed.append(word)
            continue
        option, given = _option(name, word, options)
        if option.kind is bool:
            if given is not None:
                raise InputError(option.name, "no value", repr(given))
        elif given is None:
            if not rest or rest[0].startswith("--"):
                raise InputError(option.name, option.value, "nothing after it")
            given = rest.pop(0)
        said[option.name] = given or ""
        if option.kind is not bool:
            option.check(given or "")
    _check_places(name, placed, places)
    left = [x for x in options if x.required and not x.positional and x.name not in said]
    missing = [x.name for x in places[len(placed) :] if x.required]
    missing += [f"{x.name} {x.value}" for x in left]
    if missing:
        raise InputError(name, " and ".join(missing), "none",
                         do=f"see mitt {name} --help")  # fmt: skip


def _option(name: str, word: str, options: Sequence[Option]) -> tuple[Option, str | None]:
    """Return the option that a word names, and the value that stands behind an equals sign."""
    called, equals, given = word.partition("=")
    known = {x.name: x for x in options if not x.positional}
    option = known.get(called.replace("_", "-"))
    if option is None:
        near = meant(called, (*known, "--help", "--help-all"))
        raise InputError(name, "options of its own", called,
                         do=near or f"see mitt {name} --help")  # fmt: skip
    return option, given if equals else None


def _check_places(name: str, placed: Sequence[str], places: Sequence[Option]) -> None:
    """Refuse values by their place that are too many, or none."""
    many = any(x.many for x in places)
    if len(placed) > len(places) and not many:
        wanted = " and ".join(x.name for x in places) or "options alone"
        raise InputError(name, wanted, f"{placed[len(places)]!r} as well",
                         do=f"see mitt {name} --help")  # fmt: skip
    for option, given in zip(places, placed, strict=False):
        option.check(given)


def _choices(hint: Any) -> tuple[str, ...]:  # noqa: ANN401 (an annotation)
    """Return the words that an option takes, if it takes some alone."""
    for kind in (hint, *get_args(hint)):
        if get_origin(kind) is Literal:
            return tuple(map(str, get_args(kind)))
    return ()


def _is_number(text: str) -> bool:
    """Say whether a text is a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True
