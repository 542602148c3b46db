"""``mitt study``, ``mitt report``, ``mitt bench``: many throws, their pages, and speed."""

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mitt.cli.options import BenchOptions, ReportOptions, StudyOptions
from mitt.cli.running import command_of, prepared_again
from mitt.cli.screen import (
    checked,
    print_json,
    progress,
    say,
    show,
    table,
    tell_of_kernels,
    warn,
)
from mitt.core.errors import FileError, InputError
from mitt.interrupts import tell, words_of
from mitt.io.reading import read_json
from mitt.io.writing import check_folder, check_own, locked, write_json
from mitt.lab.bench.measure import QUICK, BenchSettings, measure_all
from mitt.lab.trials.journal import MAX_BYTES, died, read_kept
from mitt.lab.trials.scored_task import NAME, PAGE, RESULT, ScoredTask
from mitt.lab.trials.study import Study, extent, planned
from mitt.lab.trials.study_folder import MANIFEST, Folder
from mitt.lab.trials.task_run import FinishedRun
from mitt.lab.trials.tasks import read_study
from mitt.lab.trials.workers import check_engine, engine_of

if TYPE_CHECKING:
    from mitt.lab.trials.study_run import FinishedStudy


def study_command(options: StudyOptions) -> int:
    """Run ``mitt study``; return its exit status."""
    from mitt.lab.trials.study_run import run_study  # noqa: PLC0415 (needs pyarrow, as nothing else here)

    study = read_study(options.study)
    folder = _folder(options, study)
    warn(study.check(), json=options.json)
    if options.check:
        return checked(f"{extent(study, planned(study))}, output to {folder.path}")
    finished = _run(options, study, folder, partial(run_study, study, folder))
    if not options.json:
        _show_study(study, folder, finished)
    return _ended(folder, finished)


def _folder(options: StudyOptions, study: Study) -> Folder:
    """Return the folder of a study, after a look at whether it may be written."""
    check_engine(options.engine, options.workers)
    if options.resume and options.overwrite:
        raise InputError("--resume and --overwrite", "one of them", "both")
    folder = Folder(options.out)
    check_folder(folder.path, overwrite=options.overwrite or options.resume or options.check)
    folder.check(study, resume=options.resume)
    return folder


def _run(
    options: StudyOptions, study: Study, folder: Folder, run: Callable[..., "FinishedStudy"]
) -> "FinishedStudy":
    """Run what is not there yet; print the summary where it is asked for as JSON."""
    with locked(folder.path):
        tell_of_kernels()
        engine = engine_of(options.engine, options.workers)
        folder.claim(study, resume=options.resume, overwrite=options.overwrite)
        with progress() as report:
            finished = run(engine, progress=report)
    if options.json:
        print(folder.summary.read_text(encoding="utf-8"), end="")  # noqa: T201
    return finished


def _ended(folder: Folder, finished: "FinishedStudy") -> int:
    """Say what was lost or broken off; return the exit status."""
    if finished.lost:
        more = f" and {len(finished.lost) - 1} more" if len(finished.lost) > 1 else ""
        say(f"{finished.lost[0]}{more}; the rest is kept, --resume tries again")
    if finished.interrupt is not None:
        say(
            f"{words_of(finished.interrupt)}; {finished.trials} of {finished.total} trials are "
            f"kept in {folder.path}, --resume goes on"
        )
    return finished.status


def _show_study(study: Study, folder: Folder, finished: "FinishedStudy") -> None:
    """Print rates with the first measure: a row a condition, four generators beside another."""
    task = study.kind
    rows = {(row["condition"], row["generator"]): row for row in finished.rows}
    generators = list(dict.fromkeys(str(row["generator"]) for row in finished.rows))
    measure = next(iter(task.measures.values()))
    for first in range(0, len(generators), 4):
        shown = generators[first : first + 4]
        rates = table(
            f"{study.name}: {task.success} [%], {measure.words} (median)",
            ("condition", *shown),
            left=("condition",),
        )
        for condition in study.conditions:
            cells = [_rate(task, rows.get((condition.name, x))) for x in shown]
            rates.add_row(condition.name, *cells)
        show(rates)
    show(f"written: {folder.summary} and {folder.trials.name}; mitt report {folder.path} says more")


def _rate(task: ScoredTask, row: Mapping[str, Any] | None) -> str:
    """Return a rate and the first measure for the table, with a star where trials are missing.

    An exclamation mark where some pressed harder than hand and arm take.
    """
    if row is None or not row[task.trials]:
        return ""
    name, measure = next(iter(task.measures.items()))
    of = row[name]
    median = "-" if of is None else f"{of['median']:.{measure.digits}f}"
    marks = ("!" if row["over_force"] else "") + ("" if row["complete"] else " *")
    return f"{100 * row[task.rate]:.1f}, {median}{marks}"


def report_command(options: ReportOptions) -> int:
    """Run ``mitt report``; return its exit status."""
    if (options.folder / NAME).is_file() and not (options.folder / MANIFEST).exists():
        return _page_of_run(options)
    return _page_of_study(options)


def _page_of_study(options: ReportOptions) -> int:
    """Write the page of a study; tables and plots are loaded only now."""
    from mitt.lab.report.study_page import write_study_page  # noqa: PLC0415
    from mitt.lab.trials.study_results import read_result  # noqa: PLC0415

    folder = Folder(options.folder)
    result = read_result(folder)
    page = folder.path / PAGE
    check_own("page of the study", page)
    if options.check:
        return checked(f"study {result.study.name!r}, {len(result.rows)} rows")
    with locked(folder.path), progress() as report:
        write_study_page(result, replays=options.replays, progress=report)
    return _written(options, page, "")


def _page_of_run(options: ReportOptions) -> int:
    """Write the page of a run that was broken off, and its result if it died."""
    folder, kept = options.folder, read_kept(options.folder)
    task = kept.task
    if (folder / PAGE).exists():
        raise FileError(
            str(folder),
            "the folder of a study, or of a run that was broken off",
            f"one of mitt {task.name}; its page is {folder / PAGE}",
        )
    said = f"{len(kept.trials)} {task.in_result} of a run that was broken off"
    if options.check:
        return checked(said)
    from mitt.lab.report.outputs import write_page  # noqa: PLC0415 (plots: when written)

    with locked(folder), progress() as report:
        result = read_json(folder / RESULT, max_bytes=MAX_BYTES) if not died(folder) else None
        if result is None:
            result = kept.result
            write_json(folder / RESULT, result)
        if not isinstance(result, dict) or not {"trials", "summary"} <= result.keys():
            raise FileError(str(folder / RESULT), "the result of the run", "another file")
        if not kept.trials:
            raise FileError(str(folder), f"a run with one of its {task.trials} ended", "none")
        run = prepared_again(command_of(task.name), folder, kept)
        done = FinishedRun(run=run, runner=run.begin(report), trials=kept.trials)
        write_page(done, result, progress=report)
    done_words = f"{result['summary'][task.success]} of them {task.success}"
    return _written(options, folder / PAGE, f"{said}, {done_words}; ")


def _written(options: ReportOptions, path: Path, said: str) -> int:
    """Print what was written, and return the exit status."""
    if options.json:
        print_json({"schema": "mitt.report/1", "report": str(path)})
    else:
        show(f"{said}written: {path}")
    return 0


#: Rows of the table: key, words, unit.
_ROWS = (
    ("tick_us", "tick, two images to torques", "us"),
    ("tick_without_images_us", "tick, a position to torques", "us"),
    ("adapt_us", "refining for a ball", "us"),
    ("learn_ms", "learning a map, mitt.learn", "ms"),
    ("learn_solver_ms", "its solver alone, torque rows", "ms"),
    ("learn_ipopt_ms", "the same rows by IPOPT, best of three", "ms"),
    ("noise_us", "fixed work: the machine's own noise", "us"),
)


def bench_command(options: BenchOptions) -> int:
    """Run ``mitt bench``; return its exit status."""
    settings = QUICK if options.quick else BenchSettings()
    if options.check:
        return checked(f"{settings.throws} throws, {settings.repeats} calls of each rival")
    tell_of_kernels()
    with progress() as report:
        result = measure_all(settings, progress=report, say=tell)
    if options.json:
        print_json(result)
    else:
        _show_times(result)
    return 0


def _show_times(result: dict[str, Any]) -> None:
    """Print the table."""
    tick = result["tick_us"]["p50"]
    times = table(
        f"speed, mitt {result['version']}, {result['machine']}",
        ("what", "median", "p99", "p99.9", "unit", "ticks of ours"),
        left=("what",),
    )
    rows = [(words, result[key], unit) for key, words, unit in _ROWS if result[key] is not None]
    rows += [(name, time, "us") for name, time in result["rivals_us"].items()]
    for words, time, unit in rows:
        cells = [f"{time[name]:.2f}" for name in ("p50", "p99", "p99_9")]
        times.add_row(words, *cells, unit, f"{time['p50'] / tick:.1f}" if unit == "us" else "")
    show(times, f"{result['throws_per_s_core']:.1f} throws per second and core")
    if result["learn_ipopt_ms"] is not None:
        ratio = result["learn_ipopt_ms"]["p50"] / result["learn_solver_ms"]["p50"]
        show(
            f"solver of learning: {ratio:.0f} times faster than IPOPT, "
            f"cost {result['learn_cost_gap']:+.1e}"
        )
