"""What all cameras have in common: frames one after the other, each with its time and number."""

from importlib import import_module
from types import ModuleType
from typing import Protocol

import numpy as np

from mitt.errors import InputError
from mitt.signals import Frame, Image


class Camera(Protocol):
    """A video, a folder of images, or a camera that runs.

    Attributes:
        name: What the user called it.
        live: Whether it goes on until it is told to stop.
    """

    name: str
    live: bool

    def read(self) -> Frame | None:
        """Return the next frame; None at the end.

        Raises:
            FileError: The file is damaged, or the camera stopped to answer.
        """

    def close(self) -> None:
        """Let go of file or device."""


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
