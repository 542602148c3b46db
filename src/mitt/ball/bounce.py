"""What a bounce does to a ball where nobody knows of a table: it may be at any height."""

from mitt.jit import kernel
from mitt.signals import GRAVITY, Array

REBOUND, GRIP = 0.8, 0.25
"""Shares of its speed that a bounce gives back across a surface, and takes along it: about those of
balls in use, 0.5 to 0.9 and 0.1 to 0.4."""

SEEMS_GONE = 2.0
"""Frames that should show the ball and do not, after which it has bounced as likely as not."""


@kernel
def change_by_bounce(dr: Array, ago: float, change: Array) -> bool:
    """Write by how much a bounce on a level surface would have changed a ball's velocity.

    Args:
        dr: Its velocity if it flies on [m/s], shape (3,).
        ago: How long ago it would have bounced [s].
        change: Result [m/s], shape (3,).

    Returns:
        Whether it could: a ball that rose does not bounce, and nothing is written.
    """
    falling = -(dr[2] + GRAVITY * ago)
    if not falling > 0.0:
        return False
    change[0], change[1], change[2] = -GRIP * dr[0], -GRIP * dr[1], (1.0 + REBOUND) * falling
    return True


@kernel
def doubt_flight(
    dr: Array, silence: float, missed: float, change: Array, covariance: Array
) -> None:
    """Add to a covariance what a bounce may have done to a ball that frames do not show any more.

    It bounced at any instant of the silence, or something hides it and it flies on. The more frames
    should have shown it and did not, the likelier is the bounce.

    Args:
        dr: Velocity if it flies on [m/s], shape (3,).
        silence: Time since it was seen [s].
        missed: Frames since then that should have shown it.
        change: Scratch, shape (3,).
        covariance: Of position and velocity, overwritten, shape (6, 6).
    """
    if not (missed > 0.0 and silence > 0.0 and change_by_bounce(dr, silence, change)):
        return
    likely = missed / (missed + SEEMS_GONE)
    for i in range(3):
        for j in range(3):
            both = likely * change[i] * change[j]
            covariance[i, j] += both * silence * silence / 3.0
            covariance[i, 3 + j] += both * silence / 2.0
            covariance[3 + i, j] += both * silence / 2.0
            covariance[3 + i, 3 + j] += both
