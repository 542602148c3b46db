"""Online optimisation measured: cost against each throw's own optimum, noise, time.

    python benchmarks/online.py --throws 500 --seed 8000

Three tables: the cost of projection alone and of projection and refinement on noise-free flights,
beside the optimum of the same problem (same t_0, limits, polynomial), which Gauss-Newton steps
with Pinocchio's derivatives find from several starts; the largest torque asked for before any
saturation where the ball is seen with 0.5 mm of noise; the time of a step and of a certificate.
"""

import argparse
import json
import sys
import time
from dataclasses import dataclass

import numpy as np

from mitt.bench.libraries import ball_at
from mitt.generator.constraints import initial_gap, initial_matrix, project
from mitt.generator.demand import Demand, Tolerance, demand
from mitt.generator.foresight import flown, foresee
from mitt.generator.mapping import DirectMap
from mitt.generator.online import Online, OnlineSettings
from mitt.generator.program import cost, limit_rows, sensitivity, solve
from mitt.robot.load import load_arm
from mitt.signals import Array, Sighting
from mitt.trials.aim import aim_of
from mitt.trials.learning import learn
from mitt.vision.filter import THROWN_BALL, BallFilter
from mitt.world.throws import Throw, default_throw

#: Start of the arm after release [s], time followed after the catch [s], tick [s].
_T_0, _LATE, _TICK = 0.082, 0.012, 0.001
#: Noise of the sightings [m].
_SIGMA = 0.0005
#: Of the optimum: instants, steps, relative gain at which it has converged, weight of excess.
_INSTANTS, _STEPS, _SMALL, _WEIGHT = 60, 60, 1e-6, 10.0


@dataclass(frozen=True, slots=True)
class Ride:
    """What a flight demanded of the arm, and the times of its online steps [us]."""

    demand: Demand
    times: list[float]


def ride(f: DirectMap, throw: Throw, online: Online | None, *, rng: np.random.Generator | None,
         alpha: Array | None = None) -> Ride:  # fmt: skip
    """Follow a ball tick by tick from t_0 to a little past the catch, refining each millisecond.

    Args:
        f: The learned map.
        throw: The throw.
        online: What refines; None for the coefficients of the start alone.
        rng: Source of the noise with which the ball is seen; None for a ball known exactly.
        alpha: Coefficients of the start; those of the projection if left out.
    """
    sight, motions, times = BallFilter(THROWN_BALL), [], []
    first = ball_at(throw, _T_0)
    end = _T_0 + foresee(f, first).after + _LATE
    for tick in range(0 if rng else round(_T_0 / _TICK), int(end / _TICK)):
        ball = ball_at(throw, tick * _TICK)
        if rng is not None:
            seen = ball.r_o + _SIGMA * rng.standard_normal(3)
            sight.update(Sighting(t=ball.t, found=True, r_o=seen, covariance=_SIGMA**2 * np.eye(3)))
            ball = sight.state(ball.t)
        if tick < round(_T_0 / _TICK):
            continue
        if alpha is None:
            alpha = f.adapt(ball, f.arm.q_ready, np.zeros(f.arm.n)).alpha
        g = f.with_alpha(alpha)
        motions.append(g.motion(np.array([ball.r_o, ball.dr_o, ball.ddr_o]))[1][:3])
        if online is not None:
            start = time.perf_counter()
            alpha = online.refine(alpha, ball).alpha
            times.append(1e6 * (time.perf_counter() - start))
    return Ride(demand(f.arm, np.array(motions)), times)


def optimum(f: DirectMap, throw: Throw, rng: np.random.Generator) -> Array:
    """Return the throw's own best coefficients, of three starts."""
    ball = ball_at(throw, _T_0)
    path = flown(ball, np.linspace(0.0, foresee(f, ball).after + _LATE, _INSTANTS))
    virtual = np.array([f.virtual(row)[1] for row in path])
    phi = np.array([f.basis.jets(*rows[:, list(f.design.free)]) for rows in virtual])
    gap = initial_gap(f.arm.q_ready, np.zeros(f.arm.n), virtual[0])
    starts = [f.alpha, 0.0 * f.alpha, f.alpha + 0.3 * rng.standard_normal(f.alpha.shape)]
    ends = [
        _converged(f, virtual, phi, project(start, f.H_inverse, phi[0, :2], gap))
        for start in starts
    ]
    return min(ends, key=lambda alpha: _merit(f, virtual + phi @ alpha))


def _merit(f: DirectMap, motion: Array) -> float:
    """Return cost (22) and the price of limits exceeded."""
    asked = demand(f.arm, motion)
    over = np.concatenate([asked.torque.ravel(), asked.speed.ravel()]) - 0.92
    excess = float(np.sum(np.maximum(over, 0.0) ** 2) + np.sum(asked.excess**2))
    return asked.cost + _WEIGHT * excess / len(motion)


def _converged(f: DirectMap, virtual: Array, phi: Array, alpha: Array) -> Array:
    """Return where Gauss-Newton steps within the initial constraint end."""
    C = initial_matrix(phi[0, :2], f.arm.n)
    free = np.linalg.svd(C / np.linalg.norm(C, axis=1, keepdims=True))[2][len(C) :].T
    last = _merit(f, virtual + phi @ alpha)
    for _ in range(_STEPS):
        s = sensitivity(f.arm, virtual + phi @ alpha, phi)
        torque, speed, J = cost(f.arm, s)
        residual, J = np.concatenate([torque.ravel(), speed.ravel()]), J @ free
        H = 2.0 * J.T @ J / _INSTANTS
        H += 1e-10 * np.trace(H) * np.eye(len(H))
        rows = limit_rows(f.arm, s, share=0.92, near=0.6)
        gradient = 2.0 * J.T @ residual / _INSTANTS
        step = solve(H, gradient, (rows.rows @ free, rows.room), weight=_WEIGHT / _INSTANTS)
        if step is None:
            break
        tries = [alpha + 0.5**k * (free @ step).reshape(alpha.shape) for k in range(8)]
        merits = [_merit(f, virtual + phi @ x) for x in tries]
        best = int(np.argmin(merits))
        if merits[best] > last * (1.0 - _SMALL):
            break
        alpha, last = tries[best], merits[best]
    return alpha


def measure(f: DirectMap, throws: int, seed: int, settings: OnlineSettings) -> dict[str, object]:
    """Return all figures over so many throws."""
    rng = np.random.default_rng(seed)
    aim = aim_of(f.arm)
    gaps, plain, asked, asked_plain, times, certified = [], [], [], [], [], []
    for k in range(throws):
        throw = default_throw(rng, aim)
        best = ride(f, throw, None, rng=None, alpha=optimum(f, throw, np.random.default_rng(k)))
        online = ride(f, throw, Online(f, settings), rng=None)
        gaps.append(online.demand.cost / best.demand.cost - 1.0)
        plain.append(ride(f, throw, None, rng=None).demand.cost / best.demand.cost - 1.0)
        noisy = ride(f, throw, Online(f, settings), rng=np.random.default_rng(k))
        asked.append(float(noisy.demand.torque.max()))
        bare = ride(f, throw, None, rng=np.random.default_rng(k))
        asked_plain.append(float(bare.demand.torque.max()))
        times += online.times[2:-60]
        certified += _certificates(f, throw, settings)
        if (k + 1) % 10 == 0:
            gap = f"{np.mean(gaps):.4f}, largest {max(gaps):.4f}, asked {max(asked):.2f}"
            print(f"{k + 1} of {throws}: gap {gap}", file=sys.stderr, flush=True)
    return {
        "throws": throws,
        "seed": seed,
        "pull": settings.pull,
        "gap": _spread(gaps) | {"within_10_percent": float(np.mean(np.array(gaps) <= 0.10))},
        "gap_projection": _spread(plain),
        "asked_with_noise": _spread(asked) | {"above_1.2": int(np.sum(np.array(asked) > 1.2))},
        "asked_with_noise_projection": _spread(asked_plain),
        "step_us": _times(times),
        "certificate_us": _times(certified),
    }


def _certificates(f: DirectMap, throw: Throw, settings: OnlineSettings) -> list[float]:
    """Return the times of twenty certificates of a throw [us]."""
    ball, online, times = ball_at(throw, _T_0), Online(f, settings), []
    alpha = f.adapt(ball, f.arm.q_ready, np.zeros(f.arm.n)).alpha
    for _ in range(20):
        answer = online.refine(alpha, ball)
        start = time.perf_counter()
        online.certify(answer.alpha, ball, tolerance=Tolerance())
        times.append(1e6 * (time.perf_counter() - start))
    return times[1:]


def _spread(values: list[float]) -> dict[str, float]:
    """Return mean, 99th percentile and largest."""
    x = np.array(values)
    return {"mean": float(x.mean()), "p99": float(np.percentile(x, 99)), "max": float(x.max())}


def _times(values: list[float]) -> dict[str, float]:
    """Return median, p99 and p99.9."""
    p50, p99, p99_9 = np.percentile(values, [50, 99, 99.9])
    return {"p50": float(p50), "p99": float(p99), "p99_9": float(p99_9)}


def main() -> None:
    """Measure and print one JSON object."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--throws", type=int, default=500)
    parser.add_argument("--seed", type=int, default=8000)
    parser.add_argument("--limits", default="paper")
    parser.add_argument("--pull", type=float, default=OnlineSettings().pull)
    options = parser.parse_args()
    f = learn(load_arm("wam", limits=options.limits)).map
    settings = OnlineSettings(pull=options.pull)
    print(json.dumps(measure(f, options.throws, options.seed, settings), indent=1))


if __name__ == "__main__":
    main()
