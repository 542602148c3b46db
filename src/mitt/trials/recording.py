"""The recording of a trial: what is kept of its log in a file that can be replayed."""

import json
from collections.abc import Mapping

import numpy as np

from mitt.catcher.settings import PHASES, Phase
from mitt.files.about import About
from mitt.files.messages import CATCH_POINT, EVENT, TRUTH
from mitt.files.recording import Notice, Recording, Track, heading_of
from mitt.files.recording_rows import clock_call, tick_rows
from mitt.trials.log import TrialLog
from mitt.trials.result import finite, plain
from mitt.trials.score import Trial, reason_of

#: What the event is called.
FIRST_CONTACT = "first contact"


def recording_of(
    log: TrialLog, trial: Trial, about: About, notes: Mapping[str, object] | None = None
) -> Recording:
    """Return the recording of a trial.

    Args:
        log: Its log.
        trial: Its score, kept as JSON in the metadata.
        about: What makes its catcher.
        notes: What else the metadata says: seed, vision, scene.
    """
    truth, used = log.truth, log.clock_offset
    metadata = {name: str(value) for name, value in (notes or {}).items()}
    metadata |= {
        "throw": str(trial.index),
        "trial": json.dumps(finite(plain(trial)), allow_nan=False),
    }
    frames = {k: x.frames for k, x in enumerate(log.senses) if x.frames}
    if log.background:
        frames[0] = log.background + frames.get(0, ())
    return Recording(
        heading=heading_of(about, metadata),
        ticks=tick_rows(log.ticks, log.senses, len(about.rig.heads)),
        points={k: x.points for k, x in enumerate(log.senses) if x.points},
        frames=frames,
        calls={} if not used else {0: (clock_call(used),)},
        tracks=(
            Track(topic=TRUTH, t=truth.t, r=truth.r_o),
            Track(topic=CATCH_POINT, t=truth.t, r=truth.position),
        ),
        notices=_events(log, trial),
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
        (FIRST_CONTACT, touched[:1]),
        (trial.status, log.truth.t[-1:]),
    )
    return tuple(
        Notice(topic=EVENT, t=float(t), text=text) for text, at in times for t in at if t < np.inf
    )
