"""The initial constraint C alpha = d, eqs. (8) to (13), and the projection onto it.

| here    | paper                                  | unit           | shape       |
|---------|----------------------------------------|----------------|-------------|
| ``phi`` | monomials and their rate at t_0        | 1, 1/s         | (2, m)      |
| ``C``   | C of eq. (13) = [phi' (x) I; dphi' (x) I] | 1, 1/s      | (2n, m n)   |
| ``d``   | right side of eq. (12)                 | rad, rad/s     | (2n,)       |

alpha is stacked monomial by monomial: (alpha_1; ...; alpha_m), each of n joints.
"""

import numpy as np

from mitt.signals import Array

#: Singular values of C H^-1 C' below this share of the largest are dropped: C loses rank where
#: phi and its rate are parallel, at the catch (s = 0) for one.
_RANK = 1e-12


def initial_matrix(phi: Array, n: int) -> Array:
    """Return C of eq. (13), shape (2n, m n), for phi and its rate, shape (2, m)."""
    C = np.zeros((2, n, phi.shape[1], n))
    for k in range(n):
        C[:, k, :, k] = phi
    return C.reshape(2 * n, -1)


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
    moved: Array = alpha + (shift(C, H_inverse) @ (d - C @ alpha.ravel())).reshape(alpha.shape)
    return moved


def shift(C: Array, H_inverse: Array) -> Array:
    """Return W = H^-1 C' (C H^-1 C')^+, shape (m n, 2n): the answer of alpha to a gap in d."""
    spread = H_inverse @ C.T
    gram = C @ spread
    size = np.sqrt(np.maximum(np.diag(gram), np.finfo(float).tiny))
    scaled = gram / (size[:, None] * size)
    W: Array = (spread / size) @ _pseudo_inverse(scaled) / size
    return W


def _pseudo_inverse(A: Array) -> Array:
    """Return A^+ of a symmetric A; ``np.linalg.pinv`` says the same in twice the time."""
    values, axes = np.linalg.eigh(A)
    values, axes = values[::-1], axes[:, ::-1]
    size = np.abs(values)
    inverse = np.divide(1.0, size, out=np.zeros_like(size), where=size > _RANK * size.max())
    out: Array = (axes * np.sign(values)) @ (inverse[:, None] * axes.T)
    return out
