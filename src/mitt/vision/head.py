"""Pan-tilt heads: where a head's camera looks, how to turn it to the ball, how to search.

The base frame of a head is an optical frame (x right, y down, z forward) with its origin where
both axes meet. Pan turns about -y (positive to the right), then tilt about x (positive up); the
lens is carried beyond both: p_base = Ry(pan) Rx(tilt) (lens + p_cam).

| here        | meaning                                                        | unit  | shape     |
|-------------|----------------------------------------------------------------|-------|-----------|
| ``heads``   | a head each: rotation of the base by rows, origin, lens, f_px, | 1, m, | (n, HEAD) |
|             | cu, cv, greatest speed and acceleration, expected range, where | px    |           |
|             | it waits (pan, tilt, nod), encoder step                        |       |           |
| ``angles``  | pan, tilt of each head, read in the middle of the exposure     | rad   | (n, 2)    |
| ``cameras`` | as in :mod:`mitt.vision.camera`                                |       | (n, 5, 3) |
"""

from math import atan2, cos, hypot, sin

import numpy as np

from mitt.jit import kernel
from mitt.signals import Array
from mitt.vision.camera import Camera, Head, Rig, look_at

HEAD = 25
"""Numbers of a packed head."""


@kernel
def aim_one(head: Array, pan: float, tilt: float, camera: Array) -> None:
    """Write the pose of a camera at the angles of its head.

    Args:
        head: A row of ``heads``.
        pan: Angle of the first axis [rad].
        tilt: Angle of the second axis [rad].
        camera: Result, a row of ``cameras``, shape (5, 3).
    """
    cp, sp, ct, st = cos(pan), sin(pan), cos(tilt), sin(tilt)
    for i in range(3):
        x, y, z = head[3 * i], head[3 * i + 1], head[3 * i + 2]
        forward = x * sp + z * cp
        right, down = x * cp - z * sp, y * ct + forward * st
        ahead = -y * st + forward * ct
        camera[i, 0], camera[i, 1], camera[i, 2] = right, down, ahead
        camera[3, i] = head[9 + i] + (right * head[12] + down * head[13] + ahead * head[14])
        camera[4, i] = head[15 + i]


@kernel
def aim(heads: Array, angles: Array, cameras: Array) -> None:
    """Write the poses of all cameras at the angles of their heads; none for a fixed rig, n = 0.

    Args:
        heads: As in the module's table.
        angles: As in the module's table.
        cameras: Result.
    """
    for n in range(heads.shape[0]):
        aim_one(heads[n], angles[n, 0], angles[n, 1], cameras[n])


@kernel
def bearing(head: Array, r: Array, dr: Array, desired: Array) -> None:
    """Write the angles at which a head looks at a point, and how fast they change.

    Exact for a lens on the optical axis; one beside it sees the point that much beside the
    middle of the image.

    Args:
        head: A row of ``heads``.
        r: Point in the world [m], shape (3,).
        dr: Its velocity [m/s], shape (3,).
        desired: Result, pan, tilt [rad] and their rates [rad/s], shape (4,).
    """
    x, y, z, dx, dy, dz = r[0] - head[9], r[1] - head[10], r[2] - head[11], dr[0], dr[1], dr[2]
    a = head[0] * x + head[3] * y + head[6] * z
    b = head[1] * x + head[4] * y + head[7] * z
    c = head[2] * x + head[5] * y + head[8] * z
    da = head[0] * dx + head[3] * dy + head[6] * dz
    db = head[1] * dx + head[4] * dy + head[7] * dz
    dc = head[2] * dx + head[5] * dy + head[8] * dz
    flat = max(hypot(a, c), 1e-6)
    range2 = flat * flat + b * b
    desired[0], desired[1] = atan2(a, c), atan2(-b, flat)
    desired[2] = (da * c - a * dc) / (flat * flat)
    desired[3] = (b * (a * da + c * dc) / flat - db * flat) / range2
    for k in range(4):  # a point so far off or so fast that the numbers run out
        if not np.isfinite(desired[k]):
            desired[k] = 0.0


def pack_heads(rig: Rig) -> Array:
    """Return the heads of a rig as the array of the module's table; no rows for a fixed rig."""
    rows = [
        (*h.T_world_base[:3, :3].ravel(), *h.T_world_base[:3, 3], *h.lens, c.f_px, c.cu, c.cv,
         h.max_speed, h.max_accel, h.expected_range, *h.search, h.nod, h.encoder_step)
        for h, c in zip(rig.heads, rig.cameras, strict=False)
    ]  # fmt: skip
    return np.array(rows, dtype=np.float64).reshape(len(rows), HEAD)


def pose_of(head: Head, pan: float, tilt: float) -> Array:
    """Return T_world_cam [m], shape (4, 4), of a head's camera at its angles [rad]."""
    row, camera = np.zeros(HEAD), np.empty((5, 3))
    row[:9], row[9:12] = head.T_world_base[:3, :3].ravel(), head.T_world_base[:3, 3]
    row[12:15] = head.lens
    aim_one(row, pan, tilt, camera)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = camera[:3], camera[3]
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
        camera = Camera(width=128, height=128, f_px=730.0, cu=63.5, cv=63.5,
                        T_world_cam=pose_of(head, *head.search))  # fmt: skip
        cameras.append(camera)
    return Rig(cameras=tuple(cameras), heads=tuple(heads))
