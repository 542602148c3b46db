"""Images of a plainer kind of truth: shaded arm, moving light, patterns, a lens that blurs.

Everything is painted without noise on a canvas of real numbers, balls and capsules in the order
of their depth; then come the lens, the light and the noise of the sensor. ``exposure`` uses it
where its own faster way, without any of this, will not do.

| here     | meaning                                                          | unit   | shape     |
|----------|------------------------------------------------------------------|--------|-----------|
| canvas   | an image without noise                                           | levels | (h, w)    |
| capsules | as in :mod:`mitt.world.capsules`, then 1 for the hand, else 0    |        | (k, 8)    |
| light    | a :class:`Light`                                                 |        |           |
| window   | first and last row, first and last column                        | px     | 4         |
"""

from math import pi, sin
from typing import NamedTuple

import numpy as np

from mitt.jit import kernel
from mitt.signals import Array, Image
from mitt.views import view
from mitt.world.capsules import Camera, Edges, Point, Seen, in_front, into, misses, seen_from
from mitt.world.noise import PERIOD
from mitt.world.outline import blend_ball
from mitt.world.shading import Canvas, paint_capsule


class Light(NamedTuple):
    """Light, noise and lens, a number each.

    Attributes:
        read_noise: Of the sensor [levels].
        electrons: A grey level.
        body, hand: Grey levels of arm and hand.
        shading, grain: Relative to these levels [1].
        blur: Of the lens, 1 sigma [px].
        amplitude, frequency, phase: Of the illumination: relative [1], [Hz], [rad].
        shadow: Relative depth of a shadow [1].
        shadow_speed, shadow_start: Of its edge: speed [px/s], column at time zero [px].
        painted: Whether images are painted.
    """

    read_noise: float
    electrons: float
    body: float
    hand: float
    shading: float
    grain: float
    blur: float
    amplitude: float
    frequency: float
    phase: float
    shadow: float
    shadow_speed: float
    shadow_start: float
    painted: bool


EDGE = 24.0
"""Width of the shadow's soft edge [px]."""
WIDEST = 9
"""Pixels that the blur of a lens reaches at most."""


@kernel
def _hang(canvas: Canvas, turn: Point, wall: Image, window: Edges) -> None:
    """Fill a window with the wall, which turns with the camera; see ``exposure``."""
    f, pan, tilt = turn
    column, row = np.uint64(round(f * pan) % PERIOD), np.uint64(round(-f * tilt) % PERIOD)
    for v in range(np.uint64(window[0]), np.uint64(window[1] + 1)):  # none counts from the end
        for u in range(np.uint64(window[2]), np.uint64(window[3] + 1)):
            canvas[v, u] = np.float32(wall[row + v, column + u])


@kernel
def _soften(canvas: Canvas, other: Canvas, sigma: float, wide: Edges, window: Edges) -> None:
    """Blur a window by a Gaussian; ``wide`` is the window and what the blur reaches beyond it."""
    height, width, reach = canvas.shape[0], canvas.shape[1], wide_of(sigma)
    left, right = np.uint64(window[2]), np.uint64(window[3] + 1)
    total = 0.0
    for k in range(-reach, reach + 1):
        total += np.exp(-0.5 * (k / sigma) ** 2)
    for v in range(np.uint64(wide[0]), np.uint64(wide[1] + 1)):
        for u in range(left, right):
            other[v, u] = np.float32(0.0)
    for k in range(-reach, reach + 1):
        weight = np.float32(np.exp(-0.5 * (k / sigma) ** 2) / total)
        first, last = max(window[2], -k), min(window[3], width - 1 - k)
        for v in range(np.uint64(wide[0]), np.uint64(wide[1] + 1)):
            for u in range(np.uint64(first), np.uint64(last + 1)):
                other[v, u] += weight * canvas[v, u + np.uint64(k)]
            for u in range(left, np.uint64(max(first, window[2]))):
                other[v, u] += weight * canvas[v, np.uint64(0)]
            for u in range(np.uint64(last + 1), right):
                other[v, u] += weight * canvas[v, np.uint64(width - 1)]
    for v in range(np.uint64(window[0]), np.uint64(window[1] + 1)):
        for u in range(left, right):
            canvas[v, u] = np.float32(0.0)
    for k in range(-reach, reach + 1):
        weight = np.float32(np.exp(-0.5 * (k / sigma) ** 2) / total)
        for v in range(window[0], window[1] + 1):
            line, row = np.uint64(v), np.uint64(min(max(v + k, 0), height - 1))
            for u in range(left, right):
                canvas[line, u] += weight * other[row, u]


@kernel
def wide_of(sigma: float) -> int:
    """Return how far the blur of a lens reaches [px]."""
    return min(int(np.ceil(3.0 * sigma)), WIDEST)


@kernel
def brightness(light: Light, t: float) -> float:
    """Return the illumination at an instant over its mean [1]."""
    return float(1.0 + light.amplitude * sin(2.0 * pi * light.frequency * t + light.phase))


@kernel
def _cast(canvas: Canvas, light: Light, t: float, window: Edges) -> None:
    """Cast the shadow on a window."""
    edge = light.shadow_start + light.shadow_speed * t
    for v in range(np.uint64(window[0]), np.uint64(window[1] + 1)):
        for u in range(np.uint64(window[2]), np.uint64(window[3] + 1)):
            into = 0.5 - (np.int64(u) - edge) / EDGE
            canvas[v, u] *= np.float32(1.0 - light.shadow * min(max(into, 0.0), 1.0))


@kernel
def _read_out(
    pixels: Image, canvas: Canvas, light: Light, t: float, normal: Array, start: int, window: Edges
) -> None:
    """Light a window, add read and shot noise, and round to bytes."""
    if light.shadow > 0.0:
        _cast(canvas, light, t, window)
    read, shot = np.float32(light.read_noise * light.read_noise), np.float32(1.0 / light.electrons)
    lit, half = np.float32(brightness(light, t)), np.float32(0.5)
    zero, top, width = np.float32(0.0), np.float32(255.0), np.uint64(pixels.shape[1])
    for v in range(np.uint64(window[0]), np.uint64(window[1] + 1)):
        at = np.uint64(start) + v * width
        for u in range(np.uint64(window[2]), np.uint64(window[3] + 1)):
            mean = lit * canvas[v, u]
            value = mean + np.sqrt(read + shot * mean) * np.float32(normal[at + u]) + half
            pixels[v, u] = np.uint8(min(max(value, zero), top))


@kernel
def _count_behind(seen: Seen, depths: Array) -> int:
    """Return how many balls a capsule is nearer than."""
    count = 0
    for k in range(depths.shape[0]):
        ball = depths[k, 0], depths[k, 1], depths[k, 2]
        count += np.isfinite(ball[0] + ball[1] + ball[2]) and in_front(seen, ball)
    return count


@kernel
def _paint_all(
    canvas: Canvas, begin: Camera, end: Camera, balls: Array, capsules: Array, light: Light,
    window: Edges, work: Array,
) -> None:  # fmt: skip
    """Paint capsules and balls, the far ones first."""
    lens, count = (begin[12], begin[13], begin[14]), balls.shape[0]
    order, centres = np.zeros(2, np.int64), np.empty((2, 3))
    for k in range(count):
        x, y, z = into(begin, balls[k, 0], balls[k, 1], balls[k, 2])
        centres[k, 0], centres[k, 1], centres[k, 2] = x, y, z
    order[0], order[1] = 0, count - 1
    if count == 2 and centres[1, 2] > centres[0, 2]:
        order[0], order[1] = 1, 0
    for stage in range(count + 1):
        for k in range(capsules.shape[0]):
            ahead, seen = seen_from(begin, capsules, k)
            if not ahead or misses(lens, seen, window):
                continue
            if _count_behind(seen, centres[:count]) == stage:
                level = light.hand if capsules[k, 7] > 0.0 else light.body
                style = light.shading, light.grain, 0.7 * k
                paint_capsule(canvas, lens, seen, level, style, window)
        if stage < count:
            b = order[stage]
            x1, y1, z1 = into(end, balls[b, 3], balls[b, 4], balls[b, 5])
            x, y, z = centres[b, 0], centres[b, 1], centres[b, 2]
            if np.isfinite(x + y + z + x1 + y1 + z1):
                ball = x, y, z, x1, y1, z1, balls[b, 6]
                blend_ball(canvas, lens, ball, balls[b, 7], window, work)


@kernel
def paint(
    pixels: Image, begin: Camera, end: Camera, turn: Point, balls: Array, capsules: Array,
    light: Light, t: float, wall: Image, normal: Array, start: int, window: Edges, work: Array,
    canvas: Canvas,
) -> None:  # fmt: skip
    """Draw what one camera sees.

    Args:
        pixels: Result, true within the window, shape (height, width).
        begin: Camera as the shutter opens, as in :mod:`mitt.world.capsules`.
        end: Camera as it closes.
        turn: f_px [px], pan and tilt [rad].
        balls: As in :mod:`mitt.world.exposure`, at most two.
        capsules: Arm and hand.
        light: Light and noise.
        t: Middle of the exposure [s].
        wall: The background.
        normal: Standard normal numbers, shape (c,).
        start: Where in them the image begins, which takes one number a pixel.
        window: What is drawn.
        work: Scratch, as of :func:`mitt.world.outline.draw_ball`.
        canvas: Scratch, two images, flat.
    """
    height, width = pixels.shape
    first, other = view(canvas, 0, (height, width)), view(canvas, height * width, (height, width))
    sigma = light.blur
    reach = wide_of(sigma) if sigma > 0.0 else 0
    wide = (
        max(window[0] - reach, 0), min(window[1] + reach, height - 1),
        max(window[2] - reach, 0), min(window[3] + reach, width - 1),
    )  # fmt: skip
    _hang(first, turn, wall, wide)
    _paint_all(first, begin, end, balls, capsules, light, wide, work)
    if reach > 0:
        _soften(first, other, sigma, wide, window)
    _read_out(pixels, first, light, t, normal, start, window)
