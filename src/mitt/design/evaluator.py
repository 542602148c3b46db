"""Candidates tried side by side: each job is a pure function, so the result is that of one."""

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import final

import numpy as np

from mitt.design.candidate import Candidate
from mitt.design.evaluation import Evaluation, How, able_to_hold, judged, learned, thrown
from mitt.design.job import Job, answer_of
from mitt.design.kept import Kept
from mitt.design.task import Task
from mitt.errors import MittError
from mitt.robot.arm import Arm
from mitt.trials.workers import Engine, run_tasks

#: How often a candidate is evaluated by itself whose worker died.
_ROUNDS = 2

Progress = Callable[[str, int, int], None]


def evaluated(job: Job) -> Evaluation:
    """Return what a candidate is worth, or why it could not be thrown at.

    An error of one candidate ends no search: it is part of the answer.
    """
    try:
        return _evaluated(job)
    except (MittError, np.linalg.LinAlgError) as error:
        return _failed(job.candidate, "error", str(error))


def _evaluated(job: Job) -> Evaluation:
    """Return what a candidate is worth, stage by stage."""
    c = job.candidate
    if not able_to_hold(job.whole, c, job.task):
        return _failed(c, "no pose")
    if job.how == "paper":
        return Evaluation(candidate=c, able=1.0, speed=0.0)
    f = learned(job.whole, c, job.task, job.how)
    if f is None:
        return _failed(c, "no map")
    worth = judged(c, f, job.task)
    if job.throws == 0 or worth.share < job.least:
        return worth
    return thrown(c, f, job.task, throws=job.throws, seed=job.seed, give_up=job.give_up)


def _failed(c: Candidate, why: str, said: str = "") -> Evaluation:
    """Return a candidate that was not thrown at."""
    return Evaluation(candidate=c, able=0.0, speed=99.0, failed=why, said=said)


def work(job: Job) -> bytes:
    """Evaluate a candidate in a worker; the answer as bytes, without the candidate."""
    return json.dumps(answer_of(evaluated(job))).encode()


@dataclass(slots=True)
class Tally:
    """What could not be evaluated, over all that a design does.

    Attributes:
        errors: Candidates whose throws ended in an error.
        lost: Candidates that were lost with their worker, again and again.
        said: What the first error said.
    """

    errors: int = 0
    lost: int = 0
    said: str = ""

    def count(self, w: Evaluation) -> None:
        """Count a candidate, if it could not be evaluated."""
        self.errors += w.failed == "error"
        self.lost += w.failed == "lost"
        self.said = self.said or w.said

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
        self, whole: Arm, task: Task, engine: Engine | None, progress: Progress,
        tally: Tally | None = None, kept: Kept | None = None,
    ) -> None:  # fmt: skip
        """Take what all jobs have in common.

        Args:
            whole: The arm with all joints active.
            task: What is to be caught.
            engine: Where to work; in this process where None.
            progress: Told what is done, and how much of it.
            tally: Where what could not be evaluated is counted.
            kept: Where answers are kept, and looked for first.
        """
        self.whole, self.task, self._engine, self.progress = whole, task, engine, progress
        self.tally, self.kept = tally or Tally(), kept or Kept()

    def at(self, task: Task) -> "Evaluator":
        """Return an evaluator for another task, which counts and keeps where this one does."""
        return Evaluator(self.whole, task, self._engine, self.progress, self.tally, self.kept)

    def try_all(
        self, name: str, candidates: Sequence[Candidate], *, throws: int = 0, seed: int = 0,
        least: float = -1e9, how: How = "quick", give_up: bool = True,
    ) -> list[Evaluation]:  # fmt: skip
        """Return what candidates are worth, in their order, without those that failed.

        Args:
            name: Of this stage, for the progress.
            candidates: What is tried.
            throws: As in :class:`Job`.
            seed: As in :class:`Job`.
            least: As in :class:`Job`.
            how: As in :class:`Job`.
            give_up: As in :class:`Job`.
        """
        jobs = [
            Job(number=k, whole=self.whole, candidate=c, task=self.task, throws=throws,
                  seed=seed, least=least, how=how, give_up=give_up)
            for k, c in enumerate(candidates)
        ]  # fmt: skip
        worth = [w for w in self._worth(name, jobs) if not w.failed]
        self.kept.ended(self.task, worth)
        return worth

    def try_each(
        self, name: str, pairs: Sequence[tuple[Candidate, Task]], *, throws: int, seed: int
    ) -> list[Evaluation]:
        """Return what each candidate is worth for a task of its own, those that failed as well.

        All throws are made, however many are caught.
        """
        jobs = [
            Job(number=k, whole=self.whole, candidate=c, task=task, throws=throws, seed=seed,
                  give_up=False)
            for k, (c, task) in enumerate(pairs)
        ]  # fmt: skip
        return self._worth(name, jobs)

    def _worth(self, name: str, jobs: Sequence[Job]) -> list[Evaluation]:
        """Return what became of jobs, in their order."""
        found = {job.number: w for job in jobs if (w := self.kept.get(job)) is not None}
        new = [job for job in jobs if job.number not in found]
        for number, worth in self._answers(new):
            found[number] = worth
            self.kept.add(jobs[number], worth)
            self.progress(name, len(found), len(jobs))
        for job in jobs:
            self.tally.count(found[job.number])
        return [found[job.number] for job in jobs]

    def _answers(self, jobs: Sequence[Job]) -> Iterable[tuple[int, Evaluation]]:
        """Yield number and worth of each, as they come.

        A worker that dies takes with it what else is under way, so that those are evaluated again
        one by one: only one whose own worker dies is lost.
        """
        if self._engine is None:
            for job in jobs:
                yield job.number, evaluated(job)
            return
        again = list[Job]()
        for job, answer in run_tasks(self._engine, work, jobs, window=2 * self._engine.workers):
            worth = self._answer(job, answer)
            if worth is None:
                again.append(job)
            else:
                yield job.number, worth
        for job in sorted(again, key=lambda x: x.number):
            yield job.number, self._alone(job, self._engine)

    def _alone(self, job: Job, engine: Engine) -> Evaluation:
        """Return what a candidate is worth with nothing else under way."""
        for _ in range(_ROUNDS):
            for _, answer in run_tasks(engine, work, [job], window=1):
                worth = self._answer(job, answer)
                if worth is not None:
                    return worth
        return _failed(job.candidate, "lost")

    def _answer(self, job: Job, answer: bytes | BaseException) -> Evaluation | None:
        """Return what a worker said of a candidate; None where it died."""
        if not isinstance(answer, BaseException):
            return Evaluation(candidate=job.candidate, **json.loads(answer))
        if self._engine is not None and self._engine.died(answer):
            return None
        raise answer
