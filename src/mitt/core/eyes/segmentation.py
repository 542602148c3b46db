"""Finding the ball in the images of one camera: where it was, and else everywhere.

1. **Where to look.** The vision chip of Ishii and others (IEEE ICRA 1999) keeps the mask of its
   target and calls target what is bright and lies in that mask, dilated. So here: what is beside
   the target is never looked at, however bright. A mask is one run of pixels a row, first and last
   column: the same for a target whose rows are unbroken, as those of a ball are.
2. **Background.** A camera that stands still learns its background from images without the thrown
   ball, resting arm included. A difference image is the image, divided by the light of the instant
   relative to that of the background, minus the background, so a pattern, a resting ball and a
   bright arm at rest vanish. A pixel that the ball covers in part shows a mixture of both; scaled
   by contrast / (ball - here), a difference is that share, so the ball weighs the same before any
   background, darker or brighter than itself. Before a ball is known, what differs either way is
   searched; then whether it is brighter or darker is known. Pixels of the sensor that stand out of
   their neighbours in the background are taken from these.
3. **Connected pixels** above a threshold, from the middle of the dilated mask on: what reaches into
   it without touching the target, which the chip would include, is left out.
4. **Moments**, which show what touches the target: then it is merged, and the mask of the ball that
   went into it moves on, so that the ball is found where the two part.
5. **Everywhere**, where the target is lost: the group of bright pixels that is most like a ball
   (:mod:`mitt.core.eyes.groups`). Where no background was learned, what a camera that stands still
   has shown of late takes its place there: what has not moved since is less like a ball.

A camera that turns has a background in each direction (:mod:`mitt.core.eyes.panorama`).

| here           | meaning                                                        | unit | shape  |
|----------------|----------------------------------------------------------------|------|--------|
| ``target``     | record of ``TARGET``: what is remembered of a camera's target  |      |        |
| ``window``     | part of an image: first and last row, first and last column    | px   | (4,)   |
| ``background`` | mean image without the ball; where none was learned, what was  | grey | (h, w) |
|                | seen of late, or empty; of a camera that turns its panorama    |      |        |
| ``difference`` | scratch as large as the image, if there is a background; three | grey | (h, w) |
|                | times as large, if the camera turns                            |      |        |
| ``settings``   | record of :func:`pack_segmenter`                               |      |        |
| ``work``       | record of ``WORK``: scratch                                    |      |        |

Runs and moments: :mod:`mitt.core.eyes.blobs`.
"""

from dataclasses import asdict, dataclass
from math import pi, sqrt
from typing import Annotated

import numpy as np

from mitt.core.eyes.background import (
    MOST_FAULTS,
    background_of,
    is_learned,
    keep_background,
    remember_turned,
    searched_difference,
    subtract,
    take_for_wall,
    whole_image,
)
from mitt.core.eyes.blobs import (
    EMPTY,
    MOMENTS,
    ROWS,
    Ints,
    connect,
    dilate,
    is_merged,
    touches_border,
    trim,
    weigh,
)
from mitt.core.eyes.groups import (
    GROUP,
    LOOK,
    MOST_GROUPS,
    SCAN,
    find_groups,
    remember,
)
from mitt.core.fields import Range, Settings
from mitt.core.kernels import Fields, Record, kernel, record_of, view
from mitt.core.signals import Frame, Image, Moments

LOST = 0
GOOD = 1
MERGED = 2
"""States of a target; from MERGED on they count the frames since merging."""

TARGET = np.dtype(
    [
        ("u", float),
        ("v", float),  # last centroid; NaN if there is none [px]
        ("du", float),
        ("dv", float),  # its motion [px a frame]
        ("state", np.int64),  # LOST, GOOD, or MERGED and more
        ("clipped", np.int64),  # whether the last target touched the border of its image
        ("moments", MOMENTS),
        ("area", float),  # of the last target, its area [px^2]
        ("mass", float),  # of the last target that was the ball alone [grey levels]
        ("top", np.int64),
        ("height", np.int64),
        ("runs", np.int64, (2, ROWS)),  # its mask [px]
        ("mark", np.int64),
        ("frozen", np.int64),  # its mark, frames it has been the same
        ("level", float),
        ("threshold", float),  # of the background, of a target [grey levels]
        ("noise", float),  # standard deviation of the background [grey levels]
        ("due", np.int64),  # frames since the background was measured
        ("light", float),
        ("mean", float),  # light over that of the background learned, whose mean
        ("expected", float),  # area that the ball should have; 0 if unknown [px^2]
        ("gain", float),
        ("weighed", float),  # mass of the ball over that, from how many frames
        ("at_u", float),
        ("at_v", float),  # where the ball should be [px]
        ("near", float),  # how far from there it may be; 0 if unknown [px]
        ("offset", float, (2,)),  # centroid less that of the ball where all cameras see it [px]
        ("behind", float),  # the background that its mass is measured before [grey levels]
        ("sign", np.int64),  # 1: brighter than the background, -1: darker; 0: not known
        ("learned", np.int64),  # whether its background was learned, without the ball
        ("faults", np.int64),  # pixels that stand out of their neighbours in the background
        ("fault_v", np.int64, (MOST_FAULTS,)),
        ("fault_u", np.int64, (MOST_FAULTS,)),  # row and column of these [px]
        ("looks", np.int64),  # whole images searched, where it was not; all, if it turns
        ("turns", np.int64),  # whether the camera turns
        ("turn_u", np.int64),
        ("turn_v", np.int64),  # where its image lies in its panorama [px]
        ("usual", float),  # area of a ball where they come into sight; 0 if unknown [px^2]
        ("followed", np.int64),  # frames that it follows what may not be the ball
        ("from_u", float),
        ("from_v", float),  # where in its panorama that was of late [px]
        ("left_out", np.int64),  # groups that found no place among the best of the last of them
    ]
)
"""What is remembered of the target in the images of one camera."""

WORK = np.dtype(
    [
        ("groups", GROUP, (MOST_GROUPS,)),
        ("look", LOOK),
        ("scan", SCAN),
        ("window", np.int64, (4,)),
        ("counts", np.int64, (256,)),
        ("runs", np.int64, (2, ROWS)),
        ("moments", MOMENTS),
    ]
)
"""Scratch of the segmentation of one image."""

TINY = 1.0 / 16.0
"""Share of the usual area of the ball below which a head is not turned to a target."""
TURNED = 4
"""Looks from one that goes into the panorama to the next: a ball that a head follows is farther
from the border of the image than the head turns meanwhile."""
DOUBTED = 32
RESTS = 1.5
"""Frames after which a head, while no ball is known, looks whether its target rests; how far that
moved then at most: 0.25 m/s at 4 m [px]."""
KEPT = 0.85
PATIENCE = 40
STEADY = 0.6
"""Share of its area below which a target is looked for anew; frames that a merged one is kept;
share of a new motion in the motion kept."""
GROWN = 1.08
RAGGED = 0.5
"""Growth of its mass in one frame, and what noise adds to that over the root of its area [px],
above which a target is the ball and something else."""
WILD = 8
"""Reach while no motion is known, as on the first frame that a turning head gets [px]."""
_NONE = np.empty((0, 0), np.uint8)
"""No background."""


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class SegmenterConfig(Settings):
    """How a target is separated from the background.

    Attributes:
        min_area: Pixels above the threshold that a target has at least; 2 keeps a ball of
            20 mm radius at 6 m (0.7 px of radius) and drops single hot pixels [px^2].
        min_contrast: Least threshold above the background [grey levels].
        noise_factor: Threshold above the background in standard deviations of it; at 6 a
            128 x 128 image has a false pixel once in 60 000 frames.
        reach: Pixels by which the last target is dilated: how far its edge may get in a frame
            beyond where its last motion takes it [px].
        background_period: Frames between two measurements of the background.
        frozen: Frames that an image may be the same, noise and all, before its camera counts
            as blind; 0 turns the test off, as for drawn images without noise.
    """

    min_area: Annotated[int, Range(1, 10**6)] = 2
    min_contrast: Annotated[float, Range(0.0, 255.0)] = 12.0
    noise_factor: Annotated[float, Range(0.0, 1e3)] = 6.0
    reach: Annotated[int, Range(0, 1000)] = 3
    background_period: Annotated[int, Range(1, 10**9)] = 64
    frozen: Annotated[int, Range(0, 10**6)] = 3


def pack_segmenter(config: SegmenterConfig) -> Record:
    """Return the settings as a record for kernels, shape (1,)."""
    return record_of(asdict(config), asdict(SegmenterConfig()))


def forget(targets: Record) -> None:
    """Forget target and background of each camera, in an array of ``TARGET`` of any shape."""
    targets[...] = np.zeros((), TARGET)
    targets["u"] = targets["v"] = np.nan


# 1. Where to look.


@kernel
def pace(place: float, motion: float) -> int:
    """Return the whole pixels by which a motion moves a place; they add up over the frames."""
    return round(place + motion) - round(place)


@kernel
def region_of_interest(target: Fields, settings: Fields, window: Ints) -> bool:
    """Cut the window of the whole image down to what will be searched first in the next.

    Returns:
        Whether it has: not where the target is lost or the background is to be measured.
    """
    rows, reach = target.height, max(settings.reach, WILD)
    if target.state == LOST or target.due == 0 or rows + 2 * reach > ROWS:
        return False
    du, dv, runs = pace(target.u, target.du), pace(target.v, target.dv), target.runs
    first, last = EMPTY, -EMPTY
    for k in range(rows):
        if runs[0, k] <= runs[1, k]:
            first, last = min(first, runs[0, k]), max(last, runs[1, k])
    if first > last:
        return False
    # The target is weighed a pixel beyond its rows, the background three beyond its columns.
    window[0] = max(window[0], target.top + dv - reach - 1)
    window[1] = min(window[1], target.top + dv + rows + reach)
    window[2] = max(window[2], first + du - reach - 3)
    window[3] = min(window[3], last + du + reach + 3)
    return True


# 2. Background (:mod:`mitt.core.eyes.background`).


@kernel
def measure_background(pixels: Image, counts: Ints) -> tuple[float, float]:
    """Return level and noise of the background [grey levels], from a ninth of the pixels.

    Mean and standard deviation of the values near the median: a ball or lamp does not count.
    ``counts``, shape (256,), is scratch.
    """
    counts[:] = 0
    total = 0
    for v in range(min(1, pixels.shape[0] - 1), pixels.shape[0], 3):
        for u in range(min(1, pixels.shape[1] - 1), pixels.shape[1], 3):
            counts[pixels[v, u]] += 1
            total += 1
    low, middle, high, seen = 0, 0, 0, 0
    for value in range(256):
        if seen * 6 < total:
            low = value
        if seen * 2 < total:
            middle = value
        if seen * 6 < 5 * total:
            high = value
        seen += counts[value]
    reach = 2 * (high - low) + 2
    n, first, second = 0.0, 0.0, 0.0
    for value in range(max(middle - reach, 0), min(middle + reach, 255) + 1):
        d = float(value - middle)
        n += counts[value]
        first += counts[value] * d
        second += counts[value] * d * d
    return middle + first / n, np.sqrt(max(second / n - (first / n) ** 2, 0.0))


@kernel
def noise_over_contrast(target: Fields, moments: Fields) -> float:
    """Return the noise of a pixel over the contrast of a disc that has these moments [1].

    Its rim adds half a pixel to the radius. A ball that smears is paler for it.
    """
    radius = max(sqrt(moments.area / pi) - 0.5, 0.5)
    return float(target.noise * pi * radius * radius / max(moments.mass, 1.0))


@kernel
def measure_if_due(shown: Image, target: Fields, settings: Fields, counts: Ints) -> None:
    """Measure level and threshold of the background where that is due."""
    if target.due == 0:
        target.level, target.noise = measure_background(shown, counts)
        rise = max(settings.min_contrast, settings.noise_factor * target.noise)
        target.threshold = min(target.level + rise, 255.0)
    target.due = (target.due + 1) % settings.background_period


@kernel
def find_sign(
    pixels: Image,
    background: Image,
    difference: Image,
    target: Fields,
    group: Fields,
    settings: Fields,
    work: Fields,
) -> bool:
    """Find whether a group is brighter or darker than the background, where that is not known.

    Then the difference image, in which both show alike, is written and measured anew. Return
    whether it was.
    """
    if target.sign != 0 or not is_learned(pixels, background, difference, target):
        return False
    shown, total = view(difference, 0, pixels.shape), 0.0
    behind = background_of(pixels, background, difference, target)
    for v in range(group.top, group.bottom + 1):
        for u in range(group.left, group.right + 1):
            if shown[v, u] > target.threshold:
                total += pixels[v, u] / target.light - behind[v, u]
    target.sign = 1 if total > 0.0 else -1
    whole_image(pixels, work.window)
    subtract(pixels, background, work.window, True, target, difference)
    target.due = 0
    measure_if_due(shown, target, settings, work.counts)
    return True


@kernel
def most_like_ball(
    shown: Image, background: Image, target: Fields, settings: Fields, work: Fields
) -> int:
    """Write the groups of an image that are most like the ball; return their number.

    ``shown`` is the whole image, or its difference from a learned background. They go into
    ``work.groups``, the most like first, and how many more there were into ``target``.
    """
    look, unlearned = work.look, target.learned == 0
    look.level, look.threshold, look.area = target.level, target.threshold, target.expected
    look.mass = target.gain * target.expected if target.weighed > 0.0 else 0.0
    look.u, look.v, look.near = target.at_u, target.at_v, target.near
    look.least = settings.min_area
    if target.expected == 0.0 and target.usual > 0.0:
        look.area, look.least = target.usual, max(settings.min_area, int(TINY * target.usual))
    before = background if unlearned and target.looks > 0 else background[:0]
    count = find_groups(shown, before, look, work.scan, work.groups)
    target.left_out = work.scan.left_out
    if unlearned:
        remember(shown, background, target.looks)
        target.looks += 1
    return int(count)


@kernel
def outline(pixels: Image, target: Fields, group: Fields, runs: Ints, moments: Fields) -> int:
    """Write runs and moments of the target in a group; return its rows, 0 if there is none."""
    rows, threshold = min(group.bottom - group.top + 1, ROWS), int(target.threshold)
    runs[0, :rows], runs[1, :rows] = group.left, group.right
    if connect(pixels, threshold, group.top, rows, runs, (group.left + group.right) // 2) == 0:
        return 0
    if not weigh(pixels, group.top, rows, runs, threshold, target.level, moments):
        return 0
    return int(rows)


# All of it, for one frame.


@kernel
def _find_again(
    pixels: Image, target: Fields, settings: Fields, new: Ints, moments: Fields
) -> tuple[int, int]:
    """Find the target in the dilated mask of the last frame; return its first row and its rows.

    No rows if it is lost, or too little of it is left.
    """
    rows, reach, threshold = target.height, settings.reach, int(target.threshold)
    if rows + 2 * max(reach, WILD) > ROWS:
        return 0, 0
    if target.du == 0.0 and target.dv == 0.0:
        reach = max(reach, WILD)
    du, dv = pace(target.u, target.du), pace(target.v, target.dv)
    dilate(target.runs, rows, reach, du, pixels.shape[1], new)
    top, rows = target.top + dv - reach, rows + 2 * reach
    if connect(pixels, threshold, top, rows, new, round(target.u) + du) == 0:
        return 0, 0
    top, rows = trim(top, rows, new)
    if not weigh(pixels, top, rows, new, threshold, target.level, moments):
        return 0, 0
    if not moments.area >= max(settings.min_area, KEPT * target.area):
        return 0, 0
    return top, rows


@kernel
def _find_anew(
    pixels: Image,
    background: Image,
    difference: Image,
    target: Fields,
    settings: Fields,
    work: Fields,
) -> tuple[int, int]:
    """Find what is most like the ball in the whole image; return its first row and its rows.

    The arguments are those of :func:`detect`; the whole difference image is written.
    """
    shown = pixels
    if is_learned(pixels, background, difference, target):
        shown = view(difference, 0, pixels.shape)
    for k in range(most_like_ball(shown, background, target, settings, work)):
        group = work.groups[k]
        signed = find_sign(pixels, background, difference, target, group, settings, work)
        rows = outline(shown, target, group, work.runs, target.moments)
        whole = rows > 0 and not touches_border(shown.shape, group.top, rows, work.runs)
        if rows > 0 and not (whole and is_merged(target.moments)):
            return group.top, rows
        if signed:
            target.sign = 0
            subtract(pixels, background, work.window, True, target, difference)
    return 0, 0


@kernel
def suffices(
    pixels: Image,
    background: Image,
    difference: Image,
    window: Ints,
    target: Fields,
    settings: Fields,
    work: Fields,
) -> bool:
    """Return whether the target will be found in its region of interest.

    Then :func:`detect` looks nowhere else, and a simulated camera need draw no more. Only scratch
    is changed. The arguments are those of :func:`detect`, the image true within the window, and
    the window of :func:`region_of_interest`.
    """
    shown = pixels
    if is_learned(pixels, background, difference, target):
        shown = view(difference, 0, pixels.shape)
        subtract(pixels, background, window, False, target, difference)
    return bool(_find_again(shown, target, settings, work.runs, work.moments)[1] > 0)


@kernel
def _lose(target: Fields) -> None:
    """Note that there is no target."""
    target.u, target.v, target.state, target.clipped = np.nan, np.nan, LOST, 0


@kernel
def _stay_merged(target: Fields) -> None:
    """Move the mask of the ball that went into a merged target on as it last moved."""
    across = pace(target.u, target.du)
    target.top += pace(target.v, target.dv)
    for k in range(ROWS):
        target.runs[0, k] += across
        target.runs[1, k] += across
    target.u, target.v = target.u + target.du, target.v + target.dv


@kernel
def follow_target(target: Fields, top: int, rows: int, runs: Ints) -> None:
    """Take the target whose moments are noted: its place, mass, area, and mask for the next."""
    moments = target.moments
    target.u, target.v, target.state = moments.u, moments.v, GOOD
    target.mass, target.area = moments.mass, moments.area
    target.top, target.height = top, rows
    for k in range(rows):
        target.runs[0, k], target.runs[1, k] = runs[0, k], runs[1, k]


@kernel
def _rests(target: Fields) -> bool:
    """Return whether what a camera follows that turns, while no ball is known, has not moved."""
    if target.turns == 0 or target.expected > 0.0 or target.state == LOST:
        return False
    target.followed += 1
    if target.followed % DOUBTED != 0:
        return False
    u, v = target.u + target.turn_u, target.v + target.turn_v
    rests = max(abs(u - target.from_u), abs(v - target.from_v)) < RESTS
    target.from_u, target.from_v = u, v
    return bool(rests)


@kernel
def _segment(
    pixels: Image,
    background: Image,
    difference: Image,
    target: Fields,
    settings: Fields,
    work: Fields,
) -> tuple[int, bool]:
    """Find the target in the dilated mask of the last, or else in the whole image; see detect."""
    window, new, moments, top, rows = work.window, work.runs, target.moments, 0, 0
    if target.state == LOST and target.expected == 0.0:
        target.sign = 0
    if _rests(target) and is_learned(pixels, background, difference, target):
        take_for_wall(pixels, background, difference, target, window)
    whole_image(pixels, window)
    part = region_of_interest(target, settings, window)
    shown = searched_difference(pixels, background, difference, target, window, not part)
    measure_if_due(shown, target, settings, work.counts)
    if target.state != LOST:
        top, rows = _find_again(shown, target, settings, new, moments)
    again = rows > 0
    if not again:
        if part:
            shown = searched_difference(pixels, background, difference, target, window, True)
        top, rows = _find_anew(pixels, background, difference, target, settings, work)
    if rows == 0:
        _lose(target)
        return 0, False
    clipped = touches_border(pixels.shape, top, rows, new)
    comes = not again or target.clipped > 0
    ball = target.gain * target.expected if target.weighed > 0.0 else 0.0
    usual = max(target.mass, ball)  # what hid a part of the ball need not go on to do so
    most = np.inf if comes else (GROWN + RAGGED / sqrt(target.area)) * usual
    if not clipped and (is_merged(moments) or moments.mass > most):
        merged = target.state - MERGED + 1 if target.state >= MERGED else 0
        if not again or merged >= PATIENCE:
            _lose(target)
            return 0, False
        target.state = MERGED + merged
        _stay_merged(target)
        return int(moments.area), clipped
    if again and target.state == GOOD:
        share = STEADY if target.du != 0.0 or target.dv != 0.0 else 1.0
        target.du += share * (moments.u - target.u - target.du)
        target.dv += share * (moments.v - target.v - target.dv)
    else:
        target.du, target.dv, target.followed = 0.0, 0.0, 0
        target.from_u, target.from_v = moments.u + target.turn_u, moments.v + target.turn_v
    follow_target(target, top, rows, new)
    target.clipped = clipped
    return int(moments.area), clipped


@kernel
def _is_frozen(pixels: Image, target: Fields, patience: int) -> bool:
    """Return whether a target has been the same, noise and all, for ``patience`` frames or more.

    The pixels of one frame under the mask, each weighted by its place, are never those of the
    next to the last bit in sum.
    """
    mark, runs = 0, target.runs
    for k in range(target.height):
        row = target.top + k
        if 0 <= row < pixels.shape[0]:
            for u in range(max(runs[0, k], 0), min(runs[1, k] + 1, pixels.shape[1])):
                mark += pixels[row, u] * (1 + 31 * u + 17 * row)
    same = patience > 0 and mark == target.mark
    target.frozen = target.frozen + 1 if same else 0
    target.mark = mark
    return bool(target.frozen >= patience > 0)


@kernel
def detect(
    pixels: Image,
    background: Image,
    difference: Image,
    target: Fields,
    settings: Fields,
    work: Fields,
) -> tuple[int, bool]:
    """Find the target in one frame of one camera; measure the background when that is due.

    The arguments are those of the module's table; ``target`` is overwritten.

    Returns:
        Pixels of the target, 0 if there is none or the image is frozen, and whether it touches
        the border. The centroid is in ``target``.
    """
    area, clipped = _segment(pixels, background, difference, target, settings, work)
    if target.turns > 0:
        if target.looks % TURNED == 0 and is_learned(pixels, background, difference, target):
            remember_turned(pixels, background, difference, target, work.window)
        target.looks += 1
    if area > 0 and _is_frozen(pixels, target, settings.frozen):
        return 0, False
    return area, clipped


class Segmenter:
    """Finds the ball in the frames of one camera; remembers where it was and the background."""

    def __init__(self, config: SegmenterConfig | None = None) -> None:
        """Start without a target and without an idea of the background."""
        self._settings = pack_segmenter(config or SegmenterConfig())
        self._target, self._work = np.zeros(1, TARGET), np.zeros(1, WORK)
        self._before = self._difference = _NONE
        self.reset()

    def reset(self) -> None:
        """Forget the target and the background."""
        forget(self._target)

    def forget_target(self) -> None:
        """Forget the target; what was learned of the background stays."""
        kept = self._target.copy()
        forget(self._target)
        for name in ("learned", "looks", "faults", "fault_v", "fault_u"):
            self._target[name] = kept[name]

    def learn_background(self, background: Image) -> None:
        """Learn what the camera sees without the ball, as of :func:`mean_background`."""
        self._before = np.ascontiguousarray(background)
        self._difference = np.zeros_like(self._before)
        keep_background(self._target[0], self._before)

    @property
    def left_out(self) -> int:
        """Bright things beyond those that are looked at, in the last whole image searched."""
        return int(self._target["left_out"][0])

    def step(self, frame: Frame) -> Moments:
        """Return the moments of the target in ``frame``."""
        target, pixels = self._target[0], np.ascontiguousarray(frame.pixels)
        if self._before.shape != pixels.shape and pixels.ndim == 2:
            self._before, target["looks"] = np.zeros(pixels.shape, np.uint8), 0
            target["learned"] = 0
        area, clipped = detect(
            pixels, self._before, self._difference, target, self._settings[0], self._work[0]
        )
        if area == 0:
            return Moments(t=frame.t, camera=frame.camera, found=False)
        return Moments(
            t=frame.t,
            camera=frame.camera,
            found=True,
            area=float(area),
            u=float(target["u"]),
            v=float(target["v"]),
            clipped=clipped,
            merged=bool(target["state"] >= MERGED),
        )
