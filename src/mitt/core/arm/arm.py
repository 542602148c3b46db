"""An arm that can be asked: where is the catch point, and what torque does a motion take?

Kinematics and dynamics (eq. (14)) are our own kernels, built from one :class:`ArmModel`; tests hold
them to Pinocchio and MuJoCo. Also which arm it is, by content: what a learned map, or any other
file for one arm, depends on. A name does not tell an arm from the same arm with another tool or a
tenth of its torque, so a file keeps the numbers themselves. They are compared with a tolerance,
because two platforms may differ in the last digit of a rotation; a hash of rounded numbers would
not say which of them differ, and changes where a number lies at the edge between two roundings.
"""

import threading
from typing import NamedTuple, TypeAlias, final

import numpy as np
from numpy.typing import NDArray

from mitt.core import checks
from mitt.core.arm.description import ArmModel, JointBrake, joint_motion
from mitt.core.arm.dynamics import (
    bias_and_mass,
    bodies_of,
    dynamics_scratch,
    inverse_dynamics,
    slopes_along,
    slopes_work,
    torque_slopes,
    torques,
)
from mitt.core.arm.kinematics import chain_of, hand_along, motion_of, place
from mitt.core.arm.limits import Limits
from mitt.core.errors import InputError, ShapeError
from mitt.core.kernels import Record
from mitt.core.signals import Array


class Tables(NamedTuple):
    """An arm for kernels."""

    bodies: Record  # its links, of type LINK of mitt.core.arm.dynamics, (N,)
    drives: Array  # ``Limits.packed``, (2 N + 3, N)
    active: NDArray[np.int64]  # indices of the active joints among the links, (n,)


Identity: TypeAlias = dict[str, list[float | None]]
"""Numbers of an arm by what they are, all links in a row each; None where one is infinite."""

#: Share of the largest number of a part by which two numbers of it may differ.
_TOLERANCE = 1e-9


class _Scratch(threading.local):
    """What a call on an arm writes into before it copies its answer out; each thread has its own.

    Attributes:
        motion: Of the kinematic kernels.
        notes: Of the inverse dynamics.
        work: Of its derivatives.
    """

    def __init__(self, n: int, links: int) -> None:
        """Make the buffers of this thread."""
        self.motion = motion_of(n)
        self.notes, self.work = dynamics_scratch(links), slopes_work(links)


@final
class Arm:
    """An arm with its limit set.

    Its methods take finite numbers of the right shape and refuse others; they may be called from
    several threads. A copy is built from the same table.

    Attributes:
        model: The table it was built from.
        limits: Limit set over all links.
        n: Number of active joints.
        names: Their names, from the base outwards.
        q_min: Lower ends of their ranges [rad], shape (n,).
        q_max: Upper ends of their ranges [rad], shape (n,).
        q_ready: Pose in which they wait for a throw [rad], shape (n,).
        tau_max: Their largest joint torques, drives taken one by one [N m], shape (n,).
        dq_max: Their largest joint speeds, drives taken one by one [rad/s], shape (n,).
        encoder_step: Resolution of their encoders [rad], shape (n,).
        brakes: Their holding brakes.
        chain: Arrays of the kinematic kernels.
        bodies: Its links for the dynamic kernels, shape (N,).
        tables: All that kernels ask of it for torques.
    """

    def __init__(self, model: ArmModel, limits: Limits) -> None:
        """Build kinematics and dynamics from the table."""
        self.model = checks.instance("model", model, ArmModel)
        self.limits = checks.instance("limits", limits, Limits)
        if len(limits.dq_max) != len(model.links):
            raise ShapeError("limits", f"({len(model.links)},)", limits.dq_max.shape)
        complete = model.complete()
        self._index = np.array(model.active)
        self.n, self.names = len(self._index), model.names
        active = [model.links[k] for k in model.active]
        self.q_min = np.array([link.q_min for link in active])
        self.q_max = np.array([link.q_max for link in active])
        self.q_ready = model.q_ready
        self.tau_max, self.dq_max = self._joint_limits()
        self.encoder_step = np.array([link.encoder_step for link in active])
        self.brakes = tuple(
            link.brake or JointBrake(torque=float(tau))
            for link, tau in zip(active, self.tau_max, strict=True)
        )
        self.chain = chain_of(complete)
        self.bodies = bodies_of(complete)
        self._moved = limits.transmission[:, self._index] != 0.0
        self.tables = Tables(self.bodies, limits.packed, self._index)
        self._holding: dict[float, Arm] = {}
        self._plate = self._last_to_plate(complete)
        self._scratch = _Scratch(self.n, len(model.links))

    def __reduce__(self) -> tuple[type["Arm"], tuple[ArmModel, Limits]]:
        """Say how to build the same arm again, in this process or another."""
        return Arm, (self.model, self.limits)

    def __repr__(self) -> str:
        """Say which arm, which joints, which limits."""
        return f"Arm({self.model.name!r}, joints={self.names}, limits={self.limits.name!r})"

    def _last_to_plate(self, model: ArmModel) -> Array:
        """Return the rotation of the tool plate in the last active joint's frame, shape (3, 3)."""
        R: Array = np.eye(3)
        for link in model.links[model.active[-1] + 1 :]:
            R = R @ (link.placement @ joint_motion(link, link.held or 0.0))[:3, :3]
        return R @ model.tool[:3, :3]

    def _joint_limits(self) -> tuple[Array, Array]:
        """Return the torque and speed at which, one joint alone, the first drive is full."""
        alone = np.eye(len(self.model.links))[self._index]
        per_torque = np.abs(self.limits.drive_torque(alone)) / self.limits.tau_peak
        per_speed = np.abs(self.limits.drive_speed(alone)) / self.limits.dq_max
        return 1.0 / per_torque.max(axis=1), 1.0 / per_speed.max(axis=1)

    @property
    def force(self) -> float:
        """Largest force of a contact that hand and arm take [N]; infinite where none is stated."""
        hand = self.model.hand
        return min(self.limits.force, np.inf if hand is None else hand.force)

    def position(self, q: Array) -> Array:
        """Return the catch point l(q), eq. (2) [m], shape (3,), for q [rad], shape (n,)."""
        motion = self._scratch.motion
        place(self.chain, self._checked("q", q), motion)
        p: Array = motion.tip[0].copy()
        return p

    def jacobian(self, q: Array) -> Array:
        """Return J = dl/dq [m/rad], shape (3, n), for q [rad], shape (n,)."""
        motion = self._scratch.motion
        place(self.chain, self._checked("q", q), motion)
        J: Array = motion.J.T.copy()
        return J

    def orientation(self, q: Array) -> Array:
        """Return the rotation of the tool plate in the world, shape (3, 3)."""
        R = place(self.chain, self._checked("q", q), self._scratch.motion)
        return np.reshape(R, (3, 3)) @ self._plate

    def hand_along(self, motion: Array) -> tuple[Array, Array]:
        """Return the catch point's velocity [m/s] and the palm's normal, shapes (K, 3).

        Args:
            motion: q, dq, ddq [rad ...], shape (K, 3, n).
        """
        motion = checks.array("motion", motion, (None, 3, self.n), finite=True)
        velocity, palm = np.empty((len(motion), 3)), np.empty((len(motion), 3))
        normal = self._plate[:, 2].copy()
        hand_along(self.chain, normal, motion, velocity, palm, self._scratch.motion)
        return velocity, palm

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Return tau of eq. (14) for all N links, held ones included [N m], shape (N,)."""
        tau = np.empty(len(self.bodies))
        state = self._checked("q", q), self._checked("dq", dq), self._checked("ddq", ddq)
        inverse_dynamics(self.bodies, *state, tau, self._scratch.notes)
        return tau

    def torques(self, motion: Array) -> Array:
        """Return tau of eq. (14) for all N links at K instants, shape (K, N).

        Args:
            motion: q, dq, ddq [rad ...], shape (K, 3, n).
        """
        motion = checks.array("motion", motion, (None, 3, self.n), finite=True)
        tau = np.empty((len(motion), len(self.bodies)))
        torques(self.bodies, motion, tau, self._scratch.notes)
        return tau

    def inverse_dynamics(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Return tau of eq. (14) for the active joints [N m], shape (n,)."""
        tau: Array = self.torque(q, dq, ddq)[self._index]
        return tau

    def torque_derivatives(self, q: Array, dq: Array, ddq: Array) -> tuple[Array, Array, Array]:
        """Return d tau/dq, d tau/d dq and M over the active joints, shapes (N, n)."""
        state = self._checked("q", q), self._checked("dq", dq), self._checked("ddq", ddq)
        tau, slope = np.empty(len(self.bodies)), np.empty((3, len(self.bodies), self.n))
        torque_slopes(self.bodies, np.array(state), tau, slope, self._scratch.work)
        return slope[0], slope[1], slope[2]

    def torques_and_slopes(self, motion: Array) -> tuple[Array, Array]:
        """Return :meth:`torques`, (K, N), and d tau/dq, d tau/d dq and M, (K, 3, N, n).

        Args:
            motion: q, dq, ddq [rad ...], shape (K, 3, n).
        """
        motion = checks.array("motion", motion, (None, 3, self.n), finite=True)
        tau, links = np.empty((len(motion), len(self.bodies))), len(self.bodies)
        slope = np.empty((len(motion), 3, links, self.n))
        slopes_along(self.bodies, motion, tau, slope, self._scratch.work)
        return tau, slope

    def mass_matrix(self, q: Array) -> Array:
        """Return M(q) over the active joints [kg m^2], shape (n, n)."""
        still = np.zeros(self.n)
        motion = np.array([self._checked("q", q), still, still])
        tau, M = np.empty(len(self.bodies)), np.empty((len(self.bodies), self.n))
        bias_and_mass(self.bodies, motion, tau, M, self._scratch.work)
        own: Array = M[self._index]
        return own

    def all_joints(self, x: Array) -> Array:
        """Return active joint speeds or torques set among all N links, zero elsewhere, (N,)."""
        out = np.zeros(len(self.model.links))
        out[self._index] = self._checked("x", x)
        return out

    def active(self, x: Array) -> Array:
        """Return the active joints' entries, shape (..., n), of one for all links, (..., N)."""
        out: Array = checks.rows("x", x, len(self.model.links))[..., self._index]
        return out

    def by_joint(self, share: Array) -> Array:
        """Return each active joint's share of a limit, (..., n), from those of drives, (..., N).

        The largest of the drives that move the joint: both motors of a differential, so that what
        a held joint asks of them is counted.
        """
        share = checks.rows("share", share, len(self.model.links))
        out: Array = np.where(self._moved, share[..., None], 0.0).max(axis=-2)
        return out

    def holding(self, mass: float) -> "Arm":
        """Return the arm with a ball of some mass [kg] held at the catch point; built once."""
        mass = checks.number("mass", mass, finite=True)
        if mass < 0.0:
            raise InputError("mass", "at least 0 kg", mass)
        if mass not in self._holding:
            hand = self.model.hand
            at = np.array([0.0, 0.0, 0.0 if hand is None else hand.catch_offset])
            loaded = self.model.loaded(mass, at=at, inertia=np.zeros((3, 3)))
            self._holding[mass] = Arm(loaded, self.limits)
        return self._holding[mass]

    def _checked(self, name: str, x: Array) -> Array:
        """Return numbers of the active joints as kernels take them; refuse any others."""
        return checks.vector(name, x, self.n, finite=True)


def tool_speeds(arm: Arm, motion: Array) -> Array:
    """Return the catch point's speed [m/s], shape (K,), along q, dq, ddq, shape (K, 3, n)."""
    speeds: Array = np.linalg.norm(arm.hand_along(motion)[0], axis=1)
    return speeds


def trusted_deceleration(arm: Arm, q: Array, strength: float = 1.0) -> Array:
    """Return what each joint alone can brake with in a pose [rad/s^2], shape (n,).

    Args:
        arm: The arm.
        q: Pose of the active joints [rad], shape (n,).
        strength: Share of its torques that the arm has.
    """
    rate: Array = strength * arm.tau_max / np.diag(arm.mass_matrix(q))
    most = arm.limits.acceleration
    return rate if most is None else np.minimum(rate, arm.active(most))


def identity_of(arm: Arm) -> Identity:
    """Return the numbers of an arm that a map depends on, its hand included."""
    model, limits = arm.model.complete(), arm.limits
    links = model.links
    parts: dict[str, Array | list[float] | list[Array]] = {
        "kinematics": [link.placement[:3] for link in links],
        "axes": [link.axis for link in links],
        "sliding joints": [float(link.prismatic) for link in links],
        "active joints": [float(k) for k in model.active],
        "held angles": [0.0 if link.held is None else link.held for link in links],
        "mount": model.mount[:3],
        "tool frame": model.tool[:3],
        "catch point": model.catch_point,
        "ready pose": model.q_ready,
        "masses": [link.mass for link in links],
        "centres of mass": [link.com for link in links],
        "inertias": [link.inertia for link in links],
        "rotor inertias": [link.armature for link in links],
        "joint ranges": [np.array([link.q_min, link.q_max]) for link in links],
        **limits.in_words,
    }
    return {name: _plain(np.asarray(part, dtype=np.float64)) for name, part in parts.items()}


def difference(mine: Identity, other: Identity) -> str | None:
    """Return what tells two arms apart, in words; None where they are the same."""
    for name, numbers in mine.items():
        if len(other.get(name, ())) != len(numbers):  # older files have none for no numbers
            return f"its {name} are of another number"
        a, b = _numbers(numbers), _numbers(other[name])
        known = a[np.isfinite(a)]
        largest = float(np.abs(known).max()) if len(known) else 0.0
        same = np.isclose(b, a, rtol=0.0, atol=_TOLERANCE * largest)
        if not same.all():
            k = int(np.argmin(same))
            return f"its {name} differ ({b[k]:.6g}, here {a[k]:.6g})"
    return None


def _plain(part: Array) -> list[float | None]:
    """Return numbers as JSON has them."""
    return [float(x) if np.isfinite(x) else None for x in part.ravel()]


def _numbers(part: list[float | None]) -> Array:
    """Return the numbers that :func:`_plain` returned."""
    return np.array([np.inf if x is None else x for x in part], dtype=np.float64)
