"""The words on a page that make its run again."""

from pathlib import Path

import pytest

from mitt.cli.line import parse
from mitt.cli.options import BatOptions, CatchOptions, MeetOptions
from mitt.cli.screen import repeated


@pytest.mark.parametrize(
    ("command", "options"),
    [
        ("bat", BatOptions(target="-1,0.2,0.5", throws=3, vision="points")),
        ("bat", BatOptions(shield=True, speed="4,6")),
        ("meet", MeetOptions(gripper_delay=0.2, tool_speed=0.5, generator="quintic")),
        ("catch", CatchOptions(throws=3, scene="rough", limits="wam-48v")),
    ],
)
def test_they_say_the_same_options(
    command: str, options: BatOptions | MeetOptions | CatchOptions
) -> None:
    """Numbers below 0 and flags too."""
    assert parse([command, *repeated(options, files=())]) == (command, options)


def test_files_are_found_from_anywhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the option may name one."""
    monkeypatch.chdir(tmp_path)
    Path("scene.toml").touch()
    options = BatOptions(scene="scene.toml")
    assert repeated(options, files=("scene",)) == [f"--scene={tmp_path / 'scene.toml'}"]
    assert repeated(options, files=()) == ["--scene=scene.toml"]
