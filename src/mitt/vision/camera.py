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
| ``cameras``     | for kernels: rotation in rows 0 to 2, centre in row 3,   | m    | (n, 5, 3) |
|                 | f_px, cu, cv in row 4                                    | px   |           |
"""

from dataclasses import dataclass, field
from math import pi

import numpy as np

from mitt import checks
from mitt.errors import InputError
from mitt.fields import brief
from mitt.jit import kernel
from mitt.signals import Array, all_of

_keep = object.__setattr__


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Camera:
    """A pinhole camera that does not move.

    Attributes:
        width: Columns [px].
        height: Rows [px].
        f_px: Focal length [px].
        cu: Column of the principal point [px].
        cv: Row of the principal point [px].
        T_world_cam: Pose of the optical frame in the world [m], shape (4, 4).
    """

    width: int
    height: int
    f_px: float
    cu: float
    cv: float
    T_world_cam: Array

    __repr__ = brief

    def __post_init__(self) -> None:
        """Refuse a camera that cannot see, or a pose that is no rigid transform."""
        T = checks.array("T_world_cam", self.T_world_cam, (4, 4))
        _keep(self, "T_world_cam", T)
        for side in ("width", "height"):
            _keep(self, side, checks.whole(f"camera.{side}", getattr(self, side)))
        for name in ("f_px", "cu", "cv"):
            _keep(self, name, checks.number(f"camera.{name}", getattr(self, name)))
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
    """A pan-tilt head that carries a camera; its kinematics: :mod:`mitt.vision.head`.

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
        arrays = {"T_world_base": (self.T_world_base, (4, 4)), "lens": (self.lens, (3,)),
                  "search": (self.search, (2,))}  # fmt: skip
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


def pack_cameras(rig: Rig) -> Array:
    """Return a rig as the array ``cameras`` of the module's table.

    Raises:
        InputError: There are fewer than two cameras.
    """
    if len(rig.cameras) < 2:
        raise InputError("rig", "at least two cameras", len(rig.cameras))
    return np.array([(*c.rotation, c.centre, (c.f_px, c.cu, c.cv)) for c in rig.cameras])


@kernel
def in_camera(camera: Array, r: Array) -> tuple[float, float, float]:
    """Return a place in the optical frame of a camera [m].

    Args:
        camera: A row of ``cameras``.
        r: The place in the world [m], shape (3,) or more.
    """
    x, y, z = 0.0, 0.0, 0.0
    for i in range(3):
        d = r[i] - camera[3, i]
        x += camera[i, 0] * d
        y += camera[i, 1] * d
        z += camera[i, 2] * d
    return x, y, z


@kernel
def sphere_centroid(
    lens: Array, place: tuple[float, float, float], radius: float, uv: Array
) -> None:
    """Write where the centroid of a ball's image lies.

    Args:
        lens: f_px, cu, cv [px], shape (3,).
        place: Ball centre in the optical frame [m], its depth greater than ``radius``.
        radius: Ball radius [m].
        uv: Result, column and row [px], shape (2,).
    """
    x, y, z = place
    stretch = 1.0 / (1.0 - radius * radius / (z * z))
    uv[0] = lens[1] + lens[0] * stretch * x / z
    uv[1] = lens[2] + lens[0] * stretch * y / z


@kernel
def project_ball(camera: Array, r: Array, radius: float, uv: Array) -> bool:
    """Write where in an image the centroid of a ball lies.

    Args:
        camera: A row of ``cameras``.
        r: Ball centre [m], shape (3,).
        radius: Ball radius [m].
        uv: Result, column and row [px], shape (2,); unchanged where there is none.

    Returns:
        Whether the ball is in front of the camera.
    """
    place = in_camera(camera, r)
    if not place[2] > 1.01 * radius:
        return False
    sphere_centroid(camera[4], place, radius, uv)
    return True


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
            width=128, height=128, f_px=220.0, cu=63.5, cv=63.5,
            T_world_cam=look_at(
                np.array((-1.8, side * 1.245, side * 0.05 - 0.9)),
                np.array((2.7, side * -0.3, side * 0.05 + 0.45)),
            ),
        )
        for side in (1.0, -1.0)
    )  # fmt: skip
    return Rig(cameras=cameras)
