"""Small linear algebra without allocation, shared by triangulation and filter."""

from numba import njit

from mitt.signals import Array


@njit(cache=True)
def inverse(
    a: float, b: float, c: float, d: float, e: float, f: float
) -> tuple[bool, float, float, float, float, float, float]:
    """Return whether [[a, b, c], [b, d, e], [c, e, f]] can be inverted, and its inverse likewise.

    It can if it is positive definite with a condition that leaves digits.
    """
    A, B, C = d * f - e * e, c * e - b * f, b * e - c * d
    det = a * A + b * B + c * C
    scale = a * d * f
    if not (a > 0.0 and a * d > b * b and det > 1e-12 * scale and scale > 0.0):
        return False, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    D, E, F = (a * f - c * c) / det, (b * c - a * e) / det, (a * d - b * b) / det
    return True, A / det, B / det, C / det, D, E, F


@njit(cache=True)
def invert_positive(S: Array, out: Array) -> bool:
    """Write the inverse of a symmetric matrix by cofactors.

    Args:
        S: Symmetric matrix, shape (3, 3).
        out: Result, shape (3, 3).

    Returns:
        Whether ``S`` is positive definite with a condition that leaves digits; if not, ``out``
        is unchanged.
    """
    ok, a, b, c, d, e, f = inverse(S[0, 0], S[0, 1], S[0, 2], S[1, 1], S[1, 2], S[2, 2])
    if ok:
        out[0, 0], out[0, 1], out[0, 2] = a, b, c
        out[1, 0], out[1, 1], out[1, 2] = b, d, e
        out[2, 0], out[2, 1], out[2, 2] = c, e, f
    return bool(ok)
