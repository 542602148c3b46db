"""``mitt study``: many throws, several generators, a grid of conditions."""

from mitt.commands.options import StudyOptions
from mitt.commands.screen import checked, progress, say, show, table, tell_of_kernels, warn
from mitt.errors import InputError
from mitt.files.files import check_folder, locked
from mitt.generator.advice import warnings_of
from mitt.interrupts import words_of
from mitt.trials.registry import available, check_generator
from mitt.trials.runs import arm_of, design_of
from mitt.trials.study_file import Study, extent, read_study
from mitt.trials.study_results import Folder
from mitt.trials.study_run import FinishedStudy, run_study
from mitt.trials.workers import check_engine, engine_of


def run(options: StudyOptions) -> int:
    """Run ``mitt study``; return its exit status."""
    study = read_study(options.study, generators=available())
    check_engine(options.engine)
    if options.resume and options.overwrite:
        raise InputError("--resume and --overwrite", "one of them", "both")
    folder = Folder(options.out)
    check_folder(folder.path, overwrite=options.overwrite or options.resume or options.check)
    folder.check(study, resume=options.resume)
    for name in study.counts:
        check_generator(name)
    for settings in dict.fromkeys(c.arm for c in study.conditions):
        arm = arm_of(settings)
        warn(warnings_of(arm, design_of(settings, arm)), json=options.json)
    if options.check:
        total = len(study.conditions) * sum(study.counts.values())
        return checked(f"{extent(study, total)}, output to {folder.path}")
    with locked(folder.path):
        tell_of_kernels()
        engine = engine_of(options.engine, options.workers)
        folder.claim(study, resume=options.resume, overwrite=options.overwrite)
        with progress() as report:
            finished = run_study(study, folder, engine, progress=report)
    if options.json:
        print(folder.summary.read_text(encoding="utf-8"), end="")  # noqa: T201
    else:
        _show(study, folder, finished)
    if finished.lost:
        more = f" and {len(finished.lost) - 1} more" if len(finished.lost) > 1 else ""
        say(f"{finished.lost[0]}{more}; the rest is kept, --resume tries again")
    if finished.interrupt is not None:
        say(f"{words_of(finished.interrupt)}; {finished.thrown} of {finished.total} throws are "
             f"kept in {folder.path}, --resume goes on")  # fmt: skip
    return finished.status


def _show(study: Study, folder: Folder, finished: FinishedStudy) -> None:
    """Print catch rates with contact forces: a row a condition, a column a generator."""
    rates = table(f"{study.name}: caught [%], contact force [N] (median)",
                  ("condition", *study.generators), left=("condition",))  # fmt: skip
    rows = {(row["condition"], row["generator"]): row for row in finished.rows}
    for condition in study.conditions:
        cells = [rows[condition.name, generator] for generator in study.generators]
        rates.add_row(condition.name, *(_rate(row) for row in cells))
    show(rates, f"written: {folder.summary} and {folder.trials.name}")


def _rate(row: dict[str, object]) -> str:
    """Return a catch rate and force for the table, with a star where throws are missing.

    An exclamation mark where some pressed harder than hand and arm take.
    """
    if not row["throws"]:
        return ""
    force = row["force_n"]
    pressed = f"{force['median']:.0f}" if isinstance(force, dict) else "-"
    marks = ("!" if row["over_force"] else "") + ("" if row["complete"] else " *")
    return f"{100 * float(str(row['catch_rate'])):.1f}, {pressed}{marks}"
