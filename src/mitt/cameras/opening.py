"""Cameras by what the user wrote: a file, a folder, or ``genicam:`` and ``basler:``."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path

from mitt.cameras.live import Basler, GenICam, Producers
from mitt.cameras.recorded import Folder, Video
from mitt.cameras.source import Camera, check_library, share_zero
from mitt.errors import InputError


@contextmanager
def open_cameras(specs: Sequence[str], *, fps: float | None = None) -> Iterator[list[Camera]]:
    """Open the cameras of a rig, and close them in the end.

    Args:
        specs: For each a video, a folder of images, ``genicam:PRODUCER.cti#INDEX`` or
            ``basler:SERIAL``.
        fps: Frames a second, where the source does not tell the time.

    Raises:
        InputError: There is no such source; also its child FileError.
    """
    if fps is not None and not 0.01 <= fps <= 1e6:
        raise InputError("--fps", "a number of frames a second in 0.01..1e6", fps)
    producers = Producers()
    with ExitStack() as stack:
        cameras = [
            stack.enter_context(closing(_opened(spec, k, producers, fps)))
            for k, spec in enumerate(specs)
        ]
        share_zero(cameras)
        yield cameras


def check_cameras(specs: Sequence[str]) -> None:
    """Refuse sources whose library is not installed; nothing is opened.

    Raises:
        MissingPackageError: A library of the extra ``cameras`` is missing.
    """
    for spec in specs:
        kind = spec.partition(":")[0]
        known = {"basler": "pypylon", "genicam": "harvesters"}
        check_library(known.get(kind, "cv2" if Path(spec).is_dir() else "av"))


def _opened(spec: str, camera: int, producers: Producers, fps: float | None) -> Camera:
    """Return one open camera."""
    kind, _, rest = spec.partition(":")
    if kind == "basler":
        return Basler(rest or "0", camera, fps=fps)
    if kind == "genicam":
        producer, _, index = rest.partition("#")
        if not (index or "0").isdecimal():
            raise InputError("genicam", "PRODUCER.cti#INDEX", spec)
        return GenICam(producers, (Path(producer), int(index or "0")), camera, fps=fps)
    path = Path(spec)
    return Folder(path, camera, fps=fps) if path.is_dir() else Video(path, camera, fps=fps)
