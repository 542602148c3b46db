"""One vector for an arm's tangent map, one for its buffers: two arrays cross into a kernel.

Handing a kernel a named tuple of thirty arrays costs more than the kernel's own work; inside
compiled code the same named tuples are views that cost nothing.
"""

import numpy as np
from numba.extending import register_jitable

from mitt.generator.tangent import Scratch, Tangent
from mitt.robot.kinematics import Chain, Motion
from mitt.signals import Array
from mitt.views import view

#: Numbers before the arrays: n, i, q_alpha, kappa, planar, three free joints, seven of the plane,
#: inward, place of i among the free joints.
_HEAD = 17


def pack(g: Tangent) -> Array:
    """Return a tangent map as one vector, to be read by :func:`unpack`."""
    n = len(g.q_rest)
    head = [n, g.catch_joint, g.q_catch, g.kappa, float(g.planar), *g.free, *g.plane, g.inward,
            g.catch]  # fmt: skip
    arrays = (g.q_rest, g.A, g.chain.tip, g.chain.prismatic, g.chain.p, g.chain.axis, g.chain.R)
    return np.concatenate([np.array(head, dtype=np.float64), *(x.ravel() for x in arrays)])


@register_jitable
def unpack(v: Array) -> Tangent:
    """Return the tangent map whose arrays are views of a packed vector."""
    n = int(v[0])
    at = _HEAD + n
    a = at + 3 * n
    b = a + 3
    c = b + n
    d = c + 3 * n
    e = d + 3 * n
    chain = Chain(
        view(v, e, (n, 3, 3)), view(v, c, (n, 3)), view(v, d, (n, 3)), view(v, b, (n,)),
        view(v, a, (3,)),
    )  # fmt: skip
    free, rest = (int(v[5]), int(v[6]), int(v[7])), view(v, _HEAD, (n,))
    return Tangent(
        chain, free, int(v[1]), int(v[16]), v[2], v[3], v[15], rest, view(v, at, (n, 3)),
        v[4] > 0.0, view(v, 8, (7,)),
    )  # fmt: skip


def workspace(n: int, m: int = 0) -> Array:
    """Return a vector that holds all buffers for ``n`` active joints and ``m`` monomials."""
    return np.zeros(38 * n + 64 + 3 * m)


@register_jitable
def flight_rows(v: Array, n: int) -> tuple[Array, Array, Array]:
    """Return buffers for a ball's state, (10,), its motion, (3, 3), and virtual joints, (3, n)."""
    a = 35 * n + 36
    return view(v, a, (10,)), view(v, a + 10, (3, 3)), view(v, a + 19, (3, n))


@register_jitable
def jet_rows(v: Array, n: int, m: int) -> tuple[Array, Array]:
    """Return buffers for the variables of the polynomial, (3, 3), and its monomials, (3, m)."""
    a = 38 * n + 55
    return view(v, a, (3, 3)), view(v, a + 9, (3, m))


@register_jitable
def unfold(v: Array, n: int) -> Scratch:
    """Return the buffers that are views of a workspace."""
    flat, k, m = 3 * n, 12 * n, 30 * n
    motion = Motion(
        view(v, 0, (n, 3)), view(v, flat, (n, 3)), view(v, 2 * flat, (n, 3)),
        view(v, 3 * flat, (n, 3)), view(v, m, (3, 3)), view(v, k, (3, n, 3)),
        view(v, k + 9 * n, (3, n, 3)),
    )  # fmt: skip
    a = m + 9
    b = a + 4 * n
    return Scratch(
        motion, view(v, a, (n,)), view(v, a + n, (n,)), view(v, a + 2 * n, (n,)),
        view(v, a + 3 * n, (n,)), view(v, b, (3, 3)), view(v, b + 9, (3, 3)),
        view(v, b + 18, (3, 3)),
    )  # fmt: skip
