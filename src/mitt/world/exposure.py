"""How an image comes about: a wall, arm and hand, and bright balls, exposed with noise and smear.

The balls are drawn by ``outline``, arm and hand by ``silhouettes``. All images of an instant are
drawn in one call. The wall turns with the camera, to whole pixels, and is as good as infinitely
far away; it does not smear, nor do arm and hand.

| here     | meaning                                                        | unit | shape        |
|----------|----------------------------------------------------------------|------|--------------|
| optics   | cameras at begin and end of the exposure, each as in           | m    | (n, 2, 5, 3) |
|          | :mod:`mitt.vision.triangulation`                               | px   |              |
| windows  | part of each image that is drawn: first and last row, first    | px   | (n, 4)       |
|          | and last column; beyond it nothing that counts is drawn        |      |              |
| balls    | centre in the world at begin and end, radius; then grey level  | m    | (k, 8)       |
"""

from typing import TypeAlias

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mitt.signals import Array, Image
from mitt.world.heads import open_and_shut
from mitt.world.noise import PERIOD
from mitt.world.outline import draw_ball
from mitt.world.silhouettes import draw_capsule, in_front, seen_from

Cameras: TypeAlias = tuple[Array, Array, Array, Array, Array, Array, Array]
Bank: TypeAlias = tuple[Image, Image, Array]
Window: TypeAlias = NDArray[np.int64]


@njit(cache=True)
def _hang(
    pixels: Image, camera: Array, wall: Image, place: Array, noise: Image, window: Window
) -> None:
    """Fill an image with the wall as it lies before a camera turned to ``place`` (pan, tilt)."""
    width, left, right = pixels.shape[1], window[2], window[3] + 1
    column = round(camera[4, 0] * place[0]) % PERIOD
    row = round(-camera[4, 0] * place[1]) % PERIOD
    for v in range(window[0], window[1] + 1):
        line, source = pixels[v, left:right], wall[row + v, column + left : column + right]
        numbers = noise[v * width + left : v * width + right]
        for u in range(right - left):
            line[u] = np.uint8(source[u] + numbers[u])


@njit(cache=True)
def _into(camera: Array, ball: Array, start: int, local: Array) -> None:
    """Write the ball in the optical frame."""
    for i in range(3):
        local[start + i] = (
            camera[0, i] * (ball[start] - camera[3, 0])
            + camera[1, i] * (ball[start + 1] - camera[3, 1])
            + camera[2, i] * (ball[start + 2] - camera[3, 2])
        )


@njit(cache=True)
def expose(
    images: tuple[Image, ...],
    optics: Array,
    places: Array,
    balls: Array,
    capsules: Array,
    light: Array,
    wall: Image,
    ground: Image,
    normal: Array,
    starts: NDArray[np.int64],
    windows: Window,
    work: Array,
) -> None:
    """Draw what all cameras of a rig see.

    Args:
        images: Results, one a camera, each shape (height, width).
        optics: As in the module's table.
        places: Pan and tilt of each camera [rad], shape (n, 2).
        balls: As in the module's table; one that is not finite is left out.
        capsules: Arm and hand, as in :mod:`mitt.world.silhouettes`.
        light: Read noise [grey levels], electrons a level, grey level of arm and hand, shape (3,).
        wall: The background.
        ground: Noise of the ground, modulo 256, shape (b,).
        normal: Standard normal numbers, shape (c,).
        starts: Offsets of each camera into both banks, shape (n, 2).
        windows: As in the module's table.
        work: Scratch, zero at entry, shape (2 widest + 1 + 6 INSTANTS + 17,).
    """
    local, seen, paint, scratch = work[-7:], work[-14:-7], work[-17:-14], work[:-17]
    paint[1], paint[2] = light[0], light[1]
    body = int(light[2])
    for n in range(len(images)):
        pixels, begin, end = images[n], optics[n, 0], optics[n, 1]
        noise = ground[starts[n, 0] :]
        window = windows[n]
        _hang(pixels, begin, wall, places[n], noise, window)
        _into(begin, balls[0], 0, local)
        x, y, z = local[0], local[1], local[2]
        nowhere = not np.isfinite(x + y + z)
        before = 0
        for k in range(capsules.shape[0]):
            if not seen_from(begin, capsules[k], seen):
                continue
            if nowhere or not in_front(seen, x, y, z):
                draw_capsule(pixels, begin[4], seen, body, noise, window)
            else:
                before += 1
        for k in range(balls.shape[0] - 1, -1, -1):
            _into(begin, balls[k], 0, local)
            _into(end, balls[k], 3, local)
            local[6], paint[0] = balls[k, 6], balls[k, 7]
            if np.isfinite(local[0] + local[1] + local[2] + local[3] + local[4] + local[5]):
                draw_ball(
                    pixels, begin[4], local, paint, normal[starts[n, 1] :], window, scratch
                )  # fmt: skip
        for k in range(capsules.shape[0] if before > 0 else 0):
            if seen_from(begin, capsules[k], seen) and in_front(seen, x, y, z):
                draw_capsule(pixels, begin[4], seen, body, noise, window)


@njit(cache=True)
def snap(
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
) -> None:
    """Place cameras and ball as the shutter opens and as it closes, and draw what is seen.

    Args:
        images: As for :func:`expose`.
        camera: Heads and their state in the middle of the exposure, as in
            :mod:`mitt.vision.head`; then ``optics``, ``places``, ``balls``, ``light`` and
            ``work`` of :func:`expose`, of which the first two and the first ball are overwritten.
        bank: ``wall``, ``ground`` and ``normal`` of :func:`expose`.
        starts: As for :func:`expose`.
        half: Half the exposure [s].
        radius: Radius of the ball [m].
        r_o: Its centre in the middle of the exposure [m], shape (3,); not finite for no ball.
        dr_o: Its velocity [m/s], shape (3,).
        capsules: As for :func:`expose`.
        windows: As for :func:`expose`.
    """
    heads, state, optics, places, balls, light, work = camera
    for i in range(3):
        balls[0, i], balls[0, 3 + i] = r_o[i] - half * dr_o[i], r_o[i] + half * dr_o[i]
    balls[0, 6] = radius
    open_and_shut(heads, state, half, optics, places)
    expose(
        images, optics, places, balls, capsules, light, bank[0], bank[1], bank[2], starts, windows,
        work,
    )  # fmt: skip
