"""How an image comes about: a wall, arm and hand, and bright balls, exposed with noise and smear.

The balls are drawn by ``outline``, arm and hand by ``capsules``. All images of an instant are
drawn in one call. The wall turns with the camera, to whole pixels, and is as good as infinitely
far away; it does not smear, nor do arm and hand.

| here     | meaning                                                        | unit | shape        |
|----------|----------------------------------------------------------------|------|--------------|
| optics   | cameras at begin and end of the exposure, records of           | m    | (n, 2)       |
|          | :data:`mitt.vision.camera.CAMERA`                              | px   |              |
| windows  | part of each image that is drawn: first and last row, first    | px   | (n, 4)       |
|          | and last column; beyond it nothing that counts is drawn        |      |              |
| balls    | centre in the world at begin and end, radius; then grey level, | m    | (k, 14)      |
|          | centre at time zero and velocity (not of the first ball)       | m/s  |              |
"""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from mitt.jit import kernel
from mitt.signals import Array, Image
from mitt.structs import Record
from mitt.world.capsules import Camera, Edges, Point, draw_body, into
from mitt.world.heads import open_and_shut
from mitt.world.noise import PERIOD
from mitt.world.outline import draw_ball
from mitt.world.painting import Light, paint
from mitt.world.shading import Canvas

Cameras: TypeAlias = tuple[Record, Array, Record, Array, Array, Light, Array, Canvas]
Bank: TypeAlias = tuple[Image, Image, Array]
Window: TypeAlias = NDArray[np.int64]


@kernel
def _hang(pixels: Image, turn: Point, wall: Image, noise: Image, start: int, window: Edges) -> None:
    """Fill a window of an image with the wall and its noise, which begins at ``start``.

    ``turn`` is f_px of the camera [px], its pan and tilt [rad].
    """
    f, pan, tilt = turn
    column, row = np.uint64(round(f * pan) % PERIOD), round(-f * tilt) % PERIOD
    for v in range(window[0], window[1] + 1):
        line, far, at = np.uint64(v), np.uint64(row + v), np.uint64(start + v * pixels.shape[1])
        for u in range(np.uint64(window[2]), np.uint64(window[3] + 1)):
            pixels[line, u] = np.uint8(wall[far, column + u] + noise[at + u])


@kernel
def _camera(optics: Record, n: int, shut: int) -> Camera:
    """Return a camera as in :mod:`mitt.world.capsules`, at begin (0) or end (1)."""
    o = optics[n, shut]
    R, c = o.R, o.centre
    return (
        R[0, 0], R[0, 1], R[0, 2], R[1, 0], R[1, 1], R[1, 2], R[2, 0], R[2, 1], R[2, 2],
        c[0], c[1], c[2], o.f_px, o.cu, o.cv,
    )  # fmt: skip


@kernel
def _draw_balls(
    pixels: Image, begin: Camera, end: Camera, balls: Array, light: Light, normal: Array,
    start: int, window: Edges, work: Array,
) -> None:  # fmt: skip
    """Draw the balls, the first above the others; for the arguments see :func:`draw_images`."""
    lens = begin[12], begin[13], begin[14]
    for k in range(balls.shape[0] - 1, -1, -1):
        x0, y0, z0 = into(begin, balls[k, 0], balls[k, 1], balls[k, 2])
        x1, y1, z1 = into(end, balls[k, 3], balls[k, 4], balls[k, 5])
        if np.isfinite(x0 + y0 + z0 + x1 + y1 + z1):
            ball, paint = (
                (x0, y0, z0, x1, y1, z1, balls[k, 6]),
                (balls[k, 7], light.read_noise, light.electrons),
            )
            draw_ball(pixels, lens, ball, paint, normal, start, window, work)


@kernel
def draw_images(
    images: tuple[Image, ...],
    optics: Record,
    places: Array,
    balls: Array,
    capsules: Array,
    light: Light,
    wall: Image,
    ground: Image,
    normal: Array,
    starts: NDArray[np.int64],
    windows: Window,
    work: Array,
    canvas: Canvas,
    t: float,
) -> None:
    """Draw what all cameras of a rig see.

    Args:
        images: Results, one a camera, each shape (height, width).
        optics: As in the module's table.
        places: Pan and tilt of each camera [rad], shape (n, 2).
        balls: As in the module's table; one that is not finite is left out.
        capsules: Arm and hand, as in :mod:`mitt.world.capsules`.
        light: Light and noise, as in :mod:`mitt.world.painting`.
        wall: The background.
        ground: Noise of the ground, modulo 256, shape (b,).
        normal: Standard normal numbers, shape (c,).
        starts: Offsets of each camera into both banks, shape (n, 2).
        windows: As in the module's table.
        work: Scratch, as of :func:`mitt.world.outline.draw_ball` for the widest image.
        canvas: Scratch, as of :func:`mitt.world.painting.paint` for the largest image.
        t: Middle of the exposure [s].
    """
    body, painted = int(light.body), light.painted
    for n in range(len(images)):
        pixels, begin, end = images[n], _camera(optics, n, 0), _camera(optics, n, 1)
        quiet, loud = starts[n, 0], starts[n, 1]
        window = windows[n, 0], windows[n, 1], windows[n, 2], windows[n, 3]
        if painted:
            paint(
                pixels, begin, end, (begin[12], places[n, 0], places[n, 1]), balls, capsules, light,
                t, wall, normal, loud, window, work, canvas,
            )  # fmt: skip
            continue
        _hang(pixels, (begin[12], places[n, 0], places[n, 1]), wall, ground, quiet, window)
        ball = into(begin, balls[0, 0], balls[0, 1], balls[0, 2])
        if not np.isfinite(ball[0] + ball[1] + ball[2]):
            ball = 0.0, 0.0, -np.inf
        nearer = draw_body(pixels, begin, capsules, body, ground, quiet, window, ball, False)
        _draw_balls(pixels, begin, end, balls, light, normal, loud, window, work)
        if nearer > 0:
            draw_body(pixels, begin, capsules, body, ground, quiet, window, ball, True)


@kernel
def render_images(
    images: tuple[Image, ...],
    camera: Cameras,
    bank: Bank,
    starts: NDArray[np.int64],
    half: float,
    radius: float,
    r_o: Array,
    dr_o: Array,
    capsules: Array,
    windows: Window,
    t: float,
) -> None:
    """Place cameras and ball as the shutter opens and as it closes, and draw what is seen.

    Args:
        images: As for :func:`draw_images`.
        camera: Heads and their state in the middle of the exposure, as in
            :mod:`mitt.vision.head`; then ``optics``, ``places``, ``balls``, ``light``, ``work``
            and ``canvas`` of :func:`draw_images`, of which the first two and the balls are
            overwritten.
        bank: ``wall``, ``ground`` and ``normal`` of :func:`draw_images`.
        starts: As for :func:`draw_images`.
        half: Half the exposure [s].
        radius: Radius of the ball [m].
        r_o: Its centre in the middle of the exposure [m], shape (3,); not finite for no ball.
        dr_o: Its velocity [m/s], shape (3,).
        capsules: As for :func:`draw_images`.
        windows: As for :func:`draw_images`.
        t: Middle of the exposure [s].
    """
    heads, state, optics, places, balls, light, work, canvas = camera
    for i in range(3):
        balls[0, i], balls[0, 3 + i] = r_o[i] - half * dr_o[i], r_o[i] + half * dr_o[i]
    balls[0, 6] = radius
    for k in range(1, len(balls)):
        for i in range(3):
            balls[k, i] = balls[k, 8 + i] + (t - half) * balls[k, 11 + i]
            balls[k, 3 + i] = balls[k, 8 + i] + (t + half) * balls[k, 11 + i]
    open_and_shut(heads, state, half, optics, places)
    draw_images(
        images, optics, places, balls, capsules, light, bank[0], bank[1], bank[2], starts, windows,
        work, canvas, t,
    )  # fmt: skip
