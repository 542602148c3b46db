"""Which of several bright things is the ball: what flies is faster than what rests or rolls.

While nothing is known of a ball and more than one target shows, all are followed for some frames.
A pair of targets, one in each of the first two cameras, is a candidate if their lines of sight meet
and both look as large as the ball would there. The candidate that has moved fastest is the ball.
A slow one, as if it rolled, is taken only when no other has come for a while: a thrown ball may
show late beside it. A single target in each camera is taken at once.

| here          | meaning                                                        | unit | shape   |
|---------------|----------------------------------------------------------------|------|---------|
| ``targets``   | a target each: centroid, area, box (u0, v0, u1, v1)            | px   | (k, 7)  |
| ``tracks``    | a candidate each: last position, first position, frame of the  | m, 1 | (k, 11) |
|               | first and of the last, frames in which it was seen, its targets|      |         |
| ``residuals`` | of each pair of targets; infinite where they are not the ball  | px   | (k, k)  |
"""

from math import pi, sqrt

import numpy as np
from numpy.typing import NDArray

from mitt.jit import kernel
from mitt.signals import Array, Image
from mitt.views import view
from mitt.vision import target as at
from mitt.vision.background import measure_if_due, show
from mitt.vision.blobs import MAX_BLOBS, Box, find_targets
from mitt.vision.segmentation import outline
from mitt.vision.target import STATE, WEIGHTS, masks
from mitt.vision.triangulation import note, triangulate
from mitt.vision.window import ROWS, is_merged

MOST = 6
"""Targets of a camera, and candidates, that are followed."""
FRAMES, SEEN = 8, 5
"""Frames for which candidates are followed, and in how many of them the ball is seen at least. In
8 ms a thrown ball goes 40 mm, and 5 m away its place is known to a few millimetres."""
PATIENCE = 24
"""Frames after which the search begins anew."""
SLOW, BLUR, ROUNDS = 0.002, 0.01, 6
"""Distance in a frame [m] below which a candidate may be a ball that rolls, 2 m/s at a kilohertz;
what the noise of two positions adds to a distance [m]; how often the search begins anew before
such a one is taken all the same."""
LEAP = 0.05
"""Distance that a candidate goes from frame to frame at most [m]: 50 m/s at a kilohertz."""
TALL, ROUGH = 0.35, 0.7
"""Difference from the radius that the ball should have: relative, and in pixels."""

_PAIRED, _FINE = 1e3, 1e6
"""What a pair is worth, against residuals [px]; steps of a pixel in which they are added up."""
_ROUNDS, _FRAME, _COUNT, _TRACKS = 15, 16, 17, 18
_TARGETS = _TRACKS + 11 * MOST
_RESIDUALS = _TARGETS + 2 * 7 * MOST
"""Places in the rig's row of the memory: searches begun anew, frames so far, number of tracks, the
three tables."""


@kernel
def _list_targets(
    images: tuple[Image, ...], backgrounds: tuple[Image, ...], n: int, memory: Array,
    settings: Array, boxes: Box, targets: Array,
) -> int:  # fmt: skip
    """Write the whole, round targets of a camera; return their number."""
    shown, own = _show(images, backgrounds, n, memory, boxes), memory[n]
    measure_if_due(shown, own, settings, boxes)
    height, width = shown.shape
    found, count = find_targets(shown, int(own[at.THRESHOLD]), boxes), 0
    runs, weights = masks(boxes)[1], own[WEIGHTS : WEIGHTS + 7]
    for k in range(1, found + 1):
        box = boxes[k]
        inside = box[0] > 0 and box[1] > 0 and box[2] < width - 1 and box[3] < height - 1
        if count == len(targets) or not inside or box[3] - box[1] >= ROWS:
            continue
        if outline(shown, own, box, runs, weights) == 0:
            continue
        if weights[6] < settings[0] or is_merged(weights):
            continue
        targets[count, 0], targets[count, 1], targets[count, 2] = weights[1], weights[2], weights[6]
        for i in range(4):
            targets[count, 3 + i] = box[i]
        count += 1
    return count


@kernel
def _fits(memory: Array, area: float) -> bool:
    """Return whether a target is as large as the ball should be; its rim adds half a pixel."""
    radius = sqrt(memory[at.EXPECTED] / pi)
    return bool(abs(sqrt(area / pi) - 0.5 - radius) < TALL * radius + ROUGH)


@kernel
def _meet(
    a: Array, b: Array, memory: Array, cameras: Array, ball: Array, points: Array, work: Array,
    r: Array, P: Array,
) -> float:  # fmt: skip
    """Write where two targets are if they are the ball; return the residual, or infinity [px]."""
    points[:, 2] = -1.0
    for n, seen in enumerate((a, b)):
        if not note(points[n], seen[0], seen[1], seen[2], False, ball):
            return np.inf
    residual = triangulate(cameras, points, ball[0], r, P, work)
    if not residual <= ball[3]:
        return np.inf
    at.expect(memory, cameras, ball[0], r, 0.0)
    if not (_fits(memory[0], a[2]) and _fits(memory[1], b[2])):
        return np.inf
    return float(residual)


@kernel
def _match(residuals: Array, boxes: Box, partners: NDArray[np.int64]) -> None:
    """Pair targets so that most have a partner, and then the residuals in sum are smallest.

    Two targets of different balls may meet by chance; their true partners would be left alone. The
    result holds a target of the second camera for each of the first; -1 for none.
    """
    start, sets = 4 * (at.WORK - ROWS), 1 << MOST
    least, choice = view(boxes, start, (sets,)), view(boxes, start + sets, (MOST, sets))
    for taken in range(sets):
        least[taken] = 0 if taken == 0 else 1 << 40
    for i in range(MOST):
        for taken in range(sets - 1, -1, -1):  # sets that a target is taken from are still old
            choice[i, taken] = -1
            for j in range(MOST):
                if taken >> j & 1 and residuals[i, j] < np.inf:
                    cost = least[taken ^ 1 << j] + int(_FINE * (residuals[i, j] - _PAIRED))
                    if cost < least[taken]:
                        least[taken], choice[i, taken] = cost, j
    taken = 0
    for other in range(sets):
        if least[other] < least[taken]:
            taken = other
    for i in range(MOST - 1, -1, -1):
        j = choice[i, taken]
        partners[i] = j
        if j >= 0:
            taken ^= 1 << j


@kernel
def _follow(tracks: Array, count: int, frame: float, r: Array, pair: tuple[int, int]) -> int:
    """Take a position into the track that it goes on with, or a new one; return their number."""
    near, best = LEAP, count
    for k in range(count):
        gap, away = frame - tracks[k, 7], 0.0
        for i in range(3):
            away += (tracks[k, i] - r[i]) ** 2
        if gap > 0.0 and sqrt(away) < near * gap:
            best, near = k, sqrt(away) / gap
    if best == len(tracks):
        return count
    track = tracks[best]
    for i in range(3):
        track[i] = r[i]
        if best == count:
            track[3 + i] = r[i]
    if best == count:
        track[6], track[8] = frame, 0.0
    track[7], track[9], track[10] = frame, float(pair[0]), float(pair[1])
    track[8] += 1.0
    return max(count, best + 1)


@kernel
def _fastest(tracks: Array, count: int, slow: bool) -> int:
    """Return the track that moved fastest, or -1; one that may be a rolling ball if ``slow``."""
    best, speed = -1, -1.0
    for k in range(count):
        track, moved = tracks[k], 0.0
        for i in range(3):
            moved += (track[i] - track[3 + i]) ** 2
        moved, frames = sqrt(moved), max(track[7] - track[6], 1.0)
        if not slow and moved < BLUR + SLOW * frames:
            continue
        if track[8] >= SEEN and moved / frames > speed:
            best, speed = k, moved / frames
    return best


@kernel
def _show(
    images: tuple[Image, ...], backgrounds: tuple[Image, ...], n: int, memory: Array, boxes: Box
) -> Image:
    """Return the whole image of a camera, or its difference from the background."""
    scratch, window = backgrounds[len(backgrounds) - 1], boxes[MAX_BLOBS + 1]
    shown: Image = show(images[n], backgrounds[n], scratch, memory[n], window, True)
    return shown


@kernel
def _take_both(
    images: tuple[Image, ...], backgrounds: tuple[Image, ...], memory: Array, a: Array, b: Array,
    boxes: Box,
) -> None:  # fmt: skip
    """Let both cameras follow a target each from now on."""
    runs, box = masks(boxes)[1], boxes[0]
    for n, chosen in enumerate((a, b)):
        shown, own = _show(images, backgrounds, n, memory, boxes), memory[n]
        weights = own[WEIGHTS : WEIGHTS + 7]
        for i in range(4):
            box[i] = int(chosen[3 + i])
        rows = outline(shown, own, box, runs, weights)
        if rows > 0:
            own[0], own[1], own[STATE] = weights[1], weights[2], float(at.GOOD)
            own[at.DU], own[at.DV], own[at.MASS] = 0.0, 0.0, weights[0]
            at.keep(own, box[1], rows, runs, weights[6])


@kernel
def choose(
    images: tuple[Image, ...], backgrounds: tuple[Image, ...], memory: Array, settings: Array,
    boxes: Box, cameras: Array, ball: Array, points: Array, work: Array, r: Array, P: Array,
) -> bool:  # fmt: skip
    """Choose the ball in two cameras that see it for the first time.

    The arguments are those of :func:`mitt.vision.localization.localize`; points, shape (n, 3), r
    and P are scratch.

    Returns:
        Whether both cameras know what to follow: chosen, or the only target of each.
    """
    rig = memory[len(images)]
    tracks, count = view(rig, _TRACKS, (MOST, 11)), int(rig[_COUNT])
    targets = view(rig, _TARGETS, (2, MOST, 7))
    residuals = view(rig, _RESIDUALS, (MOST, MOST))
    a = _list_targets(images, backgrounds, 0, memory, settings, boxes, targets[0])
    b = _list_targets(images, backgrounds, 1, memory, settings, boxes, targets[1])
    if a == 0 or b == 0:
        rig[_FRAME] += 1.0 if rig[_FRAME] > 0.0 else 0.0
        return False
    if rig[_FRAME] == 0.0 and rig[_ROUNDS] == 0.0 and a == 1 and b == 1:
        _take_both(images, backgrounds, memory, targets[0, 0], targets[1, 0], boxes)
        return True
    rig[_FRAME] += 1.0
    for i in range(MOST):
        for j in range(MOST):
            residuals[i, j] = np.inf
            if i < a and j < b:
                residuals[i, j] = _meet(
                    targets[0, i], targets[1, j], memory, cameras, ball, points, work, r, P
                )
    partners = view(boxes, 0, (MOST,))
    _match(residuals, boxes, partners)
    for i in range(MOST):
        j = partners[i]
        if j >= 0:
            _meet(targets[0, i], targets[1, j], memory, cameras, ball, points, work, r, P)
            count = _follow(tracks, count, rig[_FRAME], r, (i, j))
    rig[_COUNT] = float(count)
    if rig[_FRAME] < FRAMES:
        return False
    chosen, now = _fastest(tracks, count, rig[_ROUNDS] >= ROUNDS), rig[_FRAME]
    if chosen < 0 or tracks[chosen, 7] < now:
        if now >= PATIENCE:
            rig[_FRAME], rig[_COUNT] = 0.0, 0.0
            rig[_ROUNDS] += 1.0
        return False
    rig[_FRAME], rig[_COUNT], rig[_ROUNDS] = 0.0, 0.0, 0.0
    i, j = int(tracks[chosen, 9]), int(tracks[chosen, 10])
    _take_both(images, backgrounds, memory, targets[0, i], targets[1, j], boxes)
    return True
