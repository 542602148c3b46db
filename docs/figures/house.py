"""The rooms of ``src/mitt`` as floors of a house: each imports only from those below it."""

import configparser
from pathlib import Path

from drawing import save
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle

from mitt.lab.report.style import BAND, BLUE, GREY, INK

CONTRACTS = Path(__file__).parents[2] / ".importlinter"
#: What each part is for; a part that is not here is an error.
DOES = {
    "cli": "the command mitt: options, help, commands",
    "gym": "environments of Gymnasium",
    "robot": "the live side: cells, drivers, ROS 2; cameras, calibration",
    "lab": "the laboratory",
    "lab.report": "pages, figures, 3-D replays, the viewer",
    "lab.design": "what an arm can catch, and the map that does it",
    "lab.bench": "speed beside other libraries",
    "lab.trials": "one throw and many: loop, score, replay, studies",
    "lab.world": "the simulation: physics, sensors, throws, faults",
    "lab.rivals": "other generators",
    "io": "every reader and writer; descriptions of arms",
    "clock": "the one clock",
    "core": "what runs on the robot",
    "core.catcher": "one tick: the order of the stages, once",
    "core.verdict": "before moving: can it be met, held, how hard",
    "core.control": "joint motion to torque: limits, brake, fingers",
    "core.map": "the paper: the map and its learning",
    "core.eyes": "images to the ball's position",
    "core.arm": "the arm: kinematics, dynamics, limits, hands",
    "core.ball": "positions to the ball's motion: flight, filter",
    "core.signals": "what flows from stage to stage",
    "core.fields": "settings held to their annotations",
    "core.checks": "arguments of public functions",
    "core.errors": "one line: wanted, given, what to do",
    "core.kernels": "compiling, views, handles",
    "interrupts": "Ctrl-C and its kind",
    "numerals": "numbers that a user's text says",
    "version": "the version of mitt",
}
#: Height of a line, space about those of a room, widths [inch].
LINE = 0.27
ABOUT = 0.06
WIDE = 7.0
NAME = 1.6
INSIDE = 0.3


def parts_of(name: str) -> list[str]:
    """Return the parts that a contract lists, top down."""
    read = configparser.ConfigParser()
    read.read(CONTRACTS)
    lines = read[f"importlinter:contract:{name}"]["layers"].split("\n")
    return [x.strip().removeprefix("mitt.") for line in lines for x in line.split("|") if x.strip()]


def rooms() -> list[list[str]]:
    """Return the rooms, top down, each with the folders that a contract orders in it."""
    ordered = {"lab": parts_of("lab"), "core": parts_of("core")}
    return [[room, *ordered.get(room, [])] for room in parts_of("rooms")]


def draw(figure: Figure) -> None:
    """Draw a floor for each room, a line for each of its folders, and the roof."""
    axes = figure.add_subplot()
    y = 0.0
    for parts in rooms():
        height = len(parts) * LINE + 2 * ABOUT
        core = parts[0] == "core"
        colour = BAND if core else "white"
        axes.add_patch(Rectangle((0, y - height), WIDE, height, facecolor=colour, edgecolor=GREY))
        for k, part in enumerate(parts):
            middle = y - ABOUT - (k + 0.5) * LINE
            ink = BLUE if core else INK
            left = 0.12 + (INSIDE if k else 0.0)
            weight = "normal" if k else "bold"
            name = part.rpartition(".")[2]
            axes.text(left, middle, name, va="center", weight=weight, color=ink, fontsize=10.5)
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
        "blue: NumPy, Numba and the standard library; no plots, files, network, clock",
        color=BLUE,
        va="center",
        fontsize=10,
    )
    axes.set(xlim=(-0.3, WIDE + 0.3), ylim=(y - 0.45, 0.65))
    axes.set_axis_off()


def height() -> float:
    """Return the height of the drawing [inch]."""
    return sum(len(parts) * LINE + 2 * ABOUT for parts in rooms()) + 1.1


save("house", (WIDE + 0.6, height()), draw)
