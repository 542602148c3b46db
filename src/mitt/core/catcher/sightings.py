"""What the sightings of a throw say of a mistake in how they are made."""

from collections import deque
from typing import final

import numpy as np

from mitt.core.ball.motion_models import LOOSE
from mitt.core.signals import TICK, Array, Sighting

#: Distance beyond which a ball is none that an arm could catch [m].
FAR = 50.0
#: How far a sighting's stamp may lie behind its tick [s], and time without a sighting [s], from
#: which something is said.
_BEHIND = 0.6
_NOTHING = 3.0
#: Sightings in a row that have the same fault, and that are equal.
_FAULTS = 5
_EQUALS = 20
#: Changes of acceleration that are motion and no noise [m/s^3]: drag and spin bring 20 at most, the
#: hand that throws some hundred.
_JERK = 200.0
#: Median of the chi-squared distribution of three degrees of freedom.
_MEDIAN = 2.366
#: By how much noise exceeds what is told of it before it is said; its variance by the square. Half
#: of the samples of a window have to say so: with noise as it is told one in 10,000 does.
_UNDERSTATED = 2.5


@final
class Sightings:
    """The newest sightings of a throw, each with the time of its tick."""

    def __init__(self) -> None:
        """Begin with none."""
        self._newest: deque[tuple[float, Sighting]] = deque(maxlen=_EQUALS)
        self._said: tuple[str | None, str | None] | None = None  # of the newest, once it was asked
        self._t_begin: float | None = None
        self._t_seen = self._t = 0.0

    def note(self, points: tuple[Sighting, ...], sighted: bool, t: float) -> None:
        """Keep what a tick was given.

        Args:
            points: Positions from another source than images.
            sighted: Whether the eyes found the ball in images.
            t: Time of the tick [s].
        """
        self._t = t
        if self._t_begin is None:
            self._t_begin = self._t_seen = t
        for point in points:
            if point.found:
                self._newest.append((t, point))
                self._t_seen, self._said = t, None
        if sighted:
            self._newest.clear()
            self._t_seen, self._said = t, None

    @property
    def hint(self) -> str | None:
        """Why no ball may ever be seen, in one line; None where nothing is known to be wrong."""
        if self._t - self._t_seen > _NOTHING:
            return (
                f"no sighting for {self._t - self._t_seen:.1f} s: do the points, or the images,"
                " reach step, and is the ball in view?"
            )
        return self._of_newest[0]

    @property
    def scatter(self) -> str | None:
        """Whether the newest scatter by more than their covariance says, in one line."""
        return self._of_newest[1]

    @property
    def _of_newest(self) -> tuple[str | None, str | None]:
        """What the newest say of a mistake, and of their scatter: worked out once for each."""
        if self._said is None:
            self._said = self._mistake(), self._scatter()
        return self._said

    def _mistake(self) -> str | None:
        """Return why the newest are no ball's, in one line; None where nothing is known of it."""
        faults = [_fault(t, point) for t, point in list(self._newest)[-_FAULTS:]]
        if len(faults) == _FAULTS and all(faults):
            return faults[-1]
        if len(self._newest) == _EQUALS and len({x.r_o.tobytes() for _, x in self._newest}) == 1:
            return (
                f"the last {_EQUALS} sightings are at the same place: does the tracker repeat"
                " an old one, with a new stamp?"
            )
        return None

    def _scatter(self) -> str | None:
        """Return what :attr:`scatter` says."""
        if len(self._newest) < _EQUALS:
            return None
        points = sorted((x for _, x in self._newest), key=lambda x: x.t)
        t = np.array([x.t for x in points])
        r = np.array([x.r_o for x in points])
        P = np.array([x.covariance for x in points])
        if not (np.isfinite(r).all() and np.isfinite(P).all() and np.diff(t).min() > 1e-9):
            return None
        ratio, noise = scatter_of(t, r, P)
        if not ratio > _UNDERSTATED:
            return None
        return (
            f"sightings scatter by {1e3 * noise:.2g} mm, {ratio:.2g} times what their"
            " covariance says: is the noise understated, do stamps jitter, or are they of"
            " several things?"
        )


def scatter_of(t: Array, r: Array, P: Array) -> tuple[float, float]:
    """Return by how much sightings scatter about smooth motion.

    Third divided differences of each four in a row leave noise and, of the motion, its jerk, which
    is allowed for. Their median leaves out the few that a bounce or an outlier is in.

    Args:
        t: Times, rising [s], shape (k,), k > 3.
        r: Positions [m], shape (k, 3).
        P: Their covariances [m^2], shape (k, 3, 3).

    Returns:
        The ratio to what the covariances say, and the standard deviation of a coordinate [m].
    """
    fours = np.arange(len(t) - 3)[:, None] + np.arange(4)
    apart = t[fours][:, :, None] - t[fours][:, None, :] + np.eye(4)
    w = 1.0 / np.prod(apart, axis=2)
    size = np.linalg.norm(w, axis=1)
    e = np.einsum("ki,kid->kd", w, r[fours]) / size[:, None]
    S = np.einsum("ki,kide->kde", w * w, P[fours]) / size[:, None, None] ** 2
    S += (_JERK / 6.0 / size)[:, None, None] ** 2 * np.eye(3) + 1e-12 * np.eye(3)
    distance = np.einsum("kd,kd->k", e, np.linalg.solve(S, e[:, :, None])[:, :, 0])
    noise = np.sqrt(np.median(np.einsum("kd,kd->k", e, e)) / _MEDIAN)
    return float(np.sqrt(np.median(distance) / _MEDIAN)), float(noise)


def _fault(t: float, point: Sighting) -> str:
    """Return what is wrong with a sighting in the tick of a time [s]; nothing if it is well."""
    ahead, far = point.t - t, float(np.linalg.norm(point.r_o))
    if not -_BEHIND <= ahead <= TICK:
        side = "ahead of" if ahead > 0.0 else "behind"
        return (
            f"sightings are stamped {abs(ahead):.6g} s {side} their ticks: stamps and ticks"
            " need one clock, in seconds"
        )
    if not far <= FAR:
        return (
            f"a sighting is {far:.6g} m from the arm's base: positions are in metres, in the"
            " frame of the base; are these in millimetres?"
        )
    if not (spread := float(np.trace(point.covariance))) <= LOOSE:
        return (
            f"a sighting's covariance, for errors of {np.sqrt(spread):.3g} m, has no position"
            " in it: covariances are in m^2; are these in mm^2?"
        )
    return ""
