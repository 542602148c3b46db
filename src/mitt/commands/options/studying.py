"""Options of ``mitt study``, ``mitt report`` and ``mitt bench``."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyOptions:
    """Many throws: several generators in a grid of conditions; write tables and a summary.

    Attributes:
        study: A study file, or the name of one that ships: smoke, paper or evidence.
        out: Folder to write.
        engine: Where to throw: local, or dask://HOST:PORT of a scheduler.
        workers: Processes of the local engine; one a core if left out.
        resume: Go on with a study that was broken off; only what is missing is thrown.
        overwrite: Use a folder that has files in it, and throw everything anew.
        json: Print the summary as one JSON object and nothing else to stdout.
        check: Validate the input and do nothing.
    """

    study: Annotated[Positional[Path], arg(metavar="STUDY.toml")]
    out: Annotated[Path, arg(metavar="DIR")]
    engine: Annotated[str, arg(metavar="local|dask://HOST:PORT")] = "local"
    workers: Annotated[int | None, arg(metavar="N")] = None
    resume: bool = False
    overwrite: bool = False
    json: bool = False
    check: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportOptions:
    """Write the page of a study, DIR/report.html, with replays of its worst throws beside it.

    Attributes:
        folder: Folder of a study.
        replays: Throws to show as 3-D replays, each made once more and kept beside the page.
        json: Print one JSON object and nothing else to stdout.
        check: Validate the input and do nothing.
    """

    folder: Annotated[Positional[Path], arg(metavar="DIR")]
    replays: Annotated[int, arg(metavar="N")] = 6
    json: bool = False
    check: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchOptions:
    """Measure how fast everything is on this machine, beside other libraries, in one run.

    Attributes:
        quick: Fewer repeats, and no IPOPT.
        json: Print one JSON object and nothing else to stdout.
        check: Validate the input and do nothing.
    """

    quick: bool = False
    json: bool = False
    check: bool = False
