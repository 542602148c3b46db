"""Settings of the catcher and its phases."""

from dataclasses import dataclass, field
from enum import Enum
from math import inf
from typing import Annotated

from mitt.core.arm.catch import CaughtBall
from mitt.core.arm.shapes import Surroundings
from mitt.core.ball.filter import THROWN_BALL, FilterConfig
from mitt.core.control.encoders import Encoders
from mitt.core.fields import Range, Settings


class Phase(Enum):
    """What the catcher is about."""

    WATCH = "watch"
    FOLLOW = "follow"
    BRAKE = "brake"
    REFUSED = "refused"
    STOPPED = "stopped"


#: The phases in the order of their numbers.
PHASES = tuple(Phase)
#: Those numbers, as the field ``phase`` of a state has them.
WATCH, FOLLOW, BRAKE, REFUSED, STOPPED = range(len(PHASES))
#: What is to be thought about after a tick, as bits of its result: the verdict is open, the ball
#: has left the arm behind, the fingers have closed as far as there is time for, the catcher has
#: stopped, what is followed is to be reviewed, no catch was foreseen for some time (where the ball
#: is and goes then says whether it has passed by), a verdict is being worked out.
DECIDE = 1
LAGS = 2
GRASPS = 4
STOPS = 8
REVIEWS = 16
PASSES = 32
PONDERS = 64
#: Time without a catch ahead after which that is looked into, and for which verdicts have to be
#: against a ball that is followed until the arm brakes [s]: longer than the estimate needs to
#: settle after a bounce or a kick.
PATIENCE = 0.1
#: Time to the catch within which the hand may hide the ball, and it is not taken for lost [s].
SOON = 0.1


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class CatcherSettings(Settings):
    """Settings of the catcher.

    Attributes:
        bandwidth: Bandwidth of the tracking error [rad/s].
        sigma_ready: Predicted 1-sigma at the catch at which the arm starts to move [m].
        watch: Longest time from the start of a flight (seen first, let go or kicked) to the verdict
            [s].
        adapt_q: Gap between desired and true joint angles at which to adapt anew [rad]; at 0
            in each tick.
        adapt_dq: The same for joint speeds [rad/s].
        adapt_until: Time to the catch below which the map is left as it is [s].
        review: Time between two reviews of what is followed [s].
        ball_mass: Mass of the ball, carried by the model while it is held [kg].
        ball_radius: Radius of the ball [m]; the eyes are given the same.
        ball_restitution: Share of its speed with which the ball springs back from the palm.
        ball_friction: Coefficient of friction of ball and hand.
        ball_doubt: Relative error that its mass may have.
        flight: What the filter assumes of the ball's flight.
        around: What stands around the arm and is not to be touched.
        encoders: What is known of the joint encoders.
        tolerance: 1-sigma of the ball's position beyond which an unseen ball is lost [m]; a hand
            needs about 2 cm (Baeuml and others, ICRA 2011).
        max_tracking_error: Gap between commanded and estimated joint angles at which the arm is
            stopped if it lasts 20 ms [rad]; infinite for the map with alpha = 0, which saturates
            for longer.
        torque_lead: Time from the reading of the joints until the torque that is commanded then
            ceases to act [s]: a tick, and what the drives take to answer.
        belt: Direction of the belt whose encoder is read with the senses, a unit vector; sightings
            count from its first reading on. None without one.
        setpoint_delay: Ticks after which a command acts on the joints of a robot that follows
            setpoints, for the encoders' monitor; 0 where torques act.
    """

    bandwidth: Annotated[float, Range(1.0, 1e4)] = 80.0
    sigma_ready: Annotated[float, Range(0.0, inf)] = 0.02
    watch: Annotated[float, Range(0.0, 1e3)] = 0.08
    adapt_q: Annotated[float, Range(0.0, inf)] = 0.06
    adapt_dq: Annotated[float, Range(0.0, inf)] = 1.2
    adapt_until: Annotated[float, Range(0.0, 1e3)] = 0.05
    review: Annotated[float, Range(0.0, 1e3)] = 0.02
    ball_mass: Annotated[float, Range(0.0, 1e3)] = 0.07
    ball_radius: Annotated[float, Range(1e-3, 1.0)] = 0.04
    ball_restitution: Annotated[float, Range(0.0, 1.0)] = 0.2
    ball_friction: Annotated[float, Range(0.0, 100.0)] = 1.0
    ball_doubt: Annotated[float, Range(0.0, 1.0)] = 0.1
    flight: FilterConfig = field(default_factory=lambda: THROWN_BALL)
    around: Surroundings = field(default_factory=Surroundings)
    encoders: Encoders = field(default_factory=Encoders)
    tolerance: Annotated[float, Range(0.0, inf)] = 0.02
    max_tracking_error: Annotated[float, Range(1e-6, inf)] = 0.8
    torque_lead: Annotated[float, Range(0.0, 1.0)] = 0.001
    belt: tuple[float, float, float] | None = None
    setpoint_delay: Annotated[int, Range(0, 1000)] = 0

    @property
    def caught(self) -> CaughtBall:
        """What is known of the ball that is to be caught."""
        return CaughtBall(
            mass=self.ball_mass,
            radius=self.ball_radius,
            restitution=self.ball_restitution,
            friction=self.ball_friction,
            doubt=self.ball_doubt,
        )
