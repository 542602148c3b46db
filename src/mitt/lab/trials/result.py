"""The result of a run of whatever task: its trials, and what they come to."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from math import isfinite
from pathlib import Path
from typing import Any

from mitt.clock import Stopwatch
from mitt.lab.trials.scored_task import RESULT, ScoredTask
from mitt.lab.trials.statistics import wilson


def result(
    task: ScoredTask,
    trials: Sequence[Any],
    stopwatch: Stopwatch,
    head: Mapping[str, object],
    wanted: int | None = None,
) -> dict[str, Any]:
    """Return the whole result.

    ``head`` is what it says of the run; with fewer trials than ``wanted`` it is incomplete.
    """
    return {
        "schema": task.result_schema,
        **head,
        **({"incomplete": True} if wanted is not None and len(trials) < wanted else {}),
        "trials": [finite(plain_fields(trial)) for trial in trials],
        "summary": run_summary(task, trials, stopwatch),
    }


def run_summary(task: ScoredTask, trials: Sequence[Any], stopwatch: Stopwatch) -> dict[str, Any]:
    """Return counts, the rate over all trials with its 95 % Wilson interval, and tick times."""
    counts = {status: sum(t.status == status for t in trials) for status in task.statuses}
    low, high = wilson(counts[task.success], len(trials))
    return {
        task.in_result: len(trials),
        **counts,
        task.rate: counts[task.success] / len(trials) if trials else 0.0,
        "ci95": [low, high],
        **task.more(trials),
        "tick_us": stopwatch.percentiles_us(),
        "deadline_misses": stopwatch.misses(),
    }


def plain_fields(trial: Any) -> dict[str, Any]:  # noqa: ANN401 (any dataclass)
    """Return a trial by its fields, without what only a run that learns a clock has."""
    row = asdict(trial)
    if row.get("clock", row) is None:
        del row["clock"]
    return row


def finite(value: Any) -> Any:  # noqa: ANN401 (any JSON value)
    """Return a value as JSON has it: numbers that are not finite are None, at any depth."""
    if isinstance(value, dict):
        return {key: finite(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [finite(inner) for inner in value]
    return None if isinstance(value, float) and not isfinite(value) else value


def force_words(force: Mapping[str, float] | None, over: int) -> str:
    """Return in words how hard balls pressed, for beside a catch rate."""
    if force is None:
        return "no ball touched the hand"
    beyond = f", {over} beyond what hand or arm take" if over else ""
    return f"contact force {spread_words(force)}{beyond}"


def spread_words(force: Mapping[str, float]) -> str:
    """Return median and 95th percentile of forces [N] in words."""
    return f"{force['median']:.0f} N median, 95 % {force['p95']:.0f} N"


def kept_words(done: int, wanted: int, folder: Path) -> str:
    """Return how many trials of an interrupted run are kept, and where."""
    return f"{done} of {wanted} trials are kept in {folder / RESULT}"
