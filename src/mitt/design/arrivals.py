"""The balls of throws where they arrive, and flights of such throws to learn from.

Both are drawn from the throws themselves, so that a map is learned on the balls that are thrown.
"""

from dataclasses import replace

import numpy as np

from mitt.design.balls import BOX, FAR, Balls
from mitt.errors import MittError
from mitt.generator.flights import Flight
from mitt.generator.mapping import DirectMap
from mitt.robot.arm import Arm
from mitt.signals import Array
from mitt.trials.neighbourhood import NARROWEST, WIDER, Neighbourhood, kicked, sampled
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
#: Steps in which a throw is followed to the box [s].
_STEP = 0.005


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
    at, half = f.arm.model.aim[0], np.maximum(WIDER * f.arm.model.aim[1], NARROWEST)
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
        is_kicked = bool(rng.random() < settings.kicked)
        motion = kicked(throw.r, throw.dr, drag, rng, settings, is_kicked)
        flight = sampled(f, motion, drag, rng, settings)
        if flight is not None:
            flights.append(flight)
    return flights
