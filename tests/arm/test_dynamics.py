"""Torques, their derivatives and poses by our kernels against Pinocchio, and laws of them."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.core.arm.arm import Arm
from mitt.core.arm.description import ArmModel, Link, rotation, transform
from mitt.core.arm.dynamics import (
    bodies_of,
    dynamics_scratch,
    inverse_dynamics,
    slopes_work,
    torque_slopes,
)
from mitt.core.arm.hands import HandModel
from mitt.core.signals import Array
from mitt.io.wam import wam, wam_limits
from mitt.lab.bench.libraries import to_pinocchio

#: Agreement with Pinocchio, share of the largest torque.
AGREE = 1e-10
seeds = st.integers(0, 2**31)


def torque(model: ArmModel, motion: Array) -> Array:
    """Return our torque of all links."""
    tau, notes = np.full(len(model.links), np.nan), dynamics_scratch(len(model.links))
    inverse_dynamics(bodies_of(model), *motion, tau, notes)
    return tau


def by_pinocchio(model: ArmModel, motion: Array) -> Array:
    """Return Pinocchio's torque of all links, held ones at rest where they are held."""
    built, whole = to_pinocchio(model), np.zeros((3, len(model.links)))
    whole[0] = [0.0 if link.held is None else link.held for link in model.links]
    whole[:, model.active] = motion
    tau: Array = pin.rnea(built, built.createData(), *whole)
    return tau


def state(rng: np.random.Generator, n: int) -> Array:
    """Return random q, dq, ddq, shape (3, n)."""
    motion: Array = rng.standard_normal((3, n)) * np.array([[1.0], [5.0], [50.0]])
    return motion


def unit(rng: np.random.Generator) -> Array:
    """Return a random direction."""
    v = rng.standard_normal(3)
    out: Array = v / np.linalg.norm(v)
    return out


def link(rng: np.random.Generator, k: int) -> Link:
    """Return a random link, held in one case of four, sliding in one of three."""
    A = rng.standard_normal((3, 3))
    S = 0.01 * A @ A.T
    return Link(
        name=f"j{k}",
        placement=transform(rotation(unit(rng), rng.uniform(-3, 3)), rng.uniform(-0.5, 0.5, 3)),
        axis=unit(rng),
        prismatic=bool(rng.random() < 1 / 3),
        q_min=-3.0,
        q_max=3.0,
        mass=rng.uniform(0.1, 5.0),
        com=rng.uniform(-0.2, 0.2, 3),
        inertia=np.trace(S) * np.eye(3) - S,
        armature=rng.uniform(0.0, 0.3),
        held=rng.uniform(-1, 1) if rng.random() < 0.25 else None,
    )


def chain(rng: np.random.Generator) -> ArmModel:
    """Return a random chain of one to eight links on a mount of any pose."""
    links = tuple(link(rng, k) for k in range(rng.integers(1, 9)))
    links = (replace(links[0], held=None), *links[1:])
    active = sum(x.held is None for x in links)
    mount = transform(rotation(unit(rng), rng.uniform(-3, 3)), rng.uniform(-1, 1, 3))
    return ArmModel(
        name="random",
        links=links,
        tool=np.eye(4),
        hand=None,
        q_ready=np.zeros(active),
        base_capsules=(),
        mount=mount,
    )


@given(seed=seeds)
def test_random_chains_agree_with_pinocchio(seed: int) -> None:
    """Turning, sliding and held joints, any placement, inertia and rotor: to 1e-10."""
    rng = np.random.default_rng(seed)
    model = chain(rng)
    motion = state(rng, len(model.active))
    ours, theirs = torque(model, motion), by_pinocchio(model, motion)
    assert np.abs(ours - theirs).max() <= AGREE * max(np.abs(theirs).max(), 1.0)


@pytest.mark.parametrize("held_3", [0.0, 0.4, None])
@pytest.mark.parametrize("ball", [0.0, 0.07, 0.5])
def test_the_wam_agrees_with_pinocchio(held_3: float | None, ball: float) -> None:
    """With hand and held ball, the torque at the locked joint 3 included: to 1e-10."""
    model = wam(HandModel(), held_3=held_3).complete()
    if ball > 0.0:
        model = model.loaded(ball, at=np.array([0.0, 0.0, 0.12]), inertia=np.zeros((3, 3)))
    rng = np.random.default_rng(3)
    for _ in range(50):
        motion = state(rng, len(model.active))
        theirs = by_pinocchio(model, motion)
        assert np.abs(torque(model, motion) - theirs).max() <= AGREE * np.abs(theirs).max()
    if held_3 is not None:
        assert abs(theirs[2]) > 1.0


@given(seed=seeds)
def test_torque_is_affine_in_the_acceleration(arm: Arm, seed: int) -> None:
    """tau(ddq) - tau(0) = M ddq with the mass matrix of Pinocchio, eq. (14)."""
    q, dq, ddq = state(np.random.default_rng(seed), arm.n)
    inertial = arm.inverse_dynamics(q, dq, ddq) - arm.inverse_dynamics(q, dq, np.zeros(arm.n))
    assert inertial == pytest.approx(arm.mass_matrix(q) @ ddq, abs=1e-9 * np.abs(ddq).max())


@given(seed=seeds)
def test_many_instants_are_one_by_one(arm: Arm, seed: int) -> None:
    """A batch gives to the bit what each of its instants gives."""
    rng = np.random.default_rng(seed)
    motion = np.array([state(rng, arm.n) for _ in range(5)])
    assert np.array_equal(arm.torques(motion), [arm.torque(*row) for row in motion])


@pytest.fixture(scope="module", params=["wam", "wam-free"])
def any_arm(request: pytest.FixtureRequest, arm: Arm) -> Arm:
    """The WAM with joint 3 held, and with all four joints free."""
    if request.param == "wam":
        return arm
    return Arm(wam(HandModel(), held_3=None), wam_limits("paper"))


def slopes(arm: Arm, motion: Array) -> tuple[Array, Array]:
    """Return torques and their derivatives by the kernel."""
    links = len(arm.model.links)
    tau, slope = np.zeros(links), np.zeros((3, links, arm.n))
    torque_slopes(arm.bodies, motion, tau, slope, slopes_work(links))
    return tau, slope


@given(seed=seeds)
def test_derivatives_mass_and_orientation_are_pinocchio_s(any_arm: Arm, seed: int) -> None:
    """Torque of all links, d tau/dq, d tau/d dq and M, and the way the plate is turned."""
    model, index = any_arm.model.complete(), list(any_arm.model.active)
    motion = np.random.default_rng(seed).uniform(-1.0, 1.0, (3, any_arm.n)) * [[1.5], [8.0], [60.0]]
    tau, slope = slopes(any_arm, motion)
    assert tau == pytest.approx(any_arm.torque(*motion), abs=AGREE)
    built, whole = to_pinocchio(model), np.zeros((3, len(model.links)))
    whole[:, index] = motion
    data = built.createData()
    by_q, by_dq, mass = pin.computeRNEADerivatives(built, data, *whole)
    mass = np.triu(mass) + np.triu(mass, 1).T
    theirs = by_q[:, index], by_dq[:, index], mass[:, index]
    for ours, derived, library in zip(
        slope, any_arm.torque_derivatives(*motion), theirs, strict=True
    ):
        assert ours == pytest.approx(library, abs=AGREE)
        assert derived == pytest.approx(library, abs=AGREE)
    assert any_arm.mass_matrix(motion[0]) == pytest.approx(theirs[2][index], abs=AGREE)
    pin.framesForwardKinematics(built, data, whole[0])
    plate = data.oMf[built.getFrameId("catch_point")]
    assert any_arm.orientation(motion[0]) == pytest.approx(plate.rotation, abs=AGREE)
    assert any_arm.position(motion[0]) == pytest.approx(plate.translation, abs=AGREE)


def test_derivatives_are_central_differences_of_the_torque(any_arm: Arm) -> None:
    """Each of the three derivatives is the slope of the torque along each joint."""
    motion = np.random.default_rng(4).uniform(-1.0, 1.0, (3, any_arm.n)) * [[1.5], [8.0], [60.0]]
    _, slope = slopes(any_arm, motion)
    h = 1e-6
    for d in range(3):
        for j in range(any_arm.n):
            step = np.zeros_like(motion)
            step[d, j] = h
            change = (any_arm.torque(*(motion + step)) - any_arm.torque(*(motion - step))) / (2 * h)
            assert slope[d, :, j] == pytest.approx(change, abs=1e-6)
