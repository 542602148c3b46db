"""The rest of a flight in virtual joints: all that the way to the catch depends on besides alpha.

| here      | meaning                                                  | unit         | shape     |
|-----------|----------------------------------------------------------|--------------|-----------|
| ``after`` | instants after the estimate, denser towards the catch    | s            | (K,)      |
| ``weight``| share of each in the mean over a flight (trapezoids)     | 1            | (K,)      |
| ``path``  | r_o, dr_o, ddr_o                                         | m, m/s ..    | (K, 3, 3) |
| ``rows``  | q_o, dq_o, ddq_o                                         | rad, rad/s ..| (K, 3, n) |
| ``phi``   | monomials and their two derivatives in time              | 1, 1/s ..    | (K, 3, m) |

The last two instants lie after the catch, where the map is still followed while the fingers close.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mitt.ball.flight import acceleration, advance
from mitt.generator.inverse import lift
from mitt.generator.packing import unfold, unpack
from mitt.generator.polynomial import jets
from mitt.generator.tangent import coordinate
from mitt.jit import kernel
from mitt.signals import Array

#: Instants, those of them after the catch, and how long after it the map is followed [s].
INSTANTS, LATE, FOLLOWED = 12, 2, 0.015
#: Power of the law by which instants crowd towards the catch.
_CROWDING = 1.5
#: Duration of the flight over which the mean of eq. (22) is taken [s]: what H was learned on.
_DURATION = 0.4


class Course(NamedTuple):
    """Arrays of a course; see the module's table."""

    after: Array
    weight: Array
    path: Array
    rows: Array
    phi: Array


def course_of(n: int, m: int) -> Course:
    """Return an empty course of ``n`` joints and ``m`` monomials."""
    k = INSTANTS
    return Course(
        after=np.zeros(k),
        weight=np.zeros(k),
        path=np.zeros((k, 3, 3)),
        rows=np.zeros((k, 3, n)),
        phi=np.zeros((k, 3, m)),
    )


@kernel
def lay(
    packed: Array,
    powers: NDArray[np.int64],
    window: Array,
    state: Array,
    ahead: tuple[float, float],
    c: Course,
    work: Array,
) -> float:
    """Fly a ball on to its catch and a little further, and lift its way into virtual joints.

    Args:
        packed: The tangent map.
        powers: Exponents of the monomials, shape (m, 3).
        window: Centre and scale of the polynomial's variables, shape (2, 3).
        state: Position, velocity, drag coefficient of the ball [m, m/s, 1/m], shape (7,).
        ahead: Time to the start of the course, and from there to the catch as far as known [s].
        c: Result; ``rows[0, 0]`` is where a Newton inverse starts.
        work: Workspace of the tangent map.

    Returns:
        The time from the start to the catch, one step of Newton's method better [s]; NaN outside
        the domain.
    """
    g = unpack(packed)
    w = unfold(work, c.rows.shape[2])
    _instants(ahead[1], c)
    last, better = 0.0, ahead[1]
    c.path[0, 0], c.path[0, 1] = state[:3], state[3:6]
    advance(c.path[0, 0], c.path[0, 1], state[6], ahead[0])
    q, dq, ddq = np.empty(3), np.empty(3), np.empty(3)
    for k in range(len(c.after)):
        if k > 0:
            c.path[k, :2] = c.path[k - 1, :2]
            c.rows[k, 0] = c.rows[k - 1, 0]
            advance(c.path[k, 0], c.path[k, 1], state[6], c.after[k] - last)
        last = c.after[k]
        acceleration(c.path[k, 1], state[6], c.path[k, 2])
        if not lift(g, c.path[k], c.rows[k], w):
            return np.nan
        for a in range(3):
            q[a], dq[a] = coordinate(g, c.rows[k, 0], a), coordinate(g, c.rows[k, 1], a)
            ddq[a] = coordinate(g, c.rows[k, 2], a)
        jets(powers, window[0], window[1], q, dq, ddq, c.phi[k])
        if k == len(c.after) - 1 - LATE:
            if dq[g.catch] == 0.0:  # it does not come nearer
                return np.nan
            better -= (q[g.catch] - g.q_catch) / dq[g.catch]
    return better


@kernel
def _instants(ahead: float, c: Course) -> None:
    """Write the instants of a course and the share of each in the mean over a flight."""
    count, way = len(c.after), len(c.after) - 1 - LATE
    for k in range(way + 1):
        c.after[k] = ahead * (1.0 - (1.0 - k / way) ** _CROWDING)
    for k in range(LATE):
        c.after[way + 1 + k] = ahead + FOLLOWED * (k + 1) / LATE
    for k in range(count):
        before, behind = c.after[max(k - 1, 0)], c.after[min(k + 1, count - 1)]
        c.weight[k] = 0.5 * (behind - before) / _DURATION
