"""What all cameras have in common: frames one after the other, each with its time and number."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from importlib import import_module
from types import ModuleType

import numpy as np

from mitt.errors import InputError, check_package
from mitt.signals import Frame, Image


class Zero:
    """The stamp from which stamps count.

    Attributes:
        stamp: That stamp [s]; None before the first frame.
    """

    def __init__(self) -> None:
        """Begin without one."""
        self.stamp: float | None = None

    def since(self, stamp: float) -> float:
        """Return the time of a stamp [s]."""
        self.stamp = stamp if self.stamp is None else self.stamp
        return stamp - self.stamp


class Camera(ABC):
    """A video, a folder of images, or a live camera.

    The time of a frame is its number over ``fps`` or, without that, its stamp. Stamps of devices
    count from the first frame of any camera of a rig, their clocks being taken for one; times of
    arrival count from the camera's own first frame.

    Attributes:
        name: What the user called it.
        live: Whether it runs until it is closed.
        zero: From where the stamps of devices count.
        stamp: Stamp of the last frame [s].
        timed: Whether that is the device's own.
    """

    live = False

    def __init__(self, name: str, camera: int, fps: float | None) -> None:
        """Take the name, the index in the rig, and frames a second [Hz], None for stamps."""
        self.name, self._camera, self._fps = name, camera, fps
        self._number, self._arrivals = 0, Zero()
        self.zero, self.stamp, self.timed = Zero(), 0.0, self.live

    def read(self) -> Frame | None:
        """Return the next frame; None at the end.

        Raises:
            FileError: The file is damaged, has no times, or the camera does not answer.
        """
        got = self._grab()
        if got is None:
            return None
        (t, pixels), number = got, self._number
        self.stamp = t
        if self._fps is not None:
            t = number / self._fps
        elif self.live:
            t = (self.zero if self.timed else self._arrivals).since(t)
        self._number += 1
        return Frame(t=t, camera=self._camera, number=number, pixels=pixels)

    @abstractmethod
    def _grab(self) -> tuple[float, Image] | None:
        """Return stamp [s], any if ``fps`` is given, and grey pixels; None at the end."""

    @abstractmethod
    def close(self) -> None:
        """Close the file or release the device."""


def check_library(module: str) -> None:
    """Refuse to go on without a library of the extra ``cameras``; it is not loaded.

    Raises:
        MissingPackageError: It is not installed.
    """
    check_package("cameras", module, module, "cameras")


def share_zero(cameras: Sequence[Camera]) -> None:
    """Let the stamps of the devices of a rig count from the first frame of any of them."""
    for camera in cameras[1:]:
        camera.zero = cameras[0].zero


def optional(module: str) -> ModuleType:
    """Import a library of the extra ``cameras``.

    Raises:
        InputError: It is not installed.
    """
    try:
        return import_module(module)
    except ImportError:
        raise InputError("cameras", f"the library {module.split('.', maxsplit=1)[0]}", "none",
                         do="install mitt with its extra: mitt[cameras]") from None  # fmt: skip


def grey(pixels: Image) -> Image:
    """Return an image of one channel, shape (height, width): the mean of red, green, blue.

    Args:
        pixels: Image, shape (height, width) or (height, width, channels); a fourth is left out.
    """
    if pixels.ndim == 2:
        return np.ascontiguousarray(pixels, dtype=np.uint8)
    colour = pixels[:, :, : min(3, pixels.shape[2])].astype(np.uint16)
    return np.asarray(np.rint(colour.mean(axis=2)), dtype=np.uint8)
