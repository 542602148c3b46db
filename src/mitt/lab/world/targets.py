"""What moves within reach: things in a hand, parts on a belt.

A reach of a hand is a motion of least jerk (T. Flash and N. Hogan, J. Neuroscience 5, 1985); where
the person changes their mind, the motion of least jerk to the new place is added to the one under
way (E. Flash and T. Henis, J. Cognitive Neuroscience 3, 1991). A steady hand trembles at 8 to 12 Hz
by a tenth of a millimetre to one (R. Elble and W. Koller, Tremor, 1990).
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace

import numpy as np

from mitt.core.signals import Array
from mitt.lab.world.flights import CATCH_FRACTION, RecordedFlight, placing

#: Frequencies of a hand's tremor [Hz], and its amplitude at most [m].
_TREMOR = (8.0, 12.0)
_SHAKES = 3e-4
#: A reach, by choices of this project: its length [m], the most changes of mind, and the standard
#: deviation of each, an axis [m].
_REACH = 0.6
_CHANGES = 3
_OFF = 0.06
#: A belt: half-width of the relative changes of its speed, and about how long before it comes by
#: the middle a part appears [s]; choices too.
_VARIES = 0.3
_AHEAD = 1.6
#: Times at which a recorded motion is smoothed, the half width of the window [s], and the least
#: number of samples in it.
_STEP = 0.005
_WINDOW = 0.05
_FEWEST = 7
#: Time constant with which a thing comes to rest at the end of its recording [s].
_FADES = 0.3


class InHand(ABC):
    """A thing in the hand of a person, who holds it until the tool has it.

    Attributes:
        orientation: How it is held: columns are its axes, shape (3, 3).
    """

    __slots__ = ()
    orientation: Array

    @abstractmethod
    def at(self, t: float) -> tuple[Array, Array]:
        """Position [m], shape (3,), and velocity [m/s], shape (3,), at ``t`` [s]."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HandReach(InHand):
    """A thing in a hand: from place to place by motions of least jerk.

    Attributes:
        start: Where it rests at first [m], shape (3,).
        way: Each motion's way [m], shape (k, 3).
        begin: When each begins [s], shape (k,).
        duration: How long each takes [s], shape (k,).
        tremor: Amplitude, frequency [rad/s] and phase of the tremor along each axis, shape (3, 3).
        orientation: As of :class:`InHand`.
    """

    start: Array
    way: Array
    begin: Array
    duration: Array
    tremor: Array
    orientation: Array = field(default_factory=lambda: np.eye(3))

    def at(self, t: float) -> tuple[Array, Array]:
        """Position [m], shape (3,), and velocity [m/s], shape (3,), at ``t`` [s]."""
        x = np.clip((t - self.begin) / self.duration, 0.0, 1.0)
        share = x**3 * (10.0 - 15.0 * x + 6.0 * x * x)
        rate = 30.0 * (x * (1.0 - x)) ** 2 / self.duration
        amplitude, omega, phase = self.tremor
        r = self.start + share @ self.way + amplitude * np.sin(omega * t + phase)
        dr = rate @ self.way + amplitude * omega * np.cos(omega * t + phase)
        return r, dr


def drawn_reach(
    rng: np.random.Generator, *, to: Array, speed: float, within: tuple[Array, Array] | None = None
) -> HandReach:
    """Return a reach towards a place, with changes of mind.

    Args:
        rng: Source of the draw.
        to: Where it leads at first [m], shape (3,).
        speed: Largest speed [m/s].
        within: Lowest and highest corner of where the person offers it [m], shape (3,) each.
    """
    angle, height = rng.uniform(-0.6, 0.6), rng.uniform(-0.3, 0.3)
    along = np.array([np.cos(angle), np.sin(angle), height])
    along *= _REACH / np.linalg.norm(along)
    count = int(rng.integers(1, _CHANGES + 1))
    first = 1.875 * _REACH / (speed * rng.uniform(0.6, 1.0))
    begin = np.concatenate([[0.3], 0.3 + first * rng.uniform(0.3, 1.1, count)])
    off = np.cumsum(_OFF * rng.standard_normal((count, 3)), axis=0)
    ends = np.concatenate([[to], to + off])
    ends = ends if within is None else np.clip(ends, *within)
    way = np.diff(ends, axis=0, prepend=[to + along])
    shorter = np.full(count, 0.5)
    waves = np.array(
        [
            _SHAKES * rng.uniform(0.3, 1.0, 3),
            2.0 * np.pi * rng.uniform(*_TREMOR, 3),
            rng.uniform(0.0, 2.0 * np.pi, 3),
        ]
    )
    return HandReach(
        start=to + along,
        way=way,
        begin=begin,
        duration=np.concatenate([[first], shorter]),
        tremor=waves,
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RecordedMotion(InHand):
    """A thing that moves as one was recorded, and comes to rest after the last sample.

    Attributes:
        name: Name of the recording.
        r: Positions at even times from 0 on [m], shape (k, 3).
        dr: Velocities [m/s], shape (k, 3).
        orientation: As of :class:`InHand`.
    """

    name: str
    r: Array
    dr: Array
    orientation: Array = field(default_factory=lambda: np.eye(3))

    @property
    def duration(self) -> float:
        """Time of the last sample [s]."""
        return _STEP * (len(self.r) - 1)

    def at(self, t: float) -> tuple[Array, Array]:
        """Position [m], shape (3,), and velocity [m/s], shape (3,), at ``t`` [s]."""
        k = min(max(int(t / _STEP), 0), len(self.r) - 2)
        x = t / _STEP - k
        if x > 1.0:
            left = np.exp(-(x - 1.0) * _STEP / _FADES)
            return self.r[-1] + (1.0 - left) * _FADES * self.dr[-1], left * self.dr[-1]
        (a, b), (u, v) = self.r[k : k + 2], _STEP * self.dr[k : k + 2]
        square, cube = 3.0 * (b - a) - 2.0 * u - v, 2.0 * (a - b) + u + v
        r = a + x * (u + x * (square + x * cube))
        return r, (u + x * (2.0 * square + 3.0 * x * cube)) / _STEP


def recorded(
    recording: RecordedFlight, place: Array, rng: np.random.Generator | None
) -> RecordedMotion:
    """Return a recorded motion before an arm, as recorded flights are placed.

    It is smoothed by parabolas, each fitted to the samples about its time. Samples that are farther
    apart than the window are few: then the window is as wide as it has to be.

    Args:
        recording: The motion.
        place: Where it is after three quarters of its time [m], shape (3,).
        rng: Source of the jitter; none if None.
    """
    t, rows = recording.t, []
    for now in np.arange(0.0, float(t[-1]) + 0.5 * _STEP, _STEP):
        k = int(np.searchsorted(t, now))
        beside = np.sort(np.abs(t[max(k - _FEWEST, 0) : k + _FEWEST] - now))
        wide = max(_WINDOW, 1.001 * float(beside[_FEWEST - 1]))
        near = slice(*np.searchsorted(t, (now - wide, now + wide)).tolist())
        away = np.minimum(np.abs(t[near] - now) / wide, 1.0)
        weight = (1.0 - away**3) ** 1.5  # the root of the tricube
        powers = weight[:, None] * np.vander(t[near] - now, 3, increasing=True)
        given = weight[:, None] * recording.r[near]
        rows.append(np.linalg.lstsq(powers, given, rcond=None)[0][:2])
    r, dr = np.moveaxis(np.array(rows), 1, 0)
    anchor = r[min(round(CATCH_FRACTION * float(t[-1]) / _STEP), len(r) - 1)]
    rotation, shift = placing(recording.r[-1] - recording.r[0], anchor, place, rng)
    return RecordedMotion(name=recording.name, r=r @ rotation.T + shift, dr=dr @ rotation.T)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Ride:
    """A part that rides on a belt.

    Attributes:
        start: Where its middle is at first [m], shape (3,).
        along: Direction of the belt, a unit vector, shape (3,).
        begin: From when each change of speed goes on [s], rising, shape (k,).
        speeds: Of the belt before the first change and after each [m/s], shape (k + 1,).
        change: How long a change takes [s].
        yaw: How far the part is turned on the belt [rad].
    """

    start: Array
    along: Array
    begin: Array
    speeds: Array
    change: float = 0.2
    yaw: float = 0.0

    def speed(self, t: float) -> float:
        """Return the belt's speed at ``t`` [m/s]."""
        x = np.clip((t - self.begin) / self.change, 0.0, 1.0)
        return float(self.speeds[0] + (x * x * (3.0 - 2.0 * x)) @ np.diff(self.speeds))

    def travel(self, t: float) -> float:
        """Return how far the belt has travelled at ``t`` [m]."""
        x = np.clip((t - self.begin) / self.change, 0.0, None)
        low, over = np.minimum(x, 1.0), np.maximum(x - 1.0, 0.0)
        way = self.change * (low**3 - 0.5 * low**4 + over)
        return float(self.speeds[0] * t + way @ np.diff(self.speeds))

    def at(self, t: float) -> tuple[Array, Array]:
        """Position [m] and velocity [m/s], shape (3,) each, of a part that does not slip."""
        return self.start + self.travel(t) * self.along, self.speed(t) * self.along

    def changed(self, factor: float, begin: float, end: float) -> "Ride":
        """Return the ride on a belt whose speed is multiplied between two times [s].

        What the belt was to do meanwhile is left out; a factor of 0 stops it, a negative one runs
        it back.
        """
        before, after = self.begin < begin, self.begin >= end
        speeds = self.speeds[1:]
        last = speeds[~after][-1:] if np.any(~after) else self.speeds[:1]
        back = np.isfinite(end)
        return replace(
            self,
            begin=np.concatenate(
                [
                    self.begin[before],
                    [begin],
                    [end] if back else [],
                    self.begin[after],
                ]
            ),
            speeds=np.concatenate(
                [
                    self.speeds[:1],
                    speeds[before],
                    [factor * self.speed(begin)],
                    last if back else [],
                    speeds[after],
                ]
            ),
        )


def drawn_ride(rng: np.random.Generator, middle: Array, along: Array, *, speed: float) -> Ride:
    """Return a ride on a belt whose speed changes on the way.

    Args:
        rng: Source of the draw.
        middle: Where the middle of a part comes by [m], shape (3,).
        along: Direction of the belt, a unit vector, shape (3,).
        speed: Its mean speed [m/s].
    """
    across = np.array([-along[1], along[0], 0.0])
    speeds = speed * (1.0 + _VARIES * rng.uniform(-1.0, 1.0, 5))
    off = rng.uniform(-0.03, 0.03)
    start = middle + off * across - (0.25 + _AHEAD * speed) * along
    begin = np.sort(rng.uniform(0.3, 3.0, 4))
    return Ride(
        start=start,
        along=along,
        begin=begin,
        speeds=speeds,
        change=0.2,
        yaw=rng.uniform(-0.05, 0.05),
    )
