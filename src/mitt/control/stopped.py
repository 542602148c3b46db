"""Why a catcher has stopped, and what it knew then."""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from mitt.control.health import OLD_READING, Reason, State
from mitt.control.monitor import BEYOND
from mitt.fields import brief
from mitt.robot.arm import Arm
from mitt.signals import TICK, Array

Plain: TypeAlias = str | float | bool | list[float | None] | None
"""A value as JSON has it."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StoppedBy:
    """Why a catcher has stopped, and what it knew then.

    Attributes:
        state: State of the tick that stopped the arm: ABORT.
        reason: Why.
        joint: Name of the joint whose encoder is the reason; None for other reasons.
        hint: What may be behind it, and what to do; nothing where that is not known.
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
    hint: str = ""

    __repr__ = brief

    def plain(self) -> dict[str, Plain]:
        """Return it as JSON has it; numbers that are not finite are None."""
        names = ("q", "dq", "ddq", "tau")
        rows = {f"command_{name}": row for name, row in zip(names, self.command, strict=True)}
        read = {"q_read": self.q_read, "dq_read": self.dq_read}
        rows = {"q": self.q, "dq": self.dq, **read, **rows}
        lists = {name: _listed(row) for name, row in rows.items()}
        return {"state": self.state.value, "reason": self.reason.value, "joint": self.joint,
                "t": self.t, "brakes": self.brakes, "hint": self.hint, **lists}  # fmt: skip


def hint_of(arm: Arm, reason: Reason, q_read: Array, age: float | None = None) -> str:
    """Return what may be behind a stop because of readings that are none.

    Args:
        arm: The arm.
        reason: Why it has stopped.
        q_read: Encoder positions as read [rad], shape (n,).
        age: By how much the last reading was stamped before its tick, if that made it none [s].

    Returns:
        One line, or nothing where the readings can be those of the arm.
    """
    outside = np.flatnonzero((q_read < arm.q_min - BEYOND) | (q_read > arm.q_max + BEYOND))
    if reason is not Reason.SILENT:
        return ""
    if age is not None:
        side = "before" if age >= 0.0 else "after"
        stamped = f"stamped {abs(age):.4g} s {side} its tick" if np.isfinite(age) else "not stamped"
        return (f"the last reading was {stamped}, wanted at most {OLD_READING:g} s before or"
                f" {TICK:g} s after, and a later stamp than the reading before: is the bus frozen,"
                " or are Senses.t and ArmState.t of two clocks?")  # fmt: skip
    if not len(outside):
        return ""
    k = int(outside[0])
    return (f"{arm.names[k]} reads {q_read[k]:.4g}, wanted {arm.q_min[k]:.2f} to"
            f" {arm.q_max[k]:.2f} rad: readings are in radians, in the order of arm.names; are"
            " these in degrees, or of another joint?")  # fmt: skip


def _listed(row: Array) -> list[float | None]:
    """Return a row as a list; numbers that are not finite are None."""
    return [float(x) if np.isfinite(x) else None for x in row]
