"""Many poses of one arm at once: forward kinematics, which pose is in the way, what touches.

The kernels of :mod:`mitt.core.arm.kinematics` place one pose; a search looks at a hundred thousand.

| here     | meaning                                                      | unit  | shape     |
|----------|--------------------------------------------------------------|-------|-----------|
| ``tip``  | catch point l(q)                                             | m     | (B, 3)    |
| ``palm`` | palm's normal                                                | 1     | (B, 3)    |
| ``J``    | dl/dq_k of each joint                                        | m/rad | (B, N, 3) |
| ``W``    | rotation axis of each joint, zero where it slides            | 1     | (B, N, 3) |
| ``at``   | origin of each joint                                         | m     | (B, N, 3) |
"""

from typing import NamedTuple, TypeAlias, final

import mujoco
import numpy as np
from numpy.typing import NDArray

from mitt.core.arm.arm import Arm
from mitt.core.arm.description import ArmModel
from mitt.core.signals import Array
from mitt.lab.design.driven_arm import movable
from mitt.lab.design.task import Balls
from mitt.lab.world.build import SceneModel, build_scene
from mitt.lab.world.scene import Scene

Which: TypeAlias = NDArray[np.int64] | NDArray[np.bool_]
"""Which rows of an array: their indices, or a mask."""


class Poses(NamedTuple):
    """Where an arm is in each of B poses; see the module's table."""

    tip: Array
    palm: Array
    J: Array
    W: Array
    at: Array

    def take(self, rows: Which) -> "Poses":
        """Return some of the poses, by index or by mask."""
        return Poses(*(x[rows] for x in self))


def poses_of(model: ArmModel, q: Array) -> Poses:
    """Return where an arm is in poses of all its links, held ones included [rad], shape (B, N)."""
    count = len(q)
    at, W, slides = np.zeros((3, count, len(model.links), 3))
    R = np.broadcast_to(model.mount[:3, :3], (count, 3, 3))
    p = np.broadcast_to(model.mount[:3, 3], (count, 3))
    for k, link in enumerate(model.links):
        p = p + R @ link.placement[:3, 3]
        R = R @ link.placement[:3, :3]
        axis = R @ link.axis
        if link.prismatic:
            p, slides[:, k] = p + q[:, k, None] * axis, axis
        else:
            W[:, k] = axis
            R = R @ _turns(link.axis, q[:, k])
        at[:, k] = p
    tip = p + R @ model.catch_point
    J = np.cross(W, tip[:, None] - at) + slides
    return Poses(tip=tip, palm=R @ model.tool[:3, 2], J=J, W=W, at=at)


def _turns(axis: Array, angle: Array) -> Array:
    """Return rotations about one unit axis (Rodrigues), shape (B, 3, 3)."""
    x, y, z = axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sin, cos = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    R: Array = np.eye(3) + sin * K + (1.0 - cos) * (K @ K)
    return R


#: Height above the floor that joints and catch point keep [m], and distance of the catch point
#: from joints that are not next to it [m]; choices of this project.
_ABOVE = 0.12
_APART = 0.16


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


#: Poses drawn to learn which shapes overlap in many, as those of a wrist do.
_POSES = 64

_Pair = tuple[int, int]


@final
class Touch:
    """Finds contacts of an arm with itself and the floor, for many poses of one arm.

    Two shapes that touch in 40 % of some poses of the arm do not count: capsules about the meshes
    of a wrist are wider than the wrist.

    Attributes:
        floor: Height of the floor [m].
    """

    def __init__(self, arm: Arm, scene: Scene) -> None:
        """Take the arm, with all its joints active, and the world."""
        self.floor = scene.floor
        self._built, self._data = _placed(arm, scene)
        rng = np.random.default_rng(34)
        seen = list[_Pair]()
        for q in rng.uniform(arm.q_min, arm.q_max, (_POSES, arm.n)):
            seen += _contacts(self._built, self._data, q)
        self._usual = {pair for pair in seen if seen.count(pair) > 0.4 * _POSES}

    def clear(self, q: Array) -> NDArray[np.bool_]:
        """Say of poses [rad], shape (B, N), whether nothing touches; shape (B,)."""
        return np.array(
            [_contacts(self._built, self._data, pose) <= self._usual for pose in q], dtype=bool
        )


def touching(arm: Arm, scene: Scene, poses: Array) -> bool:
    """Say whether arm or hand touch themselves or the floor in any of some poses.

    Poses are of the active joints [rad], shape (k, n).
    """
    built, data = _placed(arm, scene)
    return any(_contacts(built, data, q) for q in poses)


def _placed(arm: Arm, scene: Scene) -> tuple[SceneModel, mujoco.MjData]:
    """Return the world with the ball out of the way."""
    built = build_scene(scene, arm.model)
    data = mujoco.MjData(built.model)
    data.qpos[-7:-4] = (0.0, 0.0, 100.0)
    return built, data


def _contacts(built: SceneModel, data: mujoco.MjData, q: Array) -> set[_Pair]:
    """Return the pairs of shapes that touch in a pose."""
    data.qpos[: built.joints] = q
    mujoco.mj_kinematics(built.model, data)
    mujoco.mj_comPos(built.model, data)
    mujoco.mj_collision(built.model, data)
    return {(a, b) for a, b in data.contact.geom.tolist()} if data.ncon else set()
