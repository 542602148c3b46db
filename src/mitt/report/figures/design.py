"""What an arm can catch: rate against the speed of the throws, and the arm in two poses."""

import base64
from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from mitt.design.speeds import AtSpeed
from mitt.report.figures.pictures import Picture, body_faces, drawn, placed
from mitt.report.figures.style import BLUE, GREY, Plot, plot
from mitt.robot.arm import Arm
from mitt.signals import Array
from mitt.trials.statistics import wilson
from mitt.world.build import build_scene
from mitt.world.scene import Scene


def rate_by_speed(rows: Sequence[AtSpeed]) -> Plot:
    """Draw the share caught within every limit against the speed of the throws, and why not."""
    speed = np.array([row.speed_m_s for row in rows])
    rate = np.array([row.feasible / max(row.throws, 1) for row in rows])
    ends = np.array([wilson(row.feasible, max(row.throws, 1)) for row in rows])

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        axes.fill_between(speed, 100.0 * ends[:, 0], 100.0 * ends[:, 1], color=BLUE, alpha=0.15)
        axes.plot(speed, 100.0 * rate, "o-", color=BLUE)
        for row, share in zip(rows, rate, strict=True):
            axes.annotate(row.binding_limit or "", (row.speed_m_s, 100.0 * share), (0, 8),
                          textcoords="offset points", ha="center", color=GREY, fontsize=8,
                          )  # fmt: skip
        axes.set(xlabel="speed of the throws at release [m/s]", ylabel="caught within limits [%]")
        axes.set_ylim(-4.0, 116.0)
        axes.set_xlim(speed.min() - 0.6, speed.max() + 0.6)

    return plot("rate", (9.0, 3.4), draw)


def pose_picture(arm: Arm, scene: Scene, q: Array, *, catch: bool) -> Picture:
    """Return a picture of an arm in a pose of its active joints [rad], shape (n,)."""
    model = build_scene(scene, arm.model).model
    bodies = [body_faces(model, body, arm, scene) for body in range(model.nbody)]
    qpos = model.qpos0.copy()
    for name, angle in zip(arm.names, q, strict=True):
        qpos[model.joint(name).qposadr[0]] = angle
    qpos[model.joint("ball").qposadr[0] :][:3] = arm.position(q) if catch else (9.0, 0.0, -0.5)
    reach = 0.5 * (arm.position(q) + arm.model.mount[:3, 3])
    corners, colours = placed(model, bodies, qpos, np.zeros((0, 3)))
    near = np.linalg.norm(corners.mean(axis=1) - reach, axis=1) < 3.0
    png = drawn(corners[near], colours[near], scene.floor, target=tuple(reach.tolist()))
    return Picture(t=0.0, catch=catch, png=base64.b64encode(png).decode("ascii"))
