"""What an arm can catch: rate against the speed of the throws, the region, and the arm itself."""

import base64
from collections import Counter
from collections.abc import Sequence

import numpy as np
from matplotlib.collections import PatchCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from mitt.design.region import Region
from mitt.design.speeds import AtSpeed
from mitt.report.figures.pictures import FROM_THE_SIDE, Picture, body_faces, drawn, placed
from mitt.report.figures.style import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PALE,
    PURPLE,
    YELLOW,
    Plot,
    plot,
)
from mitt.robot.arm import Arm
from mitt.signals import Array
from mitt.trials.statistics import wilson
from mitt.world.build import build_scene
from mitt.world.scene import Scene

#: Colours of the limits that bind most of the balls out of reach; all others are grey.
_LIMITS = (ORANGE, YELLOW, GREEN, PURPLE, GREY)
#: Where the region is seen from: elevation and azimuth [deg], from the thrower's side.
_OBLIQUE = (18.0, -52.0)


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


def region_plot(region: Region) -> Plot:
    """Draw where balls may pass, and the limit that binds elsewhere; a frame is what is thrown."""
    names = Counter(np.array(region.binding)[region.caught == 0.0].tolist()).most_common()
    colours = {name: colour for (name, _), colour in zip(names, _LIMITS, strict=False)}
    half = 0.5 * float(region.across[1] - region.across[0])
    cells = [
        Rectangle((x - half, z - half), 2.0 * half, 2.0 * half)
        for z in region.height
        for x in region.across
    ]
    faces = [
        to_rgba(BLUE, 0.25 + 0.65 * share) if share > 0.0
        else to_rgba(colours.get(name, PALE), 0.45)
        for row, limits in zip(region.caught.tolist(), region.binding, strict=True)
        for share, name in zip(row, limits, strict=True)
    ]  # fmt: skip

    def draw(figure: Figure) -> None:
        axes = figure.subplots()
        axes.add_collection(PatchCollection(cells, facecolors=faces, edgecolors="white", lw=0.5))
        (across, up), middle = region.box, float(np.mean(region.height))
        axes.add_patch(Rectangle((-across, middle - up), 2.0 * across, 2.0 * up, fill=False,
                                 edgecolor=INK, lw=1.4))  # fmt: skip
        shown = [Patch(color=to_rgba(BLUE, 0.9), label="all caught"),
                 Patch(color=to_rgba(BLUE, 0.45), label="some caught")]  # fmt: skip
        shown += [Patch(color=to_rgba(c, 0.45), label=name) for name, c in colours.items()]
        if len(names) > len(colours):
            shown.append(Patch(color=to_rgba(PALE, 0.45), label="other limits"))
        axes.legend(handles=shown, loc="center left", bbox_to_anchor=(1.02, 0.5), frameon=False)
        axes.set(xlabel="across the balls' way, off the middle [m]", ylabel="height [m]")
        axes.set_xlim(region.across[0] - half, region.across[-1] + half)
        axes.set_ylim(region.height[0] - half, region.height[-1] + half)
        axes.set_aspect("equal")
        axes.grid(visible=False)

    return plot("region", (9.0, 4.4), draw)


def region_picture(arm: Arm, scene: Scene, q: Array, region: Region) -> Picture:
    """Return a picture of an arm at a catch [rad], shape (n,), with the places of others."""
    return pose_picture(arm, scene, q, catch=True, marks=region.hand[::2], seen_from=_OBLIQUE)


def pose_picture(
    arm: Arm, scene: Scene, q: Array, *, catch: bool, marks: Array | None = None,
    seen_from: tuple[float, float] = FROM_THE_SIDE,
) -> Picture:  # fmt: skip
    """Return a picture of an arm in a pose of its active joints [rad], shape (n,).

    Args:
        arm: The arm.
        scene: The world.
        q: The pose.
        catch: Whether the ball is in the hand.
        marks: Points to mark [m], shape (k, 3).
        seen_from: Elevation and azimuth of the camera [deg].
    """
    model = build_scene(scene, arm.model).model
    bodies = [body_faces(model, body, arm, scene) for body in range(model.nbody)]
    qpos = model.qpos0.copy()
    for name, angle in zip(arm.names, q, strict=True):
        qpos[model.joint(name).qposadr[0]] = angle
    qpos[model.joint("ball").qposadr[0] :][:3] = arm.position(q) if catch else (9.0, 0.0, -0.5)
    reach = 0.5 * (arm.position(q) + arm.model.mount[:3, 3])
    corners, colours = placed(model, bodies, qpos, np.zeros((0, 3)) if marks is None else marks)
    near = np.linalg.norm(corners.mean(axis=1) - reach, axis=1) < 3.0
    png = drawn(corners[near], colours[near], scene.floor, target=tuple(reach.tolist()),
                seen_from=seen_from)  # fmt: skip
    return Picture(t=0.0, catch=catch, png=base64.b64encode(png).decode("ascii"))
