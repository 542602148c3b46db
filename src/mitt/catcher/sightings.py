"""What a catcher was shown of its ball, and why it may never see it."""

from collections import deque
from typing import final

import numpy as np

from mitt.ball.memory import LOOSE
from mitt.signals import TICK, Sighting

#: Distance beyond which a ball is none that an arm could catch [m].
FAR = 50.0
#: How far a sighting's stamp may lie behind its tick [s], and time without a sighting [s], from
#: which something is said.
_BEHIND, _NOTHING = 0.6, 3.0
#: Sightings in a row that have the same fault, and that are equal.
_FAULTS, _EQUALS = 5, 20


@final
class Sightings:
    """The newest sightings of a throw, each with the time of its tick."""

    def __init__(self) -> None:
        """Begin with none."""
        self._newest: deque[tuple[float, Sighting]] = deque(maxlen=_EQUALS)
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
                self._t_seen = t
        if sighted:
            self._newest.clear()
            self._t_seen = t

    @property
    def hint(self) -> str | None:
        """Why no ball may ever be seen, in one line; None where nothing is known to be wrong."""
        if self._t - self._t_seen > _NOTHING:
            return (f"no sighting for {self._t - self._t_seen:.1f} s: do the points, or the images,"
                    " reach step, and is the ball in view?")  # fmt: skip
        faults = [_fault(t, point) for t, point in list(self._newest)[-_FAULTS:]]
        if len(faults) == _FAULTS and all(faults):
            return faults[-1]
        if len(self._newest) == _EQUALS and len({x.r_o.tobytes() for _, x in self._newest}) == 1:
            return (f"the last {_EQUALS} sightings are at the same place: does the tracker repeat"
                    " an old one, with a new stamp?")  # fmt: skip
        return None


def _fault(t: float, point: Sighting) -> str:
    """Return what is wrong with a sighting in the tick of a time [s]; nothing if it is well."""
    ahead, far = point.t - t, float(np.linalg.norm(point.r_o))
    if not -_BEHIND <= ahead <= TICK:
        side = "ahead of" if ahead > 0.0 else "behind"
        return (f"sightings are stamped {abs(ahead):.6g} s {side} their ticks: stamps and ticks"
                " need one clock, in seconds")  # fmt: skip
    if not far <= FAR:
        return (f"a sighting is {far:.6g} m from the arm's base: positions are in metres, in the"
                " frame of the base; are these in millimetres?")  # fmt: skip
    if not (spread := float(np.trace(point.covariance))) <= LOOSE:
        return (f"a sighting's covariance, for errors of {np.sqrt(spread):.3g} m, has no position"
                " in it: covariances are in m^2; are these in mm^2?")  # fmt: skip
    return ""
