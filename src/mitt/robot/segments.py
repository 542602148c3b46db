"""Where two segments are nearest to one another, as kernels (Ericson 2004, section 5.1.9)."""

import numpy as np

from mitt.jit import kernel
from mitt.robot.vectors import Vec, dot, minus, plus, times


@kernel
def nearest_shares(a: Vec, b: Vec, c: Vec, d: Vec) -> tuple[float, float]:
    """Return the shares of the ways a-b and c-d at which their nearest points lie, 0 to 1."""
    u, v, w = minus(b, a), minus(d, c), minus(a, c)
    uu, vv, uv, uw, vw = dot(u, u), dot(v, v), dot(u, v), dot(u, w), dot(v, w)
    s, t = 0.0, 0.0
    if uu <= 1e-18 and vv <= 1e-18:
        return s, t
    if uu <= 1e-18:
        t = min(max(vw / vv, 0.0), 1.0)
    elif vv <= 1e-18:
        s = min(max(-uw / uu, 0.0), 1.0)
    else:
        across = uu * vv - uv * uv
        if across > 1e-12 * uu * vv:
            s = min(max((uv * vw - uw * vv) / across, 0.0), 1.0)
        t = (uv * s + vw) / vv
        if t < 0.0:
            t, s = 0.0, min(max(-uw / uu, 0.0), 1.0)
        elif t > 1.0:
            t, s = 1.0, min(max((uv - uw) / uu, 0.0), 1.0)
    return s, t


@kernel
def segment_distance(a: Vec, b: Vec, c: Vec, d: Vec) -> float:
    """Return the distance of the segments a-b and c-d [m]."""
    s, t = nearest_shares(a, b, c, d)
    apart = minus(plus(minus(a, c), times(s, minus(b, a))), times(t, minus(d, c)))
    return float(np.sqrt(dot(apart, apart)))
