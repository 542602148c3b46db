r"""How softly an arm's drives let it meet a ball, whatever moves it.

    python benchmarks/softest.py --limits wam-80v --aim 0.75,0,0.05 --balls 6 --seed 5

One ready pose for all balls; from there each motion is free: accelerations linear between even
instants, drives' torques and speeds and joint ranges kept, room for the brake after the catch.
IPOPT (extra ``mitt[rivals]``) looks for the least sum of relative speeds of hand and ball, from
several starts. The balls are known: an arm that sees them can do no better. What the palm faces is
left free. Prints a JSON object with the relative speed of each ball [m/s].
"""

import argparse
import json
from itertools import islice

import numpy as np
from scipy.optimize import least_squares

from mitt.baselines.choice import FOLLOW
from mitt.baselines.intercept import hand_of
from mitt.baselines.symbolic import Expression, Symbolic, casadi, symbolic
from mitt.robot.arm import Arm
from mitt.robot.load import load_arm
from mitt.signals import GRAVITY, Array

#: Parts of a motion; time after the release at which it begins, and at which the ball comes [s].
PARTS, BEGIN, COMES = 16, 0.12, 0.5
#: How much earlier or later than it comes to the aim a ball may be met [s].
WINDOW = 0.1
#: Poses drawn for each start: where the aim is out of reach none is found.
TRIES = 50
#: Share of torques and speeds that may be used; gap to the ends of the joint ranges [rad].
TORQUE, SPEED, GAP = 0.9, 0.95, 0.08


def balls_of(aim: Array, count: int, rng: np.random.Generator) -> list[tuple[Array, Array]]:
    """Return position and velocity of balls as they come to the box about an aim."""
    out = []
    for _ in range(count):
        speed, descent = rng.uniform(5.0, 6.2), rng.uniform(0.05, 0.55)
        azimuth = rng.uniform(-0.12, 0.12)
        flat = np.array([-np.cos(azimuth), np.sin(azimuth), 0.0]) * np.cos(descent)
        v = speed * (flat - np.array([0.0, 0.0, np.sin(descent)]))
        out.append((aim + rng.uniform(-1.0, 1.0, 3) * np.array([0.1, 0.2, 0.1]), v))
    return out


def start_of(
    arm: Arm, ball: tuple[Array, Array], rng: np.random.Generator
) -> tuple[Array, Array] | None:
    """Return a pose that meets a ball, and joint speeds there; None where none is found."""
    position, velocity = ball
    low, high = arm.q_min + 0.1, arm.q_max - 0.1
    found = least_squares(
        lambda q: arm.position(q) - position, rng.uniform(low, high), bounds=(low, high)
    )
    if np.abs(found.fun).max() > 1e-3:
        return None
    dq = np.linalg.lstsq(arm.jacobian(found.x), velocity, rcond=None)[0]
    return found.x, np.clip(dq, -0.8 * arm.dq_max, 0.8 * arm.dq_max)


def softest(
    arm: Arm, model: Symbolic, balls: list[tuple[Array, Array]], start: tuple[Array, Array]
) -> tuple[Array, Array] | None:
    """Return the ready pose and the relative speed of each ball; None where IPOPT ends without."""
    ca, n, (q_c, dq_c) = casadi(), arm.n, start
    problem = ca.Opti()
    ready = problem.variable(n)
    guess = np.clip(q_c - 0.2 * dq_c, arm.q_min + 0.1, arm.q_max - 0.1)
    problem.set_initial(ready, guess)
    speeds, cost = [], 0.0
    for position, velocity in balls:
        q, dq, a = (problem.variable(n, PARTS + 1) for _ in range(3))
        t = problem.variable()
        problem.set_initial(t, COMES)
        problem.subject_to(problem.bounded(COMES - WINDOW, t, COMES + WINDOW))
        h = (t - BEGIN) / PARTS
        problem.subject_to(q[:, 0] == ready)
        problem.subject_to(dq[:, 0] == 0)
        problem.subject_to(dq[:, 1:] - dq[:, :-1] == 0.5 * h * (a[:, 1:] + a[:, :-1]))
        way = h * dq[:, :-1] + h**2 / 6 * (2 * a[:, :-1] + a[:, 1:])
        problem.subject_to(q[:, 1:] - q[:, :-1] == way)
        _keep_limits(problem, arm, model, (q, dq, a))
        late = t - COMES
        fall = ca.DM([0.0, 0.0, -GRAVITY])
        tip = model.tip(q[:, -1], dq[:, -1], a[:, -1])
        met = ca.DM(position) + late * ca.DM(velocity) + 0.5 * late**2 * fall
        problem.subject_to(tip[:, 0] == met)
        missing = ca.sumsqr(tip[:, 1] - ca.DM(velocity) - late * fall)
        speeds.append(ca.sqrt(missing + 1e-6))
        cost += ca.sqrt(missing + 0.01) + 1e-4 * ca.sumsqr(a / 50)
        for k in range(PARTS + 1):
            part = k / PARTS
            problem.set_initial(dq[:, k], part * dq_c)
            problem.set_initial(q[:, k], guess + part**2 * (q_c - guess))
        problem.set_initial(a, np.repeat((dq_c / (COMES - BEGIN))[:, None], PARTS + 1, axis=1))
    problem.minimize(cost)
    options = {"print_level": 0, "sb": "yes", "max_iter": 400, "tol": 1e-4}
    problem.solver("ipopt", {"expand": True, "print_time": False}, options)
    try:
        found = problem.solve()
    except RuntimeError:
        return None
    return np.asarray(found.value(ready)), np.array([float(found.value(x)) for x in speeds])


def _keep_limits(
    problem: Expression, arm: Arm, model: Symbolic, motion: tuple[Expression, ...]
) -> None:
    """Add drives' torques and speeds, joint ranges, and room for the brake."""
    ca, limits, (q, dq, a) = casadi(), arm.limits, motion
    torque = ca.mtimes(ca.DM(limits.to_drive), model.torque.map(PARTS + 1)(q, dq, a))
    speed = ca.mtimes(ca.DM(limits.transmission[:, list(arm.model.active)]), dq)
    for k in range(len(limits.dq_max)):
        run = speed[k, :].T / limits.dq_max[k]
        problem.subject_to(problem.bounded(-TORQUE, torque[k, :].T / limits.tau_peak[k], TORQUE))
        problem.subject_to(problem.bounded(-SPEED, run, SPEED))
        if np.isfinite(limits.tau_stall[k]):
            line = torque[k, :].T / (TORQUE * limits.tau_stall[k]) + run
            problem.subject_to(problem.bounded(-1, line, 1))
    low, high = ca.DM(arm.q_min + GAP), ca.DM(arm.q_max - GAP)
    for k in range(PARTS + 1):
        problem.subject_to(problem.bounded(low, q[:, k], high))
    last = dq[:, -1]
    inertia = ca.DM(hand_of(arm)[3:])
    way = FOLLOW * last + 0.5 * last * ca.sqrt(last**2 + 0.01) * inertia
    problem.subject_to(problem.bounded(low, q[:, -1] + way, high))


def main() -> None:
    """Look for the softest motions, and print them."""
    parser = argparse.ArgumentParser(description="least relative speed of hand and ball")
    parser.add_argument("--limits", default="wam-80v")
    parser.add_argument("--aim", default="0.75,0,0.05", help="where balls come, x,y,z [m]")
    parser.add_argument("--balls", type=int, default=6)
    parser.add_argument("--starts", type=int, default=6)
    parser.add_argument("--seed", type=int, default=5)
    options = parser.parse_args()
    arm, rng = load_arm("wam", limits=options.limits), np.random.default_rng(options.seed)
    aim = np.array([float(x) for x in options.aim.split(",")])
    balls, model, found = balls_of(aim, options.balls, rng), symbolic(arm), []
    poses = (start_of(arm, balls[0], rng) for _ in range(TRIES * options.starts))
    for start in islice((x for x in poses if x is not None), options.starts):
        answer = softest(arm, model, balls, start)
        found += [] if answer is None else [answer]
    ready, speeds = min(found, key=lambda x: float(np.sum(x[1])), default=(None, None))
    print(json.dumps({
        "limits": options.limits, "aim": aim.tolist(), "solved": len(found),
        "ready": None if ready is None else ready.round(3).tolist(),
        "relative_speed_m_s": None if speeds is None else speeds.round(3).tolist(),
        "median_m_s": None if speeds is None else round(float(np.median(speeds)), 3),
    }))  # fmt: skip


if __name__ == "__main__":
    main()
