"""Computed torque with feedback: the arm follows the desired joint motion.

tau = M(q) (ddq_d + K_d (dq_d - dq) + K_p (q_d - q)) + H(q, dq) dq + g(q), eq. (14) inverted: with
an exact model the error of each joint obeys e'' + 2 w e' + w^2 e = 0 with w = ``bandwidth``.
"""

from dataclasses import dataclass, replace
from typing import final

import numpy as np
from numpy.typing import NDArray

from mitt.control.envelope import bound_acceleration
from mitt.control.viability import Guard
from mitt.jit import kernel
from mitt.robot.arm import Arm
from mitt.robot.dynamics import inverse_dynamics
from mitt.robot.limits import bound_of, drive_asked, largest_share, saturate
from mitt.robot.shapes import Surroundings
from mitt.signals import ArmState, Array, Command
from mitt.views import view

#: Change of a torque that counts as meeting a limit [N m].
_TOUCH = 1e-9
#: Numbers that the tracking notes of each link: five of its own, the rest of its dynamics.
NOTES = 23
#: Rows of what a tick tells the arm: q, dq, ddq, tau, and the acceleration that tau brings.
ROWS = 5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tracked:
    """A command, and whether a torque limit was met on the way to it."""

    command: Command
    saturated: bool


@final
class Tracker:
    """Tracking controller of one arm, with the envelope before it.

    Encoder readings that are not finite are replaced by the last that were.
    """

    def __init__(self, arm: Arm, *, bandwidth: float, around: Surroundings | None = None) -> None:
        """Take the arm, the bandwidth w of the error [rad/s] and what stands around the arm."""
        self.arm, self.bandwidth = arm, bandwidth
        self.guard = Guard(arm, around or Surroundings())
        self._index = np.array(arm.model.active)
        self._notes = np.zeros((len(arm.model.links), NOTES))
        self._known = ArmState(t=0.0, q=arm.q_ready, dq=np.zeros(arm.n))

    def believed(self, state: ArmState) -> ArmState:
        """Return the encoder readings, or the last that were finite in their place."""
        if not (all_finite(state.q) and all_finite(state.dq)):
            return replace(self._known, t=state.t)
        self._known = state
        return state

    def step(self, state: ArmState, wanted: Array, *, hand: float) -> Tracked:
        """Return the command for one tick.

        Args:
            state: Encoders.
            wanted: q_d, dq_d, ddq_d [rad, rad/s, rad/s^2], shape (3, n).
            hand: Closing angle of the fingers [rad].
        """
        state = self.believed(state)
        told = np.zeros((ROWS, self.arm.n))
        told[:3] = wanted
        self.guard.step(told[:3])
        saturated = track(
            self.guard.bounds,
            self.bandwidth,
            self.arm.limits.packed,
            self.arm.bodies,
            self._index,
            state.q,
            state.dq,
            told,
            self._notes,
        )
        command = Command(t=state.t, told=told[:4], hand=hand)
        return Tracked(command=command, saturated=saturated)


@kernel
def track(
    bounds: Array,
    bandwidth: float,
    drives: Array,
    bodies: Array,
    index: NDArray[np.int64],
    q: Array,
    dq: Array,
    told: Array,
    notes: Array,
) -> bool:
    """Write the torques that follow a motion within every limit.

    Args:
        bounds: As of :func:`mitt.control.envelope.bounds_of`, shape (>= 4, n).
        bandwidth: Bandwidth w of the error [rad/s].
        drives: ``Limits.packed``, shape (2 N + 3, N).
        bodies: Table of :mod:`mitt.robot.dynamics`, shape (N, 31).
        index: Active joints among the links, shape (n,).
        q: Encoders [rad], shape (n,).
        dq: Encoders [rad/s], shape (n,).
        told: q, dq, ddq as the envelope let them pass; result: tau of the active joints in the
            fourth row; the fifth is scratch, shape (ROWS, n).
        notes: Scratch, shape (N, NOTES).

    Returns:
        Whether a torque limit was met.
    """
    links, n = len(bodies), len(index)
    asked, speed = view(notes, 0, (links,)), view(notes, links, (links,))
    kept, push = view(notes, 2 * links, (links,)), view(told, 4 * n, (n,))
    scratch = view(notes, 5 * links, (links, NOTES - 5))
    for k in range(n):
        lag, slow = told[0, k] - q[k], told[1, k] - dq[k]
        push[k] = told[2, k] + 2.0 * bandwidth * slow + bandwidth * bandwidth * lag
    bound_acceleration(bounds, q, dq, push)
    inverse_dynamics(bodies, q, dq, push, asked, scratch)
    speed[:] = 0.0
    for k in range(n):
        speed[index[k]] = dq[k]
    saturate(drives, asked, speed, kept)
    met = False
    for k in range(links):
        met |= abs(kept[k] - asked[k]) > _TOUCH
    if met:
        _give_way(bounds, drives, bodies, q, dq, told, notes)
    for k in range(n):
        told[3, k] = kept[index[k]]
    return met


@kernel
def _give_way(
    bounds: Array, drives: Array, bodies: Array, q: Array, dq: Array, told: Array, notes: Array
) -> None:
    """Cut the torques of all joints by one share, towards what the arm does by itself at most."""
    links, n = len(bodies), len(q)
    asked, speed = view(notes, 0, (links,)), view(notes, links, (links,))
    kept, given = view(notes, 2 * links, (links,)), view(notes, 3 * links, (links,))
    scratch, coast = view(notes, 5 * links, (links, NOTES - 5)), view(told, 3 * n, (n,))
    coast[:] = 0.0
    bound_acceleration(bounds, q, dq, coast)
    inverse_dynamics(bodies, q, dq, coast, given, scratch)
    if largest_share(drives, given, speed) <= 1.0:
        _cut(drives, given, asked, speed, kept)
        return
    level = view(notes, 4 * links, (links,))
    coast[:] = 0.0
    inverse_dynamics(bodies, q, dq, coast, level, scratch)
    if largest_share(drives, level, speed) > 1.0:
        level[:] = 0.0
    _cut(drives, level, given, speed, kept)


@kernel
def _cut(drives: Array, rest: Array, asked: Array, speed: Array, kept: Array) -> None:
    """Write torques within every limit that lead as far towards the wish as they can.

    Torques are cut along the line from those of coasting to those asked for, all joints by the
    same share: then each acceleration stays between coasting and the wish, which both respect the
    speed limits and the stops. Cutting joint by joint would let one joint's limit push another
    beyond its own. Where the torques cannot even keep coasting within the limits, the line leads
    there from constant speed, or, where those torques are beyond the limits too, from none at all.
    """
    share = _share(drives, rest, asked, speed)
    for k in range(len(asked)):
        asked[k] = rest[k] + share * (asked[k] - rest[k])
    saturate(drives, asked, speed, kept)


def all_finite(x: Array) -> bool:
    """Say whether every entry of a vector is a finite number."""
    for k in range(len(x)):  # noqa: SIM110 (compiled: a loop is the fast form)
        if not np.isfinite(x[k]):
            return False
    return True


@kernel
def largest_gap(a: Array, b: Array) -> float:
    """Return the largest difference of two vectors' entries."""
    gap = 0.0
    for k in range(len(a)):
        gap = max(gap, abs(a[k] - b[k]))
    return gap


@kernel
def _share(packed: Array, rest: Array, asked: Array, speed: Array) -> float:
    """Return the largest share of the way from ``rest`` to ``asked`` within every drive's peak."""
    n, share = len(rest), 1.0
    for m in range(n):
        start, way = 0.0, 0.0
        for k in range(n):
            start += packed[m, k] * rest[k]
            way += packed[m, k] * (asked[k] - rest[k])
        goal = start + way
        bound, _ = bound_of(packed, m, goal, drive_asked(packed, m, asked, speed)[1], 0.0)
        if abs(goal) > bound:
            edge = np.copysign(bound, goal)
            share = min(share, max((edge - start) / way, 0.0)) if way * goal > 0.0 else 0.0
    return share
