"""Whether the encoders can be believed, and what state the catcher is in.

An encoder is held to what it read a tick ago and to the motion that the arm was told:

* a first reading has to lie near the joint's range;
* a reading that is not finite, or that no motion within the limits explains, is replaced by dead
  reckoning along the told motion; the third in a row is a fault, so a single glitch passes;
* an encoder that does not move is stuck if its joint must have moved by more than five counts
  since: from the speed last read, under the torques, with all that friction may hold and an error
  of the model against it;
* one that runs backwards against the acceleration that the torques bring has lost its sign.

From a fault on, the joint is reckoned, not read: the arm is stopped along the model. A reversed
encoder is read with its sign turned: it has driven the joint the wrong way, and only it can tell
how fast. A stuck encoder that moves on, the same way for some ticks, adds its motion to where the
joint was reckoned to be: the stop stays, but if it was a false alarm, nobody else sees where the
joint goes, and if it has lost counts, what is believed does not jump.

Memory of the encoders, a row a joint: last believed q and dq, readings refused in a row, least
motion since the reading changed [rad], ticks stuck, sums of the speed gained by the torques and by
the reading over a fading window [rad/s], ticks of disagreement, whether the joint is reckoned (1,
or 2 for a stuck encoder) or read with its sign turned (-1), the reading that it has not left [rad],
the least speed that the joint has had since [rad/s], and ticks in which a stuck encoder has moved
one way.
"""

from dataclasses import dataclass

import numpy as np

from mitt.control.envelope import TICK
from mitt.errors import InputError
from mitt.jit import kernel
from mitt.signals import Array
from mitt.views import view

#: Columns of the memory.
_Q, _DQ, _REFUSED, _DUE, _STUCK, _GAINED, _READ, _APART, _RECKONED, _HELD, _SPEED, _BACK = range(12)
COLUMNS = 12

#: What is wrong with an encoder; the first two are not a fault yet.
FINE, BRIDGED, SILENT, JUMPED, STUCK, REVERSED = range(6)

#: A joint that is reckoned since its encoder stuck.
_LEFT = 2.0

#: Readings in a row that make a fault, or show that a stuck encoder moves on, and a reading's
#: excess over what a limit explains.
_IN_A_ROW, _EXCESS = 3, 1.5
#: How far outside a joint's range a first reading may lie [rad].
_BEYOND = 0.5
#: Counts of least motion after which a still encoder is suspicious, and ticks until it is stuck.
_COUNTS, _STILL = 5.0, 2
#: Share of a joint's largest torque that friction may take, and share of the acceleration by the
#: model that may be wrong.
_FRICTION, _DOUBT = 0.1, 0.2
#: Share of the window that fades each tick; gained speed from which the signs are compared
#: [rad/s], the share of it that a reversed encoder shows, and ticks until it counts.
_FADING, _GAIN, _AGAINST, _TICKS_APART = 0.2, 0.25, 0.3, 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Encoders:
    """What is known of the encoders.

    Attributes:
        step: Resolution of each joint's encoder [rad], one number for all or one a joint; None:
            the arm's own.
    """

    step: float | tuple[float, ...] | None = None

    def steps(self, own: Array) -> Array:
        """Return the resolution of each joint's encoder [rad], shape (n,).

        Args:
            own: The arm's, shape (n,).

        Raises:
            InputError: Not one number above 0 for each joint.
        """
        given = own if self.step is None else np.atleast_1d(np.asarray(self.step, np.float64))
        if given.shape not in ((1,), own.shape) or not np.all((given > 0.0) & (given < 0.1)):
            wanted = f"one number or {len(own)}, above 0 and below 0.1 rad"
            raise InputError("encoder step", wanted, self.step)
        return np.array(np.broadcast_to(given, own.shape))


def memory_of(n: int) -> Array:
    """Return the memory of ``n`` encoders that have not been read yet, shape (n, COLUMNS)."""
    memory = np.zeros((n, COLUMNS))
    memory[:, _Q] = np.nan
    return memory


def doubted(memory: Array) -> list[int]:
    """Return the joints whose encoders are not believed, by their indices."""
    return [int(k) for k in np.flatnonzero(memory[:, _RECKONED])]


@kernel
def believe(
    memory: Array,
    b: Array,
    steps: Array,
    read: Array,
    told: Array,
    believed: Array,
) -> int:
    """Write what is believed of the joints, and say what is wrong with the worst encoder.

    Args:
        memory: Overwritten, shape (n, COLUMNS).
        b: Limits, as of :mod:`mitt.control.envelope`, shape (>= 5, n).
        steps: Resolution of the encoders [rad], shape (n,).
        read: q, dq as read [rad, rad/s], shape (2, n).
        told: q, dq, ddq, tau told in the tick before, and the acceleration that its torques
            bring by the model, shape (5, n).
        believed: Result: q, dq, shape (2, n).
    """
    worst = FINE
    for k in range(read.shape[1]):
        count = steps[k]
        m, q, dq = view(memory, k * COLUMNS, (COLUMNS,)), read[0, k], read[1, k]
        if np.isnan(m[_Q]) and _may_begin(b, k, q, dq):
            m[_Q], m[_DQ], m[_HELD] = q, dq, q
        moved = q - m[_HELD]
        moves_on = m[_RECKONED] == _LEFT and _moves_on(m, b, k, count, q, dq)
        found = _judge(m, b[2, k], b[3, k], b[4, k], count, q, dq, told[4, k])
        if found >= SILENT and m[_RECKONED] == 0.0:
            m[_RECKONED] = -1.0 if found == REVERSED else (_LEFT if found == STUCK else 1.0)
        if found == FINE and m[_RECKONED] == 0.0:
            m[_Q], m[_DQ] = q, dq
        elif moves_on:
            m[_Q], m[_DQ] = m[_Q] + moved, dq
        elif m[_RECKONED] < 0.0 and _may_begin(b, k, -q, -dq):
            m[_Q], m[_DQ] = -q, -dq
        elif not np.isnan(m[_Q]):
            m[_Q], m[_DQ] = m[_Q] + TICK * told[1, k], told[1, k]
        if not np.isnan(m[_Q]):
            believed[0, k], believed[1, k] = m[_Q], m[_DQ]
        worst = max(worst, found)
    return worst


@kernel
def _may_begin(b: Array, k: int, q: float, dq: float) -> bool:
    """Say whether a reading by itself can be one of this joint; one that is no number cannot."""
    return bool(b[0, k] - _BEYOND <= q <= b[1, k] + _BEYOND and abs(dq) <= _EXCESS * b[2, k])


@kernel
def _moves_on(m: Array, b: Array, k: int, count: float, q: float, dq: float) -> bool:
    """Say whether a stuck encoder has moved one way for some ticks, by a count or more in each."""
    moved = q - m[_HELD]
    if not (abs(moved) >= 0.5 * count and moved * dq > 0.0 and _may_begin(b, k, q, dq)):
        m[_BACK] = 0.0
        return False
    way = np.copysign(1.0, moved)
    m[_BACK] = m[_BACK] + way if m[_BACK] * way > 0.0 else way
    m[_HELD] = q
    return bool(abs(m[_BACK]) >= _IN_A_ROW)


@kernel
def _judge(
    m: Array,
    dq_max: float,
    brake: float,
    ddq_max: float,
    count: float,
    q: float,
    dq: float,
    push: float,
) -> int:
    """Say what is wrong with one encoder."""
    finite = np.isfinite(q) and np.isfinite(dq)
    if not finite or np.isnan(m[_Q]):
        m[_REFUSED] += 1.0
        return SILENT if m[_REFUSED] >= _IN_A_ROW else BRIDGED
    moved, gained = q - m[_Q], dq - m[_DQ]
    far = abs(moved) > _EXCESS * dq_max * TICK + _COUNTS * count
    fast = abs(dq) > _EXCESS * dq_max or abs(gained) > _EXCESS * ddq_max * TICK + count / TICK
    still = abs(q - m[_HELD]) < 0.5 * count
    speed = (m[_SPEED] if still else m[_DQ]) + push * TICK
    least = abs(speed) - (_FRICTION * brake + _DOUBT * abs(push)) * TICK
    least = np.copysign(max(least, 0.0), speed)
    if still:
        m[_SPEED], m[_DUE] = least, m[_DUE] + least * TICK
    else:
        slow = far or fast or abs(dq) < abs(least)
        m[_HELD], m[_DUE], m[_SPEED] = q, 0.0, least if slow else dq
    m[_STUCK] = m[_STUCK] + 1.0 if abs(m[_DUE]) > _COUNTS * count else 0.0
    if m[_STUCK] >= _STILL:
        return STUCK
    if far or fast:
        m[_REFUSED] += 1.0
        return JUMPED if m[_REFUSED] >= _IN_A_ROW else BRIDGED
    m[_REFUSED] = 0.0
    m[_GAINED] += push * TICK - _FADING * m[_GAINED]
    m[_READ] += gained - _FADING * m[_READ]
    against = m[_READ] * np.copysign(1.0, m[_GAINED]) < -_AGAINST * abs(m[_GAINED])
    m[_APART] = m[_APART] + 1.0 if abs(m[_GAINED]) > _GAIN and against else 0.0
    return REVERSED if m[_APART] >= _TICKS_APART else FINE
