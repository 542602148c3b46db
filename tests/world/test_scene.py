"""Scenes: what is left out has a default, what is wrong is named; by name and from files."""

from pathlib import Path

import pytest
from pydantic import ValidationError

from mitt.core.errors import FileError, InputError
from mitt.lab.world.scene import (
    NAMES,
    TABLE_TENNIS,
    Ball,
    Scene,
    changed_settings,
    named_scene,
    read_scene,
    scene_of,
)


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
        ("[sensing]\nexposure = 0.01", "exposure of at most a frame, 1 / frame_rate"),
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


def test_ideal_is_the_scene_without_arguments() -> None:
    """Its file spells out every default, so results with it are those of ``Scene()``."""
    assert named_scene("ideal") == Scene()


@pytest.mark.parametrize("name", NAMES)
def test_a_scene_knows_its_name_and_differs_from_itself_in_nothing(name: str) -> None:
    scene = named_scene(name)
    assert scene.base == name
    assert changed_settings(scene) == {}


def test_rough_doubles_the_errors_and_delays_of_lab() -> None:
    """Half-widths, noise, latency, delay; blur and exposure; bandwidth halves."""
    lab, rough = named_scene("lab"), named_scene("rough")
    assert rough.ball == lab.ball
    one, two = lab.mismatch.model_dump(), rough.mismatch.model_dump()
    assert {key: pytest.approx(2.0 * value) for key, value in one.items()} == two
    for key in ("point_noise", "latency", "exposure", "texture", "corner_noise", "blur"):
        assert getattr(rough.sensing, key) == pytest.approx(2.0 * getattr(lab.sensing, key)), key
    assert rough.actuation.delay == 2 * lab.actuation.delay
    assert rough.actuation.bandwidth == pytest.approx(0.5 * lab.actuation.bandwidth)


def test_a_file_starts_from_the_scene_that_it_names(tmp_path: Path) -> None:
    """What it leaves out is that of its base; what differs is said."""
    path = tmp_path / "mine.toml"
    path.write_text('base = "lab"\n[sensing]\nlatency = 4\n')
    scene, lab = read_scene(path), named_scene("lab")
    assert scene.ball == lab.ball
    assert changed_settings(scene) == {"sensing": {"latency": 4}}


def test_recorded_flights_are_of_table_tennis_balls_in_every_scene(tmp_path: Path) -> None:
    """Of their material where the scene's ball has one; a file's own ball stays."""
    assert read_scene("ideal", flights=True).ball == TABLE_TENNIS
    ball = read_scene("lab", flights=True).ball
    assert (ball.radius, ball.mass, ball.material) == (0.02, 0.0027, "table-tennis")
    path = tmp_path / "mine.toml"
    path.write_text("[ball]\nradius = 0.025\n")
    assert read_scene(path, flights=True).ball.radius == 0.025


@pytest.mark.parametrize("base", ["moon", 3, "../lab"])
def test_a_base_that_does_not_exist_is_refused(base: object) -> None:
    """One line that names the key and the names there are."""
    with pytest.raises(InputError, match="key base: wanted one of ideal, lab, room, rough"):
        scene_of({"base": base}, place="x.toml")


def test_a_name_that_is_neither_scene_nor_file_is_refused() -> None:
    with pytest.raises(FileError, match="ideal, lab, room, rough"):
        read_scene("moon")
