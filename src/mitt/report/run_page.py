"""The page that a run leaves behind: one file that opens anywhere and loads nothing."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mitt.files.writing import write_text
from mitt.generator.learn import Step
from mitt.report.figures.learning import feedback_by_step, feedback_share, learning_cost
from mitt.report.figures.pictures import picture_strip
from mitt.report.figures.response import joint_angles, joint_torques, target_and_hand
from mitt.report.figures.style import STATUS, Plot
from mitt.report.figures.throws import contact_errors, releases
from mitt.report.figures.trajectory import catching_trajectory
from mitt.report.page import NONE, Section, interval, number, page
from mitt.report.replay import replay_page
from mitt.report.table_1 import table_1
from mitt.robot.arm import Arm
from mitt.signals import Array
from mitt.trials.log import TrialLog
from mitt.trials.result import STATUSES
from mitt.trials.runner import LoggedTrial
from mitt.trials.score import reason_of
from mitt.world.scene import Scene

_SECTIONS = (
    Section("summary", "Summary", "What happened"),
    Section("failures", "Failures", "Throws that failed"),
    Section("replay", "3-D replay", "One throw in 3-D"),
    Section("figures", "Figures", "Figures, by the paper's numbers"),
    Section("rivals", "Comparison", "Beside other generators"),
    Section("table_1", "Table 1", "The system beside the paper's Table 1"),
    Section("trials", "All throws", "All throws"),
)
#: What became of throws that were not caught, in words.
_FAILED = {
    "dropped": "it dropped",
    "missed": "it missed",
    "unreachable": "it refused before moving",
    "stopped": "ended in a stop",
    "aborted": "ended with physics that diverged",
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReportContent:
    """What a report is made from; what is None or empty is left out of the page.

    Attributes:
        result: The result, ``mitt.catch/1``.
        arm: The arm of the run.
        scene: The world's settings of the run.
        steps: Costs over the steps of learning; None where the map brought none with it.
        direct: One throw with the generator of the run, with its log.
        unoptimised: The same throw with alpha = 0, with its log.
        releases: Ball centre at the release of each trial [m], shape (trials, 3).
        shares: Share of feedback in the torque with alpha = 0 and after each step of learning.
        rivals: Results of the same throws with other generators or settings.
    """

    result: dict[str, Any]
    arm: Arm
    scene: Scene
    steps: tuple[Step, ...] | None = None
    direct: LoggedTrial | None = None
    unoptimised: LoggedTrial | None = None
    releases: Array | None = None
    shares: tuple[float, ...] | None = None
    rivals: tuple[dict[str, Any], ...] = ()


def write_report(path: Path, content: ReportContent) -> None:
    """Write the page whole or not at all.

    Raises:
        FileError: The file cannot be written.
    """
    write_text(path, report(content))


def report(content: ReportContent) -> str:
    """Return the page."""
    result, arm, scene = content.result, content.arm, content.scene
    log, plain = (None if outcome is None else outcome.log
                  for outcome in (content.direct, content.unoptimised))  # fmt: skip
    short = result_summary(result)
    counts, throws = short["counts"], short["throws"]
    failed = ", ".join(f"{counts[s]} {words}" for s, words in _FAILED.items() if counts[s])
    return page(
        "run",
        _SECTIONS,
        title=f"{counts['caught']} of {throws} {'ball' if throws == 1 else 'balls'} caught",
        command="catch",
        result=result,
        short=short,
        failed_words=f"; {failed}" if failed else "",
        failed_counts=", ".join(f"{counts[s]} {s}" for s in STATUSES[1:]),
        failed=[t for t in result["trials"] if t["status"] != "caught"],
        direct=content.direct if log else None,
        plain=content.unoptimised if plain else None,
        feedback_share=feedback_share,
        colour={status: colour for status, (colour, _) in STATUS.items()},
        rows_of=_rows,
        replay=None if log is None else replay_page(arm, scene, log),
        drawn={plot.name: plot.svg for plot in _plots(content, log, plain)},
        strip=None if log is None else picture_strip(arm, scene, log),
        rivals=[_compared(other) for other in (result, *content.rivals)] if content.rivals else [],
        system=table_1(arm, log, vision=str(result["vision"])),
    )


def result_summary(result: dict[str, Any]) -> dict[str, Any]:
    """Return what people ask first of a result: its summary, counts and spreads over the throws.

    A spread is the median, the 95th percentile and the largest of a figure over the throws that
    have it, or None where none has: ``position_mm`` and ``velocity_m_s`` at first contact,
    ``force_n``, ``cost`` (eq. (22)).
    """
    summary, trials = result["summary"], result["trials"]
    violations = [int(t["limit_violations"]) for t in trials]
    return {
        **summary,
        "counts": {status: int(summary[status]) for status in STATUSES},
        "position_mm": _spread(trials, "position_error_mm"),
        "velocity_m_s": _spread(trials, "velocity_error_m_s"),
        "force_n": _spread(trials, "peak_contact_force_n"),
        "cost": _spread(trials, "demand_cost"),
        "violating_throws": sum(v > 0 for v in violations),
        "violations": sum(violations),
        "over_force": sum(t.get("over_force") is True for t in trials),
    }


def _spread(trials: Sequence[dict[str, Any]], key: str) -> dict[str, float] | None:
    """Return the spread of a field; None where no trial has it."""
    values = [float(t[key]) for t in trials if t[key] is not None]
    if not values:
        return None
    median, p95 = np.percentile(values, [50.0, 95.0])
    return {"median": float(median), "p95": float(p95), "most": max(values)}


def _rows(trials: Sequence[dict[str, Any]]) -> list[tuple[str, ...]]:
    """Return a row of the table a trial."""
    return [
        (
            str(t["index"]),
            str(t["status"]),
            str(t["binding_limit"] or NONE),
            reason_of(t.get("stopped_by")) or NONE,
            number(t["position_error_mm"], 1),
            number(t["velocity_error_m_s"], 2),
            number(t["peak_contact_force_n"], 0),
            str(t["limit_violations"]),
        )
        for t in trials
    ]


def _compared(result: dict[str, Any]) -> tuple[str, ...]:
    """Return a result as a row of the table that compares generators."""
    d = result_summary(result)
    place, speed, force, cost = (
        None if d[name] is None else d[name]["median"]
        for name in ("position_mm", "velocity_m_s", "force_n", "cost")
    )
    return (
        str(result["generator"]), str(result["limits"]), f"{d['caught']} of {d['throws']}",
        f"{100 * d['catch_rate']:.1f}", interval(d["ci95"]), number(place, 1), number(speed, 2),
        number(force, 0), number(cost, 3), str(d["violating_throws"]),
    )  # fmt: skip


def _plots(content: ReportContent, log: TrialLog | None, plain: TrialLog | None) -> list[Plot]:
    """Return all drawings for which there are data."""
    arm, trials = content.arm, content.result["trials"]
    out, caught_at = [], None
    if content.steps is not None:
        out.append(learning_cost(content.steps))
    if log is not None:
        out += [
            catching_trajectory(arm, log, plain),
            target_and_hand(arm, log),
            joint_angles(arm, log, plain),
            joint_torques(arm, log, plain),
        ]
        if content.shares:
            out.append(feedback_by_step(content.shares))
        elif plain is not None:
            both = feedback_share(plain), feedback_share(log)
            out.append(feedback_by_step(both, given=True))
        if np.isfinite(log.t_catch):
            caught_at = log.truth.position[int(np.argmin(np.abs(log.truth.t - log.t_catch)))]
    out.append(contact_errors(trials))
    if content.releases is not None and len(trials):
        out.append(releases(trials, content.releases[: len(trials)], caught_at))
    return out
