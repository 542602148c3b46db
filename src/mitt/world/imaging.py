"""What the image sensors give: a bright ball on a grey ground, with the noise of photons.

The outline of a sphere is the cone of rays that touch it, cut by the image plane: exactly an
ellipse. Each pixel row is cut into ``SUBROWS`` lines; along a line the covered interval follows
from a quadratic, so coverage is exact across columns and a midpoint rule down the rows.
Noise comes from banks drawn once; each frame starts at an offset drawn from the generator (a
fresh normal image costs fifty times as much: performance.md, section 5).
"""

from dataclasses import dataclass
from math import ceil, floor, sqrt

import numpy as np
from numba import njit

from mitt.errors import InputError
from mitt.signals import Array, Frame, Image
from mitt.vision.camera import Rig

SUBROWS = 16
"""Lines a pixel row; the centroid of a 1 px disc is then that of exact areas to 0.005 px."""

_BANK_SIZE = 1 << 20


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageSensor:
    """Settings of the image sensors; the exposure is short, so nothing smears.

    The defaults give 3.2 grey levels of noise on the ball and 2.2 on the ground, a signal to
    noise ratio of 50: a fast sensor with some gain.

    Attributes:
        brightness: Grey levels of the ball above the ground, without noise.
        background: Grey level of the ground.
        read_noise: Standard deviation of the Gaussian read noise [grey levels].
        electrons: Photo-electrons a grey level; shot noise has the variance value / electrons.
    """

    brightness: float = 160.0
    background: float = 24.0
    read_noise: float = 2.0
    electrons: float = 30.0

    def __post_init__(self) -> None:
        """Refuse values that no 8-bit sensor has."""
        values = {
            "brightness": self.brightness,
            "background": self.background,
            "read_noise": self.read_noise,
            "electrons": self.electrons,
        }
        for name, value in values.items():
            if not 0.0 <= value < float("inf"):
                raise InputError(name, "a finite number, not negative", value)
        if self.electrons == 0.0 or self.background + self.brightness > 255.0:
            raise InputError(
                "image sensor", "electrons > 0 and background + brightness <= 255", self
            )


@njit(cache=True)
def chord(x: float, y: float, z: float, D: float, b: float, out: Array) -> bool:
    """Write the interval of image abscissae x/z covered on the line y/z = ``b``.

    A ray (a, b, 1) meets the ball where ((a, b, 1) . c)^2 >= (a^2 + b^2 + 1) D.

    Args:
        x: Ball centre c in the optical frame [m], as ``y`` and ``z``.
        y: See ``x``.
        z: See ``x``.
        D: |c|^2 minus the squared radius [m^2].
        b: Ordinate of the line [1].
        out: Result, shape (2,).

    Returns:
        Whether the line meets the outline.
    """
    A = D - x * x
    s = b * y + z
    disc = x * x * s * s + A * (s * s - (b * b + 1.0) * D)
    if disc <= 0.0:
        return False
    root = sqrt(disc)
    out[0] = (x * s - root) / A
    out[1] = (x * s + root) / A
    return True


@njit(cache=True)
def cover(coverage: Array, row: int, lens: Array, ball: Array, ends: Array) -> tuple[int, int]:
    """Write the covered share of each pixel of one row; return the first and last column touched.

    Args:
        coverage: Result, zero outside the columns returned [1], shape (width,).
        row: Row of the image.
        lens: f_px, cu, cv [px], shape (3,).
        ball: Centre in the optical frame and radius [m], shape (4,).
        ends: Scratch, shape (2,).
    """
    x, y, z = ball[0], ball[1], ball[2]
    D = x * x + y * y + z * z - ball[3] * ball[3]
    width = coverage.shape[0]
    first, last = width, -1
    for sub in range(SUBROWS):
        b = (row - 0.5 + (sub + 0.5) / SUBROWS - lens[2]) / lens[0]
        if not chord(x, y, z, D, b, ends):
            continue
        left = max(ends[0] * lens[0] + lens[1], -0.5)
        right = min(ends[1] * lens[0] + lens[1], width - 0.5)
        if right <= left:
            continue
        u0, u1 = int(floor(left + 0.5)), min(int(floor(right + 0.5)), width - 1)  # noqa: RUF046
        for u in range(u0, u1 + 1):
            part = min(right, u + 0.5) - max(left, u - 0.5)
            coverage[u] += max(part, 0.0) / SUBROWS
        first, last = min(first, u0), max(last, u1)
    return first, last


@njit(cache=True)
def draw_ball(
    pixels: Image, lens: Array, ball: Array, light: Array, noise: Array, work: Array
) -> None:
    """Draw a ball over an image of the ground.

    Args:
        pixels: Image, overwritten where the ball is, shape (height, width).
        lens: f_px, cu, cv [px], shape (3,).
        ball: Centre in the optical frame and radius [m], shape (4,).
        light: Brightness, background and read noise [grey levels], electrons a level, shape (4,).
        noise: Standard normal numbers, at least as many as the ball has pixels, shape (n,).
        work: Scratch, its first ``width`` numbers zero at entry and exit, shape (width + 2,).
    """
    height, width = pixels.shape
    y, z, R = ball[1], ball[2], ball[3]
    if z <= R * 1.001:
        return
    side = R * sqrt(y * y + z * z - R * R)
    low = lens[2] + lens[0] * (y * z - side) / (z * z - R * R)
    high = lens[2] + lens[0] * (y * z + side) / (z * z - R * R)
    first_row = int(min(max(floor(low), 0.0), float(height)))
    last_row = int(min(max(ceil(high), -1.0), float(height - 1)))
    next_noise = 0
    coverage, ends = work[:width], work[width:]
    for row in range(first_row, last_row + 1):
        first, last = cover(coverage, row, lens, ball, ends)
        for u in range(first, last + 1):
            mean = light[1] + light[0] * coverage[u]
            sigma = sqrt(light[2] * light[2] + mean / light[3])
            value = mean + sigma * noise[next_noise]
            pixels[row, u] = np.uint8(min(max(value + 0.5, 0.0), 255.0))
            coverage[u] = 0.0
            next_noise = next_noise + 1 if next_noise + 1 < noise.shape[0] else 0


@njit(cache=True)
def _draw_in_world(
    pixels: Image,
    pose: Array,
    lens: Array,
    r_o: Array,
    radius: float,
    light: Array,
    noise: Array,
    work: Array,
) -> None:
    """Draw a ball given in the world [m]; ``pose`` holds rotation rows and centre, shape (4, 3)."""
    ball = work[-4:]
    for i in range(3):
        ball[i] = (
            pose[0, i] * (r_o[0] - pose[3, 0])
            + pose[1, i] * (r_o[1] - pose[3, 1])
            + pose[2, i] * (r_o[2] - pose[3, 2])
        )
    ball[3] = radius
    if np.isfinite(ball[0] + ball[1] + ball[2]):
        draw_ball(pixels, lens, ball, light, noise, work[:-4])


class Imager:
    """The cameras of a rig as sensors: renders one ``Frame`` a camera at each call."""

    def __init__(self, rig: Rig, sensor: ImageSensor, rng: np.random.Generator) -> None:
        """Draw the noise banks.

        Args:
            rig: Cameras to see with.
            sensor: Light and noise.
            rng: Source of the banks and of every frame's offset into them.
        """
        self._cameras = rig.cameras
        self._lenses = [np.array((c.f_px, c.cu, c.cv)) for c in rig.cameras]
        self._light = np.array(
            (sensor.brightness, sensor.background, sensor.read_noise, sensor.electrons)
        )
        sigma = sqrt(sensor.read_noise**2 + sensor.background / sensor.electrons)
        self._noise = rng.standard_normal(_BANK_SIZE)
        level = np.rint(sensor.background + sigma * self._noise)
        self._ground = np.clip(level, 0.0, 255.0).astype(np.uint8)
        self._poses = [np.vstack((c.rotation, c.centre)) for c in rig.cameras]
        self._work = [np.zeros(c.width + 6) for c in rig.cameras]
        self._rng = rng
        self._number = 0
        self._starts: list[list[int]] = []

    def render(self, t: float, r_o: Array | None, radius: float) -> tuple[Frame, ...]:
        """Return what the cameras see at ``t``.

        Args:
            t: Middle of the exposure [s].
            r_o: Ball centre [m], shape (3,); None for an empty scene.
            radius: Ball radius [m].
        """
        frames = []
        for index, camera in enumerate(self._cameras):
            size = camera.height * camera.width
            start, ball_start = self._next_starts(size)
            ground = self._ground[start : start + size]
            pixels = ground.reshape(camera.height, camera.width).copy()
            if r_o is not None:
                _draw_in_world(
                    pixels,
                    self._poses[index],
                    self._lenses[index],
                    r_o,
                    radius,
                    self._light,
                    self._noise[ball_start:],
                    self._work[index],
                )
            frames.append(Frame(t=t, camera=index, number=self._number, pixels=pixels))
        self._number += 1
        return tuple(frames)

    def _next_starts(self, size: int) -> list[int]:
        """Return offsets into the ground's and the ball's bank, drawn in blocks."""
        if not self._starts:
            self._starts = self._rng.integers(0, _BANK_SIZE - size, size=(512, 2)).tolist()
        return self._starts.pop()
