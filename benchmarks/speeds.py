"""How fast a ball can be: catch rate against release speed, for each limit set.

    python benchmarks/speeds.py                                   4 to 9 m/s, three limit sets
    python benchmarks/speeds.py --limits wam-48v --throws 50 --vision points --generator several

Throws of a speed are aimed at the box of the default throws, by flights of 0.35 to 0.65 s, and
written to OUT/throws-<speed>.csv, so that ``mitt catch --throws-file`` repeats any row. A row's
speed lies within 0.5 m/s of what it says.
"""

import argparse
from collections import Counter
from pathlib import Path

import numpy as np

from mitt.link.files import write_json
from mitt.options import CatchOptions
from mitt.robot.load import load_arm
from mitt.study.catch import Finished, prepare, run
from mitt.study.neighbourhood import aim_of
from mitt.study.score import Trial
from mitt.world.throws import ThrowRanges, default_throw

SETS = ("paper", "wam-80v", "wam-48v")
SPEEDS = (4.0, 5.0, 6.0, 7.0, 8.0, 9.0)
#: Time of flight [s] and distance [m] of these throws, and half the width of a row [m/s].
DURATION, DISTANCE, HALF = (0.35, 0.65), (1.2, 5.0), 0.5


def write_throws(path: Path, speed: float, *, count: int, seed: int) -> float:
    """Write throws of one speed; return their mean release speed [m/s]."""
    rng = np.random.default_rng([seed, int(10 * speed)])
    ranges = ThrowRanges(duration=DURATION, distance=DISTANCE, speed=(speed - HALF, speed + HALF))
    aim = aim_of(load_arm("wam"))
    throws = [default_throw(rng, aim, ranges) for _ in range(count)]
    rows = [",".join(f"{x:.17g}" for x in (*throw.r, *throw.dr)) for throw in throws]
    path.write_text("\n".join(["x,y,z,vx,vy,vz", *rows]) + "\n", encoding="utf-8")
    return float(np.mean([np.linalg.norm(throw.dr) for throw in throws]))


def row(finished: Finished) -> dict[str, object]:
    """Return what the table says of one limit set at one speed."""
    trials, summary = finished.trials, finished.result["summary"]
    design = finished.learned.map.design
    forces = [t.peak_contact_force_n for t in trials if t.peak_contact_force_n is not None]
    relative = [t.velocity_error_m_s for t in trials if t.velocity_error_m_s is not None]
    return {
        **{key: summary[key] for key in ("caught", "dropped", "missed", "unreachable", "ci95")},
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
        "limits    m/s caught dropped missed refused  kappa inward  m/s rel    N  binds / fails by"
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
                f" {found['kappa']:6g} {found['inward']:6g}"
                f" {found['relative_m_s'] or np.nan:8.2f} {found['force_n'] or np.nan:4.0f}"
                f"  {found['binds']} / {found['fails_by']}",
                flush=True,
            )
    write_json(options.out / "speeds.json", {"schema": "mitt.speeds/1", "rows": table})


if __name__ == "__main__":
    main()
