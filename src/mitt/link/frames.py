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
from mmap import mmap
from pathlib import Path
from stat import S_ISREG
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


def _slot_size(cameras: int, height: int, width: int) -> int:
    """Return the size of a slot [bytes]."""
    return _SLOT_HEAD + (cameras * height * width + 7) // 8 * 8


def _size_of(cameras: int, height: int, width: int, slots: int) -> int:
    """Return the size of a ring [bytes]."""
    return _HEAD + slots * _slot_size(cameras, height, width)


class _Slot:
    """A slot of a ring in memory: its counts, its stamp, its images."""

    def __init__(self, memory: memoryview, k: int, shape: tuple[int, int, int]) -> None:
        """Lay it out."""
        at = _HEAD + k * _slot_size(*shape)
        self.counts: NDArray[np.int64] = np.frombuffer(memory, np.int64, 3, at)
        self.stamp: NDArray[np.float64] = np.frombuffer(memory, np.float64, 3, at)
        size = int(np.prod(shape))
        pixels: NDArray[np.uint8] = np.frombuffer(memory, np.uint8, size, at + _SLOT_HEAD)
        self.images = pixels.reshape(shape)


@final
class FrameWriter:
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
        self._head: NDArray[np.int64] = np.frombuffer(memory, np.int64, 8)
        self._slots = [_Slot(memory, k, (cameras, height, width)) for k in range(SLOTS)]

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
        slot = self._slots[count % SLOTS]
        slot.counts[_BEFORE] = count
        slot.stamp[_STAMP] = t
        for place, image in zip(slot.images, images, strict=True):
            place[:] = image
        slot.counts[_AFTER] = count
        self._head[_WRITTEN] = count

    def close(self) -> None:
        """Take the memory away; who reads it may finish."""
        del self._head, self._slots
        with suppress(OSError):  # nobody's but its own
            if os.path.samestat(self._file.stat(), os.fstat(self._fd)):
                self._file.unlink()
        os.close(self._fd)


@final
class FrameReader:
    """Reads frames. It copies them from the file: a memory that is cut short ends no process.

    Attributes:
        lost: Frames that were overwritten before they were read.
    """

    @classmethod
    def named(cls, name: str, shapes: Sequence[tuple[int, int]]) -> Self:
        """Return a reader of a ring whose images are those of a rig.

        Raises:
            InputError: There is none, it is no ring, another user writes it, or its images are
                others.
        """
        file = _FOLDER / _checked(name)
        try:
            fd = os.open(file, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        except OSError:
            given = f"none called {name}"
            raise InputError("source.memory", "a shared memory that the cameras write", given,
                             do="start the cameras first") from None  # fmt: skip
        try:
            return cls(fd, _checked_head(fd, shapes))
        except InputError:
            os.close(fd)
            raise

    def __init__(self, fd: int, head: list[int]) -> None:
        """Begin with the next frame of an open file, whose header was found good."""
        self._fd, self._shape, self._slots = fd, tuple(head[1:4]), head[_SLOTS]
        self._next, self.lost = head[_WRITTEN] + 1, 0

    def close(self) -> None:
        """Give the memory up."""
        os.close(self._fd)

    def take(self) -> list[FrameSet]:
        """Return all sets since the last call, oldest first; none from a memory that was cut."""
        head = os.pread(self._fd, _HEAD, 0)
        newest = int.from_bytes(head[8 * _WRITTEN :][:8], sys.byteorder, signed=True)
        if len(head) < _HEAD or newest < self._next - 1:  # cut, or another writer has begun
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
        at = _HEAD + count % self._slots * size
        raw = os.pread(self._fd, size, at)
        again = os.pread(self._fd, _SLOT_HEAD, at)  # after the images: they are whole
        if len(raw) < size or len(again) < _SLOT_HEAD:
            return None
        counts: NDArray[np.int64] = np.frombuffer(raw + again, np.int64, 3, size)
        if not counts[_BEFORE] == count == counts[_AFTER]:
            return None
        stamp = float(np.frombuffer(raw, np.float64, 3)[_STAMP])
        pixels: NDArray[np.uint8] = np.frombuffer(
            raw, np.uint8, int(np.prod(self._shape)), _SLOT_HEAD
        )
        return FrameSet(stamp, count, tuple(pixels.reshape(self._shape)))


def _checked_head(fd: int, shapes: Sequence[tuple[int, int]]) -> list[int]:
    """Return the numbers of the header of a ring.

    Raises:
        InputError: As of :meth:`FrameReader.named`.
    """
    of = os.fstat(fd)
    if not S_ISREG(of.st_mode) or of.st_uid not in (os.geteuid(), 0):
        raise InputError("source.memory", "a shared memory of this user", "another one's",
                         do="run the cameras as the same user")  # fmt: skip
    raw = os.pread(fd, _HEAD, 0)
    if len(raw) < _HEAD:
        raise InputError("source.memory", "a ring of frames", f"{of.st_size} bytes")
    head: list[int] = np.frombuffer(raw, np.int64, 8).tolist()
    wanted = [len(shapes), *shapes[0]]
    if head[0] != _MAGIC or not 0 < head[_SLOTS] <= 4096:
        raise InputError("source.memory", "a ring of frames of this version", "another")
    whole = min(head[1:4]) > 0 and max(head[1:4]) <= _MOST
    if not whole or of.st_size < _size_of(*head[1:5]):
        raise InputError("source.memory", "a whole ring of frames", f"{of.st_size} bytes")
    if head[1:4] != wanted or len(set(shapes)) != 1:
        raise InputError("images in source.memory", f"cameras, height, width {wanted}",
                         head[1:4], do="take the rig of these cameras")  # fmt: skip
    return head
