"""Recorded images as a camera: a folder of images, or a video."""

import re
from contextlib import suppress
from pathlib import Path
from typing import final

import numpy as np

from mitt.cameras.source import Camera, grey, optional
from mitt.errors import FileError, heard
from mitt.reading import read_bytes
from mitt.signals import Image

#: Largest image file that is read [bytes].
_MAX_BYTES = 100_000_000

SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm", ".webp")

_SECONDS, _NANOSECONDS = re.compile(r"(\d+\.\d+)\D*$"), re.compile(r"(\d{16,19})\D*$")
_PARTS = re.compile(r"(\d+)")


@final
class Folder(Camera):
    """A folder of images.

    The stamp of a frame is what its name ends with: seconds with a decimal point
    (``left_12.0345.png``) or nanoseconds in 16 to 19 digits.
    """

    def __init__(self, path: Path, camera: int, *, fps: float | None) -> None:
        """List the images.

        Raises:
            FileError: There are none, or neither their names nor ``fps`` say when they were taken.
        """
        super().__init__(str(path), camera, fps)
        optional("cv2")
        paths = images_in(path)
        if fps is None:
            for first in paths[:2]:
                stamp(first)
        self._left = iter(paths)

    def _grab(self) -> tuple[float, Image] | None:
        """Read the next image."""
        path = next(self._left, None)
        if path is None:
            return None
        pixels = read_image(path)
        return (stamp(path) if self._fps is None else 0.0), pixels

    def close(self) -> None:
        """Nothing is held open."""


@final
class Video(Camera):
    """A video file: anything that PyAV reads.

    Containers round time stamps (Matroska to 1 ms): where all lie within one such step of a
    constant rate, the time follows from that rate.
    """

    def __init__(self, path: Path, camera: int, *, fps: float | None) -> None:
        """Open the file.

        Raises:
            FileError: It cannot be read, or holds no video.
        """
        super().__init__(str(path), camera, fps)
        self._av = optional("av")
        self._start: float | None = None
        if not path.is_file():
            raise FileError(str(path), "a video, a folder of images or a camera", "no such file")
        try:
            self._container = self._av.open(str(path))
            stream = self._container.streams.video[0]
        except (self._av.FFmpegError, IndexError, ValueError) as error:
            raise FileError(str(path), "a video", _reason(error)) from error
        self._frames = self._container.decode(stream)
        self._rate = float(stream.average_rate or 0.0)
        self._tick = float(stream.time_base or 0.0)

    def _grab(self) -> tuple[float, Image] | None:
        """Decode the next frame."""
        try:
            picture = next(self._frames, None)
        except (self._av.FFmpegError, ValueError) as error:
            place = f"{self.name} frame {self._number}"
            raise FileError(place, "a frame that decodes", _reason(error)) from error
        if picture is None:
            return None
        is_grey = picture.format.name.startswith("gray")
        pixels = grey(picture.to_ndarray(format="gray" if is_grey else "rgb24"))
        return (self._time(picture.time) if self._fps is None else 0.0), pixels

    def close(self) -> None:
        """Close the file."""
        self._container.close()

    def _time(self, stamp: float | None) -> float:
        """Return the time of a frame [s].

        Raises:
            FileError: The container has no time for it.
        """
        if stamp is None:
            raise FileError(self.name, "a video with time stamps", "none", do="say --fps")
        self._start = stamp if self._start is None else self._start
        if self._rate > 0.0:
            even = self._start + self._number / self._rate
            if abs(even - stamp) <= 1.01 * self._tick:
                return even
        return float(stamp)


def _reason(error: Exception) -> str:
    """Return what PyAV says in a few words."""
    return str(error).split("]")[-1].strip()[:80] or type(error).__name__


def read_image(path: Path) -> Image:
    """Return an image in grey, shape (height, width).

    Raises:
        FileError: It cannot be read or does not decode.
    """
    cv2 = optional("cv2")
    content = read_bytes(path, max_bytes=_MAX_BYTES, wanted="a readable image")
    data = np.frombuffer(content, dtype=np.uint8)
    pixels: Image | None = None
    with heard(), suppress(cv2.error):  # its decoders complain on the error stream
        pixels = cv2.imdecode(data, cv2.IMREAD_COLOR) if data.size else None
    if pixels is None:
        raise FileError(str(path), "an image", "a file that does not decode")
    return grey(pixels)


def images_in(path: Path) -> list[Path]:
    """Return the images of a folder in the order of the numbers in their names.

    Raises:
        FileError: It cannot be read, or holds no image.
    """
    try:
        found = [p for p in path.iterdir() if p.suffix.lower() in SUFFIXES]
    except OSError as error:
        raise FileError(str(path), "a folder of images", error.strerror or "an error") from error
    if not found:
        raise FileError(str(path), f"images ({', '.join(SUFFIXES)})", "none")
    return sorted(found, key=_natural)


def _natural(path: Path) -> list[tuple[int, str]]:
    """Return a key that puts image 9 before image 10."""
    return [(int(p) if p.isdigit() else -1, p) for p in _PARTS.split(path.stem)]


def stamp(path: Path) -> float:
    """Return the time that a file's name ends with [s].

    Raises:
        FileError: It ends with none.
    """
    seconds = _SECONDS.search(path.stem)
    if seconds:
        return float(seconds.group(1))
    nanoseconds = _NANOSECONDS.search(path.stem)
    if nanoseconds:
        return 1e-9 * int(nanoseconds.group(1))
    raise FileError(str(path), "a name that ends with its time (1.25.png) [s]", path.name,
                    do="say --fps")  # fmt: skip
