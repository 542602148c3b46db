"""Recorded flights: follow real table-tennis balls with the filter and look 50 ms ahead.

The flights come with mitt (``src/mitt/data/flights``). Some bounce; a bounce less than 50 ms away
cannot be known, and shows in the largest error but not in the median.
"""

import numpy as np

import mitt
from mitt.core.ball.filter import TABLE_TENNIS_BALL, BallFilter
from mitt.core.signals import Array, Sighting
from mitt.lab.world.flights import RecordedFlight, builtin_flights

AHEAD = 0.05  # [s]
NOISE = np.diag([1.6e-3, 0.6e-3, 0.85e-3]) ** 2  # of the recording [m^2]


def errors_ahead(flight: RecordedFlight) -> Array:
    """Return the errors of the forecasts made from 0.1 s on [m], shape (k,)."""
    track, errors = BallFilter(TABLE_TENNIS_BALL), []
    for t, r in zip(flight.t, flight.r, strict=True):
        track.update(Sighting(t=t, found=True, r_o=r, covariance=NOISE))
        if 0.1 <= t <= flight.t[-1] - AHEAD:
            true = [np.interp(t + AHEAD, flight.t, flight.r[:, k]) for k in range(3)]
            errors.append(float(np.linalg.norm(track.state(t + AHEAD).r_o - true)))
    return np.array(errors)


flights = builtin_flights()
one = errors_ahead(flights[0])
print(f"mitt {mitt.__version__}, {len(flights)} flights; {flights[0].name}: {len(one)} forecasts")
print(
    f"50 ms ahead on this flight: median {1e3 * np.median(one):.1f} mm, "
    f"largest {1e3 * one.max():.1f} mm"
)
every = np.concatenate([errors_ahead(flight) for flight in flights])
print(
    f"on all flights: median {1e3 * np.median(every):.1f} mm, 95 % below "
    f"{1e3 * np.quantile(every, 0.95):.0f} mm"
)
