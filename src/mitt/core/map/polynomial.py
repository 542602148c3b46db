"""The polynomial b(q) that bends the trajectory between its two ends.

Eq. (11) writes b as a sum of monomials, each with the factor (q_i - q_alpha)^2, which
makes b and its first derivatives vanish at the catch, so that eq. (3) holds whatever the
coefficients are. Variables are shifted and scaled, which spans the same space and conditions
better; the catch joint is shifted by q_alpha itself, so the factor stays exact.

Where the drives cannot match the ball's velocity, terms of first order in q_i - q_alpha may be
added. The position still matches whatever the coefficients are, and the relative velocity becomes
part of what is learned (:mod:`mitt.core.map.learn`).

| here         | paper              | unit       | shape   |
|--------------|--------------------|------------|---------|
| ``q``        | q                  | rad        | (n,)    |
| ``centre``   | q_alpha at joint i | rad        | (n,)    |
| ``alpha``    | alpha_(j1...jn)    | rad        | (m, n)  |
| ``phi``      | q1^j1 ... qn^jn    | 1 (scaled) | (m,)    |
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray

from mitt.core import checks
from mitt.core.errors import ModelError
from mitt.core.kernels import kernel
from mitt.core.signals import Array

#: Highest degree of a map's polynomial: 120 monomials of three joints.
MOST_ORDER = 9


@dataclass(frozen=True, eq=False)
class CatchBasis:
    """Monomials of total degree at most ``order``, zero to first or second order at the catch.

    Attributes:
        order: Degree N of the expansion; eq. (11) keeps j1 + ... + jn <= N - 2.
        catch_joint: Index i of the catch joint among the variables, from 0.
        centre: Shift of each variable [rad], shape (n,); q_alpha at the catch joint.
        scale: Scale of each variable [rad], shape (n,).
        first_order: Whether there are terms of first order in q_i - q_alpha too, linear in the
            other variables, so that b-dot need not vanish at the catch.
        lowest: Power of q_i - q_alpha that each monomial has: 2, or 3 where accelerations match.
        across: Highest degree in the other variables together; any if left out.
    """

    order: int
    catch_joint: int
    centre: Array
    scale: Array
    first_order: bool = False
    lowest: int = 2
    across: int | None = None

    def __post_init__(self) -> None:
        """Refuse a basis without terms, without its catch joint, or with a void scale."""
        centre = checks.array("centre", self.centre, (None,), finite=True)
        scale = checks.vector("scale", self.scale, len(centre), finite=True)
        if not np.all(scale > 0.0):
            raise ModelError("scale", f"{len(centre)} numbers above 0", scale)
        order = checks.whole("order", self.order)
        if not 2 <= order <= MOST_ORDER:
            raise ModelError("order", f"a degree in 2..{MOST_ORDER}", order)
        catch_joint = checks.whole("catch_joint", self.catch_joint)
        if not 0 <= catch_joint < len(centre):
            raise ModelError("catch_joint", f"an index in 0..{len(centre) - 1}", catch_joint)
        checks.instance("first_order", self.first_order, bool)
        fields = {"order": order, "catch_joint": catch_joint, "centre": centre, "scale": scale}
        for name, value in fields.items():
            object.__setattr__(self, name, value)

    @cached_property
    def powers(self) -> NDArray[np.int64]:
        """Exponents, shape (m, n), with the extra powers of the catch joint: two, or one."""
        degrees, i = range(self.order - self.lowest + 1), self.catch_joint
        most = self.order - self.lowest
        rows = [j for j in product(degrees, repeat=len(self.centre)) if sum(j) <= most]
        if self.across is not None:
            rows = [j for j in rows if sum(j) - j[i] <= self.across]
        powers = np.array(rows, dtype=np.int64)
        first = powers[(powers.sum(axis=1) <= 1) & (powers[:, i] == 0)]
        powers[:, i] += self.lowest
        first[:, i] += 1
        return np.concatenate([powers, first]) if self.first_order else powers

    def jets(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Return phi, its first and its second time derivative along a motion, shape (3, m)."""
        n, out = len(self.centre), np.empty((3, len(self.powers)))
        motion = (checks.vector(*x, n) for x in (("q", q), ("dq", dq), ("ddq", ddq)))
        jets(self.powers, self.centre, self.scale, *motion, out)
        return out

    def gradient(self, q: Array) -> Array:
        """Return d phi / d q [1/rad], shape (m, n)."""
        n = len(self.centre)
        still = np.zeros(n)
        return np.column_stack([self.jets(q, e, still)[1] for e in np.eye(n)])


@kernel
def jets(
    powers: NDArray[np.int64],
    centre: Array,
    scale: Array,
    q: Array,
    dq: Array,
    ddq: Array,
    out: Array,
) -> None:
    """Write the monomials and their two time derivatives, one monomial a column of (3, m).

    Each factor x^e is carried as a jet (value, first, second derivative in time), and jets are
    multiplied: (ab)'' = a''b + 2a'b' + ab''.
    """
    m, n = powers.shape
    for a in range(m):
        out[0, a], out[1, a], out[2, a] = 1.0, 0.0, 0.0
    for k in range(n):
        x, dx, ddx = (q[k] - centre[k]) / scale[k], dq[k] / scale[k], ddq[k] / scale[k]
        for a in range(m):
            e = powers[a, k]
            if e == 0:
                continue
            below2 = 1.0 if e > 1 else 0.0
            for _ in range(e - 2):
                below2 *= x
            below1 = below2 * x if e > 1 else 1.0
            g, dg = below1 * x, e * below1 * dx
            ddg = e * (e - 1) * below2 * dx * dx + e * below1 * ddx
            f, df, ddf = out[0, a], out[1, a], out[2, a]
            out[0, a], out[1, a] = f * g, df * g + f * dg
            out[2, a] = ddf * g + 2.0 * df * dg + f * ddg


@kernel
def bend(phi: Array, alpha: Array, q: Array, out: Array) -> None:
    """Write q + b(q) and its two time derivatives, eqs. (7) and (11), shape (3 or more, n).

    Args:
        phi: Monomials and their two time derivatives, shape (3, m).
        alpha: Coefficients [rad], shape (m, n).
        q: Joint angles and their two time derivatives [rad ...], shape (3, n).
        out: Result, may be ``q``.
    """
    m, n = alpha.shape
    for k in range(n):  # three sums at a time: each waits for its own last addition only
        b0, b1, b2 = q[0, k], q[1, k], q[2, k]
        for a in range(m):
            b0 += phi[0, a] * alpha[a, k]
            b1 += phi[1, a] * alpha[a, k]
            b2 += phi[2, a] * alpha[a, k]
        out[0, k], out[1, k], out[2, k] = b0, b1, b2
