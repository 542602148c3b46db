"""Frames through shared memory: a ring that one process writes and any number read.

    header   magic, cameras, height, width, slots, frames written so far; int64 each
    slot     count before, stamp [s] as float64, count after; then the images, uint8

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
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import NamedTuple, Self, final

import numpy as np
from numpy.typing import NDArray

from mitt.errors import InputError
from mitt.signals import Frame, Image

#: Where Linux shows shared memories.
_FOLDER = Path("/dev/shm")  # noqa: S108  # nosec B108
#: Says that a memory is such a ring, and in which version.
_MAGIC = 0x6D697474_0001
#: Most cameras, rows, columns.
_MOST = 65_536
#: Frames in a ring: what a reader may be late by [ticks].
SLOTS = 64
_MAGIC_AT, _CAMERAS, _HEIGHT, _WIDTH, _SLOTS, _WRITTEN = range(6)
_HEAD = 8 * 8
_SLOT_HEAD = 3 * 8
_BEFORE, _STAMP, _AFTER = range(3)


@final
class FrameSet(NamedTuple):
    """Images exposed together: stamp [s], number, one image a camera."""

    t: float
    number: int
    images: tuple[Image, ...]


def frames_of(seen: FrameSet, t: float) -> tuple[Frame, ...]:
    """Return a set as frames whose time is ``t`` [s]."""
    return tuple(
        Frame(t=t, camera=k, number=seen.number, pixels=image)
        for k, image in enumerate(seen.images)
    )


def _checked(name: str) -> str:
    """Return a name that a shared memory can have."""
    if not name.replace("-", "").replace("_", "").isalnum() or len(name) > 60:
        raise InputError("source.memory", "a name of letters, digits, - and _", repr(name[:60]))
    return name


def _size_of(cameras: int, height: int, width: int, slots: int) -> int:
    """Return the size of a ring [bytes]."""
    return _HEAD + slots * (_SLOT_HEAD + (cameras * height * width + 7) // 8 * 8)


class _Ring:
    """The parts of the memory."""

    def __init__(self, memory: memoryview) -> None:
        """Lay them out as the header says."""
        self._head: NDArray[np.int64] = np.frombuffer(memory, np.int64, 8)
        _, cameras, height, width, slots, *_ = self._head.tolist()
        self._size = _SLOT_HEAD + (cameras * height * width + 7) // 8 * 8
        shape = (cameras, height, width)
        self._counts: list[NDArray[np.int64]] = []
        self._stamps: list[NDArray[np.float64]] = []
        self._images: list[NDArray[np.uint8]] = []
        for k in range(slots):
            at = _HEAD + k * self._size
            self._counts.append(np.frombuffer(memory, np.int64, 3, at))
            self._stamps.append(np.frombuffer(memory, np.float64, 3, at))
            pixels = np.frombuffer(memory, np.uint8, int(np.prod(shape)), at + _SLOT_HEAD)
            self._images.append(pixels.reshape(shape))

    def close(self) -> None:
        """Give the memory up: it goes with the last array in it."""
        del self._head, self._counts, self._stamps, self._images


@final
class FrameWriter(_Ring):
    """Writes frames."""

    def __init__(self, name: str, cameras: int, height: int, width: int) -> None:
        """Make the ring; one that a writer left when it was killed is replaced.

        Raises:
            InputError: The memory cannot be made, is no ring, or its writer lives.
        """
        size = _size_of(cameras, height, width, SLOTS)
        self._file = _FOLDER / _checked(name)
        try:
            self._remove_left()
            self._fd = os.open(_FOLDER, os.O_RDWR | os.O_TMPFILE, 0o600)
            flock(self._fd, LOCK_EX | LOCK_NB)  # as long as this process lives
            os.truncate(self._fd, size)
            memory = memoryview(mmap(self._fd, size))
            head: NDArray[np.int64] = np.frombuffer(memory, np.int64, 8)
            head[:6] = _MAGIC, cameras, height, width, SLOTS, 0
            del head
            # Whole and locked, or not there. With a folder Python follows the link (linkat).
            os.link(f"/proc/self/fd/{self._fd}", self._file, src_dir_fd=self._fd)
        except OSError as error:
            raise InputError("source.memory", f"a shared memory called {name}", error.strerror,
                             do="choose another name") from None  # fmt: skip
        super().__init__(memory)

    def _remove_left(self) -> None:
        """Remove a ring of that name whose writer is dead; refuse anything else."""
        try:
            with self._file.open("rb") as left:
                head = left.read(8)  # nothing where its writer was killed as it began
                if head and int.from_bytes(head, sys.byteorder) != _MAGIC:
                    raise InputError("source.memory", "a name of its own",
                                     f"a memory called {self._file.name} of another program",
                                     do="choose another name")  # fmt: skip
                flock(left, LOCK_EX | LOCK_NB)
                # Another may have replaced it since it was opened; its own ring is locked.
                if os.path.samestat(self._file.stat(), os.fstat(left.fileno())):
                    self._file.unlink()
        except FileNotFoundError:
            return
        except BlockingIOError:
            raise InputError("source.memory", "one writer", f"another one of {self._file.name}",
                             do="end it, or choose another name") from None  # fmt: skip

    def write(self, t: float, images: Sequence[Image]) -> None:
        """Write images that were exposed together at a stamp [s]."""
        count = int(self._head[_WRITTEN]) + 1
        k = count % SLOTS
        self._counts[k][_BEFORE] = count
        self._stamps[k][_STAMP] = t
        for place, image in zip(self._images[k], images, strict=True):
            place[:] = image
        self._counts[k][_AFTER] = count
        self._head[_WRITTEN] = count

    def close(self) -> None:
        """Take the memory away; who reads it may finish."""
        super().close()
        with suppress(OSError):  # nobody's but its own
            if os.path.samestat(self._file.stat(), os.fstat(self._fd)):
                self._file.unlink()
        os.close(self._fd)


@final
class FrameReader(_Ring):
    """Reads frames.

    Attributes:
        lost: Frames that were overwritten before they were read.
    """

    @classmethod
    def named(cls, name: str, shapes: Sequence[tuple[int, int]]) -> Self:
        """Return a reader of a ring whose images are those of a rig.

        Raises:
            InputError: There is none, it is no ring, or its images are others.
        """
        file = _FOLDER / _checked(name)
        try:
            with file.open("rb") as opened:  # SharedMemory of a reader would remove it at its end
                memory = memoryview(mmap(opened.fileno(), 0, access=ACCESS_READ))
        except (OSError, ValueError):
            given = f"none called {name}"
            raise InputError("source.memory", "a shared memory that the cameras write", given,
                             do="start the cameras first") from None  # fmt: skip
        if len(memory) < _HEAD:
            raise InputError("source.memory", "a ring of frames", f"{len(memory)} bytes")
        found: NDArray[np.int64] = np.frombuffer(memory, np.int64, 8)
        head = [int(x) for x in found]
        del found
        wanted = [len(shapes), *shapes[0]]
        if head[0] != _MAGIC or not 0 < head[_SLOTS] <= 4096:
            raise InputError("source.memory", "a ring of frames of this version", "another")
        whole = min(head[1:4]) > 0 and max(head[1:4]) <= _MOST
        if not whole or len(memory) < _size_of(*head[1:5]):
            raise InputError("source.memory", "a whole ring of frames", f"{len(memory)} bytes")
        if head[1:4] != wanted or len(set(shapes)) != 1:
            raise InputError("images in source.memory", f"cameras, height, width {wanted}",
                             head[1:4], do="take the rig of these cameras")  # fmt: skip
        return cls(memory)

    def __init__(self, memory: memoryview) -> None:
        """Begin with the next frame."""
        super().__init__(memory)
        self._next, self.lost = int(self._head[_WRITTEN]) + 1, 0

    def take(self) -> list[FrameSet]:
        """Return all sets since the last call, oldest first."""
        newest, slots = int(self._head[_WRITTEN]), len(self._counts)
        if newest < self._next - 1:  # another writer has begun
            self._next = newest + 1
        first, found = max(self._next, newest - slots + 2), []
        self.lost += first - self._next
        for count in range(first, newest + 1):
            k = count % slots
            stamp, images = float(self._stamps[k][_STAMP]), self._images[k].copy()
            if self._counts[k][_BEFORE] == count == self._counts[k][_AFTER]:
                found.append(FrameSet(stamp, count, tuple(images)))
            else:
                self.lost += 1
        self._next = newest + 1
        return found
