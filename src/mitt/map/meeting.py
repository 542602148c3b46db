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
from typing import final

import numpy as np

from mitt import checks
from mitt.arm.arm import Arm
from mitt.errors import ModelError
from mitt.fields import brief
from mitt.map.mapping import answer_to_gap, initial_matrix
from mitt.map.polynomial import CatchBasis, bend
from mitt.map.reach import Reach, ReachScratch, reach_of, reach_scratch, reach_target
from mitt.signals import Array

#: Power of s that each monomial of b has: position, velocity and acceleration match.
_LOWEST = 3
#: Share of the trace of a metric that is added to its diagonal.
_RIDGE = 1e-9


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class MeetingMap:
    """The map of one arm.

    Attributes:
        arm: The arm.
        free: Three, five or six joints that bring the tool to the target: :mod:`mitt.map.reach`.
        frame: Columns: where the tool's x, y and z axis are to point, shape (3, 3); of three free
            joints it says nothing.
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
    def _work(self) -> ReachScratch:
        """Buffers of the kernels."""
        work = reach_scratch(self.reach)
        work.frame[:] = self.frame
        return work

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
        return bool(reach_target(self.reach, target, out, self._work)), out

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
        inside, virtual = self.virtual(target, start)
        if not inside:
            return None
        rows = np.zeros((6, self.arm.n))
        rows[3:] = virtual
        bend(self.jets(virtual, s, T), self.alpha, virtual, rows)
        return rows

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
        return replace(self, alpha=self.alpha + step.reshape(self.alpha.shape))


def unlearned_meeting(
    arm: Arm, free: tuple[int, ...], *, frame: Array | None = None,
    coupling: Array | None = None, order: int = 7, across: int = 0,
) -> MeetingMap:  # fmt: skip
    """Return the map with alpha = 0 and a metric that keeps accelerations small.

    Args:
        arm: The arm.
        free: As in :class:`MeetingMap`.
        frame: Where the tool's axes are to point; as in the ready pose if left out.
        coupling: As in :class:`MeetingMap`.
        order: Degree of b in s and p together.
        across: Degree of b in p. What b says of p answers to the errors of the estimate, too.
    """
    centre, scale = np.append(arm.q_ready[list(free)], 0.0), np.ones(len(free) + 1)
    basis = CatchBasis(order, len(free), centre, scale, lowest=_LOWEST, across=across)
    m, n = len(basis.powers), arm.n
    bent, still = np.zeros((m, m)), np.zeros((3, len(free) + 1))
    still[0], still[1, -1] = centre, -1.0
    for s in np.linspace(0.0, 1.0, 40):  # the square of the second derivative, over the way
        still[0, -1] = s
        rate = basis.jets(*still)[2]
        bent += np.outer(rate, rate) / 40.0
    metric = np.kron(bent, np.diag(arm.tau_max.max() / arm.tau_max))
    return MeetingMap(
        arm=arm, free=free, basis=basis, alpha=np.zeros((m, n)), coupling=coupling,
        frame=arm.orientation(arm.q_ready) if frame is None else frame,
        H=metric + _RIDGE * np.trace(metric) / (m * n) * np.eye(m * n),
    )  # fmt: skip
