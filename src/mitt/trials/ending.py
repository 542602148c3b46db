"""The end of a trial in one compiled loop: the catcher no longer looks, so no sense disturbs it.

The kernels are those of ``Catcher.step`` and ``World.apply``, composed as in
:mod:`mitt.trials.play`; here for every generator, none of which is asked any more, and for all
faults but those of encoders, clock and motors.
"""

import numpy as np
from numpy.typing import NDArray

from mitt.catcher import Catcher
from mitt.jit import kernel
from mitt.link.clock import Stopwatch, now_ns
from mitt.records import STOPPED, Record
from mitt.signals import Array, Image
from mitt.tick import act, perceive
from mitt.trials.play import NOTHING
from mitt.views import lent
from mitt.world.engine import Plant
from mitt.world.motion import STATE, TICK, TICKS, move, over, tell
from mitt.world.sensors import DQ, Q, read_encoders
from mitt.world.truth import Tape


@kernel
def _play(
    plant: Plant,
    rows: Array,
    rules: tuple[float, float],
    nothing: tuple[Image, Image],
    encoders: Array,
    catcher: tuple[Array, Record, Record],
    log: Record,
    times: NDArray[np.int64],
) -> tuple[int, int]:
    """Make ticks until the trial is over, there is something to think about, or the log is full.

    Args:
        plant: As in the text of :mod:`mitt.world.motion`.
        rows: The trace.
        rules: Two numbers of :func:`mitt.world.motion.over`.
        nothing: What the cameras show.
        encoders: As of :func:`mitt.world.sensors.fresh_encoders`.
        catcher: As of ``Catcher.ending``.
        log: Results of the ticks.
        times: How long the catcher took in each [ns], and two numbers of scratch.

    Returns:
        How many ticks were made, and what is to be thought about: bits of :mod:`mitt.tick`.
    """
    plant, rows, nothing, encoders = lent((plant, rows, nothing, encoders))
    (brake, state, result), log, times = lent(catcher), lent(log), lent(times)
    s, out, p, qpos, qvel, n = state[0], result[0], plant[STATE], plant[4], plant[5], len(plant[12])
    clock = times[len(times) - 2 :]
    for k in range(len(log)):
        t = int(p[TICKS]) * TICK
        read_encoders(encoders, t, qpos[:n], qvel[:n])
        before = now_ns(clock)
        perceive(nothing, nothing, 0, 0.0, t, encoders[Q], encoders[DQ], state, result)
        todo = act(brake, state, result)
        times[k] = now_ns(clock) - before
        tell(p, out["brakes"], s["phase"] == STOPPED)
        move(plant, out["told"][3], out["hand"], rows)
        log[k] = result[0]
        if todo != 0 or over(p, rules[0], rules[1]):
            return k + 1, int(todo)
    return len(log), 0


def play_out(
    world: tuple[Plant, Tape, Array],
    catcher: Catcher,
    stopwatch: Stopwatch,
    *,
    rules: tuple[float, float],
    most: int = 1024,
) -> Record:
    """Play on until the trial is over or the catcher has thought; return the ticks' results.

    Args:
        world: As of ``World.ending``.
        catcher: One that does not look.
        stopwatch: Is told how long the catcher took in each tick.
        rules: Two numbers of :func:`mitt.world.motion.over`.
        most: Most ticks to be made.
    """
    (plant, tape, encoders), parts = world, catcher.ending
    ticks = int(plant[STATE][TICKS])
    log, times = np.zeros(most, parts[2].dtype), np.zeros(most + 2, np.int64)
    rows = tape.reserve(ticks + most + 1)
    made, todo = _play(plant, rows, rules, NOTHING, encoders, parts, log, times)
    stopwatch.add(times[:made])
    catcher.ticked(todo, ticks * TICK)
    catcher.think()
    return log[:made]
