"""What a trial looked like from inside the catcher, one row a tick, for figures and recordings."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from mitt.catcher.result import Result
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
from mitt.robot.arm import Arm
from mitt.signals import Array
from mitt.trials.result import finite
from mitt.trials.score import Trial, reason_of
from mitt.world.truth import Trace

__all__ = ["PHASES", "TrialLog", "log_of", "recording_of"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrialLog:
    """One trial, k ticks, n joints. Rows of ``asked`` and below without ``following`` are zero.

    Attributes:
        t: Time of the tick [s], shape (k,).
        phase: Index into ``PHASES``, shape (k,).
        tracked: Whether there is an estimate of the ball, shape (k,).
        following: Whether the generator was asked, shape (k,).
        encoders: q, dq as read [rad, rad/s], shape (k, 2, n).
        ball: Estimated r_o, dr_o [m, m/s], shape (k, 2, 3).
        asked: q_d, dq_d, ddq_d before any limit [rad ...], shape (k, 3, n).
        virtual: q_o [rad], shape (k, n).
        command: q, dq, ddq commanded [rad ...], shape (k, 3, n).
        tau: Torque commanded [N m], shape (k, n).
        feedforward: Torque that the commanded motion alone would take [N m], shape (k, n).
        hand: Closing angle commanded [rad], shape (k,).
        brakes: Whether the brakes are commanded to engage, shape (k,).
        t_0: Time at which the arm began to move [s]; infinite if it did not.
        t_catch: Time of the catch by the map [s]; infinite if there was none.
        truth: True states, k + 1 rows.
    """

    t: Array
    phase: NDArray[np.int64]
    tracked: NDArray[np.bool_]
    following: NDArray[np.bool_]
    encoders: Array
    ball: Array
    asked: Array
    virtual: Array
    command: Array
    tau: Array
    feedforward: Array
    hand: Array
    brakes: NDArray[np.bool_]
    t_0: float
    t_catch: float
    truth: Trace


def log_of(arm: Arm, ticks: Result, truth: Trace, *, t_0: float, t_catch: float) -> TrialLog:
    """Return the log of a finished trial.

    Args:
        arm: The arm.
        ticks: Results of all k ticks.
        truth: True states, k + 1 rows.
        t_0: Time at which the arm began to move [s].
        t_catch: Time of the catch by the map [s].
    """
    s, command = ticks.scalars, ticks.command
    reference = np.where(s["following"][:, None, None], ticks.reference, 0.0)
    return TrialLog(
        t=s["t"],
        phase=s["phase"],
        tracked=s["tracked"],
        following=s["following"],
        encoders=ticks.encoders,
        ball=ticks.ball[:, :2],
        asked=reference[:, :3],
        virtual=reference[:, 3],
        command=command[:, :3],
        tau=command[:, 3],
        feedforward=arm.active(arm.torques(command[:, :3])),
        hand=s["hand"],
        brakes=s["brakes"],
        t_0=t_0,
        t_catch=t_catch,
        truth=truth,
    )


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
