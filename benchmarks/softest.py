r"""How softly an arm's drives let it meet default throws, whatever plans its motion.

    python benchmarks/softest.py --limits wam-80v --aim 0.77,0,0.057 --balls 12 --starts 4

One ready pose for all balls; from there each motion is free: accelerations linear between even
instants, drives' torques and speeds and joint ranges kept, room for the brake after the catch.
IPOPT (extra ``mitt[rivals]``) looks for the least sum of relative speeds of hand and ball, from
several starts. The balls are those of ``mitt design --aim``, and they are known. A motion begins
80 ms after the release and uses 0.95 of torques and speeds. IPOPT finds local optima, of which the
best is taken: a figure to compare with, no strict bound. With ``--palm`` the ball has to come in at
most so many degrees off the palm's normal. Prints a JSON object with the relative speed of each
ball [m/s].
"""

import argparse
import json
from itertools import islice

import numpy as np
from scipy.optimize import least_squares

from mitt.core.arm.arm import Arm
from mitt.core.ball.flight import acceleration
from mitt.core.signals import Array
from mitt.io.arm_file import ThrowSettings
from mitt.io.load import build_arm
from mitt.lab.design.task import BOX, FAR
from mitt.lab.rivals.clairvoyant import (
    PARTS,
    Symbolic,
    casadi,
    drive_rows,
    pose_after_braking,
    steps,
    symbolic,
)
from mitt.lab.trials.source import source_of, widened
from mitt.lab.world.flights import BallPath
from mitt.lab.world.scene import read_scene
from mitt.lab.world.throws import Throw, fly

#: Time after the release at which the arm begins [s], and how much earlier or later than the ball
#: is nearest to the aim it may be met [s].
BEGIN = 0.08
WINDOW = 0.08
#: Step in which a throw is followed to the aim [s], and for how long.
STEP = 0.001
LONGEST = 1.0
#: Poses drawn for each start: where the aim is out of reach none is found.
TRIES = 50
#: Share of torques and speeds that may be used; gap to the ends of the joint ranges [rad].
SHARE = 0.95
GAP = 0.08

#: A ball: time since its release [s]; position, velocity, acceleration then, shape (3, 3).
Ball = tuple[float, Array]


def balls_of(arm: Arm, aim: Array, count: int, seed: int) -> list[Ball]:
    """Return throws of ``mitt design --aim`` as they pass nearest to the aim."""
    drag = read_scene("lab").ball.drag
    half = FAR * np.array(BOX)
    box = ThrowSettings(at=tuple(aim.tolist()), around=tuple(half.tolist()))
    source = widened(source_of(arm, seed=seed, drag=drag, count=count), box)
    return [_nearest(source.ball(k), aim, drag) for k in range(count)]


def _nearest(ball: Throw | BallPath, aim: Array, drag: float) -> Ball:
    """Return when and how a throw passes nearest to a point."""
    assert isinstance(ball, Throw)
    times = np.arange(0.0, LONGEST, STEP)
    states = [fly(ball.r, ball.dr, drag=drag, duration=float(t)) for t in times]
    k = int(np.argmin([np.linalg.norm(r - aim) for r, _ in states]))
    motion = np.zeros((3, 3))
    motion[:2] = states[k]
    acceleration(motion[1], drag, motion[2])
    return float(times[k]), motion


def start_of(arm: Arm, ball: Ball, rng: np.random.Generator) -> tuple[Array, Array] | None:
    """Return a pose that meets a ball, and joint speeds there; None where none is found."""
    position, velocity = ball[1][:2]
    low, high = arm.q_min + 0.1, arm.q_max - 0.1
    found = least_squares(
        lambda q: arm.position(q) - position, rng.uniform(low, high), bounds=(low, high)
    )
    if np.abs(found.fun).max() > 1e-3:
        return None
    dq = np.linalg.lstsq(arm.jacobian(found.x), velocity, rcond=None)[0]
    return found.x, np.clip(dq, -0.8 * arm.dq_max, 0.8 * arm.dq_max)


def softest(
    arm: Arm, model: Symbolic, balls: list[Ball], start: tuple[Array, Array], palm: float | None
) -> tuple[Array, Array] | None:
    """Return the ready pose and the relative speed of each ball; None where IPOPT ends without."""
    ca, n, (q_c, dq_c) = casadi(), arm.n, start
    problem = ca.Opti()
    ready = problem.variable(n)
    guess = np.clip(q_c - 0.2 * dq_c, arm.q_min + 0.1, arm.q_max - 0.1)
    problem.set_initial(ready, guess)
    speeds, cost = [], 0.0
    low, high = ca.DM(arm.q_min + GAP), ca.DM(arm.q_max - GAP)
    for comes, ball in balls:
        q, dq, a = (problem.variable(n, PARTS + 1) for _ in range(3))
        late = problem.variable()
        problem.subject_to(problem.bounded(-WINDOW, late, WINDOW))
        h = (comes + late - BEGIN) / PARTS
        problem.subject_to(q[:, 0] == ready)
        problem.subject_to(dq[:, 0] == 0)
        for rest in steps(q, dq, a, h):
            problem.subject_to(rest == 0)
        for value, least, most in drive_rows(
            arm, model.torque.map(PARTS + 1)(q, dq, a), dq, share=SHARE
        ):
            problem.subject_to(problem.bounded(least, value, most))
        for k in range(PARTS + 1):
            problem.subject_to(problem.bounded(low, q[:, k], high))
        problem.subject_to(problem.bounded(low, pose_after_braking(arm, q[:, -1], dq[:, -1]), high))
        r, dr, ddr = (ca.DM(row) for row in ball)
        tip = model.tip(q[:, -1], dq[:, -1], a[:, -1])
        problem.subject_to(tip[:, 0] == r + late * dr + 0.5 * late**2 * ddr)
        relative = dr + late * ddr - tip[:, 1]
        speeds.append(ca.sqrt(ca.sumsqr(relative) + 1e-6))
        if palm is not None:
            into = -ca.dot(relative, model.normal(q[:, -1]))
            problem.subject_to(into >= np.cos(palm) * speeds[-1])
        cost += ca.sqrt(ca.sumsqr(relative) + 0.01) + 1e-4 * ca.sumsqr(a / 50)
        for k in range(PARTS + 1):
            part = k / PARTS
            problem.set_initial(dq[:, k], part * dq_c)
            problem.set_initial(q[:, k], guess + part**2 * (q_c - guess))
        problem.set_initial(a, np.repeat((dq_c / (comes - BEGIN))[:, None], PARTS + 1, axis=1))
    problem.minimize(cost)
    options = {"print_level": 0, "sb": "yes", "max_iter": 400, "tol": 1e-4}
    problem.solver("ipopt", {"expand": True, "print_time": False}, options)
    try:
        found = problem.solve()
    except RuntimeError:
        return None
    return np.asarray(found.value(ready)), np.array([float(found.value(x)) for x in speeds])


def main() -> None:
    """Look for the softest motions, and print them."""
    parser = argparse.ArgumentParser(description="least relative speed of hand and ball")
    parser.add_argument("--limits", default="wam-80v")
    parser.add_argument("--aim", default="0.77,0,0.057", help="where balls come, x,y,z [m]")
    parser.add_argument("--joints", default="j1,j2,j4", help="joints that move")
    parser.add_argument("--palm", type=float, help="largest angle off the palm's normal [deg]")
    parser.add_argument("--balls", type=int, default=6)
    parser.add_argument("--starts", type=int, default=6)
    parser.add_argument("--seed", type=int, default=5)
    options = parser.parse_args()
    arm = build_arm("wam", limits=options.limits, joints=options.joints.split(","))
    rng = np.random.default_rng(options.seed)
    aim = np.array([float(x) for x in options.aim.split(",")])
    palm = None if options.palm is None else float(np.deg2rad(options.palm))
    balls, model, found = balls_of(arm, aim, options.balls, options.seed), symbolic(arm), []
    poses = (start_of(arm, balls[0], rng) for _ in range(TRIES * options.starts))
    for start in islice((x for x in poses if x is not None), options.starts):
        answer = softest(arm, model, balls, start, palm)
        found += [] if answer is None else [answer]
    ready, speeds = min(found, key=lambda x: float(np.sum(x[1])), default=(None, None))
    print(
        json.dumps(
            {
                "limits": options.limits,
                "aim": aim.tolist(),
                "joints": options.joints,
                "palm_deg": options.palm,
                "solved": len(found),
                "ready": None if ready is None else ready.round(3).tolist(),
                "relative_speed_m_s": None if speeds is None else speeds.round(3).tolist(),
                "median_m_s": None if speeds is None else round(float(np.median(speeds)), 3),
            }
        )
    )


if __name__ == "__main__":
    main()
