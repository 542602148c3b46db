"""Flights from which batting is learned: how balls come, and how each is struck.

Drawn where they end, as those of :mod:`mitt.core.map.neighbourhood`: about a place, with a speed
and a direction there, and flown backwards. Each is struck at the instant within the settings' time
about that place at which the strike is easiest. All are believed slightly wrongly at t_0.
"""

from dataclasses import replace

import numpy as np

from mitt.core import checks
from mitt.core.ball.flight import acceleration, advance
from mitt.core.catcher.batting import BattingSettings
from mitt.core.errors import InputError
from mitt.core.map.batting import BattingMap, easiest, learn_batting
from mitt.core.map.learn import Flight, Learned, LearnSettings
from mitt.core.map.neighbourhood import LEARNING_SEED, Neighbourhood
from mitt.core.map.striking import PaddleStrike
from mitt.core.signals import Array

#: How balls come to a paddle: those of the default throws that are aimed at a box before the arm.
STRUCK = Neighbourhood(
    flights=100,
    kicked=0.0,
    bounced=0.0,
    after=0.008,
    box=(0.05, 0.15, 0.1),
    arrival=(4.8, 6.9),
    descent=(0.3, 0.75),
    azimuth=(-0.12, 0.12),
    flight=(0.38, 0.55),
    t_0=(0.0, 0.0),
)
#: Draws for each flight that is wanted, at most.
_DRAWS = 10


def learn_strikes(
    g: BattingMap,
    batting: BattingSettings,
    place: Array,
    *,
    around: Neighbourhood = STRUCK,
    spread: tuple[float, float, float] = (0.0, 0.0, 0.0),
    seed: int = LEARNING_SEED,
    settings: LearnSettings | None = None,
) -> tuple[BattingMap, Learned]:
    """Learn a batting map over balls that come to a place.

    Args:
        g: The map, unlearned.
        batting: Target and impact.
        place: Middle of where balls are struck [m], shape (3,).
        around: How they come there; kicks and bounces are left out.
        spread: By how much the target lies elsewhere, at most, along each axis [m].
        seed: Of the flights.
        settings: How to learn.

    Raises:
        InputError: Fewer than one ball in ten can be struck so.
    """
    place, rng = checks.vector("place", place, 3, finite=True), np.random.default_rng(seed)
    flights = list[tuple[Flight, PaddleStrike]]()
    for _ in range(_DRAWS * around.flights):
        drawn = _drawn(g, batting, place, around, (rng, np.array(spread)))
        flights += [] if drawn is None else [drawn]
        if len(flights) == around.flights:
            return learn_batting(g, flights, settings=settings)
    raise InputError(
        "place",
        "one where balls can be struck towards the target",
        place.tolist(),
        do="move target or place, or leave another joint free",
    )


def _drawn(
    g: BattingMap,
    batting: BattingSettings,
    place: Array,
    around: Neighbourhood,
    of: tuple[np.random.Generator, Array],
) -> tuple[Flight, PaddleStrike] | None:
    """Draw a flight, and how its ball is struck; None where it cannot be."""
    rng, spread = of
    drag = float(rng.uniform(*around.drag))
    r = place + np.array(around.box) * rng.uniform(-1.0, 1.0, 3)
    down, side = rng.uniform(*around.descent), rng.uniform(*around.azimuth)
    ahead = np.cos(down)
    v = -rng.uniform(*around.arrival) * np.array(
        [ahead * np.cos(side), ahead * np.sin(side), np.sin(down)]
    )
    target = None if batting.aim is None else batting.aim + spread * rng.uniform(-1.0, 1.0, 3)
    lasts, noise = float(rng.uniform(*around.flight)), rng.standard_normal((2, 3))
    impact = replace(batting.impact, drag=drag)

    def met(dt: float) -> tuple[float, PaddleStrike] | None:
        strike = g.strike(_row(r, v, dt, drag)[:2], target, impact)
        if strike is None or not g.aims(strike, target):
            return None
        return g.ease(strike, g.arm.q_ready, lasts + dt), strike

    found = easiest(met, batting.window(0.0))
    best = found[0][1] if found and found[0][1][0] < np.inf else None
    if best is None:
        return None
    ball_met = best[1].ball
    t = np.append(np.linspace(0.0, lasts, around.instants - 1), lasts + around.after)
    ball = np.array([_row(ball_met[0], ball_met[1], x - lasts, drag) for x in t])
    seen = ball[0].copy()
    seen[:2] += noise * [[around.sigma_r], [around.sigma_dr]]
    return Flight(t=t, ball=ball, seen=seen), best[1]


def _row(r: Array, v: Array, dt: float, drag: float) -> Array:
    """Return r_o, dr_o, ddr_o of a flight so much later [s], shape (3, 3)."""
    row = np.array([r, v, np.zeros(3)])
    advance(row[0], row[1], drag, dt)
    acceleration(row[1], drag, row[2])
    return row
