"""The map held against the clairvoyant, throw by throw: what could have been caught, and was not.

A throw is catchable where the clairvoyant's plan, run in the same plant with the same hand and
noise, catches it within all limits. Every throw that the map does not catch is run by the
clairvoyant too, as long as it may be asked, and a random sample of those that it catches, which
says how often the clairvoyant fails there. A verdict is *false feasible* where the map promised and
then did not catch, or went beyond a limit; *false unreachable* where it refused what can be
caught. A ball that the hand met where it tolerates it, within all limits, and that sprang back or
slipped out all the same, is *let go*: the verdict on the way was right, and it is counted apart.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import numpy as np

from mitt.trials.result import STATUSES
from mitt.trials.score import Trial, reason_of
from mitt.trials.statistics import wilson

#: The stream that a sample is drawn from.
_STREAM = 7
#: Distance of ball and catch point at first contact within which a contact is fair [mm].
FAIR = 30.0

Row = dict[str, Any]
#: Throws one ball, by its index.
Run = Callable[[int], Trial]


def judged(
    by_map: Run, by_optimum: Run, index: int, *, sampled: bool, oracle: bool = True,
    thrifty: bool = False,
) -> Row:  # fmt: skip
    """Run a throw by the map and, where it fails or is sampled, by the clairvoyant if wished.

    One that is thrifty is not asked about balls that were let go: the verdict was right.
    """
    trial = by_map(index)
    caught, told = trial.status == "caught", trial.certificate or {}
    row: Row = {
        "index": index, "status": trial.status, "verdict": told.get("outcome"),
        "binding_limit": trial.binding_limit, "margin": told.get("margin"),
        "violations": trial.limit_violations, "position_error_mm": trial.position_error_mm,
        "velocity_error_m_s": trial.velocity_error_m_s, "stopped_by": reason_of(trial.stopped_by),
        "clairvoyant": None,
    }  # fmt: skip
    if oracle and (sampled or not (caught or (thrifty and _let_go(row)))):
        best = by_optimum(index)
        row |= {"clairvoyant": best.status, "clairvoyant_violations": best.limit_violations}
    return row


def counted(rows: Sequence[Row]) -> Row:
    """Return what a table of throws comes to."""
    failed = [row for row in rows if row["status"] != "caught"]
    both = [row for row in rows if row["status"] == "caught" and row["clairvoyant"] is not None]
    caught, lost = len(rows) - len(failed), _caught_by_optimum(failed)
    # The sample stands for all that the map catches.
    common = round((_caught_by_optimum(both) / len(both) if both else 1.0) * caught)
    feasible = sum(row["verdict"] == "feasible" for row in rows)
    broken, let_go = sum(_broken(row) for row in rows), [row for row in rows if _let_go(row)]
    refused = [row for row in failed if row["status"] == "unreachable"]
    timid = round(sum(_timid(refused, name) for name in {row.get("condition") for row in refused}))
    speeds = [row["velocity_error_m_s"] for row in let_go]
    return {
        "throws": len(rows),
        "caught": caught,
        **{status: sum(row["status"] == status for row in rows) for status in STATUSES[1:]},
        "sampled": {"throws": len(both), "caught_by_clairvoyant": _caught_by_optimum(both)},
        "catchable": common + lost,
        "caught_of_catchable": _rate(common, common + lost),
        "caught_of_what_either_catches": _rate(caught, caught + lost),
        "false_feasible": _rate(broken, feasible),
        "false_unreachable": _rate(timid, len(rows)),
        "false": _rate(broken + timid, len(rows)),
        "let_go": len(let_go),
        "let_go_at_m_s": float(np.median(speeds)) if speeds else None,
        "refused": len(refused),
        "refused_and_asked": sum(row["clairvoyant"] is not None for row in refused),
        "refused_by": dict(Counter(row["binding_limit"] for row in refused)),
        "violations": sum(row["violations"] for row in rows),
        "violations_of_clairvoyant": sum(row.get("clairvoyant_violations", 0) for row in rows),
        "failures": failed,
    }


def _caught_by_optimum(rows: Sequence[Row]) -> int:
    """Return how many of some throws the clairvoyant caught within all limits."""
    return sum(row["clairvoyant"] == "caught" and not row["clairvoyant_violations"] for row in rows)


def _timid(refused: list[Row], condition: str | None) -> float:
    """Return how many refused throws of a condition could have been caught.

    Those that the clairvoyant was asked about stand for all that were refused.
    """
    here = [row for row in refused if row.get("condition") == condition]
    asked = [row for row in here if row["clairvoyant"] is not None]
    return _caught_by_optimum(asked) / len(asked) * len(here) if asked else 0.0


def _let_go(row: Row) -> bool:
    """Say whether a ball that was met as promised, within all limits, left the hand again."""
    gap = row["position_error_mm"]
    fair = gap is not None and gap <= FAIR and not row["violations"]
    return bool(row["status"] == "dropped" and row["verdict"] == "feasible" and fair)


def _broken(row: Row) -> bool:
    """Say whether a throw was promised and then not caught, or taken beyond a limit."""
    kept = (row["status"] == "caught" and not row["violations"]) or _let_go(row)
    return bool(row["verdict"] == "feasible" and not kept)


def _rate(k: int, n: int) -> Row:
    """Return a rate with its 95 % Wilson interval."""
    low, high = wilson(k, n)
    return {"of": n, "count": k, "rate": k / n if n else None, "low": low, "high": high}


def is_sampled(seed: int, index: int, share: float) -> bool:
    """Say whether a throw is in the sample; a function of seed and index alone."""
    return bool(np.random.default_rng([seed, index, _STREAM]).random() < share)


def parallel(work: Callable[[int], list[Row]], workers: int) -> list[Row]:
    """Run all shares, each in its own process where there are several; rows by index."""
    if workers == 1:
        return work(0)
    with ProcessPoolExecutor(workers) as pool:
        parts = list(pool.map(work, range(workers)))
    return sorted((row for rows in parts for row in rows), key=lambda row: int(row["index"]))
