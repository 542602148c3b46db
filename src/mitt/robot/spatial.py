"""Spatial vectors as pairs of three-vectors, in the world frame.

A motion is the velocity at the world's origin and the turning [m/s, rad/s]; a load is a force and
its moment about the world's origin [N, N m].
"""

from typing import TypeAlias

from mitt.jit import kernel
from mitt.robot.vectors import Vec, cross, dot, plus, put_at, vec_at
from mitt.signals import Array

Pair: TypeAlias = tuple[Vec, Vec]


@kernel
def crossed(v: Pair, m: Pair) -> Pair:
    """Return v x m of two spatial motions (velocity at the origin, turning)."""
    return plus(cross(v[1], m[0]), cross(v[0], m[1])), cross(v[1], m[1])


@kernel
def power(m: Pair, f: Pair) -> float:
    """Return the power of a load on a motion."""
    return float(dot(m[0], f[0]) + dot(m[1], f[1]))


@kernel
def plus_pair(a: Pair, b: Pair) -> Pair:
    """Return the sum of two spatial vectors."""
    return plus(a[0], b[0]), plus(a[1], b[1])


@kernel
def pair_at(rows: Array, k: int, at: int) -> Pair:
    """Return two vectors of row k from column ``at``."""
    return vec_at(rows, k, at), vec_at(rows, k, at + 3)


@kernel
def put_pair(rows: Array, k: int, at: int, pair: Pair) -> None:
    """Write two vectors to row k from column ``at``."""
    put_at(rows, k, at, pair[0])
    put_at(rows, k, at + 3, pair[1])
