"""How all figures look, and how one becomes an SVG that can stand inside a page."""

import io
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path

from mitt.core.signals import Array

# Colours that the colour-blind tell apart: M. Okabe, K. Ito, Color universal design, 2008.
BLUE = "#0072b2"
ORANGE = "#d55e00"
GREEN = "#009e73"
PURPLE = "#cc79a7"
YELLOW = "#e69f00"
INK = "#1f2933"
GREY = "#6b7785"
PALE = "#b8c0c9"
BAND = "#eef2f5"

#: The map that has learned nothing.
ALPHA_0 = "\u03b1 = 0"

#: What is drawn in which colour, everywhere.
BALL = ORANGE
LEARNED = BLUE
PLAIN = INK
STATUS = {
    "caught": (BLUE, "o"),
    "dropped": (YELLOW, "v"),
    "missed": (ORANGE, "X"),
    "unreachable": (GREY, "s"),
    "stopped": (PURPLE, "D"),
    "aborted": (INK, "P"),
}

#: What other tasks call a trial that came to nothing, as colours go.
_LIKE = {"slipped": "dropped"}

#: Generators: colour, marker and line. What nobody has named here comes in grey.
GENERATORS: dict[str, tuple[str, str, str]] = {
    "direct": (BLUE, "o", "-"),
    "single": ("#003f6b", "h", "-"),
    "unoptimised": (INK, "s", "--"),
    "ik": (ORANGE, "v", "-"),
    "quintic": (GREEN, "^", "-"),
    "quintic-100hz": (GREEN, "^", "--"),
    "quintic-30hz": (GREEN, "2", "-."),
    "quintic-10hz": (GREEN, "1", ":"),
    "ruckig": (PURPLE, "D", "-"),
    "mpc": (YELLOW, "P", "-"),
    "ds": ("#56b4e9", "X", "-"),
    "line": (INK, ".", ":"),
    "line-compensated": (GREY, ".", "-."),
    "clairvoyant": (GREY, "*", ":"),
}
UNNAMED = (PALE, ".", "-")

#: Attributes that hold coordinates, and digits that nobody sees in them.
_DRAWN = re.compile(r'\b(?:d|x|y)="[^"]*"')
_DIGITS = re.compile(r"(\.\d\d)\d+")

#: How Matplotlib is told to draw.
RC: dict[str, object] = {
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 9.5,
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.titlecolor": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": PALE,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e6eaee",
    "grid.linewidth": 0.7,
    "xtick.color": GREY,
    "ytick.color": GREY,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.major.size": 3.0,
    "ytick.major.size": 3.0,
    "lines.linewidth": 1.6,
    "lines.solid_capstyle": "round",
    "legend.frameon": False,
    "legend.fontsize": 9.0,
    "path.simplify": True,
    "path.simplify_threshold": 0.15,
    "savefig.transparent": True,
    "text.parse_math": False,  # names are names: a dollar begins no formula
}


def status_colour(status: str, *, success: bool) -> str:
    """Return the colour of a way in which trials end; grey where nobody has named one here."""
    if success:
        return BLUE
    return STATUS.get(_LIKE.get(status, status), (PALE, ""))[0]


@dataclass(frozen=True, slots=True)
class Plot:
    """A drawn figure.

    Attributes:
        name: Short name, unique in a page; also the prefix of the ids inside the SVG.
        svg: One ``<svg>`` element.
    """

    name: str
    svg: str


def plot(name: str, size: tuple[float, float], draw: Callable[[Figure], None]) -> Plot:
    """Draw a figure of a size [inch] and return it; the same data give the same text."""
    with matplotlib.rc_context({**RC, "svg.hashsalt": name}):
        figure = Figure(figsize=size, layout="constrained")
        canvas = FigureCanvasSVG(figure)
        draw(figure)
        out = io.BytesIO()
        canvas.print_svg(out, metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    return Plot(name, _inline(name, out.getvalue().decode()))


def _inline(name: str, document: str) -> str:
    """Return the ``<svg>`` element of a document, its ids made unique, its addresses left out."""
    svg = document[document.index("<svg") :].strip()
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r' xmlns(:\w+)?="[^"]*"', "", svg)
    svg = re.sub(r"<!--.*?-->\s*", "", svg, flags=re.DOTALL)
    svg = re.sub(r'\bid="', f'id="{name}-', svg)
    svg = svg.replace("url(#", f"url(#{name}-").replace('xlink:href="#', f'href="#{name}-')
    svg = svg.replace("xlink:href=", "href=")
    svg = _DRAWN.sub(lambda hit: _DIGITS.sub(r"\1", hit.group()), svg)
    head, body = svg.split(">", 1)
    head = re.sub(r' (width|height|version)="[^"]*"', "", head)
    return f'{head} role="img">{body}'


def dots(axes: Axes, points: Array, *, colour: str, size: float, label: str) -> None:
    """Draw many points, shape (k, 2), as one path of round dots: a tenth of k markers' text."""
    path = Path(np.repeat(points, 2, axis=0), np.tile([Path.MOVETO, Path.LINETO], len(points)))
    path.should_simplify = False
    patch = PathPatch(path, edgecolor=colour, facecolor="none", linewidth=size, zorder=3)
    patch.set_capstyle("round")
    axes.add_patch(patch)
    axes.plot([], [], "o", color=colour, markersize=size + 1.0, label=label)


def mark_time(axes: Axes, t: float, text: str, *, named: bool, before: bool = False) -> None:
    """Mark an instant by a fine line, and perhaps name it at the upper edge, left or right."""
    side, off = ("right", -3) if before else ("left", 3)
    axes.axvline(t, color=GREY, linewidth=0.9, linestyle=(0, (4, 2)), zorder=1)
    if named:
        axes.annotate(
            text,
            (t, 1.0),
            (off, -3),
            xycoords=("data", "axes fraction"),
            color=GREY,
            textcoords="offset points",
            ha=side,
            va="top",
            fontsize=8.5,
        )


def legend_above(figure: Figure, axes: Axes, **how: Any) -> None:  # noqa: ANN401 (matplotlib)
    """Put one legend for all axes above them, with the names that one of them has."""
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        figure.legend(handles, labels, loc="outside upper left", **{"ncols": len(labels), **how})
