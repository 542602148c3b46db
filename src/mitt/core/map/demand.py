"""What a joint motion demands of the arm: cost of eq. (22), and shares of its limits.

| here            | paper                                         | unit | shape  |
|-----------------|-----------------------------------------------|------|--------|
| ``cost_torque`` | tau' K_tau tau, K_tau = 1/tau_max^2           | 1    | (K,)   |
| ``cost_speed``  | omega' K_omega omega, 1/omega_max^2           | 1    | (K,)   |
| ``torque``      | of each drive, :mod:`mitt.core.arm.limits`, (18) | 1    | (K, N) |
| ``speed``       | omega over its bound, (20)                    | 1    | (K, N) |
| ``range``       | joint angle off the middle, over half its range | 1  | (K, n) |
| ``excess``      | joint angle beyond its range                  | rad  | (K, n) |
| ``acceleration``| joint acceleration over its bound; 0 without  | 1    | (K, n) |
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mitt.core.arm.arm import Arm, trusted_deceleration
from mitt.core.arm.dynamics import dynamics_scratch, inverse_dynamics, slopes_work
from mitt.core.arm.limits import drive_asked, drives_of, torque_share
from mitt.core.fields import Range, Settings
from mitt.core.kernels import Record, kernel
from mitt.core.signals import Array

KINDS: Final = ("torque", "speed", "range", "acceleration")
"""Kinds of limits on a motion: the fields of :class:`Demand` that are shares of one."""

#: Time after the catch in which the hand closes and the arm still follows [s].
FOLLOWED = 0.012


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Tolerance(Settings):
    """Share of each limit at which a throw is refused.

    By default more than 1: the envelope keeps the limits whatever is asked, and asking for too
    much for a short time costs some tracking error, mostly long before the catch, not the ball. Of
    24 wide throws 7 were refused at 1.25 and 1, and the same arm caught them all. The rivals refuse
    at the same share.

    Attributes:
        torque: Of what a drive can give.
        speed: Of a drive's largest speed.
        acceleration: Of a joint's largest acceleration, where the limit set has one.
        strength: Share of its torque with which each joint, after the catch, shall come to rest
            before the end of its range; None where that is not looked at.
    """

    torque: Annotated[float, Range(1e-6, np.inf)] = 1.6
    speed: Annotated[float, Range(1e-6, np.inf)] = 1.6
    acceleration: Annotated[float, Range(1e-6, np.inf)] = 1.6
    strength: Annotated[float | None, Range(1e-6, 1e3)] = None


def uniform(share: float) -> Tolerance:
    """Return a tolerance of one share of each limit that a motion asks for."""
    return Tolerance(torque=share, speed=share, acceleration=share)


class Demand(NamedTuple):
    """Demand of a motion at K instants; see the module's table."""

    cost_torque: Array
    cost_speed: Array
    torque: Array
    speed: Array
    range: Array
    excess: Array
    acceleration: Array

    @property
    def shares(self) -> Array:
        """Shares of the limits of drives, and of accelerations, at all instants in one row.

        Ranges are not among them: what exceeds them counts by ``excess``.
        """
        return np.concatenate([x.ravel() for x in self.of_limits])

    @property
    def of_limits(self) -> tuple[Array, Array, Array]:
        """Shares of the limits of drives, and of accelerations; see :attr:`shares`."""
        return self.torque, self.speed, self.acceleration

    @property
    def cost(self) -> float:
        """Mean of the two costs over the instants, eq. (22)."""
        return float(np.mean(self.cost_torque + self.cost_speed))


class ArmNumbers(NamedTuple):
    """What kernels know of an arm and its limits."""

    bodies: Record  # of the type LINK of mitt.core.arm.dynamics, (N,)
    drives: Array  # Limits.packed, (2 N + 3, N)
    joints: NDArray[np.int64]  # active joints among the links, (n,)
    tau_max: Array  # (n,) [N m]
    dq_max: Array  # (n,) [rad/s]
    ddq_max: Array  # (n,) [rad/s^2], infinite without a bound
    ends: Array  # (2, n) of the ranges [rad]
    middle: Array  # (n,) of the ranges [rad]
    half: Array  # (n,) of their widths [rad]


class Work(NamedTuple):
    """Buffers of kernels that ask for torques."""

    motion: Array  # (3, n) q, dq, ddq of one instant
    tau: Array  # (N,) [N m]
    dq: Array  # (N,) [rad/s], 0 of joints that are held
    slope: Array  # (3, N, n) of tau in the motion
    links: Record  # of mitt.core.arm.dynamics.torque_slopes
    notes: Record  # of mitt.core.arm.dynamics.inverse_dynamics


@lru_cache(maxsize=8)
def arm_numbers(arm: Arm) -> ArmNumbers:
    """Return the arrays of an arm, not to be written to."""
    middle, half = 0.5 * (arm.q_max + arm.q_min), 0.5 * (arm.q_max - arm.q_min)
    most = arm.limits.acceleration
    return ArmNumbers(
        *arm.tables,
        arm.tau_max,
        arm.dq_max,
        np.full(arm.n, np.inf) if most is None else arm.active(most),
        np.array([arm.q_min, arm.q_max]),
        middle,
        half,
    )


def work_of(arm: Arm) -> Work:
    """Return the buffers for an arm."""
    n, links = arm.n, len(arm.model.links)
    return Work(
        motion=np.zeros((3, n)),
        tau=np.zeros(links),
        dq=np.zeros(links),
        slope=np.zeros((3, links, n)),
        links=slopes_work(links),
        notes=dynamics_scratch(links),
    )


def demand(arm: Arm, motion: Array) -> Demand:
    """Return the demand of q, dq, ddq at K instants, shape (K, 3, n).

    The torque is eq. (14) at q = q_d, which is eq. (16) with M~, H~ and g~ of eq. (17); the
    speed is eq. (19); their shares of the limits are those of eqs. (18) and (20).
    """
    out: Demand = room_of_demand(len(motion), arm.n, len(arm.bodies))
    rows = np.ascontiguousarray(motion, dtype=np.float64)
    reckon(arm_numbers(arm), rows, out, work_of(arm))
    return out


@kernel
def room_of_demand(count: int, n: int, links: int) -> Demand:
    """Return arrays for the demand of so many instants of an arm with n joints, N links."""
    return Demand(
        np.empty(count),
        np.empty(count),
        np.empty((count, links)),
        np.empty((count, links)),
        np.empty((count, n)),
        np.empty((count, n)),
        np.empty((count, n)),
    )


@kernel
def reckon(p: ArmNumbers, motion: Array, out: Demand, w: Work) -> None:
    """Write cost and shares of all limits of a motion, shape (K, 3, n)."""
    top = drives_of(p.drives).dq_max
    for t in range(len(motion)):
        q, dq, ddq = motion[t, 0], motion[t, 1], motion[t, 2]
        inverse_dynamics(p.bodies, q, dq, ddq, w.tau, w.notes)
        out.cost_torque[t], out.cost_speed[t] = 0.0, 0.0
        for k in range(len(p.joints)):
            w.dq[p.joints[k]] = dq[k]
            out.cost_torque[t] += (w.tau[p.joints[k]] / p.tau_max[k]) ** 2  # eq. (22)
            out.cost_speed[t] += (dq[k] / p.dq_max[k]) ** 2
            out.range[t, k] = abs(q[k] - p.middle[k]) / p.half[k]
            out.excess[t, k] = max(p.ends[0, k] - q[k], q[k] - p.ends[1, k], 0.0)
            out.acceleration[t, k] = abs(ddq[k]) / p.ddq_max[k]
        for m in range(len(w.tau)):
            drive, speed = drive_asked(p.drives, m, w.tau, w.dq)
            out.torque[t, m] = torque_share(p.drives, m, drive, speed)
            out.speed[t, m] = abs(speed) / top[m]


def shares_of(arm: Arm, motion: Array, tolerance: Tolerance) -> dict[str, float]:
    """Return the largest share of every limit of the active joints, in units of its tolerance.

    Args:
        arm: The arm.
        motion: q, dq, ddq at K instants, the last one at the catch, shape (K, 3, n).
        tolerance: Shares of torque, speed and acceleration that count as 1, and what the brake may
            use.

    Returns:
        ``torque:NAME``, ``speed:NAME``, ``range:NAME``, ``acceleration:NAME`` where the limit set
        bounds it and, where the tolerance asks for room to brake, ``brake:NAME`` for each joint.
    """
    demanded = demand(arm, motion)
    p = arm_numbers(arm)
    torque, speed = arm.by_joint(
        np.array([demanded.torque.max(axis=0), demanded.speed.max(axis=0)])
    )
    kinds = {
        "torque": torque / tolerance.torque,
        "speed": speed / tolerance.speed,
        "range": demanded.range.max(axis=0),
    }
    if arm.limits.acceleration is not None:
        kinds["acceleration"] = demanded.acceleration.max(axis=0) / tolerance.acceleration
    if tolerance.strength is not None:
        kinds["brake"] = np.abs(_rest(arm, motion[-1], tolerance.strength) - p.middle) / p.half
    return {
        f"{kind}:{name}": share
        for kind, values in kinds.items()
        for name, share in zip(arm.names, values.tolist(), strict=True)
    }


def _rest(arm: Arm, motion: Array, strength: float) -> Array:
    """Return where each joint, braking alone from q, dq at the catch, comes to rest [rad], (n,)."""
    rate = trusted_deceleration(arm, motion[0], strength)
    way: Array = motion[0] + motion[1] * (FOLLOWED + 0.5 * np.abs(motion[1]) / rate)
    return way
