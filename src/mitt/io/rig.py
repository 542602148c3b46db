"""RIG.toml: the cameras as calibrated, in a file that people can read (docs/rig.md)."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from mitt.core.errors import FileError, MittError
from mitt.core.eyes.camera import MOST_READOUT, Rig, applied, rotation_by_vector
from mitt.core.eyes.lens import Lens
from mitt.core.signals import Array
from mitt.io.reading import read_toml
from mitt.io.schema import FileSection, parsed
from mitt.io.writing import write_text

SCHEMA = "mitt.rig/1"

_WANTED = "TOML as mitt calibrate writes it"
_OTHERS = (
    "files of Kalibr and OpenCV are not read: write K, distortion and pose of each camera"
    " (the inverse of what they give, in m) into a RIG.toml, docs/rig.md, or run mitt"
    " calibrate"
)
"""What to do with a calibration of another program."""
#: Numbers of cameras [m, px, 1], and times [s]: no rig and no clock has larger ones.
Finite = Annotated[float, Field(ge=-1e6, le=1e6)]
Time = Annotated[float, Field(ge=-1e10, le=1e10)]
Three = tuple[Finite, Finite, Finite]
Four = tuple[Finite, Finite, Finite, Finite]
Place = Literal["camera", "board", "robot"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HeadAxes:
    """A camera on two axes.

    Attributes:
        T_world_cam: Pose at both encoders' zero [m], shape (4, 4).
        pan_axis: Direction [1], shape (3,), in the world, of the axis that carries the other.
        pan_point: A point on it [m], shape (3,).
        tilt_axis: Direction [1], shape (3,), in the world at pan zero.
        tilt_point: A point on it [m], shape (3,).
    """

    T_world_cam: Array
    pan_axis: Array
    pan_point: Array
    tilt_axis: Array
    tilt_point: Array

    def pose(self, pan: float, tilt: float) -> Array:
        """Return T_world_cam, shape (4, 4), at head angles [rad]."""
        first = _about(self.pan_axis, self.pan_point, pan)
        return np.asarray(first @ _about(self.tilt_axis, self.tilt_point, tilt) @ self.T_world_cam)

    def seen_from(self, T: Array) -> "HeadAxes":
        """Return the head in another world: p_new = T @ p_old, shape (4, 4)."""
        R = T[:3, :3]
        return HeadAxes(
            T_world_cam=T @ self.T_world_cam,
            pan_axis=R @ self.pan_axis,
            pan_point=applied(T, self.pan_point[None])[0],
            tilt_axis=R @ self.tilt_axis,
            tilt_point=applied(T, self.tilt_point[None])[0],
        )


def _about(axis: Array, point: Array, angle: float) -> Array:
    """Return the turn by an angle [rad] about a line, shape (4, 4)."""
    T = np.eye(4)
    T[:3, :3] = rotation_by_vector(axis * angle)
    T[:3, 3] = point - T[:3, :3] @ point
    return T


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RigCamera:
    """A camera as calibrated.

    Attributes:
        name: Name of the camera, as left.
        lens: Lens and size of the image.
        T_world_cam: Pose of the optical frame [m], shape (4, 4); of a head, at encoder zero.
        rms_px: Reprojection error that calibration left [px].
        head: Axes of the head that carries it; None for a camera that stands still.
        readout: Time from the exposure of the first row to that of the last [s].
    """

    name: str
    lens: Lens
    T_world_cam: Array
    rms_px: float
    head: HeadAxes | None = None
    readout: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CalibratedRig:
    """Cameras that see the same scene.

    Attributes:
        frame: What the poses refer to: the first camera, a level board with z up, or the robot.
        cameras: In the order left, right.
        clock_offset: Arm's clock minus cameras' clock [s]; None if unknown.
        clock_sigma: Its standard deviation [s].
    """

    frame: Place
    cameras: tuple[RigCamera, ...]
    clock_offset: float | None = None
    clock_sigma: float = 0.0

    def rig(self) -> Rig:
        """Return the cameras without distortion that ``Lens.straighten`` maps to."""
        plain = [(c.lens.pinhole(c.T_world_cam), c.readout) for c in self.cameras]
        return Rig(cameras=tuple(replace(camera, readout=readout) for camera, readout in plain))

    def seen_from(self, T: Array, frame: Place) -> "CalibratedRig":
        """Return the rig in another frame: p_new = T @ p_old, shape (4, 4)."""
        moved = []
        for c in self.cameras:
            head = None if c.head is None else c.head.seen_from(T)
            moved.append(replace(c, T_world_cam=T @ c.T_world_cam, head=head))
        return replace(self, frame=frame, cameras=tuple(moved))


class _Head(FileSection):
    """Axes of a head, in the world.

    Attributes:
        pan_axis: Direction of the axis that carries the tilt axis.
        pan_point: A point on it [m].
        tilt_axis: Direction of the tilt axis, at pan zero.
        tilt_point: A point on it [m].
    """

    pan_axis: Three
    pan_point: Three
    tilt_axis: Three
    tilt_point: Three


class _Camera(FileSection):
    """A camera as calibrated.

    Attributes:
        name: ``left`` or ``right``.
        width: Columns [px].
        height: Rows [px].
        K: ``[[fu, 0, cu], [0, fv, cv], [0, 0, 1]]`` [px].
        distortion: k1, k2, p1, p2, k3 (Brown-Conrady, ``mitt.core.eyes.lens``).
        T_world_cam: Pose, p_world = T_world_cam p_cam [m]; of a head, at both encoders' zero.
        rms_px: Reprojection error that calibration left [px].
        readout_s: Time from the exposure of the first row to that of the last [s], of a rolling
            shutter whose images are stamped with the time of the middle row; 0 for a global one.
            The camera's data sheet has it: the time a row, times the rows.
        head: Of a camera on a head: its axes.
    """

    name: str = Field(pattern=r"^[A-Za-z0-9_-]{1,40}$")
    width: int = Field(ge=8, le=100_000)
    height: int = Field(ge=8, le=100_000)
    K: tuple[Three, Three, Three]
    distortion: tuple[Finite, Finite, Finite, Finite, Finite]
    T_world_cam: tuple[Four, Four, Four, Four]
    rms_px: float = Field(ge=0.0, le=1e3)
    readout_s: float = Field(default=0.0, ge=0.0, le=MOST_READOUT)
    head: _Head | None = None

    @model_validator(mode="after")
    def _plain(self) -> Self:
        """Refuse skew and a last row that no camera matrix or pose has."""
        (_, skew, _), (zero, _, _), last = self.K
        if (skew, zero, *last) != (0.0, 0.0, 0.0, 0.0, 1.0):
            raise ValueError("a K of [[fu, 0, cu], [0, fv, cv], [0, 0, 1]]")
        if self.T_world_cam[3] != (0.0, 0.0, 0.0, 1.0):
            raise ValueError("[0, 0, 0, 1] as last row of T_world_cam")
        return self


class _Clock(FileSection):
    """The clocks of arm and cameras.

    Attributes:
        offset_s: Arm's clock minus cameras' clock [s].
        sigma_s: Its standard deviation [s].
    """

    offset_s: Time
    sigma_s: float = Field(ge=0.0, le=1e3)


class RigFile(FileSection):
    """All that a rig's file says.

    Attributes:
        schema_name: Schema of the file.
        version: Version of mitt that wrote it.
        frame: What the poses refer to: ``camera`` (the left one), ``board`` (level, z up) or
            ``robot`` (world frame).
        clock: The clocks; left out where they are not known.
        camera: A table ``[[camera]]`` for each.
    """

    schema_name: Literal["mitt.rig/1"] = Field(alias="schema")
    version: str
    frame: Place
    clock: _Clock | None = None
    camera: list[_Camera] = Field(min_length=1, max_length=16)


def read_rig(path: Path) -> CalibratedRig:
    """Return the rig that a file describes.

    Raises:
        FileError: The file is missing, cut short, of another schema, or no rig can be so.
    """
    try:
        raw = read_toml(path, wanted=_WANTED)
    except FileError as error:
        do = _OTHERS if error.wanted == _WANTED else ""
        raise FileError(str(path), error.wanted, error.given, do=do) from None
    content = parsed(
        RigFile, raw, place=str(path), wanted=f"a rig of schema {SCHEMA}", do="see docs/rig.md"
    )
    try:
        return _checked(content)
    except MittError as error:
        raise FileError(str(path), "a rig that can be", error) from error


def _checked(content: RigFile) -> CalibratedRig:
    """Build the rig; refuse poses that are none and eyes in one place."""
    cameras = tuple(_camera(c) for c in content.camera)
    names = [c.name for c in cameras]
    if len(set(names)) < len(names):
        raise FileError("camera names", "all different", ", ".join(names))
    rig = CalibratedRig(frame=content.frame, cameras=cameras)
    if content.clock is not None:
        offset, sigma = content.clock.offset_s, content.clock.sigma_s
        rig = replace(rig, clock_offset=offset, clock_sigma=sigma)
    rig.rig()  # refuses poses that are no rigid transform
    for a, b in pairwise(cameras):
        base = float(np.linalg.norm(a.T_world_cam[:3, 3] - b.T_world_cam[:3, 3]))
        if base < 1e-3:
            raise FileError("cameras", "a base line of 1 mm or more", f"{1e3 * base:.3f} mm")
    return rig


def _camera(c: _Camera) -> RigCamera:
    """Return one camera."""
    (fu, _, cu), (_, fv, cv), _ = c.K
    head = None
    if c.head is not None:
        lines = {name: np.array(value) for name, value in c.head.model_dump().items()}
        for name in ("pan_axis", "tilt_axis"):
            if abs(float(np.linalg.norm(lines[name])) - 1.0) > 1e-6:
                raise FileError(f"{c.name} {name}", "a direction of length 1", c.head)
        head = HeadAxes(T_world_cam=np.array(c.T_world_cam), **lines)
    numbers = np.array((fu, fv, cu, cv, *c.distortion))
    lens, T = Lens(width=c.width, height=c.height, numbers=numbers), np.array(c.T_world_cam)
    return RigCamera(
        name=c.name,
        lens=lens,
        T_world_cam=T,
        rms_px=c.rms_px,
        head=head,
        readout=c.readout_s,
    )


def write_rig(path: Path, rig: CalibratedRig, *, version: str) -> None:
    """Write a rig atomically."""
    lines = [
        "# Cameras as mitt calibrate found them; docs/rig.md says what each key means.",
        f'schema = "{SCHEMA}"',
        f'version = "{version}"',
        f'frame = "{rig.frame}"',
    ]
    if rig.clock_offset is not None:
        clock = {"offset_s": rig.clock_offset, "sigma_s": rig.clock_sigma}
        lines += ["", "[clock]", *_lines(clock)]
    for c in rig.cameras:
        fu, fv, cu, cv = c.lens.numbers[:4]
        K = np.array(((fu, 0.0, cu), (0.0, fv, cv), (0.0, 0.0, 1.0)))
        lines += [
            "",
            "[[camera]]",
            f'name = "{c.name}"',
            f"width = {c.lens.width}",
            f"height = {c.lens.height}",
        ]
        values: dict[str, float | Array] = {
            "K": K,
            "distortion": c.lens.numbers[4:],
            "T_world_cam": c.T_world_cam,
            "rms_px": c.rms_px,
        }
        if c.readout > 0.0:
            values["readout_s"] = c.readout
        lines += _lines(values)
        if c.head is not None:
            h = c.head
            axes = {
                "pan_axis": h.pan_axis,
                "pan_point": h.pan_point,
                "tilt_axis": h.tilt_axis,
                "tilt_point": h.tilt_point,
            }
            lines += ["", "[camera.head]", *_lines(axes)]
    write_text(path, "\n".join(lines) + "\n")


def _lines(values: Mapping[str, float | Array]) -> list[str]:
    """Return a TOML line for each key."""
    return [f"{key} = {_text(value)}" for key, value in values.items()]


def _text(value: float | Array) -> str:
    """Return a number, a list or a matrix in TOML, every digit that it has."""
    if isinstance(value, np.ndarray) and value.ndim == 2:
        return "[\n" + "".join(f"    {_text(row)},\n" for row in value) + "]"
    if isinstance(value, np.ndarray):
        return "[" + ", ".join(repr(float(x)) for x in value) + "]"
    return repr(float(value))
