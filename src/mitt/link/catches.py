"""What arm and eyes say of a catch in the live loop, kept as it comes; nothing is allocated."""

from typing import final

import numpy as np

from mitt.catcher.catcher import Catcher
from mitt.catcher.settings import BRAKE, FOLLOW
from mitt.robot.arm import Arm
from mitt.signals import TICK, Array, Senses
from mitt.vision.calibration.caught import FARTHEST, Catch, ClockOffset, caught_offset

#: Ticks and sightings that are kept: the longest brake takes a second, and a clock may be off.
_KEPT = 1500


@final
class CatchNotes:
    """The newest readings and sightings of a throw, until its arm rests."""

    def __init__(self, arm: Arm) -> None:
        """Make room for an arm's readings."""
        self._arm, self._read, self._saw = arm, 0, 0
        self._t, self._q = np.zeros(_KEPT), np.zeros((_KEPT, arm.n))
        self._t_seen, self._seen = np.zeros(_KEPT), np.zeros((_KEPT, 4, 3))
        t = np.linspace(0.0, 0.1, 100)  # what is compiled is loaded now, not beside a moving arm
        caught_offset(arm, Catch(
            t_arm=t, q=np.tile(arm.q_ready, (100, 1)), t_seen=t, seen=np.zeros((100, 3)),
            covariance=np.tile(np.eye(3), (100, 1, 1)), t_brake=0.0, t_rest=0.1,
        ))  # fmt: skip

    def clear(self) -> None:
        """Begin for another throw."""
        self._read = self._saw = 0

    def note(self, senses: Senses, catcher: Catcher) -> None:
        """Keep what a tick was given and has found.

        Args:
            senses: What it was given.
            catcher: That made it.
        """
        out, s = catcher.result.scalars[0], catcher.state.scalars[0]
        if out["phase"] not in (FOLLOW, BRAKE) or out["t"] > s["t_rest"] + FARTHEST > 0.0:
            return
        k = self._read % _KEPT
        self._t[k], self._q[k] = senses.arm.t, senses.arm.q
        self._read += 1
        if out["sighted"]:
            self._see(out["t_sighted"], catcher.result.sighting[0], catcher.result.sighting[1:])
        for point in senses.points:
            if point.found:
                self._see(point.t, point.r_o, point.covariance)

    def _see(self, t: float, r_o: Array, covariance: Array) -> None:
        """Keep a sighting."""
        k = self._saw % _KEPT
        self._t_seen[k], self._seen[k, 0], self._seen[k, 1:] = t, r_o, covariance
        self._saw += 1

    def offset(self, catcher: Catcher) -> ClockOffset:
        """Return what they say of the clocks, once the arm rests."""
        s = catcher.state.scalars[0]
        read = np.argsort(self._t[: min(self._read, _KEPT)], kind="stable")
        saw = slice(0, min(self._saw, _KEPT))
        rising = read[np.append(True, np.diff(self._t[read]) > 0.1 * TICK)] if len(read) else read
        return caught_offset(self._arm, Catch(
            t_arm=self._t[rising], q=self._q[rising], t_seen=self._t_seen[saw],
            seen=self._seen[saw, 0], covariance=self._seen[saw, 1:],
            t_brake=s["t_brake"].item(), t_rest=s["t_rest"].item(),
        ))  # fmt: skip
