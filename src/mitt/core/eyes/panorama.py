"""What a camera that turns has seen in each direction: its panorama.

A panorama lies in the angles of its head, a pixel of the camera a step, and repeats itself. What
passes before it is taken away as from the background of a camera that stands still
(:mod:`mitt.core.eyes.background`): what it has where the camera looks is laid out as an image.

| here             | meaning                                                     | unit | shape  |
|------------------|-------------------------------------------------------------|------|--------|
| ``panorama``     | levels by the light of its first looks; ``UNSEEN``: none    | grey | (p, p) |
| ``turn``         | row and column of it where the image begins, of any size    | px   | 2      |
| ``window``       | part of an image, as in :mod:`mitt.core.eyes.segmentation`  | px   | (4,)   |
| ``seen``         | an image, divided by its light over that of the panorama    | grey | (h, w) |

``p`` is ``PANORAMA``.
"""

import numpy as np

from mitt.core.eyes.blobs import Ints
from mitt.core.kernels import kernel
from mitt.core.signals import Image

PANORAMA = 1024
"""Side of a panorama, a power of two, beyond which it begins anew [px]."""
UNSEEN = np.uint8(0)
"""Level of a direction that was never seen."""
STEEP = 24
"""Difference of neighbours above which one of them counts as seen as well: angles of heads are not
exact to a pixel, and noise makes 14 of it [grey levels]."""

APART = 16
STRAY = 0.3
ODD = 24.0
"""Every how many rows its light is measured [px]; share of its level, and grey levels beyond, by
which a pixel may differ from the light of before to count."""


@kernel
def cut_out(panorama: Image, turn: tuple[int, int], window: Ints, part: Image) -> None:
    """Write what a panorama has where a camera looks into a window of ``part``, an image."""
    left, first, last = turn[1] & (PANORAMA - 1), window[2], window[3] + 1
    cut = min(max(PANORAMA - left, first), last)
    for v in range(window[0], window[1] + 1):
        line = panorama[(v + turn[0]) & (PANORAMA - 1)]
        part[v, first:cut] = line[left + first : left + cut]
        part[v, cut:last] = line[left + cut - PANORAMA : left + last - PANORAMA]


@kernel
def fill_unseen(part: Image, pixels: Image, light: float, window: Ints, as_seen: bool) -> None:
    """Write into the directions of a window that were never seen what may lie there.

    What the image shows, if ``as_seen``: what is there is not new then. Else the mean of what was
    seen beside them, or where nothing was, of the image.
    """
    count, total, shown = 0, 0, 0
    first, last = window[2], window[3] + 1
    for v in range(window[0], window[1] + 1):
        known = part[v, first:last]
        for k in range(len(known)):
            count += known[k] > UNSEEN
            total += known[k]
    size = (window[1] - window[0] + 1) * (last - first)
    if count == size:
        return
    if count == 0 and not as_seen:
        for v in range(window[0], window[1] + 1):
            for u in range(first, last):
                shown += pixels[v, u]
    level = total / count if count > 0 else shown / (size * light)
    mean, scale = np.uint8(min(max(level + 0.5, 1.0), 255.0)), np.float32(1.0 / light)
    for v in range(window[0], window[1] + 1):
        for u in range(first, last):
            if part[v, u] == UNSEEN:
                part[v, u] = divided(pixels[v, u], scale) if as_seen else mean


@kernel
def divided(pixel: int, scale: float) -> np.uint8:
    """Return a level times a scale, rounded, from 1 to 255."""
    level = np.float32(pixel) * np.float32(scale) + np.float32(0.5)
    return np.uint8(min(max(level, np.float32(1.0)), np.float32(255.0)))


@kernel
def allow_beside(part: Image, pixels: Image, light: float, window: Ints, laid: Image) -> None:
    """Write ``part`` of a panorama into ``laid``, at its edges as near to the image as it may be.

    Where neighbours differ much, any level from the least to the greatest of the nine about a pixel
    may be there: of these the one that is nearest to what the image shows.
    """
    top, bottom, first, last = window[0], window[1], window[2], window[3] + 1
    scale, steep = np.float32(1.0 / light), np.uint8(STEEP)
    for v in range(top, bottom + 1):
        above, here, below = part[max(v - 1, top)], part[v], part[min(v + 1, bottom)]
        out, seen = laid[v], pixels[v]
        out[first], out[last - 1] = here[first], here[last - 1]
        a, b, c = above[first : last - 2], above[first + 1 : last - 1], above[first + 2 : last]
        d, e, f = here[first : last - 2], here[first + 1 : last - 1], here[first + 2 : last]
        g, h, i = below[first : last - 2], below[first + 1 : last - 1], below[first + 2 : last]
        shown, to = seen[first + 1 : last - 1], out[first + 1 : last - 1]
        for k in range(len(to)):
            low = min(a[k], b[k], c[k], d[k], e[k], f[k], g[k], h[k], i[k])
            high = max(a[k], b[k], c[k], d[k], e[k], f[k], g[k], h[k], i[k])
            own = divided(shown[k], scale)
            near = min(max(own, low), high)
            to[k] = near if np.uint8(high - low) > steep else e[k]


@kernel
def blank(part: Image, window: Ints) -> None:
    """Take a window of an image for unseen."""
    for v in range(window[0], window[1] + 1):
        for u in range(window[2], window[3] + 1):
            part[v, u] = UNSEEN


@kernel
def mean_ratio(pixels: Image, part: Image, before: float) -> float:
    """Return the light of an image over that of its part of a panorama; ``before`` if unseen.

    The ratio of means, as least squares would say less light than there is where the panorama has
    noise, and what is recorded would drift. What differs much from ``before`` does not count.
    """
    shown, known = 0, 0
    for v in range(0, pixels.shape[0], APART):
        for u in range(pixels.shape[1]):
            p, b = int(pixels[v, u]), int(part[v, u])
            if part[v, u] != UNSEEN and abs(p - before * b) < STRAY * b + ODD:
                shown += p
                known += b
    return float(min(max(shown / known, 0.3), 3.0)) if known > 0 else float(before)


@kernel
def _follow(old: Image, new: Image) -> None:
    """Let levels follow new ones, shape (k,): by a quarter of the change; those unseen at once."""
    for k in range(len(old)):
        change = np.int16(new[k]) - np.int16(old[k])
        # As far up as down, so that noise makes no drift.
        step = (abs(change) + np.int16(2)) // np.int16(4)
        then = np.uint8(np.int16(old[k]) + (step if change > 0 else -step))
        known = new[k] if old[k] == UNSEEN else then
        old[k] = old[k] if new[k] == UNSEEN else known


@kernel
def record(panorama: Image, turn: tuple[int, int], seen: Image) -> None:
    """Let a panorama follow what a camera saw; ``UNSEEN`` are pixels that say nothing of it."""
    height, width = seen.shape
    left = turn[1] & (PANORAMA - 1)
    room = min(width, PANORAMA - left)
    for v in range(height):
        line = panorama[(v + turn[0]) & (PANORAMA - 1)]
        _follow(line[left : left + room], seen[v, :room])
        _follow(line[: width - room], seen[v, room:])


@kernel
def forget_directions(panorama: Image, turn: tuple[int, int], window: Ints) -> None:
    """Forget what a panorama has in a window of an image."""
    for v in range(window[0], window[1] + 1):
        for u in range(window[2], window[3] + 1):
            panorama[(v + turn[0]) & (PANORAMA - 1), (u + turn[1]) & (PANORAMA - 1)] = UNSEEN
