"""The catcher end to end on points: it catches, repeats itself, refuses, and bears bad input."""

import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numba import typeof
from support import arrays_in, ball_state

from mitt.core.arm.arm import Arm
from mitt.core.arm.description import Capsule
from mitt.core.arm.shapes import Surroundings
from mitt.core.catcher.catcher import Catcher, CatcherSettings, Phase
from mitt.core.catcher.family import Family
from mitt.core.catcher.generators import Direct, Unoptimised, refining
from mitt.core.catcher.state import tick_numbers
from mitt.core.control.encoders import GOOD_TICKS, LOSSY_TICKS, SILENT_TICKS
from mitt.core.control.health import Reason
from mitt.core.errors import InputError
from mitt.core.eyes.camera import fixed_rig
from mitt.core.eyes.eyes import Eyes
from mitt.core.map.learn import Learned
from mitt.core.map.map_design import default_design
from mitt.core.map.mapping import unlearned
from mitt.core.map.neighbourhood import learn
from mitt.core.signals import ArmState, Command, Senses, Sighting
from mitt.core.verdict.feasibility import Outcome as Feasible
from mitt.core.verdict.feasibility import waiting_height
from mitt.io.load import build_arm
from mitt.lab.trials.registry import make_generator
from mitt.lab.trials.runner import LoggedTrial, TrialRunner
from mitt.lab.trials.score import held
from mitt.lab.trials.source import aim_of
from mitt.lab.world.disturbances import Spring
from mitt.lab.world.flights import builtin_flights, place_flight
from mitt.lab.world.scene import TABLE_TENNIS, Scene
from mitt.lab.world.throws import Throw, default_throw

SIDE = Throw(r=np.array([3.5, 3.0, 0.2]), dr=np.array([-6.0, 0.0, 1.5]))
#: Largest way of a joint that only holds its pose against its mismatched weight [rad].
STILL = 0.02
#: Longest gap in the sightings of one throw [s].
GAP = 0.030
#: Ticks of a trial that is stepped by hand.
TICKS = 1100

Change = Callable[[Senses], Senses]


@pytest.fixture(scope="module")
def taught(arm: Arm) -> Learned:
    """The map that ``mitt catch`` learns, bounces included."""
    return learn(arm)


@pytest.fixture(scope="module")
def runner(arm: Arm, taught: Learned) -> TrialRunner:
    """The default world, seen as points."""
    return TrialRunner(arm, Direct(taught.map), Scene(), pixels=False)


@pytest.fixture(scope="module")
def throws(arm: Arm) -> list[Throw]:
    """Some default throws."""
    rng = np.random.default_rng(17)
    return [default_throw(rng, aim_of(arm)) for _ in range(4)]


def logs_equal(a: LoggedTrial, b: LoggedTrial) -> bool:
    """Say whether two trials are equal to the bit, commands and true states included."""
    assert a.log is not None
    assert b.log is not None
    pairs = (
        (a.log.tau, b.log.tau),
        (a.log.command, b.log.command),
        (a.log.ball, b.log.ball),
        (a.log.encoders, b.log.encoders),
        (a.log.truth.qpos, b.log.truth.qpos),
        (a.log.truth.qvel, b.log.truth.qvel),
    )
    return a.trial == b.trial and all(np.array_equal(x, y) for x, y in pairs)


def values(catcher: Catcher) -> list[str]:
    """Return all fields of a catcher's state and result."""
    return [repr(x.tolist()) for x in arrays_in((catcher.state, catcher.result))]


def stepped(
    runner: TrialRunner, throw: Throw, change: Change
) -> tuple[Catcher, list[Command], bool]:
    """Run a trial with changed senses; return catcher, commands, whether the ball was held."""
    world, catcher, commands = runner.world, runner.catcher(), []
    world.reset(throw, 5)
    for _ in range(TICKS):
        command = catcher.step(change(world.sense()))
        commands.append(command)
        world.apply(command)
    return catcher, commands, held(world.truth(), 0.04)


def finite(command: Command) -> bool:
    """Say whether every number of a command is finite."""
    rows = (command.q, command.dq, command.ddq, command.tau, np.array([command.hand, command.t]))
    return all(bool(np.all(np.isfinite(row))) for row in rows)


def without_points(start: float, end: float) -> Change:
    """Return a change that loses all sightings in a span of time."""
    return lambda s: replace(s, points=()) if start <= s.t < end else s


def test_default_throws_are_caught(runner: TrialRunner, throws: list[Throw]) -> None:
    """Four default throws: caught by the rules of the score, with no limit violated."""
    trials = [runner.run(k, throw, seed=40 + k).trial for k, throw in enumerate(throws)]
    assert [trial.status for trial in trials] == ["caught"] * 4
    assert [trial.limit_violations for trial in trials] == [0] * 4


def test_a_ball_that_comes_late_is_watched_until_it_is_near(runner: TrialRunner) -> None:
    """Of a high throw there is a verdict at once; the arm begins within 0.7 s of the catch."""
    world, catcher = runner.world, runner.catcher()
    world.reset(Throw(r=np.array([2.97, 0.25, 0.21]), dr=np.array([-2.21, -0.21, 5.46])), 5)
    while catcher.phase is Phase.WATCH:
        world.apply(catcher.step(world.sense()))
        catcher.think()
    t = world.truth().t
    assert t > 0.4
    assert catcher.verdict is not None
    assert catcher.verdict.t_catch - t < 0.7


def test_a_verdict_that_was_put_off_is_the_one_that_would_have_been_given(
    arm: Arm, taught: Learned
) -> None:
    """Of a ball on a spring: asked for at every tick it is UNSETTLED, and the throw is the same."""
    scene = Scene(faults=(Spring(kind="spring", magnitude=5.0),))
    runner, said = TrialRunner(arm, Direct(taught.map), scene, pixels=False), []
    told: list[list[bytes]] = []
    for asks in (False, True):
        world, catcher, rows = runner.world, runner.catcher(), []
        world.reset(SIDE, 5)
        for _ in range(600):
            command = catcher.step(world.sense())
            rows.append(command.q.tobytes())
            world.apply(command)
            catcher.think()
            if asks and catcher.verdict is not None:
                said.append(catcher.verdict.outcome)
        told.append(rows)
    assert told[0] == told[1]
    assert said.count(Feasible.UNSETTLED) > 20
    catcher.stop()
    for _ in range(1000):
        world.apply(catcher.step(world.sense()))
        catcher.think()
    catcher.recover()
    assert catcher.verdict is None


def test_the_same_seed_is_the_same_trial_whatever_ran_before(
    arm: Arm, taught: Learned, runner: TrialRunner, throws: list[Throw]
) -> None:
    """To the bit: on a fresh runner, on a used one, and after another throw in between."""
    fresh = TrialRunner(arm, Direct(taught.map), Scene(), pixels=False)
    first = fresh.run(0, throws[0], seed=7, log=True)
    runner.run(1, throws[1], seed=8)
    runner.run(2, SIDE, seed=9)
    assert logs_equal(first, runner.run(0, throws[0], seed=7, log=True))
    assert logs_equal(first, fresh.run(0, throws[0], seed=7, log=True))


def test_a_catcher_knows_nothing_of_the_one_before(
    runner: TrialRunner, throws: list[Throw]
) -> None:
    """State, result and eyes of a catcher are those before the first throw, and its own."""
    before = runner.catcher()
    known = values(before)
    used, _, _ = stepped(runner, throws[0], lambda senses: senses)
    assert values(used) != known
    after = runner.catcher()
    assert values(after) == values(before) == known
    assert (after.phase, after.verdict, after.t_0) == (Phase.WATCH, None, np.inf)


def test_another_seed_is_another_trial(runner: TrialRunner, throws: list[Throw]) -> None:
    """The seed does reach plant and noise: with another one the torques differ."""
    a, b = (runner.run(0, throws[0], seed=s, log=True) for s in (7, 8))
    assert not logs_equal(a, b)


def test_refining_repeats_itself_and_costs_less(
    arm: Arm, taught: Learned, runner: TrialRunner, throws: list[Throw]
) -> None:
    """With steps for each ball: caught with less demand, to the bit whatever ran before."""
    refined = TrialRunner(arm, refining(taught.map), Scene(), pixels=False)
    first = refined.run(0, throws[0], seed=7, log=True)
    refined.run(1, throws[1], seed=8)
    assert logs_equal(first, refined.run(0, throws[0], seed=7, log=True))
    assert first.trial.status == "caught"
    assert first.trial.limit_violations == 0
    assert first.trial.certificate_last is not None
    assert first.trial.certificate_last["outcome"] == "feasible"
    plain = runner.run(0, throws[0], seed=7).trial
    assert first.trial.demand_cost < plain.demand_cost
    assert plain.certificate_last is None


def test_refining_keeps_a_certificate(arm: Arm, taught: Learned, throws: list[Throw]) -> None:
    """While a ball is followed the catcher says what it makes of the catch."""
    refined = TrialRunner(arm, refining(taught.map), Scene(), pixels=False)
    world, catcher = refined.world, refined.catcher()
    world.reset(throws[0], 5)
    while catcher.certificate is None and world.t < 1.0:
        world.apply(catcher.step(world.sense()))
        catcher.think()
    assert catcher.certificate is not None
    assert catcher.certificate.outcome is Feasible.FEASIBLE
    assert 0.5 < catcher.certificate.probability <= 1.0
    assert catcher.phase is Phase.FOLLOW


def test_images_lead_to_the_same_catch(arm: Arm, taught: Learned, throws: list[Throw]) -> None:
    """Seen by two cameras instead of as points, a throw is caught as well, and repeats itself."""
    seeing = TrialRunner(arm, Direct(taught.map), Scene(), pixels=True)
    first, again = (seeing.run(0, throws[0], seed=7, log=True) for _ in range(2))
    assert first.trial.status == "caught"
    assert logs_equal(first, again)


def test_recorded_flights_are_caught(arm: Arm, taught: Learned) -> None:
    """Of four recorded table-tennis flights at least three are caught, none violates a limit."""
    runner = TrialRunner(arm, Direct(taught.map), Scene(ball=TABLE_TENNIS), pixels=False)
    rng = np.random.default_rng(2)
    trials = []
    for k, recording in enumerate(builtin_flights()[:4]):
        ball = place_flight(recording, arm.position(taught.map.start), rng=rng)
        trials.append(runner.run(k, ball, seed=k).trial)
    assert sum(trial.status == "caught" for trial in trials) >= 3
    assert all(trial.limit_violations == 0 for trial in trials)


def test_an_unreachable_throw_leaves_arm_and_hand_still(runner: TrialRunner, arm: Arm) -> None:
    """Refused with its limit before moving: the ready pose is commanded, the fingers stay open."""
    outcome = runner.run(0, SIDE, seed=3, log=True)
    log = outcome.log
    assert (outcome.trial.status, outcome.trial.binding_limit) == ("unreachable", "domain")
    assert outcome.trial.demand_cost == 0.0
    assert log is not None
    assert np.all(log.command[:, 0] == arm.q_ready)
    assert not np.any(log.command[:, 1:])
    assert not np.any(log.hand)
    assert np.abs(log.truth.q - arm.q_ready).max() < STILL


def test_no_catch_waits_for_what_is_known_of_the_arm_with_the_ball() -> None:
    """It takes some 25 ms to work out, which is done before the first tick."""
    arm = build_arm("wam")
    Catcher(
        arm,
        Direct(unlearned(arm, default_design(arm))),
        Eyes(fixed_rig()),
        settings=CatcherSettings(ball_mass=0.123),
    )
    before = tick_numbers.cache_info().misses
    tick_numbers(arm.holding(0.123))
    assert tick_numbers.cache_info().misses == before


def test_the_arm_holds_its_pose_until_t_0(
    runner: TrialRunner, arm: Arm, throws: list[Throw]
) -> None:
    """Before t_0, at most 80 ms after first sight, nothing but the ready pose is commanded."""
    log = runner.run(0, throws[0], seed=7, log=True).log
    assert log is not None
    before = log.t < log.t_0
    assert np.all(log.command[before, 0] == arm.q_ready)
    assert 0.0 < log.t_0 <= 0.080 + 0.005


@pytest.mark.parametrize("start", [0.10, 0.20, 0.30])
def test_30_ms_without_sight_do_not_lose_the_ball(
    runner: TrialRunner, throws: list[Throw], start: float
) -> None:
    """Sightings missing for 30 ms in flight: the filter bridges them, the ball is held."""
    _, _, was_held = stepped(runner, throws[0], without_points(start, start + GAP))
    assert was_held


def test_the_last_30_ms_before_the_catch_may_be_dark(
    runner: TrialRunner, throws: list[Throw]
) -> None:
    """Blind in the last moment, as when the hand hides the ball: still held."""
    catch = runner.run(0, throws[0], seed=5).trial.t_catch_s
    assert catch is not None
    _, _, was_held = stepped(runner, throws[0], without_points(catch - GAP, np.inf))
    assert was_held


def test_a_ball_never_seen_moves_nothing(
    runner: TrialRunner, arm: Arm, throws: list[Throw]
) -> None:
    """Without a single sighting the catcher watches, gives no verdict and commands rest."""
    catcher, commands, was_held = stepped(runner, throws[0], without_points(0.0, np.inf))
    assert catcher.verdict is None
    assert not was_held
    assert all(np.array_equal(command.q, arm.q_ready) for command in commands)


def test_an_arm_whose_place_is_not_known_is_not_moved(arm: Arm, runner: TrialRunner) -> None:
    """Until each joint was read once: no torque, brakes, no motion; then it stays where it is."""
    catcher = runner.catcher()
    place, still = arm.q_ready + np.array([0.3, -0.2, 0.4]), np.zeros(arm.n)
    unknown, one = np.full(arm.n, np.nan), np.array([place[0], np.nan, np.nan])
    for k, q in enumerate((unknown, unknown, one)):
        command = catcher.step(Senses(t=1e-3 * k, arm=ArmState(t=1e-3 * k, q=q, dq=still)))
        assert command.brakes
        assert np.all(command.tau == 0.0)
        with pytest.raises(InputError, match="move"):
            catcher.move(np.array([[place, still, still]]))
    for k in range(3, 40):
        command = catcher.step(Senses(t=1e-3 * k, arm=ArmState(t=1e-3 * k, q=place, dq=still)))
        assert not command.brakes
        assert np.allclose(command.q, place, atol=1e-3)
        assert np.allclose(command.tau, arm.inverse_dynamics(place, still, still), atol=1.0)


def test_a_catcher_stopped_before_it_knows_its_place_keeps_the_brakes(
    arm: Arm, runner: TrialRunner
) -> None:
    """Encoders that come back release nothing: that is for a person."""
    catcher = runner.catcher()
    place, still = arm.q_ready.copy(), np.zeros(arm.n)
    unknown = np.full(arm.n, np.nan)
    for k in range(100):
        q = place if k >= 40 else unknown
        command = catcher.step(Senses(t=1e-3 * k, arm=ArmState(t=1e-3 * k, q=q, dq=still)))
        assert command.brakes, k
    assert catcher.phase is Phase.STOPPED
    assert np.all(command.tau == 0.0)
    catcher.recover()
    for k in range(100, 104):
        command = catcher.step(Senses(t=1e-3 * k, arm=ArmState(t=1e-3 * k, q=place, dq=still)))
    assert not command.brakes


def test_a_joint_that_is_never_read_keeps_the_arm_on_its_brakes(
    arm: Arm, runner: TrialRunner
) -> None:
    """It is an encoder's fault, after which there is still no torque."""
    catcher = runner.catcher()
    q, still = np.where(np.arange(arm.n) == 1, np.nan, arm.q_ready), np.zeros(arm.n)
    for k in range(LOSSY_TICKS + 20):
        command = catcher.step(Senses(t=1e-3 * k, arm=ArmState(t=1e-3 * k, q=q, dq=still)))
        assert command.brakes
        assert np.all(command.tau == 0.0)
    assert catcher.phase is Phase.STOPPED
    assert catcher.stopped_by is not None
    assert catcher.stopped_by.reason is Reason.SILENT


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e300])
def test_points_that_are_no_numbers_never_reach_a_command(
    runner: TrialRunner, throws: list[Throw], bad: float
) -> None:
    """One coordinate in ten ticks of three is no number: all commands finite, the ball is held."""

    def spoiled(senses: Senses) -> Senses:
        if round(senses.t * 1000) % 3:
            return senses
        return replace(senses, points=tuple(map(spoil, senses.points)))

    def spoil(sighting: Sighting) -> Sighting:
        r_o = sighting.r_o.copy()
        r_o[1] = bad
        return replace(sighting, r_o=r_o)

    _, commands, was_held = stepped(runner, throws[0], spoiled)
    assert all(finite(command) for command in commands)
    assert was_held


@pytest.mark.parametrize(("ticks", "after"), [(5, "goes on"), (LOSSY_TICKS, "stops")])
@pytest.mark.parametrize("bad", [np.nan, np.inf])
@pytest.mark.parametrize("phase", list(Phase)[:3])
def test_an_encoder_that_gives_no_number_never_reaches_a_command(
    runner: TrialRunner, throws: list[Throw], phase: Phase, bad: float, ticks: int, after: str
) -> None:
    """Five such ticks are bridged, fifteen stop the arm; in all phases all commands are finite."""
    spoilt: list[float] = []
    catcher = runner.catcher()
    runner.world.reset(throws[0], 5)
    for _ in range(700):
        senses = runner.world.sense()
        now = Phase.WATCH if catcher.tick is None else catcher.tick.phase
        if len(spoilt) < ticks and (spoilt or (now is phase and senses.t > 0.01)):
            spoilt.append(senses.t)
            senses = replace(senses, arm=spoil_joint(senses.arm, bad))
        command = catcher.step(senses)
        assert finite(command), f"at {senses.t:.3f} s, {now.value}"
        runner.world.apply(command)
    assert len(spoilt) == ticks
    assert (catcher.phase is Phase.STOPPED) == (after == "stops")
    if after == "stops":
        assert catcher.tick is not None
        assert catcher.tick.reason is Reason.SILENT
        by = catcher.stopped_by
        assert by is not None
        assert by.reason is Reason.SILENT
        assert by.joint in runner.arm.names
        assert by.brakes
        assert command.brakes
        assert not command.tau.any()
        assert json.loads(json.dumps(by.plain()))["reason"] == "encoder silent"
        assert np.abs(command.dq).max() < 1e-6


def test_a_stopped_catcher_recovers_when_told_to(runner: TrialRunner, throws: list[Throw]) -> None:
    """It comes to rest and stays; told to recover, it catches again, as a fresh one would."""
    catcher = runner.catcher()
    runner.world.reset(throws[0], 5)
    while runner.world.t < 0.3:
        runner.world.apply(catcher.step(runner.world.sense()))
    catcher.stop()
    for k in range(400):
        runner.world.apply(catcher.step(runner.world.sense()))
        if k < 3:
            with pytest.raises(InputError):
                catcher.recover()
    assert catcher.phase is Phase.STOPPED
    assert catcher.tick is not None
    assert catcher.tick.reason is Reason.REQUESTED
    catcher.recover()
    torques = []
    for each in (catcher, runner.catcher()):
        runner.world.reset(throws[1], 6)
        for _ in range(1100):
            runner.world.apply(each.step(runner.world.sense()))
        assert held(runner.world.truth(), 0.04)
        torques.append(runner.world.trace().tau)
    assert np.array_equal(torques[0], torques[1])


def test_an_arm_that_was_left_behind_stops_where_it_is(
    arm: Arm, taught: Learned, throws: list[Throw]
) -> None:
    """A stop far from the command brakes at once: the way to the command would be one more motion.

    With alpha = 0 the command goes away from the arm: 10 rad/s of joint 4. It brakes as
    hard as its drives can there, by the stops that were chosen on the way.
    """
    generator, settings = Unoptimised(taught.map), CatcherSettings(max_tracking_error=0.2)
    runner, far = TrialRunner(arm, generator, Scene(), pixels=False), 0
    for throw in throws[:6]:
        catcher = Catcher(arm, generator, Eyes(fixed_rig()), settings=settings)
        runner.world.reset(throw, 5)
        chosen = []
        for _ in range(TICKS):
            runner.world.apply(catcher.step(runner.world.sense()))
            catcher.think()
            if catcher.phase is Phase.STOPPED:  # with the next tick the stop begins
                chosen.append(catcher.state.safety.stop.rates.copy())
        by, truth = catcher.stopped_by, runner.world.trace()
        if by is None or by.reason is not Reason.TRACKING:
            continue
        far += 1
        after = truth.t >= by.t
        way = np.ptp(truth.q[after], axis=0)
        assert np.all(way <= 1.2 * by.dq**2 / (2.0 * np.min(chosen[1:], axis=0)) + 0.02), way
        assert np.all(np.abs(truth.dq[after]).max(axis=0) <= np.abs(by.dq) + 0.7)
        assert np.abs(truth.dq[-1]).max() < 1e-2
    assert far >= 3


def spoil_joint(arm: ArmState, bad: float) -> ArmState:
    """Return a reading with one joint position that is no number."""
    q = arm.q.copy()
    q[1] = bad
    return replace(arm, q=q)


def silenced(runner: TrialRunner, throw: Throw, ticks: int) -> Catcher:
    """Return a catcher that lost joint 2's encoder at 0.3 s, so many ticks later."""
    catcher = runner.catcher()
    runner.world.reset(throw, 5)
    while runner.world.t < 0.3 + 0.001 * ticks:
        senses = runner.world.sense()
        if senses.t >= 0.3:
            senses = replace(senses, arm=spoil_joint(senses.arm, np.nan))
        runner.world.apply(catcher.step(senses))
        catcher.think()
    return catcher


def test_an_arm_with_a_joint_that_nobody_measures_stays_where_its_brakes_hold_it(
    runner: TrialRunner, throws: list[Throw]
) -> None:
    """From the brakes' time on it rests for three seconds: no joint moves by a milliradian."""
    silenced(runner, throws[0], 3500)
    truth, brakes = runner.world.trace(), runner.arm.brakes
    stopped = 0.3 + 0.001 * SILENT_TICKS + max(brake.delay for brake in brakes)
    rest = truth.t >= stopped + 0.2
    assert np.abs(truth.dq[rest]).max() < 1e-3
    assert np.ptp(truth.q[rest], axis=0).max() < 1e-3
    after = truth.t >= stopped
    assert np.all((truth.q[after] > runner.arm.q_min) & (truth.q[after] < runner.arm.q_max))
    assert np.all(np.abs(truth.dq[after]) <= runner.arm.dq_max)


def test_a_person_recovers_once_all_encoders_are_good_again(
    runner: TrialRunner, throws: list[Throw]
) -> None:
    """While one is in doubt it is refused; after good readings, or checked by hand, it is not."""
    catcher = silenced(runner, throws[0], 400)
    with pytest.raises(InputError, match="doubt about"):
        catcher.recover()
    for _ in range(GOOD_TICKS + 1):
        command = catcher.step(runner.world.sense())
        runner.world.apply(command)
    assert command.brakes
    catcher.recover()
    assert catcher.stopped_by is None
    assert not catcher.step(runner.world.sense()).brakes
    catcher = silenced(runner, throws[0], 400)
    catcher.recover(checked=True)
    assert catcher.phase is Phase.WATCH


@pytest.mark.parametrize("step", [6e-5, 1e-4, 1e-3])
def test_the_monitor_knows_the_resolution_that_the_scene_says(
    taught: Learned, throws: list[Throw], step: float
) -> None:
    """Counting encoders are believed: no throw is stopped for them."""
    scene = Scene.model_validate({"sensing": {"encoder_step": step}})
    runner = TrialRunner(taught.map.arm, Direct(taught.map), scene, pixels=False)
    for k, throw in enumerate(throws[:4]):
        assert runner.run(k, throw, seed=k).trial.status == "caught"


def test_catchers_with_other_surroundings_stand_in_one_process(arm: Arm, learned: Learned) -> None:
    """As many pairs to be kept apart as there are shapes; far ones change nothing."""
    commands = []
    for count in (0, 1, 3, 2):
        zones = tuple(
            Capsule(start=(0.0, 5.0 + k, 0.0), end=(0.0, 5.0 + k, 1.0), radius=0.1)
            for k in range(count)
        )
        settings = CatcherSettings(around=Surroundings(zones=zones))
        catcher = Catcher(arm, Direct(learned.map), Eyes(fixed_rig()), settings=settings)
        for k in range(50):
            now = ArmState(t=0.001 * k, q=arm.q_ready, dq=np.zeros(arm.n))
            command = catcher.step(Senses(t=0.001 * k, arm=now))
        commands.append(command.joints.tobytes())
    assert len(set(commands)) == 1


def test_a_change_of_map_changes_the_waiting_height(arm: Arm) -> None:
    """A ball's surrogate target is led to the height at which the map that is followed catches."""
    several = make_generator("direct", learn(arm).map)
    assert isinstance(several, Family)
    catcher = Catcher(arm, several, Eyes(fixed_rig()), settings=CatcherSettings())
    heights = []
    for f in (one.map for one in several.maps):
        dr = np.array([-5.0, 0.0, 2.0])
        start = arm.position(f.start) - 0.4 * dr + 0.08 * np.array([0.0, 0.0, 9.81])
        catcher._planner._adapt(ball_state(start, dr, np.array([0.0, 0.0, -9.81])), Direct(f))
        followed = catcher._planner.generator.as_map()
        assert followed is not None
        assert catcher.state.scalars["waiting_height"][0] == waiting_height(followed)
        heights.append(waiting_height(followed))
    assert len(set(heights)) > 1


def test_generators_that_are_no_map_run_the_same_kernels(arm: Arm, learned: Learned) -> None:
    """Their states have the same type: nothing is compiled anew for them."""
    kinds = {
        typeof(
            Catcher(arm, generator, Eyes(fixed_rig()), settings=CatcherSettings()).kernel_arguments[
                1
            ]
        )
        for generator in (Direct(learned.map), make_generator("quintic", learned.map))
    }
    assert len(kinds) == 1
