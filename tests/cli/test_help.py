"""``--help``: one screen and an example for every command; ``--help-all``: all of it."""

import re
import shlex
import shutil
from dataclasses import fields
from pathlib import Path

import pytest

from mitt.cli.line import options_of, parse
from mitt.cli.main import main
from mitt.cli.options import COMMANDS

ROOT = Path(__file__).parents[2]
#: A screen.
LINES, COLUMNS = 40, 80


def said(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """Return what a command prints before it ends well."""
    status = main(words)
    captured = capsys.readouterr()
    assert (status, captured.err) == (0, "")
    return captured.out


@pytest.mark.parametrize("name", [*COMMANDS, ""])
def test_help_is_one_screen_with_an_example(capsys: pytest.CaptureFixture[str], name: str) -> None:
    """Usage first, then what it is for and an example, then every option."""
    text = said(capsys, *name.split(), "--help")
    lines = text.splitlines()
    assert len(lines) <= LINES
    assert max(map(len, lines)) < COLUMNS
    assert lines[0].startswith(f"usage: mitt {name}".rstrip())
    assert f"  mitt {name or 'catch'}" in lines[lines.index("examples:") + 1]
    assert said(capsys, *name.split(), "-h") == text


@pytest.mark.parametrize("name", COMMANDS)
def test_help_names_every_option_and_help_all_says_all_of_it(
    capsys: pytest.CaptureFixture[str], name: str
) -> None:
    """The class of the options, the short help and the long one know the same options."""
    short, long = said(capsys, name, "--help"), said(capsys, name, "--help-all")
    options = {x.name for x in options_of(COMMANDS[name]) if not x.place}
    assert len(options_of(COMMANDS[name])) == len(fields(COMMANDS[name]))
    for text in (short, long):
        assert set(re.findall(r"^  (--[a-z-]+)", text, re.MULTILINE)) == options
    flat = re.sub(r"\s+", "", long)
    for option in options_of(COMMANDS[name]):
        assert option.text
        assert re.sub(r"\s+", "", option.text.rstrip(".")) in flat, option.called
    lines = [line for line in short.splitlines() if line.startswith("  -")]
    assert all(len(line.split(maxsplit=2)) > 1 for line in lines)


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
