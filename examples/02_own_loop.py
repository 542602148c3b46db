"""A loop of one's own: learn a map, adapt it to a ball, ask for joint motion each millisecond.

The ball here is flown by the flight model; put your own estimate in its place. At the catch, hand
and ball have the same position and the same velocity, eq. (3), and at the start the reference
begins where the arm is, eq. (8).
"""

import numpy as np

import mitt
from mitt.core.ball.flight import forecast

arm = mitt.load_arm("wam")
direct_map = mitt.learn(arm).map
seen = mitt.BallState(
    t=0.08,
    r_o=np.array([3.3, 0.15, 0.35]),
    dr_o=np.array([-5.1, -0.2, 1.9]),
    drag=0.04,
)

ball = seen  # your estimate; its acceleration is that of the flight model if you leave it out
f = direct_map.adapt(ball, arm.q_ready, np.zeros(arm.n))
reference = f.reference(ball)
print(f"start: {np.abs(reference.q_d - arm.q_ready).max():.1e} rad from where the arm is")
while reference.time_to_catch > 0.0005:
    ball = forecast(seen, ball.t + 0.001)
    reference = f.reference(ball)
    # here: hand reference.q_d, reference.dq_d, reference.ddq_d to your controller

apart = 1e6 * np.linalg.norm(arm.position(reference.q_d) - ball.r_o)
relative = np.linalg.norm(arm.jacobian(reference.q_d) @ reference.dq_d - ball.dr_o)
print(f"catch at {ball.t + reference.time_to_catch:.3f} s, q_d = {reference.q_d.round(2)} rad")
print(f"hand and ball in the last tick: {apart:.0f} um apart, {relative:.2f} m/s relative")
