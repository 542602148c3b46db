"""Frames of two cameras, put together by their times."""

from collections.abc import Iterator
from dataclasses import dataclass, field

from mitt.cameras.source import Camera, share_zero
from mitt.signals import Frame


@dataclass(slots=True)
class PairCounts:
    """What became of the frames.

    Attributes:
        frames: Frames of the left and of the right camera.
        paired: Instants at which both gave a frame.
        ended: Name of the camera that ended while the other went on; empty if none did.
        left_over: Frames of the other after that.
        backward: Frames dropped because their time did not rise.
        first_gap: Time of the first left frame less that of the first right one [s].
    """

    frames: list[int] = field(default_factory=lambda: [0, 0])
    paired: int = 0
    ended: str = ""
    left_over: int = 0
    backward: int = 0
    first_gap: float = 0.0


def pairs(
    cameras: tuple[Camera, Camera], counts: PairCounts, *, max_skew: float, most: int | None
) -> Iterator[tuple[Frame, ...]]:
    """Yield the frames of each instant, left before right; one where the other camera has none.

    Args:
        cameras: Left and right.
        counts: Is kept up to date.
        max_skew: Largest difference of two times that are one instant [s].
        most: Most frames from each camera; None for all.
    """
    share_zero(cameras)
    sources = [_rising(camera, k, counts, most) for k, camera in enumerate(cameras)]
    left, right = (next(source, None) for source in sources)
    if left is not None and right is not None:
        counts.first_gap = left.t - right.t
    while left is not None and right is not None:
        gap = left.t - right.t
        if abs(gap) <= max_skew:
            counts.paired += 1
            yield left, right
            left, right = (next(source, None) for source in sources)
        elif gap < 0.0:
            yield (left,)
            left = next(sources[0], None)
        else:
            yield (right,)
            right = next(sources[1], None)
    if left is not None or right is not None:
        ended = 0 if left is None else 1
        counts.ended, counts.left_over = cameras[ended].name, 1
        if not cameras[1 - ended].live:
            counts.left_over += sum(1 for _ in sources[1 - ended])


def _rising(camera: Camera, k: int, counts: PairCounts, most: int | None) -> Iterator[Frame]:
    """Yield the frames of camera k whose time rises."""
    last = -float("inf")
    while most is None or counts.frames[k] < most:
        frame = camera.read()
        if frame is None:
            return
        counts.frames[k] += 1
        if frame.t > last:
            last = frame.t
            yield frame
        else:
            counts.backward += 1
