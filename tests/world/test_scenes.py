"""Scenes by name: what they are, and files that start from them."""

from pathlib import Path

import pytest

from mitt.errors import FileError, InputError
from mitt.world.scene import TABLE_TENNIS, Scene
from mitt.world.scenes import NAMES, changed, named_scene, read_scene, scene_of


def test_ideal_is_the_scene_without_arguments() -> None:
    """Its file spells out every default, so results with it are those of ``Scene()``."""
    assert named_scene("ideal") == Scene()


@pytest.mark.parametrize("name", NAMES)
def test_a_scene_knows_its_name_and_differs_from_itself_in_nothing(name: str) -> None:
    scene = named_scene(name)
    assert scene.base == name
    assert changed(scene) == {}


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
    assert changed(scene) == {"sensing": {"latency": 4}}


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
    with pytest.raises(InputError, match="key base: wanted one of ideal, lab, rough"):
        scene_of({"base": base}, place="x.toml")


def test_a_name_that_is_neither_scene_nor_file_is_refused() -> None:
    with pytest.raises(FileError, match="ideal, lab, rough"):
        read_scene("moon")
