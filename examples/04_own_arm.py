"""An arm of one's own from a URDF, and the law of the map checked on it.

The shoulder of this arm stands off the yaw axis, so there is no closed form and the map is
inverted by Newton's method. The law: whatever the coefficients alpha are, position and velocity
of hand and ball agree at the catch, eq. (3). With a hand at its palm this arm also catches:
``mitt catch --arm own_arm.urdf --tip palm --joints yaw,pitch,elbow --q-catch 1.4``.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

import mitt
from mitt.core.map.neighbourhood import Neighbourhood

urdf = Path(__file__).with_name("own_arm.urdf")
arm = mitt.load_arm(urdf, tip="palm", joints=["yaw", "pitch", "elbow"])
design = mitt.MapDesign(catch_joint=2, q_catch=1.4)
around = Neighbourhood(arrival=(4.0, 5.0), box=(0.05, 0.1, 0.1), kicked=0.0, bounced=0.0)
learned = mitt.learn(arm, design=design, around=around)  # gentle flights: this arm is not strong
first = learned.steps[0]
last = learned.steps[-1]
print(
    f"{arm}\nlearned from {learned.flights} flights: cost {first.cost_torque:.2f} + "
    f"{first.cost_speed:.2f} at alpha = 0, {last.cost_torque:.2f} + {last.cost_speed:.2f} "
    f"learned; largest share of a limit {last.worst:.2f}"
)

rng = np.random.default_rng(0)
worst = np.zeros(2)
for _ in range(100):
    f = replace(learned.map, alpha=0.2 * rng.standard_normal(learned.map.alpha.shape))
    q = np.array([rng.uniform(-0.4, 0.4), rng.uniform(0.2, 1.0), design.q_catch])
    r_o, dr_o = arm.position(q), np.array([-rng.uniform(3, 7), *rng.uniform(-1, 1, 2)])
    ball = mitt.BallState(
        t=0.0,
        tracked=True,
        r_o=r_o,
        dr_o=dr_o,
        ddr_o=np.zeros(3),
        drag=0.0,
        covariance=np.eye(6),
        t_seen=0.0,
        t_first=0.0,
    )
    reference = f.reference(ball)
    hand = arm.jacobian(reference.q_d) @ reference.dq_d
    gaps = arm.position(reference.q_d) - r_o, hand - dr_o
    worst = np.maximum(worst, [np.linalg.norm(gap) for gap in gaps])
print(f"100 random alpha: at most {worst[0]:.1e} m and {worst[1]:.1e} m/s at the catch")
