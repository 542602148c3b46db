"""World and catcher in one compiled loop, until the catcher has to think.

It composes the kernels of ``World.sense``, ``Catcher.step`` and ``World.apply``. The one other loop
is plain Python, ``TrialRunner.step``; tests demand the same bytes of both. This one stands beside
it for its speed: on one core 12 throws a second with images instead of 4, and 18 with points
instead of 13, most of it because only those parts of an image are drawn that the catcher looks at.
Faults, prescribed flights, turning heads and generators that are no map need the Python loop.
"""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from mitt.ball.estimator import update
from mitt.catcher.catcher import Catcher
from mitt.catcher.result import Result, ResultHandle, keep, result_handle, room_for, rows_of
from mitt.catcher.settings import BRAKE, STOPPED
from mitt.catcher.state import StateHandle
from mitt.catcher.tick import tick, undecided
from mitt.errors import ShapeError
from mitt.jit import kernel
from mitt.link.clock import Stopwatch, now_ns
from mitt.signals import TICK, Array, Image
from mitt.vision.segmentation import suffices
from mitt.vision.target import WORK, region_of_interest
from mitt.world.capsules import lay_capsules
from mitt.world.engine import Plant
from mitt.world.exposure import Bank, Cameras, snap
from mitt.world.imaging import BLOCK, Film
from mitt.world.motion import TICKS, WATCHED, move, over, tell
from mitt.world.painting import LIGHT
from mitt.world.sensors import DQ, Q, read_encoders
from mitt.world.stage import Body, Stage

Points: TypeAlias = tuple[Array, Array, Array]
"""How far off the points of a block are, shape (BLOCK, 3), or (0, 3) where there are images; their
covariance, shape (3, 3); those that are on their way, shape (latency + 1, 3); all [m]."""

Shots: TypeAlias = tuple[Array, NDArray[np.int64], NDArray[np.uint8]]
"""What was exposed and is on its way: arm and hand, then the ball and its velocity, a row a tick,
shape (latency + 1, c + 2, 8); offsets into the banks of noise, shape (latency + 1, 2, 2); room for
the two images of one tick, shape (2, height, width)."""

Eyes: TypeAlias = tuple[NDArray[np.int64], NDArray[np.bool_], NDArray[np.int64], Array]
"""Scratch to look ahead where the eyes look: windows, shape (2, 4), whether they are less than the
images, shape (2,), and that of :func:`mitt.vision.segmentation.suffices`."""

Sight: TypeAlias = tuple[Body, Film, Shots, Points]
"""Arm and hand, cameras, exposures, points."""

#: Cameras where there are none, and what arrives from them.
_DARK: Film = (
    (
        np.zeros((0, 1)), np.zeros((0, 4)), np.zeros((0, 2, 5, 3)), np.zeros((0, 2)),
        np.zeros((1, 14)), np.zeros(LIGHT), np.zeros(0), np.zeros(0, np.float32),
    ),
    (np.zeros((0, 0), np.uint8), np.zeros(0, np.uint8), np.zeros(0)),
    np.zeros((BLOCK, 0, 2), np.int64),
)  # fmt: skip
NOTHING = np.empty((0, 0), np.uint8), np.empty((0, 0), np.uint8)
"""Images of no camera."""


@kernel
def develop(
    shot: Array, starts: NDArray[np.int64], images: tuple[Image, Image], camera: Cameras,
    bank: Bank, half: float, radius: float, t: float, backgrounds: tuple[Image, ...],
    state: StateHandle, eyes: Eyes,
) -> None:  # fmt: skip
    """Draw of the images of an exposure what the eyes are going to look at.

    That is where they find the ball again; where they do not, and so look everywhere, all.

    Args:
        shot: Of ``Shots``, shape (c + 2, 8).
        starts: Of ``Shots``, shape (2, 2).
        images: Result.
        camera: As of ``Film``.
        bank: As of ``Film``.
        half: Half the exposure [s].
        radius: Of the ball [m].
        t: Middle of the exposure [s].
        backgrounds: As of ``Catcher.backgrounds``.
        state: As of ``Catcher.parts``.
        eyes: Scratch.
    """
    windows, known, work, weights = eyes
    memory, settings, count = state.eyes_memory, state.eyes_settings, len(shot) - 2
    r_o, dr_o = shot[count, :3], shot[count + 1, :3]
    for whole in (False, True):
        missed = False
        for n in range(2):
            windows[n, 0], windows[n, 1] = 0, images[n].shape[0] - 1
            windows[n, 2], windows[n, 3] = 0, images[n].shape[1] - 1
            known[n] = not whole and region_of_interest(memory[n], settings, windows[n])
        snap(images, camera, bank, starts, half, radius, r_o, dr_o, shot[:count], windows, t)
        for n in range(2):
            missed |= known[n] and not suffices(
                images[n], backgrounds[n], backgrounds[2], windows[n], memory[n], settings, work,
                weights,
            )  # fmt: skip
        if not missed:
            return


@kernel
def play(
    plant: Plant,
    rows: Array,
    sight: Sight,
    scalars: tuple[float, float, float, float],
    nothing: tuple[Image, Image],
    backgrounds: tuple[Image, ...],
    encoders: Array,
    catcher: tuple[Array, StateHandle, ResultHandle],
    eyes: Eyes,
    log: ResultHandle,
    times: NDArray[np.int64],
    count: int,
) -> int:
    """Make ticks until there is something to think about, or the trial is over.

    Args:
        plant: As of ``Stage``.
        rows: The trace.
        sight: As above.
        scalars: Half the exposure [s], radius of the ball [m], and two of
            :func:`mitt.world.motion.over`.
        nothing: Images where none has arrived yet.
        backgrounds: As of ``Catcher.backgrounds``.
        encoders: As of :func:`mitt.world.sensors.fresh_encoders`.
        catcher: As of ``Catcher.parts``.
        eyes: Scratch.
        log: Result of each tick, at its number.
        times: How long the catcher took in each tick [ns], and two numbers of scratch.
        count: Most ticks to be made.

    Returns:
        What is to be thought about: bits of :mod:`mitt.catcher.tick`.
    """
    body, (camera, bank, starts), (shots, begun, pixels), (scatter, covariance, line) = sight
    brake, state, result = catcher
    s, out = state.scalars[0], result.scalars[0]
    p, qpos, qvel = plant.state, plant.qpos, plant.qvel
    n, ball = len(plant.slides), len(plant.ctrl)
    r_o, dr_o = qpos[ball : ball + 3], qvel[ball : ball + 3]
    latency, clock = len(line) - 1, times[len(times) - 2 :]
    for _ in range(count):
        k, images, exposed, pointed = int(p[TICKS]), nothing, 0.0, False
        if s.phase != BRAKE and s.phase != STOPPED:
            pointed = len(scatter) > 0 and k >= latency
            if len(scatter) > 0:
                for i in range(3):
                    line[k % len(line), i] = r_o[i] + scatter[k % BLOCK, i]
            else:
                row = k % len(shots)
                shot, place = shots[row], (k - latency) % len(shots)
                lay_capsules(body[0], body[1], body[2], body[3], shot[: len(shot) - 2])
                for i in range(3):
                    shot[len(shot) - 2, i], shot[len(shot) - 1, i] = r_o[i], dr_o[i]
                begun[row] = starts[k % BLOCK]
                if k >= latency:
                    images, exposed = (pixels[0], pixels[1]), (k - latency) * TICK
                    develop(
                        shots[place], begun[place], images, camera, bank, scalars[0], scalars[1],
                        exposed, backgrounds, state, eyes,
                    )  # fmt: skip
        read_encoders(encoders, k * TICK, qpos[:n], qvel[:n])
        before = now_ns(clock)
        if pointed:
            seen = line[(k - latency) % len(line)]
            update(
                state.ball_memory, (k - latency) * TICK, seen, covariance, state.ball_settings,
                state.ball_work,
            )  # fmt: skip
        todo = tick(
            images, backgrounds, 0, exposed, k * TICK, encoders[Q], encoders[DQ], brake, state,
            result,
        )  # fmt: skip
        times[k] = now_ns(clock) - before
        tell(p, out.brakes, s.phase == STOPPED)
        move(plant, result.command[3], out.hand, rows)
        keep(result, log, k)
        if undecided(todo, state, result):
            todo = 0
        if todo != 0 or over(p, scalars[2], scalars[3]):
            return int(todo)
    return 0


def play_out(
    stage: Stage, catcher: Catcher, stopwatch: Stopwatch, *, longest: float, held: float
) -> Result:
    """Play a trial from its first tick to its end and return the results of all ticks.

    Args:
        stage: The world at the release.
        catcher: A catcher whose ``parts`` are there.
        stopwatch: Is told how long the catcher took in each tick.
        longest: As of :func:`mitt.world.motion.over` [s].
        held: As of :func:`mitt.world.motion.over` [s].

    Raises:
        ShapeError: The catcher's arm has another number of joints than the stage's.
    """
    n, own = len(stage.plant.slides), catcher.result.command.shape[1]
    if own != n:
        raise ShapeError("catcher", f"an arm of {n} joints", (own,))
    imager, p, most = stage.imager, stage.plant.state, round((longest + held + WATCHED) / TICK) + 2
    latency, shape = stage.scene.sensing.latency, (0, 0) if imager is None else imager.shape
    shots = (
        np.zeros((latency + 1, len(stage.body[4]) + 2, 8)),
        np.zeros((latency + 1, 2, 2), np.int64),
        np.empty((2, *shape), np.uint8),
    )
    eyes = (
        np.zeros((2, 4), np.int64), np.zeros(2, np.bool_), np.zeros((WORK, 4), np.int64),
        np.zeros(7),
    )  # fmt: skip
    line, covariance = np.zeros((latency + 1, 3)), stage.sensors.covariance
    scatter, cameras = np.zeros((0, 3)), _DARK
    scalars = 0.0 if imager is None else imager.half, stage.radius, longest, held
    rows, log = stage.tape.reserve(most + 1), room_for(catcher.result, most)
    times, kept = np.zeros(most + 2, np.int64), result_handle(log)
    while (parts := catcher.parts) is not None and not over(p, longest, held):
        k = int(p[TICKS])
        if imager is not None:
            cameras = imager.film
        elif k % BLOCK == 0 and catcher.looking:
            scatter = stage.sensors.scatter(BLOCK)
        sight = stage.body, cameras, shots, (scatter, covariance, line)
        todo = play(
            stage.plant, rows, sight, scalars, NOTHING, catcher.backgrounds,
            stage.sensors.encoders, parts, eyes, kept, times, BLOCK - k % BLOCK,
        )  # fmt: skip
        if imager is not None and catcher.looking:
            imager.expose(int(p[TICKS]) - k)
        catcher.ticked(todo, float(log.scalars["t"][k]))
        catcher.think()
    ticks = int(p[TICKS])
    stopwatch.add(times[:ticks])
    return rows_of(log, 0, ticks)
