"""Motions that a caller wants the arm to make: whether they are motions, and within the limits."""

from collections.abc import Sequence

import numpy as np

from mitt.control.rows import DDQ, DDQ_MAX, DQ, DQ_MAX, JERK, Q_MAX, Q_MIN, Q
from mitt.errors import InputError
from mitt.signals import TICK, Array

#: What positions [rad] and speeds [rad/s] may be off by, as numbers of a file are.
_ROUNDED, _ROUNDED_SPEED = 1e-6, 1e-4
#: Share by which a limit may be exceeded: rounding.
_SLACK = 1e-6


def check_motion(names: Sequence[str], b: Array, last: Array, motion: Array) -> None:
    """Refuse a motion that does not lead from a command to rest within the limits.

    Args:
        names: Names of the joints.
        b: Limits, as of :mod:`mitt.control.envelope`, shape (>= 6, n).
        last: q, dq, ddq of the command before, at rest, shape (3, n).
        motion: q, dq, ddq of that tick and each one after it, shape (k, 3, n).

    Raises:
        InputError: It is another one; the joint is named, and the first tick at fault.
    """
    q, dq, ddq = motion[:, Q], motion[:, DQ], motion[:, DDQ]
    if not len(motion):
        raise InputError("motion", "one row or more", "none")
    if (k := _worst(np.abs(q[:1] - last[Q]), _ROUNDED)) is not None:
        raise InputError("motion", f"a start at the last command, {names[k[1]]} at"
                         f" {last[Q, k[1]]:.6g}", f"{q[k]:.6g}",
                         do="begin at command.q of the last tick")  # fmt: skip
    speeds = np.abs(dq[[0, -1]])
    if (k := _worst(speeds, _ROUNDED_SPEED)) is not None:
        where = "an end" if k[0] else "a start"
        raise InputError("motion", f"{where} at rest", f"{names[k[1]]} at {speeds[k]:.4g} rad/s")
    _check_steps(names, q, dq, ddq)
    low, high = np.minimum(b[Q_MIN], q[0]), np.maximum(b[Q_MAX], q[0])
    far = np.maximum(low - q, q - high)
    if (k := _worst(far, _ROUNDED)) is not None:
        joint = k[1]
        raise InputError("motion", f"positions of {names[joint]} in {low[joint]:.4g}.."
                         f"{high[joint]:.4g} rad", f"{q[k]:.4g} at tick {k[0]}",
                         do="commands keep a gap to the ends of the range")  # fmt: skip
    for name, value, most, unit in (
        ("speed", np.abs(dq), b[DQ_MAX], "rad/s"),
        ("acceleration", np.abs(ddq), b[DDQ_MAX], "rad/s^2"),
        ("jerk", np.abs(np.diff(ddq, axis=0, prepend=ddq[:1])) / TICK, b[JERK], "rad/s^3"),
    ):  # fmt: skip
        if (k := _worst(value - most * (1.0 + _SLACK), _ROUNDED)) is not None:
            given = f"{value[k]:.4g} {unit} at tick {k[0]}"
            raise InputError("motion", f"a {name} of {names[k[1]]} of at most {most[k[1]]:.4g}",
                             given, do="plan one within the limits")  # fmt: skip


def _check_steps(names: Sequence[str], q: Array, dq: Array, ddq: Array) -> None:
    """Refuse rows of which positions, speeds and accelerations are not those of one motion.

    In a tick the acceleration may be anything between those at its ends.
    """
    jump = np.abs(np.diff(ddq, axis=0))
    for what, x, rate, slack in (
        ("positions", q, dq, 0.25 * TICK**2 * jump + _ROUNDED),
        ("speeds", dq, ddq, 0.5 * TICK * jump + _ROUNDED_SPEED),
    ):
        off = np.abs(np.diff(x, axis=0) - 0.5 * TICK * (rate[1:] + rate[:-1])) - slack
        if (k := _worst(off, 0.0)) is not None:
            step = np.diff(x, axis=0)[k]
            wanted = f"{what} a tick apart that change as their rates say"
            raise InputError("motion", wanted, f"a step of {step:.4g} of {names[k[1]]} after tick"
                             f" {k[0]}, at a rate of {rate[k]:.4g}",
                             do="give q, dq, ddq each millisecond")  # fmt: skip


def _worst(excess: Array, slack: float) -> tuple[int, int] | None:
    """Return tick and joint of the largest excess; None where none is above ``slack``."""
    if not excess.size or excess.max() <= slack:
        return None
    k, joint = np.unravel_index(int(np.argmax(excess)), excess.shape)
    return int(k), int(joint)
