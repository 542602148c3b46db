"""What a trial looked like from inside the catcher, one row a tick, for figures and recordings."""

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import NDArray

from mitt.catcher import Phase, Tick
from mitt.robot.arm import Arm
from mitt.signals import Array, Command, Senses
from mitt.world.truth import Trace

#: Order of the phases in :attr:`TrialLog.phase`.
PHASES = tuple(Phase)


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
    t_0: float
    t_catch: float
    truth: Trace


@final
class Logger:
    """Collects the rows of one trial."""

    def __init__(self, arm: Arm) -> None:
        """Start empty."""
        self._arm = arm
        self._rows: list[tuple[Array, ...]] = []

    def add(self, senses: Senses, tick: Tick, command: Command) -> None:
        """Append one tick."""
        n, reference = len(command.q), tick.reference
        asked = np.zeros((4, n))
        if reference is not None:
            asked[:] = reference.q_d, reference.dq_d, reference.ddq_d, reference.q_o
        flags = (senses.t, PHASES.index(tick.phase), tick.ball.tracked, reference is not None)
        self._rows.append(
            (
                np.array([*flags, command.hand], dtype=np.float64),
                np.array([senses.arm.q, senses.arm.dq]),
                np.array([tick.ball.r_o, tick.ball.dr_o]),
                asked,
                np.array([command.q, command.dq, command.ddq]),
                command.tau,
            )
        )

    def finish(self, truth: Trace, *, t_0: float, t_catch: float) -> TrialLog:
        """Return the log of the finished trial."""
        flags, encoders, ball, asked, command, tau = (
            np.array(column) for column in zip(*self._rows, strict=True)
        )
        return TrialLog(
            t=flags[:, 0],
            phase=flags[:, 1].astype(np.int64),
            tracked=flags[:, 2] > 0.0,
            following=flags[:, 3] > 0.0,
            encoders=encoders,
            ball=ball,
            asked=asked[:, :3],
            virtual=asked[:, 3],
            command=command,
            tau=tau,
            feedforward=np.array([self._arm.inverse_dynamics(*row) for row in command]),
            hand=flags[:, 4],
            t_0=t_0,
            t_catch=t_catch,
            truth=truth,
        )
