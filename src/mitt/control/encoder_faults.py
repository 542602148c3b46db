"""Tests of a reading against what the joint can have done; see :mod:`mitt.control.monitor`.

``m`` is a row of :mod:`mitt.control.encoder_memory`, ``b`` the limits (:mod:`mitt.control.rows`).
"""

import numpy as np

from mitt.control import encoder_memory as at
from mitt.control.joint_filter import IN_A_ROW, restart
from mitt.control.rows import Q_MAX, Q_MIN
from mitt.jit import kernel
from mitt.signals import TICK, Array

#: What a sum of ticks may be off by because it was rounded.
TRIFLE = 1e-6
#: Excess over a speed limit that is none of the joint.
EXCESS = 1.5
#: Counts of least motion after which a still encoder is stuck, and ticks in which it must have
#: moved: a torque may act some ticks after its command.
_COUNTS, _STILL_TICKS = 5.0, 5
#: Room before the end of a joint's range in which the end stop may hold it [rad].
_STOP = 0.03
#: Mirror image of a velocity: smallest speed [rad/s], and how alike the two have to be.
_MIRROR, _ALIKE = 0.3, 0.05
#: Share of the speed a few ticks ago that a joint still has whose sign turns at once: one that a
#: wall throws back has lost its speed by then.
_STEADY = 0.8
#: Multiple of the unknown acceleration from which torques give a sign, ticks that the speed has to
#: grow against them, and by how much [rad/s].
_SURE, _TICKS_AGAINST, _GAINED = 2.0, 10, 0.1
#: Share of the largest speed of late that is forgotten in a tick: what gave way then gives it back.
_FORGETS = 0.005


@kernel
def explain_refused(
    m: Array, dq_max: float, ddq_max: float, step: float, q: float, impact_dq: float
) -> int:
    """Say what three readings in a row mean that the prediction does not explain.

    If the joint was struck at some instant since the last good reading, the line through the new
    readings meets the one that it was on then. A jump leaves a gap between them.
    """
    ticks, apart = m[at.SINCE], m[at.SPAN] * TICK / (IN_A_ROW - 1)
    dq = (q - m[at.FIRST]) / ((IN_A_ROW - 1) * apart)
    change = abs(dq - m[at.DQ0])
    gap = abs(q - dq * ticks * TICK - m[at.Q0])
    bent = EXCESS * ddq_max * (ticks * TICK) ** 2
    if abs(dq) > EXCESS * dq_max or gap > change * ticks * TICK + bent + 4.0 * step:
        return at.JUMPED
    alike = abs(dq + m[at.DQ0]) < _ALIKE * abs(m[at.DQ0]) + 2.0 * step / apart
    alike &= change > impact_dq and abs(m[at.DQ0]) >= _STEADY * m[at.FRESH]
    if alike and abs(m[at.DQ0]) > max(_MIRROR, 10.0 * step / apart):
        return at.REVERSED
    restart(m, q, dq, step, apart)
    return at.FINE


@kernel
def stands_still(
    m: Array, b: Array, k: int, step: float, q: float, alone: tuple[float, float, float, float],
    ticks: float, anew: bool,
) -> bool:  # fmt: skip
    """Say whether a reading stands still that must have moved, whether or not the ball struck.

    ``ticks`` have passed; the look begins ``anew`` where nobody knows what the joint did in them.
    """
    (low, high, error, slack), dt = alone, m[at.STEP]
    if anew or abs(q - m[at.HELD]) >= 0.5 * step:
        sure = max(abs(m[at.DQ]) - 3.0 * np.sqrt(m[at.VARIANCE_DQ]) - slack, 0.0)
        m[at.HELD], m[at.STILL], m[at.DUE], m[at.RESTS] = q, 0.0, 0.0, 0.0
        m[at.LEAST] = np.copysign(sure, m[at.DQ])
        return False
    slowest, fastest = m[at.LEAST] + low * dt, m[at.LEAST] + high * dt
    speed = slowest if slowest > 0.0 else min(fastest, 0.0)
    m[at.STILL] += ticks
    m[at.RESTS] += ticks
    m[at.LEAST] = np.copysign(max(abs(speed) - error * dt, 0.0), speed)
    least = max(abs(m[at.LEAST]) - slack, 0.0)
    m[at.DUE] += np.copysign(least, m[at.LEAST]) * dt
    if least == 0.0:
        m[at.DUE] = m[at.STILL] = 0.0
    above, below = q > b[Q_MAX, k] + _STOP, q < b[Q_MIN, k] - _STOP
    at_stop = (m[at.DUE] > 0.0 and above) or (m[at.DUE] < 0.0 and below)
    due = abs(m[at.DUE]) > (_COUNTS + 1.0) * step and m[at.STILL] >= _STILL_TICKS - TRIFLE
    if due and not at_stop and abs(m[at.DQ]) < abs(m[at.LEAST]):  # the reading has led it astray
        m[at.Q], m[at.DQ] = m[at.HELD] + m[at.DUE], m[at.LEAST]
    return bool(due and not at_stop)


@kernel
def moves_against(m: Array, ddq_unknown: float, push: float, ticks: float, anew: bool) -> bool:
    """Say whether a reading has gained speed against the torques for too long to be true.

    The state of the joint is then that of the beginning, carried on by the model. ``ticks`` and
    ``anew`` are as for :func:`stands_still`.
    """
    speed, dt = abs(m[at.DQ]), m[at.STEP]
    if anew or not (abs(push) > _SURE * ddq_unknown and m[at.DQ] * push < 0.0):
        m[at.AGAINST], m[at.FROM] = 0.0, max(speed, (1.0 - _FORGETS * ticks) * m[at.FROM])
        m[at.SHADOW_Q], m[at.SHADOW_DQ] = m[at.Q], m[at.DQ]
        return False
    m[at.SHADOW_Q] += dt * (m[at.SHADOW_DQ] + 0.5 * dt * push)
    m[at.SHADOW_DQ] += dt * push
    before = m[at.AGAINST]
    m[at.AGAINST] += ticks
    if before < _TICKS_AGAINST // 2 - TRIFLE <= m[at.AGAINST]:  # an impact is over by now
        m[at.FROM] = max(m[at.FROM], speed)
    least = _GAINED + 3.0 * np.sqrt(m[at.VARIANCE_DQ])
    if m[at.AGAINST] < _TICKS_AGAINST - TRIFLE or speed - m[at.FROM] < least:
        return False
    m[at.Q], m[at.DQ] = m[at.SHADOW_Q], m[at.SHADOW_DQ]
    return True
