"""Shapes whose pairs are named touch as those do that MuJoCo brings together by their kinds."""

import mujoco
import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from mitt.robot.load import load_arm
from mitt.signals import Array
from mitt.world.build import build_plant, describe
from mitt.world.meeting import meeting
from mitt.world.scene import exact_scene

NAMED = build_plant(exact_scene(), load_arm("wam").model).model
KINDS = describe(exact_scene(), load_arm("wam").model)[0].compile()
OURS, THEIRS = mujoco.MjData(NAMED), mujoco.MjData(KINDS)
#: What a contact is made of.
PARTS = ("geom", "dist", "pos", "frame", "dim", "friction", "solref", "solimp", "includemargin")

poses = st.tuples(
    st.floats(-2.5, 2.5), st.floats(-1.9, 1.9), st.floats(-0.8, 3.0), *[st.floats(0.0, 2.4)] * 3
).map(np.array)
places = st.tuples(*[st.floats(-0.06, 0.06)] * 3).map(np.array)


def test_the_pairs_are_those_of_the_kinds() -> None:
    """All pairs that may meet by their kinds are named, and no others."""
    named = zip(NAMED.pair_geom1, NAMED.pair_geom2, strict=True)
    assert {frozenset(map(int, pair)) for pair in named} == set(map(frozenset, meeting(KINDS)))


@settings(max_examples=200, deadline=None)
@given(poses, places)
def test_contacts_are_the_same_and_in_the_same_order(q: Array, offset: Array) -> None:
    """With the ball about the palm and the fingers anywhere, each contact is the same."""
    for model, data in ((NAMED, OURS), (KINDS, THEIRS)):
        data.qpos[:6], data.qpos[6:13] = q, (9.0, 9.0, 9.0, 1.0, 0.0, 0.0, 0.0)
        mujoco.mj_kinematics(model, data)
        data.qpos[6:9] = data.site("catch_point").xpos + offset
        mujoco.mj_fwdPosition(model, data)
    assume(THEIRS.ncon > 0)
    assert OURS.ncon == THEIRS.ncon
    for part in PARTS:
        assert np.array_equal(getattr(OURS.contact, part), getattr(THEIRS.contact, part))
