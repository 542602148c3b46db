"""Pictures as PNG: the throw every 33 ms, fig. 12, and what a calibration has seen of its board.

The throw is drawn by Matplotlib from the meshes of the replay: faces are painted from far to near,
each in one shade.
"""

import base64
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
import mujoco
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LightSource, Normalize
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

from mitt.arm.arm import Arm
from mitt.files.writing import write_atomically
from mitt.report.scene_meshes import BALL, body_meshes, sphere
from mitt.report.style import GREY, INK, RC
from mitt.signals import Array
from mitt.trials.log import TrialLog
from mitt.world.build import build_scene
from mitt.world.scene import Scene

#: The point that the camera looks at [m], elevation and azimuth from there to the camera [deg]:
#: from the side, a little from the thrower's end.
_TARGET, FROM_THE_SIDE = (0.72, 0.0, 0.16), (4.5, -85.5)
#: Colours of sky, floor and its lines; where floor and lines end [m].
_SKY, _FLOOR, _LINES = "#e9edf1", "#eff1f4", "#dce1e7"
_X, _Y = (-6.0, 8.0), (-2.5, 9.0)

_MADE_BY = {"Software": "mitt"}

Faces = tuple[Array, Array]
"""Corners of triangles [m], shape (k, 3, 3), and their colours, 0 to 1, shape (k, 3)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """One picture.

    Attributes:
        t: Time from release [s].
        catch: Whether it shows the catch.
        png: PNG in base64.
    """

    t: float
    catch: bool
    png: str


def picture_strip(arm: Arm, scene: Scene, log: TrialLog) -> tuple[Picture, ...]:
    """Return pictures every 33 ms, one of them at the catch, or to the end without one.

    A video of the paper's time had 30 a second. Twelve dots trail the ball, 8 ms apart.
    """
    trace = log.truth
    caught = bool(np.isfinite(log.t_catch))
    last = log.t_catch if caught else float(trace.t[-1])
    model = build_scene(scene, arm.model).model
    bodies = [body_faces(model, body, arm, scene) for body in range(model.nbody)]
    out = []
    for step in range(-7, 5 if caught else 1):
        t = last + step / 30.0
        if trace.t[0] <= t <= trace.t[-1] + 1e-9:
            k = int(np.argmin(np.abs(trace.t - t)))
            trail = trace.r_o[max(k - 96, 0) : k : 8]
            png = png_of(painted(*placed(model, bodies, trace.qpos[k], trail), scene.floor))
            out.append(Picture(t=float(trace.t[k]), catch=caught and step == 0, png=png))
    return tuple(out)


def body_faces(model: mujoco.MjModel, body: int, arm: Arm, scene: Scene) -> Faces:
    """Return the faces of a body in its own frame."""
    corners, colours = [np.zeros((0, 3, 3))], [np.zeros((0, 3))]
    for mesh, rgb in body_meshes(model, body, arm, scene):
        # Sides of 12 cm at most: faces behind one another are told apart by their middles.
        corners.append(mesh.subdivide_to_size(0.12).triangles)
        colours.append(np.tile(np.array(rgb) / 255.0, (len(corners[-1]), 1)))
    return np.concatenate(corners), np.concatenate(colours)


def placed(model: mujoco.MjModel, bodies: list[Faces], qpos: Array, trail: Array) -> Faces:
    """Return all faces in the world.

    Args:
        model: The plant.
        bodies: Faces of its bodies.
        qpos: Its state, shape (nq,).
        trail: Earlier positions of the ball, drawn as dots [m], shape (k, 3).
    """
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    dot = sphere(0.011, corners=8).triangles
    corners = [f @ data.xmat[b].reshape(3, 3).T + data.xpos[b] for b, (f, _) in enumerate(bodies)]
    corners += [dot + at for at in trail]
    orange = np.tile(np.array(BALL) / 255.0, (len(trail) * len(dot), 1))
    return np.concatenate(corners), np.concatenate([*(rgb for _, rgb in bodies), orange])


def png_of(canvas: FigureCanvasAgg) -> str:
    """Return a picture as PNG in base64."""
    out = io.BytesIO()
    canvas.print_png(out, metadata=_MADE_BY)
    return base64.b64encode(out.getvalue()).decode("ascii")


def painted(
    corners: Array, colours: Array, floor: float, *, target: Sequence[float] = _TARGET,
    seen_from: tuple[float, float] = FROM_THE_SIDE,
) -> FigureCanvasAgg:  # fmt: skip
    """Return a picture of 340 x 262 pixels of faces above a floor; nearer faces are painted last.

    The camera is 3.6 m away, so near that the fingers show: Matplotlib's zoom and focal length.

    Args:
        corners: Corners of the faces [m], shape (k, 3, 3).
        colours: Their colours, shape (k, 3).
        floor: Height of the floor [m].
        target: The point that is looked at [m].
        seen_from: Elevation and azimuth from there to the camera [deg].
    """
    width, height = 3.4, 2.62  # [inch]
    figure = Figure(figsize=(width, height), dpi=100.0, facecolor=_SKY)
    canvas = FigureCanvasAgg(figure)
    square = (0.0, 0.5 - 0.5 * width / height, 1.0, width / height)  # higher than the picture
    axes: Any = figure.add_axes(
        square, projection="3d", proj_type="persp", focal_length=0.376, elev=seen_from[0],
        azim=seen_from[1], computed_zorder=False, facecolor="none",
    )  # fmt: skip
    axes.set_axis_off()
    axes.set(**{f"{k}lim": (at - 0.9, at + 0.9) for k, at in zip("xyz", target, strict=True)})
    axes.set_box_aspect((1, 1, 1), zoom=1.7)
    xs, ys = np.arange(*_X, 0.5), np.arange(*_Y, 0.5)
    lines = [[(x, y, floor) for y in _Y] for x in xs] + [[(x, y, floor) for x in _X] for y in ys]
    ground = [(x, y, floor) for x, y in zip((*_X, *_X[::-1]), np.repeat(_Y, 2), strict=True)]
    for drawing in (
        Poly3DCollection([ground], facecolors=_FLOOR, zorder=0),
        Line3DCollection(lines, colors=_LINES, linewidths=0.7, zorder=1),
        Poly3DCollection(corners, facecolors=colours, edgecolors=colours, linewidths=0.3,
                         shade=True, lightsource=LightSource(azdeg=145.0, altdeg=52.0), zorder=2),
    ):  # fmt: skip
        axes.add_collection3d(drawing, autolim=False)
    return canvas


#: Errors are shown this many times as long [1].
_STRETCH = 100.0
_BY_ERROR = "viridis_r"


def draw_coverage(
    path: Path, seen: dict[str, tuple[tuple[int, int], Array, Array]], cells: tuple[int, int]
) -> None:
    """Write a picture of the corners in each camera's image.

    Args:
        path: PNG file.
        seen: For each camera: size [px], corners, shape (n, 2), and seen minus predicted, (n, 2).
        cells: Cells across and down in which coverage is counted.
    """
    top = max(float(np.percentile(np.linalg.norm(r, axis=1), 98)) for _, _, r in seen.values())
    norm = Normalize(0.0, max(top, 1e-3))
    with matplotlib.rc_context(RC):
        figure = Figure(figsize=(4.9 * len(seen) + 0.9, 4.4), dpi=140, layout="constrained")
        canvas = FigureCanvasAgg(figure)
        panels = figure.subplots(1, len(seen), squeeze=False)[0]
        for axes, (name, (size, uv, r)) in zip(panels, seen.items(), strict=True):
            _draw_corners(axes, name, size, uv, r, norm, cells)
        bar = figure.colorbar(ScalarMappable(norm, _BY_ERROR), ax=list(panels), shrink=0.75,
                              pad=0.02)  # fmt: skip
        bar.set_label(f"reprojection error [px]; lines: {_STRETCH:g} times as long", color=INK)
        bar.outline.set_visible(False)
        write_atomically(path, lambda temporary: canvas.print_png(temporary, metadata=_MADE_BY))


def _draw_corners(
    axes: Axes, name: str, size: tuple[int, int], uv: Array, r: Array, norm: Normalize,
    cells: tuple[int, int],
) -> None:  # fmt: skip
    """Draw the corners of one camera; cells without any are shaded."""
    width, height = size
    edges = [np.linspace(-0.5, n - 0.5, k + 1) for n, k in zip(size, cells, strict=True)]
    count = np.histogram2d(uv[:, 0], uv[:, 1], bins=edges)[0]
    for i, j in zip(*np.nonzero(count == 0), strict=True):
        axes.axvspan(edges[0][i], edges[0][i + 1], 1.0 - (edges[1][j] + 0.5) / height,
                     1.0 - (edges[1][j + 1] + 0.5) / height, color="#f3d9d0", lw=0, zorder=0,
                     )  # fmt: skip
    error = np.linalg.norm(r, axis=1)
    axes.quiver(uv[:, 0], uv[:, 1], _STRETCH * r[:, 0], _STRETCH * r[:, 1], color=GREY,
                alpha=0.35, angles="xy", scale_units="xy", scale=1.0, width=0.0015, headwidth=1,
                headlength=0, zorder=1)  # fmt: skip
    axes.scatter(uv[:, 0], uv[:, 1], c=error, cmap=_BY_ERROR, norm=norm, s=5, lw=0, zorder=2)
    axes.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5), aspect="equal",
             xlabel="u [px]", ylabel="v [px]")  # fmt: skip
    for k, edge in enumerate(edges):
        (axes.set_xticks if k == 0 else axes.set_yticks)(np.rint(edge + 0.5))
    axes.set_title(f"{name}: rms {np.sqrt(np.mean(r**2)):.2f} px, corners in "
                   f"{int((count > 0).sum())} of {count.size} cells",
                   fontsize=9.5)  # fmt: skip
