"""Whether an arm stands and waits clear of its scene."""

from typing import Final

from mitt.core.arm.arm import Arm
from mitt.core.arm.standing import Slab, check_standing
from mitt.lab.world.scene import Belt, Scene, Tray

THICK: Final = 0.05
"""Thickness of belt and tray [m]."""

#: What to do about a belt that the arm is in.
_BELT = "move its middle, where parts are met, or make it shorter or lower"
_TRAY = "move its middle"


def check_scene(arm: Arm, scene: Scene) -> None:
    """Refuse a scene whose floor, belt or tray the arm is in where it stands, or waits.

    Raises:
        InputError: Which one, and what to do.
    """
    slabs = dict[str, tuple[Slab, str]]()
    if scene.belt is not None:
        slabs["belt"] = belt_slab(scene.belt), _BELT
    if scene.tray is not None:
        slabs["tray"] = tray_slab(scene.tray), _TRAY
    check_standing(arm, scene.floor, slabs)


def belt_slab(belt: Belt) -> Slab:
    """Return a belt as a slab."""
    return Slab(
        middle=belt.middle,
        direction=belt.direction,
        height=belt.height,
        size=(belt.length, belt.width, THICK),
    )


def tray_slab(tray: Tray) -> Slab:
    """Return a tray as a slab."""
    return Slab(
        middle=tray.middle, direction=0.0, height=tray.height, size=(tray.side, tray.side, THICK)
    )
