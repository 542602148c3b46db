"""Joint motions by time: quintics, and accelerations that are linear between even instants.

| here      | meaning                                   | unit                     | shape  |
|-----------|-------------------------------------------|--------------------------|--------|
| ``start`` | q, dq, ddq at time 0                      | rad, rad/s, rad/s^2      | (3, n) |
| ``end``   | q, dq, ddq at time ``span``               | the same                 | (3, n) |
"""

from dataclasses import dataclass
from typing import final

import numpy as np

from mitt.core.kernels import kernel
from mitt.core.signals import Array


@kernel
def quintic(start: Array, end: Array, span: float, t: float, out: Array) -> None:
    """Write q, dq, ddq at time ``t`` of the quintic from one state to another, shape (3, n).

    ``t`` counts from the start [s]; the polynomial goes on outside [0, ``span``], ``span`` > 0.
    """
    s = t / span
    for k in range(start.shape[1]):
        v, a = start[1, k] * span, 0.5 * start[2, k] * span * span
        x = end[0, k] - start[0, k] - v - a
        y = end[1, k] * span - v - 2.0 * a
        z = 0.5 * end[2, k] * span * span - a
        c3 = 10.0 * x - 4.0 * y + z
        c4 = -15.0 * x + 7.0 * y - 2.0 * z
        c5 = 6.0 * x - 3.0 * y + z
        out[0, k] = start[0, k] + s * (v + s * (a + s * (c3 + s * (c4 + s * c5))))
        slope = v + s * (2.0 * a + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)))
        bend = 2.0 * a + s * (6.0 * c3 + s * (12.0 * c4 + s * 20.0 * c5))
        out[1, k], out[2, k] = slope / span, bend / (span * span)


@kernel
def sample_quintic(start: Array, end: Array, span: float, out: Array) -> None:
    """Write a quintic at S even instants, the last one the end, shape (S, 3, n)."""
    for s in range(out.shape[0]):
        quintic(start, end, span, span * (s + 1) / out.shape[0], out[s])


@final
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PathMotion:
    """A motion whose acceleration is linear between even instants.

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
        h, after = self.step, t - self.t
        k = min(max(int(after // h), 0), self.q.shape[1] - 2)
        s, a, v = after - k * h, self.ddq[:, k], self.dq[:, k]
        jerk = (self.ddq[:, k + 1] - a) / h
        q = self.q[:, k] + s * (v + s * (0.5 * a + s * jerk / 6.0))
        return np.array([q, v + s * (a + 0.5 * s * jerk), a + s * jerk])


@kernel
def responses(parts: int, step: float) -> tuple[Array, Array]:
    """Return how speeds and angles at the instants follow from the accelerations there.

    dq_k = dq_0 + (D a)_k and q_k = q_0 + k step dq_0 + (P a)_k for one joint.
    D [s] and P [s^2] have the shape (M + 1, M + 1) for M parts of a length ``step`` [s].
    """
    D, P = np.zeros((parts + 1, parts + 1)), np.zeros((parts + 1, parts + 1))
    for k in range(parts):
        D[k + 1], P[k + 1] = D[k], P[k] + step * D[k]
        D[k + 1, k : k + 2] += 0.5 * step
        P[k + 1, k] += step * step / 3.0
        P[k + 1, k + 1] += step * step / 6.0
    return D, P
