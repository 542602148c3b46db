"""What arm and eyes said of a catch, kept tick by tick, and what that says of their clocks.

A flight that is shifted in time is a flight, so a wrong clock shows at the hand alone. A ball that
rides on the braking hand tells by how much (:mod:`mitt.core.eyes.clock_offset`); one that by its
stamps went through the hand, and was seen to fly on, tells that it was elsewhere.
"""

from typing import final

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.ball.filter import predict
from mitt.core.catcher.settings import BRAKE, FOLLOW
from mitt.core.catcher.state import CatcherState, Result
from mitt.core.eyes.clock_offset import (
    FARTHEST,
    WARNED,
    CatchSeen,
    ClockOffset,
    LearnedClock,
    caught_offset,
)
from mitt.core.signals import TICK, Array, Senses

#: Ticks and sightings that are kept: the longest brake takes a second, and a clock may be off.
_KEPT = 1500
#: Standard deviations by which an offset exceeds the one that costs catches: of 700 one is wrong.
_SURE = 3.0
#: Balls in a row that are lost on one side of the hand before that is said.
_STRUCK = 2
#: By its stamps the ball was in the hand [m]; it flies on within so much of its forecast, while it
#: is that far from the hand [m]; sightings that have to say so, and the time after which they do
#: not count, as the ball may have bounced [s].
_INSIDE = 0.03
_ON_FORECAST = 0.05
_OUTSIDE = 0.12
_FLOWN = 3
_SHORTLY = 0.25
#: How many sightings after the catch are asked at most: a loop waits for the answer.
_ASKED = 25
#: Age of a sighting in its tick below which it is stamped on arrival [s].
_AT_ONCE = 0.5 * TICK


def catch_of(
    state: CatcherState, t_arm: Array, q: Array, seen: tuple[Array, Array, Array]
) -> CatchSeen:
    """Return what arm and eyes said of a catch, in the order of stamps.

    Args:
        state: Of the catcher, once its arm has braked.
        t_arm: Stamps of the readings [s], shape (m,).
        q: The readings [rad], shape (m, n).
        seen: Stamps of the sightings [s], (k,), positions [m], (k, 3), covariances, (k, 3, 3).
    """
    s, t_seen = state.scalars[0], seen[0]
    order = np.argsort(t_arm, kind="stable")
    order = order[np.diff(t_arm[order], prepend=-np.inf) > 0.1 * TICK]
    t_seen, r_o, covariance = (x[np.argsort(t_seen, kind="stable")] for x in seen)
    return CatchSeen(
        t_arm=t_arm[order],
        q=q[order],
        t_seen=t_seen,
        seen=r_o,
        covariance=covariance,
        t_brake=s["t_brake"].item(),
        t_rest=s["t_rest"].item(),
    )


@final
class CatchNotes:
    """The newest readings and sightings of a throw, until its arm rests."""

    def __init__(self, arm: Arm) -> None:
        """Begin without any for an arm; room for them is made with the first."""
        self._arm, self._read, self._saw, self._aged = arm, 0, 0, 0
        self._readings = np.zeros(0, [("t", float), ("q", float, arm.n)])
        self._sightings = np.zeros(0, [("t", float), ("r_o", float, 3), ("cov", float, (3, 3))])

    def note(self, senses: Senses, state: CatcherState, result: Result) -> None:
        """Keep what a tick was given and has found."""
        out, s = result.scalars[0], state.scalars[0]
        if out["phase"] not in (FOLLOW, BRAKE) or out["t"] > s["t_rest"] + FARTHEST > 0.0:
            return
        if self._read == 0:
            self._readings = np.zeros(_KEPT, self._readings.dtype)
            self._sightings = np.zeros(_KEPT, self._sightings.dtype)
        self._readings[self._read % _KEPT] = senses.arm.t, senses.arm.q
        self._read += 1
        if out["sighted"]:
            self._see(out["t_sighted"], result.sighting[0], result.sighting[1:])
        for point in senses.points:
            if point.found:
                self._aged += senses.t - point.t > _AT_ONCE
                self._see(point.t, point.r_o, point.covariance)

    def _see(self, t: float, r_o: Array, covariance: Array) -> None:
        """Keep a sighting."""
        self._sightings[self._saw % _KEPT] = t, r_o, covariance
        self._saw += 1

    def _catch(self, state: CatcherState) -> CatchSeen:
        """Return what was kept."""
        read, saw = self._readings[: self._read], self._sightings[: self._saw]
        return catch_of(state, read["t"], read["q"], (saw["t"], saw["r_o"], saw["cov"]))

    def offset(self, state: CatcherState) -> ClockOffset:
        """Return what they say of the clocks, once the arm rests."""
        return caught_offset(self._arm, self._catch(state))

    def hint(self, state: CatcherState, clock: LearnedClock) -> str | None:
        """Return what they say of a likely mistake, once the arm rests; None for nothing.

        The clock is what earlier catches say; it learns from this one.
        """
        if self._read == 0 or not np.isfinite(state.scalars[0]["t_brake"]):
            return None
        of = self._catch(state)
        clock.take(caught_offset(self._arm, of), 0.0)
        if clock.count > 0 and abs(clock.offset) > WARNED + _SURE * clock.sigma:
            side = "older" if clock.offset < 0.0 else "newer"
            return (
                f"sightings are {1e3 * abs(clock.offset):.0f} ms {side} than their stamps, as"
                " the ball in the braking hand says: stamp each with the time of its"
                " exposure, by the clock of the ticks"
            )
        if clock.count == 0 and abs(clock.struck) >= _STRUCK:
            side = "older" if clock.struck < 0 else "newer"
            return (
                f"{abs(clock.struck)} balls in a row were struck and lost on one side of the"
                f" hand, as where sightings are some ms {side} than their stamps: stamp each"
                " with the time of its exposure, by the clock of the ticks"
            )
        if not self._flew_on(of, state):
            return None
        if self._aged == 0:
            return (
                "the ball flew on through the hand, and sightings are stamped as they arrive:"
                " stamp each with the time of its exposure"
            )
        return (
            "the ball flew on through the hand: it was elsewhere, as where stamps are some ms"
            " off, or positions in another frame; or nothing holds it, in a simulation without"
            " contact"
        )

    def _flew_on(self, of: CatchSeen, state: CatcherState) -> bool:
        """Say whether the ball, which by its stamps was in the hand, was seen to fly on."""
        since = of.t_seen - of.t_brake
        off = np.where(np.isfinite(of.q).all(axis=1), np.abs(of.t_arm - of.t_brake), np.inf)
        near = [k for k in np.argsort(off, kind="stable") if off[k] < 0.02]
        passed, motion, covariance = 0, np.zeros((3, 3)), np.zeros((6, 6))

        def gap(k: int, t: float) -> float:
            """Return the distance of the forecast from the hand [m]; infinite without one."""
            known = predict(state.ball_filter, t, motion, covariance)
            hand = self._arm.position(of.q[k])
            return float(np.linalg.norm(motion[0] - hand)) if known else np.inf

        if not any(gap(int(k), of.t_arm[k]) < _INSIDE for k in near):
            return False
        after = np.flatnonzero((since > 0.0) & (since < _SHORTLY))
        for i in after[:: max(-(-len(after) // _ASKED), 1)]:
            k = min(int(np.searchsorted(of.t_arm, of.t_seen[i])), len(of.t_arm) - 1)
            if not np.isfinite(of.q[k]).all():
                continue
            away = np.linalg.norm(of.seen[i] - self._arm.position(of.q[k]))
            if away > _OUTSIDE - _ON_FORECAST and _OUTSIDE < gap(k, of.t_seen[i]) < np.inf:
                passed += bool(np.linalg.norm(of.seen[i] - motion[0]) < _ON_FORECAST)
        return passed >= _FLOWN
