"""What a study comes to: a row for each generator in each condition, and the pairs.

All of it follows from the table of throws, ``trials.parquet``; ``summary.json`` is written for
others and never read back.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mitt.errors import FileError
from mitt.sweep.folder import Folder, read_manifest
from mitt.sweep.parts import read_columns
from mitt.sweep.study import Condition, Study
from mitt.trials.result import STATUSES, spread_of
from mitt.trials.score import reason_of
from mitt.trials.statistics import holm, mcnemar, wilson

Place = tuple[str, str]
"""Generator and condition."""
Pair = dict[str, float]
"""How two generators differ on the same throws."""
Cell = tuple[dict[str, Any], Mapping[int, bool]]
"""A row of the summary, and whether each of its throws was caught, by its index."""

#: The generator that all others are compared with.
REFERENCE = "direct"
#: Columns of which the rows give the median.
_MEDIANS = ("position_error_mm", "velocity_error_m_s", "peak_contact_force_n", "energy_j",
            "demand_cost", "peak_torque_ratio", "peak_speed_ratio")  # fmt: skip
#: Columns that a summary needs.
_COLUMNS = ("index", "status", "limit_violations", "over_force", "stopped_by_reason",
            "stopped_by_joint", *_MEDIANS)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StudyResult:
    """What the folder of a study holds.

    Attributes:
        study: The study.
        folder: The folder.
        rows: A row for each generator in each condition.
    """

    study: Study
    folder: Folder
    rows: list[dict[str, Any]]


def read_result(folder: Folder) -> StudyResult:
    """Read the folder of a study.

    Raises:
        FileError: It holds no study, one without a table of throws, or one that was altered.
    """
    study = read_manifest(folder.path)
    if not folder.summary.exists() or not folder.trials.exists():
        raise FileError(str(folder.path), "a study with a summary", "one that is not over",
                        do="finish it with mitt study --resume")  # fmt: skip
    return StudyResult(study=study, folder=folder, rows=summary(study, folder))


def summary(study: Study, folder: Folder) -> list[dict[str, Any]]:
    """Return the rows of a study's summary, from its table of throws.

    Raises:
        FileError: The table is missing, cut short or altered.
    """
    cells = []
    for condition in study.conditions:
        for generator, wanted in study.counts.items():
            cell = [("generator", "=", generator), ("condition", "=", condition.name)]
            throws = read_columns(folder.trials, _COLUMNS, cell).to_pylist()
            cells.append(cell_of(generator, condition, wanted, throws))
    return compared(cells)


def cell_of(
    generator: str, condition: Condition, wanted: int, trials: Iterable[dict[str, Any]]
) -> Cell:
    """Return the throws of one generator in one condition, as far as they are done.

    Args:
        generator: Name of the generator.
        condition: The condition.
        wanted: How many throws there should be.
        trials: Those that there are, as rows of the table.
    """
    counts = dict.fromkeys(STATUSES, 0)
    values: dict[str, list[float]] = {name: [] for name in _MEDIANS}
    caught: dict[int, bool] = {}
    violating, over, reasons = 0, 0, Counter[str]()
    for trial in trials:
        counts[trial["status"]] += 1
        violating += trial["limit_violations"] > 0
        over += trial["over_force"] is True
        if trial["stopped_by_reason"] is not None:
            named = {"reason": trial["stopped_by_reason"], "joint": trial["stopped_by_joint"]}
            reasons[reason_of(named)] += 1
        caught[trial["index"]] = trial["status"] == "caught"
        for name, found in values.items():
            value = trial[name]
            if value is not None:
                found.append(max(value, default=0.0) if isinstance(value, list) else value)
    throws = sum(counts.values())
    row = {
        "generator": generator,
        "condition": condition.name,
        "throws": throws,
        "caught": counts["caught"],
        "catch_rate": counts["caught"] / throws if throws else 0.0,
        "ci95": list(wilson(counts["caught"], throws)),
        "force_n": spread_of(values["peak_contact_force_n"]),
        "over_force": over,
        **{status: counts[status] for status in STATUSES[1:]},
        "stopped_by": dict(sorted(reasons.items())),
        "complete": throws == wanted,
        "disturbance": condition.disturbance,
        "value": condition.value,
        "unit": condition.unit,
        "violating_throws": violating,
        "median": {name: float(np.median(x)) if x else None for name, x in values.items()},
    }
    return row, caught


def compared(cells: Sequence[Cell]) -> list[dict[str, Any]]:
    """Return the rows; each rival is compared with the direct map on the same throws."""
    caught = {(row["generator"], row["condition"]): hits for row, hits in cells}
    pairs = against(caught, REFERENCE)
    return [
        row | {"against_direct": pairs.get(place)}
        for place, (row, _) in zip(caught, cells, strict=True)
    ]


def against(caught: Mapping[Place, Mapping[int, bool]], reference: str) -> dict[Place, Pair]:
    """Return how others differ from a generator on the throws that both had.

    McNemar's test, ``p``, and the same after Holm's correction over the conditions of a generator,
    ``p_holm``.

    Args:
        caught: Whether each throw was caught, by its index, of each generator in each condition.
        reference: Name of the generator that all others are compared with.
    """
    out = {
        (generator, condition): _paired(caught[reference, condition], hits)
        for (generator, condition), hits in caught.items()
        if generator != reference and (reference, condition) in caught
    }
    for generator in {name for name, _ in out}:
        pairs = [pair for (name, _), pair in out.items() if name == generator]
        for pair, p in zip(pairs, holm([pair["p"] for pair in pairs]), strict=True):
            pair["p_holm"] = p
    return out


def _paired(first: Mapping[int, bool], second: Mapping[int, bool]) -> Pair:
    """Return how two generators differ on the throws that both had."""
    both = first.keys() & second.keys()
    only_direct = sum(first[k] and not second[k] for k in both)
    only_this = sum(second[k] and not first[k] for k in both)
    return {
        "pairs": len(both),
        "only_direct": only_direct,
        "only_this": only_this,
        "p": mcnemar(only_direct, only_this),
    }
