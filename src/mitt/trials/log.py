"""What a trial looked like from inside the catcher, one row a tick."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mitt.catcher.result import Result
from mitt.catcher.settings import PHASES
from mitt.robot.arm import Arm
from mitt.signals import Array, Frame, Senses
from mitt.world.truth import Trace

__all__ = ["PHASES", "TrialLog", "log_of"]


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
    arm: Arm, ticks: Result, truth: Trace, *, t_0: float, t_catch: float,
    senses: tuple[Senses, ...] = (), background: tuple[Frame, ...] = (),
) -> TrialLog:  # fmt: skip
    """Return the log of a finished trial.

    Args:
        arm: The arm.
        ticks: Results of all k ticks.
        truth: True states, k + 1 rows.
        t_0: Time at which the arm began to move [s].
        t_catch: Time of the catch by the map [s].
        senses: As of :class:`TrialLog`.
        background: As of :class:`TrialLog`.
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
        desired=reference[:, :3],
        virtual=reference[:, 3],
        command=command[:, :3],
        tau=command[:, 3],
        feedforward=arm.active(arm.torques(command[:, :3])),
        hand=s["hand"],
        brakes=s["brakes"],
        t_0=t_0,
        t_catch=t_catch,
        truth=truth,
        ticks=ticks,
        senses=senses,
        background=background,
    )
