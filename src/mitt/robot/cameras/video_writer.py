"""Writing videos: without loss for our own images, compressed for people."""

import os
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any, final

from mitt.core.errors import FileError, InputError
from mitt.core.signals import Image
from mitt.io.writing import temporary_beside
from mitt.robot.cameras.cameras import optional

#: What people's players read; ffv1 keeps every grey value.
SUFFIXES = (".mkv", ".mp4")


@final
class VideoWriter:
    """Writes frames to a video, which takes its name only once it is whole."""

    def __init__(self, path: Path, *, rate: float, lossless: bool = False) -> None:
        """Begin a video.

        Args:
            path: File to write, .mkv or .mp4.
            rate: Frames a second.
            lossless: Whether to keep every value: ffv1, in Matroska only.

        Raises:
            InputError: The suffix is none that goes with it.
            FileError: The file cannot be written.
        """
        wanted = SUFFIXES[:1] if lossless else SUFFIXES
        if path.suffix.lower() not in wanted:
            raise InputError("video", f"a name that ends with {' or '.join(wanted)}", path.name)
        self._av = optional("av")
        self._path, self._lossless = path, lossless
        self._rate = Fraction(rate).limit_denominator(1000)
        self._stream: Any = None
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._temporary = temporary_beside(path)
        except OSError as error:
            raise FileError(str(path), "a file that can be written", error.strerror) from error
        form = "matroska" if path.suffix.lower() == ".mkv" else "mp4"
        self._container = self._av.open(str(self._temporary), "w", format=form)
        self._container.metadata["title"] = "mitt"

    def write(self, pixels: Image) -> None:
        """Add a frame: grey, shape (height, width), or red, green, blue, shape (h, w, 3)."""
        if self._stream is None:
            self._stream = self._begin(pixels)
        kind = "gray" if pixels.ndim == 2 else "rgb24"
        frame = self._av.VideoFrame.from_ndarray(pixels, format=kind)
        self._container.mux(self._stream.encode(frame))

    def _begin(self, pixels: Image) -> Any:  # noqa: ANN401 (PyAV's, without types)
        """Return a stream for frames like ``pixels``."""
        stream = self._container.add_stream("ffv1" if self._lossless else "libx264", self._rate)
        stream.height, stream.width = pixels.shape[:2]
        if self._lossless:
            stream.pix_fmt = "gray" if pixels.ndim == 2 else "bgr0"
        else:
            stream.height, stream.width = (2 * (n // 2) for n in pixels.shape[:2])
            stream.pix_fmt, stream.options = "yuv420p", {"crf": "18", "preset": "veryfast"}
        return stream

    def __enter__(self) -> "VideoWriter":
        """Return the writer."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End the video; keep it unless an error, other than an interrupt, ends it."""
        try:
            if self._stream is not None:
                self._container.mux(self._stream.encode())
            self._container.close()
            if self._stream is not None and (kind is None or issubclass(kind, KeyboardInterrupt)):
                os.replace(self._temporary, self._path)
        except OSError as problem:
            reason = problem.strerror or "an error"
            raise FileError(str(self._path), "a file that can be written", reason) from problem
        finally:
            self._temporary.unlink(missing_ok=True)
