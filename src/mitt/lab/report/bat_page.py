"""The page that ``mitt bat`` leaves behind: where the balls go, and what was learned on the way."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from mitt.core.arm.arm import Arm
from mitt.io.writing import write_text
from mitt.lab.report.page import NONE, Section, made_with, page, shown_number
from mitt.lab.report.pictures import still
from mitt.lab.report.replay_3d import BOX, replay_page
from mitt.lab.report.style import BLUE, GREY, INK, ORANGE, Plot, dots, plot
from mitt.lab.trials.batting import STATUSES
from mitt.lab.trials.log import TrialLog
from mitt.lab.world.scene import Scene

#: Circles about the target [m]: the second is the landing error of the best published return on a
#: real arm (W. Gao and others, arXiv 2109.03100).
CIRCLES = (0.10, 0.25)
#: Half-width of the picture at least, and at most [m].
_LEAST = 0.3
_MOST = 1.5
#: Trials in the table.
_ROWS = 500

_NAMES = ("arm", "limits", "scene", "vision", "generator", "seed")
_HEAD = (
    "throw",
    "status",
    "binding limit",
    "beyond a limit [ms]",
    "hit at [s]",
    "off the middle [mm]",
    "miss [cm]",
    "speed [m/s]",
    "force [N]",
)

_SECTIONS = (
    Section("summary", "Summary", "What happened"),
    Section("returns", "Returns", "Where the balls went"),
    Section("learned", "Learned", "What was learned from hit to hit"),
    Section("replay", "3-D replay", "One throw in 3-D"),
    Section("trials", "All throws", "All throws"),
    Section("repeat", "Repeat", "How to repeat it"),
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BatContent:
    """What a page is made from.

    Attributes:
        result: The result, ``mitt.bat/1``.
        arm: The arm of the run.
        scene: The world's settings of the run.
        log: A throw that was hit; None where there was none.
        command: The command that made the run.
    """

    result: dict[str, Any]
    arm: Arm
    scene: Scene
    log: TrialLog | None
    command: str


def write_bat_page(path: Path, content: BatContent) -> None:
    """Write the page whole or not at all.

    Raises:
        FileError: The file cannot be written.
    """
    result, log = content.result, content.log
    said, trials = result["summary"], result["trials"]
    passes = [t["passes_m"] for t in trials if t["passes_m"] is not None]
    misses = [t for t in trials if t["miss_m"] is not None]
    counts = ", ".join(f"{said[s]} {s}" for s in STATUSES if said[s])
    of = "stopped" if result["shield"] else "hit back"
    write_text(
        path,
        page(
            "bat",
            _SECTIONS,
            title=f"{said['hit']} of {said['throws']} balls {of}",
            frame="task",
            command="bat",
            names=_NAMES,
            head=_HEAD,
            numbers=6,
            result=result,
            said=said,
            counts=counts,
            made_with=made_with(),
            typed=content.command,
            rows=_rows(trials),
            returns=returns(passes).svg if passes else "",
            learned=draw_learned(misses).svg if len(misses) > 1 else "",
            replay=None if log is None else replay_page(content.arm, content.scene, log),
            still=None if log is None else still(content.arm, content.scene, log, BOX),
        ),
    )


def returns(passes: Sequence[Sequence[float]]) -> Plot:
    """Draw where balls pass the plane of the target, across and up from it [m]."""
    points = 100.0 * np.array(passes)
    half = 100.0 * float(np.clip(1.1 * np.abs(points / 100.0).max(), _LEAST, _MOST))

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for radius in CIRCLES:
            axes.add_patch(Circle((0.0, 0.0), 100.0 * radius, fill=False, color=GREY, lw=1.2))
        axes.plot(0.0, 0.0, "+", color=INK, ms=11, mew=1.6)
        left = np.abs(points).max(axis=1) <= half
        dots(axes, points[left], colour=BLUE, size=4.0, label="")
        axes.set(xlim=(half, -half), ylim=(-half, half), aspect="equal")
        axes.set(xlabel="to the left of the target [cm]", ylabel="above the target [cm]")
        if not np.all(left):
            axes.set_title(f"{int(np.sum(~left))} more pass outside", fontsize=9.0)

    return plot("returns", (9.0, 5.6), draw)


def draw_learned(trials: Sequence[dict[str, Any]]) -> Plot:
    """Draw what was believed before each hit, and how far it missed."""
    index = np.array([t["index"] for t in trials])
    miss = 100.0 * np.array([t["miss_m"] for t in trials])
    believed = np.array([t["restitution"] for t in trials])

    def draw(figure: Figure) -> None:
        above, below = figure.subplots(2, 1, sharex=True)
        above.plot(index, believed, color=BLUE)
        above.set(ylabel="restitution")
        dots(below, np.column_stack([index, miss]), colour=ORANGE, size=3.0, label="")
        below.set(xlabel="throw", ylabel="miss [cm]", ylim=(0.0, None))
        below.set_xlim(-0.5, float(index[-1]) + 0.5)

    return plot("learned", (9.0, 4.4), draw)


def _rows(trials: Sequence[dict[str, Any]]) -> list[tuple[str, ...]]:
    """Return a row of the table a trial."""
    return [
        (
            str(t["index"]),
            str(t["status"]),
            str(t["binding_limit"] or NONE),
            str(t["limit_violations"]),
            shown_number(t["t_hit_s"], 3),
            shown_number(t["off_middle_mm"], 1),
            shown_number(None if t["miss_m"] is None else 100.0 * t["miss_m"], 1),
            shown_number(t["return_speed_m_s"], 2),
            shown_number(t["peak_contact_force_n"], 0),
        )
        for t in trials[:_ROWS]
    ]
