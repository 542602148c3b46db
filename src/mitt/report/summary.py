"""The figures of a result that people ask for first."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mitt.trials.result import STATUSES

#: Everything but what was caught.
FAILURES = STATUSES[1:]


@dataclass(frozen=True, slots=True, kw_only=True)
class Spread:
    """Median, 95th percentile and maximum of a figure over the throws that have it."""

    median: float
    p95: float
    most: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ResultSummary:
    """What a result of ``mitt.catch/1`` comes to.

    Attributes:
        throws: Number of throws.
        counts: How many of each status.
        rate: Catch rate.
        ci95: Its 95 % Wilson interval.
        position_mm: Position error at first contact [mm]; None where nothing was touched.
        velocity_m_s: Velocity error at first contact [m/s].
        force_n: Largest contact force [N].
        cost: Demand cost, eq. (22).
        tick_us: Percentiles of the tick's wall-clock time [us].
        deadline_misses: Ticks beyond 1 ms.
        violating_throws: Throws with a limit exceeded in any tick.
        violations: Ticks with a limit exceeded, all throws together.
    """

    throws: int
    counts: dict[str, int]
    rate: float
    ci95: tuple[float, float]
    position_mm: Spread | None
    velocity_m_s: Spread | None
    force_n: Spread | None
    cost: Spread | None
    tick_us: dict[str, float]
    deadline_misses: int
    violating_throws: int
    violations: int


def result_summary(result: dict[str, Any]) -> ResultSummary:
    """Return the figures of a result."""
    summary, trials = result["summary"], result["trials"]
    low, high = summary["ci95"]
    violations = [int(t["limit_violations"]) for t in trials]
    return ResultSummary(
        throws=int(summary["throws"]),
        counts={s: int(summary[s]) for s in ("caught", *FAILURES)},
        rate=float(summary["catch_rate"]),
        ci95=(float(low), float(high)),
        position_mm=_spread(trials, "position_error_mm"),
        velocity_m_s=_spread(trials, "velocity_error_m_s"),
        force_n=_spread(trials, "peak_contact_force_n"),
        cost=_spread(trials, "demand_cost"),
        tick_us={name: float(x) for name, x in summary["tick_us"].items()},
        deadline_misses=int(summary["deadline_misses"]),
        violating_throws=sum(v > 0 for v in violations),
        violations=sum(violations),
    )


def _spread(trials: Sequence[dict[str, Any]], key: str) -> Spread | None:
    """Return the spread of a field; None where no trial has it."""
    values = [float(t[key]) for t in trials if t[key] is not None]
    if not values:
        return None
    median, p95 = np.percentile(values, [50.0, 95.0])
    return Spread(median=float(median), p95=float(p95), most=max(values))
