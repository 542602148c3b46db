"""Scenes by name, and scenes from files that may start from a named one."""

from functools import lru_cache
from pathlib import Path
from typing import Any, get_args

from mitt import checks
from mitt.errors import FileError, InputError, meant
from mitt.files.schema import merged, validated
from mitt.reading import read_toml, shipped_path
from mitt.world.scene import TABLE_TENNIS, Scene, SceneName

NAMES: tuple[str, ...] = get_args(SceneName)
"""Names of the scenes that ship."""

DEFAULT: SceneName = "lab"
"""The scene of ``mitt catch`` and of studies where none is asked for."""

_FILE_BASE: SceneName = "ideal"
"""What a file starts from that does not say so."""


def named_scene(name: str, *, flights: bool = False) -> Scene:
    """Return a scene that ships.

    Args:
        name: One of ``NAMES``.
        flights: Whether recorded flights are thrown: the ball is then one of table tennis.

    Raises:
        InputError: No scene is called that.
    """
    return scene_of({"base": name}, place="scene", flights=flights)


def read_scene(source: str | Path, *, flights: bool = False) -> Scene:
    """Read a scene: one that ships, by name, or a TOML file.

    Keys that a file leaves out keep the values of the scene that its key ``base`` names, ``ideal``
    where it names none.

    Args:
        source: Name of a scene, or a file.
        flights: As for :func:`named_scene`; a file with a table ``[ball]`` keeps its own.

    Raises:
        FileError: The file cannot be read or is no TOML.
        InputError: A key is unknown or its value cannot be used; the message names both.
    """
    flights = checks.flag("flights", flights)
    path = checks.path("scene", source)
    if str(source) in NAMES and not Path(source).is_file():
        return named_scene(str(source), flights=flights)
    if path.suffix == "" and not path.exists():
        raise FileError(str(path), f"a scene file, or one of {', '.join(NAMES)}", "neither",
                        do=meant(str(path), NAMES))  # fmt: skip
    return scene_of(read_toml(path), place=str(path), flights=flights)


def scene_from(given: Scene | str | Path | None) -> Scene:
    """Return a scene as a user gives one: itself, its name or file, or the default one for None."""
    if isinstance(given, Scene):
        return given
    if given is not None and not isinstance(given, str | Path):
        raise InputError("scene", "a Scene, or the name or file of one", checks.shown(given))
    return read_scene(DEFAULT if given is None else given)


def scene_of(
    table: dict[str, Any], *, place: str, base: SceneName = _FILE_BASE, flights: bool = False
) -> Scene:
    """Return a scene from what a file says of it.

    Args:
        table: Keys of a scene; what is left out is that of its base.
        place: What an error calls it.
        base: Base of a table that names none.
        flights: As for :func:`read_scene`.

    Raises:
        InputError: A key is unknown or its value cannot be used; the message names both.
    """
    name = table.get("base", base)
    if name not in NAMES:
        raise InputError(f"{place} key base", f"one of {', '.join(NAMES)}", repr(name)[:60])
    below = {"base": name} | _shipped(name)
    if flights:
        below["ball"] = _recorded(below.get("ball", {}))
    return validated(Scene, merged(below, table), place=place)


def changed(scene: Scene) -> dict[str, Any]:
    """Return the settings in which a scene differs from the one that it starts from."""
    own, other = scene.model_dump(mode="json"), named_scene(scene.base).model_dump(mode="json")
    return _difference(own, other)


@lru_cache(maxsize=len(NAMES))
def _shipped(name: str) -> dict[str, Any]:
    """Return what the file of a scene that ships says; not to be written to."""
    return read_toml(shipped_path("scenes", name))


def _recorded(ball: dict[str, Any]) -> dict[str, Any]:
    """Return the ball of recorded flights; its material is known where that of the ball is."""
    material = {"material": "table-tennis"} if "material" in ball else {}
    kept = {key: ball[key] for key in ("brightness",) if key in ball}
    return TABLE_TENNIS.model_dump(include={"radius", "mass", "drag"}) | kept | material


def _difference(own: dict[str, Any], other: dict[str, Any]) -> dict[str, Any]:
    """Return what one nested table says otherwise than another with the same keys."""
    out: dict[str, Any] = {}
    for key, value in own.items():
        if isinstance(value, dict) and isinstance(other[key], dict):
            if inner := _difference(value, other[key]):
                out[key] = inner
        elif value != other[key]:
            out[key] = value
    return out
