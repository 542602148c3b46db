"""Live cameras: GenICam through harvesters, any maker's producer (``.cti``); Basler by pypylon."""

from pathlib import Path
from typing import Any, final

from mitt.cameras.source import Camera, grey, optional
from mitt.errors import FileError
from mitt.link.clock import monotonic
from mitt.signals import Image

#: Channels of the formats that are read, and longest wait for a frame [s].
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
class GenICam(Camera):
    """A camera behind a GenTL producer, 8 bits a channel; without stamps, timed on arrival."""

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
        super().__init__(f"genicam:{self._producer}#{index}", camera, fps)
        self._device = producers.start(self._producer, index)

    def _grab(self) -> tuple[float, Image]:
        """Fetch the next frame."""
        try:
            with self._device.fetch(timeout=_TIMEOUT) as buffer:
                try:
                    t, self.timed = 1e-9 * float(buffer.timestamp_ns), True
                except Exception:
                    t, self.timed = monotonic(), False
                return t, _pixels(self.name, buffer.payload.components[0])
        except FileError:
            raise
        except Exception as error:
            wanted = f"a frame within {_TIMEOUT:g} s"
            raise FileError(self.name, wanted, str(error)[:100] or "none") from error

    def close(self) -> None:
        """Stop the camera and release the producer."""
        self._device.stop()
        self._device.destroy()
        self._producers.release(self._producer)


def _pixels(name: str, part: Any) -> Image:  # noqa: ANN401 (harvesters has no types)
    """Return a grey copy of a component's pixels."""
    channels = _CHANNELS.get(part.data_format)
    if channels is None:
        raise FileError(name, f"pixels as one of {', '.join(_CHANNELS)}", part.data_format,
                        do="set PixelFormat of the camera")  # fmt: skip
    return grey(part.data.reshape(part.height, part.width, channels).copy().squeeze())


@final
class Basler(Camera):
    """A Basler camera, set to 8 grey bits; without stamps, timed on arrival."""

    live = True

    def __init__(self, which: str, camera: int, *, fps: float | None) -> None:
        """Open a camera by its serial number or its index and start it.

        Raises:
            FileError: There is no such camera, or it does not start.
        """
        super().__init__(f"basler:{which}", camera, fps)
        self._pylon = optional("pypylon.pylon")
        factory = self._pylon.TlFactory.GetInstance()
        found = list(factory.EnumerateDevices())
        by_serial = {device.GetSerialNumber(): device for device in found}
        by_index = {str(k): device for k, device in enumerate(found)}
        device = by_serial.get(which) or by_index.get(which)
        if device is None:
            known = ", ".join(by_serial) or "no camera at all"
            raise FileError(self.name, f"a serial number or an index ({known})", which)
        try:
            self._device = self._pylon.InstantCamera(factory.CreateDevice(device))
            self._device.Open()
            self._device.PixelFormat.Value = "Mono8"
            self._device.StartGrabbing(self._pylon.GrabStrategy_OneByOne)
        except self._pylon.GenericException as error:
            raise FileError(self.name, "a camera that starts", str(error)[:100]) from error

    def _grab(self) -> tuple[float, Image]:
        """Retrieve the next frame."""
        raises = self._pylon.TimeoutHandling_ThrowException
        try:
            got = self._device.RetrieveResult(int(1000 * _TIMEOUT), raises)
        except self._pylon.GenericException as error:
            raise FileError(self.name, "a frame within 2 s", str(error)[:100]) from error
        try:
            if not got.GrabSucceeded():
                raise FileError(self.name, "a whole frame", got.GetErrorDescription())
            self.timed = bool(got.TimeStamp)
            return (1e-9 * got.TimeStamp if self.timed else monotonic()), grey(got.Array)
        finally:
            got.Release()

    def close(self) -> None:
        """Stop the camera and release it."""
        self._device.StopGrabbing()
        self._device.Close()
