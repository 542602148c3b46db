"""A trial's recording says what its log says."""

import json
from dataclasses import asdict

import numpy as np

from mitt.link.recording import CATCH_POINT, ESTIMATE, EVENT, PHASE, TRUTH
from mitt.trials.record import recording_of
from mitt.trials.runner import LoggedTrial

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
