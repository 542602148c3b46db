"""A target as a tool follows it: an estimate jumps with each sighting, a tool cannot."""

from math import inf
from typing import final

import numpy as np

from mitt.core.kernels import kernel
from mitt.core.signals import TICK, Array

#: Rates at which the followed target closes up to the estimate, along a belt and across it [1/s].
_ALONG = 40.0
_ACROSS = 8.0
#: The first of them where the tool's speed is limited: what may not be fast need not be quick.
_SLOWLY = 15.0
#: Shares of the speed that are left along a belt and across it, where both are limited.
_SPLIT = (0.95, 0.3)


@kernel
def _glide(
    given: Array,
    across: Array,
    dt: float,
    most: float,
    slowly: float,
    rate: float,
    lead: Array,
    motion: Array,
) -> None:
    """Let a followed motion go on for one tick towards what is given a time ``dt`` later [s].

    Args:
        given: The estimate then [m ...], shape (3, 3).
        across: Projection on the directions in which nothing moves, shape (3, 3).
        dt: That time [s].
        most: Largest speed of the place that leads the motion [m/s].
        slowly: Rate at which that place follows [1/s]; 0 where it is at once where it should be.
        rate: Rate at which the motion closes up to it, but across a belt [1/s].
        lead: That place [m], shape (3,), overwritten.
        motion: The followed motion [m ...], shape (3, 3), overwritten.
    """
    moves, rests, step = np.zeros(3), np.zeros(3), np.zeros(3)
    for i in range(3):
        r = given[0, i] - dt * given[1, i]
        moves[i] = r + (3.0 * given[1, i] + 3.0 * given[2, i] / rate) / rate
        rests[i] = r
    for i in range(3):
        to = moves[i]
        for j in range(3):
            to += across[i, j] * (rests[j] - moves[j])
        step[i] = (to if slowly == 0.0 else given[0, i]) - lead[i]
    if slowly > 0.0:
        step *= TICK * slowly
    _limit(step, across, TICK * most)
    for i in range(3):
        lead[i] += step[i]
        r, dr, ddr = lead[i] - motion[0, i], motion[1, i], motion[2, i]
        moves[i] = rate * (-3.0 * ddr + rate * (-3.0 * dr + rate * r))
        rests[i] = _ACROSS * (-3.0 * ddr + _ACROSS * (-3.0 * dr + _ACROSS * r))
    for i in range(3):
        jerk = moves[i]
        for j in range(3):
            jerk += across[i, j] * (rests[j] - moves[j])
        motion[0, i] += TICK * (motion[1, i] + 0.5 * TICK * motion[2, i])
        motion[1, i] += TICK * (motion[2, i] + 0.5 * TICK * jerk)
        motion[2, i] += TICK * jerk


@kernel
def _limit(step: Array, across: Array, most: float) -> None:
    """Shorten a step to ``most`` [m]; along a belt and across it, which lag unequally, each."""
    if most == np.inf:
        return
    beside = np.zeros(3)
    for i in range(3):  # a product of matrices in a kernel would need SciPy
        for j in range(3):
            beside[i] += across[i, j] * step[j]
    on = step - beside
    both = across[0, 0] + across[1, 1] + across[2, 2] > 0.5
    most_on, most_beside = (_SPLIT[0] * most, _SPLIT[1] * most) if both else (most, most)
    length, wide = np.sqrt(np.sum(on**2)), np.sqrt(np.sum(beside**2))
    step[:] = on * (most_on / max(length, most_on, 1e-12))
    step += beside * (most_beside / max(wide, most_beside, 1e-12))


@final
class Glide:
    """The target as the tool follows it: an estimate jumps with each sighting, a tool cannot.

    What an estimate has jumped by is closed as by a critically damped system of third order, so
    that accelerations do not jump either; a motion that is estimated rightly is followed without a
    lag. Across a belt a part rests, so that there a mean over a longer time tells where it is.

    Attributes:
        calm: When tool and estimate were out of step last [s].
        closes: When the tool begins to close [s]; infinite until it does.
        rows: What the map made of it last [rad ...], shape (6, n); None before the first.
        ended: Why the target was given up; nothing as long as it is followed.
        seen: Time of its newest sighting [s], and the 1-sigma of its place along its belt when that
            came [m].
    """

    def __init__(self, speeds: Array | None = None, most: float = _ALONG) -> None:
        """Begin nowhere.

        Args:
            speeds: Largest speed in each tick from the first on, of which the last stays [m/s],
                shape (k,); none if left out.
            most: Largest rate at which an estimate that has jumped is followed [1/s].
        """
        self._t, self._motion, self._lead = inf, np.zeros((3, 3)), np.zeros(3)
        self._rate = min(most, _ALONG if speeds is None else _SLOWLY)
        self._speeds, self._begun = np.array([inf]) if speeds is None else speeds, inf
        self.calm = self.closes = inf
        self.rows: Array | None = None
        self.ended = ""
        self.seen, self.sigma = -inf, inf

    @property
    def motion(self) -> Array:
        """r_o, dr_o, ddr_o as followed at last, shape (3, 3)."""
        return self._motion.copy()

    def to(self, t: float, given: Array, across: Array, rate: float = 0.0) -> Array:
        """Return r_o, dr_o, ddr_o of the followed target at a time, (3, 3).

        Args:
            t: Time [s].
            given: The estimate then [m ...], shape (3, 3).
            across: Projection on the directions in which nothing moves, shape (3, 3).
            rate: At which it is followed slowly [1/s]; 0 where at once.
        """
        if not 0.0 <= t - self._t < 0.1:
            self._begin(t, given)
        while t - self._t > 0.5 * TICK:
            k = min(max(round((self._t - self._begun) / TICK), 0), len(self._speeds) - 1)
            fastest = 0.0 if self.ended else float(self._speeds[k])
            _glide(given, across, t - self._t, fastest, rate, self._rate, self._lead, self._motion)
            self._t += TICK
        return self.motion

    def onwards(self) -> Array | None:
        """Return the rows of a tick later if velocities stay; None before the first."""
        if self.rows is None:
            return None
        rows = self.rows.copy()
        rows[[0, 3]] += TICK * rows[[1, 4]]
        rows[[2, 5]] = 0.0
        return rows

    def _begin(self, t: float, given: Array) -> None:
        """Begin where the target is, as fast as it is, but no faster than is allowed."""
        self._t, self._begun, self.calm = t, min(self._begun, t), t
        self._motion, most = given.copy(), float(self._speeds[0])
        if (speed := float(np.linalg.norm(given[1]))) > most:
            self._motion[1] *= most / speed
        if most < inf:
            self._motion[2] = 0.0
        ahead = 3.0 * self._motion[1] + 3.0 * self._motion[2] / self._rate
        self._lead[:] = self._motion[0] + ahead / self._rate
