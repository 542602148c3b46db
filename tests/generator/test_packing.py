"""What is packed into one vector comes out as it went in, and computes the same to the bit."""

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.generator.map_design import MapDesign
from mitt.generator.mapping import DirectMap, unlearned, virtual
from mitt.generator.tangent import Scratch, lift, pack, scratch_of, unfold, unpack, workspace
from mitt.robot.load import load_arm
from mitt.signals import Array

PANDA = "cmeel.prefix/share/example-robot-data/robots/panda_description/urdf/panda.urdf"
JOINTS = {3: (1, 2, 4), 5: (1, 2, 3, 4, 6)}


@pytest.fixture(scope="module")
def maps(plain: DirectMap) -> dict[str, DirectMap]:
    """A closed-form arm, and arms of three and five joints inverted by Newton."""
    path = Path(pytest.__file__).parents[1] / PANDA
    found = {"wam": plain}
    for n, joints in JOINTS.items():
        names = [f"panda_joint{k}" for k in joints]
        arm = load_arm(path, tip="panda_hand_tcp", joints=names)
        i = joints.index(4)
        free = (0, 1, i)
        design = MapDesign(catch_joint=i, q_catch=-1.8, free=free)
        found[f"panda-{n}"] = unlearned(arm, design)
    return found


def buffers(w: Scratch) -> list[Array]:
    """Return all arrays of a scratch."""
    return [*w.motion, *w[1:]]


@pytest.mark.parametrize("name", ["wam", "panda-3", "panda-5"])
def test_unpacking_gives_back_every_field(maps: dict[str, DirectMap], name: str) -> None:
    """Chain, design and plane of the unpacked map are those that were packed."""
    g = maps[name].tangent
    again = unpack(pack(g))
    mine = (g.free, g.catch_joint, g.q_catch, g.kappa, g.planar)
    assert (again.free, again.catch_joint, again.q_catch, again.kappa, again.planar) == mine
    assert again.inward == g.inward
    assert np.array_equal(again.q_rest, g.q_rest)
    assert np.array_equal(again.plane, g.plane)
    for part, other in zip(again.chain, g.chain, strict=True):
        assert np.array_equal(part, other)


@pytest.mark.parametrize("name", ["wam", "panda-3", "panda-5"])
@given(seed=st.integers(0, 2**31))
def test_a_packed_map_computes_the_same_to_the_bit(
    maps: dict[str, DirectMap], name: str, seed: int
) -> None:
    """Virtual joints through the packed vector equal those of the direct kernel call."""
    f, rng = maps[name], np.random.default_rng(seed)
    r_o = f.arm.position(f.start) + rng.uniform(0.0, 0.3, 3)
    ball = np.array([r_o, rng.uniform(-3, 3, 3), rng.uniform(-9, 9, 3)])
    rows, direct = np.zeros((2, 3, f.arm.n))
    rows[0] = direct[0] = f.start
    inside = virtual(f.packed, ball, rows, workspace(f.arm.n))
    assert inside == lift(f.tangent, ball, direct, scratch_of(f.arm.n))
    assert np.array_equal(rows, direct)


@pytest.mark.parametrize("n", [3, 4, 5, 7])
def test_buffers_have_their_shapes_and_do_not_overlap(n: int) -> None:
    """Each view of the workspace is as large as its own buffer would be, and apart from others."""
    views, own = buffers(unfold(workspace(n), n)), buffers(scratch_of(n))
    assert [x.shape for x in views] == [x.shape for x in own]
    assert not any(np.shares_memory(a, b) for a, b in combinations(views, 2))


def test_a_used_workspace_leaves_no_trace(maps: dict[str, DirectMap]) -> None:
    """Filled with NaN before the call, the workspace gives the same answer."""
    f = maps["wam"]
    ball = np.array([[2.0, 0.1, 0.5], [-5.0, 0.0, 1.0], [0.0, 0.0, -9.81]])
    clean, dirty = np.zeros((2, 3, 3))
    assert virtual(f.packed, ball, clean, workspace(3))
    assert virtual(f.packed, ball, dirty, np.full_like(workspace(3), np.nan))
    assert np.array_equal(clean, dirty)
