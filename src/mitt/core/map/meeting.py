"""The map that meets a target within reach: the distance to go is a clock.

q_d = f(r_o, s) = l^-1(r_o) + b(l^-1(r_o), s) with s = (t_c - t) / T: 1 when the arm starts, 0 when
it meets the target. Each monomial of b has the factor s^3, so that at the end position, velocity
and acceleration of the tool are those of the target *whatever the target does and whatever the
coefficients are*; and b dies as s^3, so that what the target does shortly before is followed, not
planned anew. After the end s stays 0, and the tool stays with the target.

As eq. (12) does for a ball, the coefficients of each meeting start the motion where the arm is, in
position, velocity and acceleration: the nearest to the learned ones in the metric of the cost.

| here       | meaning                                                        | unit  | shape   |
|------------|----------------------------------------------------------------|-------|---------|
| ``s``      | share of the time to go                                        | 1     |         |
| ``alpha``  | coefficients of b, monomial by monomial                        | rad   | (m, n)  |
| ``phi``    | monomials in s and p, and two derivatives in time              | 1 ... | (3, m)  |
| ``target`` | r_o, dr_o, ddr_o                                               | m ... | (3, 3)  |
| ``rows``   | q_d, dq_d, ddq_d, q_o, dq_o, ddq_o                             | rad ... | (6, n) |
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, final

import numpy as np
from numpy.typing import NDArray

from mitt.core import checks
from mitt.core.arm.arm import Arm
from mitt.core.errors import ModelError
from mitt.core.fields import brief
from mitt.core.kernels import kernel
from mitt.core.map.mapping import answer_to_gap, initial_matrix
from mitt.core.map.polynomial import CatchBasis, bend, jets
from mitt.core.map.reach import Reach, ReachScratch, reach_of, reach_scratch, reach_target
from mitt.core.signals import Array

#: Power of s that each monomial of b has: position, velocity and acceleration match; and degree of
#: b in s and p together.
_LOWEST = 3
_ORDER = 7
#: Instants of the way at which the metric weighs b and its rates in s, and the weights of their
#: squares: where accelerations and jerks are bounded those count, else accelerations and speeds.
_GRID = 81
_WEIGHTS = {True: np.array([0.0, 0.0, 1.0, 0.003]), False: np.array([0.0, 30.0, 1.0, 0.0])}
#: Share of the trace of a metric that is added to its diagonal.
_RIDGE = 1e-9
#: Coefficients of 1, x, ... x^5 by place, speed, acceleration at x = 0 and at x = 1.
_QUINTIC = np.linalg.inv(
    np.array(
        [
            [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 2.0, 0.0, 0.0, 0.0],
            [1.0, 1.0, 1.0, 1.0, 1.0, 1.0],
            [0.0, 1.0, 2.0, 3.0, 4.0, 5.0],
            [0.0, 0.0, 2.0, 6.0, 12.0, 20.0],
        ]
    )
)


class MeetingArrays(NamedTuple):
    """A meeting map as arrays, but for its coefficients, and the buffers of its kernels."""

    reach: Reach
    powers: NDArray[np.int64]  # (m, k + 1) of the monomials
    centre: Array  # (k + 1,)
    scale: Array  # (k + 1,)
    p: Array  # (3, k + 1) the free joints' angles and s, and two derivatives
    phi: Array  # (3, m)
    scratch: ReachScratch


@kernel
def meet(f: MeetingArrays, alpha: Array, target: Array, clock: Array, rows: Array) -> bool:
    """Write q_d, q_o and their derivatives of a target's motion.

    Args:
        f: The map, whose buffers are overwritten.
        alpha: Its coefficients [rad], shape (m, n).
        target: Motion of the target [m ...], shape (3, 3).
        clock: s and its rate, shape (2,).
        rows: Result [rad ...], shape (6, n); row 3 is the pose from which the inverse starts.

    Returns:
        False outside the domain.
    """
    virtual, k = rows[3:], len(f.reach.free)
    if not reach_target(f.reach, target, virtual, f.scratch):
        return False
    for d in range(3):
        for a in range(k):
            f.p[d, a] = virtual[d, f.reach.free[a]]
    f.p[0, k], f.p[1, k], f.p[2, k] = clock[0], clock[1], 0.0
    jets(f.powers, f.centre, f.scale, f.p[0], f.p[1], f.p[2], f.phi)
    bend(f.phi, alpha, virtual, rows)
    return True


@kernel
def meet_along(f: MeetingArrays, alpha: Array, path: Array, clock: Array, rows: Array) -> int:
    """Write the same for K instants in their order, shape (K, 6, n); return how many are inside.

    The inverse goes on from each instant to the next, and from ``rows[0, 3]`` at first.
    """
    for t in range(len(path)):
        if t > 0:
            rows[t, 3] = rows[t - 1, 3]
        if not meet(f, alpha, path[t], clock[t], rows[t]):
            return t
    return len(path)


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class MeetingMap:
    """The map of one arm.

    Attributes:
        arm: The arm.
        free: Three, five or six joints that bring the tool to the target:
        :mod:`mitt.core.map.reach`. frame: Columns: where the tool's x, y and z axis are to point,
            shape (3, 3); of three free joints it says nothing.
        basis: Monomials of b in the free joints' angles and, last, in s.
        alpha: Coefficients of b [rad], shape (m, n).
        H: Metric in which a new start is answered, shape (m n, m n), positive definite.
        coupling: How far each further joint turns per free one, shape (n - k, k).
    """

    arm: Arm
    free: tuple[int, ...]
    frame: Array
    basis: CatchBasis
    alpha: Array
    H: Array
    coupling: Array | None = None

    __repr__ = brief

    def __post_init__(self) -> None:
        """Hold the parts to each other."""
        m, n = len(self.basis.powers), self.arm.n
        if self.basis.lowest != _LOWEST or len(self.basis.centre) != len(self.free) + 1:
            raise ModelError("basis", f"{_LOWEST} powers of s, the last variable", "another")
        arrays = {
            "frame": checks.array("frame", self.frame, (3, 3), finite=True),
            "alpha": checks.array("alpha", self.alpha, (m, n), finite=True),
            "H": checks.array("H", self.H, (m * n, m * n), finite=True),
        }
        for name, value in arrays.items():
            object.__setattr__(self, name, value)

    @cached_property
    def reach(self) -> Reach:
        """Arrays of l^-1."""
        return reach_of(self.arm, self.free, self.coupling)

    @cached_property
    def arrays(self) -> MeetingArrays:
        """The map as its kernels take it."""
        m, k = self.basis.powers.shape
        scratch = reach_scratch(self.reach)
        scratch.frame[:] = self.frame
        basis = self.basis
        return MeetingArrays(
            self.reach,
            basis.powers,
            basis.centre,
            basis.scale,
            np.zeros((3, k)),
            np.zeros((3, m)),
            scratch,
        )

    @cached_property
    def H_inverse(self) -> Array:  # noqa: N802 (the paper has no letter; ours is H)
        """Inverse of H."""
        return np.asarray(np.linalg.inv(self.H), np.float64)

    def virtual(self, target: Array, start: Array | None = None) -> tuple[bool, Array]:
        """Return q_o = l^-1(r_o) and two derivatives, shape (3, n), and whether there are any.

        Args:
            target: Motion of the target [m ...], shape (3, 3).
            start: Pose from which the inverse starts [rad], shape (n,); the ready pose if left out.
        """
        out = np.zeros((3, self.arm.n))
        out[0] = self.arm.q_ready if start is None else start
        target = checks.array("target", target, (3, 3))
        return bool(reach_target(self.reach, target, out, self.arrays.scratch)), out

    def jets(self, virtual: Array, s: float, T: float) -> Array:
        """Return phi and two derivatives in time, shape (3, m), of virtual joints, (3, n).

        Args:
            virtual: q_o, dq_o, ddq_o.
            s: Share of the time to go; 0 once the target is met.
            T: Time from start to meeting [s].
        """
        p = np.zeros((3, len(self.free) + 1))
        p[:, :-1] = virtual[:, list(self.free)]
        p[:2, -1] = max(s, 0.0), (-1.0 / T if s > 0.0 else 0.0)
        return self.basis.jets(*p)

    def motion(self, target: Array, s: float, T: float, start: Array | None = None) -> Array | None:
        """Return q_d, q_o and their derivatives, shape (6, n); None outside the domain.

        Args:
            target: Motion of the target [m ...], shape (3, 3).
            s: Share of the time to go.
            T: Time from start to meeting [s].
            start: As of :meth:`virtual`.
        """
        target = checks.array("target", target, (3, 3))
        found = self.motion_along(target[None], np.array([s]), T, start)
        return None if found is None else found[0]

    def motion_along(
        self, path: Array, s: Array, T: float, start: Array | None = None
    ) -> Array | None:
        """Return the same at K instants of one motion, shape (K, 6, n); None outside the domain.

        Args:
            path: Motion of the target at each [m ...], shape (K, 3, 3).
            s: Share of the time to go at each, shape (K,).
            T: Time from start to meeting [s].
            start: As of :meth:`virtual`.
        """
        rows = np.zeros((len(path), 6, self.arm.n))
        rows[0, 3] = self.arm.q_ready if start is None else start
        clock = np.stack([np.maximum(s, 0.0), np.where(s > 0.0, -1.0 / T, 0.0)], axis=1)
        inside = meet_along(self.arrays, self.alpha, path, clock, rows)
        return rows if inside == len(path) else None

    def adapt(self, target: Array, state: Array, T: float) -> "MeetingMap | None":
        """Return the map that starts where the arm is; None where the target is out of reach.

        Args:
            target: Motion of the target [m ...], shape (3, 3).
            state: q, dq, ddq of the arm [rad ...], shape (3, n).
            T: Time from start to meeting [s].
        """
        inside, virtual = self.virtual(target)
        if not inside:
            return None
        C = initial_matrix(self.jets(virtual, 1.0, T), self.arm.n)
        gap = (state - virtual).ravel() - C @ self.alpha.ravel()
        step = answer_to_gap(C, self.H_inverse) @ gap
        other = replace(self, alpha=self.alpha + step.reshape(self.alpha.shape))
        kept = ("reach", "arrays", "H_inverse")  # nothing of it rests on alpha
        other.__dict__.update({name: getattr(self, name) for name in kept})
        return other


def interpolate_motion(motion: Array, T: float, count: int) -> Array:
    """Return a motion through one at even instants, by polynomials of fifth order in between.

    Args:
        motion: q, dq, ddq at K instants [rad ...], shape (K, 3, n).
        T: Time from the first to the last [s].
        count: Even instants that are asked for, from the first to the last.

    Returns:
        q, dq, ddq at those, shape (count, 3, n).
    """
    step, at = T / (len(motion) - 1), np.linspace(0.0, len(motion) - 1.0, count)
    k = np.minimum(at.astype(int), len(motion) - 2)
    scaled = motion * np.array([1.0, step, step**2])[:, None]
    powers = np.vander(at - k, 6, increasing=True)
    rates = np.zeros((3, *powers.shape))
    rates[0] = powers
    for d in (1, 2):
        rates[d, :, 1:] = np.arange(1, 6) * rates[d - 1, :, :-1]
    ends = np.concatenate([scaled[k], scaled[k + 1]], axis=1)
    out: Array = np.einsum("dte,ten->tdn", rates @ _QUINTIC, ends)
    out /= np.array([1.0, step, step**2])[:, None]
    return out


def unlearned_meeting(
    arm: Arm,
    free: tuple[int, ...],
    *,
    frame: Array | None = None,
    coupling: Array | None = None,
    across: int = 0,
) -> MeetingMap:
    """Return the map with alpha = 0 and a metric that keeps small what the arm's limits bound.

    Nothing is learned: coefficients learned by eq. (22) over 80 targets, with their metric, asked
    100 others for 1.04 (UR5e), 1.11 (iiwa 14) and 1.48 times (FR3) the largest share of a limit.

    Args:
        arm: The arm.
        free: As in :class:`MeetingMap`.
        frame: Where the tool's axes are to point; as in the ready pose if left out.
        coupling: As in :class:`MeetingMap`.
        across: Degree of b in p. What b says of p answers to the errors of the estimate, too.
    """
    centre, scale = np.append(arm.q_ready[list(free)], 0.0), np.ones(len(free) + 1)
    basis = CatchBasis(_ORDER, len(free), centre, scale, lowest=_LOWEST, across=across)
    m, n = len(basis.powers), arm.n
    still, jets = np.zeros((3, len(free) + 1)), np.zeros((_GRID, 4, m))
    still[0], still[1, -1] = centre, -1.0
    for row, s in zip(jets, np.linspace(0.0, 1.0, _GRID), strict=True):
        still[0, -1] = s
        row[:3] = basis.jets(*still)
    jets[:, 3] = np.gradient(jets[:, 2], 1.0 / (_GRID - 1), axis=0)
    weight = _WEIGHTS[bool(arm.limits.smooth)]
    bent = np.einsum("d,tda,tdb->ab", weight, jets, jets) / _GRID
    metric = np.kron(bent, np.diag(arm.tau_max.max() / arm.tau_max))
    return MeetingMap(
        arm=arm,
        free=free,
        basis=basis,
        alpha=np.zeros((m, n)),
        coupling=coupling,
        frame=arm.orientation(arm.q_ready) if frame is None else frame,
        H=metric + _RIDGE * np.trace(metric) / (m * n) * np.eye(m * n),
    )
