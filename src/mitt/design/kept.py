"""What a search has found out so far, kept as it goes: one that was broken off can go on.

What a candidate is worth follows from what is asked of it alone (:class:`Job`). So a search that
finds the answers of one that was broken off comes to the same design as one that never was. A line
is handed to the system as soon as it is whole: a process that is killed loses what is under way.
"""

import errno
import fcntl
import json
import os
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any, final

import mitt
from mitt.design.evaluation import Evaluation
from mitt.design.job import Job, answer_of, digest, plain_task, question_of
from mitt.design.task import Task
from mitt.errors import FileError, InputError
from mitt.reading import read_text

_SCHEMA = "mitt.search/1"
#: Largest file of answers that is read [bytes], and what an answer may say.
_MAX_BYTES = 100_000_000
_FIELDS = {x.name for x in fields(Evaluation)} - {"candidate"}


@final
class Kept:
    """The answers of a search, in a file if it has one, and the best candidates so far."""

    def __init__(self) -> None:
        """Begin with nothing, and without a file."""
        self._ended: tuple[Task, list[Evaluation]] | None = None
        self._under_way = list[tuple[Task, Evaluation]]()
        self._answers, self._tasks = dict[str, dict[str, Any]](), dict[int, tuple[Task, str]]()
        self._file: int | None = None
        self._begun: bool | None = None  # whether there are answers, once that is known
        self._path = Path()

    @classmethod
    def open(cls, path: Path, search: str, *, resume: bool) -> "Kept":
        """Begin a file of answers anew, or go on with one.

        Args:
            path: The file.
            search: What all decides the search, as a digest.
            resume: Whether the answers of a search that was broken off count.

        Raises:
            InputError: It was another search, or it is still going on.
            FileError: The file cannot be read or written.
        """
        self = cls()
        self._path = path
        head = json.dumps({"schema": _SCHEMA, "version": mitt.__version__, "search": search})
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC, 0o644)
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(self._file or 0)
            raise InputError("--out", "a design that no other search is looking for",
                             f"{path}, where one is looking") from None  # fmt: skip
        except OSError as error:
            raise self._unwritable(error) from None
        try:
            size = self._take(head) if resume else 0
            self._begun = bool(self._answers)
            os.ftruncate(self._file, size)
            if size == 0:
                self._write(head)
        except BaseException:
            self.close(done=False)
            raise
        return self

    def get(self, job: Job) -> Evaluation | None:
        """Return what is known of a candidate; None where nothing is."""
        answer = self._answers.get(self._question(job)) if self._answers else None
        return None if answer is None else Evaluation(candidate=job.candidate, **answer)

    def add(self, job: Job, worth: Evaluation) -> None:
        """Keep what a candidate is worth; one that was lost with its worker may be tried again.

        Raises:
            FileError: The file cannot be written.
        """
        if worth.enough:
            self._under_way.append((job.task, worth))
        if self._file is not None and worth.failed != "lost":
            self._write(json.dumps([self._question(job), answer_of(worth)]))
            self._begun = True

    def ended(self, task: Task, worth: Sequence[Evaluation]) -> None:
        """Note what a stage has found: candidates that catch enough, by throws."""
        enough = [w for w in worth if w.enough]
        if enough:
            self._ended = task, enough

    @property
    def best(self) -> tuple[Task, list[Evaluation]] | None:
        """The best of the last stage by throws: those that catch enough, and what they are for."""
        first = [(task, w) for task, w in self._under_way if task is self._under_way[0][0]]
        return self._ended or ((first[0][0], [w for _, w in first]) if first else None)

    def close(self, *, done: bool) -> None:
        """Close the file; it goes where the search is done, or has not begun.

        Twice does no more than once.
        """
        if self._file is not None:
            if done or self._begun is False:
                self._path.unlink(missing_ok=True)
            os.close(self._file)
        self._file = None

    def _question(self, job: Job) -> str:
        """Return what is asked, as a digest; the arm is that of the whole search."""
        task = self._tasks.get(id(job.task))
        if task is None:  # keeps the task as well, so that no other takes its id
            task = self._tasks[id(job.task)] = job.task, digest(plain_task(job.task))
        return question_of(job, task[1])

    def _take(self, head: str) -> int:
        """Take the answers of a file; return how many of its bytes are whole lines."""
        text = read_text(self._path, max_bytes=_MAX_BYTES, wanted="answers of a search")
        whole = text[: text.rfind("\n") + 1]
        lines = whole.splitlines()
        if lines and lines[0] != head:
            raise InputError("--resume", f"the arm, the version and the options of {self._path}",
                             "others", do="say the same, or --overwrite instead")  # fmt: skip
        for number, line in enumerate(lines[1:], start=2):
            try:
                question, answer = json.loads(line)
                self._answers[str(question)] = dict(answer)
                if not set(answer) <= _FIELDS:
                    raise ValueError("another answer")
            except (ValueError, TypeError, RecursionError):
                raise FileError(f"{self._path} line {number}", "an answer", line[:60],
                                do="say --overwrite to begin anew") from None  # fmt: skip
        return len(whole.encode())

    def _write(self, line: str) -> None:
        """Hand a line to the system."""
        assert self._file is not None
        try:
            data = f"{line}\n".encode()
            if os.write(self._file, data) < len(data):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        except OSError as error:
            raise self._unwritable(error) from None

    def _unwritable(self, error: OSError) -> FileError:
        """Return the error of a file that cannot be written."""
        return FileError(str(self._path), "a file that can be written", error.strerror)
