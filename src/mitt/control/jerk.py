"""The envelope of a joint whose limit set has jerk: acceleration changes by a bounded step a tick.

The joint is emitted as a chain of ticks of constant acceleration a:

    dq' = dq + T a,    q' = q + T (dq + dq') / 2,    |a - a before| <= jerk T.

A joint can stop if the ticks that :func:`calm` would make from here end at rest within its range
and below its speed. That is checked tick by tick, so there is nothing that a formula forgets; a
bound that is quickly worked out spares the walk where there is room. The wish is followed as far
as the next state can still stop, else the joint brakes, which by induction it can.

A joint that lags behind its motion comes back to it without overshoot: the speed at which it closes
in, and the acceleration that it takes for that, are such that a share of the jerk suffices to end
both in time.
"""

import numpy as np

from mitt.jit import kernel
from mitt.signals import TICK

#: Rate at which a gap to the wished position is closed [1/s].
_CLOSING = 50.0
#: Share of the jerk that ends an acceleration, and shares of jerk and acceleration that close a gap
#: of position: they leave room for the former.
_ENDING, _CLOSING_JERK, _CLOSING_DDQ = 0.5, 0.1, 0.3
#: How far into its range a joint that is beyond an end is led at least [rad].
_WITHIN = 0.001
#: Ticks in which a joint has to come to rest, halvings between wish and brake, and rounding.
_LONGEST, _HALVINGS, _ROUNDING = 5000, 10, 1e-12


@kernel
def releasable(gap: float, jerk: float) -> float:
    """Return the largest acceleration that can be ended before a gap of speed is closed.

    Args:
        gap: Speed that is lacking [rad/s].
        jerk: Largest jerk [rad/s^3]; infinite where there is no bound.

    Returns:
        Acceleration a with a^2 / (2 j) = |gap| [rad/s^2], j half the jerk; infinite where there is
        no bound.
    """
    return np.inf if np.isinf(jerk) else np.sqrt(2.0 * _ENDING * jerk * abs(gap))


@kernel
def closing_speed(gap: float, gain: float, ddq_max: float, jerk: float) -> float:
    """Return the speed at which a gap of position is closed [rad/s].

    At v = (4.5 j)^(1/3) gap^(2/3) closing in takes a constant jerk j, at v = (2 a gap)^(1/2) a
    constant acceleration a.

    Args:
        gap: Way that is lacking [rad].
        gain: Speed for each unit of it, where the limits allow that [1/s].
        ddq_max: Largest acceleration, of which a share is a [rad/s^2].
        jerk: Largest jerk, of which a share is j [rad/s^3].
    """
    smooth = (4.5 * _CLOSING_JERK * jerk * gap * gap) ** (1.0 / 3.0)
    strong = np.sqrt(2.0 * _CLOSING_DDQ * ddq_max * abs(gap))
    return float(np.copysign(min(gain * abs(gap), smooth, strong), gap))


@kernel
def calm(dq: float, ddq: float, brake: float, jerk: float) -> float:
    """Return the acceleration of the next tick of a joint that comes to rest.

    Args:
        dq: Speed now [rad/s].
        ddq: Acceleration in the tick before [rad/s^2].
        brake: Largest deceleration [rad/s^2].
        jerk: Largest change of the acceleration [rad/s^3].
    """
    speed = abs(dq)
    # With steps of jerk T back to none, a deceleration x takes x^2 / (2 jerk) + x T / 2 of speed.
    rate = jerk * (np.sqrt(0.25 * TICK * TICK + 2.0 * speed / jerk) - 0.5 * TICK)
    wish = -np.copysign(min(rate, speed / TICK, brake), dq)
    return float(min(max(wish, ddq - jerk * TICK), ddq + jerk * TICK))


@kernel
def can_stop(
    low: float, high: float, dq_max: float, brake: float, jerk: float,
    q: float, dq: float, ddq: float,
) -> bool:  # fmt: skip
    """Say whether a joint comes to rest in its range and below its speed.

    Args:
        low: Lower end of the range [rad].
        high: Upper end of the range [rad].
        dq_max: Largest speed [rad/s].
        brake: Deceleration to be trusted [rad/s^2].
        jerk: Largest jerk [rad/s^3].
        q: Position [rad].
        dq: Speed [rad/s].
        ddq: Acceleration in the tick that led there [rad/s^2].
    """
    if not (low <= q <= high and abs(dq) <= dq_max + _ROUNDING):
        return False
    rise = abs(ddq) / jerk + TICK
    top = abs(dq) + abs(ddq) * rise
    way = top * (rise + 0.5 * top / brake + brake / jerk + 2.0 * TICK)
    if top <= dq_max and way <= min(high - q, q - low):
        return True
    for _ in range(_LONGEST):
        if dq == 0.0 and ddq == 0.0:
            return True
        ddq = calm(dq, ddq, brake, jerk)
        before = dq
        dq += TICK * ddq
        if abs(dq) <= _ROUNDING and abs(ddq) <= jerk * TICK:
            dq = 0.0
        q += 0.5 * TICK * (before + dq)
        if not (low <= q <= high and abs(dq) <= dq_max + _ROUNDING):
            return False
    return False


@kernel
def clamp_smooth(
    low: float, high: float, dq_max: float, brake: float, ddq_max: float, jerk: float,
    last: tuple[float, float, float], desired: tuple[float, float, float],
) -> tuple[float, float, float]:  # fmt: skip
    """Return the command of a joint with a jerk limit for which a motion is desired.

    Beyond its speed it brakes, and beyond an end of its range it is led back in, whatever is
    desired.

    Args:
        low: Lower end of the range [rad].
        high: Upper end of the range [rad].
        dq_max: Largest speed [rad/s].
        brake: Deceleration to be trusted [rad/s^2], at most ``ddq_max``.
        ddq_max: Largest acceleration [rad/s^2].
        jerk: Largest jerk [rad/s^3].
        last: q, dq, ddq emitted in the tick before, finite.
        desired: q, dq, ddq; of a wish with anything not finite nothing is taken.
    """
    (q0, dq0, ddq0), (q, dq, ddq) = last, desired
    near = calm(dq0, ddq0, brake, jerk)
    if abs(dq0) > dq_max + _ROUNDING:
        q1, dq1, _ = onwards(q0, dq0, near)
        return q1, dq1, near
    if not (np.isfinite(q) and np.isfinite(dq) and np.isfinite(ddq)):
        q, dq, ddq = q0, 0.0, 0.0
    within = min(_WITHIN, 0.25 * (high - low))
    if q0 > high:
        q, dq, ddq, high = min(q, high - within), min(dq, 0.0), min(ddq, 0.0), q0
    elif q0 < low:
        q, dq, ddq, low = max(q, low + within), max(dq, 0.0), max(ddq, 0.0), q0
    dq, ddq = min(max(dq, -2.0 * dq_max), 2.0 * dq_max), min(max(ddq, -ddq_max), ddq_max)
    gap = min(max(q - q0 - 0.5 * TICK * (dq + dq0), -1e3), 1e3)
    lacking = dq - dq0 - TICK * ddq
    lacking += closing_speed(gap, _CLOSING, ddq_max, jerk)
    most = releasable(lacking, jerk)
    wish = min(max(ddq + min(max(lacking / TICK, -most), most), -ddq_max), ddq_max)
    wish = min(max(wish, ddq0 - jerk * TICK), ddq0 + jerk * TICK)
    q1, dq1, _ = onwards(q0, dq0, wish)
    if can_stop(low, high, dq_max, brake, jerk, q1, dq1, wish):
        return q1, dq1, wish
    far = wish
    for _ in range(_HALVINGS):
        middle = 0.5 * (near + far)
        q1, dq1, _ = onwards(q0, dq0, middle)
        if can_stop(low, high, dq_max, brake, jerk, q1, dq1, middle):
            near = middle
        else:
            far = middle
    q1, dq1, _ = onwards(q0, dq0, near)
    return q1, dq1, near


@kernel
def onwards(q: float, dq: float, ddq: float) -> tuple[float, float, float]:
    """Return q, dq, ddq after a tick of constant acceleration."""
    after = dq + TICK * ddq
    if abs(after) <= _ROUNDING:
        after = 0.0
    return q + 0.5 * TICK * (dq + after), after, ddq


@kernel
def braked(dq: float, ddq: float, brake: float, jerk: float, t: float) -> tuple[float, float]:
    """Return how far a joint that comes to rest has moved after a time at most, and its speed then.

    An upper bound of the motion of :func:`calm`, in its first direction: the acceleration stays
    until it would be turned to braking and then lets go of nothing early.

    Args:
        dq: Speed now [rad/s].
        ddq: Acceleration in the tick before [rad/s^2].
        brake: Largest deceleration [rad/s^2].
        jerk: Largest jerk [rad/s^3].
        t: Time [s].
    """
    delay = (abs(ddq) + 2.0 * brake) / jerk + 2.0 * TICK
    top = abs(dq) + 0.5 * ddq * ddq / jerk + abs(ddq) * TICK
    slow = max(t - delay, 0.0)
    slow = min(slow, top / brake)
    return top * min(t, delay) + slow * (top - 0.5 * brake * slow), top - brake * slow
