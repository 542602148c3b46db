"""A camera by what the user wrote: a file, a folder, or ``genicam:`` and ``basler:``."""

from pathlib import Path

from mitt.errors import InputError
from mitt.link.cameras.basler import Basler
from mitt.link.cameras.folder import Folder
from mitt.link.cameras.genicam import GenICam
from mitt.link.cameras.source import Camera
from mitt.link.cameras.video import Video


def open_camera(spec: str, camera: int, *, fps: float | None = None) -> Camera:
    """Return an open camera.

    Args:
        spec: A video, a folder of images, ``genicam:PRODUCER.cti#INDEX`` or ``basler:SERIAL``.
        camera: Index of the camera in its rig.
        fps: Frames a second, where the source does not tell the time.

    Raises:
        InputError: There is no such source; also its child FileError.
    """
    if fps is not None and not 0.01 <= fps <= 1e6:
        raise InputError("--fps", "a number of frames a second in 0.01..1e6", fps)
    kind, _, rest = spec.partition(":")
    if kind == "basler":
        return Basler(rest or "0", camera, fps=fps)
    if kind == "genicam":
        producer, _, index = rest.partition("#")
        if not (index or "0").isdecimal():
            raise InputError("genicam", "PRODUCER.cti#INDEX", spec)
        return GenICam(Path(producer), int(index or "0"), camera, fps=fps)
    path = Path(spec)
    return Folder(path, camera, fps=fps) if path.is_dir() else Video(path, camera, fps=fps)
