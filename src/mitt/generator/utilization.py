"""What a motion along a course asks of the arm: torques, shares of limits, cost; compiled.

| here        | meaning                                                     | shape         |
|-------------|-------------------------------------------------------------|---------------|
| ``bodies``  | table of :mod:`mitt.robot.dynamics`                         | (N, 31)       |
| ``drives``  | ``Limits.packed``                                           | (2 N + 3, N)  |
| ``scales``  | tau_max, dq_max, middle and half width of the ranges        | (4, n)        |
| ``shares``  | largest share of each drive's torque and speed, each range  | (3, N)        |
| ``at``      | instants of those shares                                    | (3, N)        |
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mitt.jit import kernel
from mitt.robot.arm import Arm
from mitt.robot.dynamics import dynamics_scratch, slopes_work
from mitt.robot.limits import torque_share
from mitt.signals import Array


class Plant(NamedTuple):
    """What the kernels know of an arm; see the module's table."""

    bodies: Array
    drives: Array
    scales: Array
    joints: NDArray[np.int64]


class Work(NamedTuple):
    """Buffers: motion of one instant, torques, slopes, drives' rows, the kernel's own."""

    motion: Array
    tau: Array
    slope: Array
    drive: Array
    speed: Array
    links: Array
    notes: Array


def plant_of(arm: Arm) -> Plant:
    """Return the arrays of an arm."""
    middle, half = 0.5 * (arm.q_max + arm.q_min), 0.5 * (arm.q_max - arm.q_min)
    scales = np.array([arm.tau_max, arm.dq_max, middle, half])
    return Plant(arm.bodies, arm.limits.packed, scales, np.array(arm.model.active))


def work_of(arm: Arm) -> Work:
    """Return the buffers for an arm."""
    n, links = arm.n, len(arm.model.links)
    return Work(
        motion=np.zeros((3, n)),
        tau=np.zeros(links),
        slope=np.zeros((3, links, n)),
        drive=np.zeros((3, n)),
        speed=np.zeros(n),
        links=slopes_work(links),
        notes=dynamics_scratch(links),
    )


@kernel
def assess(
    p: Plant, k: int, share: float, shares: Array, at: Array, w: Work
) -> tuple[float, float]:
    """Return cost and squared excess of the motion and torques in the buffers, at instant k."""
    n, links, cost, over = w.motion.shape[1], len(w.tau), 0.0, 0.0
    for j in range(n):
        cost += (w.tau[p.joints[j]] / p.scales[0, j]) ** 2
        cost += (w.motion[1, j] / p.scales[1, j]) ** 2
        x = abs(w.motion[0, j] - p.scales[2, j]) / p.scales[3, j]
        over += _note(shares, at, 2, p.joints[j], x, k, share)
    for d in range(links):
        tau, omega = asked_of(p, d, w.tau, w.motion[1])
        part = torque_share(p.drives, d, tau, omega)
        over += _note(shares, at, 0, d, part, k, share)
        part = abs(omega) / p.drives[2 * links + 2, d]
        over += _note(shares, at, 1, d, part, k, share)
    return cost, over


@kernel
def _note(
    shares: Array, at: Array, kind: int, k: int, part: float, instant: int, share: float
) -> float:
    """Keep the larger share and its instant; return the squared excess. NaN is infinitely much."""
    part = part if part == part else np.inf
    if part > shares[kind, k]:
        shares[kind, k] = part
        at[kind, k] = instant
    return max(part - share, 0.0) ** 2


@kernel
def asked_of(p: Plant, d: int, tau: Array, dq: Array) -> tuple[float, float]:
    """Return a drive's torque [N m] and speed [rad/s].

    Args:
        p: The arm.
        d: Index of the drive.
        tau: Torques of all joints [N m], shape (N,).
        dq: Speeds of the active ones [rad/s], shape (n,).
    """
    links, torque, omega = len(tau), 0.0, 0.0
    for e in range(links):
        torque += p.drives[d, e] * tau[e]
    for j in range(len(dq)):
        omega += p.drives[links + d, p.joints[j]] * dq[j]
    return torque, omega
