"""The map from the ball's motion to the desired joint motion, eqs. (1), (6) to (13), (15).

q_d = f(r_o) = g(l_c^-1(r_o)) with g(q) = q + b(q): at the catch q_i = q_alpha, b and its first
derivatives vanish, and position and velocity match whatever the coefficients are. Of a map with a
``match_weight`` b alone vanishes: the position matches, and the velocity as well as it has learned.

| here     | paper          | unit  | shape  |
|----------|----------------|-------|--------|
| ``alpha``| alpha, stacked monomial by monomial | rad | (m, n) |
| ``F``    | df/dr_o        | rad/m | (n, 3) |
| ``H``    | ours: Hessian of the learned cost at alpha | | (m n, m n) |
| ``phi``  | monomials and their rate at t_0 | 1, 1/s | (2, m) |
| ``C``    | C of eq. (13) = [phi' (x) I; dphi' (x) I] | 1, 1/s | (2n, m n) |
| ``d``    | right side of eq. (12) | rad, rad/s | (2n,) |

Each throw has an alpha of its own, with which the motion starts where the arm is: C alpha = d,
eqs. (8) to (13). The variables of b are the coordinates p of :mod:`mitt.core.map.tangent`.
"""

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import final

import numpy as np

from mitt.core import checks
from mitt.core.arm.arm import Arm
from mitt.core.errors import InputError, ModelError
from mitt.core.fields import brief
from mitt.core.kernels import big_kernel, copy, kernel, view
from mitt.core.map.map_design import MapDesign, check_joints, tangent_of
from mitt.core.map.polynomial import CatchBasis, bend, jets
from mitt.core.map.prediction import time_to_catch
from mitt.core.map.tangent import (
    MapArrays,
    Scratch,
    Tangent,
    catch_angle,
    coordinate,
    expand,
    follow_coupling,
    lift,
    pack,
    scratch_of,
    unfold,
    unpack,
    workspace,
)
from mitt.core.signals import Array, BallState, JointReference, MapStatus, reference_of

#: Singular values of C H^-1 C' below this share of the largest are dropped: C loses rank where
#: phi and its rate are parallel, at the catch (s = 0) for one.
_RANK = 1e-12
#: How far beyond its range a joint's angle cannot be meant any more: a turn [rad].
_TURN = 2.0 * np.pi
#: How far beyond the region it was learned on a map is trusted [rad].
_REGION_GAP = 0.3
#: What maps with the same design, basis and metric have in common, once it has been computed.
_SHARED = ("tangent", "packed", "H_inverse", "window", "work", "start", "trusted")


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class DirectMap:
    """The map f of one arm.

    Attributes:
        arm: The arm.
        design: Catch joint, its angle, kappa, order.
        basis: Monomials of b, over the three free joints.
        alpha: Coefficients of b [rad], shape (m, n).
        H: Metric of the projection of a new throw, shape (m n, m n), positive definite.
        region: Lowest and highest virtual joints at the catches it was learned on [rad], (2, n).
        status: DOMAIN where the last adaptation was refused, the ball being outside l_c's range.
        q_rest: Pose from which the joints that are not free follow [rad], shape (n,); the ready
            pose where None.
    """

    arm: Arm
    design: MapDesign
    basis: CatchBasis
    alpha: Array
    H: Array
    region: Array
    status: MapStatus = MapStatus.INSIDE
    q_rest: Array | None = None

    __repr__ = brief

    def __post_init__(self) -> None:
        """Hold the parts to each other: kernels trust that they fit."""
        for name, part, kind in (
            ("arm", self.arm, Arm),
            ("design", self.design, MapDesign),
            ("basis", self.basis, CatchBasis),
            ("status", self.status, MapStatus),
        ):
            checks.instance(name, part, kind)
        m, n = len(self.basis.powers), self.arm.n
        if max(*self.design.free, self.design.catch_joint) >= n:
            raise ModelError("design", f"joints in 0..{n - 1}", self.design.free)
        if len(self.basis.centre) != 3:
            raise ModelError("basis", "monomials of three joints", len(self.basis.centre))
        size = m * n
        arrays = {
            "alpha": checks.array("alpha", self.alpha, (m, n), finite=True),
            "H": checks.array("H", self.H, (size, size), finite=True),
            "region": checks.numbers("region", checks.array("region", self.region, (2, n))),
        }
        if self.q_rest is not None:
            arrays["q_rest"] = checks.vector("q_rest", self.q_rest, n, finite=True)
        for name, value in arrays.items():
            object.__setattr__(self, name, value)

    def __getstate__(self) -> dict[str, object]:
        """Return the fields; what follows from them is worked out anew."""
        return {field.name: vars(self)[field.name] for field in fields(self)}

    @cached_property
    def tangent(self) -> Tangent:
        """Arrays of l_c."""
        g = tangent_of(self.arm, self.design)
        return g if self.q_rest is None else g._replace(q_rest=self.q_rest)

    @cached_property
    def H_inverse(self) -> Array:  # noqa: N802 (the paper has no letter; ours is H)
        """Inverse of H; ModelError where H is not positive definite."""
        try:
            np.linalg.cholesky(self.H)
            return np.asarray(np.linalg.inv(self.H), np.float64)
        except np.linalg.LinAlgError:
            raise ModelError("H", "a positive definite matrix", "another") from None

    @cached_property
    def packed(self) -> Array:
        """The same in one vector, for the kernels."""
        return pack(self.tangent)

    @cached_property
    def window(self) -> Array:
        """Centre and scale of the polynomial's variables, shape (2, 3)."""
        return np.array([self.basis.centre, self.basis.scale])

    @cached_property
    def work(self) -> Array:
        """Buffers of the kernels."""
        return workspace(self.arm.n, len(self.basis.powers))

    @cached_property
    def start(self) -> Array:
        """Virtual joints in the middle of the region, where the inverse starts [rad], (n,).

        Before anything is learned: the ready pose with the catch joint at its angle.
        """
        known = bool(np.all(np.isfinite(self.region)))
        q: Array = self.region.mean(axis=0) if known else self.arm.q_ready.copy()
        q[self.design.catch_joint] = catch_angle(self.tangent, q)
        follow_coupling(self.tangent, q)
        return q

    @cached_property
    def trusted(self) -> Array:
        """Lowest and highest virtual joints at a catch for which it is trusted [rad], (2, n)."""
        region: Array = self.region + np.array([[-_REGION_GAP], [_REGION_GAP]])
        return region

    @cached_property
    def arrays(self) -> MapArrays:
        """All of it, for the kernels."""
        powers, alpha = self.basis.powers, np.ascontiguousarray(self.alpha)
        return MapArrays(
            self.packed, powers, self.window, alpha, self.start, self.trusted, self.work
        )

    def virtual(self, ball: Array) -> tuple[bool, Array]:
        """Return virtual joints and two derivatives, shape (3, n), of r_o, dr_o, ddr_o, (3, 3)."""
        out = np.zeros((3, self.arm.n))
        out[0] = self.start
        ball = checks.array("ball", ball, (3, 3))
        return bool(virtual(self.packed, ball, out, self.work)), out

    def motion(self, ball: Array) -> tuple[bool, Array]:
        """Return q_d, q_o and their derivatives, shape (6, n), of r_o, dr_o, ddr_o, (3, 3).

        At rest, as outside the domain, where a ball so far away or so fast that numbers overflow.
        """
        rows, ball = np.zeros((6, self.arm.n)), checks.array("ball", ball, (3, 3))
        rows[3] = self.start
        inside = reference(self.arrays, ball, rows)
        if not np.all(np.isfinite(rows)):
            inside, rows[:] = False, 0.0
            rows[0], rows[3] = self.tangent.q_rest, self.tangent.q_rest
        return bool(inside), rows

    def motions(self, path: Array, alpha: Array | None = None) -> Array:
        """Return q_d and its derivatives, (K, 3, n), of r_o, dr_o, ddr_o along a path, (K, 3, 3).

        At rest where the path is outside the domain.

        Args:
            path: Motion of the ball [m ...].
            alpha: Coefficients instead of the map's own [rad], shape (m, n).
        """
        path = checks.array("path", path, (None, 3, 3))
        f, rows, out = self.arrays, np.zeros((6, self.arm.n)), np.empty((len(path), 3, self.arm.n))
        if alpha is not None:
            f = f._replace(alpha=checks.array("alpha", alpha, self.alpha.shape, finite=True))
        references(f, path, rows, out)
        return out

    def to_joints(self, r_o: Array) -> tuple[MapStatus, Array]:
        """Return l_c^-1(r_o) of eq. (6) [rad], shape (n,), and whether r_o is in its domain."""
        still = np.zeros(3)
        inside, rows = self.virtual(np.array([checks.vector("r_o", r_o, 3), still, still]))
        return (MapStatus.INSIDE if inside else MapStatus.DOMAIN), rows[0]

    def to_ball(self, q_o: Array) -> Array:
        """Return l_c(q_o) of eq. (5) [m], shape (3,), for q_o [rad], shape (n,)."""
        r_o: Array = self._expanded("q_o", q_o).point[0]
        return r_o

    def bend(self, q: Array) -> Array:
        """Return g(q) = q + b(q) of eqs. (7) and (11) [rad], shape (n,)."""
        still, q = np.zeros(3), checks.vector("q", q, self.arm.n, finite=True)
        rows = np.array([q, 0.0 * q, 0.0 * q])
        bend(self.basis.jets(coordinates(self.tangent, q), still, still), self.alpha, rows, rows)
        if not np.all(np.isfinite(rows[0])):
            raise InputError("q", "angles near those of the arm [rad]", "far larger ones")
        bent: Array = rows[0]
        return bent

    def catch_gap(self, r_o: Array) -> Array:
        """Return r_e = l(f(r_o)) - r_o of eq. (4) [m], shape (3,).

        It and its rate vanish at the catch, eq. (3), for any alpha (the rate at kappa = 1,
        inward = 0 and match_weight = 0).

        Raises:
            InputError: r_o is outside the domain.
        """
        r_o = checks.vector("r_o", r_o, 3, finite=True)
        gap: Array = self.arm.position(self.bend(self._virtual_joints(r_o))) - r_o
        return gap

    def F(self, r_o: Array) -> Array:  # noqa: N802 (the paper's letter)
        """Return df/dr_o of eq. (15) [rad/m], shape (n, 3).

        Raises:
            InputError: r_o is outside the domain.
        """
        q_o = self._virtual_joints(r_o)
        per_ball = np.linalg.inv(self._expanded("q_o", q_o).J_c.T)
        bent = self.alpha.T @ self.basis.gradient(coordinates(self.tangent, q_o))
        out: Array = (self.tangent.A + bent) @ per_ball
        return out

    def _virtual_joints(self, r_o: Array) -> Array:
        """Return l_c^-1(r_o) [rad], shape (n,); InputError outside the domain."""
        status, q_o = self.to_joints(r_o)
        if status is not MapStatus.INSIDE:
            raise InputError(
                "r_o",
                "a position in the domain of the map",
                np.asarray(r_o).tolist(),
                do="ask to_joints whether it is",
            )
        return q_o

    def _expanded(self, name: str, q_o: Array) -> Scratch:
        """Return buffers of this call's own, with l_c and J_c at virtual joints, shape (n,)."""
        scratch = scratch_of(self.arm.n)
        expand(self.tangent, checks.vector(name, q_o, self.arm.n, finite=True), scratch)
        return scratch

    def reference(self, ball: BallState) -> JointReference:
        """Return q_d = f(r_o) of eq. (1) and its derivatives along a ball's motion.

        A pure function; what it returns is finite whatever the ball.
        """
        ball = checks.instance("ball", ball, BallState)
        motion = np.array([ball.r_o, ball.dr_o, ball.ddr_o])
        inside, rows = self.motion(motion)
        left = np.inf
        if inside:
            left = time_to_catch(self.arrays, rows, motion, ball.drag, ball.led)
        return reference_of(ball.t, rows, inside=inside, time_to_catch=left)

    def equals(self, other: "DirectMap") -> bool:
        """Say whether another map gives the same motions."""
        other = checks.instance("other", other, DirectMap)
        mine, theirs = (
            (f.packed, f.basis.powers, f.window, f.alpha, f.H, f.region) for f in (self, other)
        )
        return all(np.array_equal(a, b) for a, b in zip(mine, theirs, strict=True))

    def on(self, arm: Arm) -> "DirectMap":
        """Return the map for the same arm with other limits."""
        return replace(self, arm=checks.instance("arm", arm, Arm))

    def with_alpha(self, alpha: Array) -> "DirectMap":
        """Return the map with other coefficients [rad], shape (m, n); all else is shared."""
        other = replace(self, alpha=alpha, status=MapStatus.INSIDE)
        other.__dict__.update({k: v for k, v in self.__dict__.items() if k in _SHARED})
        return other

    def adapt(self, ball: BallState, q: Array, dq: Array) -> "DirectMap":
        """Return the map that starts where the arm is, eqs. (8) to (13).

        alpha moves to the point nearest in H's norm that satisfies C alpha = d; outside the
        domain the map is returned as it was, with status DOMAIN.
        """
        alpha = self.adapted(ball, q, dq)
        return replace(self, status=MapStatus.DOMAIN) if alpha is None else self.with_alpha(alpha)

    def adapted(self, ball: BallState, q: Array, dq: Array) -> Array | None:
        """Return alpha of :meth:`adapt` [rad], shape (m, n); None outside the domain."""
        ball = checks.instance("ball", ball, BallState)
        q, dq = (checks.vector(*x, self.arm.n, finite=True) for x in (("q", q), ("dq", dq)))
        if np.any(q < self.arm.q_min - _TURN) or np.any(q > self.arm.q_max + _TURN):
            wanted = f"joints of {', '.join(self.arm.names)}, in their ranges"
            raise InputError("q", wanted, q.tolist(), do="angles are in rad")
        inside, rows = self.virtual(np.array([ball.r_o, ball.dr_o, ball.ddr_o]))
        if not inside:
            return None
        phi = self.basis.jets(*coordinates(self.tangent, rows))
        return project(self.alpha, self.H_inverse, phi[:2], initial_gap(q, dq, rows))


def unlearned(arm: Arm, design: MapDesign) -> DirectMap:
    """Return the map with alpha = 0, q_d = l_c^-1(r_o): where learning starts."""
    check_joints(arm, design)
    free = list(design.free)
    centre = arm.q_ready[free].copy()
    centre[design.free.index(design.catch_joint)] = design.q_catch
    basis = basis_of(design, centre, np.ones(3))
    size = len(basis.powers) * arm.n
    region = np.array([np.full(arm.n, -np.inf), np.full(arm.n, np.inf)])
    alpha = np.zeros((len(basis.powers), arm.n))
    return DirectMap(
        arm=arm, design=design, basis=basis, alpha=alpha, H=np.eye(size), region=region
    )


def coordinates(g: Tangent, q_o: Array) -> Array:
    """Return the coordinates p [rad], (..., 3), of poses or of their rates, shape (..., n)."""
    slope = g.A[g.catch_joint].copy()
    slope[g.catch] = 0.0
    p: Array = q_o[..., list(g.free)].copy()
    p[..., g.catch] -= p @ slope
    return p


def basis_of(design: MapDesign, centre: Array, scale: Array) -> CatchBasis:
    """Return the monomials of a map's b, of coordinates shifted and scaled, shape (3,) each."""
    return CatchBasis(
        design.order,
        design.free.index(design.catch_joint),
        centre,
        scale,
        first_order=design.match_weight > 0.0,
    )


def initial_matrix(phi: Array, n: int) -> Array:
    """Return C of eq. (13), shape (..., r n, m n), for phi and its rates, shape (..., r, m)."""
    C = np.zeros((*phi.shape[:-1], n, phi.shape[-1], n))
    for k in range(n):
        C[..., k, :, k] = phi
    return C.reshape(*phi.shape[:-2], phi.shape[-2] * n, -1)


def initial_gap(q: Array, dq: Array, virtual: Array) -> Array:
    """Return d of eq. (12), what b must make up for at t_0 [rad, rad/s], shape (2n,).

    q_e = f(r_o) - q of eq. (9) is q_o - q + b(q_o), eq. (10); it and its rate vanish, as eq. (8)
    asks, where b and its rate are q - q_o and dq - dq_o.

    Args:
        q: Joint positions at t_0 [rad], shape (n,).
        dq: Joint velocities at t_0 [rad/s], shape (n,).
        virtual: q_o and dq_o at t_0 in the first two rows, shape (2 or more, n).
    """
    return np.concatenate([q - virtual[0], dq - virtual[1]])


def project(alpha: Array, H_inverse: Array, phi: Array, d: Array) -> Array:
    """Return the coefficients nearest to ``alpha`` in H's norm with C alpha = d, eq. (12).

    alpha + H^-1 C' (C H^-1 C')^+ (d - C alpha), least squares where C has lost rank.

    Args:
        alpha: Coefficients [rad], shape (m, n).
        H_inverse: Inverse of the metric, shape (m n, m n).
        phi: Monomials and their rate at t_0, shape (2, m).
        d: q(t_0) - q_o(t_0) and its rate [rad, rad/s], shape (2 n,).
    """
    C = initial_matrix(phi, alpha.shape[1])
    step = answer_to_gap(C, H_inverse) @ (d - C @ alpha.ravel())
    return np.asarray(alpha + step.reshape(alpha.shape))


def answer_to_gap(C: Array, H_inverse: Array) -> Array:
    """Return W = H^-1 C' (C H^-1 C')^+, (..., m n, 2n): the answer of alpha to a gap in d."""
    spread = H_inverse @ np.swapaxes(C, -1, -2)
    gram = C @ spread
    size = np.sqrt(np.maximum(np.diagonal(gram, 0, -2, -1), np.finfo(float).tiny))[..., None, :]
    scaled = gram / (np.swapaxes(size, -1, -2) * size)
    W: Array = (spread / size) @ _pseudo_inverse(scaled) / size
    return W


def _pseudo_inverse(A: Array) -> Array:
    """Return A^+ of symmetric A, (..., k, k); ``np.linalg.pinv`` says it in twice the time."""
    values, axes = np.linalg.eigh(A)
    values, axes = values[..., ::-1], axes[..., ::-1]
    size = np.abs(values)
    good = size > _RANK * size.max(axis=-1, keepdims=True)
    inverse = np.divide(1.0, size, out=np.zeros_like(size), where=good)
    turned = inverse[..., None] * np.swapaxes(axes, -1, -2)
    out: Array = (axes * np.sign(values)[..., None, :]) @ turned
    return out


@kernel
def virtual(packed: Array, ball: Array, rows: Array, work: Array) -> bool:
    """Write q_o, dq_o, ddq_o (3, n) for r_o, dr_o, ddr_o (3, 3); False outside the domain."""
    g = unpack(packed)
    return bool(lift(g, ball, rows, unfold(work, rows.shape[1])))


@big_kernel
def reference(f: MapArrays, ball: Array, rows: Array) -> bool:
    """Write q_d, dq_d, ddq_d, q_o, dq_o, ddq_o (6, n) for r_o, dr_o, ddr_o (3, 3), eq. (1).

    Args:
        f: The map.
        ball: r_o, dr_o, ddr_o, shape (3, 3).
        rows: Result; row 3 is where a Newton inverse starts. Outside the domain: at rest.
    """
    n, g = f.alpha.shape[1], unpack(f.packed)
    w = unfold(f.work, n)
    if not lift(g, ball, view(rows, 3 * n, (3, n)), w):
        rows[:] = 0.0
        copy(g.q_rest, rows[0])
        copy(g.q_rest, rows[3])
        return False
    for a in range(3):
        for d in range(3):
            w.variables[d, a] = coordinate(g, view(rows, (3 + d) * n, (n,)), a)
    centre, scale = view(f.window, 0, (3,)), view(f.window, 3, (3,))
    x, dx = view(w.variables, 0, (3,)), view(w.variables, 3, (3,))
    jets(f.powers, centre, scale, x, dx, view(w.variables, 6, (3,)), w.phi)
    bend(w.phi, f.alpha, view(rows, 3 * n, (3, n)), rows)
    return True


@kernel
def references(f: MapArrays, path: Array, rows: Array, out: Array) -> None:
    """Write the first three rows of :func:`reference` for each ball of a path."""
    for k in range(len(path)):
        copy(f.start, rows[3])
        reference(f, path[k], rows)
        copy(rows[:3], out[k])
