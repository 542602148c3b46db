"""Candidates tried side by side, and the answers kept as they come.

Each job is a pure function, so the result is the same with any number of workers. What a candidate
is worth follows from what is asked of it alone (:class:`SearchJob`). So a search that finds the
answers of one that was broken off comes to the same design as one that never was. A line is handed
to the system as soon as it is whole: a process that is killed loses what is under way.
"""

import errno
import hashlib
import json
import os
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import astuple, dataclass, field, fields
from pathlib import Path
from typing import Any, final

import numpy as np

import mitt
from mitt.clock import Progress
from mitt.core.arm.arm import Arm
from mitt.core.errors import FileError, InputError, MittError
from mitt.io.reading import read_text
from mitt.io.schema import to_plain
from mitt.io.writing import own_file, remove_own
from mitt.lab.design.candidate import Candidate
from mitt.lab.design.evaluation import Evaluation, How, hindrance, judged, learned_map, thrown
from mitt.lab.design.task import DesignTask
from mitt.lab.trials.workers import Engine, run_tasks


@dataclass(frozen=True, slots=True, kw_only=True)
class Procedure:
    """How candidates are tried.

    Attributes:
        throws: Number of throws; 0 to judge by verdicts alone.
        seed: Seed of the throws.
        least: Least share of balls caught by the verdicts from which a candidate is thrown at.
        how: How thoroughly its map is learned.
        give_up: Whether it is thrown at less where it catches few of the first throws.
        images: Whether the ball is seen in images, or as points.
    """

    throws: int = 0
    seed: int = 0
    least: float = -1e9
    how: How = "quick"
    give_up: bool = True
    images: bool = False


#: A candidate, what is to be caught, and how it is tried.
Asked = tuple[Candidate, DesignTask, Procedure]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SearchJob:
    """What is to be tried of a candidate.

    Attributes:
        number: Its place among those tried together.
        whole: The arm with all joints active.
        candidate: The candidate.
        task: What is to be caught.
        by: How it is tried.
    """

    number: int
    whole: Arm
    candidate: Candidate
    task: DesignTask
    by: Procedure


def answer_of(w: Evaluation) -> dict[str, Any]:
    """Return what a candidate is worth as JSON has it, without the candidate."""
    return {x.name: getattr(w, x.name) for x in fields(w) if x.name != "candidate"}


def plain_task(task: DesignTask) -> list[Any]:
    """Return a task as JSON has it."""
    rest = [to_plain(getattr(task, x.name)) for x in fields(task) if x.name != "scene"]
    return [task.scene.model_dump_json(), *rest]


def digest(*parts: object) -> str:
    """Return a digest of JSON values."""
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:16]


_SCHEMA = "mitt.search/1"
#: What an answer may say.
_FIELDS = {x.name for x in fields(Evaluation)} - {"candidate"}


@final
class Answers:
    """The answers of a search, in a file if it has one, and the best candidates so far."""

    def __init__(self) -> None:
        """Begin with nothing, and without a file."""
        self._ended: tuple[DesignTask, list[Evaluation]] | None = None
        self._under_way = list[tuple[DesignTask, Evaluation]]()
        self._most: Evaluation | None = None
        self._answers, self._tasks = (
            dict[str, dict[str, Any]](),
            dict[int, tuple[DesignTask, str]](),
        )
        self._file: int | None = None
        self._begun: bool | None = None  # whether there are answers, once that is known
        self._path = Path()

    @classmethod
    def open(cls, path: Path, search: str, *, resume: bool) -> "Answers":
        """Begin a file of answers anew, or go on with one.

        Args:
            path: The file.
            search: What all decides the search, as a digest.
            resume: Whether the answers of a search that was broken off count.

        Raises:
            InputError: It was another search, it is still going on, or mitt did not write the file.
            FileError: The file cannot be read or written.
        """
        self = cls()
        self._path = path
        head = json.dumps({"schema": _SCHEMA, "version": mitt.__version__, "search": search})
        try:
            self._file = own_file(path, _SCHEMA)
        except BlockingIOError:
            raise InputError(
                "--out",
                "a design that no other search is looking for",
                f"{path}, where one is looking",
            ) from None
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

    def get(self, job: SearchJob) -> Evaluation | None:
        """Return what is known of a candidate; None where nothing is."""
        answer = self._answers.get(self._question(job)) if self._answers else None
        return None if answer is None else Evaluation(candidate=job.candidate, **answer)

    def add(self, job: SearchJob, worth: Evaluation) -> None:
        """Keep what a candidate is worth; one that was lost with its worker may be tried again.

        Raises:
            FileError: The file cannot be written.
        """
        if worth.thrown and (self._most is None or worth.within > self._most.within):
            self._most = worth
        if worth.enough:
            self._under_way.append((job.task, worth))
        if self._file is not None and worth.failed != "lost":
            self._write(json.dumps([self._question(job), answer_of(worth)]))
            self._begun = True

    def ended(self, task: DesignTask, worth: Sequence[Evaluation]) -> None:
        """Note what a stage has found: candidates that catch enough, by throws."""
        enough = [w for w in worth if w.enough]
        if enough:
            self._ended = task, enough

    @property
    def best(self) -> tuple[DesignTask, list[Evaluation]] | None:
        """The best of the last stage by throws: those that catch enough, and what they are for."""
        first = [(task, w) for task, w in self._under_way if task is self._under_way[0][0]]
        return self._ended or ((first[0][0], [w for _, w in first]) if first else None)

    @property
    def most(self) -> Evaluation | None:
        """What caught most of its throws so far; None where none was thrown at."""
        return self._most

    def close(self, *, done: bool) -> None:
        """Close the file; it goes where the search is done, or has not begun.

        Twice does no more than once.
        """
        if self._file is not None:
            if done or self._begun is False:
                remove_own(self._path, self._file)
            os.close(self._file)
        self._file = None

    def _question(self, job: SearchJob) -> str:
        """Return what is asked, as a digest; the arm is that of the whole search."""
        task = self._tasks.get(id(job.task))
        if task is None:  # keeps the task as well, so that no other takes its id
            task = self._tasks[id(job.task)] = job.task, digest(plain_task(job.task))
        return digest(to_plain(job.candidate), task[1], *astuple(job.by))

    def _take(self, head: str) -> int:
        """Take the answers of a file; return how many of its bytes are whole lines."""
        text = read_text(self._path, max_bytes=100_000_000, wanted="answers of a search")
        whole = text[: text.rfind("\n") + 1]
        lines = whole.splitlines()
        if lines and lines[0] != head:
            raise InputError(
                "--resume",
                f"the arm, the version and the options of {self._path}",
                "others",
                do="say the same, or --overwrite instead",
            )
        for number, line in enumerate(lines[1:], start=2):
            try:
                question, answer = json.loads(line)
                self._answers[str(question)] = dict(answer)
                if not set(answer) <= _FIELDS:
                    raise ValueError("another answer")
            except (ValueError, TypeError, RecursionError):
                raise FileError(
                    f"{self._path} line {number}",
                    "an answer",
                    line[:60],
                    do="say --overwrite to begin anew",
                ) from None
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


def evaluated(job: SearchJob) -> Evaluation:
    """Return what a candidate is worth, or why it could not be thrown at.

    An error of one candidate ends no search: it is part of the answer.
    """
    try:
        return _evaluated(job)
    except (MittError, np.linalg.LinAlgError) as error:
        return _failed(job.candidate, "error", str(error))


def _evaluated(job: SearchJob) -> Evaluation:
    """Return what a candidate is worth, stage by stage."""
    c, by = job.candidate, job.by
    why = hindrance(job.whole, c, job.task)
    if why:
        return _failed(c, "no pose", why)
    if by.how == "paper":
        return Evaluation(candidate=c, able=1.0, speed=0.0)
    f = learned_map(job.whole, c, job.task, by.how)
    if f is None:
        return _failed(c, "no map")
    worth = judged(c, f, job.task)
    if by.throws == 0 or worth.share < by.least:
        return worth
    return thrown(
        c, f, job.task, throws=by.throws, seed=by.seed, give_up=by.give_up, images=by.images
    )


def _failed(c: Candidate, why: str, said: str = "") -> Evaluation:
    """Return a candidate that was not thrown at."""
    return Evaluation(candidate=c, able=0.0, speed=99.0, failed=why, said=said)


def _evaluated_in_worker(job: SearchJob) -> bytes:
    """Evaluate a candidate in a worker; the answer as bytes, without the candidate."""
    return json.dumps(answer_of(evaluated(job))).encode()


@dataclass(slots=True)
class Tally:
    """What could not be evaluated, over all that a design does.

    Attributes:
        errors: Candidates whose throws ended in an error.
        lost: Candidates that were lost with their worker, again and again.
        said: What the first error said.
        hindered: How many were given up on paper, by what kept them from a pose.
    """

    errors: int = 0
    lost: int = 0
    said: str = ""
    hindered: Counter[str] = field(default_factory=Counter)

    def count(self, w: Evaluation) -> None:
        """Count a candidate, if it could not be evaluated."""
        self.errors += w.failed == "error"
        self.lost += w.failed == "lost"
        if w.failed == "error":
            self.said = self.said or w.said
        if w.failed == "no pose":
            self.hindered[w.said] += 1

    @property
    def hindrance(self) -> str:
        """What kept most candidates from a pose; nothing where none was given up on paper."""
        return self.hindered.most_common(1)[0][0] if self.hindered else ""

    def told(self) -> list[str]:
        """Return in words what could not be evaluated, a line each."""
        out = []
        if self.errors:
            out.append(f"left out for an error: {self.errors} candidates; the first: {self.said}")
        if self.lost:
            out.append(f"left out, lost with a worker process: {self.lost} candidates")
        return out


@final
class Evaluator:
    """Tries candidates, in this process or by an engine's workers."""

    def __init__(
        self,
        whole: Arm,
        task: DesignTask,
        engine: Engine | None,
        progress: Progress,
        tally: Tally | None = None,
        answers: Answers | None = None,
    ) -> None:
        """Take what all jobs have in common.

        ``progress`` is told what is done, and how much of it. What could not be evaluated is
        counted in ``tally``; answers are looked for in ``answers`` first, and kept there.
        """
        self.whole, self.task, self._engine, self.progress = whole, task, engine, progress
        self.tally, self.answers = tally or Tally(), answers or Answers()

    def at(self, task: DesignTask) -> "Evaluator":
        """Return an evaluator for another task, which counts and keeps where this one does."""
        return Evaluator(self.whole, task, self._engine, self.progress, self.tally, self.answers)

    def try_all(
        self, name: str, candidates: Sequence[Candidate], by: Procedure
    ) -> list[Evaluation]:
        """Return what candidates are worth, in their order, without those that failed.

        ``name`` is that of the stage, for the progress.
        """
        asked = [(c, self.task, by) for c in candidates]
        worth = [w for w in self.try_each(name, asked) if not w.failed]
        self.answers.ended(self.task, worth)
        return worth

    def try_each(self, name: str, asked: Sequence[Asked]) -> list[Evaluation]:
        """Return what each candidate is worth for a task of its own, those that failed as well."""
        jobs = [
            SearchJob(number=k, whole=self.whole, candidate=c, task=task, by=by)
            for k, (c, task, by) in enumerate(asked)
        ]
        return self._worth(name, jobs)

    def _worth(self, name: str, jobs: Sequence[SearchJob]) -> list[Evaluation]:
        """Return what became of jobs, in their order."""
        found = {job.number: w for job in jobs if (w := self.answers.get(job)) is not None}
        new = [job for job in jobs if job.number not in found]
        self.progress(name, len(found), len(jobs))
        for number, worth in self._as_they_come(new):
            found[number] = worth
            self.answers.add(jobs[number], worth)
            self.progress(name, len(found), len(jobs))
        for job in jobs:
            self.tally.count(found[job.number])
        return [found[job.number] for job in jobs]

    def _as_they_come(self, jobs: Sequence[SearchJob]) -> Iterable[tuple[int, Evaluation]]:
        """Yield number and worth of each, as they come.

        A worker that dies takes with it what else is under way, so that those are evaluated again
        one by one: only one whose own worker dies is lost.
        """
        if self._engine is None:
            for job in jobs:
                yield job.number, evaluated(job)
            return
        again = list[SearchJob]()
        for job, answer in run_tasks(
            self._engine, _evaluated_in_worker, jobs, window=2 * self._engine.workers
        ):
            worth = self._answer(job, answer)
            if worth is None:
                again.append(job)
            else:
                yield job.number, worth
        for job in sorted(again, key=lambda x: x.number):
            yield job.number, self._alone(job, self._engine)

    def _alone(self, job: SearchJob, engine: Engine) -> Evaluation:
        """Return what a candidate is worth with nothing else under way; tried twice."""
        for _ in range(2):
            for _, answer in run_tasks(engine, _evaluated_in_worker, [job], window=1):
                worth = self._answer(job, answer)
                if worth is not None:
                    return worth
        return _failed(job.candidate, "lost")

    def _answer(self, job: SearchJob, answer: bytes | BaseException) -> Evaluation | None:
        """Return what a worker said of a candidate; None where it died."""
        if not isinstance(answer, BaseException):
            return Evaluation(candidate=job.candidate, **json.loads(answer))
        if self._engine is not None and self._engine.died(answer):
            return None
        raise answer
