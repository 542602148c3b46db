"""l_c and its derivatives, for any line along which the ball may come."""

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.core.arm.arm import Arm
from mitt.core.errors import InputError, MittError, ModelError
from mitt.core.map.map_design import MapDesign, tangent_of
from mitt.core.map.mapping import DirectMap, unlearned, virtual
from mitt.core.map.tangent import (
    Scratch,
    curve,
    expand,
    follow_coupling,
    invert,
    lift,
    pack,
    plane_of,
    scratch_of,
    unfold,
    unpack,
    workspace,
)
from mitt.core.signals import Array
from mitt.io.load import build_arm

PANDA = "cmeel.prefix/share/example-robot-data/robots/panda_description/urdf/panda.urdf"
#: Step of central differences [rad] and their agreement.
STEP = 1e-5
DIFFERENCE = 2e-7
seeds = st.integers(0, 2**31)


@pytest.fixture(scope="module")
def panda() -> Arm:
    """A Panda with four joints: the catch joint can be in the middle."""
    path = Path(pytest.__file__).parents[1] / PANDA
    return build_arm(path, tip="panda_hand_tcp", joints=[f"panda_joint{k}" for k in (1, 2, 4, 6)])


@pytest.mark.parametrize("slope", [(0.0, 0.0), (0.6, -1.2)])
@pytest.mark.parametrize("coupling", [(), ((0.4, -0.7, 1.3),)])
@pytest.mark.parametrize("free", [(0, 1, 2), (0, 2, 3)])
@pytest.mark.parametrize("place", [1, 2])
@given(seed=seeds, kappa=st.floats(1.0, 3.0), inward=st.floats(-3.0, 3.0))
def test_the_derivatives_of_l_c_are_differences(
    panda: Arm,
    place: int,
    free: tuple[int, int, int],
    coupling: tuple[tuple[float, float, float], ...],
    slope: tuple[float, float],
    seed: int,
    kappa: float,
    inward: float,
) -> None:
    """J_c is dl_c/dp and the curvature d(J_c dp)/dt, joints before and behind i included.

    The fourth joint stays where it is, or follows the free ones; q_alpha stays, or goes with them.
    """
    rng, i = np.random.default_rng(seed), free[place]
    q_catch = float(np.mean([panda.q_min[i], panda.q_max[i]]))
    design = MapDesign(
        catch_joint=i,
        q_catch=q_catch,
        kappa=kappa,
        inward=inward,
        free=free,
        coupling=coupling,
        slope=slope,
    )
    g, w, dp = tangent_of(panda, design), scratch_of(4), rng.uniform(-2.0, 2.0, 3)
    q, dq = rng.uniform(-1.0, 1.0, 4), g.A @ dp

    def at(x: Array) -> tuple[Array, Array, Array]:
        expand(g, x, w)
        curve(g, x, dq, w)
        return w.point[0].copy(), w.J_c.copy(), w.point[2].copy()

    _, J_c, curvature = at(q)
    for a in range(3):
        e = STEP * g.A[:, a]
        assert np.allclose(J_c[a], (at(q + e)[0] - at(q - e)[0]) / (2 * STEP), atol=DIFFERENCE)
    ahead, behind = at(q + STEP * dq)[1], at(q - STEP * dq)[1]
    change = (ahead - behind).T @ dp / (2 * STEP)
    assert np.allclose(curvature, change, atol=20 * DIFFERENCE)


def test_an_inward_line_leads_into_the_palm(arm: Arm) -> None:
    """On the WAM the ball of an inward line comes within 6 degrees of the palm's normal."""
    g = tangent_of(arm, MapDesign(q_catch=0.6, inward=3.0))
    q, w = np.array([0.1, 0.9, 0.6]), scratch_of(3)
    expand(g, q, w)
    comes = w.J_c[2] - arm.jacobian(q)[:, 2]
    cosine = -comes @ arm.orientation(q)[:, 2] / np.linalg.norm(comes)
    assert cosine > np.cos(np.deg2rad(6.0))


def test_an_inward_line_without_bounds_is_refused(arm: Arm) -> None:
    """NaN and enormous ratios raise an error that names the quantity."""
    for inward in (np.nan, 1e3):
        with pytest.raises(InputError, match="inward"):
            tangent_of(arm, MapDesign(inward=inward))


@pytest.mark.parametrize("slope", [(0.0, 0.0), (0.3, -0.4)])
@given(seed=seeds)
def test_at_the_catch_a_map_with_joints_that_follow_meets_position_and_velocity(
    panda: Arm, slope: tuple[float, float], seed: int
) -> None:
    """q_d moves the hand with the ball whatever alpha is; the further joint takes its part."""
    rng = np.random.default_rng(seed)
    design = MapDesign(
        catch_joint=2, q_catch=-1.4, free=(0, 1, 2), coupling=((0.2, -0.3, 0.8),), slope=slope
    )
    f = unlearned(panda, design)
    f = f.with_alpha(rng.normal(size=f.alpha.shape))
    q_o = panda.q_ready + rng.uniform(-0.2, 0.2, 4)
    q_o[2] = -1.4 + q_o[:2] @ slope
    follow_coupling(f.tangent, q_o)
    r_o, dr_o = f.to_ball(q_o), rng.uniform(-2.0, 2.0, 3)
    inside, rows = f.motion(np.array([r_o, dr_o, np.zeros(3)]))
    assert inside
    assert np.allclose(panda.position(rows[0]), r_o, atol=1e-9)
    assert np.allclose(panda.jacobian(rows[0]) @ rows[1], dr_o, atol=1e-9)
    assert rows[1, 3] != 0.0
    assert np.allclose(f.F(r_o) @ dr_o, rows[1], atol=1e-8)


@given(seed=seeds)
def test_the_inverse_and_its_start_are_poses_of_the_virtual_arm(panda: Arm, seed: int) -> None:
    """The joint that follows is where the free ones put it, wherever the inverse is asked."""
    rng = np.random.default_rng(seed)
    row = rng.uniform(-1.0, 1.0, 3)
    design = MapDesign(catch_joint=2, q_catch=-1.4, free=(0, 1, 2), coupling=(tuple(row),))
    f = unlearned(panda, design)

    def follows(q: Array) -> bool:
        rest = panda.q_ready
        return bool(np.isclose(q[3], rest[3] + row @ (q[:3] - rest[:3]), atol=1e-12))

    assert follows(f.start)
    q_o = f.start + np.array([*rng.uniform(-0.1, 0.1, 3), 9.0])
    w, q = scratch_of(4), f.start.copy()
    if invert(f.tangent, f.to_ball(q_o), q, w):
        assert follows(q)


@pytest.mark.parametrize("coupling", [((1.0, 2.0),), ((1, 2), (3, 4), (5, 6)), "abc", 3.0])
def test_a_coupling_that_is_no_rows_of_three_is_refused(coupling: object) -> None:
    """In one line, not reshaped to something else."""
    with pytest.raises(MittError, match="coupling"):
        MapDesign(coupling=coupling)  # type: ignore[arg-type]


def test_a_coupling_without_bounds_is_refused(panda: Arm) -> None:
    """As kappa and inward are; so is one with a row too many."""
    for coupling in (((1e6, 0.0, 0.0),), ((0.0,) * 3,) * 2):
        with pytest.raises(ModelError, match="coupling"):
            tangent_of(panda, MapDesign(catch_joint=2, q_catch=-1.4, coupling=coupling))


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
    q1=st.floats(-2.0, 2.0),
    q2=st.floats(-1.0, 1.5),
    s=st.floats(-6.0, 1.0),
    q_catch=st.floats(0.5, 2.2),
    kappa=st.floats(1.0, 4.0),
)
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
    panda = build_arm(path, tip="panda_hand_tcp", joints=joints)
    assert plane_of(panda, 3, q_catch=-1.8, kappa=1.0) is None


def test_the_shoulder_is_the_origin(plain: DirectMap) -> None:
    """For the WAM the shoulder's height is 0 and both axes turn positively."""
    assert plain.tangent.planar
    assert np.allclose(plain.tangent.plane[4:], [0.0, 1.0, 1.0], atol=EXACT)


JOINTS = {3: (1, 2, 4), 5: (1, 2, 3, 4, 6)}


@pytest.fixture(scope="module")
def maps(plain: DirectMap) -> dict[str, DirectMap]:
    """A closed-form arm, and arms of three and five joints inverted by Newton."""
    path = Path(pytest.__file__).parents[1] / PANDA
    found = {"wam": plain}
    for n, joints in JOINTS.items():
        names = [f"panda_joint{k}" for k in joints]
        arm = build_arm(path, tip="panda_hand_tcp", joints=names)
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
