"""The folders of ``src/mitt`` as floors of a house: each imports only from those below it."""

import configparser
from itertools import groupby
from pathlib import Path

from drawing import save
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle

from mitt.report.style import BAND, BLUE, GREY, INK

CONTRACTS = Path(__file__).parents[2] / ".importlinter"
#: What each part is for; a part that is not here is an error.
DOES = {
    "cli": "the command mitt: options, help, commands",
    "report": "pages, figures, 3-D replays, the viewer",
    "design": "what an arm can catch, and the map that does it",
    "bench": "speed beside other libraries",
    "cameras": "frames, calibration, videos to tracks",
    "cell": "a robot at its cell: drivers, ROS 2, live loop",
    "trials": "one throw and many: loop, score, replay, studies",
    "world": "the simulation: physics, sensors, throws, faults",
    "files": "every reader and writer",
    "catcher": "one tick: the order of the stages, once",
    "rivals": "rivals: other generators",
    "verdict": "before moving: can it be met, held, how hard",
    "control": "joint motion to torque: limits, brake, fingers",
    "map": "the paper: the map and its learning",
    "eyes": "images to the ball's position",
    "arm": "the arm: kinematics, dynamics, limits, hands",
    "ball": "positions to the ball's motion: flight, filter",
    "clock": "the one clock",
    "signals": "what flows from stage to stage",
    "checks": "arguments of public functions",
    "reading": "files within bounds",
    "errors": "one line: wanted, given, what to do",
    "fields": "settings held to their annotations",
    "interrupts": "Ctrl-C and its kind",
    "numerals": "numbers that a user's text says",
    "kernels": "compiling, views, handles",
    "version": "the version of mitt",
}
#: Height of a line, space about those of a floor, widths [inch].
LINE = 0.27
ABOUT = 0.06
WIDE = 5.9
NAME = 1.4


def layers() -> tuple[list[list[str]], set[str]]:
    """Return the floors of the contracts, top down, and the parts that run on the robot."""
    read = configparser.ConfigParser()
    read.read(CONTRACTS)
    lines = read["importlinter:contract:flow"]["layers"].split("\n")
    floors = [[x.strip().split(".")[1] for x in line.split("|")] for line in lines if line]
    seen: set[str] = set()
    out = []
    for floor in floors:  # modules of one folder on several floors: shown once, on their highest
        new = [part for part, _ in groupby(floor) if part not in seen]
        seen |= set(new)
        out += [new] if new else []
    pure = read["importlinter:contract:pure"]["source_modules"].split()
    return out, {name.split(".")[1] for name in pure}


def draw(figure: Figure) -> None:
    """Draw a floor for each layer, a line for each part, and the roof."""
    axes = figure.add_subplot()
    floors, pure = layers()
    y = 0.0
    for parts in floors:
        height = len(parts) * LINE + 2 * ABOUT
        whole = BAND if pure.issuperset(parts) else "white"
        axes.add_patch(Rectangle((0, y - height), WIDE, height, facecolor=whole, edgecolor=GREY))
        for k, part in enumerate(parts):
            middle = y - ABOUT - (k + 0.5) * LINE
            if part in pure:
                axes.add_patch(Rectangle((0.02, middle - LINE / 2), WIDE - 0.04, LINE, color=BAND))
            colour = BLUE if part in pure else INK
            axes.text(0.12, middle, part, va="center", weight="bold", color=colour, fontsize=10.5)
            axes.text(NAME, middle, DOES[part], va="center", color=INK, fontsize=10)
        y -= height
    axes.add_patch(
        Polygon([(-0.25, 0.0), (0.5 * WIDE, 0.6), (WIDE + 0.25, 0.0)], facecolor=GREY, linewidth=0)
    )
    axes.text(
        0.5 * WIDE,
        0.2,
        "imports go down only",
        color="white",
        ha="center",
        va="center",
        fontsize=10.5,
    )
    axes.text(
        0.0,
        y - 0.22,
        "blue: runs on the robot; knows no plots, files, network, clock, command line",
        color=BLUE,
        va="center",
        fontsize=10,
    )
    axes.set(xlim=(-0.3, WIDE + 0.3), ylim=(y - 0.45, 0.65))
    axes.set_axis_off()


def height() -> float:
    """Return the height of the drawing [inch]."""
    floors, _ = layers()
    return sum(len(parts) * LINE + 2 * ABOUT for parts in floors) + 1.1


save("house", (WIDE + 0.6, height()), draw)
