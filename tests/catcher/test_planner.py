"""What a verdict brings about: the same before the arm moves and on the way."""

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from exact_plant import ExactPlant
from support import ball_state

from mitt.core.arm.arm import Arm
from mitt.core.ball.filter import THROWN_BALL
from mitt.core.catcher.catcher import Catcher, CatcherSettings, Phase
from mitt.core.catcher.family import Family, direct
from mitt.core.catcher.generators import Direct, Generator
from mitt.core.catcher.planner import PIECES, comes
from mitt.core.catcher.settings import PATIENCE, SOON
from mitt.core.control.envelope import speeds_of
from mitt.core.map.learn import Learned
from mitt.core.map.mapping import DirectMap
from mitt.core.map.neighbourhood import learn
from mitt.core.signals import GRAVITY, TICK, ArmState, Array, Senses, Sighting
from mitt.core.verdict.feasibility import Outcome, Verdict
from mitt.core.verdict.impact import speed_caps, speed_jumps
from mitt.core.verdict.pieces import Pieces
from mitt.lab.rivals.planned import make_quintic
from mitt.lab.trials.runner import TrialRunner
from mitt.lab.trials.source import source_of
from mitt.lab.world.disturbances import Kick
from mitt.lab.world.scene import Scene

FALL = np.array([0.0, 0.0, -GRAVITY])
#: Height of the floor [m], share of its vertical speed that a ball has after the bounce there.
FLOOR = -0.7
SPRINGS = 0.85
#: When a ball is kicked, and stops on the floor [s].
KICKED = 0.15
STOPS = 0.247
BOUNCE = np.array([3.2, 0.1, 0.2]), np.array([-5.2, -0.1, -2.5])
SUNK = np.array([3.1, 0.15, 0.3]), np.array([-5.0, -0.2, 0.9])
FLIGHT = replace(THROWN_BALL, drag_mean=0.0, drag_sigma=0.002)


@pytest.fixture(scope="module")
def taught(arm: Arm) -> Learned:
    """The map that ``mitt catch`` learns."""
    return learn(arm)


def along(r: Array, dr: Array, t: float, fall: Array = FALL) -> Array:
    """Return where a ball is that falls [m], shape (3,)."""
    at: Array = r + t * dr + 0.5 * t * t * fall
    return at


def bouncing(t: float) -> Array:
    """Return where a ball is that bounces off a floor that nobody announced [m]."""
    r, dr = BOUNCE
    hit = (dr[2] + np.sqrt(dr[2] ** 2 + 2.0 * GRAVITY * (r[2] - FLOOR))) / GRAVITY
    if t < hit:
        return along(r, dr, t)
    up = np.array([dr[0], dr[1], -SPRINGS * (dr[2] - GRAVITY * hit)])
    return along(along(r, dr, hit), up, t - hit)


def kicked(t: float) -> Array:
    """Return where a ball is that comes well and is kicked aside on the way [m]."""
    r, dr = np.array([3.6, 0.15, 0.2]), np.array([-5.9, -0.2, 2.2])
    return along(r, dr, t) + np.array([0.0, 1.2, 0.0]) * max(t - KICKED, 0.0)


def sinking(
    t: float, down: float, table: float, start: Array = SUNK[0], speed: Array = SUNK[1]
) -> Array:
    """Return where a ball is that topspin draws down onto a table, which it springs off [m].

    Args:
        t: Time [s].
        down: What draws it down besides gravity [m/s^2].
        table: Height of the table [m].
        start: Where it is at first [m], shape (3,).
        speed: Its velocity then [m/s], shape (3,).
    """
    r, dr = start, speed
    fall = FALL - np.array([0.0, 0.0, down])
    hit = (dr[2] + np.sqrt(dr[2] ** 2 - 2.0 * fall[2] * (r[2] - table))) / -fall[2]
    if t < hit:
        return along(r, dr, t, fall)
    up = np.array([0.8, 0.8, -SPRINGS]) * (dr + hit * fall)
    return along(along(r, dr, hit, fall), up, t - hit)


def caught(
    arm: Arm,
    generator: Generator,
    way: Callable[[float], Array],
    settings: CatcherSettings,
    watch: Callable[[Catcher], None],
    *,
    exact: bool = False,
) -> Catcher:
    """Return the catcher after a throw at an arm that is where it is told to be.

    Or, ``exact``, where its torques bring it.
    """
    catcher, plant = Catcher(arm, generator, settings=settings), ExactPlant(arm)
    rng = np.random.default_rng(0)
    for k in range(900):
        t, seen = k * TICK, way(k * TICK) + 1e-3 * rng.standard_normal(3)
        point = Sighting(t=t, found=True, r_o=seen, covariance=1e-6 * np.eye(3))
        q, dq = plant.state.copy()
        senses = Senses(t=t, arm=ArmState(t=t, q=q, dq=dq), points=(point,))
        command = catcher.step(senses)
        catcher.think()
        watch(catcher)
        if catcher.phase in (Phase.BRAKE, Phase.STOPPED, Phase.REFUSED):
            break
        if exact:
            plant.move(command, TICK)
        else:
            plant.state[:] = command.q, command.dq
    return catcher


def settings_for(mass: float) -> CatcherSettings:
    """Return settings for a ball [kg]."""
    return CatcherSettings(flight=FLIGHT, ball_mass=mass, ball_restitution=0.6, ball_friction=0.6)


def test_a_ball_that_comes_back_is_judged_with_all_that_comes_after(
    arm: Arm, taught: Learned
) -> None:
    """A light one is caught with room for its impact; a heavy one the arm brakes for, hand open."""
    said: list[Verdict] = []

    def watch(catcher: Catcher) -> None:
        if catcher.verdict is not None and (not said or said[-1] is not catcher.verdict):
            said.append(catcher.verdict)

    for mass, outcome in ((0.3, Outcome.FEASIBLE), (2.0, Outcome.UNREACHABLE)):
        said.clear()
        settings = settings_for(mass)
        catcher = caught(arm, Direct(taught.map), bouncing, settings, watch)
        assert said[0].outcome is Outcome.OPEN
        assert catcher.verdict is said[-1]
        assert catcher.verdict.outcome is outcome
        assert catcher.phase is Phase.BRAKE
        closed = catcher.state.fingers["t_begun"][0] < np.inf
        assert closed == (outcome is Outcome.FEASIBLE)
        kind = catcher.verdict.binding_limit.partition(":")[0]
        assert closed or kind in ("impact", "brake", "grip", "force")


@pytest.mark.parametrize("way", [bouncing, kicked])
def test_whatever_verdict_is_followed_its_room_is_kept(
    arm: Arm, taught: Learned, way: Callable[[float], Array]
) -> None:
    """In each tick caps and jumps of the speeds are those of the verdict that is in effect."""
    settings, followed = settings_for(0.3), set[int]()

    def watch(catcher: Catcher) -> None:
        verdict = catcher.verdict
        if catcher.phase is not Phase.FOLLOW or verdict is None:
            return
        followed.add(id(verdict))
        caps, jumps = speeds_of(arm), np.zeros(arm.n)
        if verdict.approach is not None:
            given = arm, verdict.approach, settings.caught
            caps, jumps = speed_caps(*given), speed_jumps(*given)
        assert np.array_equal(catcher.state.safety.bounds["dq_max"], caps)
        assert np.array_equal(catcher.state.jump, jumps)

    caught(arm, Direct(taught.map), way, settings, watch)
    assert len(followed) >= 2


@pytest.mark.parametrize("index", [0, 1, 3])
def test_a_kick_is_no_step_of_the_command(arm: Arm, taught: Learned, index: int) -> None:
    """What the ball's new velocity asks for begins where the arm is, before any of it is emitted.

    Else a tick goes as far as the envelope lets it, 700 rad/s^2, and the next one back. Nor does
    the acceleration jump: not where the motion begins, and not where another map is followed.
    """
    scene = Scene(faults=(Kick(kind="kick", magnitude=2.0),))
    runner = TrialRunner(arm, Direct(taught.map), scene, pixels=False)
    runner.throw(source_of(arm, seed=542000, count=4, drag=0.04), index)
    ticks = runner.ticks
    early = ticks.scalars["following"] & (ticks.scalars["time_to_catch"] > 0.03)
    assert np.sum(early) > 300
    ddq = ticks.command[early, 2]
    assert np.abs(ddq).max() < 150.0
    assert np.abs(np.diff(ddq, axis=0)).max() < 20.0


@pytest.mark.parametrize(("down", "table"), [(1.5, -0.1), (1.5, -0.2), (2.0, -0.2), (3.0, -0.3)])
def test_a_ball_that_sinks_out_of_reach_is_waited_for(
    arm: Arm, taught: Learned, down: float, table: float
) -> None:
    """It was to be caught at the edge of the reach, passes below it, and springs up from there."""
    said: list[Outcome] = []

    def watch(catcher: Catcher) -> None:
        if catcher.verdict is not None and catcher.verdict.outcome not in said[-1:]:
            said.append(catcher.verdict.outcome)

    way = partial(sinking, down=down, table=table)
    catcher = caught(arm, Direct(taught.map), way, settings_for(0.07), watch)
    assert said[-3:] == [Outcome.FEASIBLE, Outcome.OPEN, Outcome.FEASIBLE]
    assert catcher.phase is Phase.BRAKE
    t = catcher.state.fingers["t_catch"][0]
    assert np.linalg.norm(way(t) - arm.position(catcher.estimated[0])) < 0.03


@pytest.mark.parametrize(("x", "up"), [(3.4, 1.6), (3.6, 1.9)])
def test_several_maps_wait_for_a_ball_that_comes_in_low(
    arm: Arm, taught: Learned, x: float, up: float
) -> None:
    """A map that reaches lower does not go for it where it falls; the one that waits catches it."""
    start, speed = np.array([x, 0.1, 0.15]), np.array([-4.6, -0.1, up])
    way = partial(sinking, down=0.0, table=-0.25, start=start, speed=speed)
    catcher = caught(arm, direct(taught.map), way, settings_for(0.07), lambda _: None)
    assert catcher.state.fingers["t_begun"][0] < np.inf
    t = catcher.state.fingers["t_catch"][0]
    assert np.linalg.norm(way(t) - arm.position(catcher.estimated[0])) < 0.03


PUSHES = {
    "aside": (0.0, 2.0, 0.0),
    "up": (0.0, 0.0, 3.0),
    "back": (8.0, 0.0, 0.0),
    "to a stop": (5.9, 0.2, 0.0),
}


@pytest.mark.parametrize(
    ("push", "make"),
    [*((x, Direct) for x in PUSHES), ("back", make_quintic), ("to a stop", make_quintic)],
)
def test_a_ball_that_goes_away_ends_in_the_brake(
    arm: Arm, taught: Learned, push: str, make: Callable[[DirectMap], Generator]
) -> None:
    """Kicked so that nothing brings it to the hand: once it comes no more, the hand open."""
    r, dr, by = np.array([3.6, 0.15, 0.2]), np.array([-5.9, -0.2, 2.2]), np.array(PUSHES[push])
    coming = [KICKED]

    def way(t: float) -> Array:
        return along(r, dr, t) + by * max(t - KICKED, 0.0)

    def watch(catcher: Catcher) -> None:
        if is_coming(arm, catcher, way):
            coming.append(catcher.result.scalars["t"].item())

    catcher = caught(arm, make(taught.map), way, settings_for(0.07), watch, exact=True)
    assert catcher.phase is Phase.BRAKE
    assert catcher.state.fingers["t_begun"][0] == np.inf
    assert catcher.state.scalars[0]["t_brake"] - coming[-1] < PATIENCE + 0.012


def is_coming(arm: Arm, catcher: Catcher, way: Callable[[float], Array]) -> bool:
    """Say whether the true ball comes to the hand in the tick that was made last."""
    t = catcher.result.scalars["t"].item()
    dr = (way(t + TICK) - way(t - TICK)) / (2.0 * TICK)
    ball = ball_state(way(t), dr, FALL)
    return comes(ball, arm.position(catcher.estimated[0]), CatcherSettings().around.floor)


def fluttering(seed: int) -> Callable[[float], Array]:
    """Return where a ball is that is pushed about on its way as a leaf is [m].

    Random acceleration of 20 m/s^2 an axis that is forgotten within 50 ms, and a soft pull back to
    the flight (10 rad/s, half of critical damping), by which it stays within reach.
    """
    rng, push, off = np.random.default_rng(seed), 20.0, np.zeros((2, 3))
    kept, places = np.exp(-TICK / 0.05), [np.zeros(3)]
    ddr = push * rng.standard_normal(3)
    for k in range(1000):
        pulled = min(k * TICK / 0.1, 1.0) * ddr - 10.0 * off[1] - 100.0 * off[0]
        off[1] += TICK * pulled
        off[0] += TICK * off[1]
        ddr = kept * ddr + push * np.sqrt(1.0 - kept**2) * rng.standard_normal(3)
        places.append(off[0].copy())
    r, dr, aside = np.array([3.6, 0.15, 0.2]), np.array([-5.9, -0.2, 2.2]), np.array(places)
    return lambda t: along(r, dr, t) + aside[round(max(t, 0.0) / TICK)]


@pytest.mark.parametrize("seed", [0, 1, 2, 5, 6, 7, 8])
def test_no_forecast_stops_an_arm_whose_ball_comes(arm: Arm, taught: Learned, seed: int) -> None:
    """Of a ball that flutters a map foresees no catch for 0.1 s, and it comes all the same."""
    way, coming = fluttering(seed), list[bool]()
    catcher = caught(
        arm,
        Direct(taught.map),
        way,
        settings_for(0.07),
        lambda x: coming.append(is_coming(arm, x, way)),
        exact=True,
    )
    assert catcher.phase is Phase.BRAKE
    assert catcher.verdict is not None
    closed = catcher.state.fingers["t_begun"][0] < np.inf
    refused = catcher.verdict.outcome is Outcome.UNREACHABLE
    assert refused or closed or not any(coming[-5:])
    assert not refused or catcher.verdict.t_catch - catcher.result.scalars["t"].item() < SOON


def test_a_ball_that_is_waited_for_and_lies_still_ends_in_the_brake(
    arm: Arm, taught: Learned
) -> None:
    """It stays where it came down, out of reach: nothing comes any more."""
    way, watched = (lambda t: bouncing(min(t, STOPS))), list[Outcome]()

    def watch(catcher: Catcher) -> None:
        if catcher.verdict is not None:
            watched.append(catcher.verdict.outcome)

    catcher = caught(arm, Direct(taught.map), way, settings_for(0.07), watch)
    assert Outcome.OPEN in watched
    assert catcher.phase is Phase.BRAKE
    assert catcher.state.fingers["t_begun"][0] == np.inf
    assert catcher.state.scalars[0]["t_brake"] - STOPS < PATIENCE + 0.012


def test_a_verdict_that_is_read_changes_nothing(
    arm: Arm, taught: Learned, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It may be read in every tick of a ball that nothing is known of yet, and even fail then."""

    def fails(*_: object) -> Verdict:
        raise ArithmeticError

    monkeypatch.setattr(Direct, "unsettled", lambda *_: True)
    monkeypatch.setattr(Direct, "verdict", fails)
    read = list[Verdict | None]()
    catcher = caught(
        arm, Direct(taught.map), fluttering(0), settings_for(0.07), lambda x: read.append(x.verdict)
    )
    assert catcher.phase is Phase.WATCH
    assert catcher.stopped_by is None
    assert read == [None] * len(read)


def coming(t: float) -> Array:
    """Return where a ball is that comes well [m]."""
    return along(np.array([3.6, 0.15, 0.2]), np.array([-5.9, -0.2, 2.2]), t)


def falling_short(t: float) -> Array:
    """Return where a ball is that the learned map refuses, and one that catches farther out not."""
    return along(np.array([3.4, 0.1, 0.15]), np.array([-4.6, -0.1, 1.9]), t)


@pytest.mark.parametrize("make", [Direct, direct])
@pytest.mark.parametrize("way", [coming, falling_short, kicked, bouncing])
def test_no_call_works_out_more_than_a_few_pieces(
    arm: Arm,
    taught: Learned,
    way: Callable[[float], Array],
    make: Callable[[DirectMap], Generator],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of a verdict, before the arm moves and on the way; what it follows is what was judged.

    In the call in which the arm starts, or changes what it follows, no map is judged.
    """
    worked, choices, ticks = Counter[int](), list[int | None](), [0]
    changes, of, consider = set[int](), Pieces.of, Family.consider
    judged, judge = Counter[int](), Family._judged

    def counted(pieces: Pieces, *args: Any, **kwargs: Any) -> Any:  # noqa: ANN401
        before, answer = len(pieces._known), of(pieces, *args, **kwargs)
        worked[ticks[0]] += len(pieces._known) > before
        return answer

    def considered(f: Family, *args: Any) -> tuple[Verdict, Family]:  # noqa: ANN401
        answer = consider(f, *args)
        choices.append(answer[1].chosen)
        return answer

    def compared(*args: Any) -> Verdict:  # noqa: ANN401
        judged[ticks[0]] += 1
        return judge(*args)

    monkeypatch.setattr(Pieces, "of", counted)
    monkeypatch.setattr(Family, "consider", considered)
    monkeypatch.setattr(Family, "_judged", compared)
    followed: list[Verdict | None] = [None]

    def watch(catcher: Catcher) -> None:
        if catcher.phase is Phase.FOLLOW and catcher._planner._verdict is not followed[-1]:
            followed.append(catcher._planner._verdict)
            changes.add(ticks[0])
            g = catcher._planner.generator
            assert not isinstance(g, Family) or g.chosen == choices[-1]
        ticks[0] += 1

    catcher = caught(arm, make(taught.map), way, settings_for(0.07), watch, exact=True)
    assert catcher.phase is Phase.BRAKE
    assert max(worked.values()) <= PIECES
    assert changes
    assert not any(judged[k] for k in changes)
