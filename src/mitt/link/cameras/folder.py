"""Images of a folder as a camera: in the order of their names, timed by them."""

import re
from contextlib import suppress
from pathlib import Path
from typing import final

import numpy as np

from mitt.errors import FileError, heard
from mitt.link.cameras.source import optional
from mitt.reading import read_bytes
from mitt.signals import Frame, Image

#: Largest image file that is read [bytes].
_MAX_BYTES = 100_000_000

SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm", ".webp")

_SECONDS, _NANOSECONDS = re.compile(r"(\d+\.\d+)\D*$"), re.compile(r"(\d{16,19})\D*$")
_PARTS = re.compile(r"(\d+)")


@final
class Folder:
    """A folder of images.

    The time of a frame is its number over ``fps`` or, without that, what its name ends with:
    seconds with a decimal point (``left_12.0345.png``) or nanoseconds in 16 to 19 digits.
    """

    live = False

    def __init__(self, path: Path, camera: int, *, fps: float | None) -> None:
        """List the images.

        Raises:
            FileError: There are none, or neither their names nor ``fps`` say when they were taken.
        """
        self.name = str(path)
        optional("cv2")
        self._camera, self._fps, self._next = camera, fps, 0
        self.paths = images_in(path)
        if fps is None:
            for first in self.paths[:2]:
                stamp(first)

    def read(self) -> Frame | None:
        """Return the next image as a frame; None after the last."""
        if self._next == len(self.paths):
            return None
        number, path = self._next, self.paths[self._next]
        self._next += 1
        pixels = read_image(path)
        t = stamp(path) if self._fps is None else number / self._fps
        return Frame(t=t, camera=self._camera, number=number, pixels=pixels)

    def close(self) -> None:
        """Nothing is held open."""


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
        pixels = cv2.imdecode(data, cv2.IMREAD_GRAYSCALE) if data.size else None
    if pixels is None:
        raise FileError(str(path), "an image", "a file that does not decode")
    return pixels


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
