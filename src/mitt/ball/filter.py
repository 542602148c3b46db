"""Estimate of the ball's motion from sightings: extended Kalman filters, a motion model each.

State: position, velocity, drag coefficient k and push a; in flight ddr_o = g - k |dr_o| dr_o + a
+ noise (``flight``). Targets that do not fly are followed by other models (``motion_models``). The
correction is in Joseph's form, in double precision. A track begins with a velocity as good as
unknown, so that the first sightings amount to a least-squares fit with known gravity; it speaks
after ``min_sightings``. The kernels of ``estimator`` do the work on one vector (``memory``);
here they get their settings, and their results a name.
"""

from dataclasses import dataclass
from typing import final

import numpy as np

from mitt import checks, fields
from mitt.ball import memory as at
from mitt.ball.estimator import doubt, is_tracked, predict, update
from mitt.errors import InputError
from mitt.fields import brief
from mitt.signals import GRAVITY, Array, BallState, Sighting

#: Least and largest value of each number; those that stand in a denominator are above 0. Choices of
#: this project, far beyond what balls and sightings ask for.
_RANGES: dict[str, tuple[float, float]] = {
    "drag_mean": (0.0, 10.0), "drag_sigma": (0.0, 10.0), "drag_max": (1e-6, 10.0),
    "drag_density": (0.0, 1e3), "accel_density": (0.0, 1e6), "speed_sigma": (1e-6, 1e3),
    "min_sightings": (1, 1000), "gate": (1e-6, 1e6), "first_gate": (1e-6, 1e6),
    "max_rejections": (1, 8), "max_rejection_time": (0.0, 1.0), "kick_sigma": (0.0, 1e3),
    "max_gap": (1e-6, 10.0), "push_sigma": (0.0, 1e3), "push_time": (1e-6, 1e3),
    "steady_density": (0.0, 1e6), "driven_sigma": (0.0, 1e4), "driven_time": (1e-6, 1e3),
    "other_motion": (0.0, 0.999), "switch_time": (1e-6, 1e6), "speaks_after": (1, 1000),
}  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class FilterConfig:
    """What is known beforehand of balls and of sightings.

    Attributes:
        drag_mean: Prior mean of the drag coefficient [1/m].
        drag_sigma: Its standard deviation [1/m]; 0.06 and 0.05 cover 0.036 to 0.15, thrown and
            table-tennis balls. A catcher that knows its ball says so and forecasts further.
        drag_max: Largest drag coefficient [1/m].
        drag_density: Spectral density of the drift of the drag coefficient [1/(m^2 s)].
        accel_density: Spectral density of the unmodelled acceleration [m^2/s^3].
        speed_sigma: Prior standard deviation of each velocity component [m/s].
        min_sightings: Sightings before the track speaks, and a rejection no longer ends it.
        gate: Squared Mahalanobis distance beyond which a sighting is rejected; a true one
            is in 1.5e-5 of cases at 25 (chi-squared, 3 degrees of freedom).
        first_gate: The same before the track speaks; wider, as a rejection costs the track.
        max_rejections: Rejections, with never three sightings in a row accepted, that make a
            kick; at most 8.
        max_rejection_time: Time from the first of three rejections in a row that makes one,
            too [s].
        kick_sigma: Velocity change that a kick may bring, each component [m/s].
        max_gap: Time without a sighting after which a new track begins, once three in a row have
            come; one alone as far from the track in time, before it or after it, counts for
            nothing [s].
        push_sigma: Standard deviation of each component of the push, a slowly varying acceleration
            that drag does not explain, such as the lift of a spinning ball [m/s^2].
        push_time: Its correlation time [s].
        steady_density: Spectral density of the unmodelled acceleration of what does not fly
            [m^2/s^3].
        driven_sigma: Standard deviation of each component of the acceleration of what is driven,
            by a hand or a spring [m/s^2].
        driven_time: Its correlation time [s].
        other_motion: Prior probability that the target does not fly; steady and driven share it.
        switch_time: Mean time between changes of the motion model [s].
        watchful: Whether the other models are weighted from the first sighting on; otherwise from
            when flight does not fit.
        speaks_after: Sightings after which there is an estimate; ``min_sightings`` if None.
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
    max_gap: float = 0.6
    push_sigma: float = 0.0
    push_time: float = 1.0
    steady_density: float = 0.02
    driven_sigma: float = 12.0
    driven_time: float = 0.2
    other_motion: float = 0.1
    switch_time: float = 2.0
    watchful: bool = False
    speaks_after: int | None = None

    __repr__ = brief

    def __post_init__(self) -> None:
        """Refuse numbers with which the filter cannot work.

        Raises:
            InputError: A field is no number, or out of its range; ``drag_mean`` exceeds
                ``drag_max``.
        """
        fields.check(self, _RANGES)
        if self.drag_mean > self.drag_max:
            raise InputError(
                "FilterConfig.drag_mean", f"at most drag_max, {self.drag_max}", self.drag_mean
            )


THROWN_BALL = FilterConfig(
    drag_mean=0.04, drag_sigma=0.005, drag_density=1e-6, accel_density=1e-4, push_sigma=0.03
)
"""For balls thrown by hand: 0.036 to 0.042 per metre, as fitted to throws, and hardly any spin."""

TABLE_TENNIS_BALL = FilterConfig(
    drag_mean=0.12, drag_sigma=0.03, accel_density=0.005, push_sigma=1.0
)
"""For table-tennis balls: 0.09 to 0.15 per metre, as fitted to flights, and visible spin."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FilterCounts:
    """What became of the sightings.

    Attributes:
        used: Taken in.
        ignored: Not found, not finite, absurd, with a stamp that was there before, or a point that
            comes back to the last digit while the ball is elsewhere.
        late: Too old to be put in their place.
        rejected: Beyond the gate.
        kicks: Times that the velocity was forgotten.
        restarts: Times that a new track replaced an old one: sightings in a row, elsewhere or of
            another time, agreed with one another.
    """

    used: int = 0
    ignored: int = 0
    late: int = 0
    rejected: int = 0
    kicks: int = 0
    restarts: int = 0


def settings_of(config: FilterConfig) -> Array:
    """Return the settings as the kernels read them, shape ``memory.SETTINGS``."""
    c = config
    table, other = np.zeros(at.SETTINGS), 0.5 * c.other_motion
    table[0] = (GRAVITY, c.accel_density, c.drag_density, c.push_sigma, c.push_time, c.drag_mean,
                c.drag_sigma, 1.0 - c.other_motion)  # fmt: skip
    table[1] = (0.0, c.steady_density, 0.0, 0.0, 1.0, 0.0, 0.0, other)
    table[2] = (0.0, c.steady_density, 0.0, c.driven_sigma, c.driven_time, 0.0, 0.0, other)
    table[at.GATES, :6] = (c.gate, c.first_gate, c.min_sightings, c.max_rejections,
                           c.max_rejection_time, c.kick_sigma)  # fmt: skip
    speaks = c.min_sightings if c.speaks_after is None else c.speaks_after
    table[at.LIMITS, :6] = (c.drag_max, c.speed_sigma, c.max_gap, speaks, c.watchful, c.switch_time)
    return table


@final
class BallFilter:
    """Tracks one ball through time-stamped sightings."""

    def __init__(self, config: FilterConfig | None = None) -> None:
        """Start without a track."""
        config = FilterConfig() if config is None else config
        self.config = checks.instance("config", config, FilterConfig)
        self._settings = settings_of(self.config)
        self._memory, self._work = at.fresh(), np.zeros(at.WORK)

    def reset(self) -> None:
        """Forget the ball; the counts go on."""
        at.clear(self._memory)

    @property
    def tracked(self) -> bool:
        """Whether there is an estimate."""
        return bool(is_tracked(self._memory, self._settings))

    @property
    def counts(self) -> FilterCounts:
        """What became of the sightings so far."""
        m = self._memory
        used, rejected, kicks, restarts = (int(count) for count in m[at.ALL_USED : at.ACTIVE])
        return FilterCounts(
            used=used, ignored=int(m[at.IGNORED]), late=int(m[at.LATE]), rejected=rejected,
            kicks=kicks, restarts=restarts,
        )  # fmt: skip

    def update(self, sighting: Sighting) -> None:
        """Take a sighting in at its own time, whatever the order of arrival."""
        s = checks.instance("sighting", sighting, Sighting)
        if s.found:
            update(self._memory, s.t, s.r_o, s.covariance, self._settings, self._work)
        else:
            self._memory[at.IGNORED] += 1.0

    def state(self, t: float) -> BallState:
        """Return the estimate carried by the flight model to ``t`` [s], near or far.

        Not tracked without an estimate, or further than ``estimator.MAX_HORIZON`` from it. Where
        the newest sightings were rejected, the covariance holds the kick that they may show.
        """
        t, m = checks.number("t", t), self._memory
        motion, covariance = np.empty((3, 3)), np.empty((6, 6))
        tracked = predict(m, t, self._settings, motion, covariance, self._work)
        if tracked:
            doubt(m, t, self._settings, covariance)
        if not np.isfinite(covariance).all():
            tracked, motion[:], covariance[:] = False, 0.0, 0.0
        return BallState(
            t=t, tracked=tracked, r_o=motion[0], dr_o=motion[1], ddr_o=motion[2],
            drag=float(m[at.DRAG]) if tracked else 0.0, covariance=covariance,
            t_seen=float(m[at.T_SEEN]) if tracked else -np.inf,
            t_first=float(m[at.T_FIRST]) if tracked else -np.inf,
            led=bool(tracked and m[at.BEST] > 0.0),
        )  # fmt: skip
