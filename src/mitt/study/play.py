"""World and catcher in one compiled loop, from one moment of thought to the next.

The kernels are those of ``World.sense``, ``Catcher.step`` and ``World.apply``, composed; tests hold
both ways together byte for byte. Where one of the three needs Python (faults, led balls, turning
heads, generators that are no map) the trial takes the way through them.
"""

from typing import final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mitt.catcher import Catcher
from mitt.errors import InputError
from mitt.link.clock import Stopwatch, now_ns
from mitt.records import BRAKE, STOPPED, Record
from mitt.signals import Array, Image
from mitt.tick import tick, undecided
from mitt.world.exposure import Bank, Cameras, snap
from mitt.world.imaging import BLOCK
from mitt.world.motion import TICK, TICKS, move, over
from mitt.world.silhouettes import lay_capsules
from mitt.world.stage import Body, Plant, Stage

#: Ticks that a log holds: more than any trial has.
_MOST = 4096


@njit(cache=True)
def play(
    plant: Plant,
    rows: Array,
    body: Body,
    camera: Cameras,
    bank: Bank,
    starts: NDArray[np.int64],
    scalars: tuple[float, float, float, float],
    film: NDArray[np.uint8],
    nothing: tuple[Image, Image],
    catcher: tuple[Array, Record, Record],
    log: Record,
    times: NDArray[np.int64],
    count: int,
) -> int:
    """Make ticks until there is something to think about, or the trial is over.

    Args:
        plant: As of ``Stage``.
        rows: The trace.
        body: As of ``Stage``.
        camera: As of :func:`mitt.world.exposure.snap`.
        bank: As of :func:`mitt.world.exposure.snap`.
        starts: Offsets of a block of frames into the banks, shape (BLOCK, 2, 2).
        scalars: Half the exposure [s], radius of the ball [m], and two of
            :func:`mitt.world.motion.over`.
        film: Images that are on their way, shape (latency + 1, 2, height, width).
        nothing: Images where none has arrived yet.
        catcher: As of ``Catcher.parts``.
        log: Result of each tick, at its number.
        times: How long the catcher took in each tick [ns], and two numbers of scratch.
        count: Most ticks to be made.

    Returns:
        What is to be thought about: bits of :mod:`mitt.tick`.
    """
    views, kinds, touching, p = plant
    brake, state, result = catcher
    s, out = state[0], result[0]
    qpos, qvel, n, ball = views[4], views[5], len(views[12]), len(views[6])
    latency, clock = len(film) - 1, times[len(times) - 2 :]
    for _ in range(count):
        k, images, exposed = int(p[TICKS]), nothing, 0.0
        if s["phase"] != BRAKE and s["phase"] != STOPPED:
            new, old = film[k % len(film)], film[(k - latency) % len(film)]
            lay_capsules(body[0], body[1], body[2], body[3], body[4])
            snap(
                (new[0], new[1]), camera, bank, starts[k % BLOCK], scalars[0], scalars[1],
                qpos[ball : ball + 3], qvel[ball : ball + 3], body[4],
            )  # fmt: skip
            if k >= latency:
                images, exposed = (old[0], old[1]), (k - latency) * TICK
        before = now_ns(clock)
        todo = tick(
            images, (True, True), exposed, k * TICK, qpos[:n], qvel[:n], brake, state, result
        )
        times[k] = now_ns(clock) - before
        move(views, kinds, touching, p, out["told"][3], out["hand"], rows)
        log[k] = result[0]
        if undecided(todo, state, result):
            todo = 0
        if todo != 0 or over(p, scalars[2], scalars[3]):
            return int(todo)
    return 0


@final
class Player:
    """Plays trials on stages; its buffers are used again for each.

    Attributes:
        stopwatch: Is told how long the catcher took in each tick.
    """

    def __init__(self, stopwatch: Stopwatch, *, longest: float, held: float) -> None:
        """Set the rules of :func:`mitt.world.motion.over`.

        Raises:
            InputError: A trial could last longer than the buffers do.
        """
        if not (longest + held) / TICK + 1 < _MOST:
            raise InputError("trial", f"at most {_MOST} ticks", (longest + held) / TICK)
        self.stopwatch, self._rules = stopwatch, (longest, held)
        self._times = np.zeros(_MOST + 2, dtype=np.int64)
        self._log: Record | None = None
        self._nothing = np.empty((0, 0), np.uint8), np.empty((0, 0), np.uint8)

    def run(self, stage: Stage, catcher: Catcher) -> Record:
        """Play a trial from its first tick to its end and return the results of all ticks.

        They are overwritten by the next trial.
        """
        imager, p = stage.imager, stage.plant[3]
        film = np.empty((stage.scene.sensing.latency + 1, 2, *imager.shape), np.uint8)
        scalars = imager.half, stage.scene.ball.radius, *self._rules
        rows, log = stage.tape.reserve(_MOST + 1), self._log_for(catcher.result)
        while (parts := catcher.parts) is not None and not over(p, *self._rules):
            k = int(p[TICKS])
            left = BLOCK - k % BLOCK
            todo = play(
                stage.plant, rows, stage.body, *imager.film, scalars, film, self._nothing, parts,
                log, self._times, left,
            )  # fmt: skip
            made = int(p[TICKS]) - k
            if catcher.looking:
                imager.expose(made)
            catcher.ticked(todo, float(log["t"][k]))
            catcher.think()
        ticks = int(p[TICKS])
        self.stopwatch.add(self._times[:ticks])
        return log[:ticks]

    def _log_for(self, result: Record) -> Record:
        """Return the table for results like this one."""
        if self._log is None or self._log.dtype is not result.dtype:
            self._log = np.zeros(_MOST, result.dtype)
        return self._log
