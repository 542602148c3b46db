"""What the figures of the documentation share: how they look, where they go, arm and ball."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

import mitt
from mitt.arm.arm import Arm
from mitt.report.scene_meshes import skeleton
from mitt.report.style import INK, RC
from mitt.signals import Array

#: Where figures go if the command names no other folder.
IMAGES = Path(__file__).parents[1] / "img"
#: Acceleration of a ball without drag [m/s^2].
FALL = np.array([0.0, 0.0, -9.81])


def save(name: str, size: tuple[float, float], draw: Callable[[Figure], None]) -> None:
    """Draw a figure of a size [inch] into ``name``.svg; the same data give the same file."""
    look: dict[Any, Any] = {
        **RC, "svg.fonttype": "path", "svg.hashsalt": name, "savefig.transparent": False,
    }  # fmt: skip
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else IMAGES
    with matplotlib.rc_context(look):
        figure = Figure(figsize=size, layout="constrained", facecolor="white")
        canvas = FigureCanvasSVG(figure)
        draw(figure)
        canvas.print_svg(str(folder / f"{name}.svg"), metadata={"Date": None})


def ball_at(r_c: Array, dr_c: Array, t: float) -> mitt.BallState:
    """Return a ball without drag that is at ``r_c`` [m] with ``dr_c`` [m/s] at time 0 [s]."""
    return mitt.BallState(
        t=t, tracked=True, r_o=r_c + t * dr_c + 0.5 * t * t * FALL, dr_o=dr_c + t * FALL,
        ddr_o=FALL.copy(), drag=0.0, covariance=1e-6 * np.eye(6), t_seen=t, t_first=t,
    )  # fmt: skip


def draw_arm(axes: Axes, arm: Arm, q: Array, **how: Any) -> None:  # noqa: ANN401 (matplotlib)
    """Draw an arm from the side, as a line from shoulder to catch point."""
    x, _, z = skeleton(arm.model, q).T
    axes.plot(x, z, **{"color": INK, "linewidth": 3.0, "solid_joinstyle": "round", **how})
