"""Brakes of the joints in the plant: what holds the arm once its drives are off.

A brake is dry friction that sticks: a stiff spring holds the joint at the place where it came to
rest, and slips where its torque is not enough (the bristle of Dahl's friction model). So a joint
that is held does not creep: it gives way by the load over the spring's stiffness, once. Shorted
windings damp the motion besides; both together are bounded by the brake's torque, as the current
through the windings is bounded.

| row       | meaning                                                        | unit        |
|-----------|----------------------------------------------------------------|-------------|
| TORQUE    | largest torque                                                 | N m         |
| DELAY     | from the command until the brake acts                          | s           |
| STIFFNESS | of the spring that holds: as stiff as a step of 1 ms carries   | N m/rad     |
| DAMPING   | of spring and windings, no more than a step of 1 ms carries    | N m s/rad   |
| GIVEN     | how far the spring has given way                               | rad         |
"""

import numpy as np

from mitt.jit import kernel
from mitt.robot.arm import Arm
from mitt.robot.description import ArmModel, Brake
from mitt.robot.limits import Limits, joint_level
from mitt.signals import Array

TORQUE, DELAY, STIFFNESS, DAMPING, GIVEN = range(5)
ROWS = 5

#: Length of the longest simulation step [s], and the parts of its limit of stability that spring
#: and damper of all joints together may take.
_STEP, _SPRING, _DAMPER = 0.001, 0.3, 0.6
#: Poses over which the smallest inertia of a joint is looked for, and their seed.
_POSES, _SEED = 64, 1
#: Torque of a brake where neither the arm's description nor a limit set states one [N m].
_STRONG = 100.0


def brake_numbers(model: ArmModel, limits: Limits | None) -> Array:
    """Return the brakes of an arm's active joints at rest, shape (ROWS, n); see the module's table.

    Args:
        model: The arm with its hand.
        limits: Its limit set, for the torque of brakes that the description does not state.
    """
    many = np.full(len(model.links), _STRONG)
    arm = Arm(model, limits or joint_level("none", tau=many, speed=many))
    inertia, rows = _least_inertia(arm), np.zeros((ROWS, arm.n))
    brakes: tuple[Brake, ...] = arm.brakes
    rows[TORQUE], rows[DELAY] = [b.torque for b in brakes], [b.delay for b in brakes]
    rows[STIFFNESS] = _SPRING / arm.n * inertia / _STEP**2
    most = _DAMPER / arm.n * inertia / _STEP
    rows[DAMPING] = np.minimum(0.5 * most + [b.damping for b in brakes], most)
    return rows


def _least_inertia(arm: Arm) -> Array:
    """Return the smallest inertia of each joint in many poses, the others free, shape (n,)."""
    poses = np.random.default_rng(_SEED).uniform(arm.q_min, arm.q_max, (_POSES, arm.n))
    inverse = [np.diag(np.linalg.inv(arm.mass_matrix(q))) for q in poses]
    out: Array = 1.0 / np.max(inverse, axis=0)
    return out


@kernel
def hold(brakes: Array, since: float, qvel: Array, ctrl: Array, passive: Array, h: float) -> None:
    """Let the brakes that act by now hold their joints for a step; their drives give nothing.

    Args:
        brakes: As in the module's table, row by row, shape (ROWS * n,); springs are overwritten.
        since: Time since they were commanded to engage [s]; negative where they were not.
        qvel: Velocities of the plant, arm first.
        ctrl: Motor torques, overwritten, arm first.
        passive: Friction, which the brakes' torques are added to, arm first.
        h: Length of the step [s].
    """
    n = len(brakes) // ROWS
    for k in range(n):
        if since < 0.0 or since < brakes[DELAY * n + k] - 0.5 * h:
            continue
        most, stiff = brakes[TORQUE * n + k], brakes[STIFFNESS * n + k]
        given = brakes[GIVEN * n + k] + h * qvel[k]
        given = min(max(given, -most / stiff), most / stiff)
        torque = stiff * given + brakes[DAMPING * n + k] * qvel[k]
        brakes[GIVEN * n + k], ctrl[k] = given, 0.0
        passive[k] -= min(max(torque, -most), most)
