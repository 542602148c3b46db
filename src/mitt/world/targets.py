"""What moves within reach: things in a hand, parts on a belt.

A reach of a hand is a motion of least jerk (T. Flash and N. Hogan, J. Neuroscience 5, 1985); where
the person changes their mind, the motion of least jerk to the new place is added to the one under
way (E. Flash and T. Henis, J. Cognitive Neuroscience 3, 1991). A steady hand trembles at 8 to 12 Hz
by a tenth of a millimetre to one (R. Elble and W. Koller, Tremor, 1990).
"""

from dataclasses import dataclass

import numpy as np

from mitt.signals import Array
from mitt.world.scene import Belt

#: Frequencies of a hand's tremor [Hz].
_TREMOR = (8.0, 12.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HandReach:
    """A thing in a hand: from place to place by motions of least jerk.

    Attributes:
        start: Where it rests at first [m], shape (3,).
        way: Each motion's way [m], shape (k, 3).
        begin: When each begins [s], shape (k,).
        duration: How long each takes [s], shape (k,).
        tremor: Amplitude, frequency [rad/s] and phase of the tremor along each axis, shape (3, 3).
    """

    start: Array
    way: Array
    begin: Array
    duration: Array
    tremor: Array

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
    rng: np.random.Generator, *, to: Array, reach: float = 0.6, speed: float = 1.2,
    changes: int = 3, off: float = 0.06, tremor: float = 3e-4,
) -> HandReach:  # fmt: skip
    """Return a reach towards a place, with changes of mind.

    Args:
        rng: Source of the draw.
        to: Where it leads at first [m], shape (3,).
        reach: Length of the way [m].
        speed: Largest speed [m/s].
        changes: Most changes of mind, one at least.
        off: Standard deviation of each of them, an axis [m].
        tremor: Amplitude [m].
    """
    angle, height = rng.uniform(-0.6, 0.6), rng.uniform(-0.3, 0.3)
    along = np.array([np.cos(angle), np.sin(angle), height])
    along *= reach / np.linalg.norm(along)
    count = int(rng.integers(1, changes + 1))
    first = 1.875 * reach / (speed * rng.uniform(0.6, 1.0))
    begin = np.concatenate([[0.3], 0.3 + first * rng.uniform(0.3, 1.1, count)])
    way = np.concatenate([[-along], off * rng.standard_normal((count, 3))])
    shorter = np.full(count, 0.5)
    waves = np.array([
        tremor * rng.uniform(0.3, 1.0, 3),
        2.0 * np.pi * rng.uniform(*_TREMOR, 3),
        rng.uniform(0.0, 2.0 * np.pi, 3),
    ])  # fmt: skip
    return HandReach(start=to + along, way=way, begin=begin,
                     duration=np.concatenate([[first], shorter]), tremor=waves)  # fmt: skip


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

    def at(self, t: float) -> tuple[Array, Array]:
        """Position [m] and velocity [m/s], shape (3,) each, of a part that does not slip."""
        x = np.clip((t - self.begin) / self.change, 0.0, None)
        low, over = np.minimum(x, 1.0), np.maximum(x - 1.0, 0.0)
        way = self.change * (low**3 - 0.5 * low**4 + over)
        gone = float(self.speeds[0] * t + way @ np.diff(self.speeds))
        return self.start + gone * self.along, self.speed(t) * self.along


def drawn_ride(
    rng: np.random.Generator, belt: Belt, *, speed: float, height: float, varies: float = 0.3,
    ahead: float = 1.6,
) -> Ride:  # fmt: skip
    """Return a ride on a belt whose speed changes on the way.

    Args:
        rng: Source of the draw.
        belt: The belt.
        speed: Its mean speed [m/s].
        height: Of the part's middle [m].
        varies: Half-width of the relative changes of speed.
        ahead: About how long before it comes by the middle the part appears [s].
    """
    along = np.array([np.cos(belt.direction), np.sin(belt.direction), 0.0])
    across = np.array([-along[1], along[0], 0.0])
    speeds = speed * (1.0 + varies * rng.uniform(-1.0, 1.0, 5))
    middle = np.array([*belt.middle, height])
    off = rng.uniform(-0.03, 0.03)
    start = middle + off * across - (0.25 + ahead * speed) * along
    begin = np.sort(rng.uniform(0.3, 3.0, 4))
    return Ride(start=start, along=along, begin=begin, speeds=speeds, change=0.2,
                yaw=rng.uniform(-0.05, 0.05))  # fmt: skip
