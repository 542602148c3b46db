"""Cameras of every kind behind one interface: pixels, times and numbers are what was taken."""

import os
from collections.abc import Iterator
from contextlib import suppress
from fractions import Fraction
from pathlib import Path

import av
import cv2
import genicam
import numpy as np
import pytest
from numpy.typing import NDArray

from mitt.core.errors import FileError, InputError
from mitt.core.signals import Frame, Image
from mitt.robot.cameras import cameras as source
from mitt.robot.cameras.cameras import (
    ImageSource,
    grey,
    open_cameras,
    optional,
    read_image,
    skew_of_times,
)
from mitt.robot.cameras.two_cameras import PairCounts, pairs
from mitt.robot.cameras.video_writer import VideoWriter

VIKY = Path(genicam.__file__).parent / "viky.cti"


def images(count: int, shape: tuple[int, int] = (64, 96)) -> list[Image]:
    """Return random images, each different."""
    rng = np.random.default_rng(0)
    return [rng.integers(0, 256, shape, dtype=np.uint8) for _ in range(count)]


def all_of(spec: Path | str, *, fps: float | None = None, most: int = 100) -> list[Frame]:
    """Return the frames of a source."""
    with open_cameras([str(spec)], fps=fps) as (camera,):
        frames: list[Frame] = []
        while len(frames) < most and (frame := camera.read()) is not None:
            frames.append(frame)
        return frames


@pytest.mark.parametrize("rate", [1000.0, 120.0, 29.97])
def test_our_videos_come_back_to_the_bit_with_their_times(tmp_path: Path, rate: float) -> None:
    """ffv1 keeps each grey value; times are even, though Matroska rounds them to 1 ms."""
    taken = images(12)
    with VideoWriter(tmp_path / "a.mkv", rate=rate, lossless=True) as writer:
        for image in taken:
            writer.write(image)
    frames = all_of(tmp_path / "a.mkv")
    assert [f.number for f in frames] == list(range(12))
    assert all(f.camera == 0 for f in frames)
    assert all(np.array_equal(f.pixels, image) for f, image in zip(frames, taken, strict=True))
    assert np.abs(np.diff([f.t for f in frames]) - 1.0 / rate).max() < 2e-6


def test_a_video_for_people_is_read_in_grey(tmp_path: Path) -> None:
    """An mp4 of a plain grey comes back within three grey levels, at a rate that is said."""
    with VideoWriter(tmp_path / "a.mp4", rate=30.0) as writer:
        for _ in range(5):
            writer.write(np.full((64, 96, 3), 100, dtype=np.uint8))
    frames = all_of(tmp_path / "a.mp4", fps=500.0)
    assert [f.t for f in frames] == [0.002 * k for k in range(5)]
    assert all(abs(int(f.pixels.mean()) - 100) <= 3 for f in frames)


def test_times_of_an_uneven_video_are_kept(tmp_path: Path) -> None:
    """A gap in the container's stamps is a gap in the frames' times."""
    path = tmp_path / "gap.mkv"
    with av.open(str(path), "w") as container:
        stream = container.add_stream("ffv1", 100)
        stream.width, stream.height, stream.pix_fmt = 96, 64, "gray"
        for k, image in enumerate(images(6)):
            frame = av.VideoFrame.from_ndarray(image, format="gray")
            frame.pts, frame.time_base = (k if k < 3 else k + 20), Fraction(1, 100)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    t = np.array([f.t for f in all_of(path)])
    assert t == pytest.approx([0.0, 0.01, 0.02, 0.23, 0.24, 0.25], abs=1.1e-3)


def write_images(folder: Path, names: list[str]) -> list[Image]:
    """Write random images under some names and return them."""
    folder.mkdir()
    taken = images(len(names))
    for name, image in zip(names, taken, strict=True):
        assert cv2.imwrite(str(folder / name), image)
    return taken


def test_a_folder_is_read_in_the_order_of_its_numbers(tmp_path: Path) -> None:
    """Image 10 comes after image 9, and the rate gives the times."""
    taken = write_images(tmp_path / "a", [f"im{k}.png" for k in (9, 10, 8)])
    frames = all_of(tmp_path / "a", fps=100.0)
    for frame, k in zip(frames, (2, 0, 1), strict=True):
        assert np.array_equal(frame.pixels, taken[k])
    assert [f.t for f in frames] == [0.0, 0.01, 0.02]


@pytest.mark.parametrize(
    ("names", "times"),
    [
        (["l_0.0010.png", "l_0.0035.png"], [0.001, 0.0035]),
        (["1700000000000000000.png", "1700000000004000000.png"], [1.7e9, 1.7e9 + 0.004]),
        (["a-1700000000000000.png", "a-1700000000004000.png"], [1.7e9, 1.7e9 + 0.004]),
        (["1700000000000.png", "1700000000004.png"], [1.7e9, 1.7e9 + 0.004]),
    ],
)
def test_names_tell_the_time(tmp_path: Path, names: list[str], times: list[float]) -> None:
    """Seconds with a point, nanoseconds as ROS writes them, micro- and milliseconds since 1970."""
    write_images(tmp_path / "a", names)
    assert [f.t for f in all_of(tmp_path / "a")] == pytest.approx(times, abs=1e-6)


@pytest.mark.parametrize(
    "name",
    [
        "one",
        "7",
        "1700000000",
        "170000000000",
        "20231011162034500",
        "9700000000000000",
        "0000000000001234",
        "170000000000000000",
        "20231011162034",
    ],
)
def test_names_without_a_time_need_a_rate(tmp_path: Path, name: str) -> None:
    """No unit is guessed of a counter, a written date, or digits of no unit."""
    write_images(tmp_path / "a", [f"{name}.png"])
    with pytest.raises(FileError, match="say --fps"):
        all_of(str(tmp_path / "a"))


def test_files_that_are_no_images_are_one_line(tmp_path: Path) -> None:
    """No file, text as video, text as image, an empty folder, a rate of nothing."""
    (tmp_path / "text.mkv").write_text("no video")
    (tmp_path / "a").mkdir()
    for spec in (tmp_path / "none.mkv", tmp_path / "text.mkv", tmp_path / "a"):
        with pytest.raises(FileError, match="wanted"):
            all_of(str(spec))
    (tmp_path / "a" / "1.5.png").write_text("no image")
    with pytest.raises(FileError, match="does not decode"):
        all_of(tmp_path / "a")
    with pytest.raises(InputError, match="--fps"):
        all_of(str(tmp_path / "a"), fps=0.0)


def test_a_video_cut_in_the_middle_ends_early_or_says_so(tmp_path: Path) -> None:
    """What is left is read, or a file error is raised; it never passes for whole."""
    with VideoWriter(tmp_path / "a.mkv", rate=100.0, lossless=True) as writer:
        for image in images(20):
            writer.write(image)
    data = (tmp_path / "a.mkv").read_bytes()
    (tmp_path / "cut.mkv").write_bytes(data[: len(data) // 2])
    with suppress(FileError):
        assert 0 < len(all_of(tmp_path / "cut.mkv")) < 20


def interrupted(path: Path, error: type[BaseException]) -> None:
    """Write one frame of a video, then fail."""
    with VideoWriter(path, rate=10.0) as writer:
        writer.write(images(1)[0])
        raise error


def test_an_error_leaves_no_video_but_an_interrupt_does(tmp_path: Path) -> None:
    """A video takes its name when it is whole; what an interrupt leaves is kept."""
    with pytest.raises(ZeroDivisionError):
        interrupted(tmp_path / "a.mkv", ZeroDivisionError)
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(KeyboardInterrupt):
        interrupted(tmp_path / "a.mkv", KeyboardInterrupt)
    assert len(all_of(tmp_path / "a.mkv")) == 1
    assert list(tmp_path.iterdir()) == [tmp_path / "a.mkv"]


@pytest.mark.parametrize("name", ["a.avi", "a"])
def test_other_suffixes_are_refused(tmp_path: Path, name: str) -> None:
    """Only .mkv and .mp4 are written."""
    with pytest.raises(InputError, match="mkv"):
        VideoWriter(tmp_path / name, rate=10.0)


def test_grey_is_the_mean_of_the_colours() -> None:
    """Alpha does not count."""
    pixels = np.zeros((2, 2, 4), dtype=np.uint8)
    pixels[..., :3], pixels[..., 3] = (30, 60, 90), 255
    assert np.array_equal(grey(pixels), np.full((2, 2), 60))


def test_a_missing_extra_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    """It says what to install."""

    def nothing(name: str) -> None:
        raise ModuleNotFoundError(name)

    monkeypatch.setattr(source, "import_module", nothing)
    with pytest.raises(InputError, match=r"install mitt with its extra: mitt\[cameras\]"):
        optional("harvesters.core")


@pytest.fixture
def emulated() -> Iterator[None]:
    """Basler's virtual camera."""
    before = os.environ.get("PYLON_CAMEMU")
    os.environ["PYLON_CAMEMU"] = "1"
    yield
    if before is None:
        del os.environ["PYLON_CAMEMU"]


@pytest.mark.usefixtures("emulated")
def test_a_basler_camera_gives_frames() -> None:
    """The virtual one: numbered, timed, grey, by index and by serial number."""
    for spec in ("basler:0", "basler:0815-0000"):
        frames = all_of(spec, most=3)
        check_live(frames)
        assert frames[0].pixels.shape == (1040, 1024)
    with pytest.raises(FileError, match="0815-0000"):
        all_of("basler:7")


def test_a_genicam_camera_gives_frames() -> None:
    """The virtual one of the GenICam wheel; two devices of one producer at once."""
    with open_cameras([f"genicam:{VIKY}#0", f"genicam:{VIKY}#1"]) as (one, two):
        pairs = [(one.read(), two.read()) for _ in range(3)]
    check_live([a for a, _ in pairs if a is not None])
    check_live([b for _, b in pairs if b is not None])


def check_live(frames: list[Frame]) -> None:
    """Check numbers, times and pixels of three live frames."""
    assert [f.number for f in frames] == [0, 1, 2]
    assert frames[0].t == 0.0
    assert np.all(np.diff([f.t for f in frames]) > 0.0)
    pixels: NDArray[np.uint8] = frames[0].pixels
    assert pixels.dtype == np.uint8
    assert pixels.ndim == 2


def test_a_rate_times_a_camera_without_stamps() -> None:
    """Frames of a camera without a clock, triggered at a known rate."""
    assert [f.t for f in all_of(f"genicam:{VIKY}", fps=200.0, most=3)] == [0.0, 0.005, 0.01]


@pytest.mark.parametrize(
    ("spec", "says"),
    [
        ("genicam:none.cti", "producer"),
        (f"genicam:{VIKY}#99", "one of its"),
        (f"genicam:{VIKY}#x", "INDEX"),
    ],
)
def test_a_camera_that_is_not_there_is_one_line(spec: str, says: str) -> None:
    """No producer, no such device, no index."""
    with pytest.raises(InputError, match=says) as caught:
        all_of(spec)
    assert "\n" not in str(caught.value)


class Device(ImageSource):
    """A live camera whose device stamps its frames."""

    live = True

    def __init__(self, index: int, stamps: list[float]) -> None:
        """Take the stamps to come [s]."""
        super().__init__(f"device {index}", index, None)
        self._stamps = iter(stamps)

    def _grab(self) -> tuple[float, NDArray[np.uint8]] | None:
        """Return a black image."""
        t = next(self._stamps, None)
        return None if t is None else (t, np.zeros((4, 4), dtype=np.uint8))

    def close(self) -> None:
        """Nothing is open."""


@pytest.mark.parametrize("skew", [0.0, 0.003, 0.35, -0.35, 3600.0])
def test_devices_of_a_rig_keep_their_skew(skew: float) -> None:
    """Stamps count from one zero, so that a camera that is late is seen to be."""
    stamps = [1000.0 + 0.01 * k for k in range(20)]
    left, right = Device(0, stamps), Device(1, [t + skew for t in stamps])
    counts = PairCounts()
    together = [x for x in pairs((left, right), counts, max_skew=0.004, most=20) if len(x) == 2]
    assert counts.first_gap == pytest.approx(-skew)
    assert all(abs(a.t - b.t) <= 0.004 for a, b in together)
    whole = round(abs(skew) / 0.01) if abs(skew) < 0.2 else 20
    assert counts.paired == 20 - min(whole, 20)


@pytest.mark.parametrize("colour", [(230, 110, 20), (20, 110, 230), (7, 7, 7), (255, 0, 0)])
def test_a_picture_has_one_grey_as_file_video_and_live(
    tmp_path: Path, colour: tuple[int, int, int]
) -> None:
    """The mean of red, green and blue, whatever the source; grey files stay as they are."""
    pixels = np.full((16, 16, 3), colour, dtype=np.uint8)
    path = tmp_path / "a.png"
    assert cv2.imwrite(str(path), pixels[:, :, ::-1])
    assert np.array_equal(read_image(path), grey(pixels))
    plain = np.arange(256, dtype=np.uint8).reshape(16, 16)
    assert cv2.imwrite(str(path), plain)
    assert np.array_equal(read_image(path), plain)


@pytest.mark.parametrize("bits", [8, 10, 12, 14, 16])
@pytest.mark.parametrize("suffix", ["png", "tiff", "pgm", "mkv"])
def test_pixels_of_any_depth_are_read_by_the_bits_that_they_use(
    tmp_path: Path, bits: int, suffix: str
) -> None:
    """Of 10, 12 or 14 bits in 16 the upper 8 count, also in the dark frames of a film."""
    bright = images(5)
    taken: list[Image] = [np.asarray(bright[0] // 8, dtype=np.uint8), *bright[1:]]
    deep = [np.left_shift(image, bits - 8, dtype=np.uint16) for image in taken]
    if suffix == "mkv":
        deep, taken = deep[1:], taken[1:]
        with av.open(str(tmp_path / "a.mkv"), "w") as container:
            stream = container.add_stream("ffv1", 100)
            stream.width, stream.height, stream.pix_fmt = *deep[0].shape[::-1], "gray16le"
            for image in deep:
                container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="gray16le")))
            container.mux(stream.encode())
        path = tmp_path / "a.mkv"
    else:
        path = tmp_path
        for k, image in enumerate(deep):
            assert cv2.imwrite(str(path / f"{k}.{suffix}"), image)
    for frame, image in zip(all_of(path, fps=100.0), taken, strict=True):
        assert np.array_equal(frame.pixels, image)


def test_other_numbers_than_those_of_pixels_are_refused(tmp_path: Path) -> None:
    """An image of floating point numbers has no known scale."""
    assert cv2.imwrite(str(tmp_path / "a.tiff"), np.ones((16, 16), dtype=np.float32))
    with pytest.raises(FileError, match="8 or 16 bits"):
        read_image(tmp_path / "a.tiff")


def test_frames_behind_a_lost_one_keep_the_rate_of_the_container(tmp_path: Path) -> None:
    """Times that Matroska rounds to 1 ms are those of the rate, also behind a gap."""
    path, rate = tmp_path / "gap.mkv", 120
    with av.open(str(path), "w") as container:
        stream = container.add_stream("ffv1", rate)
        stream.width, stream.height, stream.pix_fmt = 96, 64, "gray"
        for k, image in enumerate(images(40)):
            if k in (11, 25, 26):
                continue
            frame = av.VideoFrame.from_ndarray(image, format="gray")
            frame.pts, frame.time_base = k, Fraction(1, rate)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    numbers = rate * np.array([f.t for f in all_of(path)])
    assert numbers == pytest.approx([k for k in range(40) if k not in (11, 25, 26)], abs=1e-6)


def test_images_named_by_their_times_are_one_instant_within_a_share_of_their_gap(
    tmp_path: Path,
) -> None:
    """Names without a time, the same time twice, or one camera alone tell of none."""
    for name, names in {
        "left": ("a_1.00", "a_1.10", "a_1.30"),
        "right": ("b_1.001", "b_1.101", "b_1.301"),
        "count": ("1", "2", "3"),
        "twice": ("a_1.00", "b_1.00", "c_1.30"),
    }.items():
        (tmp_path / name).mkdir()
        for x in names:
            (tmp_path / name / f"{x}.png").write_bytes(b"")
    left, right, count, twice = (str(tmp_path / x) for x in ("left", "right", "count", "twice"))
    assert skew_of_times((left, right)) == pytest.approx(0.04)
    assert skew_of_times((left, count)) is None
    assert skew_of_times((left, twice)) is None
    assert skew_of_times((left,)) is None
    assert skew_of_times((left, "genicam:x.cti#0")) is None


def test_frames_of_two_videos_are_one_instant_by_the_times_of_their_containers(
    tmp_path: Path,
) -> None:
    """A camera that lost a frame has none at that instant, and all others are of one instant."""
    taken, lost = images(12), 5
    for name in ("left", "right"):
        with av.open(str(tmp_path / f"{name}.mkv"), "w") as container:
            stream = container.add_stream("ffv1", 30)
            stream.width, stream.height, stream.pix_fmt = *taken[0].shape[::-1], "gray"
            for k, image in enumerate(taken):
                if name == "left" or k != lost:
                    frame = av.VideoFrame.from_ndarray(image, format="gray")
                    frame.pts, frame.time_base = k, Fraction(1, 30)
                    container.mux(stream.encode(frame))
            container.mux(stream.encode())
    specs = [str(tmp_path / f"{name}.mkv") for name in ("left", "right")]
    skew = skew_of_times(specs)
    assert skew is not None
    assert skew == pytest.approx(0.4 / 30.0, rel=0.05)
    with open_cameras(specs) as (left, right):
        seen = list(pairs((left, right), PairCounts(), max_skew=skew, most=None))
    assert [len(x) for x in seen] == [1 if k == lost else 2 for k in range(12)]
    assert all(np.array_equal(x[0].pixels, x[-1].pixels) for x in seen)
    assert skew_of_times((specs[0], str(tmp_path))) is None
