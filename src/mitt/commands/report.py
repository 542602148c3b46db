"""``mitt report``: the page of a study; the result of a run that died."""

from pathlib import Path

from mitt.commands.options import ReportOptions
from mitt.commands.screen import checked, print_json, progress, show
from mitt.errors import InputError
from mitt.files.files import locked, write_json
from mitt.trials.journal import RESULT, died, recovered

#: Most replays beside one page; each weighs a megabyte.
_MOST_REPLAYS = 200


def run(options: ReportOptions) -> int:
    """Run ``mitt report``; return its exit status."""
    if not 0 <= options.replays <= _MOST_REPLAYS:
        raise InputError("--replays", f"a number in 0..{_MOST_REPLAYS}", options.replays)
    if died(options.folder):
        return _recover(options)
    return _study(options)


def _study(options: ReportOptions) -> int:
    """Write the page of a study; tables and plots are loaded only now."""
    from mitt.report.study_page import write_study_report  # noqa: PLC0415
    from mitt.sweep.folder import Folder  # noqa: PLC0415
    from mitt.sweep.summary import read_result  # noqa: PLC0415

    folder = Folder(options.folder)
    result = read_result(folder)
    if options.check:
        return checked(f"study {result.study.name!r}, {len(result.rows)} rows")
    with locked(folder.path), progress() as report:
        write_study_report(result, replays=options.replays, progress=report)
    return _written(options, folder.path / "report.html", "")


def _recover(options: ReportOptions) -> int:
    """Write the result of a run of ``mitt catch`` that died, from the throws that it kept."""
    result = recovered(options.folder)
    said, path = f"{len(result['trials'])} throws of a run that died", options.folder / RESULT
    if options.check:
        return checked(said)
    with locked(options.folder):
        write_json(path, result)
    return _written(options, path, f"{said}, {result['summary']['caught']} of them caught; ")


def _written(options: ReportOptions, path: Path, said: str) -> int:
    """Print what was written, and return the exit status."""
    if options.json:
        print_json({"schema": "mitt.report/1", "report": str(path)})
    else:
        show(f"{said}written: {path}")
    return 0
