"""Whether balls come to where a map can meet them: l_c^-1 early on their way, for many candidates.

A ball has to be in the domain of l_c^-1 (:mod:`mitt.generator.tangent`) from where the arm starts.
"""

import numpy as np

from mitt.ball.flight import advance
from mitt.design.balls import Balls
from mitt.design.rows import Rows
from mitt.generator.tangent import Tangent, invert, scratch_of
from mitt.robot.arm import Arm
from mitt.signals import Array

#: Time before the catch at which balls are looked at [s]: arms start about then.
_EARLY = 0.42
#: Drag of the balls [1/m]; it matters little in that time.
_DRAG = 0.04
#: The balls: speed and descent from the least (-1) to the most (1), as in ``Balls.velocity``.
_BALLS = ((-1.0, 1.0), (1.0, -1.0))


def share_inside(whole: Arm, balls: Balls, rows: Rows) -> Array:
    """Return which share of some balls is in the domain early on its way, shape (B,).

    Args:
        whole: The arm with all joints active.
        balls: What is to be caught.
        rows: Candidates.
    """
    ways = [_before(balls.velocity(faster, 0.0, steeper)) for faster, steeper in _BALLS]
    scratch, inside = scratch_of(whole.n), np.zeros(len(rows.q))
    for k in range(len(rows.q)):
        tangent = _tangent(whole, rows, k)
        inside[k] = np.mean([invert(tangent, rows.tip[k] + x, rows.q[k].copy(), scratch)
                             for x in ways])  # fmt: skip
    return inside


def _before(v: Array) -> Array:
    """Return where a ball was early on its way, seen from where it is now [m], shape (3,)."""
    r, dr = np.zeros(3), v.copy()
    advance(r, dr, _DRAG, -_EARLY)
    return r


def _tangent(whole: Arm, rows: Rows, k: int) -> Tangent:
    """Return the map l_c of a candidate, over all joints of the arm."""
    q, A, free = rows.q[k], rows.A[k], rows.free[k]
    order = np.argsort(free)
    a, b, c = free[order].tolist()
    i = int(free[2])
    return Tangent(
        chain=whole.chain, free=(a, b, c), catch_joint=i, catch=int(np.argmax(order == 2)),
        q_catch=float(q[i] - A[i, :2] @ q[free[:2]]), kappa=float(rows.kappa[k]),
        inward=float(rows.inward[k]), q_rest=q, A=np.ascontiguousarray(A[:, order]), planar=False,
        plane=np.zeros(7),
    )  # fmt: skip
