"""The offset between the clock of the cameras and that of the arm, from a ball in a moving hand.

The hand's path is known at the arm's times, the ball's at the cameras'. With offset d the ball
seen at t is where the hand was at t + d, up to a constant gap (a ball that does not sit exactly
at the catch point, a rig that stands a little off).
"""

from dataclasses import dataclass, replace

import numpy as np

from mitt.errors import InputError
from mitt.signals import Array

#: Fewest sightings, and the step in which a first offset is looked for [s].
FEWEST, _STEP = 20, 0.002


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ClockProblem:
    """Two records of one motion, and the offset that should lay them on each other.

    Attributes:
        t_seen: Times of the sightings, cameras' clock [s], shape (n,).
        seen: Ball [m], shape (n, 3).
        t_arm: Times of the hand, arm's clock, rising [s], shape (m,).
        hand: Catch point [m], shape (m, 3).
        offset: Arm's clock minus cameras' clock [s].
        gap: Ball minus catch point [m], shape (3,).
    """

    t_seen: Array
    seen: Array
    t_arm: Array
    hand: Array
    offset: float = 0.0
    gap: Array

    @property
    def names(self) -> tuple[str, ...]:
        """The offset and the gap."""
        return ("offset", "gap_x", "gap_y", "gap_z")

    def residuals(self) -> Array:
        """Return seen minus predicted [m], shape (3 n,)."""
        return np.asarray((self.seen - self._at(self.hand) - self.gap).ravel())

    def jacobian(self) -> Array:
        """Return the derivative of the predicted positions, shape (3 n, 4)."""
        J = np.zeros((len(self.t_seen), 3, 4))
        J[:, :, 0] = self._at(np.gradient(self.hand, self.t_arm, axis=0))
        J[:, :, 1:] = np.eye(3)
        return J.reshape(-1, 4)

    def moved(self, step: Array) -> "ClockProblem":
        """Return the problem with offset and gap moved by a step."""
        return replace(self, offset=self.offset + float(step[0]), gap=self.gap + step[1:])

    def _at(self, values: Array) -> Array:
        """Return what the arm's log says at the sightings, shape (n, 3)."""
        t = self.t_seen + self.offset
        return np.column_stack([np.interp(t, self.t_arm, v) for v in values.T])


def clock_problem(
    *, t_seen: Array, seen: Array, t_arm: Array, hand: Array, search: float
) -> ClockProblem:
    """Return the problem at the best of many offsets, with the sightings inside the arm's log.

    Args:
        t_seen: Times of the sightings, cameras' clock [s], shape (n,).
        seen: Ball [m], shape (n, 3).
        t_arm: Times of the hand, arm's clock, rising [s], shape (m,).
        hand: Catch point [m], shape (m, 3).
        search: Largest offset looked for, either way [s].

    Raises:
        InputError: At no offset do the records overlap by ``FEWEST`` sightings.
    """
    if len(t_arm) < FEWEST:
        raise InputError("arm log", f"{FEWEST} rows or more", len(t_arm))
    best: tuple[float, ClockProblem] | None = None
    wanted = min(FEWEST, len(t_seen))
    for offset in np.arange(-search, search + _STEP, _STEP):
        t = t_seen + offset
        inside = (t > t_arm[0] + _STEP) & (t < t_arm[-1] - _STEP)
        if inside.sum() < max(wanted, 0.5 * len(t_seen)):
            continue
        trial = ClockProblem(
            t_seen=t_seen[inside], seen=seen[inside], t_arm=t_arm, hand=hand,
            offset=float(offset), gap=np.zeros(3),
        )  # fmt: skip
        r = trial.residuals().reshape(-1, 3)
        gap = np.median(r, axis=0)
        cost = float(np.mean(np.abs(r - gap)))
        if best is None or cost < best[0]:
            best = (cost, replace(trial, gap=gap))
    if best is None or len(t_seen) < FEWEST:
        raise InputError(
            "clock offset",
            f"{FEWEST} sightings that overlap the arm's log within +-{search:g} s",
            f"{len(t_seen)} sightings", do="compare the times in both files or widen --search",
        )  # fmt: skip
    return best[1]
