"""Torques held for some ticks, in compiled code: what a learner's action does to the plant.

The one other way is a tick at a time, :meth:`mitt.lab.world.simulation.World.apply`; tests demand
the same bytes of both. This one stands beside it for its speed: an action of five ticks takes a
third of the time.
"""

import numpy as np
from numpy.typing import NDArray

from mitt.core.arm.limits import saturate
from mitt.core.kernels import kernel
from mitt.core.signals import Array
from mitt.lab.world.engine import Plant
from mitt.lab.world.motion import move_motors, note_stop, over
from mitt.lab.world.truth import Trace


@kernel
def hold_torques(
    plant: Plant,
    wanted: Array,
    hand: float,
    limits: Array,
    active: NDArray[np.int64],
    links: Array,
    trace: Trace,
    path: Array,
    given: Array,
    longest: float,
    held: float,
) -> int:
    """Let the motors give torques for some ticks, or until the trial is over; return how many.

    Args:
        plant: The plant.
        wanted: Torques of the joints [N m], shape (n,); in each tick those are given that the
            drives can give at the speed of the joints.
        hand: Closing angle commanded [rad].
        limits: ``Limits.packed`` of all N joints of the arm.
        active: Which of them are driven, shape (n,).
        links: Scratch, zeros for those that are not, shape (3, N).
        trace: The trace, of which a row is written each tick.
        path: As of :func:`mitt.lab.world.motion.move_motors`.
        given: Torques that were given [N m], one row a tick, shape (ticks, 4, n); the last of each
            four is written.
        longest: Time at which a trial without contact ends [s].
        held: How long a trial goes on after the first contact [s].
    """
    n = len(wanted)
    for k in range(len(given)):
        for i in range(n):
            links[0, active[i]], links[1, active[i]] = wanted[i], plant.qvel[i]
        saturate(limits, links[0], links[1], links[2])
        for i in range(n):
            given[k, 3, i] = links[2, active[i]]
        note_stop(plant.state, False, False)
        move_motors(plant, given[k, 3], hand, trace, path)
        if over(plant.state, longest, held):
            return k + 1
    return len(given)
