"""Whether recorded balls fall as balls do: axes and units of a table, held against gravity.

Each flight is cut into pieces, each piece fitted by a parabola. Its acceleration is gravity along
some axis, and drag against the way it flies. What is not as clean as that says nothing: a ball that
rolls, a hand that carries one. Spin lifts or pushes a ball by an acceleration that grows with its
speed, and is left alone.
"""

from collections import Counter
from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mitt.core.signals import GRAVITY, Array

#: How near the origin of an arm a throw comes [m].
_NEAR = 1.5
#: Share of the throws that come so near in other axes or units, where these are meant.
_MANY = 0.8

#: Units of positions and times that tables come in, per metre and per second.
_LENGTHS = {"m": 1.0, "mm": 1000.0, "cm": 100.0, "inches": 1.0 / 0.0254, "feet": 1.0 / 0.3048}
_TIMES = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}
#: Where balls may fall to, and what x, y, z become so that they fall along -z.
_TURNS = {
    "-x": "y, z, x",
    "+x": "z, y, -x",
    "-y": "x, -z, y",
    "+y": "x, z, -y",
    "+z": "x, -y, -z",
}
#: What spin adds to gravity at most: a part [m/s^2], and one that grows with the speed [1/s].
_SPIN = (3.0, 2.5)
#: Largest drag of a thrown ball [1/m]: twice that of one of table tennis.
_DRAG = 0.25


def free_of_gravity(speed: float) -> float:
    """Return the largest acceleration beside gravity of a ball in free flight [m/s^2].

    Args:
        speed: Its speed [m/s].
    """
    return _SPIN[0] + _SPIN[1] * speed + _DRAG * speed**2


class Fall(NamedTuple):
    """How a flight falls.

    Attributes:
        axis: Along which of x, y, z, with its sign.
        size: At how much [m/s^2].
        speed: Its mean speed [m/s].
    """

    axis: str
    size: float
    speed: float


class Doubt(NamedTuple):
    """What makes balls fall otherwise than along -z at 9.81 m/s^2, and what to do."""

    given: str
    do: str


WANTED = f"balls that fall along -z at {GRAVITY:.2f} m/s^2"


def doubt_of(flights: Sequence[tuple[Array, Array]]) -> Doubt | None:
    """Return why flights are in other axes or units than metres, seconds and z up, or None.

    Most of those that fall at all have to say the same.

    Args:
        flights: Times, shape (n,), and positions, shape (n, 3), of each.
    """
    chosen = (flights[k] for k in _spread(len(flights), 20))
    falls = [fall for t, r in chosen if (fall := fall_of(t, r)) is not None]
    said = Counter(_doubt(fall) for fall in falls)
    if not said:
        return None
    doubt, count = said.most_common(1)[0]
    return doubt if doubt is not None and 2 * count > len(falls) else None


def doubt_of_throws(r: Array, dr: Array) -> Doubt | None:
    """Return why throws are in other axes or units than metres, seconds and z up, or None.

    Half of them miss the arm as they are written, and most do not otherwise. Fewer than three say
    nothing.

    Args:
        r: Positions at release, shape (n, 3).
        dr: Velocities, shape (n, 3).
    """
    chosen = _spread(len(r), 300)
    r, dr = r[chosen], dr[chosen]
    if len(r) < 3 or _near(r, dr, 0.0) >= 0.5:
        return None
    for axis, turn in _TURNS.items():
        if _near(_turned(turn, r), _turned(turn, dr), _NEAR) >= _MANY:
            return Doubt(
                f"throws of which most miss the arm, but would not if they fell along {axis}",
                f"turn the axes: write {turn} for x, y, z",
            )
    for name, per_metre in _LENGTHS.items():
        if name != "m" and _near(r / per_metre, dr / per_metre, _NEAR) >= _MANY:
            return Doubt(
                f"throws of which most miss the arm, but would not in {name}",
                "write metres and metres a second",
            )
    return None


def _spread(count: int, most: int) -> NDArray[np.int64]:
    """Return numbers below a count, at most so many, from all over it."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(np.int64))


def _near(r: Array, dr: Array, released: float) -> float:
    """Return the share of throws that come near the origin, released so far from it or more."""
    t = np.linspace(0.0, 2.5, 251)[:, None, None]  # no throw flies longer [s]
    path = r + dr * t - 0.5 * t * t * np.array((0.0, 0.0, GRAVITY))
    apart = np.linalg.norm(path, axis=2)
    return float(np.mean((apart.min(axis=0) < _NEAR) & (apart[0] >= released)))


def _turned(turn: str, x: Array) -> Array:
    """Return vectors, shape (n, 3), in the axes that ``_TURNS`` names."""
    parts = [part.strip() for part in turn.split(",")]
    return np.stack([(-1.0 if p[0] == "-" else 1.0) * x[:, "xyz".index(p[-1])] for p in parts], 1)


def fall_of(t: Array, r: Array) -> Fall | None:
    """Return how one flight falls; None where that is not plain.

    Args:
        t: Times, rising, in any unit, shape (n,).
        r: Positions, in any unit, shape (n, 3).
    """
    size = min(max(len(t) // 4, 8), 200)  # of a piece
    pieces = [
        _piece(t[k : k + size], r[k : k + size])
        for k in range(0, len(t) - size + 1, max(size // 2, 1))
    ]
    if not pieces:
        return None
    a, v = (np.array(x) for x in zip(*pieces, strict=True))
    fits = [_fit(a, v, axis) for axis in range(3)]
    axis = int(np.argmin([rest for _, rest in fits]))
    along, rest = fits[axis]
    duration, length = float(t[-1] - t[0]), float(np.ptp(r, axis=0).max())
    sag = 0.125 * abs(along) * duration**2
    if rest > 0.3 * abs(along) or sag < 0.02 * length:  # the pieces disagree, or it is hardly bent
        return None
    speed = float(np.linalg.norm(v, axis=1).mean())
    return Fall("-+"[int(along > 0.0)] + "xyz"[axis], abs(along), speed)


def _piece(t: Array, r: Array) -> tuple[Array, Array]:
    """Return acceleration and velocity of a parabola through a piece, shape (3,) each."""
    span = float(t[-1] - t[0])
    fitted = np.polyfit((t - t.mean()) / span, r, 2)
    return 2.0 * fitted[0] / span**2, fitted[1] / span


def _fit(a: Array, v: Array, axis: int) -> tuple[float, float]:
    """Return the acceleration along an axis beside drag, and how far off the pieces are (median).

    What they are off in common counts twice, as it is no noise. Least absolute distances, so that a
    piece with a bounce in it does not count.

    Args:
        a: Accelerations, shape (k, 3).
        v: Velocities, shape (k, 3).
        axis: 0, 1 or 2.
    """
    drag = -np.linalg.norm(v, axis=1, keepdims=True) * v
    unit = np.zeros_like(a)
    unit[:, axis] = 1.0
    columns = np.stack((unit, drag), axis=2)  # shape (k, 3, 2)
    least = 1e-9 * float(np.abs(a).max()) + 1e-300
    scale = np.linalg.norm(columns, axis=(0, 1))
    columns = columns / np.where(scale > 0.0, scale, 1.0)
    weight = np.ones(len(a))
    found: Array = np.zeros(2)
    rest: Array = np.zeros(len(a))
    off: Array = np.zeros_like(a)
    for _ in range(12):
        root = np.sqrt(weight)[:, None]
        rows, wanted = columns * root[:, :, None], a * root
        solved = np.linalg.lstsq(rows.reshape(-1, 2), wanted.ravel(), rcond=None)
        found = np.asarray(solved[0], np.float64)
        if found[1] < 0.0:  # nothing drives a ball on
            found = np.array(
                (
                    float(rows[:, :, 0].ravel() @ wanted.ravel())
                    / float(np.sum(rows[:, :, 0] ** 2)),
                    0.0,
                )
            )
        off = a - columns @ found
        rest = np.sqrt(np.sum(off**2, axis=1))
        weight = 1.0 / np.maximum(rest, least)
        weight = weight / weight.max()
    always = float(np.linalg.norm(np.median(off, axis=0)))
    return float(found[0] / scale[0]), max(float(np.median(rest)), 2.0 * always)


def _doubt(fall: Fall) -> Doubt | None:
    """Return what is wrong with how a flight falls; None where nothing is."""
    if fall.axis != "-z" and 0.65 * GRAVITY < fall.size < 1.6 * GRAVITY:
        return Doubt(
            f"balls that fall along {fall.axis}",
            f"turn the axes: write {_TURNS[fall.axis]} for x, y, z",
        )
    for (length, metre), (time, second) in product(_LENGTHS.items(), _TIMES.items()):
        ratio = fall.size * second**2 / (GRAVITY * metre)
        if 0.87 < ratio < 1.15 and not metre == second == 1.0:
            turn = "" if fall.axis == "-z" else f", and {_TURNS[fall.axis]} for x, y, z"
            units = [x for x in (length, time) if x not in ("m", "s")]
            return Doubt(
                f"balls that fall along {fall.axis} as if in {' and '.join(units)}",
                f"write metres and seconds{turn}",
            )
    if fall.axis == "-z" and abs(fall.size - GRAVITY) > _SPIN[0] + _SPIN[1] * fall.speed:
        slow = fall.size < GRAVITY
        return Doubt(
            "balls that fall too slowly for their speed"
            if slow
            else "balls that fall too fast for their speed",
            "write metres and seconds: are the times numbers of frames, or those of slow motion?"
            if slow
            else "write metres and seconds",
        )
    return None
