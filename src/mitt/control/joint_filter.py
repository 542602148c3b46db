"""The Kalman filter of a joint: position and velocity, driven by the modelled acceleration.

Process noise is a third of the model's largest error, measurement noise that of rounding. ``m`` is
a row of :mod:`mitt.control.encoder_memory`.
"""

from mitt.control import encoder_memory as at
from mitt.jit import kernel
from mitt.signals import TICK, Array

#: Share of the model's largest error that is one sigma.
_SIGMA = 1.0 / 3.0
#: For how many ticks a model error lasts at least, which the process noise allows for.
_LASTING = 5.0
#: Refused readings in a row after which the filter begins anew or the encoder has a fault.
IN_A_ROW = 3
#: Share of the largest speed of late that is kept in a tick.
_KEEPS = 0.85


@kernel
def restart(m: Array, q: float, dq: float, step: float, apart: float) -> None:
    """Begin the filter from a reading and a velocity, of readings that are ``apart`` [s]."""
    r = step * step / 12.0
    m[at.CORRECTED] += dq - m[at.DQ]
    m[at.Q], m[at.DQ], m[at.Q0], m[at.DQ0], m[at.SINCE] = q, dq, q, dq, 0.0
    m[at.VARIANCE_Q], m[at.COVARIANCE], m[at.VARIANCE_DQ] = r, r / apart, 2.0 * r / (apart * apart)
    m[at.REFUSED], m[at.AGAINST], m[at.FROM] = 0.0, 0.0, max(m[at.FROM], abs(dq))
    m[at.FRESH] = max(abs(dq), _KEEPS**IN_A_ROW * m[at.FRESH])


@kernel
def predict(m: Array, push: float, error: float, dt: float) -> None:
    """Carry estimate and covariance on by a time [s]; back, where it is negative.

    What the model misses is white within the time. Were it constant there, a fine encoder would
    leave an error of the velocity undamped: its sign would change from tick to tick for ever.
    """
    sigma = _SIGMA * error
    v = max(_LASTING, abs(dt) / TICK) * sigma * sigma * TICK * abs(dt)
    m[at.Q] += dt * (m[at.DQ] + 0.5 * dt * push)
    m[at.DQ] += dt * push
    m[at.VARIANCE_Q] += dt * (2.0 * m[at.COVARIANCE] + dt * (m[at.VARIANCE_DQ] + v / 3.0))
    m[at.COVARIANCE] += dt * (m[at.VARIANCE_DQ] + 0.5 * v)
    m[at.VARIANCE_DQ] += v
    m[at.SINCE] += dt / TICK
    m[at.SPAN] += dt / TICK


@kernel
def correct(m: Array, off: float, r: float, ticks: float) -> None:
    """Take a reading in that is off by so much [rad], with a variance [rad^2], after so long."""
    s = m[at.VARIANCE_Q] + r
    gain, rate = m[at.VARIANCE_Q] / s, m[at.COVARIANCE] / s
    m[at.Q] += gain * off
    m[at.DQ] += rate * off
    m[at.CORRECTED] += rate * off
    m[at.VARIANCE_DQ] -= rate * m[at.COVARIANCE]
    m[at.COVARIANCE] *= 1.0 - gain
    m[at.VARIANCE_Q] *= 1.0 - gain
    m[at.Q0], m[at.DQ0], m[at.SINCE], m[at.REFUSED] = m[at.Q], m[at.DQ], 0.0, 0.0
    m[at.FRESH] = max(abs(m[at.DQ]), _KEEPS**ticks * m[at.FRESH])
