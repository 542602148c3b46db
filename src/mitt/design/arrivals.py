"""The balls of throws where they arrive, and flights of such throws to learn from.

Both are drawn from the throws themselves, so that a map is learned on the balls that are thrown.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from mitt.ball.flight import acceleration, advance
from mitt.design.balls import BOX, FAR, Balls
from mitt.errors import MittError
from mitt.generator.flights import Flight
from mitt.generator.mapping import DirectMap
from mitt.robot.arm import Arm
from mitt.signals import Array
from mitt.trials.neighbourhood import Neighbourhood
from mitt.trials.source import ranges_of
from mitt.world.ballistics import fly
from mitt.world.throws import Aim, Throw, ThrowRanges, default_throw

#: Seed and number of the throws whose arrivals are measured.
_SEED, _THROWS = 33, 400
#: Centre of the box that they pass [m]: the catch point of the WAM's default throws
#: (docs/throws.md), for which the heights of all throws are stated.
_PLACE = np.array([0.77, 0.0, 0.057])
#: Shares of the throws that arrive slower, or less steeply, than what is taken.
_LEAST, _MIDDLE, _MOST = 0.05, 0.5, 0.95
#: Width of the box of learning flights in widths of that of the throws, its least half-width [m]:
#: as :mod:`mitt.trials.neighbourhood`.
_WIDER, _NARROWEST = np.array([2.0, 1.2, 1.35]), 0.03
#: When a ball may be kicked [s], how long a flight may be [s], and steps of the search for its
#: catch [s].
_KICKED, _LONGEST, _STEP = (0.15, 0.4), 1.1, 0.005
#: Shortest time from t_0 to the catch [s].
_SHORTEST = 0.2
#: Share of a joint's speed at the catch above which nothing is learned from a flight.
_AT_CATCH = 1.1


def arriving(ranges: ThrowRanges, aim: Array | None = None) -> Balls:
    """Return how the balls of throws arrive.

    Args:
        ranges: Of the throws, heights as for the WAM's aim.
        aim: Of the balls that are returned, shape (2, 3); None where a design may choose it.

    Raises:
        InputError: There are no such throws.
    """
    rng, half = np.random.default_rng(_SEED), FAR * np.array(BOX)
    place = Aim(position=np.copy, q_low=_PLACE - half, q_high=_PLACE + half)
    v = np.array([
        _passing(default_throw(rng, place, ranges), ranges.drag) for _ in range(_THROWS)
    ])  # fmt: skip
    speed = np.linalg.norm(v, axis=1)
    slow, middle, quick = np.quantile(speed, (_LEAST, _MIDDLE, _MOST)).tolist()
    flat, down, steep = np.quantile(np.arcsin(-v[:, 2] / speed), (_LEAST, _MIDDLE, _MOST)).tolist()
    return Balls(speed=middle, descent=down, speeds=(slow, quick), descents=(flat, steep), aim=aim)


def _passing(throw: Throw, drag: float) -> Array:
    """Return the velocity of a ball where it passes the middle of the box [m/s], shape (3,)."""
    r, v = throw.r.copy(), throw.dr.copy()
    while r[0] > _PLACE[0]:
        r, v = fly(r, v, drag=drag, duration=_STEP)
    return v


def shifted(ranges: ThrowRanges, arm: Arm) -> ThrowRanges:
    """Return ranges of throws with their own heights, raised as an arm's aim is above the WAM's."""
    by = ranges_of(arm).height[0] - ThrowRanges().height[0]
    return replace(ranges, height=(ranges.height[0] + by, ranges.height[1] + by))


def flights_of(
    f: DirectMap, ranges: ThrowRanges, rng: np.random.Generator, settings: Neighbourhood
) -> list[Flight]:
    """Draw flights of throws at a map's arm; those that are never caught are redrawn.

    Args:
        f: The map.
        ranges: Of the throws, heights as for the WAM's aim.
        rng: Source of randomness.
        settings: How many, how well they are known, and how many are kicked; where they arrive
            follows from the throws.
    """
    assert f.arm.model.aim is not None
    at, half = f.arm.model.aim[0], np.maximum(_WIDER * f.arm.model.aim[1], _NARROWEST)
    place = Aim(position=np.copy, q_low=at - half, q_high=at + half)
    ranges, flights = shifted(ranges, f.arm), list[Flight]()
    for _ in range(20 * settings.flights):
        if len(flights) == settings.flights:
            break
        drag = float(rng.uniform(*settings.drag))
        try:
            throw = default_throw(rng, place, replace(ranges, drag=drag))
        except MittError:
            break
        flight = _flight(f, throw, drag, rng, settings)
        if flight is not None:
            flights.append(flight)
    return flights


def _flight(
    f: DirectMap, throw: Throw, drag: float, rng: np.random.Generator, settings: Neighbourhood
) -> Flight | None:
    """Return a throw from t_0 to a little past its catch; None where there is no catch."""
    t_0, when = float(rng.uniform(*settings.t_0)), float(rng.uniform(*_KICKED))
    kick = np.zeros(3)
    if rng.random() < settings.kicked:
        kick = rng.standard_normal(3)
        kick *= settings.kick * rng.random() / np.linalg.norm(kick)

    def ball(t: float) -> Array:
        r, dr = throw.r.copy(), throw.dr.copy()
        advance(r, dr, drag, min(t, when))
        if t > when:
            dr += kick
            advance(r, dr, drag, t - when)
        ddr = np.zeros(3)
        acceleration(dr, drag, ddr)
        return np.array([r, dr, ddr])

    t_c = _catch(f, ball, t_0)
    if t_c is None or t_c < t_0 + _SHORTEST:
        return None
    t = np.linspace(t_0, t_c + settings.after, settings.instants)
    rows = np.array([ball(float(x)) for x in t])
    if np.isfinite(settings.hopeless) and _too_fast(f, rows, settings.hopeless):
        return None
    seen = rows[0].copy()
    seen[0] += settings.sigma_r * rng.standard_normal(3)
    seen[1] += settings.sigma_dr * rng.standard_normal(3)
    return Flight(t=t, ball=rows, seen=seen)


def _catch(f: DirectMap, ball: Callable[[float], Array], t_0: float) -> float | None:
    """Return when q_o,i first reaches q_alpha after t_0 [s]; None where it does not."""
    last, still = 0.0, np.zeros(3)
    for t in np.arange(t_0, _LONGEST, _STEP).tolist():
        inside, rows = f.virtual(np.array([ball(t)[0], still, still]))
        if not inside:
            return None
        gap = float(rows[0, f.design.catch_joint]) - f.design.q_catch
        if last * gap < 0.0:
            return float(t - _STEP * gap / (gap - last))
        last = gap
    return None


def _too_fast(f: DirectMap, rows: Array, share: float) -> bool:
    """Say whether l_c^-1 asks more than a share of a joint's speed, or at the catch too much."""
    for k, motion in enumerate(rows):
        inside, virtual = f.virtual(motion)
        most = _AT_CATCH if k == len(rows) - 1 else share
        if not inside or bool(np.any(np.abs(virtual[1]) > most * f.arm.dq_max)):
            return True
    return False
