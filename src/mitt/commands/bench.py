"""``mitt bench``: how fast everything is on this machine, beside other libraries."""

from typing import Any

from mitt.bench.measure import QUICK, BenchSettings, measure
from mitt.commands.options import BenchOptions
from mitt.commands.screen import checked, print_json, progress, show, table, tell_of_kernels
from mitt.interrupts import tell

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
        print_json(result)
    else:
        _show(result)
    return 0


def _show(result: dict[str, Any]) -> None:
    """Print the table."""
    tick = result["tick_us"]["p50"]
    times = table(f"speed, mitt {result['version']}, {result['machine']}",
                  ("what", "median", "p99", "p99.9", "unit", "ticks of ours"),
                  left=("what",))  # fmt: skip
    rows = [(words, result[key], unit) for key, words, unit in _ROWS if result[key] is not None]
    rows += [(name, time, "us") for name, time in result["rivals_us"].items()]
    for words, time, unit in rows:
        cells = [f"{time[name]:.2f}" for name in ("p50", "p99", "p99_9")]
        times.add_row(words, *cells, unit, f"{time['p50'] / tick:.1f}" if unit == "us" else "")
    show(times, f"{result['throws_per_s_core']:.1f} throws per second and core")
    if result["learn_ipopt_ms"] is not None:
        ratio = result["learn_ipopt_ms"]["p50"] / result["learn_solver_ms"]["p50"]
        show(f"solver of learning: {ratio:.0f} times faster than IPOPT, "
             f"cost {result['learn_cost_gap']:+.1e}")  # fmt: skip
