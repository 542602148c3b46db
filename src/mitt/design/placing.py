"""Poses before a thrower: turned to it, led to the balls, clear of the floor and of the arm."""

import numpy as np
from numpy.typing import NDArray

from mitt.design.balls import Balls
from mitt.design.poses import Poses, poses_of
from mitt.design.whole import movable
from mitt.robot.arm import Arm
from mitt.signals import Array

#: Height above the floor that joints and catch point keep [m], and distance of the catch point
#: from joints that are not next to it [m]; choices of this project.
_ABOVE, _APART = 0.12, 0.16


def facing(whole: Arm, q: Array, rng: np.random.Generator) -> Array:
    """Turn a first joint that stands upright so that the palm looks about towards +x."""
    upright = (whole.model.mount @ whole.model.links[0].placement)[:3, :3] @ (
        whole.model.links[0].axis
    )
    if whole.chain.prismatic[0] > 0.0 or abs(upright[2]) < 0.999 or not movable(whole)[0]:
        return q
    palm = poses_of(whole.model, q).palm
    wanted = rng.uniform(-0.4, 0.4, len(q)) - np.arctan2(palm[:, 1], palm[:, 0])
    turned = q[:, 0] + np.sign(upright[2]) * wanted
    turned = whole.q_min[0] + np.mod(turned - whole.q_min[0], 2.0 * np.pi)
    return np.column_stack([turned, q[:, 1:]])


def led(whole: Arm, q: Array, balls: Balls) -> Array:
    """Lead the catch point of each pose to the way of a ball through the middle of the aim."""
    for _ in range(6):
        poses = poses_of(whole.model, q)
        off = _offset(poses.tip, balls)
        J = np.swapaxes(poses.J, 1, 2)
        damped = J @ poses.J + 1e-3 * np.eye(3)
        step = np.einsum("bkc,bc->bk", poses.J, np.linalg.solve(damped, off[..., None])[..., 0])
        step = np.where(movable(whole), np.clip(step, -0.4, 0.4), 0.0)
        q = np.clip(q - step, whole.q_min, whole.q_max)
    return q


def _offset(tip: Array, balls: Balls) -> Array:
    """Return how far points lie from the way of the ball [m], (B, 3); 0.6 m of it either way."""
    assert balls.aim is not None
    way = balls.velocity() / balls.speed
    off = tip - balls.aim[0]
    along = np.clip(off @ way, -0.6, 0.3)
    out: Array = off - along[:, None] * way
    return out


def off_line(tip: Array, balls: Balls) -> Array:
    """Return the distance of points from the way of the ball [m], shape (B,)."""
    return np.asarray(np.linalg.norm(_offset(tip, balls), axis=1))


def clear(poses: Poses, floor: float) -> NDArray[np.bool_]:
    """Say where an arm keeps above the floor, and its catch point away from its own joints."""
    above = (poses.tip[:, 2] > floor + _ABOVE) & np.all(
        poses.at[:, 1:, 2] > floor + 0.5 * _ABOVE, axis=1
    )
    far = np.linalg.norm(poses.tip[:, None] - poses.at, axis=2)
    good: NDArray[np.bool_] = above & np.all(
        far[:, : max(1, poses.at.shape[1] - 3)] > _APART, axis=1
    )
    return good
