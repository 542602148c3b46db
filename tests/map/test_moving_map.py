"""Eq. (3) for a map that changes on the way: q_alpha, slope, kappa, inward and alpha by time."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import mitt
from mitt.core.arm.arm import Arm
from mitt.core.map.map_design import default_design
from mitt.core.map.mapping import DirectMap, unlearned
from mitt.core.map.polynomial import CatchBasis
from mitt.core.map.tangent import catch_angle, expand, follow_coupling, scratch_of
from mitt.core.signals import Array

#: Step of the differences in time [s]; agreement of position [m] and of velocity [m/s].
STEP = 1e-5
PLACE = 1e-10
RATE = 1e-7
#: How fast q_alpha [rad/s], slope and alpha [rad/s] change.
TURNS = 3.0
TILTS = 0.3
BENDS = 5.0


class Moving:
    """A map whose every parameter goes with time, and a ball that it meets at t = 0."""

    def __init__(self, arm: Arm, seed: int, kappa: float, inward: float) -> None:
        """Draw the motions of all parameters, the pose of the catch and the ball's motion."""
        rng = np.random.default_rng(seed)
        self.base = unlearned(arm, replace(default_design(arm), match_weight=0.0))
        self.kappa, self.inward, self.turn = kappa, inward, rng.uniform(-TURNS, TURNS)
        self.slope = rng.standard_normal((2, 2)) * [[0.1], [TILTS]]
        self.alpha = rng.standard_normal((2, *self.base.alpha.shape)) * [[[1.0]], [[BENDS]]]
        f, q = self.at(0.0), arm.q_ready.copy()
        q[list(f.design.free)] += 0.1 * rng.standard_normal(3)
        q[f.design.catch_joint] = 0.0
        q[f.design.catch_joint] = catch_angle(f.tangent, q)
        follow_coupling(f.tangent, q)
        self.r = arm.position(q)
        self.v = rng.uniform(2.0, 6.0) * np.array([-1.0, 0.2, -0.4]) + rng.standard_normal(3)
        self.a = 10.0 * rng.standard_normal(3)

    def at(self, t: float) -> DirectMap:
        """Return the map as it is at a time [s]."""
        design = replace(
            self.base.design,
            q_catch=self.base.design.q_catch + self.turn * t,
            kappa=self.kappa * (1.0 + t) if self.kappa > 1.0 else 1.0,
            inward=self.inward * (1.0 + t),
            slope=tuple(self.slope[0] + t * self.slope[1]),
        )
        f, catch = unlearned(self.base.arm, design), design.free.index(design.catch_joint)
        centre = self.base.basis.centre.copy()
        centre[catch] = design.q_catch
        basis = CatchBasis(design.order, catch, centre, np.ones(3))
        return replace(f, basis=basis, alpha=self.alpha[0] + t * self.alpha[1])

    def errors(self, t: float) -> tuple[Array, float, Array]:
        """Return r_e of eq. (4) [m], s [rad] and q_o at a time [s]."""
        f, r = self.at(t), self.r + t * self.v + 0.5 * t * t * self.a
        inside, rows = f.virtual(np.array([r, self.v + t * self.a, self.a]))
        assume(inside)
        s = rows[0, f.design.catch_joint] - catch_angle(f.tangent, rows[0])
        return self.base.arm.position(f.bend(rows[0])) - r, float(s), rows[0]


@pytest.fixture(scope="module", params=["wam", "ur5e"])
def some_arm(request: pytest.FixtureRequest) -> Arm:
    """An arm with a closed-form inverse, and one that takes Newton's method."""
    name: str = request.param
    return mitt.load_arm(name, limits="paper") if name == "wam" else mitt.load_arm(name)


@settings(max_examples=12)
@given(
    seed=st.integers(0, 2**31),
    kappa=st.sampled_from([1.0, 1.3]),
    inward=st.floats(-1.0, 1.0),
    matched=st.booleans(),
)
def test_the_catch_holds_while_the_map_changes(
    some_arm: Arm, seed: int, kappa: float, inward: float, matched: bool
) -> None:
    """At s = 0: r_e = 0 and dr_e/dt = (J_i - T) ds/dt, so both are 0 for the paper's T = J_i.

    Whatever q_alpha, slope, kappa, inward and the coefficients do: each of their rates comes with
    a factor s.
    """
    case = Moving(some_arm, seed, 1.0 if matched else kappa, 0.0 if matched else inward)
    gap, _, q = case.errors(0.0)
    assert np.abs(gap).max() < PLACE
    dgap, ds = np.zeros(3), 0.0
    for h, weight in ((STEP, 8.0), (-STEP, -8.0), (2.0 * STEP, -1.0), (-2.0 * STEP, 1.0)):
        e, s, _ = case.errors(h)
        dgap, ds = dgap + weight / (12.0 * STEP) * e, ds + weight / (12.0 * STEP) * s
    f, w = case.at(0.0), scratch_of(some_arm.n)
    expand(f.tangent, q, w)
    J_i = some_arm.jacobian(q) @ f.tangent.A[:, f.tangent.catch]
    assert np.abs(dgap - (J_i - w.J_c[f.tangent.catch]) * ds).max() < RATE
    assert not matched or np.abs(dgap).max() < RATE
