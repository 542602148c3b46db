"""Scene settings: what is left out has a default, what is wrong is named."""

from pathlib import Path

import pytest
from pydantic import ValidationError

from mitt.errors import FileError, InputError
from mitt.world.scene import Ball, Scene
from mitt.world.scenes import read_scene


def written(folder: Path, text: str) -> Path:
    """Write a scene file."""
    path = folder / "scene.toml"
    path.write_text(text)
    return path


def test_a_file_changes_only_what_it_names(tmp_path: Path) -> None:
    """One key of one table; all else keeps its default; whole numbers count as numbers."""
    scene = read_scene(written(tmp_path, "floor = -2\n[ball]\nradius = 0.03\n"))
    assert scene == Scene(ball=Ball(radius=0.03), floor=-2.0)
    assert read_scene(written(tmp_path, "")) == Scene()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[ball]\nradius = -0.04", "ball.radius"),
        ("[ball]\nradius = nan", "ball.radius"),
        ("[ball]\nmass = 0", "ball.mass"),
        ("[ball]\nmass = '70 g'", "ball.mass"),
        ("[ball]\nradious = 0.04", "one of the keys radius, mass, drag, brightness, material"),
        ("ball = 3", "key ball"),
        ("[sensing]\nlatency = 1.5", "sensing.latency"),
        ("[mismatch]\nmass = 0.9", "mismatch.mass"),
        ("[contact]\nsettle = 0.0001", "contact.settle"),
        pytest.param("[sensing]\nlatency = 0x" + 6000 * "f", "sensing.latency", id="digits"),
        ("gravity = 3", "one of the keys base, ball, mismatch, sensing, actuation, contact, floor"),
    ],
)
def test_a_wrong_value_is_one_line_that_names_its_key(tmp_path: Path, text: str, said: str) -> None:
    """File, key, what was wanted, what was given."""
    path = written(tmp_path, text)
    with pytest.raises(InputError) as caught:
        read_scene(path)
    assert said in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_what_is_no_toml_is_refused(tmp_path: Path) -> None:
    """Broken text, bytes, a folder, a missing file."""
    broken, binary = written(tmp_path, "[["), tmp_path / "binary.toml"
    binary.write_bytes(b"\xff\xff")
    for path in (broken, binary, tmp_path, tmp_path / "missing.toml"):
        with pytest.raises(FileError):
            read_scene(path)


def test_settings_cannot_be_changed() -> None:
    """A scene is a value."""
    with pytest.raises(ValidationError):
        Scene().floor = -3.0


def test_pairs_of_numbers_can_be_said_in_a_file(tmp_path: Path) -> None:
    """TOML has lists and no tuples: pattern, light and shadow take them."""
    text = "[sensing]\npattern = [30.0, 12.0]\nlight = [0.1, 100]\nshadow = [0.2, 50.0]\n"
    sensing = read_scene(written(tmp_path, text)).sensing
    assert (sensing.pattern, sensing.light) == ((30.0, 12.0), (0.1, 100.0))
    assert sensing.shadow == (0.2, 50.0)
