"""Pictures as PNG: the throw every 33 ms, fig. 12, and what a calibration has seen of its board.

The throw is drawn from the meshes of the replay.
"""

from collections.abc import Sequence
from pathlib import Path

import matplotlib
import mujoco
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from mitt.core.arm.arm import Arm
from mitt.core.signals import Array
from mitt.io.writing import write_atomically
from mitt.lab.report.page import Shot, Strip
from mitt.lab.report.painter import FROM_THE_SIDE, Faces, View, painted, png_of
from mitt.lab.report.scene_meshes import BALL, body_meshes, sphere
from mitt.lab.report.style import GREY, INK, RC
from mitt.lab.trials.log import TrialLog
from mitt.lab.world.build import build_scene
from mitt.lab.world.scene import Scene

_MADE_BY = {"Software": "mitt"}


def picture_strip(name: str, arm: Arm, scene: Scene, log: TrialLog) -> Strip:
    """Return pictures every 33 ms, one of them at the catch, or to the end without one.

    A video of the paper's time had 30 a second.
    """
    trace, last, caught = log.truth, _end(log), bool(np.isfinite(log.t_catch))
    times = [last + step / 30.0 for step in range(-7, 5 if caught else 1)]
    times = [t for t in times if trace.t[0] <= t <= trace.t[-1] + 1e-9]
    drawn = zip(times, pictures_of(arm, scene, log, times), strict=True)
    shots = [
        Shot(float(trace.t[np.argmin(np.abs(trace.t - t))]), caught and t == last, png)
        for t, png in drawn
    ]
    return Strip(name, shots)


def still(arm: Arm, scene: Scene, log: TrialLog, view: View) -> str:
    """Return the picture of a throw 50 ms before the catch, the first touch or the end.

    It is a PNG in base64.
    """
    touched = log.truth.t[log.truth.force > 0.0]
    end = float(touched[0]) if len(touched) and not np.isfinite(log.t_catch) else _end(log)
    return pictures_of(arm, scene, log, [end - 0.05], view)[0]


def _end(log: TrialLog) -> float:
    """Return the time of the catch, or of the end without one [s]."""
    return log.t_catch if np.isfinite(log.t_catch) else float(log.truth.t[-1])


def pictures_of(
    arm: Arm, scene: Scene, log: TrialLog, times: Sequence[float], view: View = FROM_THE_SIDE
) -> list[str]:
    """Return pictures of a throw at some times [s]: PNGs in base64; dots trail the ball by 8 ms."""
    model, trace = build_scene(scene, arm.model).model, log.truth
    bodies = [body_faces(model, body, arm, scene) for body in range(model.nbody)]
    out = []
    for t in times:
        k = int(np.argmin(np.abs(trace.t - t)))
        faces = placed_faces(model, bodies, trace.qpos[k], trace.r_o[max(k - 96, 0) : k : 8])
        out.append(png_of(painted(*faces, scene.floor, view=view)))
    return out


def body_faces(model: mujoco.MjModel, body: int, arm: Arm, scene: Scene) -> Faces:
    """Return the faces of a body in its own frame."""
    corners, colours = [np.zeros((0, 3, 3))], [np.zeros((0, 3))]
    for mesh, rgb in body_meshes(model, body, arm, scene):
        # Short sides: faces behind one another are told apart by their middles.
        corners.append(mesh.subdivide_to_size(0.15 if body == 0 else 0.045).triangles)
        colours.append(np.tile(np.array(rgb) / 255.0, (len(corners[-1]), 1)))
    return np.concatenate(corners), np.concatenate(colours)


def placed_faces(model: mujoco.MjModel, bodies: list[Faces], qpos: Array, trail: Array) -> Faces:
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
        bar = figure.colorbar(
            ScalarMappable(norm, _BY_ERROR), ax=list(panels), shrink=0.75, pad=0.02
        )
        bar.set_label(f"reprojection error [px]; lines: {_STRETCH:g} times as long", color=INK)
        bar.outline.set_visible(False)
        write_atomically(path, lambda temporary: canvas.print_png(temporary, metadata=_MADE_BY))


def _draw_corners(
    axes: Axes,
    name: str,
    size: tuple[int, int],
    uv: Array,
    r: Array,
    norm: Normalize,
    cells: tuple[int, int],
) -> None:
    """Draw the corners of one camera; cells without any are shaded."""
    width, height = size
    edges = [np.linspace(-0.5, n - 0.5, k + 1) for n, k in zip(size, cells, strict=True)]
    count = np.histogram2d(uv[:, 0], uv[:, 1], bins=edges)[0]
    for i, j in zip(*np.nonzero(count == 0), strict=True):
        axes.axvspan(
            edges[0][i],
            edges[0][i + 1],
            1.0 - (edges[1][j] + 0.5) / height,
            1.0 - (edges[1][j + 1] + 0.5) / height,
            color="#f3d9d0",
            lw=0,
            zorder=0,
        )
    error = np.linalg.norm(r, axis=1)
    axes.quiver(
        uv[:, 0],
        uv[:, 1],
        _STRETCH * r[:, 0],
        _STRETCH * r[:, 1],
        color=GREY,
        alpha=0.35,
        angles="xy",
        scale_units="xy",
        scale=1.0,
        width=0.0015,
        headwidth=1,
        headlength=0,
        zorder=1,
    )
    axes.scatter(uv[:, 0], uv[:, 1], c=error, cmap=_BY_ERROR, norm=norm, s=5, lw=0, zorder=2)
    axes.set(
        xlim=(-0.5, width - 0.5),
        ylim=(height - 0.5, -0.5),
        aspect="equal",
        xlabel="u [px]",
        ylabel="v [px]",
    )
    for k, edge in enumerate(edges):
        (axes.set_xticks if k == 0 else axes.set_yticks)(np.rint(edge + 0.5))
    axes.set_title(
        f"{name}: rms {np.sqrt(np.mean(r**2)):.2f} px, corners in "
        f"{int((count > 0).sum())} of {count.size} cells",
        fontsize=9.5,
    )
