"""Capsules that hold a hand, its fingers at any angle, for keeping it from what it may meet."""

import numpy as np

from mitt.robot.basket import Basket, Hand
from mitt.robot.description import Capsule


def hand_capsules(hand: Hand) -> tuple[Capsule, ...]:
    """Return capsules on the tool plate that hold the palm, and the fingers at any angle."""
    if isinstance(hand, Basket):
        return _basket_capsules(hand)
    finger = hand.finger
    points = np.array([finger.points(x) for x in np.linspace(0.0, hand.drive.closed, 31)])
    width = float(np.hypot(np.abs(points[..., 0]).max(), finger.offset) + finger.thickness)
    low, high = points[..., 1].min() - finger.thickness, points[..., 1].max() + finger.thickness
    # The tops of the swept fingers are narrow: the round end of the capsule covers them.
    end = float(max(high - 0.5 * width, low))
    return (
        Capsule(start=(0.0, 0.0, 0.0), end=(0.0, 0.0, 0.5 * hand.palm_height), radius=0.045),
        Capsule(start=(0.0, 0.0, float(low)), end=(0.0, 0.0, end), radius=width),
    )


def _basket_capsules(b: Basket) -> tuple[Capsule, ...]:
    """Return capsules on the tool plate that hold the flange, and net, struts and ring."""
    wide = b.outside
    ring = b.net_radius + b.ring_thickness
    top = b.ring_height + b.ring_thickness - float(np.sqrt(wide**2 - ring**2))
    low = min(b.floor + float(np.sqrt(wide**2 - (wide - b.strut) ** 2)), top)
    return (
        Capsule(start=(0.0, 0.0, 0.0), end=(0.0, 0.0, 0.25 * b.flange), radius=b.flange + b.strut),
        Capsule(start=(0.0, 0.0, low), end=(0.0, 0.0, top), radius=wide),
    )
