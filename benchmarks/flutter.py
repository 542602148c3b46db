"""Draw who catches what changes its mind: ``flutter.py docs/img/flutter.svg [DIR]``.

``DIR`` is the folder, ``runs/flutter`` if left out, of a study with conditions named
``flutter N ms``: balls with a random acceleration that remembers itself for N ms. A line a
generator, with 95 % intervals.
"""

import json
import re
import sys
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.figure import Figure

from mitt.lab.report.style import GENERATORS, RC, UNNAMED

#: Names of the conditions that are drawn.
_CONDITION = re.compile(r"flutter (\d+) ms")


def draw(figure: Figure, rows: list[dict[str, Any]]) -> None:
    """Draw a line for each generator."""
    axes = figure.subplots()
    names = list(dict.fromkeys(row["generator"] for row in rows))
    for k, name in enumerate(names):
        colour, marker, line = GENERATORS.get(name, UNNAMED)
        found = sorted(
            (float(match[1]), 100.0 * row["catch_rate"], row["ci95"])
            for row in rows
            if row["generator"] == name
            and row["throws"]
            and (match := _CONDITION.fullmatch(row["condition"]))
        )
        times = [t * 1.015 ** (k - 0.5 * len(names)) for t, _, _ in found]
        rates = [rate for _, rate, _ in found]
        ends = [
            [rate - 100.0 * low for _, rate, (low, _) in found],
            [100.0 * high - rate for _, rate, (_, high) in found],
        ]
        axes.errorbar(
            times,
            rates,
            ends,
            color=colour,
            marker=marker,
            linestyle=line,
            markersize=4.5,
            linewidth=1.4,
            elinewidth=0.7,
            label=name,
        )
    ticks = sorted({float(m[1]) for row in rows if (m := _CONDITION.fullmatch(row["condition"]))})
    axes.set_xscale("log")
    axes.set_xticks(ticks, [f"{t:g}" for t in ticks])
    axes.set_xticks([], minor=True)
    axes.set(
        xlabel="time in which the ball forgets its acceleration [ms]",
        ylabel="caught [%]",
        ylim=(-3, 103),
    )
    figure.legend(loc="outside right upper")


def main() -> None:
    """Read the study and draw."""
    path, folder = Path(sys.argv[1]), Path(*(sys.argv[2:] or ["runs/flutter"]))
    rows = json.loads((folder / "summary.json").read_text(encoding="utf-8"))["rows"]
    with matplotlib.rc_context({**RC, "svg.fonttype": "path", "svg.hashsalt": "flutter"}):
        figure = Figure(figsize=(7.2, 3.6), layout="constrained", facecolor="white")
        draw(figure, [row for row in rows if _CONDITION.fullmatch(row["condition"])])
        figure.savefig(path, metadata={"Date": None})


if __name__ == "__main__":
    main()
