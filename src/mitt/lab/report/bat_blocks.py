"""What the page of a run shows of batting alone: where balls go, and what each hit taught."""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from mitt.lab.report.page import Card, OwnPicture, Replay, shown_number
from mitt.lab.report.pictures import still
from mitt.lab.report.replay_3d import BOX, replay_page
from mitt.lab.report.run_page import Blocks, Column, spread_card
from mitt.lab.report.style import BLUE, GREY, INK, ORANGE, Plot, dots, plot
from mitt.lab.trials.prepared import Shown
from mitt.lab.trials.scored_task import Measure
from mitt.lab.trials.task_run import FinishedRun

#: Circles about the target [m]: the second is the landing error of the best published return on a
#: real arm (W. Gao and others, arXiv 2109.03100).
CIRCLES = (0.10, 0.25)
#: Half-width of the picture at least, and at most [m].
_LEAST = 0.3
_MOST = 1.5
_SPEED: Final = Measure("speed after the hit [m/s]", "return_speed_m_s", 1)
_COLUMNS: Final = (
    Column("hit at [s]", lambda t: shown_number(t["t_hit_s"], 3)),
    Column("speed after it [m/s]", lambda t: shown_number(t["return_speed_m_s"], 2)),
)


def bat_blocks(finished: FinishedRun, result: dict[str, Any]) -> Blocks:
    """Return what the page of a run of batting shows, with a replay of the first hit."""
    runner = finished.runner
    hit = next((t.index for t in finished.trials if t.status == "hit"), None)
    replay = None
    if hit is not None and isinstance(runner, Shown):
        log = runner.log_of_success(hit)
        document = replay_page(runner.arm, runner.scene, log)
        replay = Replay("replay-3d", document, still(runner.arm, runner.scene, log, BOX))
    return blocks_of_hits(result, replay)


def blocks_of_hits(result: dict[str, Any], replay: Replay | None) -> Blocks:
    """Return what the page shows of balls that were hit back; ``replay`` is of the first."""
    of, trials = result["summary"], result["trials"]
    cards = [spread_card(_SPEED, trials)]
    if (later := of["median_miss_after_20_m"]) is not None:
        cards.append(Card("Miss after 20 throws", f"{100.0 * later:.1f}", "cm", "median"))
    return Blocks(
        counted="balls stopped" if result["shield"] else "",
        cards=cards,
        columns=_COLUMNS,
        pictures=_pictures(trials, replay),
    )


def _pictures(trials: Sequence[dict[str, Any]], replay: Replay | None) -> list[OwnPicture]:
    """Return all pictures for which there are data."""
    out = []
    if replay is not None:
        words = "Plays five times slower than life. Drag to turn, scroll to come nearer."
        out.append(OwnPicture("replay", "The first hit", words, replay))
    if passes := [t["passes_m"] for t in trials if t["passes_m"] is not None]:
        title = "Where the balls pass the target"
        words = (
            "In the upright plane through the target, seen along their way. Circles: 10 and 25 cm."
        )
        out.append(OwnPicture("figures", title, words, returns(passes)))
    misses = [t for t in trials if t["miss_m"] is not None]
    if len(misses) > 1:
        title = "Restitution as the catcher estimates it, and the miss"
        words = (
            "The share of the speed along the paddle\u2019s normal that ball and paddle give back "
            "differs from the one that the catcher is given, by up to 3 %. It is learned from what "
            "is seen of each hit."
        )
        out.append(OwnPicture("figures", title, words, draw_learned(misses)))
    return out


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
    """Draw the restitution as it was estimated before each hit, and how far the hit missed."""
    index = np.array([t["index"] for t in trials])
    miss = 100.0 * np.array([t["miss_m"] for t in trials])
    estimated = np.array([t["restitution"] for t in trials])

    def draw(figure: Figure) -> None:
        above, below = figure.subplots(2, 1, sharex=True)
        above.plot(index, estimated, color=BLUE)
        above.set(ylabel="restitution")
        dots(below, np.column_stack([index, miss]), colour=ORANGE, size=3.0, label="")
        below.set(xlabel="throw", ylabel="miss [cm]", ylim=(0.0, None))
        below.set_xlim(-0.5, float(index[-1]) + 0.5)

    return plot("learned", (9.0, 4.4), draw)
