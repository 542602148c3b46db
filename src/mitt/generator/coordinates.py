"""Coordinates p of the virtual arm (:mod:`mitt.generator.tangent`), and monomials over them.

The variables of b are these coordinates: the angles of the free joints, but for the catch joint's,
from which its slope is taken away.
"""

from mitt.generator.design import MapDesign
from mitt.generator.polynomial import CatchBasis
from mitt.generator.tangent import Tangent
from mitt.signals import Array


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
        design.order, design.free.index(design.catch_joint), centre, scale,
        first_order=design.match_weight > 0.0,
    )  # fmt: skip
