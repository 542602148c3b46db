"""The process that writes what a :class:`mitt.link.recorder.Recorder` hands over.

It ends when its standard input does: the recorder was closed, or its process has died.
"""

import json
import os
import select
import sys
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from mitt.errors import MittError
from mitt.files import messages as of
from mitt.files.messages import EVENT
from mitt.files.recording import Heading, RecordingWriter
from mitt.files.recording_rows import (
    Said,
    call_message,
    frame_messages,
    notice_message,
    point_message,
)
from mitt.link.clock import monotonic
from mitt.link.recorder import CALL, COUNTS, GROUND, NOTICE, TICK
from mitt.link.ring import Ring

#: Time between two looks [s], and between two chunks.
_LOOK, _CHUNK = 0.02, 0.1
#: Most ticks that are written at once.
_MOST = 200


class _Writer:
    """Takes entries from the ring and writes them."""

    def __init__(self, stream: BinaryIO, heading: Heading, ring: Ring) -> None:
        """Begin the file."""
        self._out, self._ring, self._shapes = RecordingWriter(stream, heading), ring, heading.shapes
        self._row = of.ticks(len(heading.joints), heading.heads).dtype
        self._frame, self._point = of.frames().dtype, of.points().dtype
        self._rows: list[bytes] = []
        self._before: dict[int, list[Said]] = {}
        self._first = self._dropped = 0

    def drain(self) -> None:
        """Write all that is there now."""
        while (entry := self._ring.take()) is not None:
            self._take(*entry)
        self._put()

    def finish(self) -> None:
        """Write the rest and end the file."""
        self.drain()
        for number in sorted(self._before):
            self._out.say(self._before[number], number)
        self._out.finish(dropped=self._ring.refused)

    def flush(self) -> None:
        """End the chunk."""
        self._out.flush()

    def _take(self, kind: int, data: bytes) -> None:
        """Take one entry."""
        number, points, frames = COUNTS.unpack_from(data)
        rest = memoryview(data)[COUNTS.size :]
        says = self._before.setdefault(number, [])
        if self._ring.refused != self._dropped:
            self._dropped = self._ring.refused
            says.append(notice_message(EVENT, f"recorder: {self._dropped} entries dropped so far"))
        if kind == TICK:
            size = self._row.itemsize
            row, rest = bytes(rest[:size]), rest[size:]
            if self._rows and (number != self._first + len(self._rows) or len(self._rows) >= _MOST):
                self._put()
                self._before.setdefault(number, says)
            self._first = self._first if self._rows else number
            self._rows.append(row)
            size = points * self._point.itemsize
            says += [point_message(x) for x in np.frombuffer(rest[:size], self._point)]
            rest = rest[size:]
        if kind in (TICK, GROUND):
            says += self._images(frames, rest)
        elif kind == CALL:
            says.append(call_message(bytes(rest).decode()))
        elif kind == NOTICE:
            topic, text = json.loads(bytes(rest))
            says.append(notice_message(topic, text))

    def _images(self, count: int, rest: memoryview) -> list[Said]:
        """Return the messages of frames."""
        out: list[Said] = []
        for _ in range(count):
            size = self._frame.itemsize
            row = np.frombuffer(rest[:size], self._frame)
            end = size + 4 + int.from_bytes(rest[size : size + 4], "little")
            out += frame_messages(row, bytes(rest[size + 4 : end]), self._shapes)
            rest = rest[end:]
        return out

    def _put(self) -> None:
        """Write the ticks taken so far; what is said before a tick to come waits for it."""
        if not self._rows:
            return
        rows, self._rows = np.frombuffer(b"".join(self._rows), self._row), []
        self._out.ticks(self._first, rows, self._before)
        last = self._first + len(rows)
        self._before = {k: x for k, x in self._before.items() if k >= last}


def main(words: list[str]) -> int:
    """Write a file; say ``ready``, and in the end ``written``, or what went wrong."""
    fd, size, path = int(words[0]), int(words[1]), Path(words[2])
    _be_ordinary()
    try:
        heading = json.loads(sys.stdin.buffer.readline())
        shapes = tuple((int(h), int(w)) for h, w in heading.pop("shapes"))
        ring = Ring(fd, size)
        with path.open("xb") as stream:
            writer = _Writer(stream, Heading(shapes=shapes, **_tupled(heading)), ring)
            writer.flush()
            _say("ready")
            _follow(writer)
            writer.finish()
    except (OSError, MittError) as error:
        _say(" ".join(str(error.strerror if isinstance(error, OSError) else error).split()))
        return 2
    _say("written")
    return 0


def _follow(writer: _Writer) -> None:
    """Write what comes until the recorder has no more to say."""
    due = monotonic() + _CHUNK
    while True:
        ended = bool(select.select([sys.stdin.buffer], [], [], _LOOK)[0])
        writer.drain()
        if monotonic() >= due:
            writer.flush()
            due = monotonic() + _CHUNK
        if ended:
            return


def _tupled(heading: dict[str, Any]) -> dict[str, Any]:
    """Return a heading from JSON with its tuple."""
    return heading | {"joints": tuple(heading["joints"])}


def _be_ordinary() -> None:
    """Give up what a real-time loop has given to itself: its core and its priority."""
    try:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        os.sched_setaffinity(0, range(os.cpu_count() or 1))
        os.nice(5)
    except (OSError, AttributeError):
        return


def _say(text: str) -> None:
    """Say a line to the recorder, if it still listens."""
    try:
        print(text, flush=True)  # noqa: T201
    except OSError:
        return


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
