"""How noisy positions are, learned from the positions themselves.

Each position is compared with the parabola through the three before it; without noise they agree
but for the jerk. The squared difference, over the sum of the squared weights of the four, is a
sample of the variance, axis by axis. A sample counts at most ``CLIP`` times the variance so far,
so that an outlier or a bounce hardly moves it. Where a time does not come after the one before it,
as after a wrong stamp, the next four positions in a row are waited for.
"""

from math import isfinite

import numpy as np

from mitt.kernels import Record, kernel
from mitt.signals import Array

START = 1.5e-3
"""Standard deviation assumed at first [m], of a good pair of cameras at a few metres."""
LEAST = 5e-5
"""Smallest standard deviation [m]."""
BEFORE, WINDOW = 6.0, 100.0
"""Samples that the first value is worth, and that are remembered."""
CLIP = 5.0
SOONEST = 1e-9
"""Time between two positions in a row [s]."""

NOISE = np.dtype(
    [
        ("variance", float, (3,)),  # of the axes [m^2]
        ("seen", int),  # positions so far
        ("in_a_row", int),  # positions in a row
        ("t", float, (3,)),  # times of the newest [s], and the positions [m]
        ("z", float, (3, 3)),
    ],
    align=True,
)


def fresh_noise() -> Record:
    """Return what is known without a position, one record of type ``NOISE``, shape (1,)."""
    noise = np.zeros(1, NOISE)
    noise["variance"] = START**2
    return noise


@kernel
def learn(noise: Record, t: float, z: Array) -> None:
    """Learn from the next position, if that and its time are finite.

    Args:
        noise: What is known, of :func:`fresh_noise`.
        t: Its time [s].
        z: Position [m], shape (3,).
    """
    if not (isfinite(t) and isfinite(z[0]) and isfinite(z[1]) and isfinite(z[2])):
        return
    k = noise[0]
    if not t - k.t[2] > SOONEST:
        k.in_a_row = 0
    if k.in_a_row >= 3:
        a, b, c = k.t[0], k.t[1], k.t[2]
        wa = (t - b) * (t - c) / ((a - b) * (a - c))
        wb = (t - a) * (t - c) / ((b - a) * (b - c))
        wc = (t - a) * (t - b) / ((c - a) * (c - b))
        share = 1.0 / (BEFORE + min(k.seen - 2.0, WINDOW))
        for i in range(3):
            e = z[i] - wa * k.z[0, i] - wb * k.z[1, i] - wc * k.z[2, i]
            sample = e * e / (1.0 + wa * wa + wb * wb + wc * wc)
            so_far = k.variance[i]
            if sample >= 0.0:  # else times too far apart for numbers
                more = share * (min(sample, CLIP * so_far) - so_far)
                k.variance[i] = max(so_far + more, LEAST**2)
    k.seen += 1
    k.in_a_row += 1
    for n in range(2):
        k.t[n] = k.t[n + 1]
        k.z[n] = k.z[n + 1]
    k.t[2] = t
    k.z[2] = z
