"""The log of a trial, and the recording of it."""

import json
from dataclasses import asdict

import numpy as np
import pytest

from mitt.core.arm.arm import Arm
from mitt.core.catcher.generators import Direct
from mitt.core.catcher.settings import PHASES
from mitt.core.map.learn import Learned
from mitt.io.about import About
from mitt.io.messages import CATCH_POINT, EVENT, TRUTH
from mitt.lab.trials.log import recording_of
from mitt.lab.trials.runner import LoggedTrial, TrialRunner
from mitt.lab.trials.source import source_of
from mitt.lab.world.faults import Encoder
from mitt.lab.world.scene import Scene

TICK = 0.001


def test_every_column_has_a_row_for_each_tick(direct: LoggedTrial) -> None:
    """All columns are as long as the times, the truth has one row more, at release."""
    assert direct.log is not None
    log, k = direct.log, len(direct.log.t)
    columns = (
        log.phase,
        log.tracked,
        log.following,
        log.encoders,
        log.ball,
        log.desired,
        log.virtual,
        log.command,
        log.tau,
        log.feedforward,
        log.hand,
    )
    assert {len(column) for column in columns} == {k}
    assert len(log.truth.t) == k + 1
    assert np.allclose(np.diff(log.t), TICK)
    assert np.allclose(log.truth.t[:-1], log.t)


def test_rows_without_a_reference_are_zero(direct: LoggedTrial) -> None:
    """Before t_0 and after the hand has closed nothing is asked."""
    assert direct.log is not None
    log = direct.log
    assert not np.any(log.desired[~log.following])
    assert not np.any(log.virtual[~log.following])
    assert np.any(log.following)
    assert log.t[log.following][0] == log.t_0


def test_phases_come_in_their_order(direct: LoggedTrial) -> None:
    """Watching, following, braking: the phase never goes back."""
    assert direct.log is not None
    assert np.all(np.diff(direct.log.phase) >= 0)
    assert [p.value for p in PHASES] == ["watch", "follow", "brake", "refused", "stopped"]


def test_the_feedforward_is_the_torque_of_the_command_alone(direct: LoggedTrial, arm: Arm) -> None:
    """Inverse dynamics of the commanded motion, tick by tick."""
    assert direct.log is not None
    log = direct.log
    for k in range(0, len(log.t), 97):
        assert np.allclose(log.feedforward[k], arm.inverse_dynamics(*log.command[k]), atol=1e-9)


def test_exact_encoders_are_the_truth(direct: LoggedTrial) -> None:
    """In the default world the encoders of a tick read the true state before it."""
    assert direct.log is not None
    truth = direct.log.truth
    assert np.array_equal(direct.log.encoders[:, 0], truth.q[:-1])
    assert np.array_equal(direct.log.encoders[:, 1], truth.dq[:-1])
    assert np.array_equal(direct.log.tau, truth.tau[1:])


_NOTES: dict[str, object] = {"version": "0.1.0", "seed": 3, "generator": "direct"}


@pytest.fixture(scope="module")
def about(learned: Learned) -> About:
    runner = TrialRunner(learned.map.arm, Direct(learned.map), Scene(), pixels=False)
    return runner.about("direct", learned.map)


def test_the_recording_holds_the_columns_of_the_log(direct: LoggedTrial, about: About) -> None:
    """Encoders, commands, torques and the three points are the log's own numbers."""
    log = direct.log
    assert log is not None
    recording = recording_of(log, direct.trial, about, _NOTES)
    k, n = log.tau.shape
    np.testing.assert_array_equal(recording.ticks["q"], log.encoders[:, 0])
    np.testing.assert_array_equal(recording.ticks["dq"], log.encoders[:, 1])
    told = recording.ticks["command"].reshape(k, 4, n)
    np.testing.assert_array_equal(told[:, :3], log.command)
    np.testing.assert_array_equal(told[:, 3], log.tau)
    tracks = {track.topic: track for track in recording.tracks}
    np.testing.assert_array_equal(tracks[TRUTH].r, log.truth.r_o)
    np.testing.assert_array_equal(tracks[CATCH_POINT].r, log.truth.position)
    given = np.array([len(recording.points.get(k, ())) for k in range(k)])
    np.testing.assert_array_equal(given, recording.ticks["points"])
    assert np.sum(given) > 300


def test_events_say_what_happened_and_when(direct: LoggedTrial, about: About) -> None:
    """The catch by the map and the status are told."""
    assert direct.log is not None
    recording = recording_of(direct.log, direct.trial, about, _NOTES)
    events = {n.text: n.t for n in recording.notices if n.topic == EVENT}
    assert events["catch"] == direct.log.t_catch
    assert direct.trial.status in events


def test_metadata_carries_the_trial_as_json(direct: LoggedTrial, about: About) -> None:
    """The score can be read back from the recording alone."""
    assert direct.log is not None
    notes = recording_of(direct.log, direct.trial, about, _NOTES).heading.metadata
    trial = {name: x for name, x in asdict(direct.trial).items() if name != "clock"}
    assert json.loads(notes["trial"]) == trial
    assert notes["throw"] == "0"
    assert notes["seed"] == "3"


def test_the_recording_of_a_stopped_throw_says_when_the_brakes_engaged_and_why(
    learned: Learned,
) -> None:
    """From the tick of the stop to the end, with the reason as an event and in the metadata."""
    f = learned.map
    scene = Scene(faults=(Encoder(kind="encoder", fault="dropout", joint=1, start=0.3),))
    source = source_of(f.arm, seed=91, count=1, drag=0.04)
    runner = TrialRunner(f.arm, Direct(f), scene, pixels=False)
    outcome, about = runner.throw(source, 0, log=True), runner.about("direct", f)
    assert outcome.log is not None
    recording = recording_of(outcome.log, outcome.trial, about, _NOTES)
    stop = outcome.trial.stopped_by
    assert stop is not None
    at = int(np.argmax(recording.ticks["brakes"]))
    assert recording.ticks["t"][at] == stop["t_s"]
    assert recording.ticks["brakes"][at:].all()
    assert not recording.ticks["brakes"][:at].any()
    events = {n.text: n.t for n in recording.notices if n.topic == EVENT}
    assert events["stopped by encoder silent j2"] == stop["t_s"]
    assert json.loads(recording.heading.metadata["trial"])["stopped_by"] == stop
