"""A trial's recording says what its log says."""

import json
from dataclasses import asdict

import numpy as np

from mitt.files.recording import CATCH_POINT, ESTIMATE, EVENT, PHASE, TRUTH
from mitt.generator.generators import Direct
from mitt.generator.learn import Learned
from mitt.trials.recording import recording_of
from mitt.trials.runner import LoggedTrial, TrialRunner
from mitt.trials.source import source_of
from mitt.world.faults.plan import Encoder
from mitt.world.scene import Scene

_JOINTS = ("j1", "j2", "j4")
_ABOUT: dict[str, object] = {"version": "0.1.0", "seed": 3, "generator": "direct"}


def test_the_recording_holds_the_columns_of_the_log(direct: LoggedTrial) -> None:
    """Encoders, commands, torques and the three points are the log's own numbers."""
    log = direct.log
    assert log is not None
    recording = recording_of(log, direct.trial, _JOINTS, _ABOUT)
    np.testing.assert_array_equal(recording.encoders, log.encoders)
    np.testing.assert_array_equal(recording.command, log.command[:, :2])
    np.testing.assert_array_equal(recording.tau, log.tau)
    tracks = {track.topic: track for track in recording.tracks}
    np.testing.assert_array_equal(tracks[TRUTH].r, log.truth.r_o)
    np.testing.assert_array_equal(tracks[CATCH_POINT].r, log.truth.position)
    np.testing.assert_array_equal(tracks[ESTIMATE].t, log.t[log.tracked])


def test_phases_are_told_when_they_change_and_only_then(direct: LoggedTrial) -> None:
    """A caught ball goes through watching, following and braking, each told once."""
    assert direct.log is not None
    recording = recording_of(direct.log, direct.trial, _JOINTS, _ABOUT)
    phases = [(n.text, n.t) for n in recording.notices if n.topic == PHASE]
    assert [text for text, _ in phases] == ["watch", "follow", "brake"]
    assert phases[1][1] == direct.log.t_0
    events = {n.text: n.t for n in recording.notices if n.topic == EVENT}
    assert events["catch"] == direct.log.t_catch
    assert direct.trial.status in events


def test_metadata_carries_the_trial_as_json(direct: LoggedTrial) -> None:
    """The score can be read back from the recording alone."""
    assert direct.log is not None
    notes = recording_of(direct.log, direct.trial, _JOINTS, _ABOUT).metadata
    assert json.loads(notes["trial"]) == asdict(direct.trial)
    assert notes["throw"] == "0"
    assert notes["seed"] == "3"


def test_the_recording_of_a_stopped_throw_says_when_the_brakes_engaged_and_why(
    learned: Learned,
) -> None:
    """From the tick of the stop to the end, with the reason as an event and in the metadata."""
    f = learned.map
    scene = Scene(faults=(Encoder(kind="encoder", fault="dropout", joint=1, start=0.3),))
    source = source_of(f, seed=91, count=1, drag=0.04)
    runner = TrialRunner(f.arm, Direct(f), scene, pixels=False)
    outcome = runner.throw(source, 0, log=True)
    assert outcome.log is not None
    recording = recording_of(outcome.log, outcome.trial, _JOINTS, _ABOUT)
    stop = outcome.trial.stopped_by
    assert stop is not None
    at = int(np.argmax(recording.brakes))
    assert recording.t[at] == stop["t_s"]
    assert recording.brakes[at:].all()
    assert not recording.brakes[:at].any()
    events = {n.text: n.t for n in recording.notices if n.topic == EVENT}
    assert events["stopped by encoder silent j2"] == stop["t_s"]
    assert json.loads(recording.metadata["trial"])["stopped_by"] == stop
