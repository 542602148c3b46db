"""Frames through shared memory: whole, in order, and whoever is late knows how many he lost."""

import os
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from mitt.core.errors import InputError
from mitt.robot.cell.frames import SLOTS, FrameReader, FrameWriter, SharedFrames, as_frames

SHAPE = (12, 20)
NAME = f"mitt-test-{os.getpid()}"
FOLDER = Path("/dev/shm")  # noqa: S108


def images(k: int) -> list[np.ndarray]:
    """Return two images that are full of a number."""
    return [np.full(SHAPE, (k + c) % 256, np.uint8) for c in range(2)]


def test_frames_come_whole_and_in_order() -> None:
    """With stamps and numbers; each once."""
    writer = FrameWriter(NAME, 2, *SHAPE)
    reader = FrameReader(NAME, [SHAPE, SHAPE])
    for k in range(5):
        writer.write(10.0 + k, images(k))
    got = reader.take()
    assert [(x.t, x.number) for x in got] == [(10.0 + k, k + 1) for k in range(5)]
    assert all(np.array_equal(x.images, images(k)) for k, x in enumerate(got))
    assert reader.take() == []
    assert [f.camera for f in as_frames(got[0], 1.5)] == [0, 1]
    reader.close()
    writer.close()


def test_a_late_reader_counts_what_it_lost() -> None:
    """And takes the newest that are still there."""
    writer = FrameWriter(NAME, 2, *SHAPE)
    reader = FrameReader(NAME, [SHAPE, SHAPE])
    for k in range(3 * SLOTS):
        writer.write(float(k), images(k))
    got = reader.take()
    assert got[-1].t == 3.0 * SLOTS - 1.0
    assert reader.lost == 3 * SLOTS - len(got)
    reader.close()
    writer.close()


def test_no_torn_frame_is_ever_taken() -> None:
    """While another thread writes as fast as it can, each image is of one frame."""
    writer, over = FrameWriter(NAME, 2, *SHAPE), threading.Event()

    def write() -> None:
        k = 0
        while not over.is_set():
            writer.write(float(k), images(k))
            k += 1

    thread = threading.Thread(target=write)
    reader, seen = FrameReader(NAME, [SHAPE, SHAPE]), 0
    thread.start()
    try:
        while seen < 500:
            for x in reader.take():
                assert np.array_equal(x.images, images(int(x.t)))
                seen += 1
    finally:
        over.set()
        thread.join()
        reader.close()
        writer.close()


def test_what_is_no_ring_of_this_rig_is_refused() -> None:
    """None there, images of another size, a name that cannot be."""
    with pytest.raises(InputError, match="none called"):
        FrameReader(NAME, [SHAPE, SHAPE])
    writer = FrameWriter(NAME, 2, *SHAPE)
    for shapes in ([SHAPE], [(128, 128)] * 2, [SHAPE, (1, 2)]):
        with pytest.raises(InputError, match="cameras, height, width"):
            FrameReader(NAME, shapes)
    writer.close()
    with pytest.raises(InputError, match="letters, digits"):
        FrameReader("../etc", [SHAPE])


def test_a_memory_that_is_not_its_own_is_left_alone() -> None:
    """Of another program, or of a writer that lives: one line, and it is there as before."""
    file = FOLDER / NAME
    file.write_bytes(b"somebody's own")
    try:
        with pytest.raises(InputError, match="of another program"):
            FrameWriter(NAME, 2, *SHAPE)
        assert file.read_bytes() == b"somebody's own"
    finally:
        file.unlink()
    writer = FrameWriter(NAME, 2, *SHAPE)
    with pytest.raises(InputError, match="wanted one writer"):
        FrameWriter(NAME, 2, *SHAPE)
    reader = FrameReader(NAME, [SHAPE, SHAPE])
    writer.write(1.0, images(3))
    assert len(reader.take()) == 1
    file.rename(file.with_name(NAME + "-old"))
    file.write_bytes(b"somebody's own")
    writer.close()
    assert file.read_bytes() == b"somebody's own"
    file.unlink()
    file.with_name(NAME + "-old").unlink()


_KILLED = """
import os, signal, sys
from mitt.robot.cell.frames import FrameWriter
writer = FrameWriter(sys.argv[1], 2, 12, 20)
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_what_a_killed_writer_left_is_replaced() -> None:
    """Its lock went with it."""
    subprocess.run([sys.executable, "-c", _KILLED, NAME], check=False)
    assert (FOLDER / NAME).exists()
    writer = FrameWriter(NAME, 2, *SHAPE)
    writer.write(1.0, images(3))
    writer.close()
    assert not (FOLDER / NAME).exists()


def test_a_header_that_lies_is_one_line() -> None:
    """Sizes beyond the memory, none at all, or below zero."""
    writer = FrameWriter(NAME, 2, *SHAPE)
    file, head = FOLDER / NAME, writer._head.copy()
    for field, value, shapes in (
        ("slots", 4000, [SHAPE, SHAPE]),
        ("slots", -1, [SHAPE, SHAPE]),
        ("height", 0, [(0, 20)] * 2),
    ):
        bad = head.copy()
        bad[field] = value
        with file.open("r+b") as out:
            out.write(bad.tobytes())
        with pytest.raises(InputError, match="ring of frames"):
            FrameReader(NAME, shapes)
    writer.close()


def test_cameras_may_come_later() -> None:
    """Until then there is a reason and no frame."""
    frames = SharedFrames(NAME, [SHAPE, SHAPE])
    assert "none called" in frames.open()
    assert list(frames.take()) == []
    writer = FrameWriter(NAME, 2, *SHAPE)
    later = SharedFrames(NAME, [SHAPE, SHAPE])
    assert later.open() == ""
    writer.write(1.0, images(3))
    assert len(later.take()) == 1
    writer.close()


def test_a_memory_that_is_cut_short_ends_no_process() -> None:
    """Nothing comes from it any more; grown again, its frames come again."""
    writer = FrameWriter(NAME, 2, *SHAPE)
    reader = FrameReader(NAME, [SHAPE, SHAPE])
    writer.write(1.0, images(1))
    whole = (FOLDER / NAME).read_bytes()
    for size in (0, 8, 63, 64, 200, len(whole) // 2, len(whole) - 1):
        other = FOLDER / f"{NAME}-cut"
        other.write_bytes(whole)
        try:
            cut = FrameReader(other.name, [SHAPE, SHAPE])
            with other.open("r+b") as file:
                file.seek(8 * 5)
                file.write((SLOTS - 1).to_bytes(8, "little"))
                file.truncate(size)
            assert all(x.number == 1 for x in cut.take())
            cut.close()
        finally:
            other.unlink()
    assert [x.t for x in reader.take()] == [1.0]
    reader.close()
    writer.close()


def test_what_is_no_memory_of_this_user_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """A pipe would hold the loop; another user could write whatever he likes."""
    pipe = FOLDER / f"{NAME}-pipe"
    os.mkfifo(pipe)
    try:
        with pytest.raises(InputError, match="of this user"):
            FrameReader(pipe.name, [SHAPE, SHAPE])
    finally:
        pipe.unlink()
    writer = FrameWriter(NAME, 2, *SHAPE)
    monkeypatch.setattr(os, "geteuid", lambda: 4321)
    monkeypatch.setattr(os, "fstat", lambda fd, of=os.fstat: Owned(of(fd)))
    with pytest.raises(InputError, match="as the same user"):
        FrameReader(NAME, [SHAPE, SHAPE])
    monkeypatch.undo()
    writer.close()


class Owned:
    """What the system says of a file, with another owner."""

    def __init__(self, of: os.stat_result) -> None:
        """Take it."""
        self.st_mode, self.st_size, self.st_uid = of.st_mode, of.st_size, 1234
