"""What a description file of an arm states, whatever its format: joints, limits, shapes."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

from mitt.signals import Array

_OPTION = "--limits FILE.toml, docs/arms.md"
LINK = " (link)"
"""What the name of a link ends with where a joint of the file is called the same."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Mimic:
    """A joint that follows another one: ``multiplier`` times its value, plus ``offset`` [rad]."""

    joint: str
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Shape:
    """Points that hold a body: the convex hull of balls about them.

    Attributes:
        frame: Name of the frame that they are given in.
        points: Points [m], shape (k, 3).
        radius: Radius of the balls [m].
    """

    frame: str
    points: Array
    radius: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftOut:
    """What a file states of a joint and mitt does not count.

    Attributes:
        damping: Torque per speed [N m s/rad].
        friction: Dry friction [N m].
        others: Anything else, as a note says it.
    """

    damping: float = 0.0
    friction: float = 0.0
    others: tuple[str, ...] = ()

    @property
    def words(self) -> str:
        """What it is, in words; empty where it is nothing."""
        named = (("damping", self.damping), ("dry friction", self.friction))
        return ", ".join((*(f"{name} {x:.4g}" for name, x in named if x), *self.others))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stated:
    """What a file states; a joint that is missing in one of the tables has no such limit there.

    Attributes:
        place: What an error calls the file.
        model: All joints, each of one degree of freedom where it has one in the file.
        ranges: Ends of the joints' ranges [rad or m]; of continuous joints one turn about zero.
        torque: Largest torques [N m or N].
        speed: Largest speeds [rad/s or m/s].
        mimics: Joints that follow others.
        loops: Pairs of frames that the file joins besides the tree.
        shapes: Shapes of the bodies whose meshes are there.
        notes: What a user should know of how the file was read.
        keys: How such a file states the range, torque and speed of a joint, by these words.
        left_out: What is stated of joints and not counted.
        unusable: What is written of a joint in the place of a limit that is missing.
    """

    place: str
    model: pin.Model
    ranges: Mapping[str, tuple[float, float]]
    torque: Mapping[str, float]
    speed: Mapping[str, float]
    mimics: Mapping[str, Mimic] = field(default_factory=dict)
    loops: tuple[tuple[str, str], ...] = ()
    shapes: tuple[Shape, ...] = ()
    notes: tuple[str, ...] = ()
    keys: Mapping[str, str] = field(default_factory=dict)
    left_out: Mapping[str, LeftOut] = field(default_factory=dict)
    unusable: Mapping[str, str] = field(default_factory=dict)

    def missing(self, name: str) -> tuple[str, ...]:
        """Return which of range, torque and speed are not known of a joint."""
        tables = {"range": self.ranges, "torque": self.torque, "speed": self.speed}
        return tuple(kind for kind, table in tables.items() if name not in table)

    def remedy(self, name: str) -> str:
        """Return where what is missing of a joint can be stated."""
        missing = self.missing(name)
        keys = " and ".join(self.keys.get(kind, kind) for kind in missing)
        own = " and ".join("lower, upper" if kind == "range" else kind for kind in missing)
        return f"state {keys} of {name!r} in the file, or {own} in a limits file ({_OPTION})"

    def neutral(self, values: Mapping[str, float]) -> Array:
        """Return a configuration of the whole model, shape (nq,).

        Args:
            values: Values of joints [rad or m]; any other is 0, moved into its range, and a joint
                that follows another one is where that one takes it.
        """
        q = np.array(pin.neutral(self.model), dtype=np.float64)
        at = {
            name: self.model.joints[self.model.getJointId(name)].idx_q
            for name in list(self.model.names)[1:]
            if self.model.joints[self.model.getJointId(name)].nq == 1
        }
        for name, k in at.items():
            low, high = self.ranges.get(name, (-np.inf, np.inf))
            q[k] = values.get(name, min(max(0.0, low), high))
        for _ in self.mimics:  # once for each, so that a joint may follow one that follows
            for name, mimic in self.mimics.items():
                if name in at and mimic.joint in at:
                    q[at[name]] = mimic.multiplier * q[at[mimic.joint]] + mimic.offset
        return q
