"""Cameras by what the user wrote: a video, a folder of images, ``genicam:`` or ``basler:``.

Live cameras are GenICam ones through harvesters with any maker's producer (``.cti``), and those of
Basler through pypylon. All give frames one after the other, each with its time and number.
"""

import re
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, final

import numpy as np

from mitt.clock import monotonic
from mitt.core.errors import FileError, InputError, check_package, heard
from mitt.core.signals import Frame, Image
from mitt.io.reading import read_bytes
from mitt.numerals import whole_of
from mitt.robot.cameras.ball_colour import BallColour

#: Largest image file that is read [bytes].
_MAX_BYTES = 100_000_000

SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm", ".webp")

_SECONDS = re.compile(r"([0-9]+\.[0-9]+)[^0-9]*$")
_DIGITS = re.compile(r"(?<![0-9])([0-9]+)[^0-9]*$")
#: Units of whole numbers since 1970 [s], by their digits, and the times that are believed [s]: from
#: 2001 to 2096, so that a date written out, or a counter, is none. Nanoseconds may count from
#: anywhere.
_UNITS = {13: 1e-3, 16: 1e-6, 19: 1e-9}
_BELIEVED = (1e9, 4e9)
_PARTS = re.compile(r"([0-9]+)")
#: Channels of the formats of GenICam that are read, and longest wait for a live frame [s].
_CHANNELS = {"Mono8": 1, "RGB8": 3, "BGR8": 3, "RGBa8": 4, "BGRa8": 4}
_TIMEOUT = 2.0
#: Share of the gap between two images of a camera up to which those of two are one instant.
_NEAR = 0.4
#: Frames of a video whose gaps are looked at.
_FIRST = 10
#: Images of a folder that are looked at for the bits that they use.
_LOOKS = 20


@dataclass(slots=True)
class Zero:
    """The stamp from which stamps count [s]; None before the first frame."""

    stamp: float | None = None

    def since(self, stamp: float) -> float:
        """Return the time of a stamp [s]."""
        self.stamp = stamp if self.stamp is None else self.stamp
        return stamp - self.stamp


def grey(pixels: Image) -> Image:
    """Return an image of one channel, shape (height, width): the mean of red, green, blue.

    Args:
        pixels: Image of 8 or 16 bits, shape (height, width) or (height, width, channels); a fourth
            is left out.
    """
    if pixels.ndim == 2:
        return np.ascontiguousarray(pixels)
    colour = pixels[:, :, : min(3, pixels.shape[2])].astype(np.uint32)
    return np.asarray(np.rint(colour.mean(axis=2)), dtype=pixels.dtype)


@final
class Depth:
    """How many bits the pixels of a source use: cameras of 10, 12 or 14 bits write them in 16.

    Attributes:
        bits: The most so far, an even number; 8 at least.
    """

    def __init__(self) -> None:
        """Begin with 8."""
        self.bits = 8

    def look(self, pixels: Image) -> None:
        """Learn from an image."""
        used = int(pixels.max(initial=0)).bit_length()
        self.bits = max(self.bits, used + used % 2)

    def eight(self, pixels: Image) -> Image:
        """Return an image in 8 bits, the upper ones of those that are used."""
        if pixels.dtype == np.uint8:
            return pixels
        self.look(pixels)
        return np.asarray(pixels >> (self.bits - 8), dtype=np.uint8)


class ImageSource(ABC):
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
        colour: The ball's, in which the pixels are looked at; None for their mean.
    """

    live = False

    def __init__(self, name: str, camera: int, fps: float | None) -> None:
        """Take the name, the index in the rig, and frames a second [Hz], None for stamps."""
        self.name, self._camera, self._fps = name, camera, fps
        self._number, self._arrivals = 0, Zero()
        self.zero, self.stamp, self.timed = Zero(), 0.0, self.live
        self.colour: BallColour | None = None

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

    def _in_grey(self, pixels: Image, depth: Depth, *, blue_first: bool = False) -> Image:
        """Return pixels of any depth and one or more channels in 8 grey bits."""
        if self.colour is None:
            return depth.eight(grey(pixels))
        if pixels.ndim == 2 or pixels.shape[2] < 3:
            raise InputError("--ball-colour", "cameras that show colours", f"{self.name} in grey")
        seen = depth.eight(pixels[:, :, :3])
        return self.colour.grey(seen[:, :, ::-1] if blue_first else seen)


def check_library(module: str) -> None:
    """Refuse to go on without a library of the extra ``cameras``; it is not loaded."""
    check_package("cameras", module, module, "cameras")


def optional(module: str) -> ModuleType:
    """Import a library of the extra ``cameras``."""
    try:
        return import_module(module)
    except ImportError:
        raise InputError(
            "cameras",
            f"the library {module.split('.', maxsplit=1)[0]}",
            "none",
            do="install mitt with its extra: mitt[cameras]",
        ) from None


@final
class ImageFolder(ImageSource):
    """A folder of images.

    The stamp of a frame is what its name ends with: seconds with a decimal point
    (``left_12.0345.png``), or 13, 16 or 19 digits of milli-, micro- or nanoseconds.
    """

    def __init__(self, path: Path, camera: int, *, fps: float | None) -> None:
        """List the images."""
        super().__init__(str(path), camera, fps)
        optional("cv2")
        paths = images_in(path)
        if fps is None:
            for first in paths[:2]:
                stamp(first)
        self._left, self._depth = iter(paths), Depth()
        if _decoded(paths[0]).dtype != np.uint8:  # else a dark frame would come out brighter
            for one in paths[:: -(-len(paths) // _LOOKS)]:
                self._depth.look(_decoded(one))

    def _grab(self) -> tuple[float, Image] | None:
        """Read the next image."""
        path = next(self._left, None)
        if path is None:
            return None
        pixels = self._in_grey(_decoded(path), self._depth, blue_first=True)
        return (stamp(path) if self._fps is None else 0.0), pixels

    def close(self) -> None:
        """Nothing is held open."""


@final
class Video(ImageSource):
    """A video file: anything that PyAV reads.

    Containers round time stamps (Matroska to 1 ms): where they lie within one such step of a
    constant rate, the time follows from that rate, also behind frames that were lost.
    """

    def __init__(self, path: Path, camera: int, *, fps: float | None) -> None:
        """Open the file."""
        super().__init__(str(path), camera, fps)
        self._av = optional("av")
        self._start: float | None = None
        self._lost, self._depth = 0, Depth()
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
        most = max(x.bits for x in picture.format.components)
        deep = most > 8
        if 8 < most < 16:  # what decodes these fills all 16 bits
            self._depth.bits = 16
        kinds = ("gray16le", "rgb48le") if deep else ("gray", "rgb24")
        kind = kinds[not picture.format.name.startswith("gray")]
        pixels = self._in_grey(picture.to_ndarray(format=kind), self._depth)
        return (self._time(picture.time) if self._fps is None else 0.0), pixels

    def close(self) -> None:
        """Close the file."""
        self._container.close()

    def _time(self, stamp: float | None) -> float:
        """Return the time of a frame [s]."""
        if stamp is None:
            raise FileError(self.name, "a video with time stamps", "none", do="say --fps")
        self._start = stamp if self._start is None else self._start
        if self._rate > 0.0:
            even = self._start + (self._number + self._lost) / self._rate
            lost = round((stamp - even) * self._rate) if stamp - even > 1.01 * self._tick else 0
            if abs(even + lost / self._rate - stamp) <= 1.01 * self._tick:
                self._lost += lost
                return even + lost / self._rate
        return float(stamp)


def _reason(error: Exception) -> str:
    """Return what PyAV says in a few words."""
    return str(error).split("]")[-1].strip()[:80] or type(error).__name__


def read_image(path: Path) -> Image:
    """Return an image in grey, shape (height, width), in 8 of the bits that it uses."""
    return Depth().eight(grey(_decoded(path)))


def _decoded(path: Path) -> Image:
    """Return an image of 8 or 16 bits as its file has them: blue, green, red, shape (h, w, 3)."""
    cv2 = optional("cv2")
    content = read_bytes(path, max_bytes=_MAX_BYTES, wanted="a readable image")
    data = np.frombuffer(content, dtype=np.uint8)
    pixels: Image | None = None
    with heard(), suppress(cv2.error):  # its decoders complain on the error stream
        kind = cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH
        pixels = cv2.imdecode(data, kind) if data.size else None
    if pixels is None or pixels.dtype not in (np.uint8, np.uint16):
        raise FileError(str(path), "an image of 8 or 16 bits", "a file that does not decode")
    return pixels


def picture_of(path: Path) -> Image:
    """Return red, green and blue of an image in 8 bits, shape (height, width, 3)."""
    return np.ascontiguousarray(Depth().eight(_decoded(path))[:, :, ::-1])


def images_in(path: Path) -> list[Path]:
    """Return the images of a folder in the order of the numbers in their names."""
    try:
        found = [p for p in path.iterdir() if p.suffix.lower() in SUFFIXES]
    except OSError as error:
        raise FileError(str(path), "a folder of images", error.strerror or "an error") from error
    if not found:
        raise FileError(str(path), f"images ({', '.join(SUFFIXES)})", "none")
    return sorted(
        found,
        key=lambda x: [(-1 if (k := whole_of(p)) is None else k, p) for p in _PARTS.split(x.stem)],
    )


def stamp(path: Path) -> float:
    """Return the time that a file's name ends with [s]."""
    seconds = _SECONDS.search(path.stem)
    if seconds:
        return float(seconds.group(1))
    digits = _DIGITS.search(path.stem)
    if digits:
        t = int(digits.group(1)) * _UNITS.get(len(digits.group(1)), 0.0)
        if len(digits.group(1)) == 19 or _BELIEVED[0] <= t < _BELIEVED[1]:
            return t
    raise FileError(
        str(path),
        "a name that ends with its time: seconds with a point (1.25.png),"
        " or 13, 16 or 19 digits of ms, us or ns since 1970",
        path.name,
        do="say --fps",
    )


def skew_of_times(specs: Sequence[str]) -> float | None:
    """Return how far the times of images of two cameras may differ to be one instant [s].

    A share of the least gap between two images of one camera, by the names of images, or by the
    first frames of videos. None where a camera is live, one is a video and another none, or a
    source says no time of its own.

    Args:
        specs: What the user called the cameras, two or more.
    """
    if len(specs) < 2:
        return None
    try:
        if all(Path(spec).is_dir() for spec in specs):
            times = [[stamp(path) for path in images_in(Path(spec))] for spec in specs]
        elif all(Path(spec).is_file() for spec in specs):
            times = [_first_times(Path(spec)) for spec in specs]
        else:
            return None
    except FileError:
        return None
    gaps = np.concatenate([np.diff(x) for x in times])
    return _NEAR * float(gaps.min()) if len(gaps) and gaps.min() > 0.0 else None


def _first_times(path: Path) -> list[float]:
    """Return the times of the first frames of a video [s]."""
    with closing(Video(path, 0, fps=None)) as video:
        frames = (video.read() for _ in range(_FIRST))
        return [frame.t for frame in frames if frame is not None]


@final
class Producers:
    """The GenTL producers in use; one that is loaded twice shows no device the second time."""

    def __init__(self) -> None:
        """Load none yet."""
        self._loaded: dict[Path, Any] = {}
        self._users: dict[Path, int] = {}

    def start(self, producer: Path, index: int) -> Any:  # noqa: ANN401 (harvesters has no types)
        """Return device ``index`` of a producer, started."""
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
class GenICam(ImageSource):
    """A camera behind a GenTL producer, 8 bits a channel; without stamps, timed on arrival."""

    live = True

    def __init__(
        self, producers: Producers, place: tuple[Path, int], camera: int, *, fps: float | None
    ) -> None:
        """Start a device: ``place`` is its producer and its index there."""
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
                pixels, blue_first = _pixels(self.name, buffer.payload.components[0])
                return t, self._in_grey(pixels, Depth(), blue_first=blue_first)
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


def _pixels(name: str, part: Any) -> tuple[Image, bool]:  # noqa: ANN401 (harvesters has no types)
    """Return a copy of a component's pixels, and whether blue comes first."""
    channels = _CHANNELS.get(part.data_format)
    if channels is None:
        raise FileError(
            name,
            f"pixels as one of {', '.join(_CHANNELS)}",
            part.data_format,
            do="set PixelFormat of the camera",
        )
    pixels = part.data.reshape(part.height, part.width, channels).copy()
    return (pixels[:, :, 0] if channels == 1 else pixels), part.data_format.startswith("BGR")


@final
class Basler(ImageSource):
    """A Basler camera, set to 8 bits a channel; without stamps, timed on arrival."""

    live = True

    def __init__(self, which: str, camera: int, *, fps: float | None, coloured: bool) -> None:
        """Open a camera by its serial number or its index and start it, in grey or in colours."""
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
            self._device.PixelFormat.Value = "RGB8" if coloured else "Mono8"
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
            t = 1e-9 * got.TimeStamp if self.timed else monotonic()
            return t, self._in_grey(got.Array, Depth())
        finally:
            got.Release()

    def close(self) -> None:
        """Stop the camera and release it."""
        self._device.StopGrabbing()
        self._device.Close()


@contextmanager
def open_cameras(
    specs: Sequence[str],
    *,
    fps: float | None = None,
    colours: Sequence[BallColour | None] | None = None,
) -> Iterator[list[ImageSource]]:
    """Open the cameras of a rig, and close them in the end.

    Args:
        specs: For each a video, a folder of images, ``genicam:PRODUCER.cti#INDEX`` or
            ``basler:SERIAL``.
        fps: Frames a second, where the source does not tell the time.
        colours: Of each camera that of the ball, where it is to be told from the ground by that.

    Raises:
        InputError: There is no such source; also its child FileError.
    """
    if fps is not None and not 0.01 <= fps <= 1e6:
        raise InputError("--fps", "a number of frames a second in 0.01..1e6", fps)
    producers = Producers()
    with ExitStack() as stack:
        cameras = list[ImageSource]()
        for k, (spec, colour) in enumerate(zip(specs, colours or [None] * len(specs), strict=True)):
            opened = _opened(spec, k, producers, fps, colour is not None)
            opened.colour = colour
            cameras.append(stack.enter_context(closing(opened)))
        yield cameras


def film_looks(spec: str, most: int, colour: BallColour | None = None) -> list[Image]:
    """Return images of a video or folder, ``most`` to twice as many, spread over all of it.

    None of a live camera: what it shows now does not come again.
    """
    with open_cameras((spec,), fps=1.0, colours=(colour,)) as (source,):
        return [] if source.live else spread_looks(source, most)


def spread_looks(source: ImageSource, most: int) -> list[Image]:
    """Return images of a source to its end, ``most`` to twice as many, spread over all of it."""
    kept, apart, number = list[Image](), 1, 0
    while (frame := source.read()) is not None:
        if number % apart == 0:
            kept.append(frame.pixels)
        if len(kept) > 2 * most:
            kept, apart = kept[::2], 2 * apart
        number += 1
    return kept


def check_cameras(specs: Sequence[str]) -> None:
    """Refuse sources whose library is not installed; nothing is opened."""
    for spec in specs:
        kind = spec.partition(":")[0]
        known = {"basler": "pypylon", "genicam": "harvesters"}
        check_library(known.get(kind, "cv2" if Path(spec).is_dir() else "av"))


def _opened(
    spec: str, camera: int, producers: Producers, fps: float | None, coloured: bool
) -> ImageSource:
    """Return one open camera."""
    kind, _, rest = spec.partition(":")
    if kind == "basler":
        return Basler(rest or "0", camera, fps=fps, coloured=coloured)
    if kind == "genicam":
        producer, _, index = rest.partition("#")
        number = whole_of(index or "0")
        if number is None or not 0 <= number < 100:
            raise InputError("genicam", "PRODUCER.cti#INDEX", spec)
        return GenICam(producers, (Path(producer), number), camera, fps=fps)
    path = Path(spec)
    return ImageFolder(path, camera, fps=fps) if path.is_dir() else Video(path, camera, fps=fps)
