"""``mitt report``: the page of a study; the result of a run that died."""

import json

from mitt.commands.options import ReportOptions
from mitt.commands.screen import checked, console_of, progress
from mitt.errors import InputError
from mitt.link.files import locked, write_json
from mitt.report.study_page import write_study_report
from mitt.sweep.folder import Folder
from mitt.sweep.summary import read_result
from mitt.trials.journal import RESULT, died, recovered

#: Most replays beside one page; each weighs a megabyte.
_MOST_REPLAYS = 200


def run(options: ReportOptions) -> int:
    """Run ``mitt report``; return its exit status."""
    if not 0 <= options.replays <= _MOST_REPLAYS:
        raise InputError("--replays", f"a number in 0..{_MOST_REPLAYS}", options.replays)
    if died(options.folder):
        return _recover(options)
    folder = Folder(options.folder)
    result = read_result(folder)
    if options.check:
        return checked(f"study {result.study.name!r}, {len(result.rows)} rows")
    with locked(folder.path), progress() as report:
        write_study_report(result, replays=options.replays, progress=report)
    path = folder.path / "report.html"
    if options.json:
        print(json.dumps({"schema": "mitt.report/1", "report": str(path)}))  # noqa: T201
    else:
        console_of().print(f"written: {path}", soft_wrap=True)
    return 0


def _recover(options: ReportOptions) -> int:
    """Write the result of a run of ``mitt catch`` that died, from the throws that it kept."""
    result = recovered(options.folder)
    count, path = len(result["trials"]), options.folder / RESULT
    if options.check:
        return checked(f"{count} throws of a run that died")
    with locked(options.folder):
        write_json(path, result)
    if options.json:
        print(json.dumps({"schema": "mitt.report/1", "report": str(path)}))  # noqa: T201
    else:
        caught = result["summary"]["caught"]
        console_of().print(f"{count} throws of a run that died, {caught} of them caught; "
                           f"written: {path}", soft_wrap=True)  # fmt: skip
    return 0
