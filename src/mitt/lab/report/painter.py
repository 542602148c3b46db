"""Pictures of a scene, drawn in software: faces are painted from far to near, each in one shade.

| here    | meaning                                                          | unit | shape     |
|---------|------------------------------------------------------------------|------|-----------|
| corners | of triangles, counter-clockwise as seen from outside             | m    | (k, 3, 3) |
| colours | of triangles, 0 to 1                                             | 1    | (k, 3)    |
| pixels  | to the right, down, and the depth along the line of sight        | px, m | (..., 3) |
"""

import base64
import io
from dataclasses import dataclass, replace

import numpy as np
from PIL import Image, ImageDraw
from PIL.PngImagePlugin import PngInfo

from mitt.core.signals import Array

#: Colours of sky, floor, its lines, and shadows on it: of a middle lightness, so that a light arm
#: stands out, and the picture stands out on a white page and on a dark one.
_SKY = (150, 164, 181)
_FLOOR = (118, 132, 149)
_LINES = (137, 151, 168)
_SHADOW = (88, 100, 116)
#: Where the lines of the floor end, and their distance [m].
_X = (-6.0, 8.0)
_Y = (-4.0, 9.0)
_APART = 0.5
#: Where the floor has the colour of the sky [m].
_HAZE = 14.0
#: Direction to the light, and the share of light that comes from everywhere [1].
_LIGHT = np.array([-0.38, -0.5, 0.78])
_AMBIENT = 0.45
#: Pixels drawn for each pixel of the picture, in each direction; depth at which drawing begins [m].
_FINER = 2
_NEAREST = 0.05

Faces = tuple[Array, Array]
"""Corners of triangles [m], shape (k, 3, 3), and their colours, 0 to 1, shape (k, 3)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """Where a picture is taken from, with z up.

    Attributes:
        eye: Place of the camera [m].
        target: The point in the middle of the picture [m].
        angle: Height of the picture, as an angle [rad].
        size: Width and height [px].
    """

    eye: tuple[float, float, float]
    target: tuple[float, float, float]
    angle: float = 0.434
    size: tuple[int, int] = (340, 262)

    @property
    def focal(self) -> float:
        """Focal length [px]."""
        return float(0.5 * self.size[1] / np.tan(0.5 * self.angle))

    @property
    def axes(self) -> Array:
        """Directions to the right, down and ahead in the world, one a row, shape (3, 3)."""
        ahead = np.subtract(self.target, self.eye)
        ahead /= np.linalg.norm(ahead)
        right = np.array([ahead[1], -ahead[0], 0.0]) / np.hypot(ahead[0], ahead[1])
        return np.array([right, np.cross(ahead, right), ahead])

    def pixels(self, points: Array) -> Array:
        """Return where points [m], shape (..., 3), are in the picture, and their depth."""
        seen = (points - np.array(self.eye)) @ self.axes.T
        depth = np.maximum(seen[..., 2:], _NEAREST)
        return np.concatenate(
            [seen[..., :2] / depth * self.focal + 0.5 * np.array(self.size), seen[..., 2:]], axis=-1
        )


def seen_from(
    elevation: float, azimuth: float, target: tuple[float, float, float], distance: float = 3.6
) -> View:
    """Return the view of a point [m] from so far [m], elevation and azimuth to the eye in [deg]."""
    up, round_ = np.deg2rad(elevation), np.deg2rad(azimuth)
    way = np.array([np.cos(up) * np.cos(round_), np.cos(up) * np.sin(round_), np.sin(up)])
    x, y, z = (np.array(target) + distance * way).tolist()
    return View(eye=(x, y, z), target=target)


def framed(
    points: Array,
    elevation: float,
    azimuth: float,
    *,
    size: tuple[int, int],
    angle: float = 0.434,
    margin: float = 0.06,
) -> View:
    """Return the nearest view, from a direction, in which some points are, whatever its size.

    Args:
        points: What is to be seen [m], shape (k, 3).
        elevation: To the eye [deg].
        azimuth: To the eye [deg].
        size: Width and height [px].
        angle: Height of the picture, as an angle [rad].
        margin: Share of the picture that stays free at each side.
    """
    far = seen_from(elevation, azimuth, (0.0, 0.0, 0.0))
    right, down, ahead = far.axes
    at = np.array([points @ right, points @ down, points @ ahead])
    middle = 0.5 * (at.min(axis=1) + at.max(axis=1))
    half = (0.5 - margin) * np.array(size) / replace(far, angle=angle, size=size).focal
    aside = np.abs(at - middle[:, None])
    away = (aside[:2] / half[:, None]).max(axis=0) - (at[2] - middle[2])
    x, y, z = (middle @ far.axes).tolist()
    view = seen_from(elevation, azimuth, (x, y, z), float(max(away.max(), _NEAREST)))
    return replace(view, angle=angle, size=size)


#: Elevation and azimuth [deg]: from the side, a little from the thrower's end.
SIDE = (4.5, -85.5)
#: The arm and the last metre of the ball's way.
FROM_THE_SIDE = seen_from(*SIDE, (0.72, 0.0, 0.16))


def painted(
    corners: Array, colours: Array, floor: float, *, view: View = FROM_THE_SIDE
) -> Image.Image:
    """Return a picture of faces above a floor at some height [m], with their shadows on it."""
    width, height = (_FINER * x for x in view.size)
    image = Image.new("RGB", (width, height), _SKY)
    draw = ImageDraw.Draw(image)
    _paint_floor(draw, view, floor, image.size)
    ahead = corners[:, 0] - np.array(view.eye)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    light = _LIGHT / np.linalg.norm(_LIGHT)
    lit = np.maximum(normals @ light, 0.0)
    above = corners[(lit > 0.0) & (corners[:, :, 2].min(axis=1) > floor)]
    shadows = above - light * ((above[:, :, 2:] - floor) / light[2])
    _paint(draw, view, shadows, np.tile(_SHADOW, (len(shadows), 1)))
    facing = np.flatnonzero(np.sum(normals * ahead, axis=1) < 0.0)
    away = np.linalg.norm(corners[facing].mean(axis=1) - np.array(view.eye), axis=1)
    order = facing[np.argsort(-away)]
    shade = _AMBIENT + (1.0 - _AMBIENT) * lit[order, None]
    _paint(draw, view, corners[order], 255.0 * colours[order] * shade)
    return image.reduce(_FINER)


def _paint(draw: ImageDraw.ImageDraw, view: View, corners: Array, colours: Array) -> None:
    """Paint triangles, in their order, those that are in the picture; colours are 0 to 255."""
    at = view.pixels(corners)
    inside = at[:, :, 2].min(axis=1) > _NEAREST
    for axis, size in enumerate(view.size):
        inside &= (at[:, :, axis].max(axis=1) > 0.0) & (at[:, :, axis].min(axis=1) < size)
    flat = (_FINER * at[inside, :, :2]).reshape(-1, 6).tolist()
    inks = colours[inside].astype(np.int64) @ (1, 1 << 8, 1 << 16)  # as Pillow keeps a pixel
    for triangle, ink in zip(flat, inks.tolist(), strict=True):
        draw.polygon(triangle, fill=ink)


def _paint_floor(
    draw: ImageDraw.ImageDraw, view: View, floor: float, size: tuple[int, int]
) -> None:
    """Paint the floor from the horizon down, and the part of its lines that is before the eye."""
    ahead = np.array([*np.subtract(view.target, view.eye)[:2], 0.0])
    horizon = _FINER * float(view.pixels(np.array(view.eye) + ahead)[1])
    rows = np.arange(max(int(horizon) + 1, 0), size[1])
    away = _FINER * view.focal * (view.eye[2] - floor) / np.maximum(rows - horizon, 1.0)
    haze = np.minimum(away / _HAZE, 1.0)[:, None]
    shades = (haze * np.array(_SKY) + (1.0 - haze) * np.array(_FLOOR)).astype(int).tolist()
    for row, shade in zip(rows.tolist(), shades, strict=True):
        draw.line((0, row, size[0], row), fill=(shade[0], shade[1], shade[2]))
    xs, ys = np.arange(_X[0], _X[1] + 0.1, _APART), np.arange(_Y[0], _Y[1] + 0.1, _APART)
    ends = [[(x, y, floor) for y in _Y] for x in xs] + [[(x, y, floor) for x in _X] for y in ys]
    for line in np.array(ends):
        points = np.linspace(line[0], line[1], 60)
        at = view.pixels(points)
        before = at[at[:, 2] > _NEAREST, :2]
        if len(before) > 1:
            draw.line((_FINER * before).ravel().tolist(), fill=_LINES, width=_FINER)


def png_of(image: Image.Image) -> str:
    """Return a picture as PNG in base64."""
    out, about = io.BytesIO(), PngInfo()
    about.add_text("Software", "mitt")
    image.save(out, "PNG", pnginfo=about)
    return base64.b64encode(out.getvalue()).decode("ascii")
