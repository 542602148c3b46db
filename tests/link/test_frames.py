"""Frames through shared memory: whole, in order, and whoever is late knows how many he lost."""

import os
import threading

import numpy as np
import pytest

from mitt.errors import InputError
from mitt.link.frames import SLOTS, FrameReader, FrameWriter, frames_of
from mitt.link.sight import SharedFrames

SHAPE = (12, 20)
NAME = f"mitt-test-{os.getpid()}"


def images(k: int) -> list[np.ndarray]:
    """Return two images that are full of a number."""
    return [np.full(SHAPE, (k + c) % 256, np.uint8) for c in range(2)]


def test_frames_come_whole_and_in_order() -> None:
    """With stamps and numbers; each once."""
    writer = FrameWriter(NAME, 2, *SHAPE)
    reader = FrameReader.named(NAME, [SHAPE, SHAPE])
    for k in range(5):
        writer.write(10.0 + k, images(k))
    got = reader.take()
    assert [(x.t, x.number) for x in got] == [(10.0 + k, k + 1) for k in range(5)]
    assert all(np.array_equal(x.images, images(k)) for k, x in enumerate(got))
    assert reader.take() == []
    assert [f.camera for f in frames_of(got[0], 1.5)] == [0, 1]
    reader.close()
    writer.close()


def test_a_late_reader_counts_what_it_lost() -> None:
    """And takes the newest that are still there."""
    writer = FrameWriter(NAME, 2, *SHAPE)
    reader = FrameReader.named(NAME, [SHAPE, SHAPE])
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
    reader, seen = FrameReader.named(NAME, [SHAPE, SHAPE]), 0
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
        FrameReader.named(NAME, [SHAPE, SHAPE])
    writer = FrameWriter(NAME, 2, *SHAPE)
    for shapes in ([SHAPE], [(128, 128)] * 2, [SHAPE, (1, 2)]):
        with pytest.raises(InputError, match="cameras, height, width"):
            FrameReader.named(NAME, shapes)
    writer.close()
    with pytest.raises(InputError, match="letters, digits"):
        FrameReader.named("../etc", [SHAPE])


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
