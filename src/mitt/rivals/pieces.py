"""Motions whose acceleration is linear between even instants: what the optimisers plan in."""

from dataclasses import dataclass
from typing import final

import numpy as np

from mitt.jit import kernel
from mitt.signals import Array


@final
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Motion:
    """A motion whose acceleration is linear between instants.

    Attributes:
        t: Time of the start [s].
        step: Time between the instants [s].
        q: Angles at the instants [rad], shape (n, M + 1).
        dq: Speeds [rad/s], shape (n, M + 1).
        ddq: Accelerations [rad/s^2], shape (n, M + 1).
        cost: Cost of eq. (22), the mean over the instants.
    """

    t: float
    step: float
    q: Array
    dq: Array
    ddq: Array
    cost: float

    @property
    def t_c(self) -> float:
        """Time of the catch [s]."""
        return self.t + self.step * float(self.q.shape[1] - 1)

    def at(self, t: float) -> Array:
        """Return q, dq, ddq at time ``t`` [s], shape (3, n); past the ends it goes on."""
        out = np.empty((3, self.q.shape[0]))
        _piece(self.q, self.dq, self.ddq, self.step, t - self.t, out)
        return out


@kernel
def _piece(q: Array, dq: Array, ddq: Array, h: float, after: float, out: Array) -> None:
    """Write q, dq, ddq a time after the start [s], shape (3, n); see :class:`Motion`."""
    k = min(max(int(after // h), 0), q.shape[1] - 2)
    s = after - k * h
    for j in range(q.shape[0]):
        a, v = ddq[j, k], dq[j, k]
        jerk = (ddq[j, k + 1] - a) / h
        out[0, j] = q[j, k] + s * (v + s * (0.5 * a + s * jerk / 6.0))
        out[1, j] = v + s * (a + 0.5 * s * jerk)
        out[2, j] = a + s * jerk


@kernel
def responses(parts: int, step: float) -> tuple[Array, Array]:
    """Return how speeds and angles at the instants follow from the accelerations there.

    dq_k = dq_0 + (D a)_k and q_k = q_0 + k step dq_0 + (P a)_k for one joint.

    Args:
        parts: Number M of parts.
        step: Time between the instants [s].

    Returns:
        D [s] and P [s^2], shapes (M + 1, M + 1).
    """
    D, P = np.zeros((parts + 1, parts + 1)), np.zeros((parts + 1, parts + 1))
    for k in range(parts):
        D[k + 1], P[k + 1] = D[k], P[k] + step * D[k]
        D[k + 1, k : k + 2] += 0.5 * step
        P[k + 1, k] += step * step / 3.0
        P[k + 1, k + 1] += step * step / 6.0
    return D, P
