"""One page about a recorded throw: what happened, and why the ball was missed."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mitt.io.messages import PHASE
from mitt.io.writing import write_text
from mitt.lab.report.page import Section, page, shown_number
from mitt.lab.report.style import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PALE,
    PURPLE,
    YELLOW,
    Plot,
    mark_time,
    plot,
)
from mitt.lab.trials.explain import Evidence, evidence_of, explain, timeline
from mitt.lab.trials.replayed import Replayed

_COLOURS = {
    "watch": PALE,
    "follow": BLUE,
    "brake": GREEN,
    "refused": ORANGE,
    "stopped": PURPLE,
    "nominal": "#dfe5ea",
    "predict": YELLOW,
    "degraded": ORANGE,
    "abort": PURPLE,
    "invalid": INK,
}
_DARK = ("follow", "brake", "stopped", "abort", "invalid", "refused", "degraded")
_JOINTS = (BLUE, ORANGE, GREEN, PURPLE, YELLOW, INK, GREY)


def states(x: Replayed, e: Evidence) -> Plot:
    """Draw phases and states as bars, and where a replay differs from its recording."""
    rows = timeline(x)

    def draw(figure: Figure) -> None:
        axes: Axes = figure.subplots()
        width = e.shown[1] - e.shown[0]
        for k, spans in enumerate(rows.values()):
            for name, start, until in spans:
                end = min(until, e.shown[1])
                axes.barh(k, end - start, left=start, color=_COLOURS[name], height=0.62)
                if end - start > 0.06 * width:  # else its name has no room
                    colour = "white" if name in _DARK else INK
                    axes.text(
                        0.5 * (start + end),
                        k,
                        name,
                        ha="center",
                        va="center",
                        color=colour,
                        fontsize=8.5,
                    )
        names = list(rows)
        if np.any(x.differs):
            axes.plot(
                e.t[x.differs],
                np.full(int(np.sum(x.differs)), len(names)),
                "|",
                color=ORANGE,
                markersize=9,
            )
            names.append("differs")
        axes.set_yticks(range(len(names)), names)
        axes.set_ylim(len(names) - 0.55, -0.95)
        axes.grid(visible=False)
        axes.set_xlabel("time [s]")
        _mark(axes, x, e, named=True)

    return plot("states", (11.0, 1.9), draw)


def estimate(x: Replayed, e: Evidence) -> Plot:
    """Draw residuals, error and sigma of the estimate over time [mm]."""

    def draw(figure: Figure) -> None:
        axes: Axes = figure.subplots()
        known = np.isfinite(e.residual)
        if np.any(known):
            axes.plot(
                e.t[known],
                1e3 * e.residual[known],
                ".",
                color=PALE,
                markersize=3,
                label="residual of a sighting",
            )
        for values, label, colour in (
            (e.error, "error of the estimate", ORANGE),
            (e.sigma, "its 1-sigma", BLUE),
        ):
            if np.any(np.isfinite(values)):
                axes.plot(e.t, 1e3 * values, color=colour, label=label)
        axes.axhline(20.0, color=GREY, lw=0.9, ls=":", label="what a hand needs")
        axes.set(ylabel="[mm]", xlabel="time [s]", yscale="log")
        axes.yaxis.set_major_formatter("{x:g}")
        axes.set_ylim(0.1, 1000.0)
        axes.legend(ncols=4, loc="upper right")
        _mark(axes, x, e, named=False)

    return plot("estimate", (11.0, 3.0), draw)


def limits(x: Replayed, e: Evidence) -> Plot:
    """Draw what share of its limits each joint was commanded."""

    def draw(figure: Figure) -> None:
        pair = figure.subplots(2, 1, sharex=True)
        for axes, shares, name in zip(pair, (e.torque, e.speed), ("torque", "speed"), strict=True):
            for j, joint in enumerate(x.about.arm.names):
                axes.plot(e.t, 100.0 * shares[:, j], color=_JOINTS[j % len(_JOINTS)], label=joint)
            axes.axhline(100.0, color=GREY, lw=0.9, ls=":")
            axes.set(ylabel=f"{name} [%]", ylim=(0.0, 130.0))
            _mark(axes, x, e, named=False)
        pair[0].legend(ncols=8, loc="upper left")
        pair[1].set_xlabel("time [s]")

    return plot("limits", (11.0, 4.0), draw)


def hand(x: Replayed, e: Evidence) -> Plot:
    """Draw how far the commanded and the measured hand were from where the map wanted it [mm]."""

    def draw(figure: Figure) -> None:
        axes: Axes = figure.subplots()
        names = ("command behind the map: limits", "arm behind its command: tracking")
        for values, name, colour in zip(e.behind.T, names, (BLUE, ORANGE), strict=True):
            axes.plot(e.t, 1e3 * values, color=colour, label=name)
        axes.axhline(20.0, color=GREY, lw=0.9, ls=":", label="what a hand needs")
        axes.set(ylabel="[mm]", xlabel="time [s]")
        axes.set_ylim(bottom=0.0)
        axes.legend(ncols=3, loc="upper right")
        _mark(axes, x, e, named=False)

    return plot("hand", (11.0, 2.6), draw)


def _mark(axes: Axes, x: Replayed, e: Evidence, *, named: bool) -> None:
    """Mark start, catch and stop."""
    axes.set_xlim(*e.shown)
    if np.isfinite(x.t_0):
        mark_time(axes, x.t_0, "start", named=named)
    if e.catch is not None:
        mark_time(axes, float(e.t[e.catch]), "catch", named=named)
    if x.stopped_by is not None:
        mark_time(axes, x.stopped_by.t, "stop", named=named)


_SECTIONS = (
    Section("summary", "Summary", "What happened"),
    Section("states", "States", "Phases and states"),
    Section("estimate", "Estimate", "What the estimate was worth"),
    Section("hand", "Hand", "Where the hand was"),
    Section("limits", "Limits", "Limits used"),
    Section("verdicts", "Verdicts", "Verdicts on the throw"),
    Section("events", "Events", "What the recording says"),
)
#: Most rows of a table.
_MOST = 40
#: Where a replay begins, in words.
_BEGINS = {
    "images": "from the images on",
    "eyes": "behind the eyes: from the positions that they found",
    "points": "from the given points on",
}


def write_replay_page(path: Path, x: Replayed, *, command: str) -> None:
    """Write the page of a replayed recording."""
    e = evidence_of(x)
    drawn = len(e.t) > 2 and bool(np.all(np.isfinite(e.t)))
    plots = (
        {}
        if not drawn
        else {
            "states": states(x, e).svg,
            "estimate": estimate(x, e).svg,
            "hand": hand(x, e).svg,
            "limits": limits(x, e).svg,
        }
    )
    first = x.first_difference
    said = (
        "identical to the bit"
        if x.identical
        else ("ticks are missing" if first is None else f"differs from tick {first} on")
    )
    verdicts = [
        (
            shown_number(j.t, 3),
            j.verdict.outcome.value,
            j.verdict.binding_limit or "",
            shown_number(j.verdict.share if np.isfinite(j.verdict.share) else None, 2),
        )
        for j in x.verdicts[-_MOST:]
    ]
    events = [
        (shown_number(t, 3), topic, text[:200])
        for t, topic, text in x.recorded.notices
        if topic != PHASE
    ][:_MOST]
    write_text(
        path,
        page(
            "replay",
            _SECTIONS,
            title=f"Why: {x.recorded.path.stem}",
            command=command,
            file=x.recorded.path.name,
            about=x.about,
            recorded_by=x.recorded.about.version,
            explanation=explain(x, e),
            verdict=said,
            begins=_BEGINS[x.begins],
            plots=plots,
            changed=bool(np.any(x.differs)),
            verdicts=verdicts,
            events=events,
            followed=bool(np.any(np.isfinite(e.behind))),
        ),
    )
