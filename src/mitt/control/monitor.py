"""What the joints do, and whether their encoders can be believed.

Positions alone are used: encoders count, and a velocity that is a difference of counts is wrong by
up to a count in a tick. Each joint has a Kalman filter of position and velocity that is driven by
the acceleration that the command's torques bring by the model. Its process noise is a third of the
model's largest error (unknown torque, a fifth of the acceleration, its change since the tick
before), its measurement noise that of rounding, so it trusts the counts as far as they go.

An encoder is in doubt only where no admissible plant explains what it reads:

* SILENT: no number for ``SILENT_TICKS`` in a row. Shorter gaps are bridged by the prediction, and
  up to ``LOSSY_TICKS`` where the encoder has had gaps of late, or has only been read for 0.1 s:
  with 30 % of the readings lost, fifteen in a row are lost once in 7e7 ticks;
* JUMPED: three readings in a row lie where no motion within the limits leads, impacts included: an
  impact changes the velocity, not the place;
* STUCK: the reading stands still while the joint must have moved on by more than five counts. How
  the other joints move is measured, so only a torque at this joint itself can hold it: friction and
  model error have to be larger than is known of them;
* REVERSED: a steady velocity turns round at once to its mirror image; or for some ticks the reading
  moves against the torques, and faster than the joint was of late. What is passive does not do
  that: a wall gives back no more speed than it took. While the ball may strike, a change of
  velocity that its impact explains is none;
* FAST: the joint is half as fast again as its limit.

Then the joint is *unmeasured*: nothing that is read of it reaches the controller. It is reckoned by
the model from the last state that was trusted. Good readings end that once a person recovers.

Memory, a row a joint: the columns below.
"""

import numpy as np

from mitt.jit import kernel
from mitt.signals import TICK, Array
from mitt.views import view

#: Columns of the memory: estimate, its covariance; ticks without a number, refused readings in a
#: row, the first of them; estimate at the last reading that was taken, and ticks since.
_Q, _DQ, _PQ, _PX, _PV, _GONE, _REFUSED, _FIRST, _Q0, _DQ0, _SINCE = range(11)
#: Reading that the encoder has not left; ticks in a row in which the joint must have moved since
#: then, its least speed and least way in them.
_HELD, _STILL, _LEAST, _DUE = range(11, 15)
#: Ticks in which the joint moved against the torques, largest speed of late before them, the joint
#: reckoned since then; ticks too fast; acceleration told before; what is wrong; good readings since
#: then, the last one, whether it has moved.
_AGAINST, _FROM, _SHADOW_Q, _SHADOW_DQ, _FASTS, _PUSH, _DOUBT, _GOOD, _LAST, _MOVED = range(15, 25)
#: Gaps in the readings of late; largest speed in the last few ticks; by how much readings corrected
#: the velocity in this tick, and in the tick before; ticks since the reading last changed.
_GAPS, _FRESH, _CORRECTED, _BEFORE, _RESTS = 25, 26, 27, 28, 29
COLUMNS = 30
#: Column of the variance of the estimated speed [rad^2/s^2].
SPEED_VARIANCE = _PV

#: What is wrong with an encoder; the first two are not a fault yet.
FINE, BRIDGED, SILENT, JUMPED, STUCK, REVERSED, FAST = range(7)

#: Ticks without a number after which an encoder is silent, for one that has read well and for one
#: that loses readings or has not been read yet; first readings that no joint of the arm can have.
SILENT_TICKS, LOSSY_TICKS, _IMPOSSIBLE = 6, 15, 3
#: Share of a gap that is forgotten in a tick, of one that still counts, and of a new encoder.
_HEALS, _GAP, _NEW = 0.002, 0.3, 0.37
#: Refused readings in a row that make a fault, and excess over a speed limit.
_IN_A_ROW, _EXCESS = 3, 1.5
#: How far outside a joint's range a first reading may lie [rad].
_BEYOND = 0.5
#: Counts of least motion after which a still encoder is stuck, and ticks in which it must have
#: moved: a torque may act some ticks after its command.
_COUNTS, _STILL_TICKS = 5.0, 5
#: Room before the end of a joint's range in which the end stop may hold it [rad].
_STOP = 0.03
#: Share of the modelled acceleration that may be wrong, and of the largest error that is one sigma.
_MODEL, _SIGMA = 0.2, 1.0 / 3.0
#: For how many ticks a model error lasts, which the process noise allows for.
_LASTING = 5.0
#: Sigmas of an innovation beyond which a reading is refused.
_GATE = 6.0
#: Mirror image of a velocity: smallest speed [rad/s], and how alike the two have to be.
_MIRROR, _ALIKE = 0.3, 0.05
#: Share of the speed a few ticks ago that a joint still has whose sign turns at once: one that a
#: wall throws back has lost its speed by then; and share of that speed that is kept in a tick.
_STEADY, _KEEPS = 0.8, 0.85
#: Multiple of the unknown acceleration from which torques tell a sign, ticks that the speed has to
#: grow against them, and by how much [rad/s].
_SURE, _TICKS_AGAINST, _GAINED = 2.0, 10, 0.1
#: Share of the largest speed of late that is forgotten in a tick: what gave way then gives it back.
_FORGETS = 0.005
#: Good readings in a row after which an encoder in doubt counts as good again, how near they have
#: to be to where the joint is reckoned [rad], and counts that a stuck one has to move.
GOOD_TICKS, _NEAR, _MOVES = 50, 0.1, 3.0


def memory_of(n: int) -> Array:
    """Return the memory of ``n`` encoders that have not been read yet, shape (n, COLUMNS)."""
    memory = np.zeros((n, COLUMNS))
    memory[:, _Q] = np.nan
    return memory


def doubted(memory: Array) -> list[int]:
    """Return the joints whose encoders are in doubt, by their indices."""
    return [int(k) for k in np.flatnonzero(memory[:, _DOUBT])]


def good_again(memory: Array) -> Array:
    """Say of each encoder whether it is believed, or has read well since it was in doubt, (n,)."""
    fine = (memory[:, _DOUBT] == FINE) & (memory[:, _GONE] == 0.0)
    moved = (memory[:, _DOUBT] != STUCK) | (memory[:, _MOVED] > 0.0)
    out: Array = fine | ((memory[:, _GOOD] >= GOOD_TICKS) & moved)
    return out


@kernel
def believe(
    memory: Array,
    b: Array,
    steps: Array,
    doubt: Array,
    coupling: Array,
    read: Array,
    told: Array,
    held: bool,
    blow: Array,
    believed: Array,
) -> int:
    """Write what is believed of the joints, and say what is wrong with the worst encoder.

    Args:
        memory: Overwritten, shape (n, COLUMNS).
        b: Limits, as of :mod:`mitt.control.envelope`, shape (>= 5, n).
        steps: Resolution of the encoders [rad], shape (n,).
        doubt: As of :func:`mitt.control.encoders.bring`, shape (2, n).
        coupling: As of that function, shape (n, n).
        read: q, dq as read [rad, rad/s], shape (2, n); dq counts in the first tick alone.
        told: q, dq, ddq, tau told in the tick before, and the acceleration that its torques
            bring by the model, shape (5, n).
        held: Whether brakes hold the joints: one that is not measured rests.
        blow: Change of speed that the ball's impact may bring now [rad/s], shape (n,).
        believed: Result: q, dq, shape (2, n).
    """
    worst, n = FINE, read.shape[1]
    for k in range(n):
        memory[k, _BEFORE], memory[k, _CORRECTED] = memory[k, _CORRECTED], 0.0
    for k in range(n):
        m, q = view(memory, k * COLUMNS, (COLUMNS,)), read[0, k]
        push = told[4, k] if np.isfinite(told[4, k]) else 0.0
        if np.isnan(m[_Q]):
            found = _begin(m, b, k, steps[k], q, read[1, k])
        elif m[_DOUBT] != FINE:
            found = int(m[_DOUBT])
            _reckon(m, b[2, k], steps[k], q, push, held)
        else:
            alone = _held_alone(memory, k, doubt, coupling, told, push, blow)
            found = _observe(m, b, k, steps[k], doubt[0, k], q, push, blow[k], alone, held)
            if found >= SILENT:  # what it read may have been taken for a motion that pushes others
                memory[:, _STILL], memory[:, _DUE], memory[:, _LEAST] = 0.0, 0.0, 0.0
                m[_DOUBT], m[_GOOD], m[_MOVED], m[_LAST] = found, 0.0, 0.0, q
        m[_PUSH] = push
        if not np.isnan(m[_Q]):
            believed[0, k], believed[1, k] = m[_Q], m[_DQ]
        worst = max(worst, found)
    return worst


@kernel
def _begin(m: Array, b: Array, k: int, step: float, q: float, dq: float) -> int:
    """Take the first reading, if it can be one of this joint."""
    if not b[0, k] - _BEYOND <= q <= b[1, k] + _BEYOND:
        m[_GONE] += 1.0
        m[_REFUSED] += 1.0 if np.isfinite(q) else 0.0
        silent = m[_GONE] >= LOSSY_TICKS or m[_REFUSED] >= _IMPOSSIBLE
        return SILENT if silent else BRIDGED
    known = abs(dq) <= _EXCESS * b[2, k]
    _take(m, q, dq if known else 0.0, step)
    m[_GONE], m[_HELD], m[_LEAST], m[_GAPS], m[_CORRECTED] = 0.0, q, 0.0, _NEW, 0.0
    return FINE


@kernel
def _take(m: Array, q: float, dq: float, step: float) -> None:
    """Begin the filter from a reading and a velocity that is a difference of readings."""
    r = step * step / 12.0
    m[_CORRECTED] += dq - m[_DQ]
    m[_Q], m[_DQ], m[_Q0], m[_DQ0], m[_SINCE] = q, dq, q, dq, 0.0
    m[_PQ], m[_PX], m[_PV] = r, r / TICK, 2.0 * r / (TICK * TICK)
    m[_REFUSED], m[_AGAINST], m[_FROM] = 0.0, 0.0, max(m[_FROM], abs(dq))
    m[_FRESH] = max(abs(dq), _KEEPS**_IN_A_ROW * m[_FRESH])


@kernel
def _reckon(m: Array, dq_max: float, step: float, q: float, push: float, held: bool) -> None:
    """Carry an unmeasured joint on by the model, and watch what its encoder reads."""
    if held:
        m[_DQ] = 0.0
    else:
        m[_Q] += TICK * (m[_DQ] + 0.5 * TICK * push)
        m[_DQ] = min(max(m[_DQ] + TICK * push, -dq_max), dq_max)
    moved = abs(q - m[_LAST]) if np.isfinite(q) and np.isfinite(m[_LAST]) else np.inf
    likely = moved <= _EXCESS * dq_max * TICK + 2.0 * step and abs(q - m[_Q]) <= _NEAR
    m[_GOOD] = m[_GOOD] + 1.0 if likely else 0.0
    if likely and abs(q - m[_HELD]) >= _MOVES * step:
        m[_MOVED] = 1.0
    m[_LAST] = q


@kernel
def _held_alone(
    memory: Array, k: int, doubt: Array, coupling: Array, told: Array, push: float, blow: Array
) -> tuple[float, float, float, float]:
    """Return what a torque at this joint has to overcome to hold it while the others move as read.

    A reading that stands still may be a stuck one: then its joint moves as it is read, or as the
    model says, or in between. A joint in doubt may do anything that unknown torques explain.

    Returns:
        The least and the largest acceleration that the commanded torques would bring then, their
        error [rad/s^2], and by how much the speed may be wrong because those of the others are,
        or because the ball struck [rad/s].
    """
    low, high, own, moved, variance, struck = push, push, doubt[1, k], 0.0, 0.0, 0.0
    for j in range(len(memory)):
        ratio, other = coupling[k, j], memory[j]
        struck += abs(ratio) * blow[j]
        if other[_DOUBT] != FINE:
            own = max(own, doubt[0, k])
        elif j != k:
            pull = -ratio * other[_BEFORE] / TICK
            low += min(pull, 0.0) if other[_RESTS] > 0.0 else pull
            high += max(pull, 0.0) if other[_RESTS] > 0.0 else pull
            moved += ratio * told[4, j] if np.isfinite(told[4, j]) else 0.0
            variance += ratio * ratio * other[_PV]
    error = own + _MODEL * (abs(push) + abs(moved)) + abs(push - memory[k, _PUSH])
    return low, high, error, 3.0 * np.sqrt(variance) + struck


@kernel
def _observe(
    m: Array, b: Array, k: int, step: float, doubt: float, q: float, push: float, blow: float,
    alone: tuple[float, float, float, float], held: bool,
) -> int:  # fmt: skip
    """Predict a measured joint, correct it by its reading, and say what is wrong with that."""
    error = doubt + _MODEL * abs(push) + abs(push - m[_PUSH])
    _predict(m, push, error)
    if not np.isfinite(q):
        m[_GONE] += 1.0
        lossy = m[_GAPS] > _GAP
        return SILENT if m[_GONE] >= (LOSSY_TICKS if lossy else SILENT_TICKS) else BRIDGED
    m[_GAPS] = (1.0 - _HEALS) * m[_GAPS] + (1.0 if m[_GONE] > 0.0 else 0.0)
    m[_GONE] = 0.0
    if not held and _stands_still(m, b, k, step, q, alone):  # brakes hold as hard as they do
        return STUCK
    off, r = q - m[_Q], step * step / 12.0
    gate = _GATE * np.sqrt(m[_PQ] + r) + step + _EXCESS * b[4, k] * TICK * TICK
    if abs(off) > gate:
        m[_FIRST] = q if m[_REFUSED] == 0.0 else m[_FIRST]
        m[_REFUSED] += 1.0
        return _refused(m, b[2, k], b[4, k], step, q, blow) if m[_REFUSED] >= _IN_A_ROW else BRIDGED
    _correct(m, off, r)
    m[_FASTS] = m[_FASTS] + 1.0 if abs(m[_DQ]) - 3.0 * np.sqrt(m[_PV]) > _EXCESS * b[2, k] else 0.0
    if m[_FASTS] >= _IN_A_ROW:
        return FAST
    return REVERSED if _against(m, doubt, push) else FINE


@kernel
def _predict(m: Array, push: float, error: float) -> None:
    """Carry estimate and covariance on by a tick.

    What the model misses is white within the tick. Were it constant there, a fine encoder would
    leave an error of the velocity undamped: its sign would change from tick to tick for ever.
    """
    sigma = _SIGMA * error
    v = _LASTING * sigma * sigma * TICK * TICK
    m[_Q] += TICK * (m[_DQ] + 0.5 * TICK * push)
    m[_DQ] += TICK * push
    m[_PQ] += TICK * (2.0 * m[_PX] + TICK * (m[_PV] + v / 3.0))
    m[_PX] += TICK * (m[_PV] + 0.5 * v)
    m[_PV] += v
    m[_SINCE] += 1.0


@kernel
def _correct(m: Array, off: float, r: float) -> None:
    """Take a reading in that is off by so much [rad], with a variance [rad^2]."""
    s = m[_PQ] + r
    gain, rate = m[_PQ] / s, m[_PX] / s
    m[_Q] += gain * off
    m[_DQ] += rate * off
    m[_CORRECTED] += rate * off
    m[_PV] -= rate * m[_PX]
    m[_PX] *= 1.0 - gain
    m[_PQ] *= 1.0 - gain
    m[_Q0], m[_DQ0], m[_SINCE], m[_REFUSED] = m[_Q], m[_DQ], 0.0, 0.0
    m[_FRESH] = max(abs(m[_DQ]), _KEEPS * m[_FRESH])


@kernel
def _refused(m: Array, dq_max: float, ddq_max: float, step: float, q: float, blow: float) -> int:
    """Say what three readings in a row mean that the prediction does not explain.

    If the joint was struck at some instant since the last good reading, the line through the new
    readings meets the one that it was on then. A jump leaves a gap between them.
    """
    ticks = m[_SINCE]
    dq = (q - m[_FIRST]) / ((_IN_A_ROW - 1) * TICK)
    change = abs(dq - m[_DQ0])
    gap = abs(q - dq * ticks * TICK - m[_Q0])
    bent = _EXCESS * ddq_max * (ticks * TICK) ** 2
    if abs(dq) > _EXCESS * dq_max or gap > change * ticks * TICK + bent + 4.0 * step:
        return JUMPED
    alike = abs(dq + m[_DQ0]) < _ALIKE * abs(m[_DQ0]) + 2.0 * step / TICK
    alike &= change > blow and abs(m[_DQ0]) >= _STEADY * m[_FRESH]
    if alike and abs(m[_DQ0]) > max(_MIRROR, 10.0 * step / TICK):
        return REVERSED
    _take(m, q, dq, step)
    return FINE


@kernel
def _stands_still(
    m: Array, b: Array, k: int, step: float, q: float, alone: tuple[float, float, float, float]
) -> bool:  # fmt: skip
    """Say whether a reading stands still that must have moved, whether or not the ball struck."""
    low, high, error, slack = alone
    if abs(q - m[_HELD]) >= 0.5 * step:
        sure = max(abs(m[_DQ]) - 3.0 * np.sqrt(m[_PV]) - slack, 0.0)
        m[_HELD], m[_STILL], m[_DUE], m[_RESTS] = q, 0.0, 0.0, 0.0
        m[_LEAST] = np.copysign(sure, m[_DQ])
        return False
    slowest, fastest = m[_LEAST] + low * TICK, m[_LEAST] + high * TICK
    speed = slowest if slowest > 0.0 else min(fastest, 0.0)
    m[_STILL] += 1.0
    m[_RESTS] += 1.0
    m[_LEAST] = np.copysign(max(abs(speed) - error * TICK, 0.0), speed)
    least = max(abs(m[_LEAST]) - slack, 0.0)
    m[_DUE] += np.copysign(least, m[_LEAST]) * TICK
    if least == 0.0:
        m[_DUE] = m[_STILL] = 0.0
    at_stop = (m[_DUE] > 0.0 and q > b[1, k] + _STOP) or (m[_DUE] < 0.0 and q < b[0, k] - _STOP)
    due = abs(m[_DUE]) > (_COUNTS + 1.0) * step and m[_STILL] >= _STILL_TICKS
    if due and not at_stop and abs(m[_DQ]) < abs(m[_LEAST]):  # the reading has led it astray
        m[_Q], m[_DQ] = m[_HELD] + m[_DUE], m[_LEAST]
    return bool(due and not at_stop)


@kernel
def _against(m: Array, doubt: float, push: float) -> bool:
    """Say whether a reading has gained speed against the torques for too long to be true.

    The state of the joint is then that of the beginning, carried on by the model.
    """
    speed = abs(m[_DQ])
    if not (abs(push) > _SURE * doubt and m[_DQ] * push < 0.0):
        m[_AGAINST], m[_FROM] = 0.0, max(speed, (1.0 - _FORGETS) * m[_FROM])
        m[_SHADOW_Q], m[_SHADOW_DQ] = m[_Q], m[_DQ]
        return False
    m[_SHADOW_Q] += TICK * (m[_SHADOW_DQ] + 0.5 * TICK * push)
    m[_SHADOW_DQ] += TICK * push
    m[_AGAINST] += 1.0
    if m[_AGAINST] == _TICKS_AGAINST // 2:  # a blow is over by now
        m[_FROM] = max(m[_FROM], speed)
    least = _GAINED + 3.0 * np.sqrt(m[_PV])
    if m[_AGAINST] < _TICKS_AGAINST or speed - m[_FROM] < least:
        return False
    m[_Q], m[_DQ] = m[_SHADOW_Q], m[_SHADOW_DQ]
    return True
