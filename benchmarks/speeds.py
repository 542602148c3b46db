"""How fast a ball can be: catch rate against release speed, for each limit set.

    python benchmarks/speeds.py                                   4 to 9 m/s, three limit sets
    python benchmarks/speeds.py --limits wam-48v --throws 50 --vision points --generator several

Throws of a speed are aimed at the box of the default throws, by flights of 0.35 to 0.65 s, and
written to OUT/throws-<speed>.csv, so that ``mitt catch --throws-file`` repeats any row. A row's
speed lies within 0.5 m/s of what it says. ``bound`` is the share of throws that the arm could meet
at all: somewhere on the flight there is a pose whose palm faces the ball to 25 degrees, and each
joint alone, at its peak torque, its no-load speed and its least inertia, gets there in time. What
is refused below the bound is the map's or the estimate's doing, not that of physics.
"""

import argparse
from collections import Counter
from pathlib import Path

import numpy as np

from mitt.flight import advance
from mitt.link.files import write_json
from mitt.options import CatchOptions
from mitt.robot.arm import Arm
from mitt.robot.load import load_arm
from mitt.signals import Array
from mitt.study.aim import aim_of
from mitt.study.catch import Finished, prepare, run
from mitt.study.score import Trial
from mitt.world.throws import Throw, ThrowRanges, default_throw

SETS = ("paper", "wam-80v", "wam-48v")
SPEEDS = (4.0, 5.0, 6.0, 7.0, 8.0, 9.0)
#: Time of flight [s] and distance [m] of these throws, and half the width of a row [m/s].
DURATION, DISTANCE, HALF = (0.35, 0.65), (1.2, 5.0), 0.5
#: Step in which the bound looks along a flight, and the earliest start of an arm [s].
STEP, START = 0.005, 0.03


def write_throws(path: Path, speed: float, *, count: int, seed: int) -> float:
    """Write throws of one speed; return their mean release speed [m/s]."""
    rng = np.random.default_rng([seed, int(10 * speed)])
    ranges = ThrowRanges(duration=DURATION, distance=DISTANCE, speed=(speed - HALF, speed + HALF))
    aim = aim_of(load_arm("wam"))
    throws = [default_throw(rng, aim, ranges) for _ in range(count)]
    rows = [",".join(f"{x:.17g}" for x in (*throw.r, *throw.dr)) for throw in throws]
    path.write_text("\n".join(["x,y,z,vx,vy,vz", *rows]) + "\n", encoding="utf-8")
    return float(np.mean([np.linalg.norm(throw.dr) for throw in throws]))


def meets(arm: Arm, throw: Throw) -> bool:
    """Say whether the arm could be in the way of a throw, palm ahead: a bound, not a plan."""
    angles = np.linspace(arm.q_min[2], arm.q_max[2], 400)
    points = np.array([arm.position(np.array([0.0, 0.0, x])) for x in angles])
    radius, bearing = np.hypot(points[:, 0], points[:, 2]), np.arctan2(points[:, 0], points[:, 2])
    r, dr = throw.r.copy(), throw.dr.copy()
    for t in np.arange(STEP, 1.0, STEP):
        advance(r, dr, 0.04, STEP)
        yaw, lean = np.arctan2(r[1], r[0]), np.arctan2(np.hypot(r[0], r[1]), r[2])
        gap = radius - np.linalg.norm(r)
        for k in np.flatnonzero(gap[1:] * gap[:-1] <= 0.0):
            q = np.array([yaw, lean - bearing[k], angles[k]])
            if _in_time(arm, q, t - START) and _facing(arm, q, dr):
                return True
    return False


def _in_time(arm: Arm, q: Array, left: float) -> bool:
    """Say whether each joint alone gets from the ready pose to ``q`` in the time left [s]."""
    if left <= 0.0 or np.any(q < arm.q_min) or np.any(q > arm.q_max):
        return False
    folded = np.array([arm.mass_matrix(np.array([0.0, x, 3.0])) for x in (0.0, 0.8)])
    rate = arm.tau_max / np.diagonal(folded, axis1=1, axis2=2).min(axis=0)
    rising = np.minimum(left, arm.dq_max / rate)
    way = 0.5 * rate * rising**2 + arm.dq_max * (left - rising)
    return bool(np.all(np.abs(q - arm.q_ready) <= way))


def _facing(arm: Arm, q: Array, dr: Array) -> bool:
    """Say whether a ball flying at ``dr`` comes within 25 degrees of the palm's normal."""
    normal = arm.orientation(q)[:, 2]
    return bool(-dr @ normal >= np.cos(np.deg2rad(25.0)) * np.linalg.norm(dr))


def row(finished: Finished) -> dict[str, object]:
    """Return what the table says of one limit set at one speed."""
    trials, summary = finished.trials, finished.result["summary"]
    design, thrown = finished.learned.map.design, finished.prepared.source.throws
    forces = [t.peak_contact_force_n for t in trials if t.peak_contact_force_n is not None]
    relative = [t.velocity_error_m_s for t in trials if t.velocity_error_m_s is not None]
    return {
        **{key: summary[key] for key in ("caught", "dropped", "missed", "unreachable", "ci95")},
        "bound": float(np.mean([meets(finished.prepared.arm, throw) for throw in thrown])),
        "kappa": design.kappa,
        "inward": design.inward,
        "q_catch": design.q_catch,
        "binds": _most(trials, caught=True),
        "fails_by": _most(trials, caught=False),
        "force_n": float(np.median(forces)) if forces else None,
        "relative_m_s": float(np.median(relative)) if relative else None,
        "violations": sum(t.limit_violations for t in trials),
    }


def _most(trials: list[Trial], *, caught: bool) -> str:
    """Return the limit that binds most often among the trials that were caught, or were not."""
    names = Counter(str(t.binding_limit) for t in trials if (t.status == "caught") == caught)
    return names.most_common(1)[0][0] if names else "-"


def main() -> None:
    """Throw, print, save."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--limits", nargs="+", default=SETS)
    parser.add_argument("--speeds", nargs="+", type=float, default=SPEEDS)
    parser.add_argument("--throws", type=int, default=100)
    parser.add_argument("--seed", type=int, default=8200)
    parser.add_argument("--vision", default="pixels", choices=("pixels", "points"))
    parser.add_argument("--generator", default="direct", choices=("direct", "several"))
    parser.add_argument("--out", type=Path, default=Path("runs/speeds"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    print(
        "limits    m/s caught dropped missed refused  bound  kappa inward  m/s rel    N"
        "  binds / fails by"
    )
    table = []
    for limits in options.limits:
        for speed in options.speeds:
            path = options.out / f"throws-{speed:g}.csv"
            write_throws(path, speed, count=options.throws, seed=options.seed)
            job = CatchOptions(
                limits=limits,
                throws_file=path,
                seed=options.seed,
                vision=options.vision,
                generator=options.generator,
                out=options.out / "unused",
            )
            found = row(run(prepare(job), progress=lambda *_: None))
            table.append({"limits": limits, "speed": speed, **found})
            print(
                f"{limits:9} {speed:3g} {found['caught']:6} {found['dropped']:7}"
                f" {found['missed']:6} {found['unreachable']:7}"
                f" {found['bound']:6.2f} {found['kappa']:6g} {found['inward']:6g}"
                f" {found['relative_m_s'] or np.nan:8.2f} {found['force_n'] or np.nan:4.0f}"
                f"  {found['binds']} / {found['fails_by']}",
                flush=True,
            )
    write_json(options.out / "speeds.json", {"schema": "mitt.speeds/1", "rows": table})


if __name__ == "__main__":
    main()
