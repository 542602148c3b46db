"""Contacts of an arm with what it stands on."""

import numpy as np
import pytest

from mitt.design.poses import touching
from mitt.robot.arm import Arm
from mitt.world.scene import Scene

#: The WAM's base ends 0.346 m below its shoulder.
TABLE, PEDESTAL = Scene(floor=-0.36), Scene(floor=-1.0)


@pytest.mark.parametrize(("scene", "low"), [(TABLE, True), (PEDESTAL, False)])
def test_an_arm_on_a_table_touches_it_where_it_reaches_down(
    arm: Arm, scene: Scene, *, low: bool
) -> None:
    """In its ready pose it stands there; straight and 23 degrees below the horizontal it hits."""
    assert not touching(arm, scene, arm.q_ready[None])
    down = np.array([0.0, 0.5 * np.pi + 0.4, 0.0])
    assert touching(arm, scene, down[None]) == low
