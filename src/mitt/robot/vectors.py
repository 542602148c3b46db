"""Three-vectors and rotations as tuples: what compiled kernels keep in registers.

Views of arrays cost reference counts inside compiled loops; tuples of floats cost nothing.
"""

from typing import TypeAlias

import numpy as np

from mitt.jit import kernel
from mitt.signals import Array

Vec: TypeAlias = tuple[float, float, float]
#: A rotation row by row.
Mat: TypeAlias = tuple[float, float, float, float, float, float, float, float, float]

ZERO: Vec = (0.0, 0.0, 0.0)
IDENTITY: Mat = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


@kernel
def row(rows: Array, k: int) -> Vec:
    """Return row k of an array of shape (n, 3)."""
    return rows[k, 0], rows[k, 1], rows[k, 2]


@kernel
def put(rows: Array, k: int, v: Vec) -> None:
    """Write row k of an array of shape (n, 3)."""
    rows[k, 0], rows[k, 1], rows[k, 2] = v


@kernel
def cross(a: Vec, b: Vec) -> Vec:
    """Return a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def plus(a: Vec, b: Vec) -> Vec:
    """Return a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@kernel
def minus(a: Vec, b: Vec) -> Vec:
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@kernel
def times(s: float, a: Vec) -> Vec:
    """Return s a."""
    return s * a[0], s * a[1], s * a[2]


@kernel
def dot(a: Vec, b: Vec) -> float:
    """Return a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def rotate(R: Mat, v: Vec) -> Vec:
    """Return R v."""
    return (
        R[0] * v[0] + R[1] * v[1] + R[2] * v[2],
        R[3] * v[0] + R[4] * v[1] + R[5] * v[2],
        R[6] * v[0] + R[7] * v[1] + R[8] * v[2],
    )


@kernel
def unturn(R: Mat, v: Vec) -> Vec:
    """Return R' v: a vector as the turned frame sees it."""
    return (
        R[0] * v[0] + R[3] * v[1] + R[6] * v[2],
        R[1] * v[0] + R[4] * v[1] + R[7] * v[2],
        R[2] * v[0] + R[5] * v[1] + R[8] * v[2],
    )


@kernel
def compose(A: Mat, B: Mat) -> Mat:
    """Return A B."""
    return (
        A[0] * B[0] + A[1] * B[3] + A[2] * B[6],
        A[0] * B[1] + A[1] * B[4] + A[2] * B[7],
        A[0] * B[2] + A[1] * B[5] + A[2] * B[8],
        A[3] * B[0] + A[4] * B[3] + A[5] * B[6],
        A[3] * B[1] + A[4] * B[4] + A[5] * B[7],
        A[3] * B[2] + A[4] * B[5] + A[5] * B[8],
        A[6] * B[0] + A[7] * B[3] + A[8] * B[6],
        A[6] * B[1] + A[7] * B[4] + A[8] * B[7],
        A[6] * B[2] + A[7] * B[5] + A[8] * B[8],
    )


@kernel
def turn(axis: Vec, angle: float) -> Mat:
    """Return the rotation about a unit axis (Rodrigues)."""
    x, y, z = axis
    c, s = np.cos(angle), np.sin(angle)
    u = 1.0 - c
    return (
        c + x * x * u, x * y * u - z * s, x * z * u + y * s,
        x * y * u + z * s, c + y * y * u, y * z * u - x * s,
        x * z * u - y * s, y * z * u + x * s, c + z * z * u,
    )  # fmt: skip


@kernel
def matrix(rows: Array, k: int) -> Mat:
    """Return matrix k of an array of shape (n, 3, 3)."""
    return (
        rows[k, 0, 0], rows[k, 0, 1], rows[k, 0, 2],
        rows[k, 1, 0], rows[k, 1, 1], rows[k, 1, 2],
        rows[k, 2, 0], rows[k, 2, 1], rows[k, 2, 2],
    )  # fmt: skip


@kernel
def vec_at(rows: Array, k: int, column: int) -> Vec:
    """Return three numbers of row k from a column on."""
    return rows[k, column], rows[k, column + 1], rows[k, column + 2]


@kernel
def put_at(rows: Array, k: int, column: int, v: Vec) -> None:
    """Write a vector to row k from a column on."""
    rows[k, column], rows[k, column + 1], rows[k, column + 2] = v


@kernel
def mat_at(rows: Array, k: int, column: int) -> Mat:
    """Return nine numbers of row k from a column on."""
    return (
        rows[k, column], rows[k, column + 1], rows[k, column + 2],
        rows[k, column + 3], rows[k, column + 4], rows[k, column + 5],
        rows[k, column + 6], rows[k, column + 7], rows[k, column + 8],
    )  # fmt: skip
