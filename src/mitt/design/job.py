"""What is asked of a candidate, and the answer; both as a file has them."""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

from mitt.design.candidate import Candidate
from mitt.design.effort import Effort
from mitt.design.evaluation import Evaluation, How
from mitt.design.task import Task
from mitt.files.schema import to_plain
from mitt.robot.arm import Arm

#: Characters of a digest.
_DIGITS = 16


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Job:
    """What is to be tried of a candidate.

    Attributes:
        number: Its place among those tried together.
        whole: The arm with all joints active.
        candidate: The candidate.
        task: What is to be caught.
        throws: Number of throws; 0 to judge it by verdicts alone.
        seed: Seed of the throws.
        least: Least share of balls caught by the verdicts from which it is thrown at.
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


def answer_of(w: Evaluation) -> dict[str, Any]:
    """Return what a candidate is worth as JSON has it, without the candidate."""
    return {x.name: getattr(w, x.name) for x in fields(w) if x.name != "candidate"}


def search_of(
    whole: Arm, task: Task, effort: Effort, *, joints: Sequence[str] | None, rate: float
) -> str:
    """Return all that decides a search, as a digest."""
    arm = to_plain((whole.model, whole.limits))
    return digest(arm, plain_task(task), to_plain(effort), joints, rate)


def question_of(job: Job, task: str) -> str:
    """Return what is asked of an arm's candidate, as a digest.

    Args:
        job: The job.
        task: Its task, as a digest.
    """
    c = to_plain(job.candidate)
    return digest(c, task, job.throws, job.seed, job.least, job.how, job.give_up)


def plain_task(task: Task) -> list[Any]:
    """Return a task as JSON has it."""
    rest = [to_plain(getattr(task, x.name)) for x in fields(task) if x.name != "scene"]
    return [task.scene.model_dump_json(), *rest]


def digest(*parts: object) -> str:
    """Return a digest of JSON values."""
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:_DIGITS]
