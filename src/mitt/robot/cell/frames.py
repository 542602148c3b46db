"""Frames of the cameras: through shared memory, and as the live loop shows them to its catcher.

Shared memory is a ring that one process writes and any number read:

    header   magic, cameras, height, width, slots, frames written so far
    slot     count before, stamp [s], count after; then the images, uint8

A writer notes the frame's count before and after it writes; a reader takes a frame whose two counts
are those that it looked for, before and after it has copied it. So nobody waits for anybody: a
reader that is too late has lost frames, and knows how many. A writer holds a lock (``flock``) on
the memory as long as it lives. x86-64 and ARM64 with aligned words.
"""

import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from fcntl import LOCK_EX, LOCK_NB, flock
from math import inf
from mmap import mmap
from pathlib import Path
from stat import S_ISREG
from typing import NamedTuple, Protocol, final

import numpy as np
from numpy.typing import NDArray

from mitt.clock import monotonic
from mitt.core.catcher.catcher import Catcher
from mitt.core.errors import InputError
from mitt.core.eyes.lens import Lens, straightener
from mitt.core.signals import Frame, Image

#: Where Linux shows shared memories.
_FOLDER = Path("/dev/shm")  # noqa: S108  # nosec B108
#: Says that a memory is such a ring, and in which version.
_MAGIC = 0x6D697474_0001
#: Frames in a ring: what a reader may be late by [ticks].
SLOTS = 64
_HEADER = np.dtype(
    {
        "names": ["magic", "cameras", "height", "width", "slots", "written"],
        "formats": [np.int64] * 6,
        "itemsize": 64,
    }
)
#: Before the images of a slot.
_EXPOSURE = np.dtype([("before", np.int64), ("stamp", np.float64), ("after", np.int64)])
#: Time without an image after which the cameras are lost [s]: six frames of 120 a second.
SILENT = 0.05


@final
class FrameSet(NamedTuple):
    """Images exposed together: stamp [s], number, one image a camera."""

    t: float
    number: int
    images: tuple[Image, ...]


def as_frames(seen: FrameSet, t: float) -> tuple[Frame, ...]:
    """Return a set as frames whose time is ``t`` [s]."""
    return tuple(
        Frame(t=t, camera=k, number=seen.number, pixels=image)
        for k, image in enumerate(seen.images)
    )


def memory_name(name: str) -> str:
    """Return a name that a shared memory can have."""
    if not name.replace("-", "").replace("_", "").isalnum() or len(name) > 60:
        raise InputError("source.memory", "a name of letters, digits, - and _", repr(name[:60]))
    return name


def _slot_size(cameras: int, height: int, width: int) -> int:
    """Return the size of a slot [bytes]."""
    return _EXPOSURE.itemsize + (cameras * height * width + 7) // 8 * 8


def _size_of(cameras: int, height: int, width: int, slots: int) -> int:
    """Return the size of a ring [bytes]."""
    return _HEADER.itemsize + slots * _slot_size(cameras, height, width)


@final
class FrameWriter:
    """Writes frames."""

    def __init__(self, name: str, cameras: int, height: int, width: int) -> None:
        """Make the ring; one that a writer left when it was killed is replaced."""
        size = _size_of(cameras, height, width, SLOTS)
        self._file, self._shape = _FOLDER / memory_name(name), (cameras, height, width)
        try:
            self._remove_left()
            self._fd = os.open(_FOLDER, os.O_RDWR | os.O_TMPFILE, 0o600)
            flock(self._fd, LOCK_EX | LOCK_NB)  # as long as this process lives
            os.truncate(self._fd, size)
            self._memory = memoryview(mmap(self._fd, size))
            self._head = np.frombuffer(self._memory, _HEADER, 1)
            self._head[0] = _MAGIC, cameras, height, width, SLOTS, 0
            # Whole and locked, or not there. With a folder Python follows the link (linkat).
            os.link(f"/proc/self/fd/{self._fd}", self._file, src_dir_fd=self._fd)
        except OSError as error:
            raise InputError(
                "source.memory",
                f"a shared memory called {name}",
                error.strerror,
                do="choose another name",
            ) from None

    def _remove_left(self) -> None:
        """Remove a ring of that name whose writer is dead; refuse anything else."""
        try:
            with self._file.open("rb") as left:
                if int.from_bytes(left.read(8), sys.byteorder) != _MAGIC:
                    raise InputError(
                        "source.memory",
                        "a name of its own",
                        f"a memory called {self._file.name} of another program",
                        do="choose another name",
                    )
                flock(left, LOCK_EX | LOCK_NB)
                # Another may have replaced it since it was opened; its own ring is locked.
                if os.path.samestat(self._file.lstat(), os.fstat(left.fileno())):
                    self._file.unlink()
        except FileNotFoundError:
            return
        except BlockingIOError:
            raise InputError(
                "source.memory",
                "one writer",
                f"another one of {self._file.name}",
                do="end it, or choose another name",
            ) from None

    def write(self, t: float, images: Sequence[Image]) -> None:
        """Write images that were exposed together at a stamp [s]."""
        count = int(self._head["written"][0]) + 1
        at = _HEADER.itemsize + count % SLOTS * _slot_size(*self._shape)
        slot = np.frombuffer(self._memory, _EXPOSURE, 1, at)
        pixels: NDArray[np.uint8] = np.frombuffer(
            self._memory, np.uint8, int(np.prod(self._shape)), at + _EXPOSURE.itemsize
        )
        slot["before"], slot["stamp"] = count, t
        for place, image in zip(pixels.reshape(self._shape), images, strict=True):
            place[:] = image
        slot["after"] = count
        self._head["written"] = count

    def close(self) -> None:
        """Take the memory away; who reads it may finish."""
        del self._head, self._memory
        with suppress(OSError):  # nobody's but its own
            if os.path.samestat(self._file.lstat(), os.fstat(self._fd)):
                self._file.unlink()
        os.close(self._fd)


@final
class FrameReader:
    """Reads frames. It copies them from the file: a memory that is cut short ends no process.

    Attributes:
        lost: Frames that were overwritten before they were read.
    """

    def __init__(self, name: str, shapes: Sequence[tuple[int, int]]) -> None:
        """Begin with the next frame of a ring whose images are those of a rig."""
        try:
            self._fd = os.open(
                _FOLDER / memory_name(name), os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC
            )
        except OSError:
            given = f"none called {name}"
            raise InputError(
                "source.memory",
                "a shared memory that the cameras write",
                given,
                do="start the cameras first",
            ) from None
        try:
            self._shape, self._slots, written = _checked_head(self._fd, shapes)
        except InputError:
            os.close(self._fd)
            raise
        self._next, self.lost = written + 1, 0

    def close(self) -> None:
        """Give the memory up."""
        os.close(self._fd)

    def take(self) -> list[FrameSet]:
        """Return all sets since the last call, oldest first; none from a memory that was cut."""
        head = np.zeros(1, _HEADER)
        whole = os.preadv(self._fd, [head.data], 0) == _HEADER.itemsize
        newest = int(head["written"][0])
        if not whole or newest < self._next - 1:  # cut, or another writer has begun
            self._next = newest + 1
        first, found = max(self._next, newest - self._slots + 2), []
        self.lost += first - self._next
        for count in range(first, newest + 1):
            seen = self._read(count)
            self.lost += seen is None
            found += [] if seen is None else [seen]
        self._next = newest + 1
        return found

    def _read(self, count: int) -> FrameSet | None:
        """Return a frame; None where it is another one by now, or cut."""
        size = _slot_size(*self._shape)
        at = _HEADER.itemsize + count % self._slots * size
        raw = os.pread(self._fd, size, at)
        again = os.pread(self._fd, _EXPOSURE.itemsize, at)  # after the images: they are whole
        if len(raw) < size or len(again) < _EXPOSURE.itemsize:
            return None
        before = np.frombuffer(raw, _EXPOSURE, 1)[0]
        after = np.frombuffer(again, _EXPOSURE, 1)[0]
        if not after["before"] == count == after["after"]:
            return None
        pixels: NDArray[np.uint8] = np.frombuffer(
            raw, np.uint8, int(np.prod(self._shape)), _EXPOSURE.itemsize
        )
        return FrameSet(float(before["stamp"]), count, tuple(pixels.reshape(self._shape)))


def _checked_head(
    fd: int, shapes: Sequence[tuple[int, int]]
) -> tuple[tuple[int, int, int], int, int]:
    """Return the images' shape, slots and frames so far of a ring, from its header."""
    of = os.fstat(fd)
    if not S_ISREG(of.st_mode) or of.st_uid not in (os.geteuid(), 0):
        raise InputError(
            "source.memory",
            "a shared memory of this user",
            "another one's",
            do="run the cameras as the same user",
        )
    raw = os.pread(fd, _HEADER.itemsize, 0)
    if len(raw) < _HEADER.itemsize:
        raise InputError("source.memory", "a ring of frames", f"{of.st_size} bytes")
    magic, *shape, slots, written = np.frombuffer(raw, _HEADER, 1)[0].tolist()
    if magic != _MAGIC or not 0 < slots <= 4096:
        raise InputError("source.memory", "a ring of frames of this version", "another")
    whole = min(shape) > 0 and max(shape) <= 65_536
    if not whole or of.st_size < _size_of(shape[0], shape[1], shape[2], slots):
        raise InputError("source.memory", "a whole ring of frames", f"{of.st_size} bytes")
    wanted = [len(shapes), *shapes[0]]
    if shape != wanted or len(set(shapes)) != 1:
        raise InputError(
            "images in source.memory",
            f"cameras, height, width {wanted}",
            shape,
            do="take the rig of these cameras",
        )
    return (shape[0], shape[1], shape[2]), slots, written


class FrameSource(Protocol):
    """Where frames come from."""

    def open(self) -> str:
        """Be ready to take frames; return what is wrong, nothing if all is well."""

    def take(self) -> Sequence[FrameSet]:
        """Return all frames since the last call, oldest first."""


@final
class SharedFrames:
    """Frames from a shared memory that may come and go with the process that writes it."""

    def __init__(self, name: str, shapes: Sequence[tuple[int, int]]) -> None:
        """Take the memory's name and the images' heights and widths [px]."""
        self._name, self._shapes = name, shapes
        self._reader: FrameReader | None = None
        self._said, self._due = "", 0.0

    def open(self) -> str:
        """Open the memory anew now and then: whoever writes it may have been started again."""
        if monotonic() <= self._due:
            return self._said
        if self._reader is not None:
            self._reader.close()
        self._reader, self._said = None, ""
        try:
            self._reader = FrameReader(self._name, self._shapes)
        except InputError as error:
            self._said = str(error)
        self._due = monotonic() + 0.5
        return self._said

    def take(self) -> Sequence[FrameSet]:
        """Return all frames since the last call; none while the memory is not open."""
        return () if self._reader is None else self._reader.take()


@final
class Sight:
    """Shows a catcher frames once it has learned its background in the ready pose."""

    def __init__(self, source: FrameSource | None, lenses: Sequence[Lens] = ()) -> None:
        """Take where frames come from, None where the ball is seen as points; lenses that bend."""
        self.source, self._straighten = source, [straightener(lens) for lens in lenses]
        self._views: list[tuple[Frame, ...]] = []
        self._seen, self._learned = 0, False
        self._came = self._stamp = -inf

    def open(self) -> str:
        """Say what is wrong with the cameras, nothing if all is well."""
        return "" if self.source is None else self.source.open()

    def fresh(self) -> None:
        """Begin for a catcher that has seen nothing."""
        self._views, self._seen, self._learned = [], 0, False

    def newest(self, now: float) -> FrameSet | None:
        """Return the newest frames since the last call, straight; None where there are none."""
        taken = () if self.source is None else self.source.take()
        if not taken:
            return None
        seen = taken[-1]
        if seen.t != self._stamp:  # one that hangs writes its last image again
            self._came, self._stamp = now, seen.t
        if self._straighten:
            seen = seen._replace(
                images=tuple(make(x) for make, x in zip(self._straighten, seen.images, strict=True))
            )
        return seen

    def silent(self, now: float) -> str:
        """Say that the cameras have sent nothing for too long; nothing if all is well."""
        if self.source is None or now - self._came < SILENT:
            return ""
        return f"no images for {1e3 * SILENT:.0f} ms"

    def show(self, catcher: Catcher, seen: FrameSet, t: float) -> tuple[Frame, ...]:
        """Return frames for the catcher; none as long as its background is learned from them.

        It is learned as by ``mitt catch``, from ten looks in 80 ms.
        """
        frames = as_frames(seen, t)
        if self._learned:
            return frames
        if self._seen % 8 == 0:
            self._views.append(frames)
        self._seen += 1
        if len(self._views) == 10:
            catcher.learn_background(self._views)
            self._learned = True
        return ()
