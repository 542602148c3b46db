"""World and catcher in one compiled loop, until the catcher has to think.

It composes the kernels of ``World.sense``, ``Catcher.step`` and ``World.apply``. The one other loop
is plain Python, ``TrialRunner.step``; tests demand the same bytes of both. This one stands beside
it for its speed: on one core it makes two to three times as many throws a second with images, most
of it because only those parts of an image are drawn that the catcher looks at. Faults of sensors
and commands, turning heads, frames rarer than ticks, and generators that are no map need the
Python loop.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mitt.clock import Stopwatch, now_ns
from mitt.core.ball.filter import update
from mitt.core.catcher.catcher import Catcher
from mitt.core.catcher.planner import undecided
from mitt.core.catcher.settings import BRAKE, STOPPED
from mitt.core.catcher.state import (
    Result,
    ResultHandle,
    StateHandle,
    result_handle,
    room_for,
    store,
    ticks_between,
)
from mitt.core.catcher.tick import looks, tick
from mitt.core.errors import ShapeError
from mitt.core.eyes.background import whole_image
from mitt.core.eyes.camera import CAMERA
from mitt.core.eyes.head import HEAD
from mitt.core.eyes.held import window_about
from mitt.core.eyes.segmentation import WORK, region_of_interest, suffices
from mitt.core.kernels import Record, big_kernel, copy, kernel
from mitt.core.signals import TICK, Array, Image
from mitt.lab.world.capsules import Body, lay_capsules
from mitt.lab.world.engine import Plant
from mitt.lab.world.imaging import BLOCK
from mitt.lab.world.motion import WATCHED, move_motors, note_stop, over
from mitt.lab.world.outline import scratch_for
from mitt.lab.world.painting import Exposure, Film, Optics, PaintedBalls, render_images
from mitt.lab.world.sensors import SimulatedEncoders, read_encoders
from mitt.lab.world.simulation import Stage
from mitt.lab.world.truth import Trace


class Points(NamedTuple):
    """Noisy positions in place of images, all [m].

    Attributes:
        noise: Errors of the points of a block, shape (BLOCK, 3); (0, 3) where there are images.
        covariance: Their covariance, shape (3, 3).
        line: Points that are on their way, shape (latency + 1, 3).
    """

    noise: Array
    covariance: Array
    line: Array


class Shots(NamedTuple):
    """What was exposed and is on its way, a row a tick.

    Attributes:
        rows: Arm and hand, then the ball and its velocity, shape (latency + 1, c + 2, 8).
        starts: Offsets into the bank of noise, shape (latency + 1, 2).
        images: Room for the two images of one tick, shape (2, height, width).
    """

    rows: Array
    starts: NDArray[np.int64]
    images: NDArray[np.uint8]


class LookAhead(NamedTuple):
    """Scratch to find out where the eyes are going to look.

    Attributes:
        windows: Rows and columns, first and last, shape (2, 4).
        known: Whether they are less than the images, shape (2,).
        work: Of :func:`mitt.core.eyes.segmentation.suffices`, shape (1,).
        hand: Where the hand is expected [m], shape (3,).
    """

    windows: NDArray[np.int64]
    known: NDArray[np.bool_]
    work: Record
    hand: Array


class PlayedSight(NamedTuple):
    """What the catcher is given to see, and where that comes from.

    Attributes:
        body: Arm and hand.
        film: Cameras.
        starts: Where their noise begins, a row a frame of a block.
        shots: Exposures that are on their way.
        points: Positions in place of images.
        radius: Radius of the ball [m].
        offset: What is added to stamps [s].
        encoders: The encoders.
        nothing: Images where none has arrived yet.
        backgrounds: As of ``Catcher.backgrounds``.
        ahead: Scratch.
    """

    body: Body
    film: Film
    starts: NDArray[np.int64]
    shots: Shots
    points: Points
    radius: float
    offset: float
    encoders: SimulatedEncoders
    nothing: tuple[Image, Image]
    backgrounds: tuple[Image, ...]
    ahead: LookAhead


class KeptTicks(NamedTuple):
    """What is kept of the ticks.

    Attributes:
        trace: The trace.
        results: Result of each tick, at its number.
        times: How long the catcher took in each tick [ns], and two numbers of scratch.
    """

    trace: Trace
    results: ResultHandle
    times: NDArray[np.int64]


#: Cameras where there are none, and where their noise begins.
_DARK = Film(
    0.0,
    np.zeros(0, HEAD),
    np.zeros((0, 4)),
    np.zeros((0, 2), CAMERA),
    PaintedBalls(np.zeros(1), np.zeros(1), *(np.zeros((1, 3)) for _ in range(5))),
    Optics(*(0.0,) * 13),
    np.zeros((0, 0), np.uint8),
    np.zeros(0, np.float32),
    scratch_for(0),
    np.zeros(0, np.float32),
    np.zeros((0, 4), np.int64),
    0.0,
)
_NO_STARTS = np.zeros((BLOCK, 0), np.int64)
MARGIN = 2.0
"""What the hand may be off where it was expected a tick before [px]."""
NOTHING = np.empty((0, 0), np.uint8), np.empty((0, 0), np.uint8)
"""Images of no camera."""


@kernel
def render(sight: PlayedSight, k: int, state: StateHandle, held: bool) -> None:
    """Draw of the images exposed in tick ``k`` what the eyes are going to look at.

    That is where they find the ball again; where they do not, and so look everywhere, all. A ball
    that the braking hand holds is looked for about the hand, if the tick before has done so
    (``held``).
    """
    shots, ahead, film = sight.shots, sight.ahead, sight.film
    shot, starts = shots.rows[k % len(shots.rows)], shots.starts[k % len(shots.rows)]
    images, windows, known = (shots.images[0], shots.images[1]), ahead.windows, ahead.known
    eyes, count = state.eyes, len(shot) - 2
    r_o, dr_o, capsules = shot[count, :3], shot[count + 1, :3], shot[:count]
    exposure = Exposure(k * TICK, sight.radius, r_o, dr_o, capsules)
    if state.scalars[0].phase == BRAKE:
        hand = ahead.hand
        for i in range(3):
            hand[i] = state.hand[2, i] + TICK * state.hand[1, i]
        for n in range(2):
            if (
                not held
                or window_about(
                    eyes.cameras[n], hand, eyes.ball[0].radius, MARGIN, images[n].shape, windows[n]
                )
                == 0.0
            ):
                whole_image(images[n], windows[n])
        render_images(images, film, starts, exposure, windows)
        return
    for whole in (False, True):
        missed = False
        for n in range(2):
            whole_image(images[n], windows[n])
            known[n] = not whole and region_of_interest(
                eyes.targets[n], eyes.segmenter[0], windows[n]
            )
        render_images(images, film, starts, exposure, windows)
        for n in range(2):
            missed |= known[n] and not suffices(
                images[n],
                sight.backgrounds[n],
                sight.backgrounds[2],
                windows[n],
                eyes.targets[n],
                eyes.segmenter[0],
                ahead.work[0],
            )
        if not missed:
            return


@big_kernel
def capture(plant: Plant, sight: PlayedSight, state: StateHandle, k: int, held: bool) -> None:
    """Keep what is in view in tick ``k``, and draw the images that arrive in it."""
    shots, points = sight.shots, sight.points
    ball, latency = len(plant.ctrl), len(points.line) - 1
    r_o, dr_o = plant.qpos[ball : ball + 3], plant.qvel[ball : ball + 3]
    if len(points.noise) > 0:
        for i in range(3):
            points.line[k % len(points.line), i] = r_o[i] + points.noise[k % BLOCK, i]
        return
    body, row = sight.body, k % len(shots.rows)
    shot = shots.rows[row]
    lay_capsules(body, shot[: len(shot) - 2])
    for i in range(3):
        shot[len(shot) - 2, i], shot[len(shot) - 1, i] = r_o[i], dr_o[i]
    copy(sight.starts[k % BLOCK], shots.starts[row])
    if k >= latency:
        render(sight, k - latency, state, held)


@kernel
def play(
    plant: Plant,
    sight: PlayedSight,
    catcher: tuple[Array, StateHandle, ResultHandle],
    kept: KeptTicks,
    until: tuple[float, float],
    count: int,
    path: Array,
) -> int:
    """Make up to ``count`` ticks, until there is something to think about or the trial is over.

    Args:
        plant: As of ``Stage``.
        sight: What the catcher sees.
        catcher: As of ``Catcher.parts``.
        kept: What is kept of the ticks.
        until: Two numbers of :func:`mitt.lab.world.motion.over`.
        count: Most ticks to be made.
        path: As of :func:`mitt.lab.world.motion.move_motors`.

    Returns:
        What is to be thought about: bits of :mod:`mitt.core.catcher.tick`.
    """
    brake, state, result = catcher
    s, out, p, n = state.scalars[0], result.scalars[0], plant.state[0], len(plant.slides)
    line, encoders, clock = sight.points.line, sight.encoders, kept.times[len(kept.times) - 2 :]
    latency, with_points = len(line) - 1, len(sight.points.noise) > 0
    for _ in range(count):
        k, images, exposed = p.ticks, sight.nothing, 0.0
        looking, held = looks(state, result), s.phase == BRAKE
        if looking:
            capture(plant, sight, state, k, out.phase == BRAKE)
        arrived, stamp = looking and k >= latency, (k - latency) * TICK + sight.offset
        if arrived and not with_points:
            images, exposed = (sight.shots.images[0], sight.shots.images[1]), stamp
        read_encoders(encoders, k * TICK, plant.qpos[:n], plant.qvel[:n])
        before = now_ns(clock)
        if arrived and with_points and not held:
            update(
                state.ball_filter, stamp, line[(k - latency) % len(line)], sight.points.covariance
            )
        seen, read = (
            (images, sight.backgrounds, 0, exposed),
            (k * TICK, k * TICK, encoders.q, encoders.dq),
        )
        todo = tick(seen, read, brake, state, result)
        kept.times[k] = now_ns(clock) - before
        if arrived and with_points:
            out.sighted, out.t_sighted = True, stamp
            copy(line[(k - latency) % len(line)], result.sighting[0])
            copy(sight.points.covariance, result.sighting[1:])
        note_stop(plant.state, out.brakes, s.phase == STOPPED)
        move_motors(plant, result.command[3], out.hand, kept.trace, path)
        store(result, kept.results, k)
        todo = 0 if undecided(todo, state, result) else todo
        if todo != 0 or over(plant.state, until[0], until[1]):
            return int(todo)
    return 0


def sight_of(stage: Stage, catcher: Catcher, offset: float = 0.0) -> PlayedSight:
    """Return what a catcher is given to see in a world at the release; ``offset`` as of a stamp."""
    imager, sensing = stage.imager, stage.scene.sensing
    latency = sensing.latency if imager is None else sensing.image_latency
    film, starts = (_DARK, _NO_STARTS) if imager is None else imager.film
    shots = Shots(
        np.zeros((latency + 1, len(stage.body.capsules) + 2, 8)),
        np.zeros((latency + 1, 2), np.int64),
        np.empty((2, *((0, 0) if imager is None else imager.shape)), np.uint8),
    )
    ahead = LookAhead(
        np.zeros((2, 4), np.int64), np.zeros(2, np.bool_), np.zeros(1, WORK), np.zeros(3)
    )
    points = Points(np.zeros((0, 3)), stage.sensors.covariance, np.zeros((latency + 1, 3)))
    return PlayedSight(
        stage.body,
        film,
        starts,
        shots,
        points,
        stage.radius,
        offset,
        stage.sensors.encoders,
        NOTHING,
        catcher.backgrounds,
        ahead,
    )


def play_out(
    stage: Stage,
    catcher: Catcher,
    stopwatch: Stopwatch,
    *,
    longest: float,
    held: float,
    offset: float = 0.0,
) -> Result:
    """Play a trial from its first tick to its end and return the results of all ticks.

    Args:
        stage: The world at the release.
        catcher: A catcher whose ``parts`` are there.
        stopwatch: Gets how long the catcher took in each tick.
        longest: As of :func:`mitt.lab.world.motion.over` [s].
        held: The same.
        offset: What is added to the stamps of what is seen [s].

    Raises:
        ShapeError: The catcher's arm has another number of joints than the stage's.
    """
    n, own = len(stage.plant.slides), catcher.result.command.shape[1]
    if own != n:
        raise ShapeError("catcher", f"an arm of {n} joints", (own,))
    imager, p, most = stage.imager, stage.plant.state, round((longest + held + WATCHED) / TICK) + 2
    log, sight = room_for(catcher.result, most), sight_of(stage, catcher, offset)
    trace, times = stage.trace_buffer.reserve(most + 1), np.zeros(most + 2, np.int64)
    kept = KeptTicks(trace, result_handle(log), times)
    while (parts := catcher.parts) is not None and not over(p, longest, held):
        k = int(p["ticks"][0])
        if imager is not None:
            film, starts = imager.film
            sight = sight._replace(film=film, starts=starts, backgrounds=catcher.backgrounds)
        elif k % BLOCK == 0 and catcher.looking:
            noise = stage.sensors.noise(BLOCK)
            sight = sight._replace(points=sight.points._replace(noise=noise))
        count = BLOCK - k % BLOCK
        path = stage.rows(k + count + 1)
        todo = play(stage.plant, sight, parts, kept, (longest, held), count, path)
        if imager is not None and catcher.looking:
            imager.advance(int(p["ticks"][0]) - k)
        catcher.ticked(todo, float(log.scalars["t"][k]))
        catcher.think()
    ticks = int(p["ticks"][0])
    stopwatch.add(times[:ticks])
    return ticks_between(log, 0, ticks)
