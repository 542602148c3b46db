"""The neighbourhood of flights to learn from: default throws, kicked ones, bounced ones.

The learner sees what can happen, not what will: a share of the flights changes its velocity on
the way, by a kick or by a bounce off a surface that nobody announced, and all are believed
slightly wrongly at t_0.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mitt.flight import acceleration, advance
from mitt.generator.design import nominal_catch
from mitt.generator.flights import Flight
from mitt.generator.mapping import DirectMap
from mitt.robot.arm import Arm
from mitt.signals import Array
from mitt.world.throws import Aim, default_throw


@dataclass(frozen=True, slots=True, kw_only=True)
class Neighbourhood:
    """What kinds of flights there are, and how well they are known.

    Attributes:
        flights: Number of flights.
        instants: Instants of each at which limits and cost are reckoned.
        kicked: Share of flights that are kicked on the way.
        bounced: Share of flights that bounce on the way.
        kick: Largest kick [m/s].
        t_0: Range of the time after release at which the arm starts [s]: as soon as the ball is
            known well enough, and at the latest 80 ms after first sight.
        after: Time after the catch that is still followed [s].
        sigma_r: Error of the position believed at t_0, 1 sigma an axis [m].
        sigma_dr: Error of the velocity believed at t_0, 1 sigma an axis [m/s].
        drag: Range of the drag coefficient [1/m].
    """

    flights: int = 120
    instants: int = 30
    kicked: float = 0.25
    bounced: float = 0.2
    kick: float = 0.7
    t_0: tuple[float, float] = (0.02, 0.085)
    after: float = 0.01
    sigma_r: float = 0.003
    sigma_dr: float = 0.1
    drag: tuple[float, float] = (0.03, 0.05)


#: A motion of the ball: time [s] to position [m] and velocity [m/s].
_Motion = Callable[[float], tuple[Array, Array]]
#: Longest flight considered [s], and the grid on which the catch is looked for [s].
_LONGEST, _GRID = 1.1, 0.005
#: Drag of the flights that bounce, a table-tennis ball's (facts of the recorded flights) [1/m].
_BOUNCED_DRAG = 0.1


def aim_of(arm: Arm) -> Aim:
    """Return where default throws are aimed: design of the contract, q1 +-0.3, q2 pi/4 +-0.22.

    The ready pose gives the centre of the box, so other arms have theirs.
    """
    middle, half = nominal_catch(arm), np.zeros(arm.n)
    half[:2] = 0.3, 0.22
    return Aim(position=arm.position, q_low=middle - half, q_high=middle + half)


def neighbourhood(
    f: DirectMap, rng: np.random.Generator, settings: Neighbourhood | None = None
) -> list[Flight]:
    """Draw flights around the catch region of a map; those that never reach it are redrawn."""
    settings = settings or Neighbourhood()
    flights: list[Flight] = []
    for _ in range(20 * settings.flights):
        if len(flights) == settings.flights:
            break
        motion, drag = _draw(f, rng, settings)
        flight = _sampled(f, motion, drag, rng, settings)
        if flight is not None:
            flights.append(flight)
    return flights


def _draw(f: DirectMap, rng: np.random.Generator, settings: Neighbourhood) -> tuple[_Motion, float]:
    """Draw one motion of the ball and its drag."""
    drag, kind = float(rng.uniform(*settings.drag)), rng.random()
    aim = aim_of(f.arm)
    if kind < settings.bounced:
        return _bounced(aim, rng), _BOUNCED_DRAG
    throw = default_throw(rng, aim)
    change = np.zeros(3)
    t_change = float(rng.uniform(0.15, 0.4))
    if kind < settings.bounced + settings.kicked:
        change = rng.standard_normal(3)
        change *= settings.kick * rng.random() / np.linalg.norm(change)

    def motion(t: float) -> tuple[Array, Array]:
        r, dr = throw.r.copy(), throw.dr.copy()
        advance(r, dr, drag, min(t, t_change))
        if t > t_change:
            dr += change
            advance(r, dr, drag, t - t_change)
        return r, dr

    return motion, drag


def _bounced(aim: Aim, rng: np.random.Generator) -> _Motion:
    """Draw a flight that bounces off a level surface shortly before it passes an aim point.

    Drawn backwards from the aim point. Speeds after and losses at the bounce as in the recorded
    table-tennis flights: 1.6 to 3.5 m/s, 0.75 to 0.9 of the vertical speed kept, 0.55 to 0.85 of
    the horizontal.
    """
    r_aim = aim.position(rng.uniform(aim.q_low, aim.q_high))
    dr_aim = np.array([-rng.uniform(1.6, 3.5), rng.uniform(-0.3, 0.3), rng.uniform(0.3, 2.2)])
    since, before = float(rng.uniform(0.08, 0.25)), float(rng.uniform(0.4, 0.55))
    kept = np.array([1.0, 1.0, 0.0]) * rng.uniform(0.55, 0.85)
    kept[2] = -rng.uniform(0.75, 0.9)
    r_up, dr_up = r_aim.copy(), dr_aim.copy()
    advance(r_up, dr_up, _BOUNCED_DRAG, -since)
    r_0, dr_0 = r_up.copy(), dr_up / kept
    advance(r_0, dr_0, _BOUNCED_DRAG, -before)

    def motion(t: float) -> tuple[Array, Array]:
        r, dr = (r_0.copy(), dr_0.copy()) if t < before else (r_up.copy(), dr_up.copy())
        advance(r, dr, _BOUNCED_DRAG, t if t < before else t - before)
        return r, dr

    return motion


def _sampled(
    f: DirectMap, motion: _Motion, drag: float, rng: np.random.Generator, settings: Neighbourhood
) -> Flight | None:
    """Return the flight from t_0 to a little past the catch; None where there is no catch."""
    t_0 = float(rng.uniform(*settings.t_0))
    t_c = _catch_time(f, motion, t_0)
    if t_c is None or t_c < t_0 + 0.2:
        return None
    t = np.linspace(t_0, t_c + settings.after, settings.instants)
    ball = np.array([_row(motion, x, drag) for x in t])
    seen = ball[0].copy()
    seen[0] += settings.sigma_r * rng.standard_normal(3)
    seen[1] += settings.sigma_dr * rng.standard_normal(3)
    return Flight(t=t, ball=ball, seen=seen)


def _row(motion: _Motion, t: float, drag: float) -> Array:
    """Return r_o, dr_o, ddr_o, shape (3, 3)."""
    r, dr = motion(t)
    ddr = np.zeros(3)
    acceleration(dr, drag, ddr)
    return np.array([r, dr, ddr])


def _catch_time(f: DirectMap, motion: _Motion, t_0: float) -> float | None:
    """Return when q_o,i first reaches q_alpha after ``t_0``; None where it does not."""
    i, last = f.design.catch_joint, 0.0
    for t in np.arange(t_0, _LONGEST, _GRID):
        inside, rows = f.virtual(np.array([motion(float(t))[0], np.zeros(3), np.zeros(3)]))
        if not inside:
            return None
        s = rows[0, i] - f.design.q_catch
        if last != 0.0 and last * s <= 0.0:
            return float(t - _GRID * s / (s - last))
        last = s
    return None
