"""GenICam cameras through harvesters: any producer (``.cti``) that a maker ships."""

from pathlib import Path
from typing import Any, final

import numpy as np

from mitt.errors import FileError
from mitt.link.cameras.source import grey, optional
from mitt.link.clock import monotonic
from mitt.signals import Frame

#: Channels and planes of the formats that are read.
_CHANNELS = {"Mono8": 1, "RGB8": 3, "BGR8": 3, "RGBa8": 4, "BGRa8": 4}
_TIMEOUT = 2.0


@final
class Producers:
    """The GenTL producers in use; one that is loaded twice shows no device the second time."""

    def __init__(self) -> None:
        """Load none yet."""
        self._loaded: dict[Path, Any] = {}
        self._users: dict[Path, int] = {}

    def start(self, producer: Path, index: int) -> Any:  # noqa: ANN401 (harvesters has no types)
        """Return device ``index`` of a producer, started.

        Raises:
            FileError: The producer does not load, has no such device, or it does not start.
        """
        core = optional("harvesters.core")
        if not producer.is_file():
            raise FileError(str(producer), "a GenTL producer (.cti)", "no such file")
        path = producer.resolve()
        self._users[path] = self._users.get(path, 0) + 1
        try:
            if path not in self._loaded:
                self._loaded[path] = core.Harvester()
                self._loaded[path].add_file(str(path))
                self._loaded[path].update()
            count = len(self._loaded[path].device_info_list)
            if not 0 <= index < count:
                raise FileError(str(producer), f"the index of one of its {count} devices", index)
            device = self._loaded[path].create(index)
            device.start()
        except FileError:
            self.release(producer)
            raise
        except Exception as error:  # harvesters raises the errors of every producer
            self.release(producer)
            name = f"genicam:{producer}#{index}"
            raise FileError(name, "a camera that starts", str(error)[:100]) from error
        return device

    def release(self, producer: Path) -> None:
        """Unload a producer when its last device is closed."""
        path = producer.resolve()
        self._users[path] -= 1
        if self._users[path] == 0 and path in self._loaded:
            self._loaded.pop(path).reset()


@final
class GenICam:
    """A camera behind a GenTL producer, 8 bits a channel.

    The time of a frame is the device's stamp since its first frame; that of a device without
    stamps is its number over ``fps`` or, without that, its arrival.
    """

    live = True

    def __init__(
        self, producers: Producers, place: tuple[Path, int], camera: int, *, fps: float | None
    ) -> None:
        """Start a device.

        Args:
            producers: Producers in use.
            place: Producer and index of the device.
            camera: Index of the camera in its rig.
            fps: Frames a second, where the device does not tell the time.

        Raises:
            FileError: The producer does not load, has no such device, or it does not start.
        """
        self._producers, (self._producer, index) = producers, place
        self.name = f"genicam:{self._producer}#{index}"
        self._device = producers.start(self._producer, index)
        self._camera, self._fps, self._number = camera, fps, 0
        self._first: float | None = None

    def read(self) -> Frame | None:
        """Return the next frame."""
        try:
            with self._device.fetch(timeout=_TIMEOUT) as buffer:
                t = self._time(buffer)
                pixels = _pixels(self.name, buffer.payload.components[0])
        except FileError:
            raise
        except Exception as error:
            wanted = f"a frame within {_TIMEOUT:g} s"
            raise FileError(self.name, wanted, str(error)[:100] or "none") from error
        number, self._number = self._number, self._number + 1
        return Frame(t=t, camera=self._camera, number=number, pixels=pixels)

    def close(self) -> None:
        """Stop the camera and let go of the producer."""
        self._device.stop()
        self._device.destroy()
        self._producers.release(self._producer)

    def _time(self, buffer: Any) -> float:  # noqa: ANN401 (harvesters has no types)
        """Return the time of a frame since the first [s]."""
        if self._fps is not None:
            return self._number / self._fps
        try:
            t = 1e-9 * float(buffer.timestamp_ns)
        except Exception:
            t = monotonic()
        self._first = t if self._first is None else self._first
        return t - self._first


def _pixels(name: str, part: Any) -> np.ndarray[Any, np.dtype[np.uint8]]:  # noqa: ANN401
    """Return a grey copy of a component's pixels."""
    channels = _CHANNELS.get(part.data_format)
    if channels is None:
        raise FileError(name, f"pixels as one of {', '.join(_CHANNELS)}", part.data_format,
                        do="set PixelFormat of the camera")  # fmt: skip
    return grey(part.data.reshape(part.height, part.width, channels).copy().squeeze())
