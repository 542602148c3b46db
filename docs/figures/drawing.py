"""What the figures of the documentation share: how they look, where they go, arm and ball."""

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from PIL import Image

import mitt
from mitt.core.arm.arm import Arm
from mitt.core.signals import Array
from mitt.lab.report.painter import View, painted
from mitt.lab.report.pictures import body_faces, placed_faces
from mitt.lab.report.scene_meshes import skeleton
from mitt.lab.report.style import INK, RC
from mitt.lab.world.build import build_scene
from mitt.lab.world.scene import Scene
from mitt.lab.world.truth import Trace

#: Where figures go if the command names no other folder.
IMAGES = Path(__file__).parents[1] / "img"
#: From frame to frame of a moving picture [ms].
_EACH_MS = 10
#: Acceleration of a ball without drag [m/s^2].
FALL = np.array([0.0, 0.0, -9.81])


def save(name: str, size: tuple[float, float], draw: Callable[[Figure], None]) -> None:
    """Draw a figure of a size [inch] into ``name``.svg; the same data give the same file."""
    look: dict[Any, Any] = {
        **RC,
        "svg.fonttype": "path",
        "svg.hashsalt": name,
        "savefig.transparent": False,
    }
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else IMAGES
    with matplotlib.rc_context(look):
        figure = Figure(figsize=size, layout="constrained", facecolor="white")
        canvas = FigureCanvasSVG(figure)
        draw(figure)
        canvas.print_svg(str(folder / f"{name}.svg"), metadata={"Date": None})


class Part(NamedTuple):
    """A part of a moving picture: a trial from ``first`` to ``last`` [s], a trail to ``caught``."""

    trace: Trace
    first: float
    caught: float
    last: float


def moving_picture(
    name: str,
    arm: Arm,
    scene: Scene,
    parts: Sequence[Part],
    view: View,
    *,
    mark: tuple[float, float, float] | None = None,
) -> None:
    """Draw parts of trials one after the other, four times slower than life, as a GIF.

    Args:
        name: Name of the file.
        arm: The arm.
        scene: The world.
        parts: What is shown.
        view: From where.
        mark: A place with a ring of dots about it [m].
    """
    model, frames = build_scene(scene, arm.model).model, list[Image.Image]()
    bodies = [body_faces(model, body, arm, scene) for body in range(model.nbody)]
    angle = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
    ring = 0.1 * np.column_stack([np.cos(angle), 0.0 * angle, np.sin(angle)])
    dots = np.zeros((0, 3)) if mark is None else np.array(mark) + ring
    for part in parts:
        trace = part.trace
        first, last = np.searchsorted(trace.t, (part.first, part.last))
        for k in range(first, last, _EACH_MS):
            trail = trace.r_o[max(k - 96, 0) : k : 8] if trace.t[k] < part.caught else dots[:0]
            shown = placed_faces(model, bodies, trace.qpos[k], np.concatenate([trail, dots]))
            frames.append(painted(*shown, scene.floor, view=view))
    palette = frames[30].quantize(128, Image.Quantize.FASTOCTREE)
    flat = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else IMAGES
    flat[0].save(
        folder / name, save_all=True, append_images=flat[1:], duration=4 * _EACH_MS, loop=0
    )


def ball_at(r_c: Array, dr_c: Array, t: float) -> mitt.BallState:
    """Return a ball without drag that is at ``r_c`` [m] with ``dr_c`` [m/s] at time 0 [s]."""
    return mitt.BallState(
        t=t,
        tracked=True,
        r_o=r_c + t * dr_c + 0.5 * t * t * FALL,
        dr_o=dr_c + t * FALL,
        ddr_o=FALL.copy(),
        drag=0.0,
        covariance=1e-6 * np.eye(6),
        t_seen=t,
        t_first=t,
    )


def draw_arm(axes: Axes, arm: Arm, q: Array, **how: Any) -> None:  # noqa: ANN401 (matplotlib)
    """Draw an arm from the side, as a line from shoulder to catch point."""
    x, _, z = skeleton(arm.model, q).T
    axes.plot(x, z, **{"color": INK, "linewidth": 3.0, "solid_joinstyle": "round", **how})
