"""Recording a live loop: a tick is copied into shared memory, another process writes the file.

The loop never waits: not for the disk, not for Python's lock, not for memory. A tick for which
there is no room is dropped, counted, and the file says so. Whichever process dies, the file is
readable to its last chunk, a tenth of a second.

    with Recorder(Path("throw.mcap"), about) as recorder:
        while catching:
            command = catcher.step(senses)
            robot.write(command)
            recorder.tick(senses, command, catcher.result)
            catcher.think()

Between the two processes is a ring of bytes that one puts and one takes; neither waits. Its memory
has a file descriptor and no name, so nothing is left behind however they end. Each side writes one
counter that the other reads: bytes put and bytes taken since the start. An entry is ``size, kind``
(two uint32), then its bytes, then padding to 8; kind 0 fills the end of the ring.

The process that writes is this module as a program. It ends when its standard input does: the
recorder was closed, or its process has died.
"""

import json
import mmap
import os
import select
import struct
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from contextlib import AbstractContextManager
from dataclasses import asdict
from pathlib import Path
from typing import Any, BinaryIO, final

import numpy as np

from mitt.clock import monotonic
from mitt.core import checks
from mitt.core.catcher.state import Result
from mitt.core.errors import FileError, MittError
from mitt.core.signals import Array, Command, Frame, Senses, all_of
from mitt.interrupts import safe_path
from mitt.io import messages as of
from mitt.io.about import About
from mitt.io.messages import (
    EVENT,
    Said,
    call_message,
    clock_call,
    frame_messages,
    frame_row,
    notice_message,
    point_message,
    point_rows,
    torques_call,
)
from mitt.io.recordings import Heading, RecordingWriter, heading_of
from mitt.io.robot_description import LinkFrame as Drawn

#: Kinds of entries: a tick, what the catcher was told, what happened, the background.
TICK = 1
CALL = 2
NOTICE = 3
GROUND = 4
#: Number of a tick, of its points, of its frames.
COUNTS = struct.Struct("<QII")
#: What can be told to a catcher besides its senses.
CALLS = ("stop", "recover", "recover checked", "again")
#: Time without progress after which a writer is ended [s], and between two chunks [s].
_PATIENCE = 20.0
_CHUNK = 0.1
#: Counters before the ring: bytes put, bytes taken, entries refused, largest fill [bytes].
_COUNTERS = np.dtype(
    {
        "names": ["put", "taken", "refused", "fullest"],
        "formats": [np.int64] * 4,
        "itemsize": 64,
    }
)
#: What entries are aligned to [bytes].
_ALIGN = 8
_START = _COUNTERS.itemsize
_HEAD = struct.Struct("<II")


@final
class Ring:
    """One end of the ring.

    Attributes:
        fd: File descriptor of the memory.
        size: Bytes for entries.
    """

    def __init__(self, fd: int, size: int) -> None:
        """Map the memory behind a descriptor."""
        self.fd, self.size = fd, size
        self._memory = mmap.mmap(fd, _COUNTERS.itemsize + size)
        self._counters = np.frombuffer(self._memory, _COUNTERS, 1)[0]

    @classmethod
    def new(cls, size: int) -> "Ring":
        """Return the first end of a new ring with room for ``size`` bytes."""
        size += -size % _ALIGN
        try:
            fd = os.memfd_create("mitt")
        except AttributeError:  # not Linux
            fd, name = tempfile.mkstemp()
            os.unlink(name)
        os.truncate(fd, _COUNTERS.itemsize + size)
        return cls(fd, size)

    @property
    def refused(self) -> int:
        """Entries for which there was no room."""
        return int(self._counters["refused"])

    @property
    def ever(self) -> int:
        """Bytes put so far."""
        return int(self._counters["put"])

    @property
    def left(self) -> int:
        """Bytes put and not taken yet."""
        return int(self._counters["put"]) - int(self._counters["taken"])

    @property
    def fullest(self) -> float:
        """Largest share of the ring that was ever full."""
        return float(self._counters["fullest"]) / self.size

    def put(self, kind: int, data: bytes) -> bool:
        """Put an entry of a kind from 1 on; False, and it is counted, where there is no room."""
        counters = self._counters
        put, room = int(counters["put"]), self.size
        whole = _HEAD.size + len(data)
        whole += -whole % _ALIGN
        at = put % room
        gap = room - at if room - at < whole else 0
        used = put - int(counters["taken"]) + gap + whole
        if used > room:
            counters["refused"] += 1
            return False
        if gap:
            _HEAD.pack_into(self._memory, _START + at, gap, 0)
            at = 0
        start = _START + at
        _HEAD.pack_into(self._memory, start, len(data), kind)
        self._memory[start + _HEAD.size : start + _HEAD.size + len(data)] = data
        if used > counters["fullest"]:
            counters["fullest"] = used
        counters["put"] = put + gap + whole  # last: the other end sees whole entries only
        return True

    def take(self) -> tuple[int, bytes] | None:
        """Return kind and bytes of the oldest entry; None where there is none."""
        counters = self._counters
        taken = int(counters["taken"])
        while taken < int(counters["put"]):
            start = _START + taken % self.size
            size, kind = _HEAD.unpack_from(self._memory, start)
            if kind == 0:
                taken += size
                continue
            data = self._memory[start + _HEAD.size : start + _HEAD.size + size]
            whole = _HEAD.size + size
            counters["taken"] = taken + whole + -whole % _ALIGN
            return kind, data
        return None

    def close(self) -> None:
        """Let go of the memory; what was counted stays."""
        self._counters = self._counters.copy()
        self._memory.close()
        os.close(self.fd)


@final
class Recorder(AbstractContextManager["Recorder"]):
    """Records one catcher into one file.

    Attributes:
        path: The file.
        count: Ticks so far, dropped ones included.
    """

    def __init__(
        self,
        path: Path,
        about: About,
        *,
        images: bool = False,
        metadata: Mapping[str, str] | None = None,
    ) -> None:
        """Begin a file; takes about a second, until its writer is ready.

        Args:
            path: The file, which must not be there yet.
            about: What makes the catcher.
            images: Whether to keep images: 33 kB a tick before compression. Without them a replay
                begins behind the eyes, with the positions that they found.
            metadata: Texts for other readers.

        Raises:
            FileError: The file is there, or cannot be written.
        """
        path, about = checks.path("path", path), checks.instance("about", about, About)
        self.path, self.count, self._images = path, 0, checks.flag("images", images)
        given = {} if metadata is None else checks.mapping("metadata", metadata)
        texts = {
            checks.text("metadata", key): checks.text(f"metadata {key}", value)
            for key, value in given.items()
        }
        # Room for 4 s of ticks, or for 1.5 s of two images of 128 x 128.
        self._ring = Ring.new(64_000_000 if images else 8_000_000)
        self._lay_out(about)
        heading = asdict(heading_of(about, texts))
        with safe_path():
            self._process = subprocess.Popen(  # noqa: S603 (this interpreter, our module)
                [
                    sys.executable,
                    "-m",
                    "mitt.robot.cell.recorder",
                    str(self._ring.fd),
                    str(self._ring.size),
                    str(path.resolve()),
                ],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                pass_fds=(self._ring.fd,),
                start_new_session=True,
            )
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(heading).encode() + b"\n")
        self._process.stdin.flush()
        said = self._line()  # an interpreter may take long to start; nothing moves yet
        if said != "ready":
            self._process.kill()
            self._process.wait()
            self._ring.close()
            raise FileError(str(path), "a new file that can be written", said or "no answer")

    def _lay_out(self, about: About) -> None:
        """Make the row of a tick, and a view of what in it is the catcher's result."""
        self._row = row = of.ticks(about.arm.n, len(about.rig.heads))
        names = [name for name in row.dtype.names or () if name.startswith("out_")]
        fields: Any = row.dtype.fields
        self._out = row.view(
            np.dtype(
                {
                    "names": names,
                    "formats": [fields[x][0] for x in names],
                    "offsets": [fields[x][1] for x in names],
                    "itemsize": row.dtype.itemsize,
                }
            )
        )

    def tick(self, senses: Senses, command: Command, result: Result) -> None:
        """Keep a tick: what the catcher took, what it commanded, and ``catcher.result``.

        Call it after ``catcher.step`` and before the next one; it copies what it is given.
        """
        checks.instance("senses", senses, Senses)
        checks.instance("command", command, Command)
        checks.instance("result", result, Result)
        arm, points, frames = senses.arm, senses.points, senses.frames
        row = self._row[0]
        row["t"], row["t_arm"], row["q"], row["dq"] = senses.t, arm.t, arm.q, arm.dq
        row["command"], row["hand"] = command.joints.ravel(), command.hand
        row["brakes"], self._out[:] = command.brakes, result.scalars
        row["ball"], row["covariance"] = result.ball.ravel(), result.covariance.ravel()
        row["reference"], row["sighting"] = result.reference.ravel(), result.sighting.ravel()
        if len(row["gaze"]) and command.gaze is not None:
            row["gaze"] = np.ravel(command.gaze)
        row["points"], row["frames"] = len(points), len(frames)
        kept = frames if self._images else ()
        more = point_rows(points).tobytes() + _images(kept) if points or frames else b""
        counts = COUNTS.pack(self.count, len(points), len(kept))
        self._ring.put(TICK, counts + self._row.tobytes() + more)
        self.count += 1

    def call(self, name: str) -> None:
        """Keep what the catcher is told before the next tick, so that a replay tells it too.

        Args:
            name: ``stop``, ``recover``, ``recover checked``, or ``again`` for a fresh throw.
        """
        checks.one_of("call", name, CALLS)
        self._ring.put(CALL, COUNTS.pack(self.count, 0, 0) + name.encode())

    def torques(self, torques: Array) -> None:
        """Keep what a fresh catcher was told to take over before its first tick.

        Args:
            torques: As of :meth:`mitt.core.catcher.catcher.Catcher.take_over` [N m], shape (n,).
        """
        n = len(self._row[0]["q"])
        said = torques_call(checks.vector("torques", torques, n, finite=True))
        self._ring.put(CALL, COUNTS.pack(self.count, 0, 0) + said.encode())

    def clock(self, offset: float) -> None:
        """Keep what the stamps of sightings and images are corrected by from now on.

        They bear the correction already; a replay needs nothing of it.

        Args:
            offset: What is added to them [s].
        """
        said = clock_call(checks.number("offset", offset, finite=True))
        self._ring.put(CALL, COUNTS.pack(self.count, 0, 0) + said.encode())

    def background(self, frames: tuple[Frame, ...]) -> None:
        """Keep frames of which the catcher learns its background, before the first tick.

        Kept only where images are.
        """
        frames = all_of("frames", frames, Frame)
        if self._images:
            counts = COUNTS.pack(self.count, 0, len(frames))
            self._ring.put(GROUND, counts + _images(frames))

    def note(self, text: str, topic: str = EVENT) -> None:
        """Keep a text for readers, as the status of a throw; it changes nothing in a replay."""
        content = json.dumps([checks.text("topic", topic), checks.text("text", text)[:2000]])
        self._ring.put(NOTICE, COUNTS.pack(self.count, 0, 0) + content.encode())

    @property
    def dropped(self) -> int:
        """Entries dropped so far: there was no room for them."""
        return self._ring.refused

    @property
    def trouble(self) -> str:
        """Why the recording will not be whole; nothing if all is well."""
        if self._process.poll() is not None:
            return "its writer has ended"
        return f"{self.dropped} entries found no room" if self.dropped else ""

    @property
    def fullest(self) -> float:
        """Largest share of the memory between the processes that was ever full."""
        return self._ring.fullest

    def close(self) -> None:
        """End the file; waits until it is written, as long as its writer gets on.

        A writer that takes nothing from the memory for 20 s is ended.

        Raises:
            FileError: It could not be written to its end.
        """
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        if self._process.stdin.closed:
            return
        self._process.stdin.close()
        said = self._last_words()
        left = self._ring.left
        self._process.kill()
        self._process.wait()
        self._process.stdout.close()
        self._ring.close()
        if said != "written":
            lost = f"{said or 'a cut one'}; {left} of {self._ring.ever} bytes were not written"
            raise FileError(str(self.path), "a recording written to its end", lost)

    def _last_words(self) -> str:
        """Return the next line of the writer, nothing where it has died.

        It is waited for as long as the writer takes entries.
        """
        pipe, before, due = self._process.stdout, -1, 0.0
        assert pipe is not None
        while not select.select([pipe], [], [], 0.1)[0]:
            left = self._ring.left
            if left != before:
                before, due = left, monotonic() + _PATIENCE
            elif monotonic() > due:
                return f"a writer that did nothing for {_PATIENCE:.0f} s"
        return self._line()

    def _line(self) -> str:
        """Return the next line of the writer, nothing where it has ended."""
        assert self._process.stdout is not None
        return self._process.stdout.readline().decode(errors="replace").strip()

    def __exit__(self, *_: object) -> None:
        """End the file."""
        self.close()


def _images(frames: tuple[Frame, ...]) -> bytes:
    """Return frames as the writer takes them: row, size, grey values of each."""
    parts = []
    for frame in frames:
        row, pixels = frame_row(frame)
        parts += [row.tobytes(), len(pixels).to_bytes(4, "little"), pixels]
    return b"".join(parts)


class _Writer:
    """Takes entries from the ring and writes them."""

    def __init__(self, stream: BinaryIO, heading: Heading, ring: Ring) -> None:
        """Begin the file."""
        self._out, self._ring, self._shapes = RecordingWriter(stream, heading), ring, heading.shapes
        self._row = of.ticks(len(heading.joints), heading.heads).dtype
        self._frame, self._point = of.frame_type().dtype, of.points().dtype
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
            if self._rows and (number != self._first + len(self._rows) or len(self._rows) >= 200):
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


def recorder_main(words: list[str]) -> int:
    """Write a file; say ``ready``, and in the end ``written``, or what went wrong."""
    fd, size, path = int(words[0]), int(words[1]), Path(words[2])
    _be_ordinary()
    try:
        heading = json.loads(sys.stdin.buffer.readline())
        heading["joints"] = tuple(heading["joints"])
        heading["frames"] = tuple(Drawn(**frame) for frame in heading["frames"])
        heading["shapes"] = tuple((int(h), int(w)) for h, w in heading["shapes"])
        ring = Ring(fd, size)
        with path.open("xb") as stream:
            writer = _Writer(stream, Heading(**heading), ring)
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
        ended = bool(select.select([sys.stdin.buffer], [], [], 0.02)[0])
        writer.drain()
        if monotonic() >= due:
            writer.flush()
            due = monotonic() + _CHUNK
        if ended:
            return


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
    sys.exit(recorder_main(sys.argv[1:]))
