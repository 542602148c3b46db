"""The recording of a trial: what is kept of its log in a file that other programs read."""

import json
from collections.abc import Mapping
from dataclasses import asdict

import numpy as np

from mitt.catcher.settings import PHASES, Phase
from mitt.files.recording import (
    CATCH_POINT,
    ESTIMATE,
    EVENT,
    PHASE,
    TRUTH,
    Notice,
    Recording,
    Track,
)
from mitt.trials.log import TrialLog
from mitt.trials.result import finite
from mitt.trials.score import Trial, reason_of


def recording_of(
    log: TrialLog, trial: Trial, joints: tuple[str, ...], about: Mapping[str, object]
) -> Recording:
    """Return the recording of a trial.

    Args:
        log: Its log.
        trial: Its score, kept as JSON in the metadata.
        joints: Names of the active joints.
        about: What else the metadata says: version, arm, limits, generator, vision, seed.
    """
    truth, seen = log.truth, log.tracked
    notes = {name: str(value) for name, value in about.items()}
    notes |= {
        "throw": str(trial.index),
        "trial": json.dumps(finite(asdict(trial)), allow_nan=False),
    }
    return Recording(
        joints=joints,
        t=log.t,
        encoders=log.encoders,
        command=log.command[:, :2],
        tau=log.tau,
        brakes=log.brakes,
        tracks=(
            Track(topic=ESTIMATE, t=log.t[seen], r=log.ball[seen, 0]),
            Track(topic=TRUTH, t=truth.t, r=truth.r_o),
            Track(topic=CATCH_POINT, t=truth.t, r=truth.position),
        ),
        notices=(*_phases(log), *_events(log, trial)),
        metadata=notes,
    )


def _phases(log: TrialLog) -> tuple[Notice, ...]:
    """Return a notice for the first phase and for each change."""
    starts = np.flatnonzero(np.diff(log.phase, prepend=-1))
    return tuple(
        Notice(topic=PHASE, t=float(log.t[k]), text=PHASES[log.phase[k]].value) for k in starts
    )


def _events(log: TrialLog, trial: Trial) -> tuple[Notice, ...]:
    """Return what happened: first sight, start, catch, first contact, verdict."""
    touched = log.truth.t[log.truth.force > 0.0]
    refused = log.t[log.phase == PHASES.index(Phase.REFUSED)]
    stop = trial.stopped_by
    stopped_at = [] if stop is None else [float(str(stop["t_s"]))]
    times = (
        ("ball seen", log.t[log.tracked][:1]),
        (f"stopped by {reason_of(stop)}", np.array(stopped_at)),
        ("refused", refused[:1]),
        ("arm starts", np.array([log.t_0])),
        ("catch", np.array([log.t_catch])),
        ("first contact", touched[:1]),
        (trial.status, log.truth.t[-1:]),
    )
    return tuple(
        Notice(topic=EVENT, t=float(t), text=text) for text, at in times for t in at if t < np.inf
    )
