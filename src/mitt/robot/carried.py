"""Which link carries what: frames of a description file, and capsules about its shapes."""

import numpy as np
import pinocchio as pin

from mitt.errors import UnknownNameError
from mitt.robot.description import Capsule
from mitt.robot.fit import behind, capsules_about
from mitt.robot.stated import LINK, Stated
from mitt.signals import Array

#: Most capsules of one link; a link of more shapes gets one about all of them.
_MOST = 6


def frame_of(model: pin.Model, name: str) -> pin.Frame:
    """Return the frame of a name, the body where a joint is called the same."""
    frames = {frame.name: frame for frame in model.frames}
    if name not in frames:
        raise UnknownNameError("tip", name, links_of(model),
                               do="name the link or site of the palm (--tip)")  # fmt: skip
    return frames.get(name + LINK, frames[name])


def joints_to(model: pin.Model, tip: str) -> list[str]:
    """Return the joints that move a frame, from the base outwards.

    Raises:
        UnknownNameError: There is no such frame.
    """
    carriers = model.supports[frame_of(model, tip).parentJoint]
    return [model.names[k] for k in list(carriers)[1:]]


def links_of(model: pin.Model) -> tuple[str, ...]:
    """Return the names of all links and sites of a file, from the base outwards."""
    kinds = (pin.FrameType.BODY, pin.FrameType.OP_FRAME)
    named = (x.name.removesuffix(LINK) for x in model.frames if x.type in kinds)
    return tuple(x for x in named if x != "universe")


def carried_shapes(
    stated: Stated, model: pin.Model, tool: Array | None
) -> tuple[tuple[Capsule, ...], ...]:
    """Return the capsules of the base and of each link behind a joint, in their frames.

    Args:
        stated: What the file states.
        model: The arm, its joints one behind the other.
        tool: Tool plate of a hand that is mounted on the last link, shape (4, 4): what the file
            has beyond it, as a gripper, is taken to be unmounted. None without one.
    """
    parts: list[list[tuple[Array, float]]] = [[] for _ in range(model.njoints)]
    names = {frame.name for frame in model.frames}
    for shape in stated.shapes:
        if shape.frame not in names:
            continue
        frame = frame_of(model, shape.frame)
        T = frame.placement.homogeneous
        points = shape.points @ T[:3, :3].T + T[:3, 3]
        if frame.parentJoint == model.njoints - 1 and tool is not None:
            points = behind(points, (points - tool[:3, 3]) @ tool[:3, 2] - shape.radius)
        if len(points):
            parts[frame.parentJoint].append((points, shape.radius))
    fitted = [_fitted(x) for x in parts]
    if tool is not None:
        fitted[-1] = [x for x in (_behind(c, tool) for c in fitted[-1]) if x is not None]
    return tuple(tuple(x) for x in fitted)


def _fitted(parts: list[tuple[Array, float]]) -> list[Capsule]:
    """Return capsules about the shapes of one link."""
    found = [x for points, radius in parts for x in capsules_about(points, radius)]
    if len(found) <= _MOST:
        return found
    points = np.vstack([x for x, _ in parts])
    return list(capsules_about(points, max(radius for _, radius in parts)))


def _behind(capsule: Capsule, tool: Array) -> Capsule | None:
    """Return a capsule drawn in behind the tool plate; None where nothing is left of it.

    Its round end would reach into the hand, which has shapes of its own there. What is too thick to
    be drawn in, as a flange, becomes thinner instead.
    """
    p, normal, radius = tool[:3, 3], tool[:3, 2], capsule.radius
    ends = np.array([capsule.start, capsule.end])
    height = (ends - p) @ normal
    top, low = int(np.argmax(height)), int(np.argmin(height))
    if height[low] >= radius:
        return None
    room = -radius if height[low] <= -radius else max(height[low], 0.0)
    if height[top] > room:
        ends[top] += (height[top] - room) / (height[top] - height[low]) * (ends[low] - ends[top])
    if height[low] > -radius:
        radius = 0.5 * (radius - height[low])
        ends -= np.outer((ends - p) @ normal + radius, normal)
    start, end = (tuple(x.tolist()) for x in ends)
    return Capsule(start=start, end=end, radius=radius)
