"""``mitt replay`` and ``mitt view``: recordings through the catcher once more, or watched."""

import os
import re
import shlex
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import mitt
from mitt.cli.options import ReplayOptions, ViewOptions
from mitt.cli.screen import checked, print_json, progress, say, show, table, tell_of_kernels
from mitt.core.errors import FileError, InputError
from mitt.io.recordings import Recorded
from mitt.io.writing import Leaves, check_folder, check_ours, locked
from mitt.lab.report.viewer import newest, watch
from mitt.lab.trials.explain import Explanation, evidence_of, explain
from mitt.lab.trials.registry import check_generator
from mitt.lab.trials.replayed import Replayed, changed
from mitt.lab.trials.replayed import replay as played

#: Most recordings in one call.
_MOST = 10_000


def replay_command(options: ReplayOptions) -> int:
    """Run ``mitt replay``; return its exit status."""
    if not 1 <= len(options.recordings) <= _MOST:
        raise InputError("recordings", f"1 to {_MOST} of them", len(options.recordings))
    if options.generator is not None:
        check_generator(options.generator)
    if options.out is not None:
        check_folder(options.out, overwrite=options.overwrite or options.check)
        if not options.check or options.overwrite:
            check_ours(options.out, _pages(options))
    if options.check:
        ticks = sum(len(_read(path, options)[0].ticks) for path in options.recordings)
        return checked(f"{len(options.recordings)} recordings, {ticks} ticks")
    with nullcontext() if options.out is None else locked(options.out):
        return _replay(options)


def _pages(options: ReplayOptions) -> Leaves:
    """Return what is left in a folder: pages, which say themselves who wrote them."""
    count = len(options.recordings)
    names = tuple(re.escape(_name(path, count, k)) for k, path in enumerate(options.recordings))
    return Leaves(command="mitt replay", schema="", manifests=(), names=names)


def _name(path: Path, count: int, k: int) -> str:
    """Return what the page of a recording is called."""
    return "replay.html" if count == 1 else f"{k:05d}-{path.stem}.html"


def _read(path: Path, options: ReplayOptions) -> tuple[Recorded, Any]:
    """Return a recording, and what makes the catcher of its replay."""
    recorded = Recorded(path)
    about = changed(
        recorded.about,
        map_file=options.map,
        settings=options.settings,
        generator=options.generator,
    )
    return recorded, about


def _replay(options: ReplayOptions) -> int:
    """Replay all recordings, one at a time."""
    rows: list[dict[str, Any]] = []
    tell_of_kernels()
    with progress() as report:
        for k, path in enumerate(options.recordings):
            report("replaying", k, len(options.recordings))
            x = played(*_read(path, options))
            rows.append(_row(x, explain(x, evidence_of(x))))
            if not x.recorded.whole:
                say(f"{path}: cut after {len(x.recorded.ticks)} ticks; these are replayed")
            if options.out is not None:
                _page(options.out, x, len(options.recordings), k)
        report("replaying", len(options.recordings), len(options.recordings))
    if options.json:
        print_json({"schema": "mitt.replay/1", "version": mitt.__version__, "recordings": rows})
    else:
        _show(rows, options)
    return 0


def _row(x: Replayed, why: Explanation) -> dict[str, Any]:
    """Return what JSON says of a replay."""
    return {
        "file": str(x.recorded.path),
        "ticks": len(x.recorded.ticks),
        "identical": x.identical,
        "first_difference": x.first_difference,
        "different_ticks": int(x.differs.sum()),
        "whole": x.recorded.whole,
        "dropped": x.recorded.dropped,
        "begins": x.begins,
        "recorded_by": x.recorded.about.version,
        "status": why.status,
        "cause": why.cause,
    }


def _page(out: Path, x: Replayed, count: int, k: int) -> None:
    """Write the page of a replay."""
    from mitt.lab.report.recording_page import write_replay_page  # noqa: PLC0415 (plots: when written)

    name = _name(x.recorded.path, count, k)
    write_replay_page(out / name, x, command=shlex.join(["replay", x.recorded.path.name]))


def _show(rows: list[dict[str, Any]], options: ReplayOptions) -> None:
    """Print a table, and the cause of a single one."""
    out = table(
        "replays",
        ("recording", "ticks", "begins", "commands", "status", "why"),
        left=("recording", "begins", "commands", "status", "why"),
    )
    for row in rows:
        first = row["first_difference"]
        said = (
            "identical"
            if row["identical"]
            else ("ticks missing" if first is None else f"differ from tick {first}")
        )
        out.add_row(
            Path(row["file"]).name,
            str(row["ticks"]),
            row["begins"],
            said,
            row["status"],
            row["cause"],
        )
    same = sum(row["identical"] for row in rows)
    show(out, f"{same} of {len(rows)} identical to the bit")
    if options.out is not None:
        show(f"written: {options.out}")


#: Where recordings are looked for if none is named.
_RUNS = Path("runs")


def view_command(options: ViewOptions) -> int:
    """Run ``mitt view``; return its exit status."""
    place = options.recording or _RUNS
    if options.recording is None and not place.is_dir():
        raise FileError(
            str(place), "a folder with recordings", "none", do="name a recording or a folder"
        )
    if place.is_dir() and not os.access(place, os.R_OK | os.X_OK):
        raise FileError(str(place), "a folder that can be read", "one that may not be")
    if options.check:
        path = newest(place) if place.is_dir() else place
        if path is None:
            return checked(f"{place}, in which there is no recording yet")
        return checked(f"{path}, {len(Recorded(path).ticks)} ticks")

    def ready(url: str) -> None:
        if options.json:
            print_json({"schema": "mitt.view/1", "url": url})
        else:
            show(f"open {url}; Ctrl-C ends")

    watch(
        lambda: newest(place) if place.is_dir() else place,
        host=options.host,
        port=options.port,
        ready=ready,
        until=options.seconds,
        loads=lambda path: say(f"loading {path}"),
    )
    return 0
