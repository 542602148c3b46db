"""Shapes whose pairs are named touch as those do that MuJoCo brings together by their kinds."""

import mujoco
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from mitt.errors import ModelError
from mitt.robot.load import load_arm
from mitt.signals import Array
from mitt.world.build import build_plant, describe
from mitt.world.meeting import meeting, name_pairs
from mitt.world.scene import exact_scene
from mitt.world.simulation import World
from mitt.world.throws import Throw

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


def test_a_world_that_was_drawn_anew_still_meets_by_name() -> None:
    """``mj_setConst``, by which masses are drawn, brings the kinds of the bodies back."""
    world = World(exact_scene(), load_arm("wam").model)
    world.reset(Throw(r=np.array([3.0, 0.0, 0.5]), dr=np.array([-5.0, 0.0, 3.0])), 1)
    assert not world.model.body_contype.any()
    assert not world.model.body_conaffinity.any()


def test_settings_that_pairs_would_not_take_over_are_refused() -> None:
    """A shape with a margin of its own."""
    spec, _ = describe(exact_scene(), load_arm("wam").model)
    spec.geoms[0].margin = 0.01
    with pytest.raises(ModelError, match="margin"):
        name_pairs(spec)


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
