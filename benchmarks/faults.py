"""What faults cost: catches with faults of vision, and how soon a broken encoder stops the arm.

    python benchmarks/faults.py                              all tables, 300 throws a row
    python benchmarks/faults.py --throws 1000 --only points  one table, more throws
    python benchmarks/faults.py --only pixels --rows "dropout 20 ms;10 % outliers" --seed 9000
    python benchmarks/faults.py --json faults.json           keep the numbers

Throws, seeds and plants are the same in every row; a fault of some length begins at eight moments
from 0.05 to 0.40 s after release, for an eighth of the throws each. What the faults do to the
estimate: ``benchmarks/track.py``.
"""

import argparse
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mitt.catcher import Phase
from mitt.control.condition import ABORT
from mitt.generator.generators import Direct
from mitt.generator.mapping import DirectMap
from mitt.records import REASONS
from mitt.robot.load import load_arm
from mitt.signals import Array
from mitt.study.aim import aim_of
from mitt.study.lesson import learn
from mitt.study.result import STATUSES
from mitt.study.score import measure
from mitt.study.stats import wilson
from mitt.study.trial import Bench
from mitt.world.scene import Scene
from mitt.world.throws import Throw, default_throw

SEED = 9000
#: Moments at which a fault begins, after release [s].
STARTS = tuple(float(t) for t in np.round(np.linspace(0.05, 0.40, 8), 3))
#: Speed below which the arm stands still [rad/s], and ticks after which a fault trial ends.
STILL, TICKS = 0.1, 900
#: Counts of motion from which a stuck encoder is due.
COUNTS = 5.0

Plan = Callable[[float], list[dict[str, Any]]]
Row = dict[str, Any]


def lasting(length: float, **fault: Any) -> Plan:  # noqa: ANN401 (fields of a fault)
    """Return a plan of one fault that begins at a moment and lasts [s]."""
    return lambda start: [{**fault, "start": start, "length": length}]


def alone(length: float, **fault: Any) -> Plan:  # noqa: ANN401 (fields of a fault)
    """Return a plan of one fault of one camera: each in turn, from moment to moment."""
    return lambda start: [{**fault, "camera": STARTS.index(start) % 2, "start": start,
                           "length": length}]  # fmt: skip


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
ENCODERS = ("stuck", "jump", "dropout", "sign")


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
        bench = Bench(f.arm, Direct(f), scene_of(plan(start)), pixels=pixels)
        for k in range(part, len(throws), len(STARTS)):
            trial = bench.run(k, throws[k], seed=seed + k).trial
            status.append(trial.status)
            violations += trial.limit_violations
    caught = status.count("caught")
    low, high = wilson(caught, len(throws))
    named = STATUSES[1:]
    return {"throws": len(throws), "caught": caught, "rate": caught / len(throws),
            "low": low, "high": high, "violations": violations,
            **{name: status.count(name) for name in named}}  # fmt: skip


def vision(
    f: DirectMap, plans: dict[str, Plan], throws: list[Throw], *, pixels: bool, seed: int
) -> Row:
    """Print and return the table of catches."""
    table: Row = {}
    print(f"{'pixels' if pixels else 'points':28s}caught of throws   rate [95 %]   of clean   "
          "dropped missed unreachable stopped aborted   violations")  # fmt: skip
    for name, plan in plans.items():
        row = catches(f, plan, throws, pixels=pixels, seed=seed)
        row["of_clean"] = row["rate"] / (table or {"clean": row})["clean"]["rate"]
        table[name] = row
        print(f"{name:28s}{row['caught']:6d} of {row['throws']:4d}   {row['rate']:.3f}"
              f" [{row['low']:.3f}, {row['high']:.3f}]   {row['of_clean']:.3f}   "
              f"{row['dropped']:4d}{row['missed']:6d}{row['unreachable']:8d}{row['stopped']:10d}"
              f"{row['aborted']:8d}"
              f"{row['violations']:8d}", flush=True)  # fmt: skip
    return table


def broken(f: DirectMap, kind: str, throws: list[Throw], seed: int) -> Row:
    """Break an encoder in each throw; return delays [ms] and what became of the arm."""
    rows: Row = {
        "delay_ms": [],
        "told_ms": [],
        "stop_ms": [],
        "brake_ms": [],
        "unseen": 0,
        "violations": 0,
    }
    rng, reasons = np.random.default_rng(seed), set()
    for k, throw in enumerate(throws):
        start, joint = float(rng.uniform(0.15, 0.45)), int(rng.integers(f.arm.n))
        fault = {"kind": "encoder", "fault": kind, "joint": joint, "start": start,
                 "magnitude": float(rng.choice([-1.0, 1.0]) * rng.uniform(0.05, 1.0))}  # fmt: skip
        bench = Bench(f.arm, Direct(f), scene_of([fault]), pixels=False)
        ticks, q, dq, violations = _run(bench, throw, seed + k)
        rows["violations"] += violations
        stopped = np.flatnonzero(ticks["state"] == ABORT)
        if not len(stopped):
            rows["unseen"] += 1
            continue
        reasons.add(REASONS[ticks["reason"][stopped[0]]].value)
        stop, first = int(stopped[0]), round(start / 0.001)
        shows = _shows(kind, q[:, joint], first, f.arm.encoder_step[joint])
        rows["delay_ms"].append(max(stop - shows, 0))
        moving = np.flatnonzero(np.abs(dq).max(axis=1) > STILL)
        rows["stop_ms"].append(max(int(moving[-1]) + 1 - stop, 0) if len(moving) else 0)
        told = np.flatnonzero(ticks["told"][:, 1].any(axis=1))
        rows["told_ms"].append(max(int(told[-1]) + 1 - stop, 0) if len(told) else 0)
        told, brake = ticks["told"][max(stop - 1, 0), 1], bench.catcher().deceleration
        rows["brake_ms"].append(float(1e3 * np.max(np.abs(told) / brake)))
    rows["reasons"] = sorted(reasons)
    return rows


def _shows(kind: str, q: Array, first: int, count: float) -> int:
    """Return the tick from which a fault can be seen at all; resolution ``count`` [rad]."""
    if kind in ("jump", "dropout"):
        return first
    moved = np.abs(q[first:] - q[max(first - 1, 0)]) > COUNTS * count
    return first + int(np.argmax(moved)) if moved.any() else first


def _run(bench: Bench, throw: Throw, seed: int) -> tuple[Any, Array, Array, int]:
    """Run to standstill; return ticks, true q and dq, and how many ticks broke a limit."""
    world, catcher, rows = bench.world, bench.catcher(), []
    world.reset(throw, seed)
    for k in range(TICKS):
        command = catcher.step(world.sense(look=catcher.looking))
        world.apply(command)
        catcher.think()
        rows.append(catcher.result.copy())
        at_rest = catcher.phase is Phase.STOPPED and not command.dq.any()
        if at_rest and k > 30 and not any(r["told"][0, 1].any() for r in rows[-30:]):
            break
    ticks, truth = np.concatenate(rows), world.trace()
    return ticks, truth.q, truth.dq, measure(bench.arm, ticks, truth).limit_violations


def encoders(f: DirectMap, throws: list[Throw], seed: int) -> Row:
    """Print and return the table of broken encoders."""
    table: Row = {}
    print("encoder   detected   delay [ms] p50 p99 max   command at rest [ms] p50 p99 max   "
          "arm at rest p50 p99 max   brake alone p50 max   violations")  # fmt: skip
    for kind in ENCODERS:
        row = broken(f, kind, throws, seed)
        names = ("delay_ms", "told_ms", "stop_ms", "brake_ms")
        delay, told, stop, brake = (np.array(row[name]) for name in names)
        table[kind] = {"throws": len(throws), "detected": len(delay), **row}
        if not len(delay):
            continue
        spread = "   ".join(f"{np.median(x):4.0f}{np.quantile(x, 0.99):5.0f}{x.max():5.0f}"
                            for x in (delay, told, stop, brake))  # fmt: skip
        print(f"{kind:9s}{len(delay):4d} of {len(throws)}   {spread}   {row['violations']}"
              f"   {row['unseen']} unseen   {row['reasons']}", flush=True)  # fmt: skip
    return table


def _asked(plans: dict[str, Plan], rows: str) -> dict[str, Plan]:
    """Return the clean row and those that are asked for; all if none is."""
    wanted = {"clean", *rows.split(";")} if rows else plans.keys()
    return {name: plan for name, plan in plans.items() if name in wanted}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--throws", type=int, default=300, metavar="N")
    parser.add_argument("--only", choices=("points", "pixels", "encoders"))
    parser.add_argument("--rows", default="", metavar="A;B", help="faults of vision, besides clean")
    parser.add_argument("--seed", type=int, default=SEED, metavar="S")
    parser.add_argument("--json", type=Path, metavar="FILE")
    options = parser.parse_args()
    f, seed = learn(load_arm("wam", limits="paper")).map, options.seed
    throws, tables = thrown(options.throws, f, seed), {}
    if options.only in (None, "points"):
        plans = _asked(COMMON, options.rows)
        tables["points"] = vision(f, plans, throws, pixels=False, seed=seed)
    if options.only in (None, "pixels"):
        plans = _asked(COMMON | PIXELS, options.rows)
        tables["pixels"] = vision(f, plans, throws, pixels=True, seed=seed)
    if options.only in (None, "encoders"):
        tables["encoders"] = encoders(f, throws, seed)
    if options.json:
        options.json.write_text(json.dumps(tables))


if __name__ == "__main__":
    main()
