"""``mitt view``: a recording, whole or still being written, in the browser."""

import os
from pathlib import Path

from mitt.commands.options import ViewOptions
from mitt.commands.screen import checked, print_json, show
from mitt.errors import FileError, InputError
from mitt.files.recorded import Recorded
from mitt.report.view import newest, watch

#: Where recordings are looked for if none is named.
_RUNS = Path("runs")


def run(options: ViewOptions) -> int:
    """Run ``mitt view``; return its exit status."""
    if not 1 <= options.port <= 65_535:
        raise InputError("--port", "a number from 1 to 65535", options.port)
    place = options.recording or _RUNS
    if options.recording is None and not place.is_dir():
        raise FileError(str(place), "a folder with recordings", "none",
                        do="name a recording or a folder")  # fmt: skip
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
        host=options.host, port=options.port, ready=ready, until=options.seconds,
    )  # fmt: skip
    return 0
