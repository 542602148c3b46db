"""The catcher: from images and encoders to torques and fingers, once a millisecond.

    Frame x2 -> Moments x2 -> Sighting -> BallState -> JointReference -> Command

The only module that knows the order of the stages. It takes senses and gives commands, so it does
not know whether a simulated world or a real arm is at the other end.
"""

from dataclasses import dataclass, field, replace
from enum import Enum
from typing import final

import numpy as np

from mitt.control.brake import Brake, plan_brake, short_of_room
from mitt.control.hand import Closing
from mitt.control.tracking import Tracked, Tracker, largest_gap
from mitt.generator.certificate import Outcome, Verdict
from mitt.generator.generators import Generator
from mitt.robot.arm import Arm
from mitt.signals import (
    ArmState,
    Array,
    BallState,
    Command,
    JointReference,
    MapStatus,
    Senses,
    Sighting,
)
from mitt.vision.eyes import Eyes
from mitt.vision.filter import THROWN_BALL, BallFilter, FilterConfig

PERIOD = 0.001
"""Time for which a command acts [s]."""


class Phase(Enum):
    """What the catcher is about."""

    WATCH = "watch"
    FOLLOW = "follow"
    BRAKE = "brake"
    REFUSED = "refused"


@dataclass(frozen=True, slots=True, kw_only=True)
class CatcherSettings:
    """Settings of the catcher.

    Attributes:
        bandwidth: Bandwidth of the tracking error [rad/s].
        sigma_ready: Predicted 1-sigma at the catch at which the arm starts to move [m].
        watch: Longest time from first sight to the verdict [s].
        adapt_q: Gap between desired and true joint angles at which to adapt anew [rad].
        adapt_dq: The same for joint speeds [rad/s].
        adapt_until: Time to the catch below which the map is left as it is [s].
        ball_mass: Mass of the ball, carried by the model while it is held [kg].
        ball_radius: Radius of the ball [m]; the eyes are told the same.
        flight: What the filter believes of the ball's flight.
    """

    bandwidth: float = 80.0
    sigma_ready: float = 0.02
    watch: float = 0.08
    adapt_q: float = 0.06
    adapt_dq: float = 1.2
    adapt_until: float = 0.05
    ball_mass: float = 0.07
    ball_radius: float = 0.04
    flight: FilterConfig = field(default_factory=lambda: THROWN_BALL)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tick:
    """All that one tick brought about.

    Attributes:
        phase: Phase after the tick.
        ball: Estimate of the ball, carried to the time of the command.
        reference: What the generator asked for, before any limit; None while it is not asked.
        tracked: Command and its parts.
    """

    phase: Phase
    ball: BallState
    reference: JointReference | None
    tracked: Tracked


@final
class Catcher:
    """Lets an arm catch; one object a throw.

    Attributes:
        verdict: Verdict on the throw, once given.
        t_0: Time at which the arm began to move [s]; infinite before.
        tick: What the last tick brought about; None before the first.
    """

    def __init__(
        self, arm: Arm, generator: Generator, eyes: Eyes, *, settings: CatcherSettings
    ) -> None:
        """Take the arm, the generator and the eyes."""
        self._arm, self._generator, self._eyes, self._settings = arm, generator, eyes, settings
        self._filter = BallFilter(settings.flight)
        self._tracker = Tracker(arm, bandwidth=settings.bandwidth)
        self._closing = Closing(arm.model.hand, ball_radius=settings.ball_radius)
        self._phase = Phase.WATCH
        self._wanted = np.array([arm.q_ready, np.zeros(arm.n), np.zeros(arm.n)])
        self._brake: Brake | None = None
        self._open = False
        self.verdict: Verdict | None = None
        self.t_0 = np.inf
        self.tick: Tick | None = None

    @property
    def looking(self) -> bool:
        """Whether the catcher wants images; none once its hand has closed."""
        return self._phase is not Phase.BRAKE

    def step(self, senses: Senses) -> Command:
        """See, estimate, generate, close, track: one tick."""
        believed = self._tracker.believed(senses.arm)
        if believed is not senses.arm:
            senses = replace(senses, arm=believed)
        ball = self._estimate(self._see(senses), senses.t)
        reference = self._generate(ball, senses)
        hand = self._closing.step(senses.t, self._time_to_catch(reference))
        tracked = self._tracker.step(senses.arm, self._wanted, hand=hand)
        self.tick = Tick(phase=self._phase, ball=ball, reference=reference, tracked=tracked)
        gaze = self._eyes.gaze(ball, senses.t + PERIOD)
        return tracked.command if gaze is None else replace(tracked.command, gaze=gaze)

    def _see(self, senses: Senses) -> tuple[Sighting, ...]:
        """Return the new sightings, from images or from points; none once the hand has closed."""
        if not self.looking:
            return ()
        if senses.frames:
            return (self._eyes.step(senses.frames),)
        return senses.points

    def _estimate(self, sightings: tuple[Sighting, ...], t: float) -> BallState:
        """Take in the sightings and carry the estimate to the time of the command.

        Once the hand has closed the ball is where the hand is, and the estimate stays.
        """
        if not self.looking and self.tick is not None:
            return self.tick.ball
        for sighting in sightings:
            self._filter.update(sighting)
        return self._filter.state(t)

    def _generate(self, ball: BallState, senses: Senses) -> JointReference | None:
        """Set the wanted motion for this tick, by phase."""
        if self._phase is Phase.WATCH and ball.tracked:
            self._watch(ball, senses)
        if self._phase is Phase.FOLLOW:
            ball = self._believed(ball, senses.arm)
            reference = self._readapted(self._generator.reference(ball), ball, senses.arm)
            self._follow(reference)
            hurry = short_of_room(self._arm, self._wanted) if self._closing.started else False
            if self._closing.closed(senses.t, hurry=hurry):
                self._start_braking(senses.t)
            return reference
        if self._brake is not None and not self._brake.over(senses.t):
            self._wanted = self._brake.at(senses.t)
        return None

    def _watch(self, ball: BallState, senses: Senses) -> None:
        """Give the verdict once the ball is known well enough, or when it is due."""
        due = ball.t - ball.t_first >= self._settings.watch
        if not due and self._generator.sharpness(ball) > self._settings.sigma_ready:
            return
        self.verdict = verdict = self._generator.verdict(ball, senses.arm.q)
        if verdict.outcome is Outcome.UNREACHABLE:
            self._phase = Phase.REFUSED
            return
        self._open = verdict.outcome is Outcome.OPEN
        ball = self._generator.waiting(ball) if self._open else ball
        self._generator = self._generator.adapt(ball, senses.arm.q, senses.arm.dq)
        self._phase, self.t_0 = Phase.FOLLOW, senses.t

    def _believed(self, ball: BallState, arm: ArmState) -> BallState:
        """Return the ball to follow: the estimate, or its stand-in while the verdict is open."""
        if not self._open:
            return ball
        if not self._generator.returns(ball):
            return self._generator.waiting(ball)
        self._open = False
        self._generator = self._generator.adapt(ball, arm.q, arm.dq)
        return ball

    def _readapted(
        self, reference: JointReference, ball: BallState, arm: ArmState
    ) -> JointReference:
        """Adapt the generator anew where the ball has left the arm behind, as after a bounce.

        The map then starts again from where the arm is and how fast it moves, eq. (12), and the
        gap is closed on the way to the catch instead of by feedback at once.
        """
        if reference.status is not MapStatus.INSIDE:
            return reference
        if reference.time_to_catch < self._settings.adapt_until:
            return reference
        gap = largest_gap(reference.q_d, arm.q) / self._settings.adapt_q
        lag = largest_gap(reference.dq_d, arm.dq) / self._settings.adapt_dq
        if max(gap, lag) < 1.0:
            return reference
        self._generator = self._generator.adapt(ball, arm.q, arm.dq)
        return self._generator.reference(ball)

    def _follow(self, reference: JointReference) -> None:
        """Want what the generator asks; outside its domain, stay where the arm was wanted."""
        if reference.status is MapStatus.INSIDE:
            self._wanted = np.array([reference.q_d, reference.dq_d, reference.ddq_d])
        else:
            self._wanted = np.array([self._wanted[0], *np.zeros((2, self._arm.n))])

    def _start_braking(self, t: float) -> None:
        """Plan the stop from the last command, with the ball's weight in the model."""
        loaded = self._arm.holding(self._settings.ball_mass)
        self._tracker = Tracker(loaded, bandwidth=self._settings.bandwidth)
        self._brake = plan_brake(loaded, t, self._last_command())
        self._wanted = self._brake.at(t)
        self._phase = Phase.BRAKE

    def _last_command(self) -> Array:
        """Return q, dq, ddq of the last command, shape (3, n)."""
        if self.tick is None:
            return self._wanted
        command = self.tick.tracked.command
        return np.array([command.q, command.dq, command.ddq])

    def _time_to_catch(self, reference: JointReference | None) -> float:
        """Return the time to the catch [s]; infinite while nothing is being followed."""
        if reference is None or reference.status is not MapStatus.INSIDE:
            return np.inf
        return reference.time_to_catch
