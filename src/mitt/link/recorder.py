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
"""

import json
import select
import struct
import subprocess
import sys
from collections.abc import Mapping
from contextlib import AbstractContextManager
from dataclasses import asdict
from pathlib import Path
from typing import Any, final

import numpy as np

from mitt import checks
from mitt.catcher.result import Result
from mitt.errors import FileError
from mitt.files import messages as of
from mitt.files.about import About
from mitt.files.messages import EVENT
from mitt.files.recording import heading_of
from mitt.files.recording_rows import clock_call, frame_row, point_rows
from mitt.link.clock import monotonic
from mitt.link.ring import Ring
from mitt.signals import Command, Frame, Senses, all_of

#: Kinds of entries: a tick, what the catcher was told, what happened, the background.
TICK, CALL, NOTICE, GROUND = 1, 2, 3, 4
#: Number of a tick, of its points, of its frames.
COUNTS = struct.Struct("<QII")
#: Room for 4 s of ticks, and for 1.5 s of two images of 128 x 128 [bytes].
_ROOM, _ROOM_IMAGES = 8_000_000, 64_000_000
#: What can be told to a catcher besides its senses.
CALLS = ("stop", "recover", "recover checked", "again")
#: Time without progress after which a writer is ended [s], and time between two looks [s].
_PATIENCE, _LOOK = 20.0, 0.1


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
        images, metadata = checks.flag("images", images), _texts(metadata)
        self.path, self.count, self._images = path, 0, images
        self._ring = Ring.new(_ROOM_IMAGES if images else _ROOM)
        self._lay_out(about)
        heading = asdict(heading_of(about, metadata))
        self._process = subprocess.Popen(  # noqa: S603 (this interpreter, our module)
            [sys.executable, "-m", "mitt.link.recording", str(self._ring.fd),
             str(self._ring.size), str(path.resolve())],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            pass_fds=(self._ring.fd,), start_new_session=True,
        )  # fmt: skip
        pipe = self._process.stdin
        if pipe is not None:
            pipe.write(json.dumps(heading).encode() + b"\n")
            pipe.flush()
        said = self._last_words()
        if said != "ready":
            self._process.kill()
            self._process.wait()
            self._ring.close()
            raise FileError(str(path), "a new file that can be written", said or "no answer")

    def _lay_out(self, about: About) -> None:
        """Make the row of a tick, and views of its parts."""
        n, heads = about.arm.n, len(about.rig.heads)
        self._row = row = of.ticks(n, heads)
        names = [name for name in row.dtype.names or () if name.startswith("out_")]
        fields: Any = row.dtype.fields
        self._out = row.view(np.dtype({
            "names": names, "formats": [fields[x][0] for x in names],
            "offsets": [fields[x][1] for x in names], "itemsize": row.dtype.itemsize,
        }))  # fmt: skip
        self._joints = row["command"].reshape(4, n)
        self._ball = row["ball"].reshape(3, 3)
        self._covariance = row["covariance"].reshape(6, 6)
        self._reference = row["reference"].reshape(6, n)
        self._sighting = row["sighting"].reshape(4, 3)
        self._q, self._dq, self._gaze = row["q"][0], row["dq"][0], row["gaze"].reshape(heads, 4)
        self._t, self._hand, self._brakes = row["t"], row["hand"], row["brakes"]
        self._t_arm, self._heads = row["t_arm"], heads

    def tick(self, senses: Senses, command: Command, result: Result) -> None:
        """Keep a tick: what the catcher took, what it commanded, and ``catcher.result``.

        Call it after ``catcher.step`` and before the next one; it copies what it is given.
        """
        checks.instance("senses", senses, Senses)
        checks.instance("command", command, Command)
        checks.instance("result", result, Result)
        arm, points, frames = senses.arm, senses.points, senses.frames
        self._t[0], self._t_arm[0] = senses.t, arm.t
        self._q[:], self._dq[:], self._joints[:] = arm.q, arm.dq, command.joints
        self._hand[0], self._brakes[0] = command.hand, command.brakes
        self._out[:] = result.scalars
        self._ball[:], self._covariance[:] = result.ball, result.covariance
        self._reference[:], self._sighting[:] = result.reference, result.sighting
        if self._heads and command.gaze is not None:
            self._gaze[:] = command.gaze
        kept = frames if self._images else ()
        counts = COUNTS.pack(self.count, len(points), len(kept))
        if points or frames:
            self._row["points"], self._row["frames"] = len(points), len(frames)
            more = point_rows(points).tobytes() + _images(kept)
            self._ring.put(TICK, counts + self._row.tobytes() + more)
            self._row["points"], self._row["frames"] = 0, 0
        else:
            self._ring.put(TICK, counts + self._row.tobytes())
        self.count += 1

    def call(self, name: str) -> None:
        """Keep what the catcher is told before the next tick, so that a replay tells it too.

        Args:
            name: ``stop``, ``recover``, ``recover checked``, or ``again`` for a fresh throw.
        """
        checks.one_of("call", name, CALLS)
        self._ring.put(CALL, COUNTS.pack(self.count, 0, 0) + name.encode())

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
        if self._process.stdin is None or self._process.stdin.closed:
            return
        self._process.stdin.close()
        said = self._last_words()
        left = self._ring.left
        self._process.kill()
        self._process.wait()
        if self._process.stdout is not None:
            self._process.stdout.close()
        self._ring.close()
        if said != "written":
            lost = f"{said or 'a cut one'}; {left} of {self._ring.ever} bytes were not written"
            raise FileError(str(self.path), "a recording written to its end", lost)

    def _last_words(self) -> str:
        """Return what the writer says at its end; wait for it as long as it takes entries."""
        pipe, before, due = self._process.stdout, -1, 0.0
        while pipe is not None and not select.select([pipe], [], [], _LOOK)[0]:
            left = self._ring.left
            if left != before:
                before, due = left, monotonic() + _PATIENCE
            elif monotonic() > due:
                return f"a writer that did nothing for {_PATIENCE:.0f} s"
        return self._answer()

    def __exit__(self, *_: object) -> None:
        """End the file."""
        self.close()

    def _answer(self) -> str:
        """Return the next line that the writer says; nothing where it has died."""
        pipe = self._process.stdout
        return "" if pipe is None else pipe.readline().decode(errors="replace").strip()


def _texts(metadata: object) -> dict[str, str]:
    """Return texts by name; none where they were left out."""
    given = {} if metadata is None else checks.mapping("metadata", metadata)
    return {
        checks.text("metadata", key): checks.text(f"metadata {key}", value)
        for key, value in given.items()
    }


def _images(frames: tuple[Frame, ...]) -> bytes:
    """Return frames as the writer takes them: row, size, grey values of each."""
    parts = []
    for frame in frames:
        row, pixels = frame_row(frame)
        parts += [row.tobytes(), len(pixels).to_bytes(4, "little"), pixels]
    return b"".join(parts)
