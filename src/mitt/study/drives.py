"""What the drives of a trial gave, those that hold a still joint included.

A held joint stands still because its drives balance what the moving ones do to it. Where motors
share joints, as in the WAM's differential, the holding torque of joint 3 loads the motors of
joint 2: a torque limit is one of motors, and this is what they are held to.

| here    | meaning                                                  | unit | shape  |
|---------|----------------------------------------------------------|------|--------|
| ``tau`` | torques of the active joints, tick by tick               | N m  | (k, n) |
| ``all`` | torques of all links, held ones as the model reckons them| N m  | (k, N) |
"""

import numpy as np

from mitt.robot.arm import Arm
from mitt.signals import Array


def with_held(arm: Arm, q: Array, dq: Array, tau: Array) -> Array:
    """Return the torques of all links while the active ones are driven [N m], shape (k, N).

    Eq. (14) is linear in the acceleration: tau = bias + M ddq. The active rows give ddq, the
    others are what it takes to hold the rest. Contact with a ball is not in the model.

    Args:
        arm: The arm.
        q: Joint positions when the torques were given [rad], shape (k, n).
        dq: Joint speeds then [rad/s], shape (k, n).
        tau: Torques of the active joints [N m], shape (k, n).
    """
    index = np.array(arm.model.active)
    if len(index) == len(arm.model.links):
        return tau
    bias = _torques(arm, q, dq, np.zeros(arm.n))
    columns = [_torques(arm, q, dq, e) - bias for e in np.eye(arm.n)]
    M = np.stack(columns, axis=-1)
    ddq = np.linalg.solve(M[:, index], (tau - bias[:, index])[..., None])
    out = bias + (M @ ddq)[..., 0]
    out[:, index] = tau
    return out


def rms_ratio(arm: Arm, tau: Array) -> tuple[float, ...]:
    """Return root mean square torque over continuous torque, drive by drive, for (k, N) [N m]."""
    rms = np.sqrt(np.mean(arm.limits.drive_torque(tau) ** 2, axis=0))
    return tuple(float(x) for x in rms / arm.limits.tau_rms)


def _torques(arm: Arm, q: Array, dq: Array, ddq: Array) -> Array:
    """Return eq. (14) tick by tick with the same acceleration, shape (k, N)."""
    return arm.torques(np.stack([q, dq, np.broadcast_to(ddq, q.shape)], axis=1))
