"""The page that ``mitt meet`` leaves behind: what was met, how near, and why the rest was not."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from mitt.io.writing import write_text
from mitt.lab.report.page import NONE, Section, made_with, page, shown_number
from mitt.lab.report.style import BLUE, GREY, ORANGE, Plot, mark_time, plot
from mitt.lab.trials.meeting import NEAR, SLOW, STATUSES, Course

#: How long before the first touch, and after the tool has closed, a course is drawn [s].
_BEFORE = 1.0
_AFTER = 0.6
#: Trials in the table.
_ROWS = 500

_HEAD = (
    "trial",
    "status",
    "placed",
    "binding limit",
    "beyond a limit [ms]",
    "closed at [s]",
    "in step [ms]",
    "off [mm]",
    "relative [m/s]",
    "force [N]",
    "on the hand [N]",
    "tool [m/s]",
)

_NAMES = ("arm", "limits", "tool", "target", "generator", "seed")

_SECTIONS = (
    Section("summary", "Summary", "What happened"),
    Section("course", "One meeting", "One meeting"),
    Section("failures", "Not met", "What was not met, and why"),
    Section("trials", "All trials", "All trials"),
    Section("repeat", "Repeat", "How to repeat it"),
)


def write_meet_page(path: Path, result: dict[str, Any], course: Course, *, command: str) -> None:
    """Write the page whole or not at all.

    Args:
        path: The file.
        result: The result, ``mitt.meet/1``.
        course: How the first trial went.
        command: The command that made the run.

    Raises:
        FileError: The file cannot be written.
    """
    said, trials = result["summary"], result["trials"]
    failed = [t for t in trials if t["status"] != "met" or t["placed"] is False]
    why = Counter((t["status"], t["binding_limit"] or NONE) for t in trials if t["status"] != "met")
    whys = [(status, reason, str(n)) for (status, reason), n in why.most_common()]
    write_text(
        path,
        page(
            "meet",
            _SECTIONS,
            title=f"{said['met']} of {said['trials']} met",
            command="meet",
            frame="task",
            names=_NAMES,
            numbers=8,
            result=result,
            said=said,
            made_with=made_with(),
            typed=command,
            whys=whys,
            counts=", ".join(f"{said[s]} {s}" for s in STATUSES if said[s]),
            head=_HEAD,
            failed=_rows(failed),
            rows=_rows(trials),
            course=gap_and_speed(course).svg,
        ),
    )


def gap_and_speed(course: Course) -> Plot:
    """Draw distance and relative speed of tool and part over time, about the meeting."""
    first = course.t_touched if course.t_touched is not None else course.t[int(course.gap.argmin())]
    end = course.t_met if course.t_met is not None else first
    shown = (course.t >= first - _BEFORE) & (course.t <= max(end, first) + _AFTER)
    t = course.t[shown]

    def draw(figure: Figure) -> None:
        above, below = figure.subplots(2, 1, sharex=True)
        for axes, values, colour, bound, label in (
            (above, 1e3 * course.gap, BLUE, 1e3 * NEAR, "distance [mm]"),
            (below, course.slip, ORANGE, SLOW, "relative speed [m/s]"),
        ):
            axes.semilogy(t, np.maximum(values[shown], 0.02 * bound), color=colour)
            axes.axhline(bound, color=GREY, linewidth=0.9, linestyle=(0, (1, 2)))
            axes.set(ylabel=label)
            axes.yaxis.set_major_formatter("{x:g}")
            for at, text in ((course.t_touched, "touches"), (course.t_met, "has closed")):
                if at is not None:
                    first = at == course.t_touched
                    mark_time(axes, at, text, named=axes is above, before=first)
        below.set(xlabel="time [s]")

    return plot("course", (9.0, 4.8), draw)


def _rows(trials: Sequence[dict[str, Any]]) -> list[tuple[str, ...]]:
    """Return a row of the table a trial."""
    placed = {True: "yes", False: "no", None: NONE}
    return [
        (
            str(t["index"]),
            str(t["status"]),
            placed[t["placed"]],
            str(t["binding_limit"] or NONE),
            str(t["limit_violations"]),
            shown_number(t["t_met_s"], 2),
            shown_number(1e3 * t["in_sync_s"], 0),
            shown_number(t["position_error_mm"], 1),
            shown_number(t["velocity_error_m_s"], 3),
            shown_number(t["peak_contact_force_n"], 0),
            shown_number(t["hand_force_n"], 0),
            shown_number(t["tool_speed_m_s"], 2),
        )
        for t in trials[:_ROWS]
    ]
