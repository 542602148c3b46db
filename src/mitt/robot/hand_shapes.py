"""Capsules that hold a hand, its fingers at any angle, for keeping it from what it may meet."""

import numpy as np

from mitt.robot.basket import Basket, Hand
from mitt.robot.description import Capsule

#: Angles of the fingers at which capsules are laid about them: between two of these the tip of a
#: finger of 0.1 m strays by less than 0.1 um. Every thirtieth tells how high they reach.
_ANGLES, _ROUGH = 901, 30
#: Radius of the palm and how far its rim stands above it [m], and radius of its capsule [m].
_PALM, _RIM, _PALM_CAPSULE = 0.041, 0.012, 0.045


def hand_capsules(hand: Hand) -> tuple[Capsule, ...]:
    """Return capsules on the tool plate that hold the palm, and the fingers at any angle."""
    if isinstance(hand, Basket):
        return _basket_capsules(hand)
    finger = hand.finger
    points = np.array([finger.points(x) for x in np.linspace(0.0, hand.drive.closed, _ANGLES)])
    off, height = np.hypot(points[..., 0], finger.offset), points[..., 1]
    width = float(off.max()) + finger.thickness
    low, high = height.min() - finger.thickness, height[::_ROUGH].max() + finger.thickness
    # The tops of the swept fingers are narrow: the round end of the capsule covers them where it
    # reaches. A capsule that holds the ends of a rod holds the rod.
    round_ = np.sqrt(np.maximum((width - finger.thickness) ** 2 - off**2, 0.0))
    end = max(float(high - 0.5 * width), float(low), float((height - round_).max()))
    return (
        Capsule(start=(0.0, 0.0, 0.0), end=(0.0, 0.0, _palm_end(hand.palm_height, width, low, end)),
                radius=_PALM_CAPSULE),
        Capsule(start=(0.0, 0.0, float(low)), end=(0.0, 0.0, end), radius=width),
    )  # fmt: skip


def _palm_end(height: float, width: float, low: float, end: float) -> float:
    """Return where the palm's capsule ends, so that with that of the fingers it holds the palm [m].

    Args:
        height: Of the palm above the plate [m].
        width: Radius of the fingers' capsule [m].
        low: Where that begins [m].
        end: Where that ends [m].
    """
    own, theirs = (np.sqrt(max(x**2 - _PALM**2, 0.0)) for x in (_PALM_CAPSULE, width))
    top, half = height + _RIM, 0.5 * height
    covered = width > _PALM and low - theirs <= half + own and end + theirs >= top
    return half if covered else max(half, float(top - own))


def _basket_capsules(b: Basket) -> tuple[Capsule, ...]:
    """Return capsules on the tool plate that hold the flange, and net, struts and ring."""
    ring = b.net_radius + b.ring_thickness
    wide = max(b.outside, ring)
    top = b.ring_height + b.ring_thickness - float(np.sqrt(wide**2 - ring**2))
    low = min(b.floor + float(np.sqrt(wide**2 - (wide - b.strut) ** 2)), top)
    return (
        Capsule(start=(0.0, 0.0, 0.0), end=(0.0, 0.0, 0.25 * b.flange), radius=b.flange + b.strut),
        Capsule(start=(0.0, 0.0, low), end=(0.0, 0.0, top), radius=wide),
    )
