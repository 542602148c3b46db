"""``mitt bat``: hit thrown balls back to a target, or stop them."""

import shlex
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import mitt
from mitt.cli.options import BatOptions
from mitt.cli.screen import (
    beyond_words,
    check_record,
    checked,
    print_json,
    progress,
    rate_words,
    repeated,
    run_folder,
    say,
    show,
    table,
    table_number,
    tell_of_kernels,
    worth_a_row,
)
from mitt.clock import Progress
from mitt.errors import InputError
from mitt.files.arm_file import arm_of_task
from mitt.files.writing import check_ours, locked
from mitt.interrupts import notice, status_of, words_of
from mitt.reading import reals_of
from mitt.signals import Array
from mitt.trials.bat_station import (
    TARGET,
    BatStation,
    bat_station,
    coming,
    strike_share,
    throw_ranges,
)
from mitt.trials.batting import SCHEMA, BatRunner, BatTrial, summary
from mitt.trials.log import TrialLog, keep_recording
from mitt.trials.result import PAGE, RESULT, finite, kept_words
from mitt.trials.source import Source, source_of
from mitt.trials.task_folder import BATTING, incomplete, kept_result
from mitt.world.flights import RecordedFlight, builtin_flights, read_flights
from mitt.world.scene import DEFAULT_SCENE, Scene, read_scene

#: Options that may name a file.
_FILES = ("arm", "scene", "limits", "flights")
#: Name of the recorded flights that ship.
_SHIPPED = "tennicam"
#: Limits of the WAM's motors: those of the idealised arm would flatter.
_LIMITS = {"wam": "wam-48v"}


@dataclass(frozen=True, slots=True, kw_only=True)
class _Asked:
    """What a run is made from."""

    target: Array | None
    speed: tuple[float, float] | None
    recordings: tuple[RecordedFlight, ...]
    limits: str | None
    scene: Scene
    out: Path


def bat_command(options: BatOptions) -> int:
    """Run ``mitt bat``; return its exit status."""
    asked = _asked(options)
    station = bat_station(
        options.arm,
        scene=asked.scene,
        target=asked.target,
        limits=asked.limits,
        around=coming(asked.speed, asked.recordings),
        learns=not options.check,
    )
    source = _source(options, asked, station)
    check_record(options)
    if options.check:
        return checked(f"{source.count} throws, output to {asked.out}")
    check_ours(asked.out, BATTING)
    trials = list[BatTrial]()
    with locked(asked.out):
        tell_of_kernels()
        with progress() as report:
            runner = BatRunner(
                station,
                source,
                pixels=options.vision == "pixels",
                generator=options.generator,
                keeps=options.record != "none",
            )

            def said() -> dict[str, Any]:
                head = _head(options, asked, station) | incomplete(len(trials), source.count)
                return head | {
                    "trials": [finite(asdict(t)) for t in trials],
                    "summary": summary(trials, runner.stopwatch),
                }

            with kept_result(
                asked.out, BATTING, said, source.count, overwrite=options.overwrite
            ) as kept:
                keep = partial(keep_recording, options.record, "hit", runner, asked.out)
                log, stopped = _run(runner, source.count, report, trials, keep, kept)
            result, page = said(), RESULT
            if trials and not stopped:
                from mitt.report.bat_page import (  # noqa: PLC0415 (plots: when written)
                    BatContent,
                    write_bat_page,
                )

                page = PAGE
                report("report", 0, 1)
                typed = shlex.join(["mitt", "bat", *repeated(options, files=_FILES)])
                content = BatContent(
                    result=result, arm=station.arm, scene=asked.scene, log=log, command=typed
                )
                write_bat_page(asked.out / page, content)
                report("report", 1, 1)
    if options.json:
        print_json(result)
    else:
        _show(options, trials, result["summary"], asked.out / page)
    if stopped:
        say(f"{words_of(stopped)}; {kept_words(len(trials), source.count, asked.out)}")
    return stopped


def _asked(options: BatOptions) -> _Asked:
    """Read and check what was said."""
    if options.shield and options.target is not None:
        raise InputError(
            "--target", "none for a shield", options.target, do="leave one of them out"
        )
    rival = "" if options.generator == "direct" else f"-{options.generator}"
    out = run_folder(options, f"bat-{options.seed}{rival}")
    name, flights = options.scene or DEFAULT_SCENE, options.flights is not None
    speed = None if options.speed is None else reals_of("--speed", options.speed, 2, most=100.0)
    if speed is not None and not 1.0 <= speed[0] <= speed[1] <= 20.0:
        raise InputError("--speed", "MIN,MAX with 1 <= MIN <= MAX <= 20 m/s", options.speed)
    target = None
    if not options.shield:
        given = (
            None if options.target is None else reals_of("--target", options.target, 3, most=100.0)
        )
        target = np.array(TARGET if given is None else given)
    return _Asked(
        target=target,
        speed=None if speed is None else (speed[0], speed[1]),
        recordings=_recordings(options.flights),
        limits=_limits(options),
        scene=read_scene(name, flights=flights),
        out=out,
    )


def _limits(options: BatOptions) -> str | None:
    """Return the limit set that is said, or that of the arm's motors where it has none."""
    arm = arm_of_task(options.arm)
    own = None if arm.limits is not None else _LIMITS.get(str(arm.arm))
    return own if options.limits is None else options.limits


def _recordings(name: str | None) -> tuple[RecordedFlight, ...]:
    """Return recorded flights by name or file; none where nothing is named."""
    if name is None:
        return ()
    return builtin_flights() if name == _SHIPPED else read_flights(Path(name))


def _source(options: BatOptions, asked: _Asked, station: BatStation) -> Source:
    """Return the balls of a run."""
    source = source_of(
        station.arm,
        seed=options.seed,
        drag=asked.scene.ball.drag,
        count=options.throws,
        recordings=asked.recordings,
        ranges=throw_ranges(asked.speed, station),
    )
    return replace(source, shares=tuple(strike_share(x) for x in asked.recordings))


def _run(
    runner: BatRunner,
    count: int,
    report: Progress,
    trials: list[BatTrial],
    keep: Callable[[BatTrial], None],
    kept: Callable[[], None],
) -> tuple[TrialLog | None, int]:
    """Run all trials, each kept when it ends.

    Returns the log of the first that was hit, and the status of an interrupt or 0.
    """
    log = None
    report("batting", 0, count)
    try:
        for trial in runner.run():
            trials.append(trial)
            keep(trial)
            kept()
            if log is None and trial.status == "hit":
                log = runner.log()
            report("batting", len(trials), count)
    except KeyboardInterrupt as stop:
        notice()
        return log, status_of(stop)
    return log, 0


def _head(options: BatOptions, asked: _Asked, station: BatStation) -> dict[str, Any]:
    """Return what the result says of the run."""
    return {
        "schema": SCHEMA,
        "version": mitt.__version__,
        "arm": station.arm.model.name,
        "limits": station.arm.limits.name,
        "scene": options.scene or DEFAULT_SCENE,
        "vision": options.vision,
        "generator": options.generator,
        "flights": options.flights,
        "target": None if asked.target is None else asked.target.tolist(),
        "shield": options.shield,
        "speed_m_s": None if asked.speed is None else list(asked.speed),
        "seed": options.seed,
    }


def _show(options: BatOptions, trials: list[BatTrial], said: dict[str, Any], page: Path) -> None:
    """Print the table of a run, and what it comes to."""
    rows = table(
        f"{options.arm}, {'shield' if options.shield else 'to a target'}, {options.generator}",
        ("trial", "status", "beyond [ms]", "t [s]", "miss [cm]", "back [m/s]", "[N]", "why"),
        left=("status", "why"),
        no_wrap=True,
    )
    for t in worth_a_row(trials, "hit"):
        cells = (
            table_number(t.t_hit_s, 2),
            table_number(None if t.miss_m is None else 100.0 * t.miss_m, 1),
            table_number(t.return_speed_m_s, 1),
            table_number(t.peak_contact_force_n, 0),
        )
        why = "" if t.status == "hit" else t.binding_limit or ""
        rows.add_row(str(t.index), t.status, str(t.limit_violations), *cells, why)
    show(rows)
    show(f"{'stopped' if options.shield else 'hit'} {rate_words(said, 'hit', 'throws')}")
    if said["median_miss_m"] is not None:
        show(
            f"miss: {100.0 * said['median_miss_m']:.1f} cm in the median, "
            f"90 % within {100.0 * said['p90_miss_m']:.1f} cm"
        )
    show(*beyond_words(trials), f"written: {page}")
