"""How an image comes about: a wall, arm and hand, and bright balls, exposed with noise and smear.

All images of an instant are drawn in one call. Balls (``outline``) and capsules (``capsules``) are
painted without noise on a canvas of real numbers, the far ones first; then come the lens, the
light and the noise of the sensor. The wall turns with the camera, to whole pixels, and is as good
as infinitely far away; it does not smear, nor do arm and hand, which a rolling shutter does not
bend either.

| here    | meaning                                                           | unit   | shape  |
|---------|-------------------------------------------------------------------|--------|--------|
| canvas  | an image without noise                                            | levels | (h, w) |
| windows | part of each image that is drawn: first and last row, first and   | px     | (n, 4) |
|         | last column; beyond it nothing that counts is drawn               |        |        |
"""

from math import pi, sin
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from mitt.core.eyes.head import aim_one
from mitt.core.kernels import Record, big_kernel, kernel, view
from mitt.core.signals import Array, Image
from mitt.lab.world.capsules import (
    Camera,
    Canvas,
    Edges,
    Point,
    Seen,
    capsule_in_view,
    in_front,
    into,
    misses,
    paint_capsule,
)
from mitt.lab.world.outline import PaintScratch, paint_ball

Window: TypeAlias = NDArray[np.int64]

PERIOD = 1024
"""Side of the wall before it repeats [px]."""
_SHADOW_EDGE = 24.0
"""Width of the shadow's soft edge [px]; a choice of this project."""
_GRAIN_SHIFT = 0.7
"""Phase by which the grain of a capsule differs from that of the one before it [half periods]."""


class Optics(NamedTuple):
    """Light, noise and lens, a number each.

    Attributes:
        read_noise: Of the sensor [levels].
        electrons: A grey level.
        body, hand: Grey levels of arm and hand.
        shading, grain: Relative to these levels [1].
        blur: Of the lens, 1 sigma [px].
        amplitude, frequency, phase: Of the illumination as an exposure averages it: relative [1],
            [Hz], [rad].
        shadow: Relative depth of a shadow [1].
        shadow_speed, shadow_start: Of its edge: speed [px/s], column at time zero [px], of a camera
            that turns as it waits.
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


class PaintedBalls(NamedTuple):
    """The balls in view, at most two: one that is thrown and one that rolls.

    One whose place is not finite is left out.

    Attributes:
        level: Grey levels, shape (k,).
        radius: Radii [m], shape (k,).
        start, velocity: Centre as the first is released [m] and velocity [m/s] of those that roll,
            shape (k, 3).
        begin, end: Scratch, centres in the world as the shutter opens and closes [m], shape (k, 3).
        centre: Scratch, ``begin`` in the optical frame [m], shape (k, 3).
    """

    level: Array
    radius: Array
    start: Array
    velocity: Array
    begin: Array
    end: Array
    centre: Array


class Film(NamedTuple):
    """Cameras and what they see beside arm, hand and the thrown ball.

    Attributes:
        half: Half the exposure [s].
        heads: The heads, as in :mod:`mitt.core.eyes.head`; no rows for cameras that stand still.
        angles: Pan, tilt [rad] and their rates [rad/s] in the middle of the exposure, shape (n, 4).
        optics: Cameras as the shutter opens and closes, records of
            :data:`mitt.core.eyes.camera.CAMERA`, shape (n, 2); those on heads are overwritten.
        balls: The balls.
        light: Light, noise and lens.
        wall: The background as it would look without noise, two periods a side.
        normal: Standard normal numbers to read the noise from, shape (c,).
        work: Scratch for the widest image.
        canvas: Scratch, two images of the largest, flat.
        hot: Hot pixels: camera, row, column [px], and what they add [levels], shape (k, 4).
        readout: Time from the exposure of the first row to that of the last, 0 for a global
            shutter [s]; the middle one is exposed at the time of the image.
    """

    half: float
    heads: Record
    angles: Array
    optics: Record
    balls: PaintedBalls
    light: Optics
    wall: Image
    normal: NDArray[np.float32]
    work: PaintScratch
    canvas: NDArray[np.float32]
    hot: NDArray[np.int64]
    readout: float


class Exposure(NamedTuple):
    """The thrown ball, arm and hand in the middle of an exposure.

    Attributes:
        t: When that is [s].
        radius: Radius of the ball [m].
        r_o: Its centre [m], shape (3,); not finite for no ball.
        dr_o: Its velocity [m/s], shape (3,).
        capsules: Arm and hand, as in :mod:`mitt.lab.world.capsules`.
    """

    t: float
    radius: float
    r_o: Array
    dr_o: Array
    capsules: Array


@big_kernel
def render_images(
    images: tuple[Image, ...],
    film: Film,
    starts: NDArray[np.int64],
    shot: Exposure,
    windows: Window,
) -> None:
    """Place cameras and balls as the shutter opens and as it closes, and draw what is seen.

    Args:
        images: Results, one a camera, each shape (height, width).
        film: Cameras.
        starts: Where in ``film.normal`` the noise of each camera begins, shape (n,).
        shot: What is in view.
        windows: As in the module's table.
    """
    half, t, angles = film.half, shot.t, film.angles
    film.balls.radius[0] = shot.radius
    for n in range(len(angles)):
        pan, tilt, dpan, dtilt = angles[n]
        aim_one(film.heads[n], pan - half * dpan, tilt - half * dtilt, film.optics[n, 0])
        aim_one(film.heads[n], pan + half * dpan, tilt + half * dtilt, film.optics[n, 1])
    for n in range(len(images)):
        window = windows[n, 0], windows[n, 1], windows[n, 2], windows[n, 3]
        _place_balls(n, images[n].shape[0], film, shot)
        _draw(images[n], n, film, shot, window)
        turned = 0.0
        if len(angles) > 0:
            turned = film.heads[n].f_px * (angles[n, 0] - film.heads[n].pan)
        _read_out(images[n], film, t, starts[n], (turned, window))
        _heat(images[n], n, film.hot, window)


@kernel
def _place_balls(n: int, height: int, film: Film, shot: Exposure) -> None:
    """Write where the balls are as the n-th camera's shutter opens and closes on them.

    The rows of a rolling shutter are exposed one after the other: a ball when the row of its middle
    is. Its own rows are taken for one.
    """
    balls, half = film.balls, film.half
    for k in range(len(balls.level)):
        place, speed = (shot.r_o, shot.dr_o) if k == 0 else (balls.begin[k], balls.velocity[k])
        if k > 0:
            for i in range(3):
                place[i] = balls.start[k, i] + shot.t * speed[i]
        late = 0.0
        if film.readout > 0.0:
            camera = _camera(film.optics, n, 0)
            _, y, z = into(camera, place[0], place[1], place[2])
            row = camera[14] + camera[12] * y / z if z > 0.0 else 0.5 * (height - 1)
            late = film.readout * (min(max(row / (height - 1), 0.0), 1.0) - 0.5)
        for i in range(3):
            middle = place[i] + late * speed[i]
            balls.begin[k, i] = middle - half * speed[i]
            balls.end[k, i] = middle + half * speed[i]


@kernel
def _heat(pixels: Image, n: int, hot: NDArray[np.int64], window: Edges) -> None:
    """Add what its hot pixels have to a window of the n-th camera's image."""
    for k in range(len(hot)):
        v, u = hot[k, 1], hot[k, 2]
        inside = window[0] <= v <= window[1] and window[2] <= u <= window[3]
        if hot[k, 0] == n and inside:
            pixels[v, u] = np.uint8(min(pixels[v, u] + hot[k, 3], 255))


@kernel
def _draw(pixels: Image, n: int, film: Film, shot: Exposure, window: Edges) -> None:
    """Paint what the n-th camera sees on the canvas, as its lens shows it."""
    height, width = pixels.shape
    canvas = view(film.canvas, 0, (height, width))
    reach = _reach(film.light.blur) if film.light.blur > 0.0 else 0
    wide = (
        max(window[0] - reach, 0),
        min(window[1] + reach, height - 1),
        max(window[2] - reach, 0),
        min(window[3] + reach, width - 1),
    )
    pan, tilt = (film.angles[n, 0], film.angles[n, 1]) if len(film.angles) > 0 else (0.0, 0.0)
    _hang(canvas, film.wall, (film.optics[n, 0].f_px, pan, tilt), wide)
    _paint(canvas, _camera(film.optics, n, 0), _camera(film.optics, n, 1), film, shot, wide)
    if reach > 0:
        other = view(film.canvas, height * width, (height, width))
        _soften(canvas, other, film.light.blur, wide, window)


@kernel
def _camera(optics: Record, n: int, shut: int) -> Camera:
    """Return a camera as in :mod:`mitt.lab.world.capsules`, at begin (0) or end (1)."""
    o = optics[n, shut]
    R, c = o.R, o.centre
    return (
        R[0, 0],
        R[0, 1],
        R[0, 2],
        R[1, 0],
        R[1, 1],
        R[1, 2],
        R[2, 0],
        R[2, 1],
        R[2, 2],
        c[0],
        c[1],
        c[2],
        o.f_px,
        o.cu,
        o.cv,
    )


@kernel
def _hang(canvas: Canvas, wall: Image, turn: Point, window: Edges) -> None:
    """Fill a window with the wall, as a camera of f_px that is turned by pan and tilt sees it."""
    f, pan, tilt = turn
    column, row = np.uint64(round(f * pan) % PERIOD), np.uint64(round(-f * tilt) % PERIOD)
    for v in range(np.uint64(window[0]), np.uint64(window[1] + 1)):  # none counts from the end
        for u in range(np.uint64(window[2]), np.uint64(window[3] + 1)):
            canvas[v, u] = np.float32(wall[row + v, column + u])


@kernel
def _paint(
    canvas: Canvas, begin: Camera, end: Camera, film: Film, shot: Exposure, window: Edges
) -> None:
    """Paint capsules and balls, the far ones first."""
    balls, light, lens = film.balls, film.light, (begin[12], begin[13], begin[14])
    opens, shuts, centre, capsules = balls.begin, balls.end, balls.centre, shot.capsules
    count, work = len(centre), film.work
    for k in range(count):
        x, y, z = into(begin, opens[k, 0], opens[k, 1], opens[k, 2])
        centre[k, 0], centre[k, 1], centre[k, 2] = x, y, z
    farther = 1 if count == 2 and centre[1, 2] > centre[0, 2] else 0
    for drawn in range(count + 1):
        for k in range(capsules.shape[0]):
            ahead, seen = capsule_in_view(begin, capsules, k)
            if not ahead or misses(lens, seen, window):
                continue
            if _count_behind(seen, centre) == drawn:
                level = light.hand if capsules[k, 7] > 0.0 else light.body
                style = light.shading, light.grain, _GRAIN_SHIFT * k
                paint_capsule(canvas, lens, seen, level, style, window)
        if drawn < count:
            b = farther if drawn == 0 else 1 - farther
            x1, y1, z1 = into(end, shuts[b, 0], shuts[b, 1], shuts[b, 2])
            x, y, z = centre[b, 0], centre[b, 1], centre[b, 2]
            if np.isfinite(x + y + z + x1 + y1 + z1):
                ball = x, y, z, x1, y1, z1, balls.radius[b]
                paint_ball(canvas, lens, ball, balls.level[b], window, work)


@kernel
def _count_behind(seen: Seen, centre: Array) -> int:
    """Return how many balls a capsule is nearer than."""
    count = 0
    for k in range(centre.shape[0]):
        ball = centre[k, 0], centre[k, 1], centre[k, 2]
        count += np.isfinite(ball[0] + ball[1] + ball[2]) and in_front(seen, ball)
    return count


@kernel
def _reach(sigma: float) -> int:
    """Return how far the blur of a lens reaches: 3 sigma, at most 9 px."""
    return min(int(np.ceil(3.0 * sigma)), 9)


@kernel
def _soften(canvas: Canvas, other: Canvas, sigma: float, wide: Edges, window: Edges) -> None:
    """Blur a window by a Gaussian; ``wide`` is the window and what the blur reaches beyond it."""
    height, width, reach = canvas.shape[0], canvas.shape[1], _reach(sigma)
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
def _cast(canvas: Canvas, light: Optics, t: float, turned: float, window: Edges) -> None:
    """Cast the shadow on a window; it stays where it is as a camera turns by so much [px]."""
    edge = light.shadow_start + light.shadow_speed * t - turned
    for v in range(np.uint64(window[0]), np.uint64(window[1] + 1)):
        for u in range(np.uint64(window[2]), np.uint64(window[3] + 1)):
            into = 0.5 - (np.int64(u) - edge) / _SHADOW_EDGE
            canvas[v, u] *= np.float32(1.0 - light.shadow * min(max(into, 0.0), 1.0))


@kernel
def _read_out(pixels: Image, film: Film, t: float, start: int, part: tuple[float, Edges]) -> None:
    """Light a window of the canvas at an instant, add read and shot noise, and round to bytes.

    ``part`` is how far the camera has turned from where it waits [px], and the window. The rows of
    a rolling shutter are lit one after the other: light that flickers shows in bands.
    """
    light, normal, canvas = film.light, film.normal, view(film.canvas, 0, pixels.shape)
    turned, window = part
    if light.shadow > 0.0:
        _cast(canvas, light, t, turned, window)
    read, shot = np.float32(light.read_noise * light.read_noise), np.float32(1.0 / light.electrons)
    half, last = np.float32(0.5), max(pixels.shape[0] - 1, 1)
    zero, top, width = np.float32(0.0), np.float32(255.0), np.uint64(pixels.shape[1])
    for v in range(np.uint64(window[0]), np.uint64(window[1] + 1)):
        at = np.uint64(start) + v * width
        when = t + film.readout * (np.int64(v) / last - 0.5)
        turn = 2.0 * pi * light.frequency * when + light.phase
        lit = np.float32(1.0 + light.amplitude * sin(turn))
        for u in range(np.uint64(window[2]), np.uint64(window[3] + 1)):
            mean = lit * canvas[v, u]
            value = mean + np.sqrt(read + shot * mean) * normal[at + u] + half
            pixels[v, u] = np.uint8(min(max(value, zero), top))
