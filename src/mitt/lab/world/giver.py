"""A person who hands something over: holds it softly, and lets go once the tool has it.

Until the tool touches it, the thing is where the hand leads it. From then on the hand pulls it
towards its own way, as a spring and a damper: hands of people who sit are as stiff as 100 to
800 N/m, by posture and direction (F. Mussa-Ivaldi, N. Hogan and E. Bizzi, J. Neuroscience 5, 1985).
It lets go a reaction time after the tool has begun to hold: 0.15 s, as to a touch. Stiffness about
the hand's axes is a choice of this project.
"""

from typing import final

import mujoco
import numpy as np

from mitt.core.signals import TICK, Array
from mitt.lab.world.targets import InHand

#: Stiffness of a hand [N/m], and about its axes [N m/rad].
STIFF = 300.0
TURNS = 0.6
#: From the first hold of the tool until the hand lets go [s].
REACTION = 0.15
#: Highest angular frequency of hand and thing [rad/s]: what steps of a tick carry.
_FASTEST = 150.0


@final
class Giver:
    """The person of one trial.

    Attributes:
        path: How the hand moves.
        force: Largest force on the hand since the tool touched the thing, beyond its weight [N].
        lets_go: When the hand lets go [s]; infinite as long as the tool does not hold.
    """

    def __init__(self, path: InHand, mass: float, inertia: float) -> None:
        """Hold a thing of some mass [kg] and inertia [kg m^2]."""
        self.path, self.force, self.lets_go = path, 0.0, np.inf
        stiff, turns = min(STIFF, mass * _FASTEST**2), min(TURNS, inertia * _FASTEST**2)
        self._stiff, self._damps = (
            (stiff, turns),
            (2.0 * np.sqrt(stiff * mass), 2.0 * np.sqrt(turns * inertia)),
        )
        self._mass, self._held = mass, np.zeros(4)
        mujoco.mju_mat2Quat(self._held, np.ascontiguousarray(path.orientation).ravel())

    @property
    def quaternion(self) -> Array:
        """How the thing is held, shape (4,)."""
        return self._held.copy()

    def pull(self, t: float, qpos: Array, qvel: Array, weight: float, *, held: bool) -> Array:
        """Return force and torque of the hand on the thing [N, N m], shape (6,); once a tick.

        Args:
            t: Time [s].
            qpos: Position and quaternion of the thing [m], shape (7,).
            qvel: Its velocity, and its angular velocity in its own axes [m/s, rad/s], shape (6,).
            weight: Its weight, which the hand carries besides [N].
            held: Whether the tool holds it now.
        """
        if held:
            self.lets_go = min(self.lets_go, t + REACTION)
        if t >= self.lets_go:
            return np.zeros(6)
        (r, dr), (_, ahead) = self.path.at(t), self.path.at(t + TICK)
        force = self._stiff[0] * (r - qpos[:3]) + self._damps[0] * (dr - qvel[:3])
        force += self._mass * (ahead - dr) / TICK
        self.force = max(self.force, float(np.linalg.norm(force)))
        turn, own = np.zeros(3), np.zeros(3)
        mujoco.mju_subQuat(turn, self._held, qpos[3:])  # in the axes of the thing
        own[:] = self._stiff[1] * turn - self._damps[1] * qvel[3:]
        mujoco.mju_rotVecQuat(turn, own, qpos[3:])
        force[2] += weight
        return np.array([*force, *turn])
