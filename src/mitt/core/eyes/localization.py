"""Localization: the ball in the images of all cameras, then in the world, in one compiled call.

While nothing is known of a ball and more than one target shows, all are followed for some frames
(``_choose``). A pair of targets, one in each of the first two cameras, is a candidate if their
lines of sight meet and both look as large as the ball would there. The candidate that has moved
fastest is the ball. A slow one, as if it rolled, is taken only when no other has come for a while:
a thrown ball may show late beside it. A single target in each camera is taken at once.
"""

from math import hypot, pi, sqrt
from typing import Any, NamedTuple, final

import numpy as np

from mitt.core.eyes.background import (
    background_of,
    error_by_light,
    level_behind,
    searched_difference,
)
from mitt.core.eyes.blobs import ROWS, is_merged
from mitt.core.eyes.camera import in_camera, late_by_row, sphere_centroid
from mitt.core.eyes.candidates import MOST, TRACK, extend_track, fastest_track
from mitt.core.eyes.groups import GROUP
from mitt.core.eyes.segmentation import (
    GOOD,
    LOST,
    MERGED,
    detect,
    find_sign,
    follow_target,
    measure_if_due,
    most_like_ball,
    noise_over_contrast,
    outline,
)
from mitt.core.eyes.triangulation import NEAR, note, on_ray, triangulate
from mitt.core.kernels import Fields, Handle, Record, define, kernel
from mitt.core.signals import TICK, Array, Image

BLIND, ONE, BOTH, AT_ODDS = range(4)
"""What the last frames said of the ball; ``EyesStatus``."""
LACKING = -2.0
"""Instead of a centroid's standard deviation: the target is not as heavy as the ball should be."""
SHORTEST = 0.25
"""Least time between two images [ticks]: that of a camera of 4 kHz."""
LARGE = 2.0
"""Mass over the one that the ball should have above which a target is something else."""

SEEN = np.dtype([("u", float), ("v", float), ("area", float), ("noise", float), ("group", GROUP)])
"""A target that may be the ball: centroid [px], area [px^2], noise over contrast, its pixels."""
RIG = np.dtype(
    [
        ("status", np.int64),  # BLIND, ONE, BOTH or AT_ODDS
        ("r", float, (3,)),
        ("step", float, (3,)),  # position [m], its motion a tick [m]
        ("known", float),  # sightings that the position rests on
        ("since", float),
        ("age", float),  # time since both cameras saw it, since a correction [ticks]
        ("gap", float),  # time since the images before [ticks]
        ("t", float),  # when the last images were exposed [s]
        ("odds", float),  # frames at odds in a row
        ("missed", float),  # frames since a sighting that should have shown the ball and did not
        (
            "alone",
            np.int64,
        ),  # whether one camera counts while something hides the ball from the other
        ("guided", float),  # distance from a position of ``guide`` at which the ball may be [m]
        ("rounds", np.int64),
        ("searched", float),  # searches begun anew, time of this one so far [ticks]
        ("count", np.int64),
        ("tracks", TRACK, (MOST,)),  # its candidates
        ("late", float),  # how much later than its images the ball was seen, by its rows [s]
        ("t_shown", float),
        ("lag", float),  # of the gaze: last exposure, lag of one with the ball [s]
    ]
)
"""What is remembered of a ball by all cameras together."""
WORK = np.dtype(
    [
        ("seen", SEEN, (2, MOST)),
        ("residuals", float, (MOST, MOST)),
        ("least", np.int64, (1 << MOST,)),
        ("choice", np.int64, (MOST, 1 << MOST)),
        ("partners", np.int64, (MOST,)),
        ("r", float, (3,)),
        ("P", float, (3, 3)),
    ]
)
"""Scratch of the localization: targets of the first two cameras, and their pairs."""


@final
class _Limits(NamedTuple):
    """When what is known of the ball is old, wrong or enough; found on simulated throws.

    Times are in ticks, of which one is a frame of a camera of 1 kHz. The time between two images
    that both show the ball counts as one tick, however long it is.
    """

    # Age of a position: ticks without both cameras after which it is old, and no more than so many
    # for each sighting that it rests on, as its motion is then a guess; frames at odds that are no
    # accident; sightings that count, and frames over which the contrast may change.
    forget: float = 100.0
    hasty: float = 5.0
    stubborn: float = 20.0
    slowly: float = 20.0
    # Share of the ball's mass by which a target differs by noise, by which it may differ, what
    # patches of the background add to that, over the radius [px], and each tick without both.
    sure: float = 0.002
    misfit: float = 0.01
    small: float = 0.05
    drift: float = 0.0005
    # Share of its mass that may lack where the lines of sight meet all the same.
    shade: float = 0.2
    # Relative standard deviation of a ball's mass, over noise / contrast and (radius + 1.5) /
    # radius^2 [px]: that of its pixels and of the level beside it; and how many of these it may be
    # off, where that is more.
    rim: float = 0.85
    deviations: float = 3.0
    # Relative standard deviation of the light of a window, over noise / background.
    lit: float = 0.07
    # Distance from where it should be within which a lost ball is searched, and what each tick
    # without both cameras adds [m]: it may change its speed by 10 m/s.
    reach: float = 0.12
    astray: float = 0.01
    # The same where its flight says where it should be: it is nowhere else, two standard deviations
    # added; standard deviation of the flight's position below which it says so [m]; and ticks
    # without a sighting after which it does no longer: the ball may have bounced where nothing saw
    # it. While it is above an image they do not count: there is nothing to bounce off.
    guided_reach: float = 0.06
    guided_sigma: float = 0.06
    guides: float = 30.0
    # Gains of position and motion from frame to frame; ticks after which motion starts anew.
    alpha: float = 0.5
    beta: float = 0.1
    restart: float = 20.0
    # Ticks for which candidates are followed, and in how many frames the ball is seen at least, or
    # where so few take that long; and ticks, or frames where these are longer, after which the
    # search begins anew. In 8 ms a thrown ball goes 40 mm, and 5 m away its place is known to a few
    # millimetres.
    watched: float = 8.0
    seen: int = 5
    few: int = 3
    patience: float = 24.0
    # How often the search begins anew before what may be a ball that rolls is taken all the same.
    rounds: int = 6
    # Speed of a ball of which nothing is known [m/s], and its distance from a camera [m].
    fast: float = 6.0
    close: float = 3.0
    # Difference from the radius that the ball should have: relative, and in pixels.
    tall: float = 0.35
    rough: float = 0.7
    # What a pair is worth, against residuals [px], and steps of a pixel in which they are summed.
    paired: float = 1e3
    fine: float = 1e6


LIMITS = _Limits()


@final
class EyesMemory(NamedTuple):
    """What the eyes of n cameras know and remember; Python and compiled code share its arrays."""

    targets: Record  # what each camera remembers, records of segmentation.TARGET, shape (n,)
    rig: Record  # what they remember together, a record of RIG, shape (1,)
    segmenter: Record  # settings of segmentation.pack_segmenter, shape (1,)
    ball: Record  # a record of triangulation.BALL, shape (1,)
    cameras: Record  # records of camera.CAMERA, shape (n,)
    heads: Record  # records of head.HEAD; one that is not used where the cameras stand still
    angles: Array  # pan and tilt of each head at the exposure [rad], shape (k, 2)
    gaze: Record  # what each head remembers, records of head.GAZE, shape (k,)
    points: Record  # what each camera sees, records of triangulation.POINT, shape (n,)
    corrected: Record  # scratch of the same kind, and records of each module's WORK
    segment_work: Record
    solve_work: Record
    match_work: Record
    gaze_work: Record


class EyesHandle(Handle):
    """The memory of eyes, for kernels."""


define(EyesHandle, EyesMemory)


@kernel
def eyes_handle(memory: EyesMemory) -> Any:  # noqa: ANN401
    """Return the handle of the memory of eyes."""
    return EyesHandle(*memory)


@kernel
def guide(
    rig: Fields, r: Array, dr: Array, ahead: float, t: float, sigma: float, alone: bool
) -> None:
    """Tell cameras that do not both see the ball where it should be by its flight.

    Args:
        rig: What the cameras remember together.
        r: Position [m], shape (3,).
        dr: Velocity [m/s], shape (3,).
        ahead: Time from there to the images that come next [s].
        t: When these are exposed [s].
        sigma: Standard deviation of that position [m]; infinite without a flight.
        alone: Whether one camera counts while something hides the ball from the other.
    """
    rig.alone = 1 if alone else 0
    gap = max(t - rig.t, 0.0)
    fresh = rig.since == 0.0 and gap < 1.5 * TICK
    if not sigma < LIMITS.guided_sigma or fresh or rig.age >= LIMITS.guides:
        return
    for i in range(3):
        rig.r[i], rig.step[i] = r[i] + (ahead + rig.late - gap) * dr[i], TICK * dr[i]
    rig.known, rig.guided = LIMITS.slowly, LIMITS.guided_reach + 2.0 * sigma
    rig.since = min(rig.since, LIMITS.forget - 2.0)


@kernel
def localize(
    images: tuple[Image, ...],
    backgrounds: tuple[Image, ...],
    apart: int,
    t: float,
    eyes: EyesMemory,
    r: Array,
    P: Array,
) -> bool:
    """Find the ball in the images of all cameras, then in the world.

    Args:
        images: One a camera, each shape (height, width); empty where there is none.
        backgrounds: One a camera, as in :mod:`mitt.core.eyes.segmentation`, then scratch as large
            as the largest image, or three times as large where cameras turn.
        apart: Images that were not exposed at the instant that is asked for, a bit each.
        t: That instant [s].
        eyes: What the cameras know and remember, overwritten.
        r: Result, centre of the ball [m], shape (3,).
        P: Result, its covariance [m^2], shape (3, 3).

    Returns:
        Whether two or more cameras agree on the ball, or one alone sees it go on. While something
        hides it from the other, one counts only where ``rig.alone`` says so, and not before a
        catch: it is then soon half hidden from both, and the flight model knows better.
    """
    hidden, gone, count, one = False, False, 0, -1
    points, rig = eyes.points, eyes.rig[0]
    rig.status = BLIND
    if not any_shown(images):
        return False
    _predict(rig, t)
    if _is_searching(images, apart, eyes) and not _choose(images, backgrounds, eyes, r, P):
        return False
    guided = rig.guided > 0.0
    since, reach = (rig.age, rig.guided) if guided else (rig.since, LIMITS.reach)
    rig.guided = 0.0
    if rig.known > 0.0:
        expect(eyes, rig.r, reach + LIMITS.astray * since)
        if guided and min(eyes.targets[0].at_v, eyes.targets[1].at_v) < 0.0:
            rig.age -= rig.gap
    else:
        for n in range(len(points)):
            own = eyes.targets[n]
            own.expected, own.weighed, own.near = 0.0, 0.0, 0.0
    since -= rig.gap - 1.0
    for n in range(len(points)):
        points[n].sigma = -1.0
        if images[n].size > 0:
            scratch, beside = backgrounds[len(points)], apart >> n & 1 > 0
            whole, covered, missing = _look(
                images[n], backgrounds[n], scratch, n, eyes, beside, (since, guided)
            )
            count, one = (count + 1, n) if whole else (count, one)
            hidden, gone = hidden | covered, gone | missing
    if gone and not hidden:
        rig.missed += 1.0
    if count < 2:
        count = max(count, _count_where_they_meet(eyes, since))
    rig.late = _bring_together(eyes)
    if count >= 2:
        return bool(_locate(eyes, r, P))
    if count == 1 and (not hidden or rig.alone > 0) and rig.known > 0.0:
        return bool(_locate_alone(one, hidden, eyes, r, P))
    return False


# What should be seen.


@kernel
def any_shown(images: tuple[Image, ...]) -> bool:
    """Return whether there is an image."""
    shown = False
    for n in range(len(images)):
        shown |= images[n].size > 0
    return shown


@kernel
def _predict(rig: Fields, t: float) -> None:
    """Move the last position on to images that were exposed at ``t``; forget it where it is old."""
    rig.gap, rig.t = max((t - rig.t) / TICK, 0.0), t
    rig.since += rig.gap
    rig.age += rig.gap
    if rig.searched > 0.0:
        rig.searched += rig.gap
    if rig.since - rig.gap + 1.0 > min(LIMITS.forget, LIMITS.hasty * rig.known):
        rig.known = 0.0
    if rig.known > 0.0:
        for i in range(3):
            rig.r[i] += rig.gap * rig.step[i]


@kernel
def expect(eyes: EyesMemory, r: Array, reach: float) -> None:
    """Tell each camera where in its image the ball should be, within a reach [m], and how large."""
    radius = eyes.ball[0].radius
    for n in range(len(eyes.cameras)):
        camera, own = eyes.cameras[n], eyes.targets[n]
        x, y, z = in_camera(camera, r)
        scale = camera.f_px / max(z, radius)
        own.at_u, own.at_v = camera.cu + scale * x, camera.cv + scale * y
        own.near = scale * reach
        far = sqrt(max(x * x + y * y + z * z - radius * radius, radius * radius))
        sine = radius / far
        own.expected = pi * (camera.f_px * sine) ** 2 * (far / max(z, radius)) ** 3


# What each camera sees.


@kernel
def _look(
    pixels: Image,
    background: Image,
    scratch: Image,
    n: int,
    eyes: EyesMemory,
    apart: bool,
    expected: tuple[float, bool],
) -> tuple[bool, bool, bool]:
    """Find the target of camera ``n``, and write what it sees.

    ``expected`` are the ticks since the ball was seen, and whether its flight says where it is.

    Returns:
        Whether it is the whole ball; whether something hides that, or is beside it; and whether
        there is nothing where the ball should be.
    """
    own, point, (since, guided) = eyes.targets[n], eyes.points[n], expected
    own.behind = own.mean
    unscaled = own.weighed == 0.0 or own.expected == 0.0
    area, clipped = detect(
        pixels, background, scratch, own, eyes.segmenter[0], eyes.segment_work[0]
    )
    if unscaled and own.learned > 0 and area > 0:
        own.behind = level_behind(background_of(pixels, background, scratch, own), own)
    hidden = own.state >= MERGED
    if own.state == GOOD and area > 0 and guided and _is_elsewhere(own):
        hidden, own.state = True, LOST  # to be searched anew
    if apart or area == 0 or own.state != GOOD:
        return False, hidden, area == 0 and _is_inside(own, pixels)
    noise = noise_over_contrast(own, own.moments)
    if not note(point, own.u, own.v, float(area), noise, clipped, eyes.ball[0]):
        return False, hidden, False
    if own.learned > 0 and own.weighed > 0.0:
        point.sigma = hypot(point.sigma, error_by_light(own))
    if _is_whole(own, since, point):
        return True, hidden, False
    point.sigma = LACKING
    return False, True, False


@kernel
def _is_elsewhere(target: Fields) -> bool:
    """Return whether a target is not where the ball is by its flight, or much heavier than it."""
    off = max(abs(target.u - target.at_u), abs(target.v - target.at_v))
    most = LARGE * (target.gain * target.expected)
    return bool(off > target.near or (target.weighed > 0.0 and target.moments.mass > most))


@kernel
def _is_inside(target: Fields, pixels: Image) -> bool:
    """Return whether the whole ball should be in an image."""
    rows, columns = pixels.shape
    rim = sqrt(target.expected / pi)
    across, down = rim <= target.at_u < columns - rim, rim <= target.at_v < rows - rim
    return bool(target.expected > 0.0 and across and down)


@kernel
def _lacking(target: Fields) -> float:
    """Return the share by which a target is not as heavy as the ball, where that is known."""
    return float(abs(target.moments.mass / (target.gain * target.expected) - 1.0))


@kernel
def _is_whole(target: Fields, since: float, point: Fields) -> bool:
    """Return whether a target is the whole ball and nothing else, by its mass.

    The mass over the area that the ball should have is its contrast, which changes slowly; a
    ball that is hidden in part has less, long before its shape gives it away. A rim that hides a
    share s of the disc moves the centroid by up to s radii: its error widens by that. A contrast
    that rests on few frames is soon forgotten: they may have been odd. Before a background of
    little contrast noise alone takes more from it. ``since`` counts the ticks since both cameras
    saw the ball.
    """
    if target.expected == 0.0 or since >= LIMITS.hasty * target.weighed:
        target.weighed = 0.0
        return True
    lacking = _lacking(target)
    radius = sqrt(target.expected / pi)
    spread = LIMITS.rim * target.noise * (radius + 1.5) / (target.gain * radius * radius)
    if target.learned > 0:
        light = LIMITS.lit * target.noise / max(target.mean, 1.0)
        spread = hypot(spread, light * (1.0 + target.mean / target.gain))
    spread *= sqrt(1.0 + 1.0 / target.weighed)
    allowed = max(LIMITS.small / radius, LIMITS.deviations * spread - LIMITS.misfit)
    off = max(lacking - LIMITS.sure - 0.5 * allowed, 0.0) * radius
    point.sigma = sqrt(point.sigma * point.sigma + off * off)
    return bool(lacking < LIMITS.misfit + allowed + LIMITS.drift * since)


@kernel
def _bring_together(eyes: EyesMemory) -> float:
    """Move what cameras with rolling shutters see to one instant; return how late that is [s].

    Each sees the ball when the row of its middle is exposed. Its motion in the image is that of the
    ball in the world; where that is not known yet, the error widens by what it may be.
    """
    cameras, points, rig = eyes.cameras, eyes.points, eyes.rig[0]
    total, count = 0.0, 0
    for n in range(len(points)):
        if points[n].sigma > 0.0:
            total += late_by_row(cameras[n], points[n].v)
            count += 1
    late: float = total / max(count, 1)
    for n in range(len(points)):
        point, camera = points[n], cameras[n]
        early = late - late_by_row(camera, point.v)
        if not point.sigma > 0.0 or early == 0.0:
            continue
        x, y, z = in_camera(camera, rig.r)
        if rig.known < 2.0 or not z > NEAR * eyes.ball[0].radius:
            most = LIMITS.fast * camera.f_px / LIMITS.close * early
            point.sigma = hypot(point.sigma, most)
            continue
        u, v = x / z, y / z
        dx, dy, dz = 0.0, 0.0, 0.0
        for i in range(3):
            dx += camera.R[i, 0] * rig.step[i]
            dy += camera.R[i, 1] * rig.step[i]
            dz += camera.R[i, 2] * rig.step[i]
        scale = camera.f_px / z * early / TICK
        point.u += scale * (dx - u * dz)
        point.v += scale * (dy - v * dz)
    return late


@kernel
def _count_where_they_meet(eyes: EyesMemory, since: float) -> int:
    """Judge targets that are not as heavy as expected where their lines of sight meet.

    After a bounce, or while its motion is not known yet, the ball is farther away than it should
    be, or nearer, and its mass is that of a ball there. That says something only where its contrast
    is known. Where little is lacking, as when the ball passes from the light into shade, what they
    see counts with the error that a hidden rim would have; before a catch it counts only with
    heads, as the hand hides it from cameras that stand still.

    Returns:
        How many cameras see the whole ball there; 0 if one does not, and ``points`` are as before.
    """
    points, seen, ball, work = eyes.points, eyes.corrected, eyes.ball[0], eyes.match_work[0]
    count = 0
    for n in range(len(points)):
        seen[n].sigma = -1.0
        own = eyes.targets[n]
        if own.weighed > 0.0 and (points[n].sigma > 0.0 or points[n].sigma == LACKING):
            noise = noise_over_contrast(own, own.moments)
            count += note(seen[n], own.u, own.v, own.area, noise, False, ball)
    if count < 2:
        return 0
    residual = triangulate(eyes.cameras, seen, ball.radius, work.r, work.P, eyes.solve_work[0])
    if not residual <= ball.max_residual:
        return 0
    expect(eyes, work.r, 0.0)
    for n in range(len(points)):
        own = eyes.targets[n]
        whole = seen[n].sigma <= 0.0 or _is_whole(own, since, seen[n])
        hides = ball.fixed > 0 and eyes.rig[0].alone == 0
        if not whole and (hides or _lacking(own) > LIMITS.shade):
            return 0
    for n in range(len(points)):
        points[n].u, points[n].v, points[n].sigma = seen[n].u, seen[n].v, seen[n].sigma
    return count


# Where the ball is.


@kernel
def _locate(eyes: EyesMemory, r: Array, P: Array) -> bool:
    """Triangulate what two or more cameras see; return whether they agree; see ``localize``."""
    rig, ball, points = eyes.rig[0], eyes.ball[0], eyes.points
    residual = triangulate(eyes.cameras, points, ball.radius, r, P, eyes.solve_work[0])
    if residual <= ball.max_residual:
        _correct(rig, r)
        rig.since, rig.odds, rig.status = 0.0, 0.0, BOTH
        expect(eyes, r, 0.0)
        for n in range(len(points)):
            if points[n].sigma > 0.0:
                _learn(n, eyes, r)
        return True
    rig.odds += 1.0
    rig.status = AT_ODDS if rig.odds >= LIMITS.stubborn else BLIND
    return False


@kernel
def _locate_alone(one: int, hidden: bool, eyes: EyesMemory, r: Array, P: Array) -> bool:
    """Put the ball of one camera on its ray, where it was going; return whether it goes on."""
    rig, own, point = eyes.rig[0], eyes.targets[one], eyes.points[one]
    point.u -= own.offset[0]
    point.v -= own.offset[1]
    if not on_ray(eyes.cameras[one], point, eyes.ball[0].radius, rig.r, r, P):
        return False
    known = rig.known
    _correct(rig, r)
    if hidden:  # if that lasts, what was learned of the ball may be wrong, and is forgotten
        rig.known = min(rig.known, known)
    rig.status = ONE
    return True


@kernel
def _correct(rig: Fields, r: Array) -> None:
    """Correct position and motion from frame to frame by an alpha-beta filter."""
    ticks = max(rig.age, SHORTEST)
    count = rig.known if rig.age - rig.gap + 1.0 < LIMITS.restart else 0.0
    for i in range(3):
        error = r[i] - rig.r[i]
        rig.r[i] = r[i] if count < 2.0 else rig.r[i] + LIMITS.alpha * error
        if count == 0.0:
            rig.step[i] = 0.0
        else:
            rig.step[i] += (1.0 if count == 1.0 else LIMITS.beta) * error / ticks
    rig.known, rig.age, rig.missed = min(count + 1.0, LIMITS.slowly), 0.0, 0.0


@kernel
def _learn(n: int, eyes: EyesMemory, r: Array) -> None:
    """Update the ball's contrast, and by how much camera ``n`` differs from where all see the ball.

    A calibration leaves such an offset, ten times the noise of a frame. Without it a camera that
    goes on alone would see the ball jump, which the filter would take for a kick.
    """
    own, point, camera = eyes.targets[n], eyes.points[n], eyes.cameras[n]
    radius = eyes.ball[0].radius
    if own.expected > 0.0:
        own.weighed = min(own.weighed + 1.0, LIMITS.slowly)
        before_mean = own.moments.mass / own.expected + own.sign * (own.behind - own.mean)
        own.gain += (before_mean - own.gain) / own.weighed
    place, share = in_camera(camera, r), 1.0 / max(eyes.rig[0].known, 1.0)
    if place[2] > NEAR * radius:
        u, v = sphere_centroid(camera, place, radius)
        own.offset[0] += share * (point.u - u - own.offset[0])
        own.offset[1] += share * (point.v - v - own.offset[1])


# Which of several targets is the ball.


@kernel
def _is_searching(images: tuple[Image, ...], apart: int, eyes: EyesMemory) -> bool:
    """Return whether two fixed cameras search for a ball of which nothing is known."""
    if eyes.rig[0].known > 0.0 or eyes.ball[0].fixed == 0 or apart & 3:
        return False
    shown = images[0].size > 0 and images[1].size > 0
    return bool(shown and eyes.targets[0].state == LOST and eyes.targets[1].state == LOST)


@kernel
def _choose(
    images: tuple[Image, ...], backgrounds: tuple[Image, ...], eyes: EyesMemory, r: Array, P: Array
) -> bool:
    """Choose the ball in two cameras that see it for the first time; r and P are scratch.

    Returns:
        Whether both cameras know what to follow: chosen, or the only target of each.
    """
    rig, work = eyes.rig[0], eyes.match_work[0]
    seen, partners = work.seen, work.partners
    a, b = _list_targets(images, backgrounds, 0, eyes), _list_targets(images, backgrounds, 1, eyes)
    if a == 0 or b == 0:
        return False
    if rig.searched == 0.0 and rig.rounds == 0 and a == 1 and b == 1:
        _take_both(images, backgrounds, eyes, 0, 0)
        return True
    if rig.searched == 0.0:
        rig.searched, rig.count = 1.0, 0
    for i in range(MOST):
        for j in range(MOST):
            paired = i < a and j < b
            work.residuals[i, j] = _meet(seen[0, i], seen[1, j], eyes, r, P) if paired else np.inf
    _match(work)
    for near in (True, False):  # what hardly moved first, so that it loses its track to none
        for i in range(MOST):
            if partners[i] >= 0:
                _meet(seen[0, i], seen[1, partners[i]], eyes, r, P)
                pair = i, partners[i]
                rig.count, taken = extend_track(rig.tracks, rig.count, rig.searched, r, pair, near)
                partners[i] = -1 if taken else partners[i]
    if rig.searched < LIMITS.watched:
        return False
    enough = LIMITS.few if rig.gap * LIMITS.few >= LIMITS.watched else LIMITS.seen
    chosen = fastest_track(rig.tracks, rig.count, rig.rounds >= LIMITS.rounds, enough)
    if chosen < 0 or rig.tracks[chosen].last < rig.searched:
        if rig.searched >= max(LIMITS.patience, LIMITS.watched * rig.gap):
            rig.searched = 0.0
            rig.rounds += 1
        return False
    rig.searched, rig.rounds = 0.0, 0
    pair = rig.tracks[chosen].pair
    _take_both(images, backgrounds, eyes, pair[0], pair[1])
    return True


@kernel
def _show_whole(
    images: tuple[Image, ...], backgrounds: tuple[Image, ...], n: int, eyes: EyesMemory
) -> Image:
    """Return the whole image of a camera, or its difference from the background."""
    scratch, window = backgrounds[len(backgrounds) - 1], eyes.segment_work[0].window
    shown: Image = searched_difference(
        images[n], backgrounds[n], scratch, eyes.targets[n], window, True
    )
    return shown


@kernel
def _list_targets(
    images: tuple[Image, ...], backgrounds: tuple[Image, ...], n: int, eyes: EyesMemory
) -> int:
    """Write the whole, round targets of a camera most like the ball; return their number."""
    own = eyes.targets[n]
    own.sign = 0
    shown = _show_whole(images, backgrounds, n, eyes)
    work, settings, seen = eyes.segment_work[0], eyes.segmenter[0], eyes.match_work[0].seen
    count = 0
    measure_if_due(shown, own, settings, work.counts)
    height, width = shown.shape
    for k in range(most_like_ball(shown, backgrounds[n], own, settings, work)):
        group = work.groups[k]
        inside = group.left > 0 and group.right < width - 1
        inside &= group.top > 0 and group.bottom < height - 1
        if not inside or group.bottom - group.top >= ROWS:
            continue
        if outline(shown, own, group, work.runs, own.moments) == 0:
            continue
        if own.moments.area < settings.min_area or is_merged(own.moments):
            continue
        if count == MOST:
            own.left_out += 1
            continue
        one = seen[n, count]
        one.u, one.v, one.area = own.moments.u, own.moments.v, own.moments.area
        one.noise = noise_over_contrast(own, own.moments)
        one.group = group
        count += 1
    return count


@kernel
def _take_both(
    images: tuple[Image, ...], backgrounds: tuple[Image, ...], eyes: EyesMemory, i: int, j: int
) -> None:
    """Let both cameras follow a target each from now on, number i and j of those listed."""
    work, seen = eyes.segment_work[0], eyes.match_work[0].seen
    scratch = backgrounds[len(backgrounds) - 1]
    for n, k in enumerate((i, j)):
        own, group = eyes.targets[n], seen[n, k].group
        shown = _show_whole(images, backgrounds, n, eyes)
        find_sign(images[n], backgrounds[n], scratch, own, group, eyes.segmenter[0], work)
        rows = outline(shown, own, group, work.runs, own.moments)
        if rows > 0:
            own.du, own.dv = 0.0, 0.0
            follow_target(own, group.top, rows, work.runs)


@kernel
def _fits(target: Fields, area: float) -> bool:
    """Return whether a target is as large as the ball should be; its rim adds half a pixel."""
    radius = sqrt(target.expected / pi)
    return bool(abs(sqrt(area / pi) - 0.5 - radius) < LIMITS.tall * radius + LIMITS.rough)


@kernel
def _meet(a: Fields, b: Fields, eyes: EyesMemory, r: Array, P: Array) -> float:
    """Write where two targets are if they are the ball; return the residual, or infinity [px]."""
    points, ball = eyes.points, eyes.ball[0]
    for n in range(len(points)):
        points[n].sigma = -1.0
    for n, seen in enumerate((a, b)):
        if not note(points[n], seen.u, seen.v, seen.area, seen.noise, False, ball):
            return np.inf
    residual = triangulate(eyes.cameras, points, ball.radius, r, P, eyes.solve_work[0])
    if not residual <= ball.max_residual:
        return np.inf
    expect(eyes, r, 0.0)
    if not (_fits(eyes.targets[0], a.area) and _fits(eyes.targets[1], b.area)):
        return np.inf
    return float(residual)


@kernel
def _match(work: Fields) -> None:
    """Pair targets so that most have a partner, and then the residuals in sum are smallest.

    Two targets of different balls may meet by chance; their true partners would be left alone. The
    result, ``partners``, is a target of the second camera for each of the first; -1 for none.
    """
    least, choice, residuals, sets = work.least, work.choice, work.residuals, 1 << MOST
    for taken in range(sets):
        least[taken] = 0 if taken == 0 else 1 << 40
    for i in range(MOST):
        for taken in range(sets - 1, -1, -1):  # sets that a target is taken from are still old
            choice[i, taken] = -1
            for j in range(MOST):
                if taken >> j & 1 and residuals[i, j] < np.inf:
                    worth = int(LIMITS.fine * (residuals[i, j] - LIMITS.paired))
                    cost = least[taken ^ 1 << j] + worth
                    if cost < least[taken]:
                        least[taken], choice[i, taken] = cost, j
    taken = 0
    for other in range(sets):
        if least[other] < least[taken]:
            taken = other
    for i in range(MOST - 1, -1, -1):
        j = choice[i, taken]
        work.partners[i] = j
        if j >= 0:
            taken ^= 1 << j
