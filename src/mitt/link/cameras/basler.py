"""Basler cameras through pypylon."""

from typing import final

from mitt.errors import FileError
from mitt.link.cameras.source import grey, optional
from mitt.link.clock import monotonic
from mitt.signals import Frame

_TIMEOUT_MS = 2000


@final
class Basler:
    """A Basler camera, set to 8 grey bits.

    The time of a frame is the device's stamp since its first frame; that of a device without
    stamps is its number over ``fps`` or, without that, its arrival.
    """

    live = True

    def __init__(self, which: str, camera: int, *, fps: float | None) -> None:
        """Open a camera by its serial number or its index and start it.

        Raises:
            FileError: There is no such camera, or it does not start.
        """
        self.name = f"basler:{which}"
        self._pylon = optional("pypylon.pylon")
        self._camera, self._fps, self._number = camera, fps, 0
        self._first: float | None = None
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

    def read(self) -> Frame | None:
        """Return the next frame."""
        try:
            got = self._device.RetrieveResult(
                _TIMEOUT_MS, self._pylon.TimeoutHandling_ThrowException
            )
        except self._pylon.GenericException as error:
            raise FileError(self.name, "a frame within 2 s", str(error)[:100]) from error
        try:
            if not got.GrabSucceeded():
                raise FileError(self.name, "a whole frame", got.GetErrorDescription())
            pixels, t = grey(got.Array), self._time(got.TimeStamp)
        finally:
            got.Release()
        number, self._number = self._number, self._number + 1
        return Frame(t=t, camera=self._camera, number=number, pixels=pixels)

    def close(self) -> None:
        """Stop the camera and let go of it."""
        self._device.StopGrabbing()
        self._device.Close()

    def _time(self, ticks: int) -> float:
        """Return the time of a frame since the first [s]."""
        if self._fps is not None:
            return self._number / self._fps
        t = 1e-9 * ticks if ticks else monotonic()
        self._first = t if self._first is None else self._first
        return t - self._first
