"""Slow motions: from rest to rest, straight in the joints, no faster than a person can watch."""

from math import ceil

import numpy as np
from ruckig import InputParameter, Result, Ruckig, Synchronization, Trajectory

from mitt.core.arm.arm import Arm, trusted_deceleration
from mitt.core.control.envelope import bounds_of
from mitt.core.errors import InputError
from mitt.core.signals import TICK, Array

#: Fastest that a joint moves [rad/s]: the reduced speed of ISO 10218-1 is 0.25 m/s at the tool, a
#: quarter of a metre from the joint; and time to that speed [s].
_FASTEST = 1.0
_RAMP = 0.25
#: Share of what the drives can accelerate with, and of the limits of acceleration and jerk, that
#: is used.
_GENTLE = 0.3


def slow_motion(arm: Arm, start: Array, end: Array, share: float) -> Array:
    """Return q, dq, ddq each tick from one pose to another, straight in the joints, (k, 3, n).

    It rests at both, shape (n,) [rad]. ``share`` of the joints' speeds is used, 1 rad/s at most.
    """
    b = bounds_of(arm)
    speed = np.minimum(np.minimum(share * arm.dq_max, b["dq_max"]), _FASTEST)
    most = _GENTLE * np.minimum(trusted_deceleration(arm, start), b["ddq_max"])
    acceleration = np.minimum(speed / _RAMP, most)
    jerk = np.minimum(acceleration / (0.2 * _RAMP), _GENTLE * b["jerk"])
    request, way = InputParameter(arm.n), Trajectory(arm.n)
    request.synchronization = Synchronization.Phase
    request.current_position, request.target_position = start.tolist(), end.tolist()
    request.max_velocity, request.max_acceleration = speed.tolist(), acceleration.tolist()
    request.max_jerk = jerk.tolist()
    try:
        found = Ruckig(arm.n).calculate(request, way)
    except Exception as error:  # Ruckig's own
        raise InputError("a motion", "two poses at rest", f"{error}"[:120]) from error
    if found not in (Result.Working, Result.Finished):
        raise InputError("a motion", "two poses at rest", f"{start.tolist()}, {end.tolist()}")
    return sample_motion(way, np.arange(ceil(way.duration / TICK) + 2) * TICK)


def sample_motion(way: Trajectory, t: Array) -> Array:
    """Return q, dq, ddq of a motion from rest at some times, shape (k, 3, n); at its end after it.

    Ruckig is asked where the jerk of a joint changes, 7 times a joint at most. Between these times
    each joint is a cubic. Asking for each tick takes 4 us a tick, longer than a robot waits.
    """
    ends = [np.cumsum(profile.t) for profile in way.profiles[0]]
    knots = np.unique(np.clip([0.0, way.duration, *np.concatenate(ends)], 0.0, way.duration))
    known = np.array([way.at_time(x)[:3] for x in knots.tolist()])
    t = np.minimum(t, way.duration)
    k = np.clip(np.searchsorted(knots, t, side="right") - 1, 0, max(len(knots) - 2, 0))
    x = (t - knots[k])[:, None]
    lasts = np.append(np.diff(knots), 1.0)[k, None]
    q, dq, ddq = np.moveaxis(known[k], 1, 0)
    jerk = (known[np.minimum(k + 1, len(knots) - 1), 2] - ddq) / lasts
    rows = (
        q + x * (dq + x * (0.5 * ddq + x * jerk / 6.0)),
        dq + x * (ddq + 0.5 * x * jerk),
        ddq + x * jerk,
    )
    return np.stack(rows, axis=1)
