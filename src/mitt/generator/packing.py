"""One vector for an arm's tangent map, one for its buffers: two arrays cross into a kernel.

Handing a kernel a named tuple of thirty arrays costs more than the kernel's own work; inside
compiled code the same named tuples are views that cost nothing.
"""

import numpy as np
from numba import njit

from mitt.generator.tangent import Scratch, Tangent
from mitt.robot.chain import Chain, Motion
from mitt.signals import Array

#: Numbers before the arrays: n, i, q_alpha, kappa, planar, three free joints, seven of the plane,
#: inward.
_HEAD = 16


def pack(g: Tangent) -> Array:
    """Return a tangent map as one vector, to be read by :func:`unpack`."""
    n = len(g.q_rest)
    head = [n, g.catch_joint, g.q_catch, g.kappa, float(g.planar), *g.free, *g.plane, g.inward]
    arrays = (g.q_rest, g.chain.tip, g.chain.prismatic, g.chain.p, g.chain.axis, g.chain.R)
    return np.concatenate([np.array(head, dtype=np.float64), *(x.ravel() for x in arrays)])


@njit(cache=True)
def unpack(v: Array) -> Tangent:
    """Return the tangent map whose arrays are views of a packed vector."""
    n = int(v[0])
    a = _HEAD + n
    b = a + 3
    c = b + n
    d = c + 3 * n
    e = d + 3 * n
    chain = Chain(
        v[e : e + 9 * n].reshape(n, 3, 3),
        v[c:d].reshape(n, 3),
        v[d:e].reshape(n, 3),
        v[b:c],
        v[a:b],
    )
    free = (int(v[5]), int(v[6]), int(v[7]))
    planar, plane = v[4] > 0.0, v[8:15]
    return Tangent(chain, free, int(v[1]), v[2], v[3], v[15], v[_HEAD:a], planar, plane)


def workspace(n: int, m: int = 0) -> Array:
    """Return a vector that holds all buffers for ``n`` active joints and ``m`` monomials."""
    return np.zeros(35 * n + 45 + 3 * m)


@njit(cache=True)
def jet_rows(v: Array, n: int, m: int) -> tuple[Array, Array]:
    """Return buffers for the variables of the polynomial, (3, 3), and its monomials, (3, m)."""
    a = 35 * n + 36
    return v[a : a + 9].reshape(3, 3), v[a + 9 : a + 9 + 3 * m].reshape(3, m)


@njit(cache=True)
def unfold(v: Array, n: int) -> Scratch:
    """Return the buffers that are views of a workspace."""
    flat, k, m = 3 * n, 12 * n, 30 * n
    motion = Motion(
        v[0:flat].reshape(n, 3),
        v[flat : 2 * flat].reshape(n, 3),
        v[2 * flat : 3 * flat].reshape(n, 3),
        v[3 * flat : k].reshape(n, 3),
        v[m : m + 9].reshape(3, 3),
        v[k : k + 9 * n].reshape(3, n, 3),
        v[k + 9 * n : m].reshape(3, n, 3),
    )
    a = m + 9
    b = a + 4 * n
    return Scratch(
        motion,
        v[a : a + n],
        v[a + n : a + 2 * n],
        v[a + 2 * n : a + 3 * n],
        v[a + 3 * n : b],
        v[b : b + 9].reshape(3, 3),
        v[b + 9 : b + 18].reshape(3, 3),
        v[b + 18 : b + 27].reshape(3, 3),
    )
