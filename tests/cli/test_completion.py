"""``mitt completion``: what a shell offers is what the command takes."""

import shutil
import subprocess
from pathlib import Path

import pytest

from mitt.cli.line import options_of
from mitt.cli.main import main
from mitt.cli.options import COMMANDS
from mitt.io.cell import read_cell
from mitt.io.load import arm_names

#: Asks for what may follow some words; the last of them is completed.
ASK = """
source "$1"; cd "$2"; shift 2
while read -ra COMP_WORDS; do
    COMP_WORDS=("${COMP_WORDS[@]/#-EMPTY-/}")
    COMP_CWORD=$((${#COMP_WORDS[@]} - 1)) COMPREPLY=()
    _mitt 2>/dev/null
    echo "${COMPREPLY[*]}"
done
"""


def script(capsys: pytest.CaptureFixture[str], shell: str) -> str:
    """Return what is written for a shell."""
    assert main(["completion", shell]) == 0
    return capsys.readouterr().out


def offered(text: str, folder: Path, *lines: str) -> list[set[str]]:
    """Return what bash offers at the end of each line."""
    (folder / "mitt.bash").write_text(text)
    (folder / "here").mkdir(exist_ok=True)
    (folder / "here" / "my.toml").touch()
    asked = "\n".join(x + "-EMPTY-" if x.endswith(" ") else x for x in lines)
    done = subprocess.run(
        ["bash", "-c", ASK, "bash", str(folder / "mitt.bash"), str(folder / "here")],
        input=asked + "\n",
        capture_output=True,
        text=True,
        check=True,
    )
    return [set(x.split()) for x in done.stdout.splitlines()]


@pytest.mark.skipif(shutil.which("bash") is None, reason="asks bash")
def test_bash_offers_every_command_option_and_choice(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    asked, wanted = ["mitt "], [{*COMMANDS, "--help", "--version"}]
    for name in COMMANDS:
        options = [x for x in options_of(COMMANDS[name]) if not x.place]
        asked.append(f"mitt {name} -")
        wanted.append({x.name for x in options} | {"--help"})
        for option in options:
            if option.choices:
                asked += [f"mitt {name} {option.name} ", f"mitt {name} {option.name} ="]
                wanted += [{str(x) for x in option.choices}] * 2
    assert offered(script(capsys, "bash"), tmp_path, *asked) == wanted


@pytest.mark.skipif(shutil.which("bash") is None, reason="asks bash")
def test_bash_offers_names_and_files_where_they_are_taken(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    text = script(capsys, "bash")
    arms, cells, after, file, number, target = offered(
        text,
        tmp_path,
        "mitt catch --arm ",
        "mitt run ",
        "mitt design --seed 3 u",
        "mitt catch --arm m",
        "mitt catch --throws m",
        "mitt meet --target ",
    )
    assert arms == set(arm_names())
    assert "wam-sim" in cells
    assert [read_cell(x).name for x in cells]
    assert after == {x for x in arm_names() if x.startswith("u")}
    assert file == {"my.toml"}
    assert number == set()
    assert target == {"belt", "hand"}


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_each_script_names_all_there_is_and_can_be_read(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, shell: str
) -> None:
    """The shell itself judges it where it is installed."""
    text = script(capsys, shell)
    for name in COMMANDS:
        assert name in text
        for option in options_of(COMMANDS[name]):
            said = option.name.removeprefix("--") if shell == "fish" else option.name
            assert said in text or option.place
    for name in (*arm_names(), "wam-48v", "rough", "ur5e-belt-sim", "quintic", "smoke"):
        assert name in text
    (tmp_path / "script").write_text(text)
    if shutil.which(shell) is not None:
        subprocess.run([shell, "-n", str(tmp_path / "script")], check=True)
