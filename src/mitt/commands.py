"""What the commands do: run, show, write. Tables and progress for people live here."""

import json
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

import mitt
from mitt.errors import InputError
from mitt.generator.learn import Learned
from mitt.link.files import check_folder, make_folder
from mitt.link.maps import save_map
from mitt.options import CatchOptions, LearnOptions
from mitt.study.catch import Finished, arm_of, design_of, prepare, run
from mitt.study.lesson import LEARNING_SEED
from mitt.study.lesson import learn as learn_map
from mitt.study.neighbourhood import Neighbourhood
from mitt.study.score import Trial

Report = Callable[[str, int, int], None]

#: Most flights to learn from; more only takes longer.
_MOST_FLIGHTS = 10_000
#: Width of tables that do not go to a terminal [characters].
_FILE_WIDTH = 110


def catch(options: CatchOptions) -> int:
    """Run ``mitt catch``; return its exit status."""
    prepared = prepare(options)
    if options.check:
        return _checked(f"{prepared.source.count} throws, output to {prepared.out}")
    from mitt.study.outputs import write_outputs  # noqa: PLC0415 (plots: only when written)

    make_folder(prepared.out)
    with _progress() as report:
        finished = run(prepared, progress=report)
        write_outputs(finished, progress=report)
    if options.json:
        print(json.dumps(finished.result, allow_nan=False))  # noqa: T201
    else:
        _show(finished)
    return finished.status


def learn(options: LearnOptions) -> int:
    """Run ``mitt learn``; return its exit status."""
    arm = arm_of(options)
    design = design_of(options, arm)
    if not 1 <= options.flights_count <= _MOST_FLIGHTS:
        raise InputError("--flights", f"a number in 1..{_MOST_FLIGHTS}", options.flights_count)
    if options.seed is not None and not 0 <= options.seed < 2**63:
        raise InputError("--seed", "a number from 0 to 2^63 - 1", options.seed)
    if options.out.exists() and not options.overwrite:
        raise InputError("--out", "a new file", f"{options.out}, which exists",
                         do="choose another or say --overwrite")  # fmt: skip
    if options.out.is_dir():
        raise InputError("--out", "a file", f"{options.out}, which is a folder")
    check_folder(options.out.parent, overwrite=True)
    if options.check:
        return _checked(f"{options.flights_count} flights, output to {options.out}")
    with _progress() as report:
        report("learning", 0, 1)
        learned = learn_map(
            arm,
            design=design,
            seed=LEARNING_SEED if options.seed is None else options.seed,
            around=Neighbourhood(flights=options.flights_count),
        )
        report("learning", 1, 1)
    save_map(options.out, learned, version=mitt.__version__)
    if options.json:
        print(json.dumps(_lesson(learned, options.out), allow_nan=False))  # noqa: T201
    else:
        _show_lesson(learned, options.out)
    return 0


def _checked(what: str) -> int:
    """Say that the input is good."""
    print(f"mitt: the input is good: {what}", file=sys.stderr)  # noqa: T201
    return 0


@contextmanager
def _progress() -> Iterator[Report]:
    """Show progress on stderr."""
    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    )  # fmt: skip
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        tasks = {}

        def report(name: str, done: int, of: int) -> None:
            if name not in tasks:
                tasks[name] = bar.add_task(name, total=of)
            bar.update(tasks[name], completed=done, total=of)

        yield report


def _show(finished: Finished) -> None:
    """Print the table of a run."""
    console, summary = _console(), finished.result["summary"]
    table = Table(title=_title(finished), title_justify="left", padding=(0, 1))
    for name in ("throw", "status", "t [s]", "miss [mm]", "rel. [m/s]", "torque", "speed", "[N]",
                 "asks most"):  # fmt: skip
        words = name in ("status", "asks most")
        table.add_column(name, justify="left" if words else "right", no_wrap=True)
    shown = finished.trials[:20] + [t for t in finished.trials[20:] if t.status != "caught"][:40]
    for trial in shown:
        table.add_row(*_row(trial))
    console.print(table)
    if len(shown) < len(finished.trials):
        console.print(f"{len(finished.trials) - len(shown)} more throws, all in result.json")
    low, high = summary["ci95"]
    console.print(
        f"caught {summary['caught']} of {summary['throws']}: {100 * summary['catch_rate']:.1f} % "
        f"(95 % interval {100 * low:.1f} to {100 * high:.1f} %), "
        f"dropped {summary['dropped']}, missed {summary['missed']}, "
        f"unreachable {summary['unreachable']}, aborted {summary['aborted']}; "
        f"tick {summary['tick_us']['p50']:.0f} us median"
    )
    page = "report.html" if finished.trials else "result.json"
    console.print(f"written: {finished.prepared.out / page}", soft_wrap=True)


def _console() -> Console:
    """Return the console of tables: as wide as the terminal, wide enough in a file."""
    console = Console()
    return console if console.is_terminal else Console(width=_FILE_WIDTH)


def _title(finished: Finished) -> str:
    """Return the title of a run's table."""
    head = finished.prepared.head
    return f"{head['arm']}, limits {head['limits']}, {head['generator']}, {head['vision']}"


def _row(trial: Trial) -> tuple[str, ...]:
    """Return a trial as cells of the table."""
    return (
        str(trial.index),
        trial.status,
        _number(trial.t_catch_s, 3),
        _number(trial.position_error_mm, 1),
        _number(trial.velocity_error_m_s, 2),
        f"{100 * max(trial.peak_torque_ratio):.0f} %",
        f"{100 * max(trial.peak_speed_ratio):.0f} %",
        _number(trial.peak_contact_force_n, 0),
        trial.binding_limit or "",
    )


def _number(value: float | None, digits: int) -> str:
    """Return a number for the table; nothing where there is none."""
    return "" if value is None else f"{value:.{digits}f}"


def _lesson(learned: Learned, out: Path) -> dict[str, object]:
    """Return what ``mitt learn --json`` prints."""
    return {
        "schema": "mitt.learn/1",
        "version": mitt.__version__,
        "map": str(out),
        "status": learned.status,
        "flights": learned.flights,
        "left_out": learned.left_out,
        "cost_torque": [step.cost_torque for step in learned.steps],
        "cost_speed": [step.cost_speed for step in learned.steps],
    }


def _show_lesson(learned: Learned, out: Path) -> None:
    """Print the cost at each step, the numbers behind fig. 7."""
    console = _console()
    table = Table(title="cost over the optimisation (fig. 7)", title_justify="left")
    for name in ("step", "torque", "speed", "sum", "largest share of a limit"):
        table.add_column(name, justify="right")
    for k, step in enumerate(learned.steps):
        name = "alpha = 0" if k == 0 else str(k - 1)
        both = step.cost_torque + step.cost_speed
        table.add_row(name, f"{step.cost_torque:.4f}", f"{step.cost_speed:.4f}", f"{both:.4f}",
                      f"{step.worst:.2f}")  # fmt: skip
    console.print(table)
    console.print(
        f"{learned.status}: {learned.flights} flights, {learned.left_out} left out; written: {out}",
        soft_wrap=True,
    )
