"""``mitt calibrate``: cameras, heads, place and clock from what was seen; writes RIG.toml."""

import json
from collections.abc import Mapping
from math import isfinite
from pathlib import Path

from rich.table import Table

import mitt
from mitt.calibration.views import CELLS
from mitt.commands.options import CalibrateOptions
from mitt.commands.screen import check_new_file, checked, console_of, progress
from mitt.commands.stages import Calibration, calibrate, prepare
from mitt.errors import InputError
from mitt.link.rig import write_rig


def run(options: CalibrateOptions) -> int:
    """Run ``mitt calibrate``; return its exit status."""
    job = prepare(options)
    picture = (options.picture or options.out.with_suffix(".png")) if options.left else None
    if picture is not None and picture.suffix.lower() != ".png":
        raise InputError("--picture", "a name that ends with .png", picture.name)
    for name, path in (("--out", options.out), ("--picture", picture)):
        if path is not None:
            check_new_file(name, path, overwrite=options.overwrite)
    if options.check:
        return checked(f"{', '.join(job.stages)}, output to {options.out}")
    with progress() as report:
        done = calibrate(job, progress=report)
    write_rig(options.out, done.rig, version=mitt.__version__)
    if picture is not None:
        _draw(done, picture)
    if options.json:
        print(json.dumps(_result(done, options.out, picture), allow_nan=False))  # noqa: T201
    else:
        _show(done, options.out, picture)
    return 0


def _draw(done: Calibration, picture: Path) -> None:
    """Draw the coverage of the boards."""
    from mitt.report.figures.coverage import draw_coverage  # noqa: PLC0415 (plots: only when drawn)

    if done.boards is None or done.views is None:
        return
    corners = done.boards.problem.corners
    r = done.boards.problem.residuals().reshape(-1, 2)
    seen = {
        name: (size, corners.uv[corners.camera == k], r[corners.camera == k])
        for k, (name, size) in enumerate(zip(done.views.names, done.views.sizes, strict=True))
    }
    draw_coverage(picture, seen, CELLS)


def _result(done: Calibration, out: Path, picture: Path | None) -> dict[str, object]:
    """Return what ``mitt calibrate --json`` prints."""
    return {
        "schema": "mitt.calibrate/1",
        "version": mitt.__version__,
        "rig": str(out),
        "picture": None if picture is None else str(picture),
        "frame": done.rig.frame,
        "cameras": [c.name for c in done.rig.cameras],
        "stages": {s.name: {"status": s.status, **_finite(s.numbers)} for s in done.stages},
        "warnings": list(done.warnings),
    }


def _finite(numbers: Mapping[str, float]) -> dict[str, float | None]:
    """Return numbers as JSON has them: none for what is not determined."""
    return {name: value if isfinite(value) else None for name, value in numbers.items()}


def _show(done: Calibration, out: Path, picture: Path | None) -> None:
    """Print what was found."""
    console = console_of()
    for stage in done.stages:
        table = Table(
            title=f"{stage.name}: {stage.status}", title_justify="left", show_header=False
        )
        table.add_column(no_wrap=True)
        table.add_column(justify="right", no_wrap=True)
        for name, value in stage.numbers.items():
            table.add_row(name.replace("_", " "), f"{value:.5g}")
        console.print(table)
    for text in done.warnings:
        console.print(f"warning: {text}", style="yellow", soft_wrap=True)
    files = ", ".join(str(path) for path in (out, picture) if path is not None)
    console.print(f"poses in the frame of the {done.rig.frame}; written: {files}", soft_wrap=True)
