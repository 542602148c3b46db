"""Limit sets of an arm's joints: data of vendors, fitted to an arm by the names of its joints."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from mitt import checks
from mitt.errors import ModelError
from mitt.fields import brief
from mitt.signals import Array

KINDS = ("lower", "upper", "speed", "acceleration", "jerk", "torque", "torque_rate")
"""What a set may bound: ends of the range [rad], then the largest rad/s, rad/s^2, rad/s^3, N m and
N m/s (of a sliding joint m and N in the place of rad and N m)."""

#: Names of joints that tell nothing of the arm.
_BARE = re.compile(r"(actuator|joint|jnt|axis|j|a|q)?[ _-]*\d*", re.IGNORECASE)
#: Share of a file's figure up to which a set's is the same but for rounding.
_ROUNDED = 1.002


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
                f"limits {self.name}", f"an arm with the joints {', '.join(self.joints)}",
                ", ".join(names), do="name a set of this arm, or write one (docs/arms.md)",
            )  # fmt: skip
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
            notes.append(f"limits {self.name}: the names of the joints do not say whether they are"
                         " of this arm; taken in their order")  # fmt: skip
        bounds = self.fitted(names)
        for kind, stated in own.items():
            more = [
                f"{name} {x:.4g} instead of {stated[name]:.4g}"
                for name, x in bounds.get(kind, {}).items()
                if x > _ROUNDED * stated.get(name, np.inf)
            ]
            if more:
                rest = f" and {len(more) - 2} more" if len(more) > 2 else ""
                notes.append(f"limits {self.name}: more {kind} than the file states:"
                             f" {', '.join(more[:2])}{rest}")  # fmt: skip
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
