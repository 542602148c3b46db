"""How noisy positions are, learned from the positions themselves.

Each position is compared with the parabola through the three before it; without noise they agree
but for the jerk. The squared difference, over the sum of the squared weights of the four, is a
sample of the variance, axis by axis. A sample counts at most ``CLIP`` times the variance so far,
so that an outlier or a bounce hardly moves it. Where a time does not come after the one before it,
as after a wrong stamp, the next four positions in a row are waited for.
"""

from math import isfinite

from mitt.jit import kernel
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

NOISE = 17
"""Numbers kept: variances of the axes [m^2], positions so far, three times [s] and positions [m],
positions in a row."""


@kernel
def reset(noise: Array) -> None:
    """Forget all but the first value, shape (NOISE,)."""
    noise[:] = 0.0
    noise[0] = noise[1] = noise[2] = START**2


@kernel
def learn(noise: Array, t: float, z: Array) -> None:
    """Learn from the next position, if that and its time are finite.

    Args:
        noise: What is known, shape (NOISE,); its first three numbers are the variances.
        t: Its time [s].
        z: Position [m], shape (3,).
    """
    if not (isfinite(t) and isfinite(z[0]) and isfinite(z[1]) and isfinite(z[2])):
        return
    seen = noise[3]
    if not t - noise[6] > SOONEST:
        noise[16] = 0.0
    if noise[16] >= 3.0:
        a, b, c = noise[4], noise[5], noise[6]
        wa = (t - b) * (t - c) / ((a - b) * (a - c))
        wb = (t - a) * (t - c) / ((b - a) * (b - c))
        wc = (t - a) * (t - b) / ((c - a) * (c - b))
        share = 1.0 / (BEFORE + min(seen - 2.0, WINDOW))
        for i in range(3):
            e = z[i] - wa * noise[7 + i] - wb * noise[10 + i] - wc * noise[13 + i]
            sample = e * e / (1.0 + wa * wa + wb * wb + wc * wc)
            so_far = noise[i]
            if not sample >= 0.0:  # times too far apart for numbers
                continue
            noise[i] = max(so_far + share * (min(sample, CLIP * so_far) - so_far), LEAST**2)
    noise[3] = seen + 1.0
    noise[16] += 1.0
    for k in range(2):
        noise[4 + k] = noise[5 + k]
        for i in range(3):
            noise[7 + 3 * k + i] = noise[10 + 3 * k + i]
    noise[6] = t
    for i in range(3):
        noise[13 + i] = z[i]
