"""A belt by its encoder: how far it has travelled, now, at any sighting's time, and shortly after.

What lies on a belt rests in the belt's frame. So a sighting is brought there by the travel at its
own time, the filter estimates a thing at rest, which creeps where the encoder's scale is off or the
part slips, and the estimate is brought back by the travel at the time of the tick:

| here   | meaning                                                  | unit           | shape |
|--------|----------------------------------------------------------|----------------|-------|
| along  | direction of the belt, a unit vector                     |                | (3,)  |
| travel | of the belt since the first reading, s(t)                | m              |       |
| z      | sighted place r - s(t_seen) along, in the belt's frame   | m              | (3,)  |
| motion | r_o, dr_o, ddr_o: in that frame, then r_o + s along, ... | m, m/s, m/s^2  | (3, 3)|

Travel between two readings is interpolated. Beyond the newest a parabola goes on that is fitted to
those of the last 30 ms: encoders count in steps, and their readings are some milliseconds old.
"""

from bisect import bisect_right
from dataclasses import dataclass
from typing import Final, final

import numpy as np

from mitt.core.ball.filter import FilterConfig
from mitt.core.signals import Array

RIDING: Final = FilterConfig(
    other_motion=0.998,
    watchful=True,
    min_sightings=4,
    speaks_after=1,
    speed_sigma=0.01,
    steady_density=1e-6,
    driven_sigma=0.03,
    driven_time=0.3,
    switch_time=2.0,
    max_gap=4.0,
)
"""What the filter assumes of a part in the frame of its belt: it creeps by 1 cm/s at most."""

#: Time over which the newest readings tell speed and acceleration [s], and the fewest of them.
_FITTED = 0.03
_FEWEST = 3
#: How long readings are kept [s]: sightings are no older.
_KEPT = 5.0
#: Faster than this no belt runs [m/s]: a counter that was set anew jumps.
_MOST = 20.0
SILENT: Final = 0.05
"""Age of the newest reading from which a belt goes on unseen [s]."""
#: How its speed may change then [m/s^2].
_CHANGES = 1.5


@dataclass(frozen=True, slots=True)
class _Fit:
    """Travel, speed and acceleration at the newest reading."""

    t: float
    rows: tuple[float, float, float]


@final
class BeltTravel:
    """The travel of one belt.

    Attributes:
        along: As in the module's table.
    """

    def __init__(self, along: Array) -> None:
        """Begin without a reading."""
        self.along = along
        self._t, self._s = list[float](), list[float]()
        self._fit: _Fit | None = None
        self.forget()

    def forget(self) -> None:
        """Begin anew, as for a belt whose time begins anew."""
        self._t.clear()
        self._s.clear()
        self._shift, self._fit = 0.0, None

    @property
    def known(self) -> bool:
        """Whether there was a reading."""
        return bool(self._t)

    @property
    def newest(self) -> float:
        """Time of the newest reading [s]; minus infinity before the first."""
        return self._t[-1] if self._t else -np.inf

    def read(self, t: float, travel: float) -> None:
        """Take a reading: its time [s] and the travel [m], going on over a counter set anew.

        One that is not newer than the one before changes nothing.
        """
        if not (np.isfinite(t) and np.isfinite(travel) and t > self.newest):
            return
        if not self._t:
            self._shift = -travel
        elif abs(travel + self._shift - self._s[-1]) > _MOST * (t - self._t[-1]):
            self._shift = self.at(t)[0] - travel
        self._t.append(t)
        self._s.append(travel + self._shift)
        self._fit = None
        if len(self._t) % 1000 == 0 and t - self._t[0] > 2.0 * _KEPT:
            k = bisect_right(self._t, t - _KEPT)
            del self._t[:k], self._s[:k]

    def at(self, t: float) -> tuple[float, float, float]:
        """Return travel, speed and acceleration at a time [m, m/s, m/s^2].

        Before the oldest reading that is kept the belt counts as if it had gone on as then.
        """
        if not self._t:
            return 0.0, 0.0, 0.0
        k = bisect_right(self._t, t)
        if k == len(self._t):
            fit = self._fit = self._fit or self._fitted()
            s, ds, dds = fit.rows
            ahead = min(t - fit.t, SILENT)
            s, ds = s + ahead * (ds + 0.5 * ahead * dds), ds + ahead * dds
            late = t - fit.t - ahead
            return (s, ds, dds) if late == 0.0 else (s + late * ds, ds, 0.0)
        if len(self._t) == 1:
            return self._s[0], 0.0, 0.0
        k = max(k, 1)
        speed = (self._s[k] - self._s[k - 1]) / (self._t[k] - self._t[k - 1])
        return self._s[k] + (t - self._t[k]) * speed, speed, 0.0

    def _fitted(self) -> _Fit:
        """Return the end of a parabola through the newest readings."""
        k = min(bisect_right(self._t, self._t[-1] - _FITTED), max(len(self._t) - _FEWEST, 0))
        t, s = np.array(self._t[k:]) - self._t[-1], np.array(self._s[k:])
        if len(t) < _FEWEST:
            speed = 0.0 if len(t) < 2 else float((s[1] - s[0]) / (t[1] - t[0]))
            return _Fit(self._t[-1], (float(s[-1]), speed, 0.0))
        scale = -float(t[0])
        powers = np.stack([np.ones(len(t)), t / scale, (t / scale) ** 2], axis=1)
        a, b, c = np.linalg.solve(powers.T @ powers, powers.T @ s).tolist()
        return _Fit(self._t[-1], (a, b / scale, 2.0 * c / scale**2))

    def into(self, t: float, r: Array) -> Array:
        """Return a place seen at a time [m] in the belt's frame, shape (3,)."""
        out: Array = r - self.at(t)[0] * self.along
        return out

    def carry(self, t: float, motion: Array, covariance: Array) -> None:
        """Bring an estimate in the belt's frame to where the belt is at a time, in place.

        What the belt may have done since it was read last is added to the covariance.

        Args:
            t: The time [s].
            motion: As in the module's table.
            covariance: Of position and velocity, shape (6, 6).
        """
        for i, row in enumerate(self.at(t)):
            motion[i] += row * self.along
        silent = max(t - self.newest - SILENT, 0.0)
        if silent > 0.0:
            both = np.outer(self.along, self.along)
            covariance[:3, :3] += (0.5 * _CHANGES * silent**2) ** 2 * both
            covariance[3:, 3:] += (_CHANGES * silent) ** 2 * both
