"""A video as a camera: anything that PyAV reads."""

from pathlib import Path
from typing import final

from mitt.errors import FileError
from mitt.link.cameras.source import grey, optional
from mitt.signals import Frame


@final
class Video:
    """A video file.

    The time of a frame is its number over ``fps`` or, without that, its stamp in the container.
    Containers round stamps (Matroska to 1 ms): where all lie within one such step of a constant
    rate, it is the rate that counts.
    """

    live = False

    def __init__(self, path: Path, camera: int, *, fps: float | None) -> None:
        """Open the file.

        Raises:
            FileError: It cannot be read, or holds no video.
        """
        self.name = str(path)
        self._av = optional("av")
        self._camera, self._fps, self._number = camera, fps, 0
        self._first: float | None = None
        if not path.is_file():
            raise FileError(str(path), "a video, a folder of images or a camera", "no such file")
        try:
            self._container = self._av.open(str(path))
            self._stream = self._container.streams.video[0]
        except (self._av.FFmpegError, IndexError, ValueError) as error:
            raise FileError(str(path), "a video", _reason(error)) from error
        self._frames = self._container.decode(self._stream)
        self._rate = float(self._stream.average_rate or 0.0)
        self._tick = float(self._stream.time_base or 0.0)

    def read(self) -> Frame | None:
        """Return the next frame; None after the last."""
        try:
            picture = next(self._frames, None)
        except (self._av.FFmpegError, ValueError) as error:
            place = f"{self.name} frame {self._number}"
            raise FileError(place, "a frame that decodes", _reason(error)) from error
        if picture is None:
            return None
        number, self._number = self._number, self._number + 1
        if picture.format.name.startswith("gray"):
            pixels = picture.to_ndarray(format="gray")
        else:
            pixels = grey(picture.to_ndarray(format="rgb24"))
        t = self._time(picture.time, number)
        return Frame(t=t, camera=self._camera, number=number, pixels=grey(pixels))

    def close(self) -> None:
        """Close the file."""
        self._container.close()

    def _time(self, stamp: float | None, number: int) -> float:
        """Return the time of a frame [s].

        Raises:
            FileError: The container has no time for it, and no rate was said.
        """
        if self._fps is not None:
            return number / self._fps
        if stamp is None:
            raise FileError(self.name, "a video with time stamps", "none", do="say --fps")
        if self._first is None:
            self._first = stamp
        if self._rate > 0.0:
            even = self._first + number / self._rate
            if abs(even - stamp) <= 1.01 * self._tick:
                return even
        return float(stamp)


def _reason(error: Exception) -> str:
    """Return what PyAV says in a few words."""
    return str(error).split("]")[-1].strip()[:80] or type(error).__name__
