"""``mitt bench``: how fast everything is on this machine, beside other libraries."""

import json
from typing import Any

from rich.table import Table

from mitt.bench.measure import QUICK, BenchSettings, measure
from mitt.commands.options import BenchOptions
from mitt.commands.screen import checked, console_of, progress, tell, tell_of_kernels

#: Rows of the table: key, words, unit.
_ROWS = (
    ("tick_us", "tick, two images to torques", "us"),
    ("tick_without_images_us", "tick, a position to torques", "us"),
    ("adapt_us", "online step, all rows", "us"),
    ("learn_ms", "learning a map, mitt.learn", "ms"),
    ("learn_solver_ms", "its solver alone, torque rows", "ms"),
    ("learn_ipopt_ms", "the same rows by IPOPT, best of three", "ms"),
    ("noise_us", "fixed work: the machine's own noise", "us"),
)


def run(options: BenchOptions) -> int:
    """Run ``mitt bench``; return its exit status."""
    settings = QUICK if options.quick else BenchSettings()
    if options.check:
        return checked(f"{settings.throws} throws, {settings.repeats} calls of each rival")
    tell_of_kernels()
    with progress() as report:
        result = measure(settings, progress=report, say=tell)
    if options.json:
        print(json.dumps(result, allow_nan=False))  # noqa: T201
    else:
        _show(result)
    return 0


def _show(result: dict[str, Any]) -> None:
    """Print the table."""
    console, tick = console_of(), result["tick_us"]["p50"]
    table = Table(title=f"speed, mitt {result['version']}, {result['machine']}",
                  title_justify="left")  # fmt: skip
    table.add_column("what")
    for name in ("median", "p99", "p99.9", "unit", "ticks of ours"):
        table.add_column(name, justify="right")
    for key, words, unit in _ROWS:
        if result[key] is not None:
            ratio = f"{result[key]['p50'] / tick:.1f}" if unit == "us" else ""
            table.add_row(words, *_cells(result[key]), unit, ratio)
    for name, time in result["rivals_us"].items():
        table.add_row(name, *_cells(time), "us", f"{time['p50'] / tick:.1f}")
    console.print(table)
    console.print(f"{result['throws_per_s_core']:.1f} throws per second and core")
    if result["learn_ipopt_ms"] is not None:
        ratio = result["learn_ipopt_ms"]["p50"] / result["learn_solver_ms"]["p50"]
        console.print(
            f"solver of learning: {ratio:.0f} times faster than IPOPT, "
            f"cost {result['learn_cost_gap']:+.1e}"
        )


def _cells(time: dict[str, float]) -> list[str]:
    """Return a time as cells."""
    return [f"{time[name]:.2f}" for name in ("p50", "p99", "p99_9")]
