"""Why a catcher has stopped, and what it knew then."""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from mitt.control.health import Reason, State
from mitt.signals import Array

Plain: TypeAlias = str | float | bool | list[float | None] | None
"""A value as JSON has it."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StoppedBy:
    """Why a catcher has stopped, and what it knew then.

    Attributes:
        state: State of the tick that stopped the arm: ABORT.
        reason: Why.
        joint: Name of the joint whose encoder is the reason; None for other reasons.
        t: Time of that tick [s].
        q: Estimated joint positions in that tick [rad], shape (n,).
        dq: Estimated joint velocities in that tick [rad/s], shape (n,).
        q_read: Encoder positions in that tick, as read [rad], shape (n,).
        dq_read: Encoder velocities in that tick, as read [rad/s], shape (n,).
        command: q, dq, ddq, tau of that tick's command [rad ..., N m], shape (4, n).
        brakes: Whether the brakes were commanded to engage.
    """

    state: State
    reason: Reason
    joint: str | None
    t: float
    q: Array
    dq: Array
    q_read: Array
    dq_read: Array
    command: Array
    brakes: bool

    def plain(self) -> dict[str, Plain]:
        """Return it as JSON has it; numbers that are not finite are None."""
        names = ("q", "dq", "ddq", "tau")
        rows = {f"command_{name}": row for name, row in zip(names, self.command, strict=True)}
        read = {"q_read": self.q_read, "dq_read": self.dq_read}
        rows = {"q": self.q, "dq": self.dq, **read, **rows}
        lists = {name: _listed(row) for name, row in rows.items()}
        return {"state": self.state.value, "reason": self.reason.value, "joint": self.joint,
                "t": self.t, "brakes": self.brakes, **lists}  # fmt: skip


def _listed(row: Array) -> list[float | None]:
    """Return a row as a list; numbers that are not finite are None."""
    return [float(x) if np.isfinite(x) else None for x in row]
