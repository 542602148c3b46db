"""Small linear algebra without allocation, shared by triangulation and filter."""

from mitt.jit import kernel
from mitt.signals import Array


@kernel
def inverse(
    a: float, b: float, c: float, d: float, e: float, f: float
) -> tuple[bool, float, float, float, float, float, float]:
    """Return whether [[a, b, c], [b, d, e], [c, e, f]] can be inverted, and its inverse likewise.

    It can if it is positive definite with a condition that leaves digits. By elimination: where one
    direction is known a million times worse than the others, cofactors leave no digit.
    """
    p, q = b / a if a > 0.0 else 0.0, c / a if a > 0.0 else 0.0
    d1, e1 = d - b * p, e - b * q
    w = e1 / d1 if d1 > 0.0 else 0.0
    f1 = f - c * q - e1 * w
    if not (a > 0.0 and d1 > 1e-13 * d and f1 > 1e-13 * f):
        return False, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    v = p * w - q
    F = 1.0 / f1
    E, D = -w * F, 1.0 / d1 + w * w * F
    return True, 1.0 / a + p * p / d1 + v * v * F, -p / d1 - v * w * F, v * F, D, E, F


@kernel
def invert_positive(S: Array, out: Array) -> bool:
    """Write the inverse of a symmetric matrix, shape (3, 3); return whether there is one.

    That is as for :func:`inverse`; if there is none, ``out`` is unchanged.
    """
    ok, a, b, c, d, e, f = inverse(S[0, 0], S[0, 1], S[0, 2], S[1, 1], S[1, 2], S[2, 2])
    if ok:
        out[0, 0], out[0, 1], out[0, 2] = a, b, c
        out[1, 0], out[1, 1], out[1, 2] = b, d, e
        out[2, 0], out[2, 1], out[2, 2] = c, e, f
    return bool(ok)
