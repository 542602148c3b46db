"""The torque that a motor has left at the speed at which a command will act.

Near its no-load speed a motor's torque falls off to nothing, so what it may give depends on a speed
that nobody knows yet: the joints go on speeding up until the torque acts, their speeds are
estimated, and the ball strikes them. The torque-speed line is therefore taken at the largest speed
that a drive can have by then,

    w + max(w', 0) T + sum_k |T_k| (3 sigma_k + a_k T) + max(w_ball, 0),

all in the direction in which the drive turns. A line that is lower by a margin w_m is the line of a
drive whose stall torque and no-load speed are both smaller by the share w_m / w_0.

While a joint is not measured, the torques that hold what it moves are worked out from a place and a
speed that are not quite its own: every drive then keeps a share of its peak back.

| here       | meaning                                                           | unit    | shape |
|------------|-------------------------------------------------------------------|---------|-------|
| ``lead``   | T, from the reading of the joints until the command has acted     | s       |       |
| ``command``     | fifth row: accelerations by the torques before, by the model | rad/s^2 | (5, n)|
| ``ddq_unknown`` | first row: a_k, accelerations that unknown torques can add   | rad/s^2 | (2, n)|
| ``jump``   | change of the joint speeds by the ball, where it may come         | rad/s   | (n,)  |
| ``memory`` | of :mod:`mitt.control.encoder_memory`, sigma_k among it           |         | (n, .)|
"""

import numpy as np
from numpy.typing import NDArray

from mitt.control.encoder_memory import FAULT, FINE, GONE, VARIANCE_DQ
from mitt.control.rows import DDQ_BY_TAU
from mitt.jit import kernel
from mitt.robot.limits import LEAST
from mitt.signals import Array

#: Multiple of the estimate's 1-sigma by which a speed may be larger.
_SIGMAS = 3.0
#: Share of its peak that a drive may give while a joint is not measured; the rest is for what a
#: wrong pose makes of the torques. The plant of a trial may exceed a limit by as much.
_UNMEASURED = 0.99


@kernel
def derate(
    drives: Array, index: NDArray[np.int64], memory: Array, dq: Array, command: Array,
    ddq_unknown: Array, jump: Array, lead: float, struck: bool, out: Array,
) -> None:  # fmt: skip
    """Write the drives with what is left of their torque-speed lines, shape (2 N + 3, N).

    Args:
        drives: ``Limits.packed``, shape (2 N + 3, N).
        index: Active joints among the links, shape (n,).
        memory: As in the module's table.
        dq: Estimated joint speeds [rad/s], shape (n,).
        command: As in the module's table.
        ddq_unknown: As in the module's table.
        jump: As in the module's table.
        lead: As in the module's table.
        struck: Whether the ball may come before the command ceases to act.
        out: Result.
    """
    links = drives.shape[1]
    out[:] = drives
    measured = True
    for k in range(len(index)):
        measured &= memory[k, FAULT] == FINE and memory[k, GONE] == 0.0
    for m in range(links):
        out[2 * links, m] *= 1.0 if measured else _UNMEASURED
        stall, top = drives[2 * links + 1, m], drives[2 * links + 2, m]
        if not np.isfinite(stall):
            continue
        speed, rate, impact_dq, margin = 0.0, 0.0, 0.0, 0.0
        for k in range(len(index)):
            ratio = drives[links + m, index[k]]
            speed += ratio * dq[k]
            rate += ratio * command[DDQ_BY_TAU, k]
            impact_dq += ratio * jump[k]
            sigma = np.sqrt(max(memory[k, VARIANCE_DQ], 0.0))
            margin += abs(ratio) * (_SIGMAS * sigma + lead * ddq_unknown[0, k])
        way = 1.0 if speed >= 0.0 else -1.0
        margin += lead * max(way * rate, 0.0) + (max(way * impact_dq, 0.0) if struck else 0.0)
        left = max(1.0 - margin / top, LEAST)
        out[2 * links + 1, m], out[2 * links + 2, m] = left * stall, left * top
