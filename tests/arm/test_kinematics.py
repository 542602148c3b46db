"""The kinematic kernel against central differences, hinges and slides alike."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.core.arm.hands import HandModel
from mitt.core.arm.kinematics import chain_of, motion_of, sweep
from mitt.core.signals import Array
from mitt.io.wam import wam

STEP = 1e-5
#: Central differences of first and second order leave errors of this size.
FIRST = 1e-7
SECOND = 1e-3


def swept(sliding: bool, q: Array, dq: Array) -> tuple[Array, Array, Array, Array]:
    """Return tip rows, J, dJ, ddJ of the WAM, its third joint optionally a slide."""
    model = wam(HandModel(), held_3=None)
    links = list(model.links)
    links[2] = replace(links[2], prismatic=sliding)
    chain, m = chain_of(replace(model, links=tuple(links))), motion_of(4)
    sweep(chain, q, dq, m)
    return m.tip.copy(), m.J.copy(), m.dJ.copy(), m.ddJ.copy()


angles = st.lists(st.floats(-1.5, 1.5), min_size=4, max_size=4).map(np.array)


@pytest.mark.parametrize("sliding", [False, True])
@given(q=angles, dq=angles)
def test_derivatives_along_a_motion_are_differences(sliding: bool, q: Array, dq: Array) -> None:
    """J, dJ, ddJ, dp and ddp are the derivatives of l(q + t dq) and of J."""
    tip, J, dJ, ddJ = swept(sliding, q, dq)
    ahead, back = (swept(sliding, q + s * STEP * dq, dq) for s in (1.0, -1.0))
    assert np.allclose(tip[1], (ahead[0][0] - back[0][0]) / (2 * STEP), atol=FIRST)
    assert np.allclose(tip[1], dq @ J, atol=1e-12)
    assert np.allclose(tip[2], (ahead[0][1] - back[0][1]) / (2 * STEP), atol=FIRST)
    assert np.allclose(dJ, (ahead[1] - back[1]) / (2 * STEP), atol=FIRST)
    assert np.allclose(ddJ, (ahead[2] - back[2]) / (2 * STEP), atol=SECOND)
