"""What happens to the ball: wind, spin, drag, kicks, plates in the way, springs, somebody's hand.

And to a part that is met: its belt changes its speed, it is turned, or taken away.

A fault is one entry of a plan: a class with its fields, and with what it does. :meth:`Fault.begun`
makes of the entry the fault of one trial, which remembers what it did under names that begin with
an underscore. Rows are those of the tests in ``tests/faults``.
"""

from abc import abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import count, islice
from math import cos, exp, pi, sin, sqrt
from typing import Annotated, Literal, NamedTuple, Self, final

import numpy as np
from pydantic import Field

from mitt.core.arm.limits import Limits
from mitt.core.ball.flight import advance
from mitt.core.errors import InputError
from mitt.core.signals import TICK, Array
from mitt.io.schema import FileSettings
from mitt.lab.world.flights import BallPath
from mitt.lab.world.targets import Ride
from mitt.lab.world.throws import Throw, fly, release_velocity

Chance = Annotated[float, Field(ge=0.0, le=1.0)]

#: Steps between instants at which the undisturbed flight is looked at, first and then between
#: them, and how far [s].
_COARSE = 0.02
_FINE = 0.001
_LONGEST = 1.6
#: How far a disturbed flight is flown beforehand [s].
_BEFOREHAND = 2.0
#: Time in which a flutter rises from none [s].
_RISE = 0.1
#: Trials in which a throw on a string is aimed, and the least time that one is reckoned with [s].
_AIMS = 8
_SOONEST = 0.2
#: Factor by which a ball that drag slows down takes longer.
_LATER = 1.05


@dataclass(frozen=True, slots=True, kw_only=True)
class Undisturbed:
    """The flight as it would have been.

    Attributes:
        ball: What is thrown.
        drag: Its drag coefficient [1/m].
        hand: Catch point of the waiting arm [m], shape (3,).
    """

    ball: Throw | BallPath
    drag: float
    hand: Array

    def at(self, t: float) -> tuple[Array, Array]:
        """Return position [m] and velocity [m/s] at a time after release [s]."""
        if not isinstance(self.ball, Throw):
            return self.ball.at(t)
        return fly(self.ball.r, self.ball.dr, drag=self.drag, duration=t)

    def nearest(self) -> float:
        """Return when it is nearest to the waiting hand [s]."""
        coarse = self._nearest(np.arange(0.0, _LONGEST, _COARSE))
        return self._nearest(np.arange(max(coarse - _COARSE, 0.0), coarse + _COARSE, _FINE))

    def _nearest(self, instants: Array) -> float:
        """Return the one of some instants at which it is nearest to the waiting hand [s]."""
        gaps = [float(np.linalg.norm(self.at(float(t))[0] - self.hand)) for t in instants]
        return float(instants[int(np.argmin(gaps))])


class DisturbedTrial(NamedTuple):
    """What a fault may ask of the trial that it happens in.

    Attributes:
        flight: The undisturbed flight.
        limits: Limit set of the arm, if it is known.
        active: Indices of the active joints among those of the limit set.
    """

    flight: Undisturbed
    limits: Limits | None
    active: tuple[int, ...]


class Fault(FileSettings):
    """What all kinds share.

    Attributes:
        start: When it begins, after release [s].
        later: It begins up to so much later, drawn for each trial [s].
        length: How long it lasts [s]; to the end if left out.
    """

    magnitude: float
    start: Annotated[float, Field(ge=0.0, le=60.0)] = 0.0
    later: Annotated[float, Field(ge=0.0, le=60.0)] = 0.0
    length: Annotated[float, Field(gt=0.0, le=60.0)] | None = None

    _rng: np.random.Generator

    def begun(self, rng: np.random.Generator, trial: DisturbedTrial) -> Self:
        """Return a fresh copy that acts in a trial, with a source of randomness of its own."""
        begins = self.start + (rng.uniform(0.0, self.later) if self.later > 0.0 else 0.0)
        fresh = self.model_copy(update={"start": begins})
        fresh._rng = rng
        fresh._begin(trial)
        return fresh

    def _begin(self, trial: DisturbedTrial) -> None:
        """Draw and set what is remembered."""

    @property
    def end(self) -> float:
        """When it is over [s]."""
        return float("inf") if self.length is None else self.start + self.length

    def is_active(self, t: float, *, slack: float = 0.0) -> bool:
        """Tell whether it acts at a time [s]; ``slack`` before its time [s], for rounded times."""
        return self.start - slack <= t < self.end - slack


class Push(Fault):
    """Something that changes the velocity of a flying ball."""

    @abstractmethod
    def act(self, t: float, h: float, r: Array, dr: Array) -> bool:
        """Act from ``t`` for ``h`` [s] on position [m] and velocity [m/s], in place.

        Returns:
            Whether it changed anything.
        """


class _Force(Push):
    """A force that acts as long as its fault does."""

    @abstractmethod
    def _acceleration(self, dr: Array) -> Array:
        """Return the acceleration [m/s^2] at a velocity [m/s], both of shape (3,)."""

    def act(self, t: float, h: float, r: Array, dr: Array) -> bool:
        """Add the force to a step that is still to be flown, to second order."""
        if not self.is_active(t):
            return False
        ddr = self._acceleration(dr)
        dr += h * ddr
        r -= 0.5 * h * h * ddr
        return True


class Spin(_Force):
    """A ball that spins about a random axis (Magnus); magnitude: lift per squared speed [1/m]."""

    kind: Literal["spin"] = "spin"
    magnitude: Annotated[float, Field(ge=0.0, le=1.0)]
    _axis: Array

    def _begin(self, trial: DisturbedTrial) -> None:  # noqa: ARG002
        self._axis = direction(self._rng)

    def _acceleration(self, dr: Array) -> Array:
        return self.magnitude * sqrt((dr * dr).sum()) * np.cross(self._axis, dr)


class _Air(_Force):
    """Wind or another drag, by what it adds to the drag that is known."""

    _nominal: float
    _drag: float
    _wind: Array

    def _begin(self, trial: DisturbedTrial) -> None:
        self._nominal = self._drag = trial.flight.drag
        self._wind = np.zeros(3)

    def _acceleration(self, dr: Array) -> Array:
        past = dr - self._wind
        actual = -self._drag * sqrt((past * past).sum())
        return np.asarray(actual * past + self._nominal * sqrt((dr * dr).sum()) * dr)


class Drag(_Air):
    """Drag that the catcher does not know; magnitude: factor on the ball's drag."""

    kind: Literal["drag"] = "drag"
    magnitude: Annotated[float, Field(ge=0.0, le=20.0)]

    def _begin(self, trial: DisturbedTrial) -> None:
        super()._begin(trial)
        self._drag = self.magnitude * self._nominal


class Gust(_Air):
    """Wind from a random level direction; magnitude: speed of the air [m/s]."""

    kind: Literal["gust"] = "gust"
    magnitude: Annotated[float, Field(ge=0.0, le=60.0)]

    def _begin(self, trial: DisturbedTrial) -> None:
        super()._begin(trial)
        heading = self._rng.uniform(-np.pi, np.pi)
        self._wind[:2] = self.magnitude * np.cos(heading), self.magnitude * np.sin(heading)


class Kick(Push):
    """A sudden change of the ball's velocity in a random direction; magnitude: [m/s].

    Attributes:
        share: When, as a share of the time until the undisturbed ball is nearest to the catch
            point of the waiting arm, plus ``start``.
        before: How much earlier than that [s].
    """

    kind: Literal["kick"] = "kick"
    magnitude: Annotated[float, Field(ge=0.0, le=20.0)]
    share: Annotated[float, Field(ge=0.0, le=2.0)] = 0.7
    before: Annotated[float, Field(ge=0.0, le=2.0)] = 0.0
    _when: float
    _change: Array
    _over: bool = False

    def _begin(self, trial: DisturbedTrial) -> None:
        self._when = self.start + self.share * trial.flight.nearest() - self.before
        self._change = self.magnitude * direction(self._rng)

    def act(self, t: float, h: float, r: Array, dr: Array) -> bool:  # noqa: ARG002
        """Add it in the step in which it is due."""
        if self._over or t + h <= self._when:
            return False
        self._over = True
        dr += self._change
        return True


class Bounce(Push):
    """A smooth plate in the ball's way, tilted about a random side; magnitude: angle.

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
    _centre: Array
    _normal: Array
    _gap: float = np.inf
    _over: bool = False

    def _begin(self, trial: DisturbedTrial) -> None:
        """Put the plate where the ball's centre touches its middle."""
        self._centre, dr = trial.flight.at(self.start + self.share * trial.flight.nearest())
        along = dr / np.linalg.norm(dr)
        side = direction(self._rng)
        side -= (side @ along) * along
        side /= np.linalg.norm(side)
        self._normal = np.cos(self.magnitude) * side - np.sin(self.magnitude) * along

    def act(self, t: float, h: float, r: Array, dr: Array) -> bool:  # noqa: ARG002
        """Turn the velocity about when the ball has come through the plane, once."""
        if self._over:
            return False
        normal, away = self._normal, r - self._centre
        gap = float(normal @ away)
        before, self._gap = self._gap, gap
        if gap >= 0.0 or before < 0.0:
            return False
        self._over = True
        beside = away - gap * normal
        if np.linalg.norm(beside) > self.size:
            return False
        r -= (1.0 + self.restitution) * gap * normal
        dr -= (1.0 + self.restitution) * float(normal @ dr) * normal
        return True


class Taken(Push):
    """A part that somebody takes away, up and to a random side; magnitude: speed [m/s].

    What the tool has touched before is left to it.

    Attributes:
        soon: Time in which that speed is reached [s].
    """

    kind: Literal["taken"] = "taken"
    magnitude: Annotated[float, Field(gt=0.0, le=5.0)] = 0.5
    soon: Annotated[float, Field(gt=0.0, le=2.0)] = 0.1
    _along: Array

    def _begin(self, trial: DisturbedTrial) -> None:  # noqa: ARG002
        angle = self._rng.uniform(-pi, pi)
        self._along = np.array([cos(angle), sin(angle), 1.0]) / sqrt(2.0)

    def act(self, t: float, h: float, r: Array, dr: Array) -> bool:  # noqa: ARG002
        """Give it the speed of the hand that takes it."""
        if not self.is_active(t):
            return False
        share = h / max(self.start + self.soon - t, h)
        dr += share * (self.magnitude * self._along - dr)
        return True


class Turned(Fault):
    """A part that is turned about the vertical; magnitude: angle [rad]."""

    kind: Literal["turned"] = "turned"
    magnitude: Annotated[float, Field(ge=-pi, le=pi)] = pi / 4.0
    length: Annotated[float, Field(gt=0.0, le=60.0)] = 0.2

    def rate(self, t: float) -> float | None:
        """Return how fast it is turned at a time [rad/s]; None where it is let alone."""
        return self.magnitude / self.length if self.is_active(t) else None


class Replacement(Fault):
    """A ball that is led along a path instead of being thrown."""

    @abstractmethod
    def path(self, flight: Undisturbed) -> BallPath:
        """Return its path in place of a flight."""


class BeltChange(Replacement):
    """A belt of another speed; magnitude: factor, 0 for one that stops, negative to run back."""

    kind: Literal["belt"] = "belt"
    magnitude: Annotated[float, Field(ge=-5.0, le=5.0)] = 0.0

    def path(self, flight: Undisturbed) -> BallPath:
        """Return the ride on such a belt.

        Raises:
            InputError: No belt carries what comes.
        """
        if not isinstance(flight.ball, Ride):
            raise InputError("fault belt", "a part that rides on a belt", "another target")
        return flight.ball.changed(self.magnitude, self.start, self.end)


class Spring(Replacement):
    """A ball on a spring instead of a throw; magnitude: its speed in the middle [m/s].

    It starts at rest where the throw would have been released, and swings about the point of
    that throw nearest to the waiting hand, without gravity and drag, until it is touched.
    """

    kind: Literal["spring"] = "spring"
    magnitude: Annotated[float, Field(ge=0.5, le=15.0)] = 5.0

    def path(self, flight: Undisturbed) -> BallPath:
        """Return a harmonic motion from rest."""
        goal = flight.at(flight.nearest())[0]
        out = flight.at(0.0)[0] - goal
        return _Swing(centre=goal, out=out, rate=self.magnitude / float(np.linalg.norm(out)))


class Carried(Replacement):
    """A ball carried by somebody's hand instead of a throw; magnitude: its top speed [m/s].

    It starts at rest in the middle of the throw's way, gathers speed smoothly, wanders sideways
    by ``wander`` [m] and reaches the point of the throw nearest to the waiting hand at that speed.

    Attributes:
        wander: How far it wanders [m].
    """

    kind: Literal["carried"] = "carried"
    magnitude: Annotated[float, Field(ge=0.5, le=15.0)] = 2.5
    wander: Annotated[float, Field(ge=0.0, le=0.3)] = 0.03

    def path(self, flight: Undisturbed) -> BallPath:
        """Return a walk that starts without a jump and ends on its line."""
        goal = flight.at(flight.nearest())[0]
        start = 0.5 * (flight.at(0.0)[0] + goal)
        along = goal - start
        length = float(np.linalg.norm(along))
        along = along / length
        across = np.cross(along, (0.0, 0.0, 1.0))
        across /= np.linalg.norm(across)
        rates = self._rng.uniform(0.6, 1.6, 2) * 2.0 * pi
        return _Walk(
            start=start,
            along=along,
            speed=self.magnitude,
            run_up=min(0.3, length / self.magnitude),
            sway=0.5 * self.wander * np.array([across, np.cross(across, along)]),
            rates=(float(rates[0]), float(rates[1])),
        )


class Flutter(Replacement):
    """A ball that flutters about its path, as a leaf or a butterfly; magnitude: [m/s^2].

    Magnitude is the standard deviation of a random acceleration along each axis (an
    Ornstein-Uhlenbeck process, which rises from none in 0.1 s). A soft pull leads back to the path.

    Attributes:
        correlation: Time in which the acceleration forgets what it was [s].
        pull: Rate of the pull, damped by half [rad/s].
    """

    kind: Literal["flutter"] = "flutter"
    magnitude: Annotated[float, Field(ge=0.0, le=200.0)] = 20.0
    correlation: Annotated[float, Field(ge=0.005, le=5.0)] = 0.05
    pull: Annotated[float, Field(ge=0.0, le=50.0)] = 10.0

    def path(self, flight: Undisturbed) -> BallPath:
        """Return the path about which it flutters, and how far it is off at each tick."""
        ticks, keeps = round(_BEFOREHAND / TICK), exp(-TICK / self.correlation)
        drawn = self.magnitude * self._rng.standard_normal((ticks + 1, 3))
        ddr, off = drawn[0], np.zeros((ticks + 1, 2, 3))
        for k in range(ticks):
            r, dr = off[k]
            risen = min(k * TICK / _RISE, 1.0)
            pulled = risen * ddr - self.pull * dr - self.pull * self.pull * r
            off[k + 1, 1] = dr + TICK * pulled
            off[k + 1, 0] = r + 0.5 * TICK * (dr + off[k + 1, 1])
            ddr = keeps * ddr + sqrt(1.0 - keeps * keeps) * drawn[k + 1]
        return _Fluttering(about=flight, off=off)


class Elastic(Replacement):
    """A ball on an elastic string that is tied to where it was thrown; magnitude: [1/s^2].

    Magnitude is the string's stiffness by the ball's mass. It pulls from a length on that is
    drawn for each trial. The ball is thrown so that it still passes where the throw was nearest to
    the waiting hand.

    Attributes:
        slack: Least share of that distance at which the string begins to pull.
        slackest: Largest such share.
    """

    kind: Literal["elastic"] = "elastic"
    magnitude: Annotated[float, Field(ge=0.0, le=1000.0)] = 25.0
    slack: Annotated[float, Field(ge=0.0, le=1.0)] = 0.5
    slackest: Annotated[float, Field(ge=0.0, le=1.0)] = 0.8

    def path(self, flight: Undisturbed) -> BallPath:
        """Return its flight, aimed by a few trials."""
        start, dr = flight.at(0.0)
        goal = flight.at(flight.nearest())[0]
        share = self._rng.uniform(self.slack, max(self.slackest, self.slack))
        length = share * float(np.linalg.norm(goal - start))
        for _ in range(_AIMS):
            flown = self._flown(flight.drag, start, dr, length)
            k = int(np.argmin(np.sum((flown.r - goal) ** 2, axis=1)))
            dr = dr + (goal - flown.r[k]) / max(k * TICK, _SOONEST)
        return self._flown(flight.drag, start, dr, length)

    def _flown(self, drag: float, start: Array, dr: Array, length: float) -> "DisturbedFlight":
        """Return the flight from a start with a velocity, and a string of a length [m]."""
        ticks = round(_BEFOREHAND / TICK)
        rows = np.empty((ticks + 1, 2, 3))
        rows[0] = start, dr
        for k in range(ticks):
            rows[k + 1] = rows[k]
            away = rows[k, 0] - start
            far = float(np.linalg.norm(away))
            if far > length:
                rows[k + 1, 1] -= TICK * self.magnitude * (1.0 - length / far) * away
            advance(rows[k + 1, 0], rows[k + 1, 1], drag, TICK)
        return DisturbedFlight(r=rows[:, 0], dr=rows[:, 1], drag=drag)


class Light(Replacement):
    """A ball lighter than believed, thrown to pass the same place; magnitude: drag [1/m].

    A shuttlecock has about 0.2, a ball of paper 0.5. It takes longer by a twentieth, and comes
    more steeply.
    """

    kind: Literal["light"] = "light"
    magnitude: Annotated[float, Field(ge=0.0, le=2.0)] = 0.2

    def path(self, flight: Undisturbed) -> BallPath:
        """Return its flight, slower at the end."""
        start, after = flight.at(0.0)[0], flight.nearest()
        goal = flight.at(after)[0]
        dr = release_velocity(start, goal, drag=self.magnitude, duration=_LATER * after)
        return _Flown(r=start, dr=dr, drag=self.magnitude)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class _Flown:
    """A free flight: position [m] and velocity [m/s] at its start, and its drag [1/m]."""

    r: Array
    dr: Array
    drag: float

    def at(self, t: float) -> tuple[Array, Array]:
        """Position [m], shape (3,), and velocity [m/s], shape (3,), ``t`` s after release."""
        return fly(self.r, self.dr, drag=self.drag, duration=t)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class _Fluttering:
    """A path with what is added to it, position [m] and velocity [m/s] a tick, shape (k, 2, 3)."""

    about: Undisturbed
    off: Array

    def at(self, t: float) -> tuple[Array, Array]:
        """Position [m], shape (3,), and velocity [m/s], shape (3,), ``t`` s after release."""
        r, dr = self.about.at(t)
        k = min(max(int(t / TICK + 1e-6), 0), len(self.off) - 1)
        off, rate = self.off[k]
        return r + off + min(max(t - k * TICK, 0.0), TICK) * rate, dr + rate


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class _Swing:
    """A harmonic motion from rest.

    Attributes:
        centre: Its middle [m], shape (3,).
        out: From the middle to where it is let go [m], shape (3,).
        rate: Angular frequency [rad/s].
    """

    centre: Array
    out: Array
    rate: float

    def at(self, t: float) -> tuple[Array, Array]:
        """Position [m], shape (3,), and velocity [m/s], shape (3,), ``t`` s after release."""
        r = self.centre + cos(self.rate * t) * self.out
        return r, -self.rate * sin(self.rate * t) * self.out


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class _Walk:
    """A motion by hand: smoothly up to a speed along a line, with sideways wandering.

    Attributes:
        start: Where it begins [m], shape (3,).
        along: Unit direction of the line, shape (3,).
        speed: Speed after the run-up [m/s].
        run_up: Duration of the run-up [s].
        sway: Directions and amplitudes of the wandering [m], shape (2, 3).
        rates: Its angular frequencies [rad/s].
    """

    start: Array
    along: Array
    speed: float
    run_up: float
    sway: Array
    rates: tuple[float, float]

    def at(self, t: float) -> tuple[Array, Array]:
        """Position [m], shape (3,), and velocity [m/s], shape (3,), ``t`` s after release."""
        s = min(max(t / self.run_up, 0.0), 1.0)
        run_up = self.run_up * (s * s * s - 0.5 * (s * s * (s * s)))
        way = self.speed * (run_up + max(t - self.run_up, 0.0))
        r = self.start + way * self.along
        dr = self.speed * (3.0 * (s * s) - 2.0 * (s * s * s)) * self.along
        for rate, sway in zip(self.rates, self.sway, strict=True):
            r += (1.0 - cos(rate * t)) * sway
            dr += rate * sin(rate * t) * sway
        return r, dr


@final
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DisturbedFlight:
    """A flight by its states at each tick.

    Attributes:
        r: Positions [m], shape (k, 3).
        dr: Velocities [m/s], shape (k, 3).
        drag: Drag of the flight after the last [1/m].
    """

    r: Array
    dr: Array
    drag: float

    def at(self, t: float) -> tuple[Array, Array]:
        """Position [m], shape (3,), and velocity [m/s], shape (3,), ``t`` s after release."""
        k = min(max(int(t / TICK), 0), len(self.r) - 1)
        return fly(self.r[k], self.dr[k], drag=self.drag, duration=t - k * TICK)


def disturbed_states(
    ball: Throw | BallPath, pushes: Sequence[Push], *, drag: float
) -> Iterator[tuple[Array, Array]]:
    """Fly a ball through its disturbances; return position [m], velocity [m/s] tick by tick.

    Args:
        ball: What comes at the arm.
        pushes: What disturbs it, a fresh copy: they remember what they did.
        drag: Drag coefficient that acts [1/m].
    """
    path = None if isinstance(ball, Throw) else ball
    r, dr = (ball.r.copy(), ball.dr.copy()) if isinstance(ball, Throw) else ball.at(0.0)
    for k in count():
        yield r.copy(), dr.copy()
        changed = [push.act(k * TICK, TICK, r, dr) for push in pushes]
        path = None if any(changed) else path
        if path is None:
            advance(r, dr, drag, TICK)
        else:
            r, dr = path.at((k + 1) * TICK)


def disturbed_flight(
    ball: Throw | BallPath, pushes: Sequence[Push], *, drag: float
) -> DisturbedFlight:
    """Return a flight through its disturbances, as far as anybody looks ahead.

    Arguments as of :func:`disturbed_states`.
    """
    ticks = round(_BEFOREHAND / TICK) + 1
    states = islice(disturbed_states(ball, pushes, drag=drag), ticks)
    positions, velocities = (np.array(column) for column in zip(*states, strict=True))
    return DisturbedFlight(r=positions, dr=velocities, drag=drag)


def direction(rng: np.random.Generator) -> Array:
    """Return a unit vector of any direction, shape (3,)."""
    v = rng.standard_normal(3)
    return np.asarray(v / np.linalg.norm(v))
