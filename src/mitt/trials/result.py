"""The result of a run, as the contract ``mitt.catch/1`` writes it."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict
from math import isfinite
from typing import Any

import numpy as np

from mitt.link.clock import Stopwatch
from mitt.trials.score import Trial
from mitt.trials.statistics import wilson

SCHEMA = "mitt.catch/1"
STATUSES = ("caught", "dropped", "missed", "unreachable", "stopped", "aborted")


def result(
    trials: list[Trial], stopwatch: Stopwatch, head: dict[str, object], wanted: int | None = None
) -> dict[str, Any]:
    """Return the whole result.

    Args:
        trials: Finished trials.
        stopwatch: Times of the catcher's ticks.
        head: version, arm, limits, generator, vision, seed.
        wanted: How many throws there should have been; a result of fewer says that it is
            incomplete. As many as there are if left out.
    """
    return {
        "schema": SCHEMA,
        **head,
        **({"incomplete": True} if wanted is not None and len(trials) < wanted else {}),
        "trials": [finite(plain(trial)) for trial in trials],
        "summary": summary(trials, stopwatch),
    }


def plain(trial: Trial) -> dict[str, Any]:
    """Return a trial by its fields, without what only a run that learns a clock has."""
    row = asdict(trial)
    if row["clock"] is None:
        del row["clock"]
    return row


def finite(value: Any) -> Any:  # noqa: ANN401 (any JSON value)
    """Return a value as JSON has it: numbers that are not finite are None, at any depth."""
    if isinstance(value, dict):
        return {key: finite(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [finite(inner) for inner in value]
    return None if isinstance(value, float) and not isfinite(value) else value


def summary(trials: list[Trial], stopwatch: Stopwatch) -> dict[str, Any]:
    """Return counts, catch rate over all throws with its 95 % Wilson interval, and tick times.

    Beside the rate ``force_n``, median and 95th percentile of the largest contact forces of the
    throws that touched the hand, and ``over_force``, how many of them were beyond what hand and arm
    take.
    """
    counts = {status: sum(t.status == status for t in trials) for status in STATUSES}
    low, high = wilson(counts["caught"], len(trials))
    return {
        "throws": len(trials),
        **counts,
        "catch_rate": counts["caught"] / len(trials) if trials else 0.0,
        "ci95": [low, high],
        "force_n": spread_of([t.peak_contact_force_n for t in trials]),
        "over_force": sum(t.over_force is True for t in trials),
        "tick_us": stopwatch.percentiles_us(),
        "deadline_misses": stopwatch.misses(),
    }


def spread_of(values: Iterable[float | None]) -> dict[str, float] | None:
    """Return ``median`` and 95th percentile ``p95`` of what is known; None where nothing is."""
    known = [x for x in values if x is not None]
    if not known:
        return None
    median, p95 = np.percentile(known, [50.0, 95.0])
    return {"median": float(median), "p95": float(p95)}


def force_words(force: Mapping[str, float] | None, over: int) -> str:
    """Return in words how hard balls pressed, for beside a catch rate."""
    if force is None:
        return "no ball touched the hand"
    beyond = f", {over} beyond what hand or arm take" if over else ""
    return f"contact force {spread_words(force)}{beyond}"


def spread_words(force: Mapping[str, float]) -> str:
    """Return median and 95th percentile of forces [N] in words."""
    return f"{force['median']:.0f} N median, 95 % {force['p95']:.0f} N"
