"""What the page of a run shows of batting alone: where balls land, and what each hit taught."""

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
from mitt.lab.trials.batting import BAT
from mitt.lab.trials.landing import CLOSE, NEAR
from mitt.lab.trials.prepared import Shown
from mitt.lab.trials.scored_task import Measure
from mitt.lab.trials.task_run import FinishedRun

#: Half-width of the picture at least, and at most [m].
_LEAST = 0.3
_MOST = 1.5
_SPEED: Final = Measure("speed after the hit [m/s]", "return_speed_m_s", 1)
_COLUMNS: Final = (
    Column("hit at [s]", lambda t: shown_number(t["t_hit_s"], 3)),
    Column("speed after it [m/s]", lambda t: shown_number(t["return_speed_m_s"], 2)),
)


def bat_blocks(finished: FinishedRun, result: dict[str, Any]) -> Blocks:
    """Return what the page of a run of batting shows, with a replay of the first return."""
    runner = finished.runner
    first = next((t.index for t in finished.trials if t.status == BAT.success), None)
    replay = None
    if first is not None and isinstance(runner, Shown):
        log = runner.log_of_success(first)
        document = replay_page(runner.arm, runner.scene, log)
        replay = Replay("replay-3d", document, still(runner.arm, runner.scene, log, BOX))
    return blocks_of_hits(result, replay)


def blocks_of_hits(result: dict[str, Any], replay: Replay | None) -> Blocks:
    """Return what the page shows of balls that were hit back; ``replay`` is of the first."""
    of, trials = result["summary"], result["trials"]
    cards = []
    if of["within_10_cm"] is not None:
        low, high = (100.0 * end for end in of["within_10_cm_ci95"])
        note = (
            f"{of['within_10_cm']} of {of['throws']} throws; 95 % interval {low:.1f} to "
            f"{high:.1f} % (Wilson); balls returned are those within 25 cm"
        )
        cards.append(
            Card("Within 10 cm", f"{100.0 * of['within_10_cm_rate']:.1f}", "% of all", note)
        )
    if (median := of["median_landing_m"]) is not None:
        note = "median of all balls; one that does not land is farther than any"
        cards.append(Card("Landing error of all", f"{100.0 * median:.1f}", "cm", note))
    cards.append(spread_card(_SPEED, trials))
    if (later := of["median_landing_after_20_m"]) is not None:
        note = "median of all balls"
        cards.append(Card("Landing error after 20 throws", f"{100.0 * later:.1f}", "cm", note))
    return Blocks(
        is_="An arm with a paddle is to hit thrown balls to a target: a learned map turns what is "
        "seen straight into motion of the joints.",
        shown="" if replay is None else "The ball was returned to within 25 cm of the target.",
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
        out.append(OwnPicture("replay", "The first ball that was returned", words, replay))
    if lands := [t["lands_m"] for t in trials if t["lands_m"] is not None]:
        title = "Where the balls land"
        words = (
            "Seen from above, at the target\u2019s height; up is along their way. Circles: 10 and "
            f"25 cm. {len(lands)} of {len(trials)} balls land."
        )
        out.append(OwnPicture("figures", title, words, returns(lands)))
    landed = [t for t in trials if t["landing_m"] is not None]
    if len(landed) > 1:
        title = "Restitution as the catcher estimates it, and the landing error"
        words = (
            "The share of the speed along the paddle\u2019s normal that ball and paddle give back "
            "differs from the one that the catcher is given, by up to 3 %. It is learned from what "
            "is seen of each hit."
        )
        out.append(OwnPicture("figures", title, words, draw_learned(landed)))
    return out


def returns(lands: Sequence[Sequence[float]]) -> Plot:
    """Draw where balls land, from the target: beyond it and to the left of it [m]."""
    points = 100.0 * np.array(lands)[:, ::-1]
    half = 100.0 * float(np.clip(1.1 * np.abs(points / 100.0).max(), _LEAST, _MOST))

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        for radius in (CLOSE, NEAR):
            axes.add_patch(Circle((0.0, 0.0), 100.0 * radius, fill=False, color=GREY, lw=1.2))
        axes.plot(0.0, 0.0, "+", color=INK, ms=11, mew=1.6)
        left = np.abs(points).max(axis=1) <= half
        dots(axes, points[left], colour=BLUE, size=4.0, label="")
        axes.set(xlim=(half, -half), ylim=(-half, half), aspect="equal")
        axes.set(xlabel="to the left of the target [cm]", ylabel="beyond the target [cm]")
        if not np.all(left):
            axes.set_title(f"{int(np.sum(~left))} more land outside", fontsize=9.0)

    return plot("returns", (9.0, 5.6), draw)


def draw_learned(trials: Sequence[dict[str, Any]]) -> Plot:
    """Draw the restitution as it was estimated before each hit, and the landing error."""
    index = np.array([t["index"] for t in trials])
    error = 100.0 * np.array([t["landing_m"] for t in trials])
    estimated = np.array([t["restitution"] for t in trials])

    def draw(figure: Figure) -> None:
        above, below = figure.subplots(2, 1, sharex=True)
        above.plot(index, estimated, color=BLUE)
        above.set(ylabel="restitution")
        dots(below, np.column_stack([index, error]), colour=ORANGE, size=3.0, label="")
        below.set(xlabel="throw", ylabel="landing error [cm]", ylim=(0.0, None))
        below.set_xlim(-0.5, float(index[-1]) + 0.5)

    return plot("learned", (9.0, 4.4), draw)
