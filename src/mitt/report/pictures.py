"""Fig. 12: the throw as pictures every 33 ms, drawn by Matplotlib from the meshes of the replay.

Faces are painted from far to near, each in one shade.
"""

import base64
import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LightSource
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

from mitt.arm.arm import Arm
from mitt.report.scene_meshes import BALL, body_meshes, sphere
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
    canvas.print_png(out, metadata={"Software": "mitt"})
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
