"""``--help``: all of every option, and an example for every command."""

import re
import shlex
import shutil
from dataclasses import fields
from pathlib import Path

import pytest

from mitt.cli.line import options_of, paragraphs, parse
from mitt.cli.main import main
from mitt.cli.options import COMMANDS

ROOT = Path(__file__).parents[2]
#: Columns of terminals: narrow, of old, wide.
COLUMNS = (60, 80, 120)


def said(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """Return what a command prints before it ends well."""
    status = main(words)
    captured = capsys.readouterr()
    assert (status, captured.err) == (0, "")
    return captured.out


@pytest.mark.parametrize("name", [*COMMANDS, ""])
def test_help_fits_the_terminal_and_has_an_example(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """Usage first, then what it is for and an example, then every option; all of the width."""
    for columns in COLUMNS:
        monkeypatch.setenv("COLUMNS", str(columns))
        text = said(capsys, *name.split(), "--help")
        lines = text.splitlines()
        assert max(map(len, lines)) < columns
        assert max(map(len, lines)) > columns - 20 or name not in ("", "catch", "calibrate")
        assert lines[0].startswith(f"usage: mitt {name}".rstrip())
        assert f"  mitt {name or 'catch'}" in lines[lines.index("examples:") + 1]
        assert said(capsys, *name.split(), "-h") == text


def flat(text: str) -> str:
    """Return a text without what wrapping changes."""
    return re.sub(r"\s+", "", text)


@pytest.mark.parametrize("columns", COLUMNS)
@pytest.mark.parametrize("name", COMMANDS)
def test_help_says_all_of_every_option(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, name: str, columns: int
) -> None:
    """Nothing is cut, at whatever length and width; examples are what a shell reads."""
    monkeypatch.setenv("COLUMNS", str(columns))
    text = said(capsys, name, "--help")
    options = {x.name for x in options_of(COMMANDS[name]) if not x.place}
    assert len(options_of(COMMANDS[name])) == len(fields(COMMANDS[name]))
    assert set(re.findall(r"^  (--[a-z-]+)", text, re.MULTILINE)) == options
    for option in options_of(COMMANDS[name]):
        assert option.text
        assert flat(option.text.rstrip(".")) in flat(text), option.called
    assert all(flat(part) in flat(text) for part in paragraphs(COMMANDS[name]))
    assert not any(line.endswith(" ...") for line in text.splitlines())
    examples = text.partition("examples:\n")[2].partition("\n\n")[0].replace("\\\n", "")
    assert [shlex.split(x) for x in examples.splitlines()] == [
        shlex.split(x) for x in COMMANDS[name].examples
    ]


def test_the_overview_says_all_of_what_each_command_is_for(
    capsys: pytest.CaptureFixture[str],
) -> None:
    text = flat(said(capsys, "--help"))
    for name, options in COMMANDS.items():
        assert flat(name + paragraphs(options)[0].removesuffix(".")) in text


@pytest.mark.usefixtures("watched_shortly")
@pytest.mark.parametrize("line", [x for kind in COMMANDS.values() for x in kind.examples])
def test_every_example_parses_and_passes_its_check(
    files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, line: str
) -> None:
    """As it stands in the help; nothing is written."""
    words = shlex.split(line)[1:]
    name, _ = parse(words)
    if name == "report":  # of a study that has been thrown: tests/trials
        return
    here = tmp_path / "here"
    shutil.copytree(files, here)
    if "--out" in words:
        (here / words[words.index("--out") + 1]).unlink(missing_ok=True)
    monkeypatch.chdir(here)
    before = sorted(here.iterdir())
    assert main([*words, "--check"]) == 0
    assert sorted(here.iterdir()) == before
