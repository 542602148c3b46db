"""Which arm it is, by content: what a learned map, or any other file for one arm, depends on.

A name does not tell an arm from the same arm with another tool or a tenth of its torque. So a file
keeps the numbers themselves. They are compared with a tolerance, because two platforms may differ
in the last digit of a rotation; a hash of rounded numbers would not say which of them differ, and
changes where a number lies at the edge between two roundings.
"""

from typing import TypeAlias

import numpy as np

from mitt.robot.arm import Arm
from mitt.signals import Array

Identity: TypeAlias = dict[str, list[float | None]]
"""Numbers of an arm by what they are, all links in a row each; None where one is infinite."""

#: Share of the largest number of a part by which two numbers of it may differ.
_TOLERANCE = 1e-9


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
        "transmission": limits.transmission,
        "peak torques": limits.tau_peak,
        "stall torques": limits.tau_stall,
        "continuous torques": limits.tau_rms,
        "joint speeds": limits.dq_max,
        "accelerations": np.zeros(0) if limits.acceleration is None else limits.acceleration,
        "jerks": np.zeros(0) if limits.jerk is None else limits.jerk,
        "torque rates": np.zeros(0) if limits.torque_rate is None else limits.torque_rate,
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
