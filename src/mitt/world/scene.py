"""Settings of the simulated world, from code or from a TOML file.

What the catcher is not told: how heavy the links really are, how much the joints rub, how good
the sensors are. Every figure without a source is a choice of this project.
"""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from mitt.reading import read_toml
from mitt.world.faults.plan import FaultPlan
from mitt.world.settings import Settings, validated

NotNegative = Annotated[float, Field(ge=0.0)]
Share = Annotated[float, Field(ge=0.0, lt=0.5)]


class Ball(Settings):
    """What is thrown; facts.md, section 4.

    Attributes:
        radius: Radius [m].
        mass: Mass [kg].
        drag: Quadratic drag coefficient k [1/m].
        brightness: Brightness above the background of 24 [grey levels]; both fit into 8 bits.
    """

    radius: Annotated[float, Field(ge=0.005, le=0.06)] = 0.04
    mass: Annotated[float, Field(ge=0.001, le=2.0)] = 0.07
    drag: Annotated[float, Field(ge=0.0, le=1.0)] = 0.04
    brightness: Annotated[float, Field(gt=0.0, le=231.0)] = 160.0


class Mismatch(Settings):
    """How far the plant is from the model of the catcher, drawn anew from each trial's seed.

    Attributes:
        mass: Half-width of each link's relative mass error.
        viscous: Largest viscous friction of a joint [N m s/rad].
        coulomb: Largest dry friction of a joint [N m].
        drag: Half-width of the relative error of the ball's drag.
    """

    mass: Share = 0.05
    viscous: NotNegative = 0.1
    coulomb: NotNegative = 0.5
    drag: Share = 0.10


class Sensing(Settings):
    """What the catcher is told, and when.

    Attributes:
        point_noise: Noise of points, 1 sigma an axis [m].
        latency: Ticks from the exposure of a frame or point to its delivery.
        encoder_step: Resolution of the joint encoders [rad]; 0 is exact.
        cameras: Cameras that stand still and see all, or that pan-tilt heads turn to the ball.
        exposure: How long a shutter is open [s].
        texture: Standard deviation of the background's brightness [grey levels].
        body: Grey level of arm and hand in the images; the background has 24.
        second: A second bright ball that stands still: centre and radius [m].
    """

    point_noise: NotNegative = 0.001
    latency: Annotated[int, Field(ge=0, le=20)] = 1
    encoder_step: NotNegative = 0.0
    cameras: Literal["fixed", "active"] = "fixed"
    exposure: Annotated[float, Field(ge=0.0, le=0.001)] = 0.0005
    texture: Annotated[float, Field(ge=0.0, le=8.0)] = 3.0
    body: Annotated[float, Field(ge=0.0, le=255.0)] = 12.0
    second: Annotated[tuple[float, float, float, float], Field(strict=False)] | None = None


class Contact(Settings):
    """Contact of ball and hand.

    Attributes:
        friction: Coefficient of sliding friction.
        settle: Time constant in which a contact settles [s]; 0.002 is the stiffest that steps
            of 0.5 ms carry.
    """

    friction: Annotated[float, Field(gt=0.0, le=3.0)] = 1.0
    settle: Annotated[float, Field(ge=0.002, le=0.02)] = 0.004


class Scene(Settings):
    """The world around the catcher.

    Attributes:
        ball: What is thrown.
        mismatch: How far the plant is from its model.
        sensing: What the catcher is told, and when.
        contact: Contact of ball and hand.
        floor: Height of the floor below the shoulder, negative [m]; the arm is on a stand.
        faults: What goes wrong in every trial, in the order in which it acts.
    """

    ball: Ball = Ball()
    mismatch: Mismatch = Mismatch()
    sensing: Sensing = Sensing()
    contact: Contact = Contact()
    floor: Annotated[float, Field(ge=-10.0, le=-0.5)] = -1.0
    faults: FaultPlan = ()


#: Scene of the recorded flights: a table-tennis ball, facts.md, section 4.
TABLE_TENNIS = Ball(radius=0.02, mass=0.0027, drag=0.12)


def exact_scene(ball: Ball | None = None) -> Scene:
    """Return a scene without plant mismatch and without noise, for tests and for study."""
    return Scene(
        ball=ball or Ball(),
        mismatch=Mismatch(mass=0.0, viscous=0.0, coulomb=0.0, drag=0.0),
        sensing=Sensing(point_noise=0.0, latency=0),
    )


def read_scene(path: Path) -> Scene:
    """Read a scene from a TOML file; keys that are left out keep their defaults.

    Raises:
        FileError: The file cannot be read or is no TOML.
        InputError: A key is unknown or its value cannot be used; the message names both.
    """
    return validated(Scene, read_toml(path), place=str(path))
