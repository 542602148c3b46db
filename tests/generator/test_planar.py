"""The closed form: which arms have it, and that its seven figures are the arm's."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.generator.map_design import MapDesign
from mitt.generator.mapping import DirectMap, unlearned
from mitt.generator.tangent import plane_of
from mitt.robot.arm import Arm
from mitt.robot.load import load_arm
from mitt.signals import Array

PANDA = "cmeel.prefix/share/example-robot-data/robots/panda_description/urdf/panda.urdf"
#: Rounding of lengths of about a metre [m].
EXACT = 1e-12


def by_formula(plane: Array, q1: float, q2: float, s: float) -> Array:
    """Return l_c from the seven figures: p + s t in the plane, leant by q2, turned by q1."""
    px, pz, tx, tz, height, yaw, pitch = plane
    x, z = px + s * tx, pz + s * tz
    lean = pitch * q2
    radius = np.cos(lean) * x + np.sin(lean) * z
    up = -np.sin(lean) * x + np.cos(lean) * z
    return np.array([np.cos(yaw * q1) * radius, np.sin(yaw * q1) * radius, up + height])


@given(
    q1=st.floats(-2.0, 2.0), q2=st.floats(-1.0, 1.5), s=st.floats(-6.0, 1.0),
    q_catch=st.floats(0.5, 2.2), kappa=st.floats(1.0, 4.0),
)  # fmt: skip
def test_the_seven_figures_say_where_l_c_is(
    arm: Arm, q1: float, q2: float, s: float, q_catch: float, kappa: float
) -> None:
    """l_c by rotations of p + s t equals the kernel that knows nothing of planes."""
    f = unlearned(arm, MapDesign(q_catch=q_catch, kappa=kappa))
    plane = plane_of(arm, 2, q_catch=q_catch, kappa=kappa)
    assert plane is not None
    q_o = np.array([q1, q2, q_catch + s])
    assert np.allclose(f.to_ball(q_o), by_formula(plane, q1, q2, s), atol=EXACT * (1 + 10 * abs(s)))


def test_the_wam_is_such_an_arm_with_its_elbow_only(arm: Arm) -> None:
    """The catch joint must be the elbow: with another one there is no closed form."""
    assert plane_of(arm, 2, q_catch=np.pi / 2, kappa=1.0) is not None
    assert plane_of(arm, 1, q_catch=0.5, kappa=1.0) is None


def test_another_geometry_has_no_closed_form() -> None:
    """A Panda's axes 1, 2, 4 stand off the plane: plane_of says None, the map uses Newton."""
    path = Path(pytest.__file__).parents[1] / PANDA
    joints = ["panda_joint1", "panda_joint2", "panda_joint3", "panda_joint4"]
    panda = load_arm(path, tip="panda_hand_tcp", joints=joints)
    assert plane_of(panda, 3, q_catch=-1.8, kappa=1.0) is None


def test_the_shoulder_is_the_origin(plain: DirectMap) -> None:
    """For the WAM the shoulder's height is 0 and both axes turn positively."""
    assert plain.tangent.planar
    assert np.allclose(plain.tangent.plane[4:], [0.0, 1.0, 1.0], atol=EXACT)
