"""Localization: the ball in the images of all cameras, then in the world, in one compiled call."""

from math import pi, sqrt

from mitt.jit import kernel
from mitt.signals import Array, Image
from mitt.views import view
from mitt.vision import target, triangulation
from mitt.vision.blobs import Box
from mitt.vision.camera import project_ball
from mitt.vision.candidates import choose
from mitt.vision.segmentation import detect
from mitt.vision.target import (
    AT_U,
    AT_V,
    EXPECTED,
    GAIN,
    GOOD,
    LOST,
    MERGED,
    NEAR,
    STATE,
    WEIGHED,
    WEIGHTS,
)
from mitt.vision.triangulation import note, on_ray, triangulate

KNOWN, SINCE, ODDS, STATUS, SPEED = range(3, 8)
AGE, ALONE, GUIDED, MISSED = 10, 11, 12, 13
"""Places in the rig's row of the memory, after the position: sightings that it rests on, frames
since both cameras saw the ball, frames at odds in a row, status, motion a frame, frames since the
position was corrected, whether one camera counts while something hides the ball from the other,
how far from there the ball may be if the position is that of :func:`guide` [m], else 0, frames
since the last sighting that should have shown the ball and did not."""
BLIND, ONE, BOTH, AT_ODDS = range(4)

LACKING = -2.0
"""Instead of a centroid's standard deviation: the target is not as heavy as the ball should be."""

ALONG = 1.0
"""Standard deviation along the ray of a ball that one camera alone sees [m]: a thousand times what
is known of it, and few enough digits away from what is seen across."""
FORGET, HASTY, STUBBORN = 100.0, 5.0, 20.0
"""Frames without both cameras after which a position is old, and no more than so many for each
sighting that it rests on, as its motion is then a guess; frames at odds that are no accident."""
SURE, MISFIT, SMALL, DRIFT, SLOWLY = 0.002, 0.01, 0.05, 0.0005, 20.0
"""Share of the ball's mass by which a target differs by noise; by which it may differ; what
patches of the background add to that, over the radius [px]; what each frame without both cameras
adds; frames over which the contrast may change."""
LARGE = 2.0
"""Mass over the one that the ball should have above which a target is something else."""
GUIDES = 30.0
"""Frames without a sighting after which the flight no longer says where the ball is: it may have
bounced where nothing saw it. While it is above an image they do not count: there is nothing to
bounce off, and it comes back."""
REACH, ASTRAY, GUIDED_REACH = 0.12, 0.01, 0.06
"""Distance from where it should be within which a lost ball is searched, and what each frame
without both cameras adds [m]: it may change its speed by 10 m/s. Where its flight says where it
should be, it is nowhere else (two standard deviations are added), and each frame without any
sighting counts."""
GUIDED_SIGMA = 0.06
"""Standard deviation of the flight's position below which it guides the search [m]."""
ALPHA, BETA, RESTART = 0.5, 0.1, 20.0
"""Gains of position and motion from frame to frame; frames after which motion is estimated anew."""


@kernel
def _is_whole(memory: Array, since: float, point: Array) -> bool:
    """Return whether a target is the whole ball and nothing else, by its mass.

    The mass over the area that the ball should have is its contrast, which changes slowly; a
    ball that is hidden in part has less, long before its shape gives it away. A rim that hides a
    share s of the disc moves the centroid by up to s radii: its error widens by that. A contrast
    that rests on few frames is soon forgotten: they may have been odd. ``since`` counts the frames
    since both cameras saw the ball.
    """
    if memory[EXPECTED] == 0.0 or since >= HASTY * memory[WEIGHED]:
        memory[WEIGHED] = 0.0
        return True
    lacking = abs(memory[WEIGHTS] / (memory[GAIN] * memory[EXPECTED]) - 1.0)
    radius = sqrt(memory[EXPECTED] / pi)
    off = max(lacking - SURE - 0.5 * SMALL / radius, 0.0) * radius
    point[2] = sqrt(point[2] * point[2] + off * off)
    return bool(lacking < MISFIT + SMALL / radius + DRIFT * since)


@kernel
def _learn(memory: Array, camera: Array, point: Array, radius: float, known: float, r: Array,
           uv: Array) -> None:  # fmt: skip
    """Update the ball's contrast, and by how much a camera differs from where all see the ball.

    A calibration leaves such an offset, ten times the noise of a frame. Without it a camera that
    goes on alone would see the ball jump, which the filter would take for a kick. ``known``
    sightings were made, this one included; ``r`` is where all cameras see the ball [m].
    """
    if memory[EXPECTED] > 0.0:
        memory[WEIGHED] = min(memory[WEIGHED] + 1.0, SLOWLY)
        gain = memory[WEIGHTS] / memory[EXPECTED]
        memory[GAIN] += (gain - memory[GAIN]) / memory[WEIGHED]
    if project_ball(camera, r, radius, uv):
        for k in range(2):
            offset = memory[target.OFF_U + k]
            memory[target.OFF_U + k] += 1.0 / max(known, 1.0) * (point[k] - uv[k] - offset)


@kernel
def _predict(rig: Array) -> None:
    """Move the last position on by one frame; forget it where it is old."""
    rig[SINCE] += 1.0
    rig[AGE] += 1.0
    if rig[SINCE] > min(FORGET, HASTY * rig[KNOWN]):
        rig[KNOWN] = 0.0
    if rig[KNOWN] > 0.0:
        for i in range(3):
            rig[i] += rig[SPEED + i]


@kernel
def _correct(rig: Array, r: Array) -> None:
    """Correct position and motion from frame to frame by an alpha-beta filter."""
    frames = max(rig[AGE], 1.0)
    count = rig[KNOWN] if frames < RESTART else 0.0
    for i in range(3):
        error = r[i] - rig[i]
        rig[i] = r[i] if count < 2.0 else rig[i] + ALPHA * error
        if count == 0.0:
            rig[SPEED + i] = 0.0
        else:
            rig[SPEED + i] += (1.0 if count == 1.0 else BETA) * error / frames
    rig[KNOWN], rig[AGE], rig[MISSED] = min(count + 1.0, SLOWLY), 0.0, 0.0


@kernel
def guide(
    rig: Array, r: Array, dr: Array, ahead: float, gap: float, sigma: float, alone: bool
) -> None:
    """Tell cameras that do not both see the ball where it should be by its flight.

    Args:
        rig: Row of the rig in the memory.
        r: Position [m], shape (3,).
        dr: Velocity [m/s], shape (3,).
        ahead: Time from there to the frames that come next [s].
        gap: Time between two frames [s].
        sigma: Standard deviation of that position [m]; infinite without a flight.
        alone: Whether one camera counts while something hides the ball from the other.
    """
    rig[ALONE] = 1.0 if alone else 0.0
    if not sigma < GUIDED_SIGMA or rig[SINCE] == 0.0 or rig[AGE] >= GUIDES:
        return
    for i in range(3):
        rig[i], rig[SPEED + i] = r[i] + (ahead - gap) * dr[i], gap * dr[i]
    reach = GUIDED_REACH + 2.0 * sigma
    rig[KNOWN], rig[GUIDED], rig[SINCE] = SLOWLY, reach, min(rig[SINCE], FORGET - 2.0)


@kernel
def _is_elsewhere(memory: Array) -> bool:
    """Return whether a target is not where the ball is by its flight, or much heavier than it."""
    off = max(abs(memory[0] - memory[AT_U]), abs(memory[1] - memory[AT_V]))
    ball = memory[GAIN] * memory[EXPECTED]
    return bool(off > memory[NEAR] or (memory[WEIGHED] > 0.0 and memory[WEIGHTS] > LARGE * ball))


@kernel
def _is_inside(memory: Array, pixels: Image) -> bool:
    """Return whether the whole ball should be in an image."""
    rows, columns = pixels.shape
    rim = sqrt(memory[EXPECTED] / pi)
    u, v = memory[AT_U], memory[AT_V]
    across, down = rim <= u < columns - rim, rim <= v < rows - rim
    return bool(memory[EXPECTED] > 0.0 and across and down)


@kernel
def _is_searching(
    images: tuple[Image, ...], apart: int, memory: Array, rig: Array, ball: Array
) -> bool:
    """Return whether two fixed cameras search for a ball of which nothing is known."""
    if rig[KNOWN] > 0.0 or ball[4] == 0.0 or apart & 3:
        return False
    shown = images[0].size > 0 and images[1].size > 0
    return bool(shown and memory[0, STATE] == LOST and memory[1, STATE] == LOST)


@kernel
def localize(
    images: tuple[Image, ...], backgrounds: tuple[Image, ...], apart: int, memory: Array,
    settings: Array, boxes: Box, cameras: Array, ball: Array, work: Array, r: Array, P: Array,
) -> bool:  # fmt: skip
    """Find the ball in the images of all cameras, then in the world.

    Args:
        images: One a camera, each shape (height, width); empty where there is none.
        backgrounds: One a camera, as in :mod:`mitt.vision.background`, then scratch as large as the
            largest image.
        apart: Images that were not exposed at the instant that is asked for, a bit each.
        memory: A row a camera, and the rig's (``KNOWN`` ...), overwritten, shape (n + 1, MEMORY).
        settings: Numbers of the segmenter, shape (6,).
        boxes: Scratch, shape (target.WORK, 4).
        cameras: As in :mod:`mitt.vision.camera`, shape (n, 5, 3).
        ball: As of :func:`mitt.vision.triangulation.pack_ball`, shape (5,).
        work: Scratch, shape (triangulation.WORK + 2 n + 4, 3).
        r: Result, centre of the ball [m], shape (3,).
        P: Result, its covariance [m^2], shape (3, 3).

    Returns:
        Whether two or more cameras agree on the ball, or one alone sees it go on. While something
        hides it from the other, one counts only where ``ALONE`` says so, and not before a catch:
        it is then soon half hidden from both, and the flight model knows better.
    """
    eyes, hidden, gone, count, one = len(images), False, False, 0, -1
    points, rig = view(work, 3 * triangulation.WORK, (eyes, 3)), memory[eyes]
    _predict(rig)
    rig[STATUS] = float(BLIND)
    if _is_searching(images, apart, memory, rig, ball) and not choose(
        images, backgrounds, memory, settings, boxes, cameras, ball, points, work, r, P
    ):
        return False
    guided = rig[GUIDED] > 0.0
    since, reach = (rig[AGE], rig[GUIDED]) if guided else (rig[SINCE], REACH)
    rig[GUIDED] = 0.0
    _expect(memory, cameras, ball, reach + ASTRAY * since, guided)
    for n in range(eyes):
        points[n, 2] = -1.0
        if images[n].size > 0:
            look = images[n], backgrounds[n], backgrounds[eyes], memory[n], settings, boxes
            whole, covered, missing = _look(*look, apart >> n & 1, since, guided, ball, points[n])
            count, one = (count + 1, n) if whole else (count, one)
            hidden, gone = hidden | covered, gone | missing
    if gone and not hidden:
        rig[MISSED] += 1.0
    if count < 2:
        count = max(count, _count_where_they_meet(memory, since, cameras, points, ball, work))
    if count >= 2:
        return bool(_locate(memory, cameras, points, ball, work, r, P))
    if count == 1 and (not hidden or rig[ALONE] > 0.0) and rig[KNOWN] > 0.0:
        return bool(_locate_alone(one, hidden, memory, cameras, points, ball, r, P))
    return False


@kernel
def _look(
    pixels: Image, background: Image, scratch: Image, own: Array, settings: Array, boxes: Box,
    apart: int, since: float, guided: bool, ball: Array, point: Array,
) -> tuple[bool, bool, bool]:  # fmt: skip
    """Find the target of one camera, and write what it sees; see ``localize``.

    Returns:
        Whether it is the whole ball; whether something hides that, or is beside it; and whether
        there is nothing where the ball should be.
    """
    area, clipped = detect(pixels, background, scratch, own, settings, boxes)
    hidden = own[STATE] >= MERGED
    if own[STATE] == GOOD and area > 0 and guided and _is_elsewhere(own):
        hidden, own[STATE] = True, float(LOST)  # to be searched anew
    if apart > 0 or area == 0 or own[STATE] != GOOD:
        return False, hidden, area == 0 and _is_inside(own, pixels)
    if not note(point, own[0], own[1], float(area), clipped, ball):
        return False, hidden, False
    if _is_whole(own, since, point):
        return True, hidden, False
    point[2] = LACKING
    return False, True, False


@kernel
def _count_where_they_meet(
    memory: Array, since: float, cameras: Array, points: Array, ball: Array, work: Array
) -> int:
    """Judge targets that are not as heavy as expected where their lines of sight meet.

    After a bounce the ball is farther away than by its flight, or nearer, and its mass is that of
    a ball there. That says something only where its contrast is well known. The arguments are those
    of :func:`localize`, and frames as of :func:`_is_whole`.

    Returns:
        How many cameras see the whole ball there; 0 if one does not, and ``points`` are as before.
    """
    start, count = triangulation.WORK + len(points), 0
    r, P = view(work, 3 * start, (3,)), view(work, 3 * start + 3, (3, 3))
    seen = view(work, 3 * start + 12, points.shape)
    for n in range(len(points)):
        seen[n, 2] = -1.0
        own = memory[n]
        if own[WEIGHED] == SLOWLY and (points[n, 2] > 0.0 or points[n, 2] == LACKING):
            count += note(seen[n], own[0], own[1], own[target.AREA], False, ball)
    if count < 2 or not triangulate(cameras, seen, ball[0], r, P, work) <= ball[3]:
        return 0
    target.expect(memory, cameras, ball[0], r, 0.0)
    for n in range(len(points)):
        if seen[n, 2] > 0.0 and not _is_whole(memory[n], since, seen[n]):
            return 0
    points[:] = seen
    return count


@kernel
def _expect(memory: Array, cameras: Array, ball: Array, reach: float, guided: bool) -> None:
    """Tell each camera where its ball should be, within ``reach`` [m]; see ``localize``."""
    eyes = len(cameras)
    rig = memory[eyes]
    if rig[KNOWN] > 0.0:
        target.expect(memory, cameras, ball[0], rig, reach)
        if guided and min(memory[0, AT_V], memory[1, AT_V]) < 0.0:
            rig[AGE] -= 1.0
    else:
        for n in range(eyes):
            memory[n, EXPECTED], memory[n, WEIGHED], memory[n, NEAR] = 0.0, 0.0, 0.0


@kernel
def _locate_alone(
    one: int, hidden: bool, memory: Array, cameras: Array, points: Array, ball: Array, r: Array,
    P: Array,
) -> bool:  # fmt: skip
    """Put the ball of one camera on its ray, where it was going; return whether it goes on."""
    rig, own = memory[len(cameras)], memory[one]
    points[one, 0] -= own[target.OFF_U]
    points[one, 1] -= own[target.OFF_V]
    if not on_ray(cameras[one], points[one], ball[0], rig[:3], r, P, ALONG):
        return False
    known = rig[KNOWN]
    _correct(rig, r)
    if hidden:  # if that lasts, what was learned of the ball may be wrong, and is forgotten
        rig[KNOWN] = min(rig[KNOWN], known)
    rig[STATUS] = float(ONE)
    return True


@kernel
def _locate(
    memory: Array, cameras: Array, points: Array, ball: Array, work: Array, r: Array, P: Array
) -> bool:
    """Triangulate what two or more cameras see; return whether they agree; see ``localize``."""
    eyes = len(cameras)
    rig = memory[eyes]
    if triangulate(cameras, points, ball[0], r, P, work) <= ball[3]:
        _correct(rig, r)
        rig[SINCE], rig[ODDS], rig[STATUS] = 0.0, 0.0, float(BOTH)
        for n in range(eyes):
            if points[n, 2] > 0.0:
                _learn(memory[n], cameras[n], points[n], ball[0], rig[KNOWN], r, work[0])
        return True
    rig[ODDS] += 1.0
    rig[STATUS] = float(AT_ODDS if rig[ODDS] >= STUBBORN else BLIND)
    return False
