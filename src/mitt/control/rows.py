"""Names of the rows of the arrays that the controller's kernels share."""

#: Limits of the active joints, as of :func:`mitt.control.envelope.bounds_of`, then what
#: :mod:`mitt.control.viability` adds: reach, and :func:`mitt.control.reserve.gentle_rates`.
Q_MIN, Q_MAX, DQ_MAX, DECELERATION, DDQ_MAX, JERK, REACH, GENTLE = range(8)

#: A command, and the acceleration that its torques cause by the model.
Q, DQ, DDQ, TAU, DDQ_BY_TAU = range(5)
ROWS = 5
