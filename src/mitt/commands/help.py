"""``--help``: a command on one screen, each option in one line, with examples.

It is made from the options themselves, as ``--help-all`` and docs/commands.md are. A text that is
longer than its line ends early, with dots; ``--help-all`` has all of it.
"""

import re
from collections.abc import Callable, Mapping
from textwrap import wrap

from mitt.commands import words

Commands = Mapping[str, Callable[..., object]]
"""Options of each command, by its name."""

#: Columns of a screen, and of what an option is called.
_WIDE, _CALLED = 80, 22
#: Where a text may end early.
_ENDS = re.compile(r"(?=[;:,.]? \(|[;:,.] )")
#: What each command is good for, as lines that can be typed.
EXAMPLES: dict[str, tuple[str, ...]] = {
    "catch": (
        "mitt catch --throws 100 --seed 1 --out many",
        "mitt catch --arm ARM.toml --scene rough --record all",
    ),
    "learn": ("mitt learn --limits wam-80v --out MAP.json",),
    "design": (
        "mitt design ARM.urdf --tip palm --joints yaw,pitch,elbow --out DESIGN.toml",
        "mitt design wam --limits wam-48v --effort quick --out soft.toml",
    ),
    "run": ("mitt run wam-sim --throws 5 --yes",),
    "sim": ("mitt sim wam-sim --throws 5 --seed 1",),
    "study": ("mitt study smoke --out STUDY", "mitt study STUDY.toml --out MINE --workers 4"),
    "report": ("mitt report STUDY --replays 3",),
    "track": ("mitt track POINTS.csv --out TRACK.csv --ahead 0.1",),
    "see": ("mitt see LEFT.mkv RIGHT.mkv --rig RIG.toml --out TRACK.csv",),
    "calibrate": (
        "mitt calibrate --left LEFT --right RIGHT --out RIG.toml",
        "mitt calibrate --rig RIG.toml --hand HAND.csv --out PLACED.toml",
    ),
    "replay": (
        "mitt replay REC.mcap --out why",
        "mitt replay REC.mcap --map MAP.json",
    ),
    "view": ("mitt view REC.mcap --port 8080",),
    "bench": ("mitt bench --json",),
}


def overview(commands: Commands) -> str:
    """Return what ``mitt --help`` says: all commands, a line each."""
    rows = [(name, _paragraphs(options)[0]) for name, options in commands.items()]
    return "\n".join([
        "usage: mitt COMMAND [options]", "",
        "Lets a robot arm catch what is thrown at it.", "",
        "examples:", "  mitt catch", f"  {EXAMPLES['catch'][0]}", "",
        "commands:", *_table(rows), "",
        "mitt COMMAND --help    the options of a command, and examples",
        "mitt --version         the version",
    ])  # fmt: skip


def screen(name: str, options: Callable[..., object]) -> str:
    """Return what ``mitt COMMAND --help`` says.

    Args:
        name: Of the command.
        options: The class of its options.
    """
    rows = options_of(options)
    first = " ".join(called for called, _, positional in rows if positional)
    return "\n".join([
        f"usage: mitt {name} {first} [options]".replace("  ", " "), "",
        *wrap(_paragraphs(options)[0], _WIDE - 1), "",
        "examples:", *(f"  {line}" for line in EXAMPLES[name]), "",
        "options:", *_table([(called, text) for called, text, _ in rows]), "",
        f"mitt {name} --help-all    all that is to be said of each option",
    ])  # fmt: skip


def options_of(options: Callable[..., object]) -> list[tuple[str, str, bool]]:
    """Return the options of a command: what they are called, their text, whether by place."""
    said, found = _attributes(options), list[tuple[str, str, bool]]()
    for option in words.options_of(options):
        text, default = option.text or said.get(option.field, ""), option.default
        if option.required and not option.positional:
            text = f"Required. {text}"
        elif isinstance(default, str | int | float) and not isinstance(default, bool):
            text = f"{text.rstrip('.')} (default: {default})."
        called = option.name if option.positional else f"{option.name} {option.value}".strip()
        found.append((called, text, option.positional))
    return sorted(found, key=lambda row: not row[2])


def _paragraphs(options: Callable[..., object]) -> list[str]:
    """Return what a command does, paragraph by paragraph."""
    text = (options.__doc__ or "").split("Attributes:")[0]
    return [" ".join(part.split()) for part in text.strip().split("\n\n")]


def _attributes(options: Callable[..., object]) -> dict[str, str]:
    """Return the texts of the fields of a class and of those that it is made from."""
    said: dict[str, str] = {}
    for kind in reversed(options.__mro__):  # type: ignore[attr-defined]  # it is a class
        _, _, text = (kind.__doc__ or "").partition("Attributes:")
        for name, does in re.findall(r"\n +(\w+): ((?:.|\n(?! +\w+: ))*)", text):
            said[name] = " ".join(does.split())
    return said


def _table(rows: list[tuple[str, str]]) -> list[str]:
    """Return names and texts in columns, a line each."""
    column = min(max(len(name) for name, _ in rows), _CALLED)
    lines = []
    for name, text in rows:
        head = f"  {name.ljust(column)}  "
        lines.append((head + _fitting(text, _WIDE - 1 - len(head))).rstrip())
    return lines


def _fitting(text: str, room: int) -> str:
    """Return a text as it fits on a line; shortened where a sentence or a part of one ends."""
    text = text.removesuffix(".")
    if len(text) <= room:
        return text
    ends = [end.start() for end in _ENDS.finditer(text) if 0 < end.start() <= room - 4]
    whole = [end for end in ends if text[:end].count("(") == text[:end].count(")")]
    if whole and whole[-1] > room // 3:
        return text[: whole[-1]] + " ..."
    return text[: room - 4].rsplit(" ", 1)[0] + " ..."
