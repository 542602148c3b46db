"""Candidates tried side by side: each trial is a pure function, so the result is that of one."""

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, final

from mitt.design.assay import How, Task, Worth, judged, learned, stands, thrown
from mitt.design.candidate import Candidate
from mitt.robot.arm import Arm
from mitt.sweep.engine import Engine, run_tasks

#: How often a candidate is tried whose worker dies.
_ROUNDS = 3

Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trial:
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


def tried(trial: Trial) -> Worth | None:
    """Try a candidate; None where it cannot stand or has no map."""
    c = trial.candidate
    if not stands(trial.whole, c, trial.task):
        return None
    f = learned(trial.whole, c, trial.task, trial.how)
    if f is None:
        return None
    worth = judged(c, f, trial.task)
    if trial.throws == 0 or worth.score < trial.least:
        return worth
    return thrown(c, f, trial.task, throws=trial.throws, seed=trial.seed, give_up=trial.give_up)


def work(trial: Trial) -> bytes:
    """Try a candidate in a worker; the answer as bytes, without the candidate."""
    w = tried(trial)
    plain = None if w is None else {
        "able": w.able, "speed": w.speed, "thrown": w.thrown, "caught": w.caught, "clean": w.clean,
        "force": w.force, "binding": w.binding,
    }  # fmt: skip
    return json.dumps({"number": trial.number, "worth": plain}).encode()


@final
class Bench:
    """Tries candidates, in this process or by an engine's workers."""

    def __init__(self, whole: Arm, task: Task, engine: Engine | None, progress: Progress) -> None:
        """Take what all trials have in common.

        Args:
            whole: The arm with all joints active.
            task: What is to be caught.
            engine: Where to work; in this process where None.
            progress: Told what is done, and how much of it.
        """
        self.whole, self._task, self._engine, self._progress = whole, task, engine, progress

    def try_all(
        self, name: str, candidates: Sequence[Candidate], *, throws: int = 0, seed: int = 0,
        least: float = -1e9, how: How = "quick", give_up: bool = True,
    ) -> list[Worth]:  # fmt: skip
        """Return what candidates are worth, in their order; those that cannot stand are left out.

        Args:
            name: Of this stage, for the progress.
            candidates: What is tried.
            throws: As in :class:`Trial`.
            seed: As in :class:`Trial`.
            least: As in :class:`Trial`.
            how: As in :class:`Trial`.
            give_up: As in :class:`Trial`.
        """
        trials = [
            Trial(number=k, whole=self.whole, candidate=c, task=self._task, throws=throws,
                  seed=seed, least=least, how=how, give_up=give_up)
            for k, c in enumerate(candidates)
        ]  # fmt: skip
        return [w for w in self._worth(name, trials) if w is not None]

    def try_each(
        self, name: str, pairs: Sequence[tuple[Candidate, Task]], *, throws: int, seed: int
    ) -> list[Worth | None]:
        """Return what each candidate is worth for a task of its own; None where it cannot stand."""
        trials = [
            Trial(number=k, whole=self.whole, candidate=c, task=task, throws=throws, seed=seed)
            for k, (c, task) in enumerate(pairs)
        ]
        return self._worth(name, trials)

    def _worth(self, name: str, trials: Sequence[Trial]) -> list[Worth | None]:
        """Return what became of trials, in their order."""
        found: list[Worth | None] = [None] * len(trials)
        for done, (number, worth) in enumerate(self._answers(trials), start=1):
            self._progress(name, done, len(trials))
            found[number] = worth
        return found

    def _answers(self, trials: Sequence[Trial]) -> Iterable[tuple[int, Worth | None]]:
        """Yield number and worth of each, as they come."""
        if self._engine is None:
            for trial in trials:
                yield trial.number, tried(trial)
            return
        left, engine = list(trials), self._engine
        for _ in range(_ROUNDS):
            lost = list[Trial]()
            for trial, answer in run_tasks(engine, work, left, window=2 * engine.workers):
                if not isinstance(answer, BaseException):
                    plain = json.loads(answer)["worth"]
                    yield trial.number, _worth_of(trial.candidate, plain)
                elif engine.died(answer):
                    lost.append(trial)  # with its worker, perhaps not by its own fault
                else:
                    raise answer
            left = lost
        for trial in left:
            yield trial.number, None


def _worth_of(c: Candidate, plain: dict[str, Any] | None) -> Worth | None:
    """Return what a worker said of a candidate."""
    return None if plain is None else Worth(candidate=c, **plain)
