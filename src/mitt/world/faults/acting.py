"""Kinds of disturbances of the plant and of the ball."""

from typing import Annotated, Literal

from pydantic import Field

from mitt.world.faults.entry import Chance, Delay, Entry


class Torque(Entry):
    """Motors weaker than their limit set says (row 18); magnitude: share that is left."""

    kind: Literal["torque"] = "torque"
    magnitude: Annotated[float, Field(ge=0.01, le=1.0)] = 0.5


class Command(Entry):
    """Commands on their way to the motors; magnitude: delay [s].

    Attributes:
        lost: Share of the commands that never arrive; the motors keep the one before.
    """

    kind: Literal["command"] = "command"
    magnitude: Delay = 0.0
    lost: Chance = 0.0


class Payload(Entry):
    """Mass at the hand that no model knows (row 18), all the trial; magnitude: [kg]."""

    kind: Literal["payload"] = "payload"
    magnitude: Annotated[float, Field(ge=0.0, le=20.0)]


class Drag(Entry):
    """Drag that nobody told; magnitude: factor on the ball's drag."""

    kind: Literal["drag"] = "drag"
    magnitude: Annotated[float, Field(ge=0.0, le=20.0)]


class Spin(Entry):
    """A ball that spins about a random axis (Magnus); magnitude: lift per squared speed [1/m]."""

    kind: Literal["spin"] = "spin"
    magnitude: Annotated[float, Field(ge=0.0, le=1.0)]


class Gust(Entry):
    """Wind from a random level direction; magnitude: speed of the air [m/s]."""

    kind: Literal["gust"] = "gust"
    magnitude: Annotated[float, Field(ge=0.0, le=60.0)]


class Kick(Entry):
    """A sudden change of the ball's velocity (row 20) in a random direction; magnitude: [m/s].

    Attributes:
        share: When, as a share of the time until the undisturbed ball is nearest to the catch
            point of the waiting arm; ``start`` then adds to it.
    """

    kind: Literal["kick"] = "kick"
    magnitude: Annotated[float, Field(ge=0.0, le=20.0)]
    share: Annotated[float, Field(ge=0.0, le=2.0)] = 0.7


class Bounce(Entry):
    """A smooth plate in the ball's way (row 20), tilted about a random side; magnitude: angle.

    The plate touches the ball alone and does not hide it. Magnitude is the angle between plate
    and flight [rad]; the ball leaves with its speed along the normal times the restitution.

    Attributes:
        share: Where, as a share of the flight as for a kick.
        restitution: Coefficient of restitution.
        size: Half the side of the square plate [m].
    """

    kind: Literal["bounce"] = "bounce"
    magnitude: Annotated[float, Field(gt=0.0, le=1.5)] = 0.15
    share: Annotated[float, Field(ge=0.0, le=2.0)] = 0.6
    restitution: Chance = 0.7
    size: Annotated[float, Field(gt=0.0, le=5.0)] = 0.5


class Spring(Entry):
    """A ball on a spring instead of a throw; magnitude: its speed in the middle [m/s].

    It is let go at rest where the throw would have been released, and swings about the point of
    that throw nearest to the waiting hand: no gravity, no drag, until it is touched.
    """

    kind: Literal["spring"] = "spring"
    magnitude: Annotated[float, Field(ge=0.5, le=15.0)] = 5.0


class Carried(Entry):
    """A ball carried by somebody's hand instead of a throw; magnitude: its top speed [m/s].

    It starts at rest in the middle of the throw's way, gathers speed smoothly, wanders sideways
    and reaches the point of the throw nearest to the waiting hand at that speed.

    Attributes:
        wander: Amplitude of the wandering [m].
    """

    kind: Literal["carried"] = "carried"
    magnitude: Annotated[float, Field(ge=0.5, le=15.0)] = 2.5
    wander: Annotated[float, Field(ge=0.0, le=0.3)] = 0.03
