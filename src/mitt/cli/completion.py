"""``mitt completion``: what lets a shell complete commands, options and names.

A script is made from the same options as the help, and holds all names that there are, so that no
Python starts when a word is completed. What may have a name is said by its option, as ``known``.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import final

from mitt.cli.line import Option, options_of, paragraphs
from mitt.cli.options import COMMANDS, CompletionOptions
from mitt.cli.screen import checked, print_json
from mitt.io.arm_file import known_limits
from mitt.io.load import arm_names
from mitt.io.reading import shipped
from mitt.lab.trials.registry import available
from mitt.version import __version__

#: Where the beginning of a sentence ends that says enough beside a word.
_ENOUGH = re.compile(r"[;:.] |, or |, as ")
#: A part of a value that is said as it stands, as ``belt`` of ``belt|hand|CSV``.
_AS_IT_STANDS = re.compile(r"[a-z]+")
#: Values of a text that are files or folders.
_FILES = re.compile(r"FILE|FOLDER|IMAGES|PICTURE|CSV|TOML|LEFT|RIGHT|ARM|CELL")


def completion_command(options: CompletionOptions) -> int:
    """Run ``mitt completion``; return its exit status."""
    if options.check:
        return checked(options.shell)
    script = script_for(options.shell)
    if options.json:
        said = {"schema": "mitt.completion/1", "version": __version__}
        print_json({**said, "shell": options.shell, "script": script})
    else:
        print(script)  # noqa: T201
    return 0


def script_for(shell: str) -> str:
    """Return what is written for a shell: bash, zsh or fish."""
    return _SCRIPTS[shell]()


@final
@dataclass(frozen=True, slots=True)
class _Value:
    """What may stand for a value.

    Attributes:
        words: Those that have a name.
        files: Whether it may be a file or a folder.
    """

    words: tuple[str, ...]
    files: bool


def _value(option: Option) -> _Value:
    """Return what may stand for the value of an option."""
    said = [x for x in option.value.split("|") if _AS_IT_STANDS.fullmatch(x)]
    named = _names(option.arg.known) if option.arg.known else ()
    files = option.kind is Path or _FILES.search(option.value) is not None
    return _Value((*map(str, option.choices), *said, *named), files and not option.choices)


def _names(kind: str) -> tuple[str, ...]:
    """Return the names of a kind of things; those of a folder of data, but for some."""
    if kind == "arms":
        return arm_names()
    if kind == "limits":
        return known_limits()
    if kind == "generators":
        return available()
    if kind == "flights":
        return ("tennicam",)
    return shipped(kind)


def _about(text: str) -> str:
    """Return the beginning of a text, which says enough beside a word."""
    return _ENOUGH.split(text.removesuffix("."), maxsplit=1)[0]


def _of(name: str) -> tuple[list[Option], list[Option]]:
    """Return the options of a command: those with a name, and those that are said by place."""
    found = options_of(COMMANDS[name])
    return [x for x in found if not x.place], [x for x in found if x.place]


def _bash() -> str:
    """Return the script for bash."""
    values, words = list[str](), list[str]()
    for name in COMMANDS:
        options, places = _of(name)
        values += [_bash_case(f'"{name} {x.name}"', _value(x)) for x in options if x.value]
        named = (*(x.name for x in options), "--help")
        words.append(_bash_case(f'"{name} -"*', _Value(named, files=False)))
        words += [_bash_case(f'"{name} "*', _value(x)) for x in places[-1:]]
    return _filled(_BASH, commands=" ".join(COMMANDS), values=values, words=words)


def _bash_case(pattern: str, value: _Value) -> str:
    """Return a branch of a case."""
    return f'{pattern}) words="{" ".join(value.words)}" files={"yes" if value.files else ""} ;;'


def _zsh() -> str:
    """Return the script for zsh."""
    commands = [_quoted(f"{name}:{_about(paragraphs(kind)[0])}") for name, kind in COMMANDS.items()]
    cases = list[str]()
    for name in COMMANDS:
        options, places = _of(name)
        rows = ["'--help[Show the options and examples]'"]
        for option in options:
            about = re.sub(r"([\[\]])", r"\\\1", _about(option.text))
            takes = f"=[{about}]{_zsh_value(option)}" if option.value else f"[{about}]"
            rows.append(_quoted(option.name + takes))
        rows += [_quoted(f"{'*' if x.many else k}{_zsh_value(x)}") for k, x in enumerate(places, 1)]
        cases.append(f"{name}) _arguments {' '.join(rows)} ;;")
    return _filled(_ZSH, commands=commands, cases=cases)


def _zsh_value(option: Option) -> str:
    """Return what is said of a value, and what may stand for it."""
    value, called = _value(option), option.value.replace(":", r"\:")
    words = " ".join(value.words)
    if value.files:
        return f":{called}:{{compadd - {words}; _files}}" if words else f":{called}:_files"
    return f":{called}:({words})" if words else f":{called}: "


def _fish() -> str:
    """Return the script for fish."""
    rows = list[str]()
    for name, kind in COMMANDS.items():
        about = _quoted(_about(paragraphs(kind)[0]))
        rows.append(f"complete -c mitt -n __mitt_first -a {name} -d {about}")
    for name in COMMANDS:
        options, places = _of(name)
        at = f"complete -c mitt -n '__mitt_at {name}'"
        for option in options:
            about = f"-l {option.name.removeprefix('--')} -d {_quoted(_about(option.text))}"
            rows.append(f"{at} {about}{_fish_value(option) if option.value else ''}")
        rows += [at + _fish_value(option, wanted=()) for option in places[-1:]]
        rows.append(f"{at} -l help -d 'Show the options and examples'")
    return _filled(_FISH, rows=rows)


def _fish_value(option: Option, *, wanted: tuple[str, ...] = ("-r",)) -> str:
    """Return what may stand for a value."""
    value = _value(option)
    words = [f"-a {_quoted(' '.join(value.words))}"] if value.words else []
    return "".join(f" {x}" for x in (*wanted, "-F" if value.files else "-f", *words))


def _quoted(text: str) -> str:
    """Return a text that each of the shells takes as it stands, without its apostrophes."""
    return "'" + text.replace("'", " ") + "'"


def _filled(script: str, **parts: str | list[str]) -> str:
    """Return a script whose ``@NAME@`` are filled in; lines as far in as the mark stands."""
    for name, part in parts.items():
        if isinstance(part, str):
            script = script.replace(f"@{name}@", part)
        else:
            script = re.sub(
                rf"^( *)@{name}@",
                lambda found, rows=part: "\n".join(found[1] + row for row in rows),  # type: ignore[misc]
                script,
                flags=re.MULTILINE,
            )
    return script.strip()


_BASH = r"""
# mitt in bash: keep this as ~/.local/share/bash-completion/completions/mitt
_mitt() {
    local IFS=$'\n' command=${COMP_WORDS[1]} words= files=
    local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD-1]}
    if [[ $word == "=" ]]; then
        word=
    elif [[ $before == "=" ]]; then
        before=${COMP_WORDS[COMP_CWORD-2]}
    fi
    if [[ $COMP_CWORD -eq 1 ]]; then
        words="@commands@ --help --version"
    else
        case "$command $before" in
            @values@
            *)
                case "$command $word" in
                    @words@
                esac
                ;;
        esac
    fi
    COMPREPLY=($(IFS=' '; compgen -W "$words" -- "$word"))
    if [[ -n $files && ( -n $word || -z $words ) ]]; then
        compopt -o filenames 2>/dev/null
        COMPREPLY+=($(compgen -f -- "$word"))
    fi
}
complete -F _mitt mitt
"""
_ZSH = r"""
#compdef mitt
# mitt in zsh: keep this as a file _mitt in a folder of fpath, before compinit
_mitt() {
    local -a commands
    commands=(
        @commands@
    )
    if (( CURRENT == 2 )); then
        _describe -t commands command commands
        return
    fi
    shift words
    (( CURRENT-- ))
    case $words[1] in
        @cases@
    esac
}
if [[ $funcstack[1] == _mitt ]]; then
    _mitt "$@"
else
    compdef _mitt mitt
fi
"""
_FISH = r"""
# mitt in fish: keep this as ~/.config/fish/completions/mitt.fish
function __mitt_first
    test (count (commandline -opc)) -eq 1
end
function __mitt_at
    set -l said (commandline -opc)
    test (count $said) -ge 2; and test "$said[2]" = "$argv[1]"
end
complete -c mitt -f
complete -c mitt -n __mitt_first -l version -d 'The version'
complete -c mitt -n __mitt_first -l help -d 'All commands'
@rows@
"""
_SCRIPTS: dict[str, Callable[[], str]] = {"bash": _bash, "zsh": _zsh, "fish": _fish}
