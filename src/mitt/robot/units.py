"""Whether the limits of joints can be in radians: degrees are refused, or doubted in a note.

A hinge may state any speed: files of walking robots allow 40 rad/s, and others write 1000 for "no
limit". So a speed of the description file is only doubted. A limit set has a unit of its own, and
is refused.
"""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
import pinocchio as pin

from mitt.errors import ModelError
from mitt.robot.stated import Stated

#: Widest range of a hinge that is taken for radians [rad]; a wider one was written in degrees.
WIDEST: Final = 4.0 * np.pi
#: Speed of a hinge above which a unit is doubted, and above which a limit set is refused [rad/s].
#: Choices of this project: arms turn at up to 10 rad/s, and state 60 to 400 degrees a second.
_DOUBTED, _FASTEST = 20.0, 20.0 * np.pi


def slides(model: pin.Model, name: str) -> bool:
    """Say whether a joint slides [m] instead of turning [rad]."""
    return bool(model.joints[model.getJointId(name)].shortname().startswith("JointModelP"))


def check_range(where: str, low: float, high: float) -> None:
    """Refuse a range of a hinge [rad] that was written in degrees.

    Raises:
        ModelError: An end is beyond 4 pi.
    """
    if max(abs(low), abs(high)) > WIDEST:
        raise ModelError(where, "a range within +-4 pi rad", f"{low:g}..{high:g}",
                         do="these look like degrees: write radians")  # fmt: skip


def check_set(model: pin.Model, name: str, bounds: Mapping[str, Mapping[str, float]]) -> None:
    """Refuse ranges and speeds of a limit set that were written in degrees.

    Args:
        model: The joints.
        name: Name of the set.
        bounds: Bounds by kind and joint, as of :meth:`mitt.robot.limit_sets.LimitSet.fitted`.

    Raises:
        ModelError: A hinge has a range beyond 4 pi rad or a speed beyond 20 pi rad/s.
    """
    for joint, low in bounds.get("lower", {}).items():
        if not slides(model, joint):
            check_range(f"limits {name} of joint {joint!r}", low, bounds["upper"][joint])
    for joint, speed in bounds.get("speed", {}).items():
        if not slides(model, joint) and speed > _FASTEST:
            raise ModelError(
                f"limits {name} of joint {joint!r}", "a speed of at most 20 pi rad/s", f"{speed:g}",
                do=f"this looks like degrees: write radians, {np.radians(speed):.4g}",
            )  # fmt: skip


def speed_notes(stated: Stated, joints: Sequence[str]) -> tuple[str, ...]:
    """Return a note of the active joints whose speed limits are too large to be believed."""
    fast = [x for x in joints if not slides(stated.model, x) and stated.speed[x] > _DOUBTED]
    if not fast:
        return ()
    named = [f"{x} {stated.speed[x]:.4g} rad/s" for x in fast[:2]]
    rest = f" and {len(fast) - 2} more" if len(fast) > 2 else ""
    degrees = np.radians(stated.speed[fast[0]])
    return (f"large speed limits: {', '.join(named)}{rest}; if they are in degrees, write radians"
            f" ({fast[0]} {degrees:.4g}), in the file or as speed in a limits file"
            " (--limits FILE.toml)",)  # fmt: skip
