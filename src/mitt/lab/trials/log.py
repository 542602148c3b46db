"""What a trial looked like from inside the catcher, one row a tick, and the recording of it."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from mitt.core.arm.arm import Arm
from mitt.core.catcher.settings import PHASES, Phase
from mitt.core.catcher.state import Result
from mitt.core.signals import Array, Frame, Senses
from mitt.io.about import About
from mitt.io.messages import CATCH_POINT, EVENT, TRUTH, clock_call, tick_rows
from mitt.io.recordings import Notice, Recording, Track, heading_of
from mitt.lab.trials.result import finite, plain_fields
from mitt.lab.trials.score import reason_of
from mitt.lab.world.truth import Trace

#: What the event of the first contact is called.
FIRST_CONTACT = "first contact"
#: Time around the catch in which the map's own time to it is taken for exact [s].
_NEAR_CATCH = 0.006


class Scored(Protocol):
    """What a recording says of a trial, of whatever task; a dataclass."""

    @property
    def index(self) -> int:
        """Its number."""
        ...

    @property
    def status(self) -> str:
        """How it ended."""
        ...

    @property
    def stopped_by(self) -> dict[str, Any] | None:
        """Why the catcher stopped; None where it did not."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrialLog:
    """One trial, k ticks, n joints. Rows of ``desired`` and below without ``following`` are zero.

    Attributes:
        t: Time of the tick [s], shape (k,).
        phase: Index into ``PHASES``, shape (k,).
        tracked: Whether there is an estimate of the ball, shape (k,).
        following: Whether the generator was evaluated, shape (k,).
        encoders: q, dq as read [rad, rad/s], shape (k, 2, n).
        ball: Estimated r_o, dr_o [m, m/s], shape (k, 2, 3).
        desired: q_d, dq_d, ddq_d before any limit [rad ...], shape (k, 3, n).
        virtual: q_o [rad], shape (k, n).
        command: q, dq, ddq commanded [rad ...], shape (k, 3, n).
        tau: Torque commanded [N m], shape (k, n).
        feedforward: Torque that the commanded motion alone would take [N m], shape (k, n).
        hand: Closing angle commanded [rad], shape (k,).
        brakes: Whether the brakes are commanded to engage, shape (k,).
        t_0: Time at which the arm began to move [s]; infinite if it did not.
        t_catch: Time of the catch by the map [s]; infinite if there was none.
        truth: True states, k + 1 rows.
        ticks: All that the ticks brought about.
        senses: What each tick took, images only where they were asked for; empty where a compiled
            loop made the ticks: ``ticks`` then says it all.
        background: Frames of which the eyes learned their background, where images are kept.
        clock_offset: What was added to the stamps of what the eyes saw [s].
    """

    t: Array
    phase: NDArray[np.int64]
    tracked: NDArray[np.bool_]
    following: NDArray[np.bool_]
    encoders: Array
    ball: Array
    desired: Array
    virtual: Array
    command: Array
    tau: Array
    feedforward: Array
    hand: Array
    brakes: NDArray[np.bool_]
    t_0: float
    t_catch: float
    truth: Trace
    ticks: Result
    senses: tuple[Senses, ...] = ()
    background: tuple[Frame, ...] = ()
    clock_offset: float = 0.0


def log_of(
    arm: Arm,
    ticks: Result,
    truth: Trace,
    *,
    t_0: float,
    senses: tuple[Senses, ...] = (),
    background: tuple[Frame, ...] = (),
    clock_offset: float = 0.0,
) -> TrialLog:
    """Return the log of a finished trial from the results of its ticks; what else as it has it."""
    s, command = ticks.scalars, ticks.command
    reference = np.where(s["following"][:, None, None], ticks.reference, 0.0)
    return TrialLog(
        t=s["t"],
        phase=s["phase"],
        tracked=s["tracked"],
        following=s["following"],
        encoders=ticks.encoders,
        ball=ticks.ball[:, :2],
        desired=reference[:, :3],
        virtual=reference[:, 3],
        command=command[:, :3],
        tau=command[:, 3],
        feedforward=arm.active(arm.torques(command[:, :3])),
        hand=s["hand"],
        brakes=s["brakes"],
        t_0=t_0,
        t_catch=announced_catch_time(ticks),
        truth=truth,
        ticks=ticks,
        senses=senses,
        background=background,
        clock_offset=clock_offset,
    )


def catch_tick(ticks: Result) -> int | None:
    """Return the tick of the catch by the map: the last one near it; None without one."""
    near = np.flatnonzero(np.abs(ticks.scalars["time_to_catch"]) < _NEAR_CATCH)
    return int(near[-1]) if len(near) else None


def announced_catch_time(ticks: Result) -> float:
    """Return the time of the catch, as the map announced it last [s]; infinite without one."""
    k, s = catch_tick(ticks), ticks.scalars
    return np.inf if k is None else float(s["t"][k] + s["time_to_catch"][k])


def recording_of(
    log: TrialLog, trial: Scored, about: About, notes: Mapping[str, object] | None = None
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
        "trial": json.dumps(finite(plain_fields(trial)), allow_nan=False),
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


def _events(log: TrialLog, trial: Scored) -> tuple[Notice, ...]:
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
