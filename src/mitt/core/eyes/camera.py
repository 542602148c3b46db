"""Where a point of the world appears in an image, and where an image point may lie.

Pinhole cameras without distortion; optical frame z forward, x right, y down; pixel centres lie
at integers. The centroid of a sphere's image is not the image of its centre: with angular radius
rho, sin rho = R / d, and angle theta off the optical axis the ellipse's centre lies at
tan(theta) / (1 - sin^2(rho) / cos^2(theta)), the mean of tan(theta + rho) and tan(theta - rho).

| here            | meaning                                                  | unit | shape     |
|-----------------|----------------------------------------------------------|------|-----------|
| ``T_world_cam`` | p_world = T_world_cam @ p_cam, homogeneous               | m    | (4, 4)    |
| ``f_px``        | focal length over the pixel pitch                        | px   |           |
| ``cu, cv``      | principal point, column and row                          | px   |           |
| ``camera``      | for kernels: a record of ``CAMERA``                      |      |           |
"""

from dataclasses import dataclass, field
from math import pi

import numpy as np

from mitt.core import checks
from mitt.core.errors import InputError
from mitt.core.fields import brief
from mitt.core.kernels import Fields, Record, kernel
from mitt.core.signals import Array, all_of

CAMERA = np.dtype(
    [
        ("R", float, (3, 3)),  # axes of the optical frame as columns in the world [1]
        ("centre", float, (3,)),  # optical centre [m]
        ("f_px", float),
        ("cu", float),
        ("cv", float),  # [px]
        ("readout", float),  # time from the exposure of the first row to that of the last [s]
        ("last", float),  # last row [px]
    ]
)
"""A camera for kernels."""

MOST_READOUT = 0.1
"""Longest time in which an image is read out [s]."""

_keep = object.__setattr__


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Camera:
    """A pinhole camera that does not move.

    Attributes:
        width: Columns [px].
        height: Rows [px].
        f_px: Focal length [px].
        cu: Column of the principal point [px].
        cv: Fields of the principal point [px].
        T_world_cam: Pose of the optical frame in the world [m], shape (4, 4).
        readout: Time from the exposure of the first row to that of the last [s]: that of a rolling
            shutter, whose images are stamped with the time of the middle row; 0 for a global one.
    """

    width: int
    height: int
    f_px: float
    cu: float
    cv: float
    T_world_cam: Array
    readout: float = 0.0

    __repr__ = brief

    def __post_init__(self) -> None:
        """Refuse a camera that cannot see, or a pose that is no rigid transform."""
        T = checks.array("T_world_cam", self.T_world_cam, (4, 4))
        _keep(self, "T_world_cam", T)
        for side in ("width", "height"):
            _keep(self, side, checks.whole(f"camera.{side}", getattr(self, side)))
        for name in ("f_px", "cu", "cv"):
            _keep(self, name, checks.number(f"camera.{name}", getattr(self, name)))
        readout = checks.number("camera.readout", self.readout, least=0.0, most=MOST_READOUT)
        _keep(self, "readout", readout)
        values = np.append(T.ravel(), (self.f_px, self.cu, self.cv))
        if not np.all(np.isfinite(values)) or self.f_px <= 0 or min(self.width, self.height) < 8:
            raise InputError(
                "camera", "finite values, f_px > 0 and at least 8 x 8 pixels", f"f_px {self.f_px}"
            )
        R = T[:3, :3]
        if np.abs(R.T @ R - np.eye(3)).max() > 1e-6 or np.linalg.det(R) < 0:
            raise InputError("T_world_cam", "a rotation in its upper left 3 x 3", R.tolist())

    @property
    def centre(self) -> Array:
        """Optical centre in the world [m], shape (3,)."""
        return self.T_world_cam[:3, 3]

    @property
    def rotation(self) -> Array:
        """Axes of the optical frame as columns in the world [1], shape (3, 3)."""
        return self.T_world_cam[:3, :3]

    def _to_optical(self, p_world: Array) -> Array:
        """Return the point in the optical frame [m], shape (..., 3)."""
        return np.asarray((p_world - self.centre) @ self.rotation)

    def project(self, p_world: Array) -> tuple[float, float]:
        """Return the image point (u, v) [px] of ``p_world`` [m], shape (3,).

        Both are NaN for a point behind the camera.
        """
        x, y, z = self._to_optical(p_world)
        if z <= 0.0:
            return float("nan"), float("nan")
        return float(self.cu + self.f_px * x / z), float(self.cv + self.f_px * y / z)

    def ray(self, u: float, v: float) -> Array:
        """Return the unit direction [1], shape (3,), in the world of what appears at (u, v)."""
        direction = np.array(((u - self.cu) / self.f_px, (v - self.cv) / self.f_px, 1.0))
        return np.asarray(self.rotation @ direction / np.linalg.norm(direction))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Head:
    """A pan-tilt head that carries a camera; its kinematics: :mod:`mitt.core.eyes.head`.

    Attributes:
        T_world_base: Pose of the base frame [m], shape (4, 4).
        lens: Optical centre beyond both axes, in the camera's axes [m], shape (3,).
        encoder_step: Resolution of both encoders [rad].
        max_speed: Greatest speed of each axis [rad/s]; the paper prints 525 rad/s, which cannot
            be right: 525 deg/s.
        max_accel: Greatest acceleration of each axis [rad/s^2]; a choice of this project.
        search: Pan and tilt at which the head waits for a ball [rad], shape (2,).
        nod: How far it nods up and down while it waits [rad].
        expected_range: Distance at which balls come into sight [m].
    """

    T_world_base: Array
    lens: Array = field(default_factory=lambda: np.array((0.0, 0.0, 0.03)))
    encoder_step: float = 2.0 * pi / 2**18
    max_speed: float = 525.0 * pi / 180.0
    max_accel: float = 1000.0
    search: Array = field(default_factory=lambda: np.zeros(2))
    nod: float = 0.0
    expected_range: float = 4.0

    __repr__ = brief

    def __post_init__(self) -> None:
        """Refuse a head that cannot turn, or a pose that is none."""
        arrays = {
            "T_world_base": (self.T_world_base, (4, 4)),
            "lens": (self.lens, (3,)),
            "search": (self.search, (2,)),
        }
        for name, (value, shape) in arrays.items():
            kept = checks.array(f"head.{name}", value, shape, finite=True)
            _keep(self, name, kept)
        for name in ("encoder_step", "max_speed", "max_accel", "nod", "expected_range"):
            _keep(self, name, checks.number(f"head.{name}", getattr(self, name), finite=True))
        limits = (self.max_speed, self.max_accel, self.expected_range)
        if not (min(limits) > 0.0 and 0.0 <= self.encoder_step < 0.1):
            raise InputError("head", "positive limits, an encoder step below 0.1 rad", limits)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rig:
    """Cameras that see the same scene at the same instants; two or more to triangulate.

    Attributes:
        cameras: In the order of ``Frame.camera``; with heads, their poses while they wait.
        heads: One a camera where cameras turn; none where they are fixed.
    """

    cameras: tuple[Camera, ...]
    heads: tuple[Head, ...] = ()

    __repr__ = brief

    def __post_init__(self) -> None:
        """Refuse a rig without cameras, or with heads for some of them only."""
        _keep(self, "cameras", all_of("cameras", self.cameras, Camera))
        _keep(self, "heads", all_of("heads", self.heads, Head))
        if not self.cameras:
            raise InputError("cameras", "at least one camera", "none")
        if len(self.heads) not in (0, len(self.cameras)):
            raise InputError("heads", f"none or {len(self.cameras)}", len(self.heads))


def look_at(centre: Array, target: Array) -> Array:
    """Return the pose T_world_cam, shape (4, 4), of an upright camera that faces ``target``.

    Args:
        centre: Optical centre [m], shape (3,).
        target: Point that appears at the principal point [m], shape (3,).

    Raises:
        InputError: The target is at the centre, or straight above or below it.
    """
    forward = target - centre
    right = np.cross(forward, (0.0, 0.0, 1.0))
    if np.linalg.norm(right) < 1e-9:
        raise InputError("target", "a point not on the camera's vertical", target.tolist())
    right = right / np.linalg.norm(right)
    forward = forward / np.linalg.norm(forward)
    T = np.eye(4)
    T[:3, :3] = np.column_stack((right, np.cross(forward, right), forward))
    T[:3, 3] = centre
    return T


def rotation_by_vector(w: Array) -> Array:
    """Return the rotation by a vector [rad], shape (3, 3), by Rodrigues' formula."""
    angle, (x, y, z) = float(np.linalg.norm(w)), w
    K = np.array(((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)))
    sine, half = np.sinc(angle / np.pi), np.sinc(0.5 * angle / np.pi)  # of the angle, over it
    return np.asarray(np.eye(3) + sine * K + 0.5 * half**2 * K @ K)


def rotation_vector(R: Array) -> Array:
    """Return the vector w [rad], shape (3,), of ``rotation``; for less than half a turn."""
    axis = 0.5 * np.array((R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]))
    sine = float(np.linalg.norm(axis))
    angle = np.arctan2(sine, 0.5 * (np.trace(R) - 1.0))
    return np.asarray(axis * (angle / sine if sine > 0.0 else 1.0))


def turned(T: Array, step: Array) -> Array:
    """Return a pose moved by a step: R becomes exp(w) R, t becomes t + v.

    Args:
        T: Pose, shape (4, 4).
        step: w [rad] and v [m], shape (6,).
    """
    out = np.array(T)
    out[:3, :3] = rotation_by_vector(step[:3]) @ T[:3, :3]
    out[:3, 3] += step[3:]
    return out


def inverse(T: Array) -> Array:
    """Return the inverse of a rigid transform, shape (4, 4)."""
    out = np.eye(4)
    out[:3, :3] = T[:3, :3].T
    out[:3, 3] = -T[:3, :3].T @ T[:3, 3]
    return out


def applied(T: Array, p: Array) -> Array:
    """Return points, shape (n, 3), moved by a pose."""
    return np.asarray(p @ T[:3, :3].T + T[:3, 3])


def by_pose(p_turned: Array) -> Array:
    """Return the derivative of R p + t with respect to a step of ``turned``, shape (n, 3, 6).

    Args:
        p_turned: R p [m], shape (n, 3).
    """
    out = np.empty((len(p_turned), 3, 6))
    out[:, :, :3] = np.cross(np.eye(3), p_turned[:, None]).swapaxes(1, 2)
    out[:, :, 3:] = np.eye(3)
    return out


def laid(a: Array, b: Array, weights: Array) -> Array:
    """Return the pose that lays points ``a`` on points ``b`` with the least weighted squares.

    W. Kabsch, A solution for the best rotation to relate two sets of vectors, Acta
    Crystallographica A 32 (1976) 922-923.

    Args:
        a: Points [m], shape (n, 3), n >= 3 and not on one line.
        b: The same points elsewhere [m], shape (n, 3).
        weights: Weight of each, shape (n,).
    """
    w = weights / weights.sum()
    mean_a, mean_b = w @ a, w @ b
    U, _, Vt = np.linalg.svd((a - mean_a).T @ ((b - mean_b) * w[:, None]))
    flip = np.diag((1.0, 1.0, np.linalg.det(U @ Vt)))
    T = np.eye(4)
    T[:3, :3] = (U @ flip @ Vt).T
    T[:3, 3] = mean_b - T[:3, :3] @ mean_a
    return T


def pack_cameras(rig: Rig) -> Record:
    """Return the cameras of a rig as records of ``CAMERA``, shape (n,)."""
    rows = [
        (c.rotation, c.centre, c.f_px, c.cu, c.cv, c.readout, c.height - 1) for c in rig.cameras
    ]
    return np.array(rows, CAMERA)


@kernel
def late_by_row(camera: Fields, v: float) -> float:
    """Return how much later than its image a row is exposed [s]."""
    return float(camera.readout * (min(max(v / camera.last, 0.0), 1.0) - 0.5))


@kernel
def in_camera(camera: Fields, r: Array) -> tuple[float, float, float]:
    """Return a place of the world [m], shape (3,), in the optical frame of a camera [m]."""
    x, y, z, R = 0.0, 0.0, 0.0, camera.R
    for i in range(3):
        d = r[i] - camera.centre[i]
        x += R[i, 0] * d
        y += R[i, 1] * d
        z += R[i, 2] * d
    return x, y, z


@kernel
def sphere_centroid(
    camera: Fields, place: tuple[float, float, float], radius: float
) -> tuple[float, float]:
    """Return the column and row [px] at which the centroid of a ball's image lies.

    Args:
        camera: A record of ``CAMERA``.
        place: Ball centre in the optical frame [m], its depth greater than ``radius``.
        radius: Ball radius [m].
    """
    x, y, z = place
    stretch = 1.0 / (1.0 - radius * radius / (z * z))
    return camera.cu + camera.f_px * stretch * x / z, camera.cv + camera.f_px * stretch * y / z


@kernel
def ray_of(camera: Fields, u: float, v: float) -> tuple[float, float]:
    """Return the ideal point at unit distance [1] of an image point [px]."""
    return (u - camera.cu) / camera.f_px, (v - camera.cv) / camera.f_px


def fixed_rig() -> Rig:
    """Return two 128 x 128 cameras that do not move and see the whole flight and the catch.

    They are behind the arm, 1.8 m back, 1.25 m to either side and 0.9 m below the shoulder, and
    look forward and up past it. Of 105 positions those were considered that keep in view every
    flight and the box x 0.6 to 5.1 m, |y| to 0.75 m, z -0.4 to 1.4 m narrowing to |y| 0.4 m, z -0.3
    to 0.6 m at the catch; these are the most accurate. From below, hand and arm hide the ball in
    the last 40 ms before contact, from 0.35 m above the shoulder in the last 90 ms; the error far
    away is 14 % larger. Images are 128 x 128 as in the paper. The left camera is 0.1 m higher than
    the right: were they equally high, swapped cables would go unnoticed, as lines of sight then
    meet as well.
    """
    cameras = tuple(
        Camera(
            width=128,
            height=128,
            f_px=220.0,
            cu=63.5,
            cv=63.5,
            T_world_cam=look_at(
                np.array((-1.8, side * 1.245, side * 0.05 - 0.9)),
                np.array((2.7, side * -0.3, side * 0.05 + 0.45)),
            ),
        )
        for side in (1.0, -1.0)
    )
    return Rig(cameras=cameras)
