"""What is asked for, without its jumps.

What a map or a planner asks for jumps where the ball's estimate does, as after a kick, and where
another map is followed; as long as the estimate is unsure it jumps a little in each tick. The arm
goes on as it did instead: the difference e of that and of what is asked for is carried to none by
the polynomial of fifth degree that ends in a time T,

    e(t) = e B_0(t/T) + T e' B_1(t/T) + T^2 e'' B_2(t/T).

In each tick it is begun anew, from what was desired and with the time that is left then: T is a
share of the time to the catch, so e has ended by then, and eq. (3) holds for what is desired as for
what is asked for. What limits hold the command back by is no part of e: begun from the command, a
joint at its limits would be asked for ever more, and swing. A motion of steady acceleration is
followed exactly; one whose acceleration changes at a rate j is missed by j T^3 / 60: by 1e-4 rad at
6,000 rad/s^3 and 10 ms.

| here        | meaning                                                       | unit    | shape  |
|-------------|---------------------------------------------------------------|---------|--------|
| ``desired`` | q_d, dq_d, ddq_d of the tick before; after: those of this one | rad ... | (3, n) |
| ``asked``   | q_d, dq_d, ddq_d asked for in this tick                       | rad ... | (3, n) |
| ``ends``    | T                                                             | s       | number |
"""

from mitt.core.kernels import kernel
from mitt.core.signals import Array

#: Largest T [s]. After a kick of 2 m/s the jerk up to 30 ms before the catch is 1.1 times that of a
#: planner at 1 kHz; with 0.03 s it is twice that.
_LONGEST = 0.05
#: Smallest T [s]. With 0.005 s the jerk of the last 30 ms is more than twice as large.
_SHORTEST = 0.01
#: Share of the time to the catch that it takes otherwise.
_SHARE = 1.0 / 3.0


@kernel
def easing_time(time_to_catch: float) -> float:
    """Return the time in which a difference is to end, so long before a catch [s]."""
    return float(max(min(_SHARE * time_to_catch, _LONGEST), _SHORTEST))


@kernel
def ease(desired: Array, asked: Array, dt: float, ends: float) -> None:
    """Lead what is desired on towards what is asked for.

    Args:
        desired: As in the module's table, overwritten.
        asked: What is asked for.
        dt: Time since the tick before [s].
        ends: Time in which the difference is to end [s].
    """
    x = min(dt / ends, 1.0)
    y = 1.0 - x
    y2 = y * y
    for k in range(desired.shape[1]):
        q, dq, ddq = asked[0, k], asked[1, k], asked[2, k]
        e = desired[0, k] - (q - dt * (dq - 0.5 * dt * ddq))
        de = ends * (desired[1, k] - (dq - dt * ddq))
        dde = ends * ends * (desired[2, k] - ddq)
        place = y * (e * (1.0 + 3.0 * x + 6.0 * x * x) + de * x * (1.0 + 3.0 * x))
        place += 0.5 * y * dde * x * x
        speed = de * (1.0 + 2.0 * x - 15.0 * x * x) - 30.0 * e * x * x
        speed += 0.5 * dde * x * (2.0 - 5.0 * x)
        rate = dde * (1.0 - 8.0 * x + 10.0 * x * x) - 12.0 * de * x * (3.0 - 5.0 * x)
        rate -= 60.0 * e * x * (1.0 - 2.0 * x)
        desired[0, k] = q + y2 * place
        desired[1, k] = dq + y2 * speed / ends
        desired[2, k] = ddq + y * rate / (ends * ends)
