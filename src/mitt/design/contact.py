"""Whether an arm touches itself, its hand or the floor, in the simulated world's own shapes."""

from typing import final

import mujoco
import numpy as np
from numpy.typing import NDArray

from mitt.robot.arm import Arm
from mitt.signals import Array
from mitt.world.build import SceneModel, build_scene
from mitt.world.scene import Scene

#: Poses drawn to learn which shapes overlap in many, as those of a wrist do, their seed, and the
#: share that counts.
_POSES, _SEED, _USUAL = 64, 34, 0.4
#: Height at which the ball is out of the way [m].
_AWAY = 100.0

_Pair = tuple[int, int]


@final
class Touch:
    """Finds contacts of an arm with itself and the floor, for many poses of one arm.

    Two shapes that touch in many poses of the arm do not count: capsules about the meshes of a
    wrist are wider than the wrist.

    Attributes:
        floor: Height of the floor [m].
    """

    def __init__(self, arm: Arm, scene: Scene) -> None:
        """Take the arm, with all its joints active, and the world."""
        self.floor = scene.floor
        self._built, self._data = _placed(arm, scene)
        rng = np.random.default_rng(_SEED)
        seen = list[_Pair]()
        for q in rng.uniform(arm.q_min, arm.q_max, (_POSES, arm.n)):
            seen += _contacts(self._built, self._data, q)
        self._usual = {pair for pair in seen if seen.count(pair) > _USUAL * _POSES}

    def clear(self, q: Array) -> NDArray[np.bool_]:
        """Say of poses [rad], shape (B, N), whether nothing touches; shape (B,)."""
        return np.array(
            [_contacts(self._built, self._data, pose) <= self._usual for pose in q], dtype=bool
        )


def touching(arm: Arm, scene: Scene, poses: Array) -> bool:
    """Say whether arm or hand touch themselves or the floor in any of some poses.

    Args:
        arm: The arm.
        scene: The world.
        poses: Poses of the active joints [rad], shape (k, n).
    """
    built, data = _placed(arm, scene)
    return any(_contacts(built, data, q) for q in poses)


def _placed(arm: Arm, scene: Scene) -> tuple[SceneModel, mujoco.MjData]:
    """Return the world with the ball out of the way."""
    built = build_scene(scene, arm.model)
    data = mujoco.MjData(built.model)
    data.qpos[-7:-4] = (0.0, 0.0, _AWAY)
    return built, data


def _contacts(built: SceneModel, data: mujoco.MjData, q: Array) -> set[_Pair]:
    """Return the pairs of shapes that touch in a pose."""
    data.qpos[: built.joints] = q
    mujoco.mj_kinematics(built.model, data)
    mujoco.mj_comPos(built.model, data)
    mujoco.mj_collision(built.model, data)
    return {(a, b) for a, b in data.contact.geom.tolist()} if data.ncon else set()
