"""What the page of a run shows of meetings alone: how near and how slow, and what was put away."""

from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from mitt.lab.report.page import NONE, Card, OwnPicture, shown_number
from mitt.lab.report.run_page import Blocks, Column
from mitt.lab.report.style import BLUE, GREY, ORANGE, Plot, mark_time, plot
from mitt.lab.trials.meeting import NEAR, SLOW, Course, MeetRunner
from mitt.lab.trials.task_run import FinishedRun

#: How long before the first touch, and after the tool has closed, a course is drawn [s].
_BEFORE = 1.0
_AFTER = 0.6
#: What the table says of a part that was met: whether it was put where it belongs.
_PLACED: Final = {True: "yes", False: "no", None: NONE}
_COLUMNS: Final = (
    Column("placed", lambda t: _PLACED[t["placed"]]),
    Column("cycle [s]", lambda t: shown_number(t["cycle_s"], 1)),
    Column("closed at [s]", lambda t: shown_number(t["t_met_s"], 2)),
    Column("on the hand [N]", lambda t: shown_number(t["hand_force_n"], 0)),
    Column("tool [m/s]", lambda t: shown_number(t["tool_speed_m_s"], 2)),
)


def meet_blocks(finished: FinishedRun, result: dict[str, Any]) -> Blocks:
    """Return what the page of a run of meetings shows, with the course of the first."""
    runner = finished.runner
    if not isinstance(runner, MeetRunner):
        raise TypeError("a run of meetings has a page of meetings")
    return blocks_of_meetings(result, runner.first_course)


def blocks_of_meetings(result: dict[str, Any], course: Course) -> Blocks:
    """Return what the page shows of meetings, the first of which went as ``course`` says."""
    of = result["summary"]
    rate = of["parts_a_minute"]
    minute = [] if rate is None else [Card("Parts a minute", f"{rate:.1f}", "", "one at a time")]
    cards = [*minute, Card("Placed", str(of["placed"]), f"of {of['met']} met", "put on the tray")]
    if of["hand_force_n"] is not None:
        note = "largest, beyond the weight of the thing"
        cards.append(Card("Force on the hand", f"{of['hand_force_n']:.0f}", "N", note))
    return Blocks(
        is_="An arm is to meet what moves on a belt or in a hand, and to take it: a learned map "
        "turns what is seen straight into motion of the joints.",
        lead=[f"The arm was at rest at the end of {of['at_rest']} of {of['trials']} trials."],
        cards=cards,
        columns=_COLUMNS,
        failures="Area means that the part left the work area while it was followed.",
        pictures=[
            OwnPicture(
                "figures",
                "Distance and relative speed of tool and part",
                "The first trial, until 0.6 s after the tool has closed. Dotted: the bounds "
                f"within which tool and part are in step, {1e3 * NEAR:g} mm and {SLOW:g} m/s.",
                gap_and_speed(course),
            )
        ],
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
