"""What the drives allow: named sets of torque and speed limits.

Every set is a linear transmission from joints to drives and limits on the drives. For joint-level
sets the transmission is the identity; for motor-level ones it holds the gear ratios and the
differential. A drive's torque is bounded by a peak and, when it drives rather than brakes, by
the line from its stall torque at rest to zero at its no-load speed.

How much of a drive is asked for is the larger of its share of the peak and, where it drives, of
its voltage: tau/tau_stall + omega/omega_0. Like the torque over its bound this is 1 at the limit,
but it is linear, and it says how far beyond the limit a motion is: near the no-load speed, where
the bound vanishes, torque over bound is endless for a motion that a volt more would allow.

Vendors state bounds of joints; such a set is fitted to an arm by the names of its joints.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np
from numba.extending import register_jitable

from mitt.core import checks
from mitt.core.errors import InputError, ModelError, ShapeError
from mitt.core.fields import brief
from mitt.core.kernels import kernel, view
from mitt.core.signals import Array

LEAST: Final = 1e-3
"""Share of its stall torque that counts as left to a drive beyond its no-load speed, where it is
divided by. Torques themselves are held to the bound without it."""

KINDS = ("lower", "upper", "speed", "acceleration", "jerk", "torque", "torque_rate")
"""What a set may bound: ends of the range [rad], then the largest rad/s, rad/s^2, rad/s^3, N m and
N m/s (of a sliding joint m and N in the place of rad and N m)."""

IN_WORDS: Final = {
    "transmission": "transmission",
    "tau_peak": "peak torques",
    "tau_stall": "stall torques",
    "tau_rms": "continuous torques",
    "dq_max": "joint speeds",
    "acceleration": "accelerations",
    "jerk": "jerks",
    "torque_rate": "torque rates",
}
"""What the transmission and the bounds of a limit set are called, by their fields."""

HELD_BACK: Final = ("tau_peak", "tau_stall")
"""Bounds of which a share is left to drives that lag behind their commands."""

#: Names of joints that tell nothing of the arm.
_BARE = re.compile(r"(actuator|joint|jnt|axis|j|a|q)?[ _-]*\d*", re.IGNORECASE)
#: Share of a file's figure up to which a set's is the same but for rounding.
_ROUNDED = 1.002


@dataclass(frozen=True, kw_only=True, eq=False)
class Limits:
    """A limit set over all N joints of a chain, held ones included.

    Attributes:
        name: Name of the set.
        transmission: Drive speed per joint speed, shape (N, N).
        tau_peak: Largest torque of each drive [N m], shape (N,).
        tau_stall: Torque at rest of the torque-speed line [N m], shape (N,); infinite without one.
        dq_max: Largest (no-load) speed of each drive [rad/s], shape (N,).
        tau_rms: Continuous torque, as root mean square over a trial [N m], shape (N,).
        acceleration: Largest acceleration of each joint [rad/s^2], shape (N,); None where the set
            has none. In this and the next two a joint without a bound has an infinite one.
        jerk: Largest jerk of each joint [rad/s^3], shape (N,); None where the set has none.
        torque_rate: Largest rate of each joint's torque [N m/s], shape (N,); None where the set
            has none.
        force: Largest force of a single contact at the hand that the arm takes [N]; infinite where
            the set says nothing of it.
    """

    name: str
    transmission: Array
    tau_peak: Array
    tau_stall: Array
    dq_max: Array
    tau_rms: Array
    acceleration: Array | None = None
    jerk: Array | None = None
    torque_rate: Array | None = None
    force: float = np.inf

    __repr__ = brief

    def __post_init__(self) -> None:
        """Hold the arrays to the number of drives, and their bounds to numbers above 0.

        Raises:
            ShapeError: An array has another shape.
            InputError: A bound is none.
        """
        transmission = checks.array("transmission", self.transmission, (None, None), finite=True)
        size = len(transmission)
        kept = {"transmission": checks.array("transmission", transmission, (size, size))}
        bounds = {name: vars(self)[name] for name in IN_WORDS if name != "transmission"}
        kept |= {k: checks.vector(k, x, size) for k, x in bounds.items() if x is not None}
        for name, value in kept.items():
            if name != "transmission" and not np.all(value > 0.0):  # they stand in denominators
                raise InputError(f"limits {name}", "numbers above 0", value.tolist())
            object.__setattr__(self, name, value)
        if not checks.number("limits force", self.force) > 0.0:
            raise InputError("limits force", "a number above 0", self.force)

    def __getstate__(self) -> dict[str, object]:
        """Return the fields; what follows from them is worked out anew."""
        return {x.name: vars(self)[x.name] for x in fields(self)}

    @cached_property
    def to_drive(self) -> Array:
        """Drive torque per joint torque, shape (N, N): the inverse transpose of transmission."""
        return np.asarray(np.linalg.inv(self.transmission.T), np.float64)

    @cached_property
    def packed(self) -> Array:
        """All that kernels ask of the drives, as :func:`drives_of` reads it, (2 N + 3, N)."""
        bounds = np.array([self.tau_peak, self.tau_stall, self.dq_max])
        return np.ascontiguousarray(np.concatenate([self.to_drive, self.transmission, bounds]))

    @cached_property
    def no_load(self) -> bool:
        """Whether the torque of a drive falls off towards its no-load speed."""
        return bool(np.all(np.isfinite(self.tau_stall)))

    @property
    def in_words(self) -> dict[str, Array]:
        """What tells it from another set, by what it is called; no numbers where it has none."""
        given = {words: vars(self)[name] for name, words in IN_WORDS.items()}
        return {words: np.zeros(0) if x is None else x for words, x in given.items()}

    @property
    def smooth(self) -> bool:
        """Whether acceleration, jerk or torque rate is bounded."""
        return any(x is not None for x in (self.acceleration, self.jerk, self.torque_rate))

    def drive_torque(self, tau: Array) -> Array:
        """Return drive torques [N m] for joint torques [N m], shapes (..., N)."""
        out: Array = self._rows("tau", tau) @ self.to_drive.T
        return out

    def drive_speed(self, dq: Array) -> Array:
        """Return drive speeds [rad/s] for joint speeds [rad/s], shapes (..., N)."""
        out: Array = self._rows("dq", dq) @ self.transmission.T
        return out

    def torque_bound(self, tau_drive: Array, dq_drive: Array) -> Array:
        """Return the bound on the size of each drive torque in its direction [N m].

        Args:
            tau_drive: Drive torques [N m], shape (..., N).
            dq_drive: Drive speeds [rad/s], of the same shape.
        """
        tau_drive, dq_drive = self._rows("tau_drive", tau_drive), self._rows("dq_drive", dq_drive)
        if tau_drive.shape != dq_drive.shape:
            raise ShapeError("dq_drive", str(tau_drive.shape), dq_drive.shape)
        out = np.asarray(np.broadcast_to(self.tau_peak, tau_drive.shape), np.float64)
        if self.no_load:
            line = self.tau_stall * np.maximum(1.0 - np.abs(dq_drive) / self.dq_max, 0.0)
            driving = tau_drive * dq_drive > 0.0
            out = np.asarray(np.where(driving, np.minimum(self.tau_peak, line), out), np.float64)
        return out

    def torque_ratio(self, tau: Array, dq: Array) -> Array:
        """Return how much of each drive is asked for, shape (..., N); 1 is the limit.

        Args:
            tau: Joint torques [N m], shape (..., N).
            dq: Joint speeds [rad/s], of the same shape.
        """
        drive, speed = self.drive_torque(tau), self.drive_speed(dq)
        out: Array = np.abs(drive) / self.tau_peak
        if self.no_load:
            voltage = np.abs(drive) / self.tau_stall + np.abs(speed) / self.dq_max
            out = np.where(drive * speed > 0.0, np.maximum(out, voltage), out)
        return out

    def saturate(self, tau: Array, dq: Array) -> Array:
        """Return joint torques within every drive's bound [N m], shape (N,)."""
        out = np.empty(len(self.dq_max))
        tau, dq = (checks.vector(*x, len(out)) for x in (("tau", tau), ("dq", dq)))
        saturate(self.packed, tau, dq, out)
        return out

    def _rows(self, name: str, x: Array) -> Array:
        """Return numbers of all N joints or drives, shape (..., N); refuse any other shape."""
        return checks.rows(name, x, len(self.dq_max))


def with_reserve(limits: Limits, share: float) -> Limits:
    """Return a limit set of whose drives a share is not commanded (:data:`HELD_BACK`)."""
    given = {name: vars(limits)[name] for name in HELD_BACK}
    return replace(limits, **{k: (1.0 - share) * x for k, x in given.items() if x is not None})


def slowed(limits: Limits, scale: float) -> Limits:
    """Return a limit set with a share of its speeds."""
    if scale == 1.0:
        return limits
    return replace(limits, name=f"{limits.name} x{scale:g}", dq_max=scale * limits.dq_max)


class DriveNumbers(NamedTuple):
    """What kernels know of the drives: views of ``Limits.packed``, which count no references.

    Arrays of their own cost each kernel that takes them 30 ns, half as much again as
    :func:`largest_share` takes.
    """

    to_drive: Array  # (N, N) drive torque per joint torque
    transmission: Array  # (N, N) drive speed per joint speed
    tau_peak: Array  # (N,) [N m]
    tau_stall: Array  # (N,) [N m]
    dq_max: Array  # (N,) [rad/s]


@register_jitable
def drives_of(packed: Array) -> DriveNumbers:
    """Return the drives whose arrays are views of ``Limits.packed``."""
    n = packed.shape[1]
    square = n * n
    return DriveNumbers(
        view(packed, 0, (n, n)),
        view(packed, square, (n, n)),
        view(packed, 2 * square, (n,)),
        view(packed, 2 * square + n, (n,)),
        view(packed, 2 * square + 2 * n, (n,)),
    )


@kernel
def bound_of(packed: Array, m: int, drive: float, speed: float, least: float) -> float:
    """Return the bound on the size of a drive's torque [N m].

    Args:
        packed: ``Limits.packed``.
        m: Index of the drive.
        drive: Its torque, of which only the direction counts [N m].
        speed: Its speed [rad/s].
        least: Share of the stall torque that is always left: 0 where a torque is held to its
            bound, ``LEAST`` where it is divided by.
    """
    d = drives_of(packed)
    bound, stall = d.tau_peak[m], d.tau_stall[m]
    if drive * speed > 0.0 and np.isfinite(stall):
        bound = min(bound, stall * max(1.0 - abs(speed) / d.dq_max[m], least))
    return float(bound)


@kernel
def torque_share(packed: Array, m: int, drive: float, speed: float) -> float:
    """Return how much of a drive is asked for, eq. (18) and the module; 1 is the limit.

    Args:
        packed: ``Limits.packed``.
        m: Index of the drive.
        drive: Its torque [N m].
        speed: Its speed [rad/s].
    """
    d = drives_of(packed)
    peak, voltage = abs(drive) / d.tau_peak[m], 0.0
    if drive * speed > 0.0 and np.isfinite(d.tau_stall[m]):
        voltage = abs(drive) / d.tau_stall[m] + abs(speed) / d.dq_max[m]
    return float(max(peak, voltage))


@kernel
def drive_asked(packed: Array, m: int, tau: Array, dq: Array) -> tuple[float, float]:
    """Return a drive's torque [N m] and speed [rad/s] for those of all joints, shapes (N,)."""
    d, drive, speed = drives_of(packed), 0.0, 0.0
    for k in range(len(tau)):
        drive += d.to_drive[m, k] * tau[k]
        speed += d.transmission[m, k] * dq[k]
    return drive, speed


@kernel
def largest_share(packed: Array, tau: Array, dq: Array) -> float:
    """Return how much of the drive that is asked most is asked for; 1 is the limit.

    Args:
        packed: ``Limits.packed``.
        tau: Joint torques asked for [N m], shape (N,).
        dq: Joint speeds [rad/s], shape (N,).
    """
    n, largest = len(tau), 0.0
    for m in range(n):
        drive, speed = drive_asked(packed, m, tau, dq)
        largest = max(largest, torque_share(packed, m, drive, speed))
    return largest


@kernel
def saturate(packed: Array, tau: Array, dq: Array, out: Array) -> None:
    """Write joint torques within every drive's bound [N m], shape (N,).

    Args:
        packed: ``Limits.packed``.
        tau: Joint torques asked for [N m], shape (N,).
        dq: Joint speeds [rad/s], shape (N,).
        out: Result, shape (N,).
    """
    n, d = len(tau), drives_of(packed)
    out[:] = 0.0
    for m in range(n):
        drive, speed = drive_asked(packed, m, tau, dq)
        bound = bound_of(packed, m, drive, speed, 0.0)
        drive = min(max(drive, -bound), bound)
        for k in range(n):
            out[k] += drive * d.transmission[m, k]


def joint_level(
    name: str,
    *,
    tau: Array,
    speed: Array,
    acceleration: Array | None = None,
    jerk: Array | None = None,
    torque_rate: Array | None = None,
) -> Limits:
    """Return a set whose drives are the joints themselves.

    Args:
        name: Name of the set.
        tau: Largest joint torques [N m], shape (N,).
        speed: Largest joint speeds [rad/s], shape (N,).
        acceleration: Largest accelerations [rad/s^2], shape (N,), if the set has them.
        jerk: Largest jerks [rad/s^3], shape (N,), likewise.
        torque_rate: Largest torque rates [N m/s], shape (N,), likewise.
    """
    endless = np.full(len(tau), np.inf)
    return Limits(
        name=name,
        transmission=np.eye(len(tau)),
        tau_peak=tau,
        tau_stall=endless,
        dq_max=speed,
        tau_rms=endless,
        acceleration=acceleration,
        jerk=jerk,
        torque_rate=torque_rate,
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LimitSet:
    """Bounds of joints; what the source does not say is left out.

    Attributes:
        name: Name of the set.
        joints: Names of the joints, from the base outwards.
        bounds: Bounds by kind, of :data:`KINDS`, each of shape (len(joints),).
        force: Largest force of a single contact at the hand that the arm takes [N]; infinite where
            its source says nothing of it.
        shipped: Whether it comes with the package, for one arm whose joints have these names.
    """

    name: str
    joints: tuple[str, ...]
    bounds: Mapping[str, Array] = field(default_factory=dict)
    force: float = np.inf
    shipped: bool = False

    __repr__ = brief

    def __post_init__(self) -> None:
        """Refuse bounds that no joint can have; ModelError, InputError or ShapeError."""
        place = f"limits {self.name}"
        if not self.joints or len(set(self.joints)) != len(self.joints):
            raise ModelError(f"{place} joints", "different names, one or more", self.joints)
        kept = {}
        for kind, values in self.bounds.items():
            if kind not in KINDS:
                raise ModelError(place, f"one of {', '.join(KINDS)}", kind)
            kept[kind] = checks.vector(f"{place} {kind}", values, len(self.joints), finite=True)
            if kind not in KINDS[:2] and not np.all(kept[kind] > 0.0):
                raise ModelError(f"{place} {kind}", "numbers above 0", kept[kind].tolist())
        if len(kept.keys() & set(KINDS[:2])) == 1:
            raise ModelError(place, "both ends of the range, lower and upper", "one")
        if "lower" in kept and not np.all(kept["lower"] < kept["upper"]):
            raise ModelError(place, "lower < upper", f"{kept['lower']}, {kept['upper']}")
        if not checks.number(f"{place} force", self.force) > 0.0:
            raise ModelError(f"{place} force", "a number above 0", self.force)
        object.__setattr__(self, "bounds", kept)

    def fitted(self, names: Sequence[str]) -> dict[str, dict[str, float]]:
        """Return the bounds of an arm's joints, each kind by the arm's own names.

        Joints fit by name if each joint of the set ends the name of one joint of the arm, those of
        a set that ships in the same order. A set of which no name fits is taken by order, if both
        have as many joints; one that ships only where the arm's names tell nothing of the arm, as
        ``joint_1`` or ``A1`` do.

        Args:
            names: All joints of the arm, from the base outwards.

        Raises:
            ModelError: The set is of another arm.
        """
        pairs = self._by_name(names)
        some = any(name.endswith(joint) for name in names for joint in self.joints)
        told = not all(_BARE.fullmatch(x) for x in names) if self.shipped else some
        if pairs is None and len(names) == len(self.joints) and not told:
            pairs = list(enumerate(names))
        if pairs is None:
            raise ModelError(
                f"limits {self.name}",
                f"an arm with the joints {', '.join(self.joints)}",
                ", ".join(names),
                do="name a set of this arm, or write one (docs/arms.md)",
            )
        return {
            kind: {name: float(values[k]) for k, name in pairs}
            for kind, values in self.bounds.items()
        }

    def notes(
        self, names: Sequence[str], own: Mapping[str, Mapping[str, float]]
    ) -> tuple[str, ...]:
        """Return what a user should know of the set on an arm, as of :meth:`fitted`.

        Args:
            names: All joints of the arm, from the base outwards.
            own: What its file states, by kind and name.
        """
        notes = []
        if self._by_name(names) is None:
            notes.append(
                f"limits {self.name}: the names of the joints do not say whether they are"
                " of this arm; taken in their order"
            )
        bounds = self.fitted(names)
        for kind, stated in own.items():
            more = [
                f"{name} {x:.4g} instead of {stated[name]:.4g}"
                for name, x in bounds.get(kind, {}).items()
                if x > _ROUNDED * stated.get(name, np.inf)
            ]
            if more:
                rest = f" and {len(more) - 2} more" if len(more) > 2 else ""
                notes.append(
                    f"limits {self.name}: more {kind} than the file states:"
                    f" {', '.join(more[:2])}{rest}"
                )
        return tuple(notes)

    def _by_name(self, names: Sequence[str]) -> list[tuple[int, str]] | None:
        """Return indices of the set's joints with the arm's names; None where names do not fit."""
        pairs: list[tuple[int, str]] = []
        for k, joint in enumerate(self.joints):
            ends = [name for name in names if name.endswith(joint)]
            if len(ends) != 1:
                return None
            pairs.append((k, ends[0]))
        order = [list(names).index(name) for _, name in pairs]
        if len(set(order)) < len(order):
            return None
        return None if self.shipped and order != sorted(order) else pairs
