"""``mitt report``: the page of a study, and of a run that was broken off."""

from pathlib import Path

from mitt.commands.catch import prepared_again
from mitt.commands.options import ReportOptions
from mitt.commands.screen import checked, print_json, progress, show
from mitt.errors import FileError, InputError
from mitt.files.files import locked, read_json, write_json
from mitt.files.folders import wrote
from mitt.link.clock import Stopwatch
from mitt.trials.result import MAX_BYTES, NAME, PAGE, RESULT, died, read_kept
from mitt.trials.runs import FinishedRun
from mitt.trials.study_results import MANIFEST, Folder

#: Most replays beside one page; each weighs a megabyte.
_MOST_REPLAYS = 200


def run(options: ReportOptions) -> int:
    """Run ``mitt report``; return its exit status."""
    if not 0 <= options.replays <= _MOST_REPLAYS:
        raise InputError("--replays", f"a number in 0..{_MOST_REPLAYS}", options.replays)
    if (options.folder / NAME).is_file() and not (options.folder / MANIFEST).exists():
        return _page_of_run(options)
    return _study(options)


def _study(options: ReportOptions) -> int:
    """Write the page of a study; tables and plots are loaded only now."""
    from mitt.report.study_page import write_study_report  # noqa: PLC0415
    from mitt.trials.study_results import read_result  # noqa: PLC0415

    folder = Folder(options.folder)
    result = read_result(folder)
    if options.check:
        return checked(f"study {result.study.name!r}, {len(result.rows)} rows")
    page = folder.path / PAGE
    if page.exists() and not wrote(page):
        raise FileError(str(page), "a page of mitt, or none", "another file", do="move it away")
    with locked(folder.path), progress() as report:
        write_study_report(result, replays=options.replays, progress=report)
    return _written(options, page, "")


def _page_of_run(options: ReportOptions) -> int:
    """Write the page of a run of ``mitt catch`` that was broken off, and its result if it died.

    Raises:
        FileError: The run has its page, or no throw; MittError: a file that it read has changed.
    """
    folder, kept = options.folder, read_kept(options.folder)
    if (folder / PAGE).exists():
        raise FileError(str(folder), "the folder of a study, or of a run that was broken off",
                        f"one of mitt catch; its page is {folder / PAGE}")  # fmt: skip
    said = f"{len(kept.trials)} throws of a run that was broken off"
    if options.check:
        return checked(said)
    from mitt.report.outputs import write_page  # noqa: PLC0415 (plots: when written)

    with locked(folder), progress() as report:
        result = read_json(folder / RESULT, max_bytes=MAX_BYTES) if not died(folder) else None
        if result is None:
            result = kept.result
            write_json(folder / RESULT, result)
        if not isinstance(result, dict) or not {"trials", "summary"} <= result.keys():
            raise FileError(str(folder / RESULT), "the result of the run", "another file")
        if not kept.trials:
            raise FileError(str(folder), "a run with a throw that ended", "none")
        prepared = prepared_again(folder, kept)
        if prepared.learned is None:
            raise FileError(str(folder), "the map of the run", "none")
        done = FinishedRun(prepared=prepared, learned=prepared.learned, trials=kept.trials,
                           stopwatch=Stopwatch(), interrupt=None)  # fmt: skip
        write_page(done, result, progress=report)
    return _written(
        options, folder / PAGE, f"{said}, {result['summary']['caught']} of them caught; "
    )


def _written(options: ReportOptions, path: Path, said: str) -> int:
    """Print what was written, and return the exit status."""
    if options.json:
        print_json({"schema": "mitt.report/1", "report": str(path)})
    else:
        show(f"{said}written: {path}")
    return 0
