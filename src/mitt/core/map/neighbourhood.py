"""Learning a map with everything that is silent filled in, and the flights to learn from.

The flights are not the throws that a run makes (:mod:`mitt.lab.world.throws`; docs/throws.md has
both). A learning flight is drawn where it ends: a point of a box in space about the nominal catch,
a speed and a direction there, and it is flown backwards to its release. Its ranges are wider than
those of the default throws, and all are centred on the arm, so other arms have theirs; the drag is
that of the ball.

The learner sees what can happen, not what will: a share of the flights changes its velocity on
the way, by a kick or by a bounce off a surface that nobody announced, and all are believed
slightly wrongly at t_0.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from mitt.core import checks
from mitt.core.arm.arm import Arm
from mitt.core.arm.description import ArmModel
from mitt.core.ball.flight import acceleration, advance
from mitt.core.errors import InputError
from mitt.core.fields import Range, Settings
from mitt.core.map.learn import Flight, Learned, LearnSettings, learn_from
from mitt.core.map.map_design import MapDesign, catch_place, default_design
from mitt.core.map.mapping import DirectMap, unlearned
from mitt.core.map.tangent import to_go
from mitt.core.signals import Array, BallState


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Neighbourhood(Settings):
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
        sigma_r: Error of the position estimated at t_0, 1 sigma an axis [m].
        sigma_dr: Error of the velocity estimated at t_0, 1 sigma an axis [m/s].
        drag: Range of the drag coefficient [1/m].
        box: Half-widths of the box of arrivals about the nominal catch point [m], (x, y, z).
        arrival: Speed of the ball there [m/s].
        descent: Angle by which it comes down there [rad].
        azimuth: Where it comes from, seen from there, off the direction of +x [rad].
        flight: Time of its flight before that [s].
        max_speed_share: Share of a joint's speed above which l_c^-1 asks for what no learned map
            catches; such flights are redrawn. At the catch 1.3, if finite and no match is weighed.
    """

    flights: Annotated[int, Range(1, 10**6)] = 120
    instants: Annotated[int, Range(2, 10**5)] = 30
    kicked: Annotated[float, Range(0.0, 1.0)] = 0.25
    bounced: Annotated[float, Range(0.0, 1.0)] = 0.2
    kick: Annotated[float, Range(0.0, 100.0)] = 0.7
    t_0: Annotated[tuple[float, float], Range(0.0, 100.0)] = (0.02, 0.085)
    after: Annotated[float, Range(0.0, 10.0)] = 0.01
    sigma_r: Annotated[float, Range(0.0, 10.0)] = 0.003
    sigma_dr: Annotated[float, Range(0.0, 100.0)] = 0.1
    drag: Annotated[tuple[float, float], Range(0.0, 10.0)] = (0.03, 0.05)
    box: Annotated[tuple[float, float, float], Range(0.0, 100.0)] = (0.08, 0.28, 0.24)
    arrival: Annotated[tuple[float, float], Range(1e-3, 1e3)] = (4.5, 7.3)
    descent: Annotated[tuple[float, float], Range(-1.6, 1.6)] = (0.24, 0.78)
    azimuth: Annotated[tuple[float, float], Range(-7.0, 7.0)] = (-0.15, 0.15)
    flight: Annotated[tuple[float, float], Range(1e-3, 100.0)] = (0.42, 0.65)
    max_speed_share: Annotated[float, Range(1e-6, np.inf)] = np.inf


def neighbourhood_of_ball(drag: float) -> Neighbourhood:
    """Return the flights to learn from for a ball with a drag coefficient [1/m]: a quarter off."""
    return Neighbourhood(drag=(0.75 * drag, 1.25 * drag))


#: A motion of the ball: time [s] to position [m] and velocity [m/s].
Motion = Callable[[float], tuple[Array, Array]]
#: Time after the time of flight in which the catch is still looked for [s], on which grid [s], and
#: every how many of its instants at first.
_LATER = 0.45
_GRID = 0.005
_STRIDE = 6
#: Share of a joint's speed that l_c^-1 may ask for at the catch: above 1 the hand is a little late,
#: which fingers allow. Four designs caught as many or more with 1.3 as with 1.1; with 1.6 no more.
_AT_CATCH = 1.3
#: For an arm that says where it wants its balls: width of the box of arrivals in widths of the box
#: that is aimed at, and its least half-width [m].
WIDER = np.array([2.0, 1.2, 1.35])
NARROWEST = 0.03
#: Drag of the flights that bounce, a table-tennis ball's (facts of the recorded flights) [1/m].
_BOUNCED_DRAG = 0.1


def neighbourhood(
    f: DirectMap, rng: np.random.Generator, settings: Neighbourhood | None = None
) -> list[Flight]:
    """Draw flights around the catch region of a map; those that never reach it are redrawn."""
    settings = _about(settings or Neighbourhood(), f.arm.model)
    flights: list[Flight] = []
    for _ in range(20 * settings.flights):
        if len(flights) == settings.flights:
            break
        motion, drag = _draw(f, rng, settings)
        flight = sampled(f, motion, drag, rng, settings)
        if flight is not None:
            flights.append(flight)
    return flights


def _about(settings: Neighbourhood, model: ArmModel) -> Neighbourhood:
    """Return settings for an arm that says where it wants its balls: that box, and a margin.

    Default throws there do not bounce, so none of these flights does. What is not as usual in the
    settings stays as it is given.
    """
    if model.aim is None:
        return settings
    x, y, z = np.maximum(WIDER * model.aim[1], NARROWEST).tolist()
    own: dict[str, float | tuple[float, ...]] = {"box": (x, y, z)}
    if model.arrivals is None:
        own["bounced"] = 0.0
    else:
        names = ("arrival", "descent", "azimuth", "flight")
        own |= {name: tuple(row) for name, row in zip(names, model.arrivals.tolist(), strict=True)}
    usual = Neighbourhood()
    unsaid = {k: x for k, x in own.items() if getattr(settings, k) == getattr(usual, k)}
    return replace(settings, **unsaid)  # type: ignore[arg-type]


def _draw(f: DirectMap, rng: np.random.Generator, settings: Neighbourhood) -> tuple[Motion, float]:
    """Draw one motion of the ball and its drag."""
    drag, kind = float(rng.uniform(*settings.drag)), rng.random()
    arrival = catch_place(f.arm) + np.array(settings.box) * rng.uniform(-1.0, 1.0, 3)
    if kind < settings.bounced:
        return _bounced(arrival, rng, float(np.mean(settings.azimuth))), _BOUNCED_DRAG
    release = _release(arrival, drag, rng, settings)
    return kicked(*release, drag, rng, settings, kind < settings.bounced + settings.kicked), drag


def kicked(
    r_0: Array,
    dr_0: Array,
    drag: float,
    rng: np.random.Generator,
    settings: Neighbourhood,
    is_kicked: bool,
) -> Motion:
    """Return a flight from its release [m, m/s], shape (3,) each, and draw its kick, if it has one.

    ``drag`` in 1/m.
    """
    change, t_change = np.zeros(3), float(rng.uniform(0.15, 0.4))
    if is_kicked:
        change = rng.standard_normal(3)
        change *= settings.kick * rng.random() / np.linalg.norm(change)

    def motion(t: float) -> tuple[Array, Array]:
        r, dr = r_0.copy(), dr_0.copy()
        advance(r, dr, drag, min(t, t_change))
        if t > t_change:
            dr += change
            advance(r, dr, drag, t - t_change)
        return r, dr

    return motion


def _release(
    arrival: Array, drag: float, rng: np.random.Generator, settings: Neighbourhood
) -> tuple[Array, Array]:
    """Draw how a ball arrives at a point [m], shape (3,), and return its release [m, m/s]."""
    speed = float(rng.uniform(*settings.arrival))
    down, side = rng.uniform(*settings.descent), rng.uniform(*settings.azimuth)
    ahead, r = np.cos(down), arrival.copy()
    dr = -speed * np.array([ahead * np.cos(side), ahead * np.sin(side), np.sin(down)])
    advance(r, dr, drag, -float(rng.uniform(*settings.flight)))
    return r, dr


def _bounced(arrival: Array, rng: np.random.Generator, aside: float) -> Motion:
    """Draw a flight that bounces off a level surface shortly before it passes a point [m], (3,).

    It comes from ``aside`` off +x in the middle [rad], and is drawn backwards from that point.
    Speeds after and losses at the bounce as in the recorded table-tennis flights: 1.6 to 3.5 m/s,
    0.75 to 0.9 of the vertical speed kept, 0.55 to 0.85 of the horizontal.
    """
    dr_aim = np.array([-rng.uniform(1.6, 3.5), rng.uniform(-0.3, 0.3), rng.uniform(0.3, 2.2)])
    c, s = np.cos(aside), np.sin(aside)
    dr_aim[:2] = c * dr_aim[0] - s * dr_aim[1], s * dr_aim[0] + c * dr_aim[1]
    since, before = float(rng.uniform(0.08, 0.25)), float(rng.uniform(0.4, 0.55))
    kept = np.array([1.0, 1.0, 0.0]) * rng.uniform(0.55, 0.85)
    kept[2] = -rng.uniform(0.75, 0.9)
    r_up, dr_up = arrival.copy(), dr_aim.copy()
    advance(r_up, dr_up, _BOUNCED_DRAG, -since)
    r_0, dr_0 = r_up.copy(), dr_up / kept
    advance(r_0, dr_0, _BOUNCED_DRAG, -before)

    def motion(t: float) -> tuple[Array, Array]:
        r, dr = (r_0.copy(), dr_0.copy()) if t < before else (r_up.copy(), dr_up.copy())
        advance(r, dr, _BOUNCED_DRAG, t if t < before else t - before)
        return r, dr

    return motion


def sampled(
    f: DirectMap, motion: Motion, drag: float, rng: np.random.Generator, settings: Neighbourhood
) -> Flight | None:
    """Return the flight from t_0 to a little past the catch; None where there is no catch."""
    t_0 = float(rng.uniform(*settings.t_0))
    t_c = _catch_time(f, motion, t_0, settings.flight[1] + _LATER)
    if t_c is None or t_c < t_0 + 0.2:
        return None
    t = np.linspace(t_0, t_c + settings.after, settings.instants)
    ball = np.array([_row(motion, x, drag) for x in t])
    if np.isfinite(settings.max_speed_share) and _asks_too_much(
        f, ball, settings.max_speed_share, int(np.sum(t <= t_c)) - 1
    ):
        return None
    seen = ball[0].copy()
    seen[0] += settings.sigma_r * rng.standard_normal(3)
    seen[1] += settings.sigma_dr * rng.standard_normal(3)
    return Flight(t=t, ball=ball, seen=seen)


def _asks_too_much(f: DirectMap, ball: Array, share: float, catch: int) -> bool:
    """Say whether a flight leaves the domain of l_c^-1, or comes so near to its edge.

    There the virtual joints turn as fast as one likes, and a few such flights would decide what
    is learned. From row ``catch`` on the ball is at the hand.
    """
    at_catch = min(share, _AT_CATCH) if f.design.match_weight == 0.0 else share
    for k, motion in enumerate(ball):
        inside, rows = f.virtual(motion)
        most = at_catch if k >= catch else share
        if not inside or bool(np.any(np.abs(rows[1]) > most * f.arm.dq_max)):
            return True
    return False


def _row(motion: Motion, t: float, drag: float) -> Array:
    """Return r_o, dr_o, ddr_o, shape (3, 3)."""
    r, dr = motion(t)
    ddr = np.zeros(3)
    acceleration(dr, drag, ddr)
    return np.array([r, dr, ddr])


def _catch_time(f: DirectMap, motion: Motion, t_0: float, longest: float) -> float | None:
    """Return when q_o,i first reaches q_alpha after ``t_0``; None where it does not."""
    times = np.arange(t_0, longest, _GRID)
    before = _beyond(f, motion, times[0])
    for k in range(_STRIDE, len(times) + _STRIDE - 1, _STRIDE):
        if before is None:
            return None
        step = times[k - _STRIDE + 1 : k + 1]
        now = _beyond(f, motion, step[-1])
        if now is None or before * now <= 0.0:
            return _crossing(f, motion, step, before)
        before = now
    return None


def _crossing(f: DirectMap, motion: Motion, times: Array, before: float) -> float | None:
    """Return when q_o,i reaches q_alpha at one of some times [s] or before; None where never.

    The times are :data:`_GRID` apart; ``before`` is q_o,i - q_alpha one such step earlier [rad].
    """
    for t in times:
        now = _beyond(f, motion, t)
        if now is None:
            return None
        if before != 0.0 and before * now <= 0.0:
            return float(t - _GRID * now / (now - before))
        before = now
    return None


def _beyond(f: DirectMap, motion: Motion, t: float) -> float | None:
    """Return q_o,i - q_alpha at a time [rad]; None outside the domain of l_c^-1."""
    inside, rows = f.virtual(np.array([motion(float(t))[0], np.zeros(3), np.zeros(3)]))
    return float(to_go(f.tangent, rows[0])) if inside else None


#: How long before it is where it is aimed the nominal ball is looked at [s].
_ON_ITS_WAY = 0.3
#: Seed of the flights that maps are learned from; evaluations use other seeds.
LEARNING_SEED = 20020708
#: Share of a joint's speed that l_c^-1 may ask of an arm that says where it wants its balls; a
#: choice of this project.
FASTEST_SHARE = 3.0


def learn(
    arm: Arm,
    *,
    design: MapDesign | None = None,
    flights: Sequence[Flight] | None = None,
    seed: int = LEARNING_SEED,
    around: Neighbourhood | None = None,
    settings: LearnSettings | None = None,
) -> Learned:
    """Learn a map for an arm, eq. (22).

    Args:
        arm: The arm.
        design: Catch joint, its angle, kappa and order; if left out those of the arm's file, or
            else what follows from the arm, the paper's for the WAM.
        flights: Flights to learn from; a neighbourhood of default throws if left out.
        seed: Seed of that neighbourhood.
        around: Its settings.
        settings: How to learn.

    Returns:
        The map (``.map``) and the cost at each step (``.steps``).
    """
    checks.instance("arm", arm, Arm)
    seed = checks.whole("seed", seed, least=0)
    design = default_design(arm) if design is None else checks.instance("design", design, MapDesign)
    if flights is not None and not isinstance(flights, Sequence):
        raise InputError("flights", "a sequence of flights", checks.shown(flights))
    for name, value, kind in (
        ("around", around, Neighbourhood),
        ("settings", settings, LearnSettings),
    ):
        if value is not None:
            checks.instance(name, value, kind)
    around = around or Neighbourhood()
    if arm.model.aim is not None and not np.isfinite(around.max_speed_share):
        around = replace(around, max_speed_share=FASTEST_SHARE)
    if flights is None:
        start = unlearned(arm, design)
        flights = neighbourhood(start, np.random.default_rng(seed), around)
    for flight in flights:
        checks.instance("flights", flight, Flight)
    return learn_from(arm, design, flights, settings=settings)


def nominal_ball(arm: Arm) -> BallState:
    """Return a ball as those that a map is learned from, in their middle, on its way."""
    of = _about(Neighbourhood(), arm.model)
    speed, down, side, drag = (
        float(np.mean(x)) for x in (of.arrival, of.descent, of.azimuth, of.drag)
    )
    dr = -speed * np.array([np.cos(down) * np.cos(side), np.cos(down) * np.sin(side), np.sin(down)])
    r = catch_place(arm).copy()
    advance(r, dr, drag, -_ON_ITS_WAY)
    return BallState(t=0.0, r_o=r, dr_o=dr, drag=drag)
