"""What makes no sense of an arm and its map before anything is thrown, in words.

Where no throw is given, balls come as the default ones do: from +x, falling (docs/throws.md).
"""

from collections.abc import Iterator

import numpy as np

from mitt.generator.design import MapDesign, default_design
from mitt.robot.arm import Arm
from mitt.signals import Array

#: Directions of arriving balls: azimuth from +x, and angle of descent [rad] (docs/throws.md).
_AZIMUTHS, _DESCENTS = (-0.15, 0.0, 0.15), (0.24, 0.5, 0.78)
#: Least cosine of the angle between the palm's normal and where a ball comes from.
_FACING = 0.2
#: Share of a torque at rest, and of a range at its ends, from which a warning is given.
_AT_REST, _NEAR_END = 0.5, 0.05


def warnings_of(arm: Arm, design: MapDesign | None = None) -> tuple[str, ...]:
    """Return what makes no sense: notes of the import, ready pose, palm; nothing where all does.

    Args:
        arm: The arm.
        design: Design of its map; the one that follows from the arm if left out.
    """
    return (*arm.model.notes, *_at_rest(arm), *_near_ends(arm), *_palm(arm, design))


def _at_rest(arm: Arm) -> Iterator[str]:
    """Yield the drives that the ready pose loads hard."""
    links, still = arm.model.links, np.zeros(arm.n)
    share = arm.limits.torque_ratio(arm.torque(arm.q_ready, still, still), np.zeros(len(links)))
    for link, x in zip(links, share, strict=True):
        if x > _AT_REST:
            yield f"the ready pose takes {100.0 * x:.0f} % of the torque of {link.name!r} at rest"


def _near_ends(arm: Arm) -> Iterator[str]:
    """Yield the joints whose ready angle leaves no room."""
    rows = zip(arm.names, arm.q_ready, arm.q_min, arm.q_max, strict=True)
    for name, q, low, high in rows:
        if not low <= q <= high:
            yield f"the ready pose has {name!r} at {q:.3g}, outside {low:.3g}..{high:.3g}"
        elif min(q - low, high - q) < _NEAR_END * (high - low):
            yield f"the ready pose has {name!r} at {q:.3g}, near the end of {low:.3g}..{high:.3g}"


def _palm(arm: Arm, design: MapDesign | None) -> Iterator[str]:
    """Yield a line if the palm faces no ball, neither in the ready pose nor at the catch."""
    if arm.n < 3:
        return
    design = default_design(arm) if design is None else design
    catch: Array = arm.q_ready.copy()
    others = [k for k in design.free if k != design.catch_joint]
    catch[design.catch_joint] = design.q_catch + catch[others] @ design.slope
    most = max(_facing(arm, q) for q in (arm.q_ready, catch))
    if most < _FACING:
        yield (
            "the palm faces away from the balls, in the ready pose and at the catch: by"
            f" {np.rad2deg(np.arccos(most)):.0f} degrees at least; hold other joints otherwise,"
            " or name another tip"
        )


def _facing(arm: Arm, q: Array) -> float:
    """Return the largest cosine between the palm's normal and where a ball comes from."""
    normal = arm.orientation(q)[:, 2]
    return max(
        float(normal @ (np.cos(d) * np.cos(a), np.cos(d) * np.sin(a), np.sin(d)))
        for a in _AZIMUTHS
        for d in _DESCENTS
    )
