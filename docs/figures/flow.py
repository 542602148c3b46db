"""What flows in a tick, from two images to torques: stages as boxes, signals on the arrows."""

from drawing import save
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from mitt.lab.report.style import BAND, BLUE, GREY, INK

#: Stages in two rows: name, what it does.
STAGES = (
    ("cameras", "two images\na millisecond"),
    ("vision", "centroids,\ntriangulation"),
    ("ball filter", "motion models,\nprediction"),
    ("generator", "the map f, adapted\nto the throw"),
    ("control", "limits, brake,\nfingers"),
    ("arm and hand", "torques or\nmotions"),
)
#: Signals between them.
SIGNALS = ("Frame", "Sighting", "BallState", "JointReference", "Command")
#: Half width and half height of a box, and the height between the two rows.
WIDE = 0.95
HIGH = 0.55
BETWEEN = -1.0


def box(axes: Axes, x: float, y: float, name: str, does: str) -> None:
    """Draw a stage."""
    axes.add_patch(
        FancyBboxPatch(
            (x - WIDE, y - HIGH),
            2 * WIDE,
            2 * HIGH,
            boxstyle="round,pad=0.04",
            facecolor=BAND,
            edgecolor=GREY,
            zorder=0,
        )
    )
    axes.text(x, y + 0.27, name, ha="center", va="center", weight="bold", color=INK, fontsize=11)
    axes.text(x, y - 0.18, does, ha="center", va="center", color=INK, fontsize=9.5)


def draw(figure: Figure) -> None:
    """Draw the first three stages above the last three."""
    axes = figure.add_subplot()
    places = [(3.3 * (k % 3), -2.0 * (k // 3)) for k in range(len(STAGES))]
    for place, stage in zip(places, STAGES, strict=True):
        box(axes, *place, *stage)
    arrow = {"arrowstyle": "-|>", "color": BLUE, "lw": 1.4, "shrinkA": 0, "shrinkB": 0}
    for k, signal in enumerate(SIGNALS):
        (x0, y0), (x1, y1) = places[k], places[k + 1]
        if y0 == y1:
            axes.annotate("", (x1 - WIDE - 0.06, y1), (x0 + WIDE + 0.06, y0), arrowprops=arrow)
            at = 0.5 * (x0 + x1), y0 + 0.08
        else:
            axes.plot([x0, x0, x1], [y0 - HIGH - 0.05, BETWEEN, BETWEEN], color=BLUE, linewidth=1.4)
            axes.annotate("", (x1, y1 + HIGH + 0.05), (x1, BETWEEN), arrowprops=arrow)
            at = 0.5 * (x0 + x1), BETWEEN + 0.08
        axes.text(*at, signal, ha="center", va="bottom", color=BLUE, fontsize=9.5)
    axes.text(
        places[4][0],
        -2.85,
        "encoders go to control, and to the generator when it starts",
        color=GREY,
        fontsize=9.5,
        ha="center",
    )
    axes.set(xlim=(-1.1, 7.7), ylim=(-3.0, 0.7))
    axes.set_axis_off()


save("flow", (9.0, 3.8), draw)
