"""Frames of two cameras, put together by their times."""

from collections.abc import Iterator
from dataclasses import dataclass

from mitt.link.cameras.source import Camera
from mitt.signals import Frame

Pair = tuple[Frame | None, Frame | None]


@dataclass(slots=True)
class PairCounts:
    """What became of the frames.

    Attributes:
        frames: Frames of the left and of the right camera.
        paired: Instants at which both gave a frame.
        ended: Name of the camera that ended while the other went on; empty if none did.
        left_over: Frames of the other after that.
        backward: Frames dropped because their time did not rise.
    """

    frames: tuple[int, int] = (0, 0)
    paired: int = 0
    ended: str = ""
    left_over: int = 0
    backward: int = 0


class Pairing:
    """Two cameras read as one.

    Attributes:
        counts: What became of the frames so far.
    """

    def __init__(self, left: Camera, right: Camera, *, max_skew: float, most: int | None) -> None:
        """Take two cameras.

        Args:
            left: Camera 0.
            right: Camera 1.
            max_skew: Largest difference of two times that are one instant [s].
            most: Most frames from each camera.
        """
        self.counts = PairCounts()
        self._cameras, self._max_skew, self._most = (left, right), max_skew, most
        self._last = [-float("inf"), -float("inf")]

    def _next(self, k: int) -> Frame | None:
        """Return the next frame of a camera whose time rises; None at the end."""
        while self._most is None or self.counts.frames[k] < self._most:
            frame = self._cameras[k].read()
            if frame is None:
                return None
            a, b = self.counts.frames
            self.counts.frames = (a + 1, b) if k == 0 else (a, b + 1)
            if frame.t > self._last[k]:
                self._last[k] = frame.t
                return frame
            self.counts.backward += 1
        return None

    def __iter__(self) -> Iterator[Pair]:
        """Yield the frames of each instant; one alone where the other camera has none."""
        left, right = self._next(0), self._next(1)
        while left is not None and right is not None:
            gap = left.t - right.t
            if abs(gap) <= self._max_skew:
                self.counts.paired += 1
                yield left, right
                left, right = self._next(0), self._next(1)
            elif gap < 0.0:
                yield left, None
                left = self._next(0)
            else:
                yield None, right
                right = self._next(1)
        self._finish(left, right)

    def _finish(self, left: Frame | None, right: Frame | None) -> None:
        """Count what one camera has left when the other has ended."""
        if left is None and right is None:
            return
        k = 0 if left is None else 1
        self.counts.ended, self.counts.left_over = self._cameras[k].name, 1
        if self._cameras[1 - k].live:
            return
        while self._next(1 - k) is not None:
            self.counts.left_over += 1
