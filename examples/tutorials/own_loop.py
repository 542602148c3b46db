"""Your loop: a tracker and a controller of your own around the map, each millisecond."""

from dataclasses import replace
from math import pi

import numpy as np

import mitt
from mitt.core.ball.filter import THROWN_BALL
from mitt.core.control.setpoints import Setpoints
from mitt.core.map.demand import Tolerance
from mitt.core.signals import Array

TICK = 0.001  # s
FALL = np.array([0.0, 0.0, -9.81])  # m/s^2

arm = mitt.load_arm("wam", limits="paper")
learned = mitt.learn(arm)  # some seconds, once; keep it: mitt learn --out MAP.json

SIGMA = 0.001  # standard deviation of a measured coordinate [m]


class Tracker:
    """Fits a ball in free fall to measured positions by least squares."""

    def __init__(self) -> None:
        self.t: list[float] = []
        self.r: list[Array] = []

    def saw(self, t: float, r: Array) -> None:
        """Take a measured position [m] and its time [s]."""
        self.t.append(t)
        self.r.append(r)

    def state(self, t: float) -> mitt.BallState:
        """Return what is known of the ball at time t [s]."""
        since = np.array(self.t) - t
        A = np.stack([np.ones_like(since), since], axis=1)
        r_o, dr_o = np.linalg.lstsq(A, np.array(self.r) - 0.5 * since[:, None] ** 2 * FALL)[0]
        covariance = np.kron(np.linalg.inv(A.T @ A), SIGMA**2 * np.eye(3))
        return mitt.BallState(t=t, r_o=r_o, dr_o=dr_o, covariance=covariance)


class Robot:
    """A simulated arm with a computed-torque controller that keeps the torque limits."""

    def __init__(self) -> None:
        self.q, self.dq = arm.q_ready.copy(), np.zeros(arm.n)
        self.torque = self.speed = 0.0  # largest shares of the limits so far

    def track(self, q_d: Array, dq_d: Array, ddq_d: Array) -> None:
        """Track a reference for one tick."""
        wish = ddq_d + 80.0 * (dq_d - self.dq) + 1600.0 * (q_d - self.q)
        tau = arm.inverse_dynamics(self.q, self.dq, wish)
        tau = np.clip(tau, -arm.tau_max, arm.tau_max)
        bias = arm.inverse_dynamics(self.q, self.dq, np.zeros(arm.n))
        self.dq = self.dq + TICK * np.linalg.solve(arm.mass_matrix(self.q), tau - bias)
        self.q = self.q + TICK * self.dq
        self.torque = max(self.torque, float(np.max(np.abs(tau) / arm.tau_max)))
        self.speed = max(self.speed, float(np.max(np.abs(self.dq) / arm.dq_max)))


rng = np.random.default_rng(7)
release = np.array([3.6, 0.15, 0.2])
velocity = np.array([-5.9, -0.2, 2.2])


def measure(t: float) -> Array:
    """Return where the ball is seen at time t [m]: your camera or motion capture."""
    return release + t * velocity + 0.5 * t * t * FALL + SIGMA * rng.standard_normal(3)


tracker = Tracker()
robot = Robot()
t = 0.0
while t < 0.1:  # watch before you move
    tracker.saw(t, measure(t))
    t += TICK
ball = tracker.state(t)

within = Tolerance(torque=1.0, speed=1.0, acceleration=1.0)  # in shares of the limits
verdict = mitt.Direct(learned.map, within).verdict(ball, robot.q)
print(f"{verdict.outcome.value}: {100 * verdict.share:.0f} % of {verdict.binding_limit}")
if verdict.outcome is not mitt.Outcome.FEASIBLE:
    raise SystemExit("the arm stays where it is")

f = learned.map.adapt(ball, robot.q, robot.dq)  # eq. (12): this throw, from this state
reference = f.reference(ball)
while ball.tracked and reference.time_to_catch > 0.5 * TICK:
    robot.track(reference.q_d, reference.dq_d, reference.ddq_d)
    t += TICK
    tracker.saw(t, measure(t))
    ball = tracker.state(t)
    reference = f.reference(ball)
    # here: close your hand, so early that it has closed a few milliseconds before the catch

gap = 1e3 * np.linalg.norm(arm.position(robot.q) - ball.r_o)
relative = np.linalg.norm(arm.jacobian(robot.q) @ robot.dq - ball.dr_o)
print(f"at the catch: {gap:.1f} mm and {relative:.2f} m/s between hand and ball")
print(f"largest torque {100 * robot.torque:.0f} %, speed {100 * robot.speed:.0f} % of the limits")

brake = mitt.plan_brake(arm, t, np.array([robot.q, robot.dq, np.zeros(arm.n)]))
while not brake.over(t):
    robot.track(*brake.at(t))
    t += TICK
print(f"at rest {1e3 * brake.duration:.0f} ms later, at {np.abs(robot.dq).max():.3f} rad/s")

flight = replace(THROWN_BALL, drag_mean=0.0, drag_sigma=0.002)  # if not said: 0.04 1/m
mitt.simulate(learned, throws=1, pixels=False)  # loads all that is compiled, before the arm moves
catcher = mitt.Catcher(arm, learned, settings=mitt.CatcherSettings(flight=flight))
q = arm.q_ready.copy()
dq = np.zeros(arm.n)
t = 0.0
nearest = np.inf
while not catcher.done:
    seen = mitt.Sighting(t=t, found=True, r_o=measure(t), covariance=SIGMA**2 * np.eye(3))
    reading = mitt.ArmState(t=t, q=q, dq=dq)
    command = catcher.step(mitt.Senses(t=t, arm=reading, points=(seen,)))
    bias = arm.inverse_dynamics(q, dq, np.zeros(arm.n))  # here: command.tau to your drives
    dq = dq + TICK * np.linalg.solve(arm.mass_matrix(q), command.tau - bias)
    q = q + TICK * dq
    catcher.think()  # after the command has left: the verdict, and adaptation
    t += TICK
    ball_now = release + t * velocity + 0.5 * t * t * FALL
    nearest = min(nearest, float(np.linalg.norm(arm.position(q) - ball_now)))
# here: engage your brakes, or go on with the loop, whose commands hold the arm and the ball
print(f"{catcher.phase.value}, {1e3 * nearest:.1f} mm from the ball at the nearest")

servo = 2.0 * pi * 8.0
delay = 4  # bandwidth [rad/s] and delay [ticks]: measure both
setpoints = Setpoints(arm, "position", bandwidth=servo, delay=delay * TICK)
settings = mitt.CatcherSettings(
    bandwidth=servo, setpoint_delay=delay, torque_lead=TICK * (1 + delay)
)
told = setpoints.lead(command, catcher.estimated[0])  # each tick; told.q goes to the robot
