"""Groups of bright pixels that touch, the most like a ball first.

One pass over the image, row by row: a run of bright pixels joins the groups whose runs in the row
above it touches, by a side or a corner. A group that no run of a row goes on with is finished, and
is judged; those that are most like a ball are kept, wherever in the image they are.

| here       | meaning                                                           | shape          |
|------------|-------------------------------------------------------------------|----------------|
| ``look``   | record of ``LOOK``: what the ball should look like                |                |
| ``before`` | what earlier images showed                                        | (h, w)         |
| ``scan``   | record of ``SCAN``: scratch                                       |                |
| ``best``   | records of ``GROUP``, the result, the most like a ball first      | (MOST_GROUPS,) |
"""

from math import pi

import numpy as np
from numpy.typing import NDArray

from mitt.core.kernels import Fields, Record, kernel
from mitt.core.signals import Image

Ints = NDArray[np.int64]

MOST_GROUPS = 16
"""Groups that are kept of one image: those most like a ball."""
RUNS = 512
"""Runs of bright pixels of one row that are looked at; further ones are counted as left out."""
AT_REST = 0.02
"""Likeness of what has not changed since earlier images, to that of something new [1]."""

GROUP = np.dtype(
    [
        ("left", np.int64),
        ("top", np.int64),
        ("right", np.int64),
        ("bottom", np.int64),  # first and last columns and rows [px]
        ("area", np.int64),  # its pixels [px^2]
        ("mass", float),  # sum of its pixels above the background [grey levels]
        ("fresh", float),  # of that, what was not there in earlier images [grey levels]
        ("likeness", float),  # to a ball: greater is more alike
    ]
)
"""A group of pixels."""

LOOK = np.dtype(
    [
        ("level", float),
        ("threshold", float),  # of the background, and what bright pixels exceed [grey levels]
        ("area", float),  # of the ball; 0 if unknown [px^2]
        ("mass", float),  # sum of its pixels above the background; 0 if unknown [grey levels]
        ("u", float),
        ("v", float),  # where the ball should be [px]
        ("near", float),  # how far from there it may be; 0 if unknown [px]
        ("least", np.int64),  # pixels of the smallest group that counts [px^2]
    ]
)
"""What the ball should look like in an image."""

SCAN = np.dtype(
    [
        ("groups", GROUP, (2 * RUNS,)),  # those that are not finished
        ("spare", np.int64, (2 * RUNS,)),  # numbers of groups that may be used again
        ("first", np.int64, (2, RUNS)),
        ("last", np.int64, (2, RUNS)),
        ("owner", np.int64, (2, RUNS)),  # columns of the runs of two rows, and their groups
        ("spares", np.int64),
        ("used", np.int64),  # numbers spare, and used so far
        ("count", np.int64),
        ("left_out", np.int64),  # groups kept, and those that found no place
    ]
)
"""Scratch of a pass over an image."""

GONE = -1
"""Owner of a run whose group is finished."""


@kernel
def row_has(pixels: Image, row: int, u0: int, u1: int, threshold: int) -> bool:
    """Return whether a pixel of columns u0..u1 of ``row`` lies above the threshold."""
    line = pixels[row, u0 : u1 + 1]  # a slice, so that the loop below becomes vector code
    top = np.uint8(0)
    for k in range(line.shape[0]):
        top = max(top, line[k])
    return bool(top > threshold)


@kernel
def likeness(group: Fields, look: Fields, moves: bool) -> float:
    """Return how much a group is like a ball; negative where it cannot be one.

    By its size, or its mass where the ball's is known, by its shape, and, if ``moves``, by the
    share of it that is new. Where no size is known, the larger is the better.
    """
    du = 0.5 * (group.left + group.right) - look.u
    dv = 0.5 * (group.top + group.bottom) - look.v
    far = look.near > 0.0 and max(abs(du), abs(dv)) > look.near
    if far or group.area < look.least:
        return -1.0
    wide, high = group.right - group.left + 1, group.bottom - group.top + 1
    filled = min(group.area / (0.25 * pi * wide * high), 1.0)
    like: float = group.area * filled * min(wide, high) / max(wide, high)
    if look.area > 0.0:
        like = min(like / look.area, look.area / like)
    if look.mass > 0.0:
        like *= min(group.mass / look.mass, look.mass / max(group.mass, 1.0))
    if moves:
        like *= AT_REST + group.fresh / max(group.mass, 1.0)
    return like


@kernel
def _keep(group: Fields, like: float, scan: Fields, best: Record) -> None:
    """Put a finished group among the best where it belongs; the least alike makes room."""
    if scan.count == len(best):
        scan.left_out += 1
        if like <= best[scan.count - 1].likeness:
            return
    else:
        scan.count += 1
    k = scan.count - 1
    while k > 0 and best[k - 1].likeness < like:
        best[k] = best[k - 1]
        k -= 1
    best[k] = group
    best[k].likeness = like


@kernel
def _finish(
    v: int, row: int, count: int, look: Fields, moves: bool, scan: Fields, best: Record
) -> None:
    """Judge the groups of a row of runs that do not reach row ``v`` of the image."""
    for j in range(count):
        number = scan.owner[row, j]
        group = scan.groups[number]
        if group.bottom < v and group.area > 0:
            like = likeness(group, look, moves)
            if like >= 0.0:
                _keep(group, like, scan, best)
            group.area = 0
            scan.spare[scan.spares] = number
            scan.spares += 1


@kernel
def _open(scan: Fields, v: int) -> int:
    """Return the number of an empty group in row ``v``."""
    if scan.spares > 0:
        scan.spares -= 1
        number = scan.spare[scan.spares]
    else:
        number = scan.used
        scan.used += 1
    group = scan.groups[number]
    group.left, group.right, group.top, group.bottom = 1 << 30, -1, v, v
    group.area, group.mass, group.fresh = 0, 0.0, 0.0
    return int(number)


@kernel
def _join(scan: Fields, into: int, other: int, counts: tuple[int, int]) -> None:
    """Merge a group into another, with its runs in both rows."""
    a, b = scan.groups[into], scan.groups[other]
    a.left, a.right = min(a.left, b.left), max(a.right, b.right)
    a.top, a.bottom = min(a.top, b.top), max(a.bottom, b.bottom)
    a.area, a.mass, a.fresh = a.area + b.area, a.mass + b.mass, a.fresh + b.fresh
    b.area = 0
    for row in range(2):
        for j in range(counts[row]):
            if scan.owner[row, j] == other:
                scan.owner[row, j] = into
    scan.spare[scan.spares] = other
    scan.spares += 1


@kernel
def _take_run(
    v: int, bounds: tuple[int, int], row: int, counts: tuple[int, int], start: int, scan: Fields
) -> tuple[int, int]:
    """Take a run of row ``v`` into the group that it touches; return which, and where to go on.

    ``counts`` are the runs of both rows of ``scan`` so far; those above are in the other ``row``,
    and those before ``start`` end left of this one.
    """
    above, (first, last), owner = 1 - row, bounds, GONE
    while start < counts[above] and scan.last[above, start] < first - 1:
        start += 1
    j = start
    while j < counts[above] and scan.first[above, j] <= last + 1:
        other = scan.owner[above, j]
        if owner == GONE:
            owner = other
        elif other != owner:
            _join(scan, owner, other, counts)
        j += 1
    if owner == GONE:
        owner = _open(scan, v)
    group, here = scan.groups[owner], counts[row]
    group.left, group.right = min(group.left, first), max(group.right, last)
    group.bottom = v
    scan.first[row, here], scan.last[row, here], scan.owner[row, here] = first, last, owner
    return owner, start


@kernel
def find_groups(pixels: Image, before: Image, look: Fields, scan: Fields, best: Record) -> int:
    """Write the groups of bright pixels that are most like a ball.

    Args:
        pixels: The image.
        before: As in the module's table; empty where earlier images do not count.
        look: What the ball should look like.
        scan: Scratch; its ``left_out`` is then how many more there were.
        best: Result, the most like a ball first.

    Returns:
        Their number.
    """
    height, width = pixels.shape
    threshold, moves = int(look.threshold), before.size > 0
    scan.spares, scan.used, scan.count, scan.left_out = 0, 0, 0, 0
    row, above = 0, 0
    for v in range(height):
        here, start, u = 0, 0, 0
        if not row_has(pixels, v, 0, width - 1, threshold):
            u = width
        while u < width:
            if pixels[v, u] <= threshold:
                u += 1
                continue
            first, mass, fresh = u, 0.0, 0.0
            while u < width and pixels[v, u] > threshold:
                mass += pixels[v, u] - look.level
                if moves:
                    new = float(pixels[v, u]) - before[v, u]
                    fresh += max(new - (look.threshold - look.level), 0.0)
                u += 1
            if here == RUNS:
                scan.left_out += 1
                continue
            counts = (here, above) if row == 0 else (above, here)
            number, start = _take_run(v, (first, u - 1), row, counts, start, scan)
            group = scan.groups[number]
            group.area += u - first
            group.mass += mass
            group.fresh += fresh
            here += 1
        _finish(v, 1 - row, above, look, moves, scan, best)
        row, above = 1 - row, here
    _finish(height, 1 - row, above, look, moves, scan, best)
    return int(scan.count)


@kernel
def remember(pixels: Image, before: Image, looks: int) -> None:
    """Let ``before`` follow what images show: a quarter of the change each fourth look.

    ``looks`` are the images that it has seen; the first is taken as it is.
    """
    if before.size != pixels.size or looks % 4 != 0:
        return
    for v in range(pixels.shape[0]):
        old, new = before[v], pixels[v]
        for u in range(len(old)):
            change = np.int16(new[u]) - np.int16(old[u])
            old[u] = new[u] if looks == 0 else np.uint8(np.int16(old[u]) + change // 4)
