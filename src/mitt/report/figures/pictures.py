"""Fig. 12: the throw as pictures every 33 ms, drawn by Matplotlib from the meshes of the replay.

Faces are projected onto the image and painted from far to near, each in one shade.
"""

import base64
import io
from dataclasses import dataclass

import mujoco
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure

from mitt.report.meshes import BALL, body_meshes, sphere
from mitt.robot.arm import Arm
from mitt.signals import Array
from mitt.trials.log import TrialLog
from mitt.world.build import build_plant
from mitt.world.scene import Scene

#: Pictures a video of the paper's time has [s], how many before and after the catch, and the
#: spacing of the dots that trail the ball [ticks], their number and radius [m].
_PERIOD, _BEFORE, _LATER, _DOTS, _TRAIL, _DOT = 1.0 / 30.0, 7, 4, 8, 12, 0.011
#: Size of a picture [px], pixels per inch, and its angle from top to bottom [deg].
_SIZE, _DPI, _FIELD_DEG = (340, 262), 100.0, 21.5
#: Camera and the point that it looks at [m]: from the side, a little from the thrower's end, so
#: near that the fingers show.
_EYE, _TARGET = np.array((1.0, -3.6, 0.45)), np.array((0.72, 0.0, 0.16))
#: Direction of the light, and how much of it comes from there and from everywhere.
_SUN, _DIRECT, _DIFFUSE, _GAMMA = np.array((0.35, -0.50, 0.79)), 0.78, 0.34, 2.2
#: Longest side of a face, so that faces behind one another can be told apart by their middles [m].
_LONGEST = 0.12
#: Colours of sky, floor and its lines; spacing and ends of the lines [m].
_SKY, _FLOOR, _LINES = "#e9edf1", "#eff1f4", "#dce1e7"
_SPACING, _X, _Y = 0.5, (-6.0, 8.0), (-2.5, 9.0)

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
    """Return pictures every 33 ms, one of them at the catch, or to the end without one."""
    trace = log.truth
    caught = bool(np.isfinite(log.t_catch))
    last = log.t_catch if caught else float(trace.t[-1])
    model = build_plant(scene, arm.model).model
    bodies = [body_faces(model, body, arm, scene) for body in range(model.nbody)]
    out = []
    for step in range(-_BEFORE, (_LATER if caught else 0) + 1):
        t = last + step * _PERIOD
        if trace.t[0] <= t <= trace.t[-1] + 1e-9:
            k = int(np.argmin(np.abs(trace.t - t)))
            trail = trace.r_o[max(k - _TRAIL * _DOTS, 0) : k : _DOTS]
            png = drawn(*placed(model, bodies, trace.qpos[k], trail), scene.floor)
            text = base64.b64encode(png).decode("ascii")
            out.append(Picture(t=float(trace.t[k]), catch=caught and step == 0, png=text))
    return tuple(out)


def body_faces(model: mujoco.MjModel, body: int, arm: Arm, scene: Scene) -> Faces:
    """Return the faces of a body in its own frame."""
    corners, colours = [np.zeros((0, 3, 3))], [np.zeros((0, 3))]
    for mesh, rgb in body_meshes(model, body, arm, scene):
        corners.append(mesh.subdivide_to_size(_LONGEST).triangles)
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
    dot = sphere(_DOT, corners=8).triangles
    corners = [f @ data.xmat[b].reshape(3, 3).T + data.xpos[b] for b, (f, _) in enumerate(bodies)]
    corners += [dot + at for at in trail]
    orange = np.tile(np.array(BALL) / 255.0, (len(trail) * len(dot), 1))
    return np.concatenate(corners), np.concatenate([*(rgb for _, rgb in bodies), orange])


def project(points: Array) -> Array:
    """Return where points [m], shape (..., 3), are in the image, shape (..., 2).

    The image's height is 2, x to the right and y upwards from its middle.
    """
    forward = (_TARGET - _EYE) / np.linalg.norm(_TARGET - _EYE)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    local = (points - _EYE) @ np.array([right, np.cross(right, forward), forward]).T
    at: Array = local[..., :2] / (local[..., 2:] * np.tan(0.5 * np.deg2rad(_FIELD_DEG)))
    return at


def shaded(corners: Array, colours: Array) -> tuple[Array, Array]:
    """Return the faces that the camera sees, from far to near, and their shades."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    middle = corners.mean(axis=1)
    seen = np.einsum("ij,ij->i", normal, _EYE - middle) > 0.0
    lit = np.maximum(normal @ (_SUN / np.linalg.norm(_SUN)), 0.0)
    light = _DIFFUSE * (0.62 + 0.38 * normal[:, 2]) + _DIRECT * lit
    shade = np.clip(colours**_GAMMA * light[:, None], 0.0, 1.0) ** (1.0 / _GAMMA)
    order = np.argsort(-np.linalg.norm(middle[seen] - _EYE, axis=1))
    return corners[seen][order], shade[seen][order]


def drawn(corners: Array, colours: Array, floor: float) -> bytes:
    """Return a picture of faces above a floor [m] as PNG."""
    width, height = _SIZE
    figure = Figure(figsize=(width / _DPI, height / _DPI), dpi=_DPI, facecolor=_SKY)
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(-width / height, width / height), ylim=(-1.0, 1.0))
    axes.set_axis_off()
    xs, ys = np.arange(*_X, _SPACING), np.arange(*_Y, _SPACING)
    ends = zip((*_X, *_X[::-1]), np.repeat(_Y, 2), strict=True)
    ground = np.array([[(x, y, floor) for x, y in ends]])
    lines = [[(x, y, floor) for y in _Y] for x in xs] + [[(x, y, floor) for x in _X] for y in ys]
    axes.add_collection(PolyCollection([*project(ground)], facecolors=_FLOOR))
    axes.add_collection(LineCollection([*project(np.array(lines))], colors=_LINES, linewidths=0.7,
                                       zorder=1))  # fmt: skip
    near, shades = shaded(corners, colours)
    axes.add_collection(PolyCollection([*project(near)], facecolors=shades, edgecolors=shades,
                                       linewidths=0.3, zorder=2))  # fmt: skip
    out = io.BytesIO()
    canvas.print_png(out, metadata={"Software": "mitt"})
    return out.getvalue()
