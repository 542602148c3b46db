r"""What faults cost: catches with faults of vision, and how soon a broken encoder stops the arm.

    python benchmarks/faults.py                              all tables, 300 throws a row
    python benchmarks/faults.py --throws 1000 --only points  one table, more throws
    python benchmarks/faults.py --only pixels --rows "dropout 20 ms;10 % outliers" --seed 9000
    python benchmarks/faults.py --only encoders --limits all --throws 200 --workers 2
    python benchmarks/faults.py --only steps --limits panda        another arm
    python benchmarks/faults.py --json faults.json           keep the numbers

Throws, seeds and plants are the same in every row; a fault of some length begins at eight moments
from 0.05 to 0.40 s after release, for an eighth of the throws each. What the faults do to the
estimate: ``benchmarks/track.py``.
"""

import argparse
import json
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from math import ceil
from multiprocessing import get_context
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from arms import WAM, named

from mitt.core.arm.arm import Arm
from mitt.core.catcher.generators import Direct
from mitt.core.catcher.state import REASONS, Result, ticks_between
from mitt.core.control.health import ABORT
from mitt.core.map.mapping import DirectMap
from mitt.core.map.neighbourhood import learn
from mitt.core.signals import Array
from mitt.lab.trials.runner import TrialRunner
from mitt.lab.trials.score import STATUSES, measure
from mitt.lab.trials.source import aim_of
from mitt.lab.trials.statistics import wilson
from mitt.lab.world.scene import Scene
from mitt.lab.world.throws import Throw, default_throw
from mitt.lab.world.truth import Trace

SEED = 9000
#: Moments at which a fault begins, after release [s].
STARTS = tuple(float(t) for t in np.round(np.linspace(0.05, 0.40, 8), 3))
#: Speed below which the arm stands still [rad/s], and ticks after the brakes' time from which no
#: joint may creep.
STILL = 0.1
SETTLED = 300
#: Counts of motion from which a stuck encoder is due.
COUNTS = 5.0
#: Parts into which the throws of a row are dealt for several processes.
PARTS = 8
#: Columns of the table of encoders: counts, and spreads.
COUNTED = ("unseen", "violations", "engaged", "after_brakes", "restless")
SPREADS = ("delay_ms", "told_ms", "stop_ms", "brake_ms", "creep_mrad")
#: Arms that can be asked for, as of :mod:`arms`.
ALL = (*WAM, "panda")

Plan = Callable[[float], list[dict[str, Any]]]
Row = dict[str, Any]


def lasting(length: float, **fault: Any) -> Plan:  # noqa: ANN401 (fields of a fault)
    """Return a plan of one fault that begins at a moment and lasts [s]."""
    return lambda start: [{**fault, "start": start, "length": length}]


def alone(length: float, **fault: Any) -> Plan:  # noqa: ANN401 (fields of a fault)
    """Return a plan of one fault of one camera: each in turn, from moment to moment."""
    return lambda start: [
        {**fault, "camera": STARTS.index(start) % 2, "start": start, "length": length}
    ]


def always(**fault: Any) -> Plan:  # noqa: ANN401 (fields of a fault)
    """Return a plan of one fault throughout."""
    return lambda start: [fault]  # noqa: ARG005


COMMON: dict[str, Plan] = {
    "clean": lambda start: [],  # noqa: ARG005
    "dropout 5 ms": lasting(0.005, kind="dropout"),
    "dropout 20 ms": lasting(0.020, kind="dropout"),
    "dropout 50 ms": lasting(0.050, kind="dropout"),
    "dropout 100 ms": lasting(0.100, kind="dropout"),
    "half lost": always(kind="dropout", magnitude=0.5),
    "90 % lost": always(kind="dropout", magnitude=0.9),
    "5 ms late, stamped": always(kind="latency", magnitude=0.005),
    "20 ms late, stamped": always(kind="latency", magnitude=0.020),
    "10 % late by 2 ms": always(kind="late", magnitude=0.002, chance=0.1),
    "half late by 5 ms": always(kind="late", magnitude=0.005, chance=0.5),
    "10 % doubled": always(kind="duplicate", magnitude=0.1),
    "frozen 100 ms": lasting(0.100, kind="frozen"),
    "1 % outliers": always(kind="outlier", magnitude=0.3, chance=0.01),
    "10 % outliers": always(kind="outlier", magnitude=0.3, chance=0.1),
}
PIXELS: dict[str, Plan] = {
    "frozen 100 ms, numbered": lasting(0.100, kind="frozen", numbered=True),
    "one camera lost 50 ms": alone(0.050, kind="dropout"),
    "one camera lost 100 ms": alone(0.100, kind="dropout"),
    "one camera frozen 100 ms": alone(0.100, kind="frozen"),
}
ENCODERS = ("stuck", "jump", "dropout", "sign", "30 % lost")
#: Resolutions of encoders, 0 for exact ones [rad].
STEPS = (0.0, 1e-5, 3e-5, 1e-4, 3e-4, 1e-3)


def scene_of(plan: list[dict[str, Any]]) -> Scene:
    """Return the default scene with a plan of faults."""
    return Scene.model_validate({"faults": plan})


def thrown(count: int, f: DirectMap, seed: int) -> list[Throw]:
    """Return the throws of every row."""
    rng, aim = np.random.default_rng(seed), aim_of(f.arm)
    return [default_throw(rng, aim) for _ in range(count)]


def catches(f: DirectMap, plan: Plan, throws: Sequence[Throw], *, pixels: bool, seed: int) -> Row:
    """Throw with a fault; return how many were caught and what became of the rest."""
    status: list[str] = []
    violations = 0
    for part, start in enumerate(STARTS):
        runner = TrialRunner(f.arm, Direct(f), scene_of(plan(start)), pixels=pixels)
        for k in range(part, len(throws), len(STARTS)):
            trial = runner.run(k, throws[k], seed=seed + k).trial
            status.append(trial.status)
            violations += trial.limit_violations
    caught = status.count("caught")
    low, high = wilson(caught, len(throws))
    named = STATUSES[1:]
    return {
        "throws": len(throws),
        "caught": caught,
        "rate": caught / len(throws),
        "low": low,
        "high": high,
        "violations": violations,
        **{name: status.count(name) for name in named},
    }


def vision(
    f: DirectMap, plans: dict[str, Plan], throws: list[Throw], *, pixels: bool, seed: int
) -> Row:
    """Print and return the table of catches."""
    table: Row = {}
    print(
        f"{'pixels' if pixels else 'points':28s}caught of throws   rate [95 %]   of clean   "
        "dropped missed unreachable stopped aborted   violations"
    )
    for name, plan in plans.items():
        row = catches(f, plan, throws, pixels=pixels, seed=seed)
        row["of_clean"] = row["rate"] / (table or {"clean": row})["clean"]["rate"]
        table[name] = row
        print(
            f"{name:28s}{row['caught']:6d} of {row['throws']:4d}   {row['rate']:.3f}"
            f" [{row['low']:.3f}, {row['high']:.3f}]   {row['of_clean']:.3f}   "
            f"{row['dropped']:4d}{row['missed']:6d}{row['unreachable']:8d}{row['stopped']:10d}"
            f"{row['aborted']:8d}"
            f"{row['violations']:8d}",
            flush=True,
        )
    return table


def broken(f: DirectMap, kind: str, throws: list[Throw], seed: int, numbers: range) -> Row:
    """Break an encoder in some of the throws, each joint in turn.

    Returns:
        Delays [ms], and what became of the arm.
    """
    rows: Row = {name: [] for name in SPREADS}
    rows |= dict.fromkeys(COUNTED, 0) | {"reasons": []}
    for k in numbers:
        rng, joint = np.random.default_rng((seed, k)), k % f.arm.n
        start, size = float(rng.uniform(0.15, 0.45)), float(rng.uniform(0.05, 1.0))
        size *= float(rng.choice([-1.0, 1.0]))
        runner = TrialRunner(
            f.arm, Direct(f), scene_of([_fault(kind, joint, start, size)]), pixels=False
        )
        rows["violations"] += runner.run(k, throws[k], seed=seed + k).trial.limit_violations
        ticks, truth = runner.ticks, runner.world.trace()
        stopped = np.flatnonzero(ticks.scalars["health"] == ABORT)
        if not len(stopped):
            rows["unseen"] += 1
            continue
        rows["reasons"].append(REASONS[ticks.scalars["reason"][stopped[0]]].value)
        stop, first = int(stopped[0]), round(start / 0.001)
        shows = _shows(kind, truth.q[:, joint], first, f.arm.encoder_step[joint])
        rows["delay_ms"].append(max(stop - shows, 0))
        told = np.flatnonzero(ticks.command[:, 1].any(axis=1))
        rows["told_ms"].append(max(int(told[-1]) + 1 - stop, 0) if len(told) else 0)
        command, brake = (
            ticks.command[max(stop - 1, 0), 1],
            runner.catcher().state.safety.bounds["deceleration"],
        )
        rows["brake_ms"].append(float(1e3 * np.max(np.abs(command) / brake)))
        _at_rest(rows, f.arm, ticks, truth, stop)
    return rows


def gathered(parts: list[Row]) -> Row:
    """Return the rows of several processes as one."""
    out: Row = {}
    for part in parts:
        for name, value in part.items():
            out[name] = out[name] + value if name in out else value
    out["reasons"] = sorted(set(out["reasons"]))
    return out


def _fault(kind: str, joint: int, start: float, size: float) -> dict[str, Any]:
    """Return a fault of an encoder, or of all where readings are lost now and then."""
    if kind == "30 % lost":
        return {"kind": "nan", "where": "encoders", "magnitude": 0.3}
    return {"kind": "encoder", "fault": kind, "joint": joint, "start": start, "magnitude": size}


def _at_rest(rows: Row, arm: Arm, ticks: Result, truth: Trace, stop: int) -> None:
    """Note what became of the arm after a stop: when it rested, and whether it stayed.

    The brakes' time is their delay and what the slowest joint needs to brake.
    """
    moving = np.flatnonzero(np.abs(truth.dq).max(axis=1) > STILL)
    rows["stop_ms"].append(max(int(moving[-1]) + 1 - stop, 0) if len(moving) else 0)
    held = stop + round(max(brake.delay for brake in arm.brakes) / 0.001)
    for name, since in (("engaged", held), ("after_brakes", held + ceil(rows["brake_ms"][-1]))):
        later = Trace._make(x[since:] for x in truth)
        if len(later.t) > 1:
            rows[name] += measure(
                arm, ticks_between(ticks, since, len(truth.t)), later
            ).limit_violations
    if held + 1 < len(truth.t):
        rest = truth.q[min(held + SETTLED, len(truth.t) - 1) :]
        rows["restless"] += int(np.abs(truth.dq[-1]).max() > STILL)
        rows["creep_mrad"].append(float(1e3 * np.ptp(rest, axis=0).max()))


def _shows(kind: str, q: Array, first: int, count: float) -> int:
    """Return the tick from which a fault can be seen at all; resolution ``count`` [rad]."""
    if kind in ("jump", "dropout"):
        return first
    moved = np.abs(q[first:] - q[max(first - 1, 0)]) > COUNTS * count
    return first + int(np.argmax(moved)) if moved.any() else first


def encoders(f: DirectMap, throws: list[Throw], seed: int, workers: int) -> Row:
    """Print and return the table of broken encoders."""
    table: Row = {}
    print(
        "encoder   stopped   delay [ms] p50 p99 max   command at rest [ms] p50 p99 max   "
        "arm at rest p50 p99 max   brake alone p50 max   creep [mrad] p50 p99 max   "
        "ticks beyond a limit, once brakes act, after the brakes' time, "
        "arms not at rest at the end"
    )
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        for kind in ENCODERS:
            jobs = [
                pool.submit(broken, f, kind, throws, seed, range(part, len(throws), PARTS))
                for part in range(PARTS)
            ]
            row = gathered([job.result() for job in jobs])
            columns = [np.array(row[name]) for name in SPREADS]
            table[kind] = {"throws": len(throws), "detected": len(columns[0]), **row}
            spread = "   ".join(
                f"{np.median(x):4.0f}{np.quantile(x, 0.99):5.0f}{x.max():5.1f}"
                for x in columns
                if len(x)
            )
            print(
                f"{kind:9s}{len(columns[0]):4d} of {len(throws)}   {spread}   "
                f"{row['violations']}, {row['engaged']}, {row['after_brakes']}, "
                f"{row['restless']}   {row['unseen']} unseen   {row['reasons']}",
                flush=True,
            )
    return table


def resolutions(f: DirectMap, throws: list[Throw], seed: int, *, pixels: bool) -> Row:
    """Print and return what the encoders' resolution costs; no throw may be stopped."""
    table: Row = {}
    for step in STEPS:
        scene = Scene.model_validate({"sensing": {"encoder_step": step}})
        runner = TrialRunner(f.arm, Direct(f), scene, pixels=pixels)
        trials = [runner.run(k, x, seed=seed + k).trial for k, x in enumerate(throws)]
        status = [trial.status for trial in trials]
        row = {name: status.count(name) for name in sorted(set(status))}
        row["violations"] = sum(trial.limit_violations for trial in trials)
        table[f"{step:g}"] = row
        print(f"encoders of {step:g} rad, {'images' if pixels else 'points'}: {row}", flush=True)
    return table


def _asked(plans: dict[str, Plan], rows: str) -> dict[str, Plan]:
    """Return the clean row and those that are asked for; all if none is."""
    wanted = {"clean", *rows.split(";")} if rows else plans.keys()
    return {name: plan for name, plan in plans.items() if name in wanted}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--throws", type=int, default=300, metavar="N")
    parser.add_argument("--only", choices=("points", "pixels", "encoders", "steps"))
    parser.add_argument("--rows", default="", metavar="A;B", help="faults of vision, besides clean")
    parser.add_argument("--seed", type=int, default=SEED, metavar="S")
    parser.add_argument("--json", type=Path, metavar="FILE")
    parser.add_argument(
        "--limits",
        default="paper",
        metavar="NAME",
        help=f"{', '.join(ALL)}, several with commas between them, or all",
    )
    parser.add_argument("--workers", type=int, default=1, metavar="N", help="for encoders")
    options = parser.parse_args()
    names = ALL if options.limits == "all" else options.limits.split(",")
    tables = {name: tables_of(name, options) for name in names}
    if options.json:
        options.json.write_text(json.dumps(tables if len(names) > 1 else tables[names[0]]))


def tables_of(name: str, options: argparse.Namespace) -> Row:
    """Print and return the tables of an arm."""
    arm, design = named(name)
    f, seed, begun = learn(arm, design=design).map, options.seed, perf_counter()
    throws, tables = thrown(options.throws, f, seed), {}
    print(f"{name}, seed {seed}")
    if options.only in (None, "points"):
        plans = _asked(COMMON, options.rows)
        tables["points"] = vision(f, plans, throws, pixels=False, seed=seed)
    if options.only in (None, "pixels"):
        plans = _asked(COMMON | PIXELS, options.rows)
        tables["pixels"] = vision(f, plans, throws, pixels=True, seed=seed)
    if options.only in (None, "encoders"):
        tables["encoders"] = encoders(f, throws, seed, options.workers)
    if options.only in (None, "steps"):
        for pixels in (False, True):
            title = "steps, images" if pixels else "steps, points"
            tables[title] = resolutions(f, throws, seed, pixels=pixels)
    print(f"{perf_counter() - begun:.0f} s")
    return tables


if __name__ == "__main__":
    main()
