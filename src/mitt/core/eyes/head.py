"""Pan-tilt heads: where their cameras look, how to turn them to the ball, how to search for it.

The base frame of a head is an optical frame (x right, y down, z forward) with its origin where
both axes meet. Pan turns about -y (positive to the right), then tilt about x (positive up); the
lens is carried beyond both: p_base = Ry(pan) Rx(tilt) (lens + p_cam).

The gaze law (``lead``) keeps the ball in the middle of each image. While the filter follows the
ball, a head looks where the ball will be at the next exposure, and turns as fast as it will pass.
Where an image contradicts the filter, as after a bounce, its head follows the image: the ball's
direction and rate by an alpha-beta filter (Benedict and Bordner 1962). A head that sees nothing
then looks where the line of sight of the other is at the ball's distance, or before there is a
track at the distance at which balls come into sight.

Where exposures show no ball any more, it may have bounced, at any height: nobody knows of a table.
Both heads look at what that makes of its way (``_search``). Before any ball is seen, and long
after the last, they nod and sway over where throws come from.

Angles are pan and tilt [rad], ``goal`` and ``desired`` both and their rates [rad, rad/s].
"""

from math import atan2, cos, hypot, pi, sin, sqrt

import numpy as np

from mitt.core.ball.flight import change_by_bounce
from mitt.core.eyes.camera import CAMERA, Camera, Head, Rig, look_at, ray_of
from mitt.core.eyes.localization import LARGE, EyesMemory
from mitt.core.eyes.segmentation import GOOD
from mitt.core.kernels import Fields, Record, kernel
from mitt.core.signals import Array

HEAD = np.dtype(
    [
        ("base", float, (3, 3)),
        ("origin", float, (3,)),  # pose in the world [1], [m]
        ("lens", float, (3,)),  # optical centre beyond both axes [m]
        ("f_px", float),
        ("cu", float),
        ("cv", float),  # of its camera [px]
        ("max_speed", float),
        ("max_accel", float),  # [rad/s], [rad/s^2]
        ("expected_range", float),  # distance at which balls come into sight [m]
        ("pan", float),
        ("tilt", float),
        ("nod", float),  # where it waits [rad]
    ]
)
"""A head for kernels."""
GAZE = np.dtype(
    [
        ("pan", float),
        ("tilt", float),
        ("dpan", float),
        ("dtilt", float),  # where it sees the ball
        ("count", np.int64),
        ("t", float),  # sightings in a row, time of the last [s]
    ]
)
"""What a head remembers of the ball."""
WORK = np.dtype(
    [
        ("camera", CAMERA),
        ("r", float, (2, 3)),
        ("goal", float, (4,)),
        ("change", float, (3,)),
        ("sought", float, (2, 3)),
    ]
)
"""Scratch of the gaze law."""

ALPHA = 0.5
BETA = 0.15
"""Gains of direction and rate from sighting to sighting."""
FRESH = 0.006
STALE = 0.03
"""Ages up to which an image contradicts the filter, beyond how old the newest always are, and up to
which it leads a head while there is no track [s]."""
LET_GO = 0.15
"""Time without a sighting after which the heads no longer follow the filter [s]."""
DOUBT = 0.04
"""Angle between image and filter above which a head follows its image [rad]."""
NOD = 0.052
SWAY = 0.069
BREADTH = 1.375
"""Periods in which a waiting head nods and sways [s]; how far it sways, over the pan at which
it waits: two heads that wait on either side look outwards and inwards together."""
BORDER = 6.0
"""What is left between a ball and the border of its image [px]: it moves on before the next."""
SWEEP = 0.06
"""Period of a search that does not fit into the image [s]: heads at 9 rad/s can follow 0.17 rad."""


# Kinematics.


@kernel
def aim_one(head: Fields, pan: float, tilt: float, camera: Fields) -> None:
    """Write the pose of a camera at the angles of its head [rad] into a record of ``CAMERA``."""
    cp, sp, ct, st, base, lens = cos(pan), sin(pan), cos(tilt), sin(tilt), head.base, head.lens
    for i in range(3):
        x, y, z = base[i, 0], base[i, 1], base[i, 2]
        forward = x * sp + z * cp
        right, down = x * cp - z * sp, y * ct + forward * st
        ahead = -y * st + forward * ct
        camera.R[i, 0], camera.R[i, 1], camera.R[i, 2] = right, down, ahead
        camera.centre[i] = head.origin[i] + (right * lens[0] + down * lens[1] + ahead * lens[2])
    camera.f_px, camera.cu, camera.cv = head.f_px, head.cu, head.cv


@kernel
def aim_heads(eyes: EyesMemory) -> None:
    """Write the poses of all cameras at the angles of their heads; for a rig with heads.

    Where their images lie in their panoramas as well, and how large a ball usually is.
    """
    for n in range(len(eyes.heads)):
        head, own, pan, tilt = eyes.heads[n], eyes.targets[n], eyes.angles[n, 0], eyes.angles[n, 1]
        aim_one(head, pan, tilt, eyes.cameras[n])
        own.turns, own.turn_u, own.turn_v = 1, round(head.f_px * pan), round(-head.f_px * tilt)
        own.learned = 1
        own.usual = pi * (head.f_px * eyes.ball[0].radius / head.expected_range) ** 2


@kernel
def bearing(head: Fields, r: Array, dr: Array, desired: Array) -> None:
    """Write the angles at which a head looks at a point, and how fast they change.

    Exact for a lens on the optical axis; one beside it sees the point that much beside the
    middle of the image.

    Args:
        head: A record of ``HEAD``.
        r: Point in the world [m], shape (3,).
        dr: Its velocity [m/s], shape (3,).
        desired: Result, shape (4,).
    """
    R, o = head.base, head.origin
    x, y, z, dx, dy, dz = r[0] - o[0], r[1] - o[1], r[2] - o[2], dr[0], dr[1], dr[2]
    a = R[0, 0] * x + R[1, 0] * y + R[2, 0] * z
    b = R[0, 1] * x + R[1, 1] * y + R[2, 1] * z
    c = R[0, 2] * x + R[1, 2] * y + R[2, 2] * z
    da = R[0, 0] * dx + R[1, 0] * dy + R[2, 0] * dz
    db = R[0, 1] * dx + R[1, 1] * dy + R[2, 1] * dz
    dc = R[0, 2] * dx + R[1, 2] * dy + R[2, 2] * dz
    flat = max(hypot(a, c), 1e-6)
    range2 = flat * flat + b * b
    desired[0], desired[1] = atan2(a, c), atan2(-b, flat)
    desired[2] = (da * c - a * dc) / (flat * flat)
    desired[3] = (b * (a * da + c * dc) / flat - db * flat) / range2
    for k in range(4):  # a point so far off or so fast that the numbers run out
        if not np.isfinite(desired[k]):
            desired[k] = 0.0


@kernel
def _distance(a: Array, b: Array) -> float:
    """Return how far two points are apart [m]."""
    x, y, z = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    return float(sqrt(x * x + y * y + z * z))


# The gaze law.


@kernel
def lead(
    eyes: EyesMemory, motion: Array, t_seen: float, te: float, t: float, desired: Array
) -> None:
    """Write where the heads are to look.

    Args:
        eyes: After ``localize``, the cameras as they stood at the exposure; overwritten.
        motion: Position [m] and velocity [m/s] of the ball at ``t``, rows 0 and 1.
        t_seen: When the ball was last seen that ``motion`` is known of [s]; -infinity: unknown.
        te: Time of the newest exposure [s].
        t: Time at which the heads are to be there [s].
        desired: Result, shape (n, 4).
    """
    heads, rig, work, silence = eyes.heads, eyes.rig[0], eyes.gaze_work[0], 0.0
    for n in range(len(heads)):
        if te == eyes.gaze[n].t or not _is_ball(eyes.targets[n]):
            continue
        away, centre = heads[n].expected_range, eyes.cameras[n].centre
        if rig.known > 0.0:
            away = _distance(centre, rig.r)
        _observe(n, eyes, te, away)
    follows = t - t_seen < LET_GO
    if follows:
        if te != rig.t_shown and t_seen == te:
            rig.lag = t - te
        rig.t_shown = te
        silence = t - t_seen - rig.lag
        _search(heads[0], motion, silence, eyes.targets[0].expected, work)
    for n in range(len(heads)):
        if follows:
            _look_at(n, eyes, silence > FRESH, t, desired[n])
        else:
            _wait(n, eyes, t, desired[n])


@kernel
def _is_ball(target: Fields) -> bool:
    """Return whether a camera follows what may be the ball: no more than twice as heavy as it."""
    ball = target.gain * target.expected
    light = target.weighed == 0.0 or ball == 0.0 or target.moments.mass < LARGE * ball
    return bool(light and target.state == GOOD)


@kernel
def _observe(n: int, eyes: EyesMemory, te: float, away: float) -> None:
    """Update what head ``n`` remembers by the target's direction in its image.

    ``te`` is the time of the exposure [s], ``away`` the distance of the ball, or a guess [m].
    """
    camera, track, work = eyes.cameras[n], eyes.gaze[n], eyes.gaze_work[0]
    x, y = ray_of(camera, eyes.targets[n].u, eyes.targets[n].v)
    far, seen, R = away / sqrt(x * x + y * y + 1.0), work.goal, camera.R
    for i in range(3):
        work.r[0, i] = camera.centre[i] + far * (R[i, 0] * x + R[i, 1] * y + R[i, 2])
        work.r[1, i] = 0.0
    bearing(eyes.heads[n], work.r[0], work.r[1], seen)
    elapsed = te - track.t
    if track.count == 0 or not 0.0 < elapsed < STALE:
        track.pan, track.tilt, track.dpan, track.dtilt, track.count = seen[0], seen[1], 0.0, 0.0, 1
    else:
        first = track.count == 1
        error = seen[0] - track.pan - elapsed * track.dpan
        track.pan = seen[0] if first else seen[0] - (1.0 - ALPHA) * error
        track.dpan += (1.0 if first else BETA) * error / elapsed
        error = seen[1] - track.tilt - elapsed * track.dtilt
        track.tilt = seen[1] if first else seen[1] - (1.0 - ALPHA) * error
        track.dtilt += (1.0 if first else BETA) * error / elapsed
        track.count += 1
    track.t = te


@kernel
def _seen_at(track: Fields, t: float) -> tuple[float, float]:
    """Return the direction in which a head saw the ball, carried on to ``t`` [rad]."""
    later = t - track.t
    return track.pan + later * track.dpan, track.tilt + later * track.dtilt


@kernel
def _take_image(track: Fields, t: float, goal: Array) -> None:
    """Write the direction in which a head saw the ball, carried on to ``t``, and its rate."""
    goal[0], goal[1] = _seen_at(track, t)
    goal[2], goal[3] = track.dpan, track.dtilt


@kernel
def _along(head: Fields, track: Fields, t: float, far: float, camera: Fields, point: Array) -> None:
    """Write the point that a head's line of sight reaches at a distance at ``t``."""
    pan, tilt = _seen_at(track, t)
    aim_one(head, pan, tilt, camera)
    for i in range(3):
        point[i] = camera.centre[i] + far * camera.R[i, 2]


@kernel
def _from_others(
    n: int, eyes: EyesMemory, t: float, oldest: float, known: bool, r: Array, desired: Array
) -> bool:
    """Write where head ``n`` looks to meet the line of sight of another; False if none sees.

    What the other sees is not older than ``oldest`` [s]. If ``known`` they meet as far off as
    ``r``, else as far as balls come into sight.
    """
    work, h = eyes.gaze_work[0], 1e-3
    now, rate = work.r[0], work.r[1]
    for m in range(len(eyes.heads)):
        head, track = eyes.heads[m], eyes.gaze[m]
        if m == n or track.count < 1 or t - track.t > oldest:
            continue
        far = _distance(head.origin, r) if known else head.expected_range
        _along(head, track, t, far, work.camera, now)
        _along(head, track, t + h, far, work.camera, rate)
        for i in range(3):
            rate[i] = (rate[i] - now[i]) / h
        bearing(eyes.heads[n], now, rate, desired)
        return True
    return False


@kernel
def _search(head: Fields, motion: Array, silence: float, area: float, work: Fields) -> None:
    """Write where a ball that is not seen any more is looked for into ``work.sought``.

    If it bounced a time T ago, it is off its flight by what the bounce changed of its velocity,
    times T; and T is anything from 0 to the silence. From a head that is a line. All of it is held
    in the image as long as it fits; then the gaze goes to and fro along it, from its far end on: a
    ball is most likely lost as it bounces. A ball that rises does not bounce.

    The silence is the time for which the ball was not seen though it should have been [s], the area
    that of its image [px^2].
    """
    sought, change = work.sought, work.change
    for i in range(3):
        sought[0, i], sought[1, i] = motion[0, i], motion[1, i]
    if not (silence > 0.0 and change_by_bounce(motion[1], silence, change)):
        return
    speed = sqrt(change[0] ** 2 + change[1] ** 2 + change[2] ** 2)
    held = max(min(head.cu, head.cv) - BORDER - sqrt(area / pi), 0.0) / head.f_px
    fits = 2.0 * held * _distance(head.origin, motion[0]) / speed
    share, drift, swept = 0.5 * silence, 0.5, silence - fits
    if swept > 0.0:
        phase = 2.0 * pi * swept / SWEEP
        share += 0.5 * swept * cos(phase)
        drift += 0.5 * cos(phase) - pi * swept / SWEEP * sin(phase)
    for i in range(3):
        sought[0, i] += share * change[i]
        sought[1, i] += drift * change[i]


@kernel
def _look_at(n: int, eyes: EyesMemory, silent: bool, t: float, goal: Array) -> None:
    """Write where head ``n`` looks for a ball that is followed.

    Its own image knows better where it contradicts the filter, and any image where that is silent.
    """
    track, sought, oldest = eyes.gaze[n], eyes.gaze_work[0].sought, eyes.rig[0].lag + FRESH
    bearing(eyes.heads[n], sought[0], sought[1], goal)
    if track.count >= 1 and t - track.t < oldest:
        u, v = _seen_at(track, t)
        if silent or max(abs(goal[0] - u), abs(goal[1] - v)) > DOUBT:
            _take_image(track, t, goal)
    elif silent:
        _from_others(n, eyes, t, oldest, True, sought[0], goal)


@kernel
def _wait(n: int, eyes: EyesMemory, t: float, goal: Array) -> None:
    """Write where head ``n`` looks while no ball is followed: at what it sees, or for a throw."""
    head, track = eyes.heads[n], eyes.gaze[n]
    if track.count >= 1 and t - track.t < STALE:
        _take_image(track, t, goal)
    elif not _from_others(n, eyes, t, STALE, False, head.origin, goal):
        nod, sway, breadth = 2.0 * pi / NOD, 2.0 * pi / SWAY, BREADTH * head.pan
        goal[0], goal[2] = head.pan + breadth * sin(sway * t), breadth * sway * cos(sway * t)
        goal[1] = head.tilt + head.nod * sin(nod * t)
        goal[3] = head.nod * nod * cos(nod * t)


# Rigs with heads.


def pack_heads(rig: Rig) -> Record:
    """Return the heads of a rig as records of ``HEAD``, shape (n,); none for a fixed rig."""
    return np.array(
        [
            (
                h.T_world_base[:3, :3],
                h.T_world_base[:3, 3],
                h.lens,
                c.f_px,
                c.cu,
                c.cv,
                h.max_speed,
                h.max_accel,
                h.expected_range,
                *h.search,
                h.nod,
            )
            for h, c in zip(rig.heads, rig.cameras, strict=False)
        ],
        HEAD,
    )


def fresh_gaze(n: int) -> Record:
    """Return records of ``GAZE`` of heads that have seen nothing, shape (n,)."""
    gaze = np.zeros(n, GAZE)
    gaze["t"] = -np.inf
    return gaze


def pose_of(head: Head, pan: float, tilt: float) -> Array:
    """Return T_world_cam [m], shape (4, 4), of a head's camera at its angles [rad]."""
    packed, camera, T = np.zeros(1, HEAD), np.zeros(1, CAMERA), np.eye(4)
    packed["base"], packed["origin"] = head.T_world_base[:3, :3], head.T_world_base[:3, 3]
    packed["lens"] = head.lens
    aim_one(packed[0], pan, tilt, camera[0])
    T[:3, :3], T[:3, 3] = camera["R"][0], camera["centre"][0]
    return T


def active_rig() -> Rig:
    """Return two heads with cameras of 730 px focal length, 1 m apart.

    They stand 0.8 m behind the shoulder and 0.3 m below it: from there a default throw is no
    more than 0.14 rad off the middle of where throws come from, no head need turn faster than
    its limit, and the arm, which reaches up and forward, stays out of the way until the hand
    closes. A field of +-5 degrees covers half of that; so while no ball is in sight the left eye
    watches the right half and the right eye the left, as a ball nearer than the middle appears
    there, and both nod and sway. The pattern is the best of 450: begun at any phase, 99 % of 800
    default throws come into a field within 50 ms, all but 1 in 10 000 within 160 ms, and so do
    44 recorded flights within 12 ms. The first to see a ball tells the other where to look.
    The left head is a little higher, so that swapped cables show.
    """
    middle = np.array((4.0, 0.05, 0.25))
    heads, cameras = [], []
    for side in (1.0, -1.0):
        pivot = np.array((0.2, 0.5 * side, 0.04 * side - 0.7))
        head = Head(
            T_world_base=look_at(pivot, middle),
            search=np.array((0.054 * side, 0.053)),
            nod=0.06,
            expected_range=float(np.linalg.norm(middle - pivot)),
        )
        heads.append(head)
        camera = Camera(
            width=128,
            height=128,
            f_px=730.0,
            cu=63.5,
            cv=63.5,
            T_world_cam=pose_of(head, *head.search),
        )
        cameras.append(camera)
    return Rig(cameras=tuple(cameras), heads=tuple(heads))
