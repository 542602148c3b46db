"""Drawing solids on a floor by casting rays: exact outlines, soft shadows, no graphics library.

A bound on the image keeps most rays from most solids. Light: a sun a little wide, so that shadows
are soft, a pale sky, and a gloss (Blinn 1977).
"""

from math import floor as round_down
from math import sqrt
from typing import NamedTuple

import numpy as np

from mitt.jit import kernel
from mitt.signals import Array, Image
from mitt.world.solids import FAR, Solids, meet, shades

#: Direction of the sun and its half-width.
_SUN, _SUN_WIDTH = (0.35, -0.50, 0.79), 0.08
_SUN_LIGHT, _SKY_LIGHT, _GLOSS = 0.78, 0.34, 0.22
#: Spacing of the floor's grid and half-width of its lines [m]; distance of its haze [m].
_GRID, _LINE, _HAZE = 0.5, 0.006, 9.0
#: Colours in linear light: floor, lines, sky above the horizon.
_FLOOR, _LINES, _SKY = (0.80, 0.81, 0.83), (0.58, 0.61, 0.65), (0.93, 0.965, 1.0)
_GAMMA = 2.2
#: Turn from one sample's place on the sun to the next: the golden angle [rad].
_GOLDEN = 2.399963


class Lens(NamedTuple):
    """The camera: position [m], axes right, down, forward as rows (3, 3), focal length [px]."""

    eye: Array
    axes: Array
    focal: float


class Work(NamedTuple):
    """Buffers of one ray, each of shape (3,)."""

    ray: Array
    normal: Array
    point: Array
    sun: Array
    scratch: Array
    colour: Array


@kernel
def render(image: Image, lens: Lens, solids: Solids, floor_z: float, samples: int) -> None:
    """Draw solids on a floor.

    Args:
        image: Result, shape (height, width, 3).
        lens: The camera.
        solids: What is drawn.
        floor_z: Height of the floor [m].
        samples: Rays a pixel along each axis.
    """
    height, width = image.shape[0], image.shape[1]
    count = samples * samples
    work = Work(np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3), np.empty(3))
    total = np.empty(3)
    for v in range(height):
        sky = 0.80 + 0.16 * v / height
        for u in range(width):
            total[:] = 0.0
            # Jimenez 2014: noise that the eye, and the mean over a few pixels, does not see.
            dither = (52.9829189 * ((0.06711056 * u + 0.00583715 * v) % 1.0)) % 1.0
            for s in range(count):
                x = u + (s % samples + 0.5) / samples - 0.5 * width
                y = v + (s // samples + 0.5) / samples - 0.5 * height
                depth, nearest = _look(lens, solids, floor_z, x, y, u, v, work)
                _turn_sun((s + 0.5) / count, _GOLDEN * s + 2.0 * np.pi * dither, work.sun)
                _light(lens, solids, depth, nearest, sky, work)
                total += work.colour
            for i in range(3):
                level = min(max(total[i] / count, 0.0), 1.0) ** (1.0 / _GAMMA)
                image[v, u, i] = np.uint8(255.0 * level + 0.5)


@kernel
def _look(
    lens: Lens, solids: Solids, floor_z: float, x: float, y: float, u: int, v: int, work: Work
) -> tuple[float, int]:
    """Cast a ray through (x, y) of pixel (u, v); return its length and the solid, -1: floor."""
    ray, normal = work.ray, work.normal
    for i in range(3):
        ray[i] = lens.axes[0, i] * x + lens.axes[1, i] * y + lens.axes[2, i] * lens.focal
    ray /= sqrt(ray[0] ** 2 + ray[1] ** 2 + ray[2] ** 2)
    depth, nearest = FAR, -1
    if ray[2] < -1e-9 and lens.eye[2] > floor_z:
        depth = (floor_z - lens.eye[2]) / ray[2]
        normal[0], normal[1], normal[2] = 0.0, 0.0, 1.0
    for k in range(solids.kind.shape[0]):
        left, right, top, bottom = solids.boxes[k]
        if left <= u <= right and top <= v <= bottom:
            t = meet(solids, k, lens.eye, ray, work.scratch)
            if t < depth:
                depth, nearest = t, k
                normal[:] = work.scratch
    return depth, nearest


@kernel
def _turn_sun(share: float, turn: float, sun: Array) -> None:
    """Write the direction of one place on the sun's disc."""
    wide = _SUN_WIDTH * sqrt(share)
    sun[0], sun[1], sun[2] = _SUN[0] + wide * np.cos(turn), _SUN[1] + wide * np.sin(turn), _SUN[2]
    sun /= sqrt(sun[0] ** 2 + sun[1] ** 2 + sun[2] ** 2)


@kernel
def _light(lens: Lens, solids: Solids, depth: float, nearest: int, sky: float, work: Work) -> None:
    """Write the light that comes along the ray just cast."""
    colour, n, point, sun = work.colour, work.normal, work.point, work.sun
    if depth >= FAR:
        for i in range(3):
            colour[i] = _SKY[i] * sky
        return
    for i in range(3):
        point[i] = lens.eye[i] + depth * work.ray[i] + 1e-4 * n[i]
    facing = n[0] * sun[0] + n[1] * sun[1] + n[2] * sun[2]
    lit = facing > 0.0 and not shades(solids, point, sun, work.scratch)
    light = _SKY_LIGHT * (0.62 + 0.38 * n[2]) + (_SUN_LIGHT * facing if lit else 0.0)
    if nearest < 0:
        _floor_colour(point[0], point[1], colour)
        haze = 1.0 - np.exp(-((depth / _HAZE) ** 3))
        for i in range(3):
            colour[i] = colour[i] * light * (1.0 - haze) + haze * _SKY[i] * sky
        return
    half = work.scratch
    for i in range(3):
        half[i] = sun[i] - work.ray[i]
    cosine = (n[0] * half[0] + n[1] * half[1] + n[2] * half[2]) / sqrt(
        half[0] ** 2 + half[1] ** 2 + half[2] ** 2
    )
    gloss = _GLOSS * max(cosine, 0.0) ** 40 if lit else 0.0
    for i in range(3):
        colour[i] = solids.rgb[nearest, i] * light + gloss


@kernel
def _floor_colour(x: float, y: float, out: Array) -> None:
    """Write the colour of the floor: near white, with a thin grid."""
    u, v = x / _GRID, y / _GRID
    off = min(abs(u - round_down(u + 0.5)), abs(v - round_down(v + 0.5))) * _GRID
    for i in range(3):
        out[i] = _LINES[i] if off < _LINE else _FLOOR[i]
