"""What is remembered of the encoders from tick to tick: a row a joint, the columns below.

Ticks that are counted are times, in units of ``TICK``: a call adds what has passed since the last
one. A late call adds what one in time may at most, because nothing is known of what lay between.
"""

import numpy as np

from mitt.signals import Array

#: Estimate [rad, rad/s] and its covariance.
Q, DQ, VARIANCE_Q, COVARIANCE, VARIANCE_DQ = range(5)
#: Ticks without a number; refused readings in a row, and the first of them [rad].
GONE, REFUSED, FIRST = range(5, 8)
#: Estimate at the last reading that was taken, and ticks since, late ones wholly.
Q0, DQ0, SINCE = range(8, 11)
#: Reading that the encoder has not left; ticks in a row in which the joint must have moved since
#: then, its least speed and least way in them.
HELD, STILL, LEAST, DUE = range(11, 15)
#: Ticks in which the joint moved against the torques; largest speed of late before them; the joint
#: predicted since then.
AGAINST, FROM, SHADOW_Q, SHADOW_DQ = range(15, 19)
#: Readings too fast; acceleration by the command before.
FASTS, PUSH = range(19, 21)
#: What is wrong; good readings since then, the last one, whether it has moved.
FAULT, GOOD, LAST, MOVED = range(21, 25)
#: Gaps in the readings of late; largest speed in the last few ticks.
GAPS, FRESH = range(25, 27)
#: By how much readings corrected the velocity in this tick, and in the tick before; ticks since the
#: reading last changed.
CORRECTED, BEFORE, RESTS = range(27, 30)
#: Time that the last step took [s]; ticks since the first of the refused readings.
STEP, SPAN = range(30, 32)
#: By how much the stamps of readings may be off, by how evenly they came of late [s].
SHAKE = 32
COLUMNS = 33

#: Values of ``FAULT``; the first two are not a fault yet.
FINE, BRIDGED, SILENT, JUMPED, STUCK, REVERSED, FAST = range(7)


def memory_of(n: int) -> Array:
    """Return the memory of ``n`` encoders that have not been read yet, shape (n, COLUMNS)."""
    memory = np.zeros((n, COLUMNS))
    memory[:, Q] = np.nan
    return memory
