"""Polynomials of degree five in time between two states of motion, all joints alike.

| here      | meaning                                   | unit                     | shape  |
|-----------|-------------------------------------------|--------------------------|--------|
| ``start`` | q, dq, ddq at time 0                      | rad, rad/s, rad/s^2      | (3, n) |
| ``end``   | q, dq, ddq at time ``span``               | the same                 | (3, n) |
"""

from mitt.jit import kernel
from mitt.signals import Array


@kernel
def quintic(start: Array, end: Array, span: float, t: float, out: Array) -> None:
    """Write q, dq, ddq at time ``t`` of the quintic from one state to another, shape (3, n).

    Args:
        start: State at time 0, shape (3, n).
        end: State at time ``span``, shape (3, n).
        span: Duration [s], positive.
        t: Time since the start [s]; the polynomial goes on outside [0, span].
        out: Result, shape (3, n).
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
def sample(start: Array, end: Array, span: float, out: Array) -> None:
    """Write a quintic from one state to another at S even instants, shape (S, 3, n).

    The first instant is a little after the start, the last one the end.
    """
    for s in range(out.shape[0]):
        quintic(start, end, span, span * (s + 1) / out.shape[0], out[s])
