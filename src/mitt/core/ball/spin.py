"""Spin and the lift that it gives (Magnus): the law of a ball in air, both ways.

    a = K c omega x v,   c = |v| / (|v| + 2 r omega_T),   K = rho pi r^3 / (2 m)

omega_T is the part of the spin across the velocity. That is the lift coefficient
C_L = 1 / (2 + |v| / (r omega_T)), as R. Cross and C. Lindsey use it for tennis balls; that other
balls have the same is believed here, not measured. Their drag coefficient did not depend on spin
(0.507 +- 0.024), so drag is that of a ball without spin. In half a second of flight a ball keeps
its spin.

What a flight shows is w = c K omega: in each moment its part across the velocity, and as gravity
turns the velocity, all of it in time.

| here     | meaning                                    | unit    | shape |
|----------|--------------------------------------------|---------|-------|
| ``spin`` | omega, angular velocity                    | rad/s   | (3,)  |
| ``lift`` | K omega and 2 r / K: what flights take     | 1/s, m  | (4,)  |
| ``w``    | c K omega, as the ball filter estimates it | 1/s     | (3,)  |
"""

from typing import Final

import numpy as np

from mitt.core.ball.flight import Lift
from mitt.core.signals import Array

AIR: Final = 1.2
"""Density of air at 20 degrees C and sea level [kg/m^3]."""
MOST_SPIN: Final = 1000.0
"""Fastest spin that a flight is taken to show [rad/s]; fast players reach about 900."""


def lift_constant(radius: float, mass: float) -> float:
    """Return K of a ball: lift per spin and speed of one that spins slowly."""
    return 0.5 * AIR * np.pi * radius**3 / mass


def lift_of(spin: Array, K: float, radius: float) -> Lift:
    """Return what flights take of a spin.

    Args:
        spin: Angular velocity [rad/s], shape (3,).
        K: Lift constant of the ball.
        radius: Its radius [m].
    """
    x, y, z = (K * spin).tolist()
    return x, y, z, 2.0 * radius / K if K > 0.0 else 0.0


def steady_lift(w: Array) -> Lift:
    """Return what flights take of a w [1/s], (3,), that stays as it is."""
    x, y, z = w.tolist()
    return x, y, z, 0.0


def spin_shown(w: Array, v: Array, K: float, radius: float) -> Array:
    """Return the spin that a flight shows, at most ``MOST_SPIN`` across the velocity [rad/s], (3,).

    Args:
        w: As estimated [1/s], shape (3,).
        v: Velocity [m/s], shape (3,).
        K: Lift constant of the ball; of 0, none is shown.
        radius: Its radius [m].
    """
    speed = float(np.linalg.norm(v))
    if not (K > 0.0 and speed > 0.0):
        return np.zeros(3)
    across = float(np.linalg.norm(np.cross(w, v))) / speed
    left = K * speed - 2.0 * radius * across
    factor = speed / left if left * MOST_SPIN > across * speed else MOST_SPIN / across
    return np.asarray(factor * w)
