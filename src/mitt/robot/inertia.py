"""Moments of inertia: which a body can have, as MuJoCo asks too, and how rounded ones are mended.

A body's principal moments are above 0, and none is above the sum of the others (that of a flat
plate is just as large). Files of light links break this in the last digit that they keep, or leave
all moments out.
"""

import numpy as np

from mitt.errors import ModelError
from mitt.signals import Array

#: Least principal moment that MuJoCo takes, with some room [kg m^2].
_LEAST = 1e-13
#: By how much of itself the largest moment stays below the sum of the others: room for rounding.
_ROOM = 1e-9
#: How far moments may be off by the rounding of a file [kg m^2].
_ROUNDED = 1e-6
#: Density of steel [kg/m^3].
_STEEL = 7850.0
WANTED = "principal moments that a body can have (above 0, none above the sum of the others)"


def checked_inertia(
    where: str, inertia: Array, *, do: str = "check the inertia of that link"
) -> Array:
    """Return an inertia that MuJoCo takes; a flat plate's moments are moved by rounding only.

    Args:
        where: What an error calls the body.
        inertia: Inertia about the centre of mass [kg m^2], shape (3, 3).
        do: What to do about another one.

    Raises:
        ModelError: No body has such moments.
    """
    moments, axes = np.linalg.eigh(0.5 * (inertia + inertia.T))
    room = moments[0] + moments[1] - moments[2]
    if moments[0] < _LEAST or room < -_ROOM * moments[2]:
        raise ModelError(where, WANTED, shown(moments), do=do)
    if room > 1e-3 * _ROOM * moments[2]:
        return inertia
    return _turned(_apart(moments), axes)


def mended_inertia(where: str, mass: float, inertia: Array) -> tuple[Array, str]:
    """Return an inertia that a body can have, and a note where a file's was mended.

    Moments of 0 become those of a ball of steel, the smallest body of that mass; where the largest
    is above the sum of the others, these are raised. Both only as far as a file rounds.

    Args:
        where: What a note and an error call the body.
        mass: Its mass [kg].
        inertia: Inertia about the centre of mass [kg m^2], shape (3, 3).

    Raises:
        ModelError: No body has such moments, and no rounding explains them.
    """
    given, axes = np.linalg.eigh(0.5 * (inertia + inertia.T))
    moments = given.copy()
    if -_ROUNDED <= moments[0] < _LEAST:
        ball = max(steel_ball(mass), _LEAST)
        moments[moments < _LEAST] = min(ball, moments[2]) if moments[2] > _LEAST else ball
    order = np.argsort(moments, kind="stable")
    moments, axes = moments[order], axes[:, order]
    if _ROOM * moments[2] < moments[2] - moments[0] - moments[1] <= _ROUNDED:
        moments = _apart(moments)
    if np.array_equal(moments, given):
        return checked_inertia(where, inertia), ""
    out = checked_inertia(where, _turned(moments, axes))
    return out, (f"{where}: no body has the principal moments {shown(given)} kg m^2; taken as"
                 f" {shown(moments)}")  # fmt: skip


def steel_ball(mass: float) -> float:
    """Return the moment of inertia of a ball of steel, given its mass [kg]."""
    return float(0.4 * mass * (3.0 * mass / (4.0 * np.pi * _STEEL)) ** (2.0 / 3.0))


def shown(moments: Array) -> str:
    """Return moments as a message has them."""
    return ", ".join(f"{x:.4g}" for x in moments)


def _apart(moments: Array) -> Array:
    """Return rising moments, the smaller two raised until the largest is below their sum."""
    lacking = max(moments[2] * (1.0 + _ROOM) - moments[0] - moments[1], 0.0)
    return np.asarray(moments + np.array((0.5, 0.5, 0.0)) * lacking)


def _turned(moments: Array, axes: Array) -> Array:
    """Return the inertia with principal moments about the columns of ``axes``."""
    out = axes @ np.diag(moments) @ axes.T
    return np.asarray(0.5 * (out + out.T))
