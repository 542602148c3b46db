"""Candidates tried side by side: each trial is a pure function, so the result is that of one."""

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields
from typing import final

import numpy as np

from mitt.design.candidate import Candidate
from mitt.design.evaluation import Evaluation, How, Task, able_to_hold, judged, learned, thrown
from mitt.errors import MittError
from mitt.robot.arm import Arm
from mitt.sweep.engine import Engine, run_tasks

#: How often a candidate is evaluated by itself whose worker died.
_ROUNDS = 2

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Job:
    """What is to be tried of a candidate.

    Attributes:
        number: Its place among those tried together.
        whole: The arm with all joints active.
        candidate: The candidate.
        task: What is to be caught.
        throws: Number of throws; 0 to judge it by flights alone.
        seed: Seed of the throws.
        least: Least score by flights from which it is thrown at.
        how: How thoroughly the map is learned.
        give_up: Whether it is thrown at less where it catches few of the first throws.
    """

    number: int
    whole: Arm
    candidate: Candidate
    task: Task
    throws: int = 0
    seed: int = 0
    least: float = -1e9
    how: How = "quick"
    give_up: bool = True


def evaluated(trial: Job) -> Evaluation:
    """Return what a candidate is worth, or why it could not be thrown at.

    An error of one candidate ends no search: it is part of the answer.
    """
    try:
        return _evaluated(trial)
    except (MittError, np.linalg.LinAlgError) as error:
        return _failed(trial.candidate, "error", str(error))


def _evaluated(trial: Job) -> Evaluation:
    """Return what a candidate is worth, stage by stage."""
    c = trial.candidate
    if not able_to_hold(trial.whole, c, trial.task):
        return _failed(c, "no pose")
    f = learned(trial.whole, c, trial.task, trial.how)
    if f is None:
        return _failed(c, "no map")
    worth = judged(c, f, trial.task)
    if trial.throws == 0 or worth.score < trial.least:
        return worth
    return thrown(c, f, trial.task, throws=trial.throws, seed=trial.seed, give_up=trial.give_up)


def _failed(c: Candidate, why: str, said: str = "") -> Evaluation:
    """Return a candidate that was not thrown at."""
    return Evaluation(candidate=c, able=0.0, speed=99.0, failed=why, said=said)


def work(trial: Job) -> bytes:
    """Evaluate a candidate in a worker; the answer as bytes, without the candidate."""
    w = evaluated(trial)
    plain = {x.name: getattr(w, x.name) for x in fields(w) if x.name != "candidate"}
    return json.dumps(plain).encode()


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
        tally: Tally | None = None,
    ) -> None:  # fmt: skip
        """Take what all trials have in common.

        Args:
            whole: The arm with all joints active.
            task: What is to be caught.
            engine: Where to work; in this process where None.
            progress: Told what is done, and how much of it.
            tally: Where what could not be evaluated is counted.
        """
        self.whole, self.task, self._engine, self.progress = whole, task, engine, progress
        self.tally = tally or Tally()

    def at(self, task: Task) -> "Evaluator":
        """Return an evaluator for another task, which counts in the same tally."""
        return Evaluator(self.whole, task, self._engine, self.progress, self.tally)

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
        trials = [
            Job(number=k, whole=self.whole, candidate=c, task=self.task, throws=throws,
                  seed=seed, least=least, how=how, give_up=give_up)
            for k, c in enumerate(candidates)
        ]  # fmt: skip
        return [w for w in self._worth(name, trials) if not w.failed]

    def try_each(
        self, name: str, pairs: Sequence[tuple[Candidate, Task]], *, throws: int, seed: int
    ) -> list[Evaluation]:
        """Return what each candidate is worth for a task of its own, those that failed as well.

        All throws are made, however many are caught.
        """
        trials = [
            Job(number=k, whole=self.whole, candidate=c, task=task, throws=throws, seed=seed,
                  give_up=False)
            for k, (c, task) in enumerate(pairs)
        ]  # fmt: skip
        return self._worth(name, trials)

    def _worth(self, name: str, trials: Sequence[Job]) -> list[Evaluation]:
        """Return what became of trials, in their order."""
        found = dict[int, Evaluation]()
        for done, (number, worth) in enumerate(self._answers(trials), start=1):
            self.progress(name, done, len(trials))
            self.tally.count(worth)
            found[number] = worth
        return [found[trial.number] for trial in trials]

    def _answers(self, trials: Sequence[Job]) -> Iterable[tuple[int, Evaluation]]:
        """Yield number and worth of each, as they come.

        A worker that dies takes with it what else is under way, so that those are evaluated again
        one by one: only one whose own worker dies is lost.
        """
        if self._engine is None:
            for trial in trials:
                yield trial.number, evaluated(trial)
            return
        again = list[Job]()
        for trial, answer in run_tasks(self._engine, work, trials, window=2 * self._engine.workers):
            worth = self._answer(trial, answer)
            if worth is None:
                again.append(trial)
            else:
                yield trial.number, worth
        for trial in sorted(again, key=lambda x: x.number):
            yield trial.number, self._alone(trial, self._engine)

    def _alone(self, trial: Job, engine: Engine) -> Evaluation:
        """Return what a candidate is worth with nothing else under way."""
        for _ in range(_ROUNDS):
            for _, answer in run_tasks(engine, work, [trial], window=1):
                worth = self._answer(trial, answer)
                if worth is not None:
                    return worth
        return _failed(trial.candidate, "lost")

    def _answer(self, trial: Job, answer: bytes | BaseException) -> Evaluation | None:
        """Return what a worker said of a candidate; None where it died."""
        if not isinstance(answer, BaseException):
            return Evaluation(candidate=trial.candidate, **json.loads(answer))
        if self._engine is not None and self._engine.died(answer):
            return None
        raise answer
