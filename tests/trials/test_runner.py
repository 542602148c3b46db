"""One trial: what it reports agrees with its own log."""

import copy
import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from mitt.core.arm.arm import Arm
from mitt.core.arm.hands import HandModel
from mitt.core.ball.filter import FilterConfig
from mitt.core.catcher.family import direct
from mitt.core.catcher.generators import Direct, Unoptimised
from mitt.core.errors import InputError, StoppedError
from mitt.core.map.learn import Learned
from mitt.core.map.mapping import DirectMap
from mitt.core.map.neighbourhood import learn
from mitt.core.signals import Array, BallState, JointReference
from mitt.core.verdict.feasibility import Verdict
from mitt.io.load import build_arm
from mitt.io.recordings import write_recording
from mitt.lab.rivals.planned import make_quintic
from mitt.lab.trials.catcher_settings import driven, filter_settings
from mitt.lab.trials.log import recording_of
from mitt.lab.trials.runner import LoggedTrial, TrialRunner
from mitt.lab.trials.runs import simulate
from mitt.lab.trials.score import HELD_AFTER
from mitt.lab.trials.source import aim_of
from mitt.lab.world.scene import Scene, Sensing, named_scene, scene_of
from mitt.lab.world.throws import Throw, default_throw

#: Agreement of figures reckoned two ways.
EXACT = 1e-12


def test_a_caught_ball_ends_half_a_second_after_first_contact(direct: LoggedTrial) -> None:
    """The trial runs to 0.5 s after the first force on the ball, to a tick."""
    assert direct.log is not None
    assert direct.trial.status == "caught"
    truth = direct.log.truth
    touched = truth.t[np.flatnonzero(truth.force > 0.0)[0]]
    assert truth.t[-1] - touched == pytest.approx(HELD_AFTER, abs=0.0021)


def test_peaks_are_those_of_the_trace(direct: LoggedTrial, arm: Arm) -> None:
    """Peak ratios are the largest true torques and speeds over their limits."""
    assert direct.log is not None
    truth, trial = direct.log.truth, direct.trial
    assert trial.peak_torque_ratio == pytest.approx(np.abs(truth.tau / arm.tau_max).max(axis=0))
    assert trial.peak_speed_ratio == pytest.approx(np.abs(truth.dq / arm.dq_max).max(axis=0))
    assert max(trial.peak_torque_ratio) <= 1.0 + EXACT
    assert trial.peak_contact_force_n == pytest.approx(truth.force.max())


def test_errors_at_contact_are_those_of_the_trace(direct: LoggedTrial) -> None:
    """Position and velocity errors agree with the true states at the tick of first contact."""
    assert direct.log is not None
    assert direct.trial.position_error_mm is not None
    assert direct.trial.velocity_error_m_s is not None
    truth = direct.log.truth
    k = np.flatnonzero(truth.force > 0.0)[0]
    near = np.linalg.norm(truth.r_o[k - 2 : k + 1] - truth.position[k - 2 : k + 1], axis=1)
    # Within a tick the ball moves against the hand by the velocity error times 1 ms.
    slack = direct.trial.velocity_error_m_s + 1.0
    assert 1e3 * near.min() - slack <= direct.trial.position_error_mm <= 1e3 * near.max() + slack


def test_the_demand_is_that_of_the_log(direct: LoggedTrial, arm: Arm) -> None:
    """demand_cost is eq. (22) over the ticks that followed, from what the log says was asked."""
    assert direct.log is not None
    log, costs = direct.log, []
    for q, dq, ddq in log.desired[log.following]:
        torque, speed = arm.inverse_dynamics(q, dq, ddq) / arm.tau_max, dq / arm.dq_max
        costs.append(float(torque @ torque + speed @ speed))
    assert direct.trial.demand_cost == pytest.approx(float(np.mean(costs)))


def test_learning_asks_less_than_alpha_0(direct: LoggedTrial, unoptimised: LoggedTrial) -> None:
    """On the same throw the learned map demands less, and alpha = 0 leaves the range."""
    assert direct.trial.demand_cost < unoptimised.trial.demand_cost
    assert unoptimised.trial.range_excess_rad > 0.0
    assert direct.trial.range_excess_rad == 0.0


def test_no_limit_is_violated_even_by_alpha_0(
    direct: LoggedTrial, unoptimised: LoggedTrial
) -> None:
    """What is emitted keeps the limits whatever is asked for."""
    assert direct.trial.limit_violations == 0
    assert unoptimised.trial.limit_violations == 0


def test_the_catch_of_the_log_is_the_catch_of_the_trial(direct: LoggedTrial) -> None:
    """t_catch is when q_o,i passes q_alpha in the log, to a millisecond."""
    assert direct.log is not None
    assert direct.trial.t_catch_s is not None
    log = direct.log
    s = log.virtual[log.following, 2] - np.pi / 2
    nearest = log.t[log.following][np.abs(s).argmin()]
    assert direct.trial.t_catch_s == pytest.approx(nearest, abs=1.5e-3)
    assert log.t_catch == direct.trial.t_catch_s


def test_logging_and_timing_change_nothing(
    arm: Arm, learned: Learned, scene: Scene, throw: Throw, direct: LoggedTrial
) -> None:
    """Without a log the trial is the same; the stopwatch has ticked and stays out of it."""
    runner = TrialRunner(arm, Direct(learned.map), scene, pixels=False)
    assert runner.stopwatch.percentiles_us()["max"] == 0.0
    outcome = runner.run(0, throw, seed=3)
    assert outcome.log is None
    assert outcome.trial == direct.trial
    assert runner.stopwatch.percentiles_us()["p50"] > 0.0


@pytest.mark.parametrize(("mass", "density"), [(0.07, 1e-4), (1.0, 1e-4), (0.0027, 0.00259)])
def test_a_lighter_ball_is_believed_less_steady(mass: float, density: float) -> None:
    """The unmodelled acceleration grows as the ball gets lighter than 70 g."""
    known = filter_settings(0.1, mass)
    assert known.accel_density == pytest.approx(density, rel=0.01)
    assert known.drag_mean == 0.1
    assert known.drag_sigma == pytest.approx(0.025)


@pytest.mark.parametrize("limits", ["wam-48v", "wam-80v"])
def test_real_motors_catch_with_the_design_chosen_for_them(limits: str) -> None:
    """Four default throws each: caught, within every limit, motors below continuous torque."""
    arm = build_arm("wam", limits=limits, hand=HandModel())
    trials = simulate(learn(arm).map, throws=4, seed=31, pixels=False)
    assert [trial.status for trial in trials] == ["caught"] * 4
    assert sum(trial.limit_violations for trial in trials) == 0
    assert 0.0 < max(max(trial.rms_torque_ratio) for trial in trials) < 1.0


@pytest.mark.parametrize("limits", ["paper", "wam-80v"])
def test_a_ball_that_springs_back_from_the_palm_is_caught(limits: str) -> None:
    """A ball that keeps 70 % of its speed, met by motors that cannot match it: four of four."""
    arm = build_arm("wam", limits=limits, hand=HandModel())
    scene = scene_of({"contact": {"restitution": 0.7}}, place="test", base="lab")
    trials = simulate(learn(arm).map, throws=4, seed=11, pixels=False, scene=scene)
    assert [trial.status for trial in trials] == ["caught"] * 4


def test_a_ball_that_rolls_before_the_thrown_one_does_not_end_the_throw(arm: Arm) -> None:
    """It hides the flight from one camera for 0.2 s, larger and nearer: three of three caught."""
    sensing = {"second": (0.9, 0.6, 0.0, 0.08), "second_velocity": (0.0, -1.0, 0.0)}
    scene = scene_of({"sensing": sensing}, place="test", base="lab")
    trials = simulate(learn(arm).map, throws=3, seed=5, scene=scene)
    assert [trial.status for trial in trials] == ["caught"] * 3


def test_a_ball_that_leaves_the_images_upwards_is_caught() -> None:
    """It is not seen for 0.4 s, beside an arm that waits: caught, as no new track is begun."""
    arm = build_arm("wam", limits="wam-80v", hand=HandModel())
    runner = TrialRunner(arm, Direct(learn(arm).map), named_scene("lab"))
    throw = Throw(r=np.array([2.97, 0.25, 0.21]), dr=np.array([-2.21, -0.21, 5.46]))
    assert [runner.run(0, throw, seed=seed).trial.status for seed in range(3)] == ["caught"] * 3


def test_drives_that_lag_are_not_asked_for_all_their_torque(arm: Arm) -> None:
    """Two per cent are kept for what a millisecond and counts of encoders change."""
    assert driven(arm, named_scene("ideal")) is arm
    for name in ("lab", "rough"):
        weaker = driven(arm, named_scene(name)).limits
        assert np.allclose(weaker.tau_peak, 0.98 * arm.limits.tau_peak)
        assert np.array_equal(weaker.dq_max, arm.limits.dq_max)


def test_the_filter_believes_what_it_is_told_of_the_drag() -> None:
    """A uniform error of 60 % is 0.35 of the drag, 1 sigma; of 30 % less than the usual quarter."""
    usual, little, much = (filter_settings(0.1, 0.07, spread=x).drag_sigma for x in (0.0, 0.3, 0.6))
    assert little == usual
    assert much == pytest.approx(0.1 * 0.6 / np.sqrt(3.0))


def test_the_filter_may_find_twice_the_drag_that_it_was_told() -> None:
    """The usual bound, 0.3 per metre, is below what a very light ball has."""
    assert filter_settings(0.5, 0.07).drag_max == 1.0
    assert filter_settings(0.04, 0.07).drag_max == FilterConfig().drag_max


def test_a_trial_that_is_over_before_its_first_tick_is_a_result(
    arm: Arm, learned: Learned, tmp_path: Path
) -> None:
    """A ball faster than the physics is trusted: every number finite, and it can be recorded."""
    ball = Throw(r=np.array([3.0, 0.0, 0.5]), dr=np.array([-100.0, 0.0, 0.0]))
    runner = TrialRunner(arm, Direct(learned.map), Scene(), pixels=False)
    outcome = runner.run(0, ball, seed=1, log=True)
    assert outcome.log is not None
    assert len(outcome.log.t) == 0
    assert outcome.trial.status == "aborted"
    text = json.dumps(asdict(outcome.trial), allow_nan=False)
    assert json.loads(text)["rms_torque_ratio"] == [0.0] * len(outcome.trial.rms_torque_ratio)
    about = runner.about("direct", learned.map)
    write_recording(tmp_path / "x.mcap", recording_of(outcome.log, outcome.trial, about))
    after = runner.run(1, default_throw(np.random.default_rng(5), aim_of(arm)), seed=3)
    assert after.trial.status == "caught"


def test_simulate_takes_what_learn_returns(learned: Learned) -> None:
    """What came of learning stands for the default generator; anything else is one line."""
    given = (learned, direct(learned.map))
    found = [simulate(f, throws=1, seed=3, pixels=False) for f in given]
    assert found[0] == found[1]
    for wrong in (None, 3, [learned.map]):
        with pytest.raises(InputError, match="f: wanted a generator, a map"):
            simulate(wrong, throws=1)  # type: ignore[arg-type]  # what is refused
    with pytest.raises(InputError, match="seed"):
        simulate(learned, throws=1, seed=-1)


def test_a_map_that_never_learned_can_be_thrown_at(plain: DirectMap) -> None:
    """Its region is everywhere, without a corner that could be asked about."""
    assert len(simulate(plain, throws=1, seed=3, pixels=False)) == 1


def test_a_stop_is_an_exception_s_data_where_that_is_asked_for(learned: Learned) -> None:
    """A lying encoder: the error carries what the trial says, also from another process."""
    scene = Scene.model_validate(
        {"faults": [{"kind": "encoder", "fault": "stuck", "joint": 1, "start": 0.3}]}
    )
    (trial,) = simulate(learned, throws=1, seed=3, scene=scene, pixels=False)
    assert trial.status == "stopped"
    assert trial.stopped_by is not None
    with pytest.raises(StoppedError) as caught:
        simulate(learned, throws=1, seed=3, scene=scene, pixels=False, raise_stopped=True)
    assert caught.value.stopped_by == trial.stopped_by
    assert str(trial.stopped_by["reason"]) in str(caught.value)
    again = copy.deepcopy(caught.value)
    assert (again.index, again.stopped_by, str(again)) == (0, trial.stopped_by, str(caught.value))


@pytest.mark.parametrize(
    "sensing",
    [
        Sensing(body=120.0, shading=0.3),
        Sensing(body=255.0),
        Sensing(second=(1.5, 0.5, 0.3, 0.08)),
        Sensing(second=(2.0, 0.6, -0.8, 0.06), second_velocity=(-1.0, -1.0, 0.0)),
        Sensing(pattern=(30.0, 8.0), light=(0.1, 100.0), shadow=(0.2, 50.0)),
    ],
)
def test_the_ball_is_caught_beside_whatever_else_is_bright(
    learned: Learned, sensing: Sensing
) -> None:
    """A bright arm, a ball at rest, one that rolls, a pattern in moving light: 3 of 3 each."""
    trials = simulate(learned.map, throws=3, seed=12, scene=Scene(sensing=sensing))
    assert [trial.status for trial in trials] == ["caught"] * 3


def test_simulate_takes_whatever_moves_an_arm(learned: Learned, tmp_path: Path) -> None:
    """A map, what was learned, a generator of ours with or without a map, one of somebody else."""
    f, given = learned.map, {"throws": 1, "seed": 3, "pixels": False}
    first = simulate(f, throws=1, seed=3, pixels=False)
    assert simulate(Direct(f), throws=1, seed=3, pixels=False) == first
    assert simulate(Unoptimised(f), throws=1, seed=3, pixels=False) != first
    rival = make_quintic(f)
    (trial,) = simulate(rival, arm=f.arm, throws=1, seed=3, pixels=False)
    assert trial.status == "caught"
    for wanted, moved in (
        ("arm: wanted the arm", {"f": rival}),
        ("record: wanted nothing", {"f": rival, "arm": f.arm, "record": tmp_path}),
        ("f: wanted a generator", {"f": "direct"}),
    ):
        with pytest.raises(InputError, match=wanted):
            simulate(**(given | moved))
    (trial,) = simulate(Somebodys(f), arm=f.arm, throws=1, seed=3, pixels=False)
    assert trial.status == "stopped"
    assert trial.stopped_by is not None
    assert "generator Somebodys: wanted an answer of" in str(trial.stopped_by["hint"])


class Somebodys:
    """A generator that somebody wrote, and whose last line is not."""

    def __init__(self, f: DirectMap) -> None:
        """Take a map to begin with."""
        self._f = Direct(f)

    def sharpness(self, ball: BallState) -> float:
        """Ask the map."""
        return self._f.sharpness(ball)

    def verdict(self, ball: BallState, q: Array) -> Verdict:
        """Ask the map."""
        return self._f.verdict(ball, q)

    def unsettled(self, ball: BallState, q: Array) -> bool:
        """Ask the map."""
        return self._f.unsettled(ball, q)

    def returns(self, ball: BallState) -> bool:
        """Ask the map."""
        return self._f.returns(ball)

    def waiting(self, ball: BallState) -> BallState:
        """Ask the map."""
        return self._f.waiting(ball)

    def adapt(self, ball: BallState, q: Array, dq: Array) -> "Somebodys":
        """Begin anew."""
        return Somebodys(self._f.adapt(ball, q, dq).map)

    def reference(self, ball: BallState) -> JointReference:
        """Fail."""
        raise AttributeError(f"nothing at {ball.t}")

    def as_map(self) -> None:
        """Say that this is no map."""
