"""Settings of the simulated world: scenes from code, by name, or from a TOML file.

What the catcher does not know: how heavy the links really are, how much the joints rub, how good
the sensors are. Every figure without a source is a choice of this project.
"""

from functools import lru_cache
from math import ceil
from pathlib import Path
from typing import Annotated, Any, Final, Literal, Self, get_args

import numpy as np
from pydantic import Field, field_validator, model_validator

from mitt.core import checks
from mitt.core.ball.spin import lift_constant
from mitt.core.errors import FileError, InputError, meant
from mitt.core.signals import TICK, Array
from mitt.io.reading import read_toml, shipped_path
from mitt.io.schema import FileSettings, merged, validated
from mitt.lab.world.faults import FaultPlan
from mitt.lab.world.throws import Spinning

NotNegative = Annotated[float, Field(ge=0.0)]
Share = Annotated[float, Field(ge=0.0, lt=0.5)]
Side = Annotated[float, Field(ge=0.005, le=0.5)]
Count = Annotated[float, Field(ge=0.0, le=100.0)]
Grey = Annotated[float, Field(ge=0.0, le=255.0)]
Bend = Annotated[float, Field(ge=-0.5, le=0.5)]
SceneName = Literal["ideal", "lab", "room", "rough"]
Material = Literal["foam", "tennis", "table-tennis", "rubber"]

MOST_THROWN: Final = 2.0
"""Mass of the heaviest ball [kg]; parts that are met may be heavier."""

NAMES: tuple[str, ...] = get_args(SceneName)
"""Names of the scenes that ship."""

DEFAULT_SCENE: SceneName = "lab"
"""The scene of ``mitt catch`` and of studies where none is asked for."""

_FILE_BASE: SceneName = "ideal"
"""What a file starts from that does not say so."""


class Ball(FileSettings):
    """What is thrown; radius and mass are choices of this project, drag that of thrown balls.

    Attributes:
        radius: Radius [m].
        mass: Mass [kg]: of a ball 2 kg at most.
        drag: Quadratic drag coefficient k [1/m].
        brightness: Brightness above the background [grey levels], negative below it; both fit into
            8 bits.
        material: What it is made of, which gives friction and restitution of its contact; see
            :mod:`mitt.lab.world.build`.
        sides: Length, width and height of a part in the shape of a box [m]; a ball if left out.
        lift: Lift of a spin, as share of what :mod:`mitt.core.ball.spin` says.
        spin: How fast thrown balls spin [rad/s], each about an axis of its own across its velocity.
        hollow: Whether it is a thin shell, as balls of table tennis are.
    """

    radius: Annotated[float, Field(ge=0.005, le=0.06)] = 0.04
    mass: Annotated[float, Field(ge=0.001, le=50.0)] = 0.07
    drag: Annotated[float, Field(ge=0.0, le=1.0)] = 0.04
    brightness: Annotated[float, Field(ge=-255.0, le=255.0)] = 160.0
    material: Material | None = None
    sides: Annotated[tuple[Side, Side, Side], Field(strict=False)] | None = None
    lift: Annotated[float, Field(ge=0.0, le=3.0)] = 1.0
    spin: Annotated[float, Field(ge=0.0, le=1000.0)] = 0.0
    hollow: bool = False

    @property
    def lift_constant(self) -> float:
        """Its lift constant, of :mod:`mitt.core.ball.spin`."""
        return self.lift * lift_constant(self.radius, self.mass)

    @property
    def spinning(self) -> Spinning:
        """How it spins when it is thrown."""
        return Spinning(rate=self.spin, K=self.lift_constant, radius=self.radius)

    @model_validator(mode="after")
    def _light(self) -> Self:
        """Refuse a ball as heavy as a part may be."""
        if self.sides is None and self.mass > MOST_THROWN:
            raise ValueError(f"a mass of at most {MOST_THROWN:g} kg, or the sides of a part")
        return self


class Mismatch(FileSettings):
    """How far the plant is from the model of the catcher, drawn anew from each trial's seed.

    Attributes:
        mass: Half-width of each link's relative mass error.
        viscous: Largest viscous friction of a joint [N m s/rad].
        coulomb: Largest dry friction of a joint [N m].
        drag: Half-width of the relative error of the ball's drag.
        ball_mass: Half-width of the relative error of the ball's mass.
        ball_radius: Half-width of the relative error of the ball's radius.
        lift: Half-width of the relative error of the ball's lift, one for a run of batting.
        restitution: The same of a paddle's restitution, one for a run.
        tangential: The same of its tangential restitution, one for a run.
        fall: The same of how its restitution falls with speed, one for a run.
    """

    mass: Share = 0.05
    viscous: NotNegative = 0.1
    coulomb: NotNegative = 0.5
    drag: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.10
    ball_mass: Share = 0.0
    ball_radius: Annotated[float, Field(ge=0.0, le=0.2)] = 0.0
    lift: Share = 0.10
    restitution: Share = 0.03
    tangential: Share = 0.20
    fall: Annotated[float, Field(ge=0.0, le=1.0)] = 0.5


class BeltEncoder(FileSettings):
    """The encoder of a belt.

    Attributes:
        step: Its resolution, along the belt [m].
        rate: Readings a second [Hz].
        age: Ticks from a reading to its delivery.
        scale: Half-width of the relative error of its scale, drawn anew from each trial's seed.
        clock: Half-width of the error of its stamps [s], drawn likewise.
    """

    step: Annotated[float, Field(ge=0.0, le=0.1)] = 1e-4
    rate: Annotated[float, Field(ge=10.0, le=1000.0)] = 500.0
    age: Annotated[int, Field(ge=0, le=100)] = 2
    scale: Annotated[float, Field(ge=0.0, le=0.2)] = 0.0
    clock: Annotated[float, Field(ge=0.0, le=0.1)] = 0.0


class Sensing(FileSettings):
    """What the catcher senses, and when.

    Attributes:
        point_noise: Noise of points, 1 sigma an axis [m].
        viewpoint: From where points are seen: ``around``, whatever stands between; ``above`` the
            belt, 1 m; ``upstream``, 0.7 m before that, 0.5 m of the belt alone; or a place [m]. The
            first two are beside the arm where there is no belt. What arm, tool or giver cover is
            not seen from there.
        belt: The encoder of the belt; none if left out.
        latency: Ticks until a frame, once it is exposed and read out, or a point is delivered.
        frame_rate: Frames or points a second [Hz], from a random phase on, each exposed in a tick.
        encoder_step: Resolution of the joint encoders [rad]; 0 is exact, ``arm`` that of the
            arm's own encoders. Where they count in steps, velocity is the difference of counts.
        cameras: Cameras that stand still and see all, or that pan-tilt heads turn to the ball.
        exposure: How long a shutter is open [s].
        background: Mean grey level of the background.
        texture: Standard deviation of the background's brightness [grey levels].
        slope: Amplitude of a slow change of the background from side to side [grey levels].
        lamps: Small bright things in the background of an image, how many and their grey level.
        windows: Large ones, a quarter of an image a side.
        hot: Hot pixels of each camera.
        readout: Time from the exposure of the first row to that of the last [s], which the catcher
            knows; 0 is a global shutter.
        body: Grey level of the arm in the images.
        hand: Grey level of the hand; that of the arm if left out.
        shading: Relative difference between the middle of arm and hand and their lit side.
        grain: Relative amplitude of the texture of arm and hand.
        pattern: Contrast [grey levels] and size [px] of squares on the background.
        light: Relative amplitude and frequency [Hz] of the illumination, in phase for both
            cameras; lamps at the mains flicker at twice its frequency, 100 or 120 Hz.
        shadow: Relative depth of a soft shadow and the speed of its edge in the images [px/s].
        second: A second bright ball: centre as the first is released, and radius [m].
        second_velocity: Velocity at which it rolls [m/s].
        views: Views of a board, at least 6, from which cameras that stand still were calibrated,
            and places of a ball in the hand by which they were placed; 0 is an exact calibration.
        corner_noise: Error of a corner or of a ball's centre in these views, 1 sigma an axis [px].
        distortion: k1 and k2 of the lenses, which calibration finds with the rest.
        blur: Standard deviation of the lenses' blur [px].
    """

    point_noise: Annotated[float, Field(ge=0.0, le=10.0)] = 0.001
    viewpoint: (
        Literal["around", "above", "upstream"]
        | Annotated[tuple[float, float, float], Field(strict=False)]
    ) = "around"
    belt: BeltEncoder | None = None
    latency: Annotated[int, Field(ge=0, le=1000)] = 1
    frame_rate: Annotated[float, Field(ge=1.0, le=1000.0)] = 1000.0
    encoder_step: NotNegative | Literal["arm"] = 0.0
    cameras: Literal["fixed", "active"] = "fixed"
    exposure: Annotated[float, Field(ge=0.0, le=0.02)] = 0.0005
    background: Annotated[float, Field(ge=0.0, le=255.0)] = 24.0
    texture: Annotated[float, Field(ge=0.0, le=8.0)] = 3.0
    slope: Annotated[float, Field(ge=0.0, le=120.0)] = 0.0
    lamps: Annotated[tuple[Count, Grey], Field(strict=False)] = (0.0, 220.0)
    windows: Annotated[tuple[Count, Grey], Field(strict=False)] = (0.0, 250.0)
    hot: Annotated[int, Field(ge=0, le=2000)] = 0
    readout: Annotated[float, Field(ge=0.0, le=0.1)] = 0.0
    body: Annotated[float, Field(ge=0.0, le=255.0)] = 12.0
    hand: Annotated[float, Field(ge=0.0, le=255.0)] | None = None
    shading: Annotated[float, Field(ge=0.0, le=0.9)] = 0.0
    grain: Annotated[float, Field(ge=0.0, le=0.9)] = 0.0
    pattern: Annotated[
        tuple[Annotated[float, Field(ge=0.0, le=60.0)], Annotated[float, Field(ge=1.0, le=64.0)]],
        Field(strict=False),
    ] = (0.0, 8.0)
    light: Annotated[
        tuple[Annotated[float, Field(ge=0.0, le=0.5)], Annotated[float, Field(ge=0.0, le=1000.0)]],
        Field(strict=False),
    ] = (0.0, 100.0)
    shadow: Annotated[
        tuple[
            Annotated[float, Field(ge=0.0, le=0.5)], Annotated[float, Field(ge=-1000.0, le=1000.0)]
        ],
        Field(strict=False),
    ] = (0.0, 0.0)
    second: Annotated[tuple[float, float, float, float], Field(strict=False)] | None = None
    second_velocity: Annotated[tuple[float, float, float], Field(strict=False)] = (0.0, 0.0, 0.0)
    views: Annotated[int, Field(ge=0, le=200)] = 0
    corner_noise: Annotated[float, Field(gt=0.0, le=5.0)] = 0.2
    distortion: Annotated[tuple[Bend, Bend], Field(strict=False)] = (0.0, 0.0)
    blur: Annotated[float, Field(ge=0.0, le=3.0)] = 0.0

    @field_validator("views")
    @classmethod
    def _enough(cls, views: int) -> int:
        """Refuse views that leave a calibration open."""
        if 0 < views < 6:
            raise ValueError("0, or at least 6 views")
        return views

    @model_validator(mode="after")
    def _closes(self) -> Self:
        """Refuse a shutter that is still open as the next frame begins."""
        if self.exposure * self.frame_rate > 1.0 + 1e-9:
            raise ValueError("exposure of at most a frame, 1 / frame_rate")
        return self

    @property
    def image_latency(self) -> int:
        """Ticks from the time of an image, the middle of its exposure, to its delivery."""
        half = 0.5 * (self.exposure + self.readout)
        return self.latency + ceil(half / TICK - 0.5)


class Actuation(FileSettings):
    """How commands become torques.

    Attributes:
        delay: Ticks from a command to its effect at the drives and fingers.
        bandwidth: Bandwidth of the drives' torque, of first order [Hz]; 0 follows at once.
        takes: What the robot takes; one that takes no torques has a joint control of its own
            (:mod:`mitt.lab.world.drives`).
        servo: Bandwidth of that control [Hz]; 8 Hz is a choice of this project.
    """

    delay: Annotated[int, Field(ge=0, le=20)] = 0
    bandwidth: Annotated[float, Field(ge=0.0, le=1e5)] = 0.0
    takes: Literal["torque", "velocity", "position"] = "torque"
    servo: Annotated[float, Field(ge=0.5, le=100.0)] = 8.0


class Contact(FileSettings):
    """Contact of ball and hand.

    Attributes:
        friction: Coefficient of sliding friction; that of the ball's material, or 1, if left out.
        restitution: Share of the normal speed that a ball keeps on the palm; that of the ball's
            material on the hand's pads, or a soft contact by ``settle``, if left out.
        settle: Time constant in which a contact without restitution settles [s]; 0.002 is the
            stiffest that steps of 0.5 ms carry.
        tangential: Tangential restitution of a paddle; its rubber's if left out.
        fall: By how much the restitution on a paddle falls with speed [s/m]; its rubber's if left
            out.
    """

    friction: Annotated[float, Field(gt=0.0, le=3.0)] | None = None
    restitution: Annotated[float, Field(ge=0.17, le=0.92)] | None = None
    settle: Annotated[float, Field(ge=0.002, le=0.02)] = 0.004
    tangential: Annotated[float, Field(ge=-0.5, le=0.99)] | None = None
    fall: Annotated[float, Field(ge=0.0, le=0.1)] | None = None


class Belt(FileSettings):
    """A conveyor belt, level and straight.

    Attributes:
        middle: Its middle, where parts are met, seen from above [m].
        direction: Where it leads, from +x towards +y [rad].
        height: Of its surface [m].
        length: Of the straight part [m].
        width: Across [m].
    """

    middle: Annotated[tuple[float, float], Field(strict=False)] = (0.6, 0.0)
    direction: Annotated[float, Field(ge=-7.0, le=7.0)] = 1.5707963267948966
    height: Annotated[float, Field(ge=-5.0, le=5.0)] = -0.1
    length: Annotated[float, Field(gt=0.1, le=100.0)] = 6.0
    width: Annotated[float, Field(gt=0.02, le=10.0)] = 0.3

    @property
    def along(self) -> Array:
        """Where it leads, a unit vector, shape (3,)."""
        return np.array([np.cos(self.direction), np.sin(self.direction), 0.0])


class Tray(FileSettings):
    """A level plate that stands still, for what was met.

    Attributes:
        middle: Its middle, seen from above [m].
        height: Of its surface [m].
        side: Length of each side [m].
    """

    middle: Annotated[tuple[float, float], Field(strict=False)] = (0.0, 0.6)
    height: Annotated[float, Field(ge=-5.0, le=5.0)] = -0.1
    side: Annotated[float, Field(gt=0.02, le=5.0)] = 0.24


class Scene(FileSettings):
    """The world around the catcher; without arguments the scene ``ideal``.

    Attributes:
        base: Name of the scene that it starts from; settings are compared with those.
        ball: What is thrown.
        mismatch: How far the plant is from its model.
        sensing: What the catcher senses, and when.
        actuation: How commands become torques.
        contact: Contact of ball and hand.
        floor: Height of the floor, or of the table that the arm stands on, in the base frame [m].
        belt: A belt that carries what is met; none if left out.
        tray: A tray on which it is put; none if left out.
        faults: What goes wrong in every trial, in the order in which it acts.
    """

    base: SceneName = "ideal"
    ball: Ball = Ball()
    mismatch: Mismatch = Mismatch()
    sensing: Sensing = Sensing()
    actuation: Actuation = Actuation()
    contact: Contact = Contact()
    floor: Annotated[float, Field(ge=-10.0, le=0.0)] = -1.0
    belt: Belt | None = None
    tray: Tray | None = None
    faults: FaultPlan = ()

    @model_validator(mode="after")
    def _shows(self) -> Self:
        """Refuse a ball beyond what 8 bits show before its background."""
        if not 0.0 <= self.sensing.background + self.ball.brightness <= 255.0:
            raise ValueError("sensing.background + ball.brightness in 0..255")
        return self


#: Scene of the recorded flights: a table-tennis ball, its drag as fitted to them.
TABLE_TENNIS = Ball(radius=0.02, mass=0.0027, drag=0.12, hollow=True)


def exact_scene(ball: Ball | None = None) -> Scene:
    """Return a scene without plant mismatch and without noise, for tests and for study."""
    return Scene(
        ball=ball or Ball(),
        mismatch=Mismatch(mass=0.0, viscous=0.0, coulomb=0.0, drag=0.0),
        sensing=Sensing(point_noise=0.0, latency=0),
    )


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
        raise FileError(
            str(path),
            f"a scene file, or one of {', '.join(NAMES)}",
            "neither",
            do=meant(str(path), NAMES),
        )
    return scene_of(read_toml(path), place=str(path), flights=flights)


def scene_from(given: Scene | str | Path | None) -> Scene:
    """Return a scene as a user gives one: itself, its name or file, or the default one for None."""
    if isinstance(given, Scene):
        return given
    if given is not None and not isinstance(given, str | Path):
        raise InputError("scene", "a Scene, or the name or file of one", checks.shown(given))
    return read_scene(DEFAULT_SCENE if given is None else given)


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


def changed_settings(scene: Scene) -> dict[str, Any]:
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
    own = TABLE_TENNIS.model_dump(include={"radius", "mass", "drag", "hollow"})
    return own | kept | material


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
