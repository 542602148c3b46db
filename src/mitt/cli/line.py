"""The command line: words in, exit status out; the work is done elsewhere.

Words are held to the options of their command, and help is made from the same options. What is
wrong is told as everything else is: what was wanted, what was given, what to do.
"""

import re
import shutil
from collections.abc import Sequence
from dataclasses import MISSING, dataclass, fields
from importlib import import_module
from textwrap import wrap
from types import NoneType
from typing import Any, Literal, get_args, get_origin, get_type_hints

import mitt
from mitt.cli.options import COMMANDS, Arg, Options, TaskOptions
from mitt.core.errors import FileError, InputError, MittError, UnknownNameError, meant
from mitt.interrupts import safe_path
from mitt.numerals import real_of, whole_of

#: Columns of a text where there is no terminal, and in how few and how many it is still read well.
_WIDE = 80
_NARROWEST = 40
_WIDEST = 120


def dispatch(words: list[str]) -> int:
    """Run a command and return its exit status; what goes wrong is the caller's to tell.

    Raises:
        MittError: The input is bad.
    """
    said = _answer(words)
    if said is not None:
        print(said, flush=True)  # noqa: T201
        return 0
    name, options = parse(words)
    with safe_path():  # GLFW, which MuJoCo imports, starts a Python that looks for a library
        module = import_module(f"mitt.cli.{options.module}")  # heavy: only now
    try:
        status: int = (vars(module).get(f"{name}_command") or module.command_of(name))(options)
    except InputError as error:
        raise _as_said(options, error) from error
    return status


def _answer(words: list[str]) -> str | None:
    """Return version or help where it is asked for; None where something is to be done."""
    if "--version" in words:
        return mitt.__version__
    if words and not {"--help", "-h"} & set(words):
        return None
    return screen(words[0]) if words and words[0] in COMMANDS else overview()


def _as_said(options: Options, error: InputError) -> MittError:
    """Return an error that calls an input as the command line does, where it is an option."""
    if isinstance(error, FileError):
        return error
    names = {x.field: x.name for x in options_of(type(options))}
    said = names.get(error.name.rpartition(".")[2].replace(" ", "_"))
    return error if said is None else MittError(said + str(error).removeprefix(error.name))


@dataclass(frozen=True, slots=True, kw_only=True)
class Option:
    """One option of a command.

    Attributes:
        name: As it is said, with its dashes; what stands for its value where it has none.
        field: Name of its field.
        value: What stands for its value in a text; nothing where it takes none.
        text: What the docstring says of it.
        kind: ``bool``, ``int``, ``float``, ``str`` or ``Path``.
        choices: The values that it takes, where it takes some alone.
        default: Its value where it is not said.
        required: Whether it has to be said.
        many: Whether several values may be said by their place.
        arg: How it is said.
    """

    name: str
    field: str
    value: str
    text: str
    kind: type
    choices: tuple[object, ...]
    default: object
    required: bool
    many: bool
    arg: Arg

    @property
    def place(self) -> bool:
        """Whether it is said by its place."""
        return self.arg.place

    @property
    def names_file(self) -> bool:
        """Whether its value may be a file."""
        return re.search(r"FILE|CSV|TOML|\.json", self.value) is not None

    @property
    def called(self) -> str:
        """Name and value, as help has them."""
        return self.name if self.place else f"{self.name} {self.value}".strip()

    def read(self, given: str) -> object:
        """Return the value that a word stands for.

        Raises:
            InputError: It is none.
        """
        if self.choices:
            known = {str(x): x for x in self.choices}
            if given not in known:
                raise UnknownNameError(self.name, given, known)
            return known[given]
        if self.kind in (int, float):
            return self._number(given)
        if not given:
            wanted = "a value" if self.place else self.value
            raise InputError(self.name, wanted, "an empty text")
        return self.kind(given)

    def _number(self, given: str) -> float:
        """Return the number that a word stands for, within the option's range."""
        value, arg = whole_of(given) if self.kind is int else real_of(given), self.arg
        if value is None:
            raise InputError(
                self.name, "a whole number" if self.kind is int else "a number", repr(given)
            )
        if arg.range is not None and not arg.range[0] <= value <= arg.range[1]:
            raise InputError(self.name, f"a number in {arg.range[0]}..{arg.range[1]}", value)
        return value


def options_of(command: type[Options]) -> list[Option]:
    """Return the options of a command: by place, its own, of every task, of every command."""
    hints, said = get_type_hints(command, include_extras=True), _attributes(command)
    shared = (TaskOptions, Options) if issubclass(command, TaskOptions) else (Options,)
    rank = {x.name: k for k, kind in enumerate(shared) for x in fields(kind)}
    found = []
    for field in fields(command):
        inner = get_args(hints[field.name])
        arg = next((x for x in inner if isinstance(x, Arg)), Arg(""))
        hint = inner[0] if arg.value else hints[field.name]
        kinds = [x for x in get_args(hint) or (hint,) if x is not NoneType]
        literal = next((x for x in (hint, *kinds) if get_origin(x) is Literal), None)
        choices = get_args(literal)
        value = arg.value or (f"{{{','.join(map(str, choices))}}}" if choices else "")
        found.append(
            Option(
                name=value if arg.place else f"--{(arg.name or field.name).replace('_', '-')}",
                field=field.name,
                value=value,
                text=said.get(field.name, ""),
                kind=str if choices else kinds[0],
                choices=choices,
                default=field.default,
                required=field.default is MISSING,
                many=get_origin(hint) is tuple,
                arg=arg,
            )
        )
    return sorted(found, key=lambda x: (not x.place, rank.get(x.field, -1)))


def parse(words: Sequence[str]) -> tuple[str, Options]:
    """Return command and options.

    Args:
        words: The command and what follows it.

    Raises:
        InputError: A word cannot be; UnknownNameError: a command or an option is none.
    """
    name = words[0]
    if name not in COMMANDS:
        raise UnknownNameError("command", name, COMMANDS)
    options = options_of(COMMANDS[name])
    values, placed, rest = dict[str, object](), list[str](), list(words[1:])
    while rest:
        word = rest.pop(0)
        if not word.startswith("-") or real_of(word) is not None:
            placed.append(word)
            continue
        option, given = _option(name, word, options)
        if option.kind is bool:
            if given is not None:
                raise InputError(option.name, "no value", repr(given))
            values[option.field] = True
            continue
        if given is None:
            if not rest or rest[0].startswith("--"):
                raise InputError(option.name, option.value, "nothing after it")
            given = rest.pop(0)
        values[option.field] = option.read(given)
    values |= _by_place(name, placed, [x for x in options if x.place])
    missing = [x.called for x in options if x.required and x.field not in values]
    if missing:
        raise InputError(name, " and ".join(missing), "none", do=f"see mitt {name} --help")
    return name, COMMANDS[name](**values)  # type: ignore[arg-type]  # as the options have them


def _option(name: str, word: str, options: Sequence[Option]) -> tuple[Option, str | None]:
    """Return the option that a word names, and the value that stands behind an equals sign."""
    called, equals, given = word.partition("=")
    known = {x.name: x for x in options if not x.place}
    option = known.get(called.replace("_", "-"))
    if option is None:
        near = meant(called, (*known, "--help"))
        raise InputError(name, "options of its own", called, do=near or f"see mitt {name} --help")
    return option, given if equals else None


def _by_place(name: str, placed: Sequence[str], places: Sequence[Option]) -> dict[str, object]:
    """Return the values that are said by their place; refuse those that are too many, or none."""
    if places and places[-1].many:
        return {places[-1].field: tuple(map(places[-1].read, placed))} if placed else {}
    if len(placed) > len(places):
        wanted = " and ".join(x.name for x in places) or "options alone"
        raise InputError(
            name, wanted, f"{placed[len(places)]!r} as well", do=f"see mitt {name} --help"
        )
    return {x.field: x.read(given) for x, given in zip(places, placed, strict=False)}


def overview() -> str:
    """Return what ``mitt --help`` says: all commands, a line each."""
    rows = [(name, paragraphs(options)[0]) for name, options in COMMANDS.items()]
    more = {
        "mitt COMMAND --help": "the options of a command, and examples",
        "mitt --version": "the version",
    }
    wide = _columns()
    return "\n".join(
        [
            "usage: mitt COMMAND [options]",
            "",
            "Lets a robot arm catch what is thrown at it.",
            "",
            "examples:",
            *_examples(("mitt catch", COMMANDS["catch"].examples[0]), wide),
            "",
            "commands:",
            *_table(rows, wide),
            "",
            "more:",
            *_table([*more.items()], wide),
        ]
    )


def screen(name: str) -> str:
    """Return what ``mitt COMMAND --help`` says of a command: all of it."""
    command, options, wide = COMMANDS[name], options_of(COMMANDS[name]), _columns()
    rows = [(x.called, text_of(x)) for x in options]
    first = " ".join(x.name for x in options if x.place)
    about = "\n\n".join("\n".join(wrap(part, wide - 1)) for part in paragraphs(command))
    return "\n".join(
        [
            f"usage: mitt {name} {first} [options]".replace("  ", " "),
            "",
            about,
            "",
            "examples:",
            *_examples(command.examples, wide),
            "",
            "options:",
            *_table(rows, wide),
        ]
    )


def _columns() -> int:
    """Return how many columns a text may take: those of the terminal, within reason."""
    return min(max(shutil.get_terminal_size((_WIDE, 0)).columns, _NARROWEST), _WIDEST)


def text_of(option: Option) -> str:
    """Return what help says of an option, with its default."""
    text, default = option.text, option.default
    if option.required and not option.place:
        return f"Required. {text}"
    if isinstance(default, str | int | float) and not isinstance(default, bool):
        return f"{text.rstrip('.')} (default: {default})."
    return text


def paragraphs(command: type[Options]) -> list[str]:
    """Return what a command does, paragraph by paragraph."""
    text = (command.__doc__ or "").split("Attributes:")[0]
    return [" ".join(part.split()) for part in text.strip().split("\n\n")]


def _attributes(command: type[Any]) -> dict[str, str]:
    """Return the texts of the fields of a class and of those that it is made from."""
    said: dict[str, str] = {}
    for kind in reversed(command.__mro__):
        _, _, text = (kind.__doc__ or "").partition("Attributes:")
        for name, does in re.findall(r"\n +(\w+): ((?:.|\n(?! +\w+: ))*)", text):
            said[name] = " ".join(does.split())
    return said


def _examples(lines: Sequence[str], wide: int) -> list[str]:
    """Return commands, those that are too long in lines that a shell takes as one."""
    out = list[str]()
    for line in lines:
        parts = wrap(
            line,
            wide - 3,  # for the backslash
            initial_indent="  ",
            subsequent_indent="      ",
            break_long_words=False,
            break_on_hyphens=False,
        )
        out += [f"{part} \\" for part in parts[:-1]] + parts[-1:]
    return out


def _table(rows: list[tuple[str, str]], wide: int) -> list[str]:
    """Return names and texts in columns, each text whole; a long name has a line of its own."""
    column = min(max(len(name) for name, _ in rows), wide // 4)
    left, lines = " " * (column + 4), list[str]()
    for name, text in rows:
        head = f"  {name.ljust(column)}  "
        if len(name) > column:
            lines += _broken(name, wide)
            head = left
        told = wrap(
            text.removesuffix("."),
            wide - 1,
            initial_indent=head,
            subsequent_indent=left,
            break_on_hyphens=False,
        )
        lines += told or [head.rstrip()]
    return lines


def _broken(name: str, wide: int) -> list[str]:
    """Return a long name in lines, which break behind commas too."""
    parts = wrap(
        name.replace(",", ", "),
        wide - 1,
        initial_indent="  ",
        subsequent_indent="    ",
        break_on_hyphens=False,
    )
    return [part.replace(", ", ",") for part in parts]
