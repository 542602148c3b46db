"""Estimate of the ball's motion from sightings: an extended Kalman filter on the flight model.

State: position, velocity and drag coefficient; ddr_o = g - k |dr_o| dr_o + noise (``flight``).
The correction is in Joseph's form, in double precision. A track begins with a velocity as good
as unknown, so that the first sightings amount to a least-squares fit with known gravity; it
speaks after ``min_sightings``. A bounce or a kick changes the velocity, not the position: after
a few rejections the filter goes back to before the first of them, forgets the velocity, and
takes the sightings since then in again. If they still do not fit, it goes on from the newest,
or begins a new track if that is farther away than a kick can carry.
"""

from dataclasses import dataclass
from math import isfinite

import numpy as np

from mitt.signals import BallState, Sighting
from mitt.vision.kalman import carry, copy, is_sane, settle, take


@dataclass(frozen=True, slots=True, kw_only=True)
class FilterConfig:
    """What is believed of balls and of sightings.

    Attributes:
        drag_mean: Prior mean of the drag coefficient [1/m].
        drag_sigma: Its standard deviation [1/m]; 0.06 and 0.05 cover 0.036 to 0.15 (facts.md,
            section 4). A catcher that knows its ball says so and forecasts further.
        drag_max: Largest drag coefficient [1/m].
        drag_density: Spectral density of the drift of the drag coefficient [1/(m^2 s)].
        accel_density: Spectral density of the unmodelled acceleration [m^2/s^3].
        speed_sigma: Prior standard deviation of each velocity component [m/s].
        min_sightings: Sightings before the track speaks.
        gate: Squared Mahalanobis distance beyond which a sighting is not believed; a true one
            is in 1.5e-5 of cases at 25 (chi-squared, 3 degrees of freedom).
        first_gate: The same before the track speaks; wider, as a rejection costs the track.
        max_rejections: Rejections, with never three sightings in a row believed, that make a
            kick; at most 8.
        max_rejection_time: Time from the first of three rejections in a row that makes one,
            too [s].
        kick_sigma: Velocity change that a kick may bring, each component [m/s].
        max_gap: Time without a sighting after which a new one begins a new track [s].
    """

    drag_mean: float = 0.06
    drag_sigma: float = 0.05
    drag_max: float = 0.3
    drag_density: float = 1e-5
    accel_density: float = 0.01
    speed_sigma: float = 8.0
    min_sightings: int = 6
    gate: float = 25.0
    first_gate: float = 100.0
    max_rejections: int = 6
    max_rejection_time: float = 0.008
    kick_sigma: float = 6.0
    max_gap: float = 0.3


MAX_DOUBTFUL = 24
"""Sightings that are kept while some of them are rejected."""

MAX_HORIZON = 2.0
"""Farthest that an estimate is carried [s]; no throw flies longer."""

THROWN_BALL = FilterConfig(drag_mean=0.04, drag_sigma=0.005, accel_density=0.001)
"""For the thrown balls of facts.md, section 4: 0.036 to 0.042 per metre and hardly any spin."""

TABLE_TENNIS_BALL = FilterConfig(drag_mean=0.12, drag_sigma=0.03, accel_density=0.03)
"""For the recorded balls of facts.md, section 4: 0.09 to 0.15 per metre, and visible spin."""


@dataclass(slots=True)
class FilterCounts:
    """What became of the sightings.

    Attributes:
        used: Taken in.
        ignored: Not found, not finite, absurd or not newer than the last.
        rejected: Beyond the gate.
        kicks: Times that the velocity was forgotten.
        restarts: Times that a new track replaced an old one.
    """

    used: int = 0
    ignored: int = 0
    rejected: int = 0
    kicks: int = 0
    restarts: int = 0


class BallFilter:
    """Tracks one ball through time-stamped sightings."""

    def __init__(self, config: FilterConfig | None = None) -> None:
        """Start without a track."""
        self.config = config or FilterConfig()
        c = self.config
        self.counts = FilterCounts()
        self._settings = np.array((c.accel_density, c.drag_density, c.drag_max))
        self._tracks = np.zeros((3, 8, 7))
        self._x, self._P = self._tracks[0, 0], self._tracks[0, 1:]
        self._work = np.zeros((2, 7, 7))
        self.reset()

    def reset(self) -> None:
        """Forget the ball; the counts go on."""
        self._t = self._t_seen = self._t_first = self._t_believed = -np.inf
        self._used = 0
        self._doubtful: list[Sighting] = []
        self._rejected = self._in_a_row = 0

    @property
    def tracked(self) -> bool:
        """Whether there is an estimate."""
        return self._used >= self.config.min_sightings

    def update(self, sighting: Sighting) -> None:
        """Take a sighting in; one not found, not finite or not newer than the last is ignored."""
        s, max_gap = sighting, self.config.max_gap
        if not (s.found and isfinite(s.t) and (s.t > self._t or s.t < self._t_seen - max_gap)):
            self.counts.ignored += 1
            return
        if self._used == 0 or abs(s.t - self._t_seen) > max_gap:
            if is_sane(s.r_o, s.covariance):
                self._begin(s)
            else:
                self.counts.ignored += 1
            return
        before, calm = self._t, not self._doubtful
        distance = self._take(s, keep=calm)
        if distance < 0.0:
            self.counts.ignored += 1
            return
        if calm:
            self._t_believed = before
        if distance <= self._gate():
            self._believe(s)
        else:
            self._doubt(s)

    def state(self, t: float) -> BallState:
        """Return the estimate carried by the flight model to ``t`` [s], near or far.

        Not tracked without an estimate, or further than ``MAX_HORIZON`` from it.
        """
        if not self.tracked or not abs(t - self._t) <= MAX_HORIZON:
            return _untracked(t)
        motion, covariance = np.empty((3, 3)), np.empty((6, 6))
        drag = carry(self._tracks, t - self._t, self._settings, motion, covariance, self._work)
        return BallState(
            t=t,
            tracked=True,
            r_o=motion[0],
            dr_o=motion[1],
            ddr_o=motion[2],
            drag=drag,
            covariance=covariance,
            t_seen=self._t_seen,
            t_first=self._t_first,
        )

    def _gate(self) -> float:
        """Return the squared distance beyond which a sighting is not believed."""
        return self.config.gate if self.tracked else self.config.first_gate

    def _take(self, s: Sighting, *, keep: bool) -> float:
        """Carry the estimate to the sighting and take it in if it lies in the gate.

        Returns:
            Its squared distance; negative if it cannot be a sighting, and then nothing changes.
        """
        distance: float = take(
            self._tracks,
            s.t - self._t,
            s.r_o,
            s.covariance,
            self._gate(),
            keep,
            self._settings,
            self._work,
        )
        if distance >= 0.0:
            self._t = s.t
        return distance

    def _believe(self, sighting: Sighting) -> None:
        """Note a sighting that was taken in; three in a row end a doubt."""
        self._t_seen = sighting.t
        self._used += 1
        self.counts.used += 1
        if self._doubtful:
            self._doubtful.append(sighting)
            self._in_a_row += 1
            if self._in_a_row == 3 or len(self._doubtful) > MAX_DOUBTFUL:
                self._doubtful.clear()

    def _doubt(self, sighting: Sighting) -> None:
        """Note a rejected sighting; act when they are too many or last too long."""
        self.counts.rejected += 1
        if not self.tracked:
            self._begin(sighting)
            return
        if not self._doubtful:
            self._rejected = 0
        self._doubtful.append(sighting)
        self._rejected += 1
        self._in_a_row = 0
        n, lasts = self._rejected, sighting.t - self._doubtful[0].t
        stubborn = n == len(self._doubtful) >= 3 and lasts >= self.config.max_rejection_time
        if n >= self.config.max_rejections or stubborn:
            self._reacquire()

    def _begin(self, sighting: Sighting) -> None:
        """Begin a new track at a sighting."""
        c = self.config
        self.counts.restarts += self._used > 0
        self._x[3:6], self._x[6], self._P[6, 6] = 0.0, c.drag_mean, c.drag_sigma**2
        settle(self._x, self._P, sighting.r_o, sighting.covariance, c.speed_sigma)
        self._t = self._t_first = sighting.t
        self._used = 0
        self._doubtful.clear()
        self._believe(sighting)

    def _reacquire(self) -> None:
        """Forget the velocity where the doubt began and take all sightings since then in."""
        again = tuple(self._doubtful)
        self._doubtful.clear()
        leap = float(np.linalg.norm(self._x[:3] - again[-1].r_o))
        reach = 1.5 * self.config.kick_sigma * (again[-1].t - self._t_believed)
        copy(self._tracks[1], self._tracks[0])
        self._t = self._t_believed
        # When within the gap the kick came is unknown, and so how far it has carried the ball.
        kick = self.config.kick_sigma
        self._P[range(3), range(3)] += (kick * (again[0].t - self._t)) ** 2
        self._P[range(3, 6), range(3, 6)] += kick**2
        fitting = 0
        for sighting in again:
            if self._take(sighting, keep=False) <= self._gate():
                self._believe(sighting)
                fitting += 1
        if 2 * fitting <= len(again) and leap > reach:
            self._begin(again[-1])
            return
        self.counts.kicks += 1
        if 2 * fitting <= len(again):
            self._resume(again[-1])

    def _resume(self, sighting: Sighting) -> None:
        """Go on from a sighting with a velocity as good as unknown, on the same track."""
        kick = self.config.kick_sigma
        settle(self._x, self._P, sighting.r_o, sighting.covariance, kick)
        self._t = sighting.t
        self._doubtful.clear()
        self._believe(sighting)


def _untracked(t: float) -> BallState:
    """Return the state of no ball."""
    return BallState(
        t=t,
        tracked=False,
        r_o=np.zeros(3),
        dr_o=np.zeros(3),
        ddr_o=np.zeros(3),
        drag=0.0,
        covariance=np.zeros((6, 6)),
        t_seen=-np.inf,
        t_first=-np.inf,
    )
