"""What the live loop shows its catcher of the cameras: frames in its time, and the background."""

from collections.abc import Sequence
from math import inf
from typing import Protocol, final

from mitt.catcher.catcher import Catcher
from mitt.errors import InputError
from mitt.link.clock import monotonic
from mitt.link.frames import FrameReader, FrameSet, frames_of
from mitt.signals import Frame
from mitt.vision.lens import Lens
from mitt.vision.resampling import straightener

#: Looks at the scene before a throw, and readings between two of them: as ``mitt catch`` takes
#: them, ten in 80 ms.
_LOOKS, _APART = 10, 8
#: Time between two looks at whether a memory is still that of the cameras [s].
_AGAIN = 0.5
#: Time without an image after which the cameras are lost [s]: six frames of 120 a second.
SILENT = 0.05


class FrameSource(Protocol):
    """Where frames come from."""

    def open(self) -> str:
        """Be ready to take frames; return what is wrong, nothing if all is well."""

    def take(self) -> Sequence[FrameSet]:
        """Return all frames since the last call, oldest first."""


@final
class SharedFrames:
    """Frames from a shared memory that may come and go with the process that writes it."""

    def __init__(self, name: str, shapes: Sequence[tuple[int, int]]) -> None:
        """Take the memory's name and the images' heights and widths [px]."""
        self._name, self._shapes = name, shapes
        self._reader: FrameReader | None = None
        self._said, self._due = "", 0.0

    def open(self) -> str:
        """Open the memory anew now and then: whoever writes it may have been started again."""
        if monotonic() > self._due:
            self._said, self._due = self._opened(), monotonic() + _AGAIN
        return self._said

    def _opened(self) -> str:
        """Open the memory anew; return what is wrong."""
        if self._reader is not None:
            self._reader.close()
            self._reader = None
        try:
            self._reader = FrameReader.named(self._name, self._shapes)
        except InputError as error:
            return str(error)
        return ""

    def take(self) -> Sequence[FrameSet]:
        """Return all frames since the last call; none while the memory is not open."""
        return () if self._reader is None else self._reader.take()


@final
class StraightFrames:
    """Frames whose images were bent by lenses, made straight."""

    def __init__(self, source: FrameSource, lenses: Sequence[Lens]) -> None:
        """Take where the bent ones come from, and a lens a camera."""
        self._source, self._straighten = source, [straightener(lens) for lens in lenses]

    def open(self) -> str:
        """Say what is wrong with the cameras."""
        return self._source.open()

    def take(self) -> Sequence[FrameSet]:
        """Return all frames since the last call, oldest first."""
        return [
            seen._replace(
                images=tuple(make(x) for make, x in zip(self._straighten, seen.images, strict=True))
            )
            for seen in self._source.take()
        ]


def straight(source: FrameSource | None, lenses: Sequence[Lens]) -> FrameSource | None:
    """Return a source of frames that no lens bends any more."""
    return source if source is None or not lenses else StraightFrames(source, lenses)


@final
class Sight:
    """Shows a catcher frames once it has learned its background in the ready pose."""

    def __init__(self, source: FrameSource | None) -> None:
        """Take where frames come from; None where the ball is seen as points."""
        self.source = source
        self._views: list[tuple[Frame, ...]] = []
        self._seen, self._learned = 0, False
        self._came = self._stamp = -inf

    def open(self) -> str:
        """Say what is wrong with the cameras, nothing if all is well."""
        return "" if self.source is None else self.source.open()

    def fresh(self) -> None:
        """Begin for a catcher that has seen nothing."""
        self._views, self._seen, self._learned = [], 0, False

    def beside(self, count: int, now: float) -> list[FrameSet | None]:
        """Return the newest frames beside readings, oldest first; None where there is none.

        What came with older readings than these is left out.

        Args:
            count: How many readings.
            now: Time by the steady clock [s].
        """
        taken = [] if self.source is None else list(self.source.take())[-count:]
        if taken and taken[-1].t != self._stamp:  # one that hangs writes its last image again
            self._came, self._stamp = now, taken[-1].t
        return [None] * (count - len(taken)) + taken

    def silent(self, now: float) -> str:
        """Say that the cameras have sent nothing for too long; nothing if all is well."""
        if self.source is None or now - self._came < SILENT:
            return ""
        return f"no images for {1e3 * SILENT:.0f} ms"

    def show(self, catcher: Catcher, seen: FrameSet, t: float) -> tuple[Frame, ...]:
        """Return frames for the catcher; none as long as its background is learned from them.

        Args:
            catcher: Which waits in its ready pose until it has a background.
            seen: Frames.
            t: Their time [s].
        """
        frames = frames_of(seen, t)
        if self._learned:
            return frames
        if self._seen % _APART == 0:
            self._views.append(frames)
        self._seen += 1
        if len(self._views) == _LOOKS:
            catcher.learn_background(self._views)
            self._learned = True
        return ()
