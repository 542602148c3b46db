"""Load an arm and ask it: where is the catch point, how does it move, what torque does it take?

The Jacobian is checked against differences of the position, the torque of a motion against
inertia, and the torque at rest against the weight that a virtual displacement lifts.
"""

import numpy as np

import mitt

arm = mitt.load_arm("wam", limits="paper")
print(arm)

q = np.array([0.0, np.pi / 4, np.pi / 2])  # where the ball is usually met [rad]
still = np.zeros(arm.n)
print("catch point [m]:", arm.position(q).round(3))

step = 1e-6
differences = np.column_stack(
    [(arm.position(q + step * e) - arm.position(q - step * e)) / (2 * step) for e in np.eye(arm.n)]
)
gap = np.abs(arm.jacobian(q) - differences).max()
print(f"Jacobian against differences: {gap:.1e} m/rad")

ddq = np.array([5.0, -10.0, 40.0])
holding = arm.inverse_dynamics(q, still, still)
moving = arm.inverse_dynamics(q, still, ddq)
left = np.abs(moving - holding - arm.mass_matrix(q) @ ddq).max()
print(f"torque to hold still [N m]: {holding.round(2)}, limits {arm.tau_max.round(1)}")
print(f"tau - g - M ddq: {left:.1e} N m")

# At 6 m/s along the tangent of the elbow the joint must turn this fast:
reach = np.linalg.norm(arm.jacobian(q)[:, 2])
print(f"elbow speed that meets a 6 m/s ball: {6.0 / reach:.1f} rad/s, limit {arm.dq_max[2]:.0f}")
