"""``mitt meet``: meet what moves on a belt or in a hand, and take it."""

import shlex
from collections.abc import Callable
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

import mitt
from mitt.arm.tools import TOOLS
from mitt.cli.options import MeetOptions
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
from mitt.errors import FileError, InputError, meant
from mitt.files.arm_file import joint_names
from mitt.files.writing import check_ours, locked
from mitt.interrupts import notice, status_of, words_of
from mitt.rivals.meeting import PLANNERS
from mitt.trials.log import keep_recording
from mitt.trials.meeting import SCHEMA, Course, MeetRunner, MeetTrial, summary
from mitt.trials.result import PAGE, RESULT, finite, kept_words
from mitt.trials.station import PARTS_SCENE, TARGETS, Station, station
from mitt.trials.task_folder import MEETING, incomplete, kept_result
from mitt.world.flights import RecordedFlight, read_flights
from mitt.world.scene import read_scene

#: Options that may name a file.
_FILES = ("arm", "scene", "limits", "target")
#: Speeds of belt and hand where none is said [m/s]; and of the tool near a person: the reduced
#: speed of manual mode (ISO 10218-1: 0.25 m/s), which says nothing of forces (ISO/TS 15066).
_SPEEDS = {"belt": 0.3, "hand": 0.8}
_NEAR_PERSON = 0.25
#: Trials where none are said, and longest recorded motion [s].
_TRIALS = 10
_LONGEST = 60.0


def meet_command(options: MeetOptions) -> int:
    """Run ``mitt meet``; return its exit status."""
    recordings = _recordings(options.target)
    count = options.trials or len(recordings) or _TRIALS
    out = run_folder(options, f"meet-{options.seed}-{Path(options.target).stem}")
    scene = PARTS_SCENE if options.scene is None else read_scene(options.scene)
    tool = replace(TOOLS[options.tool], delay=options.gripper_delay)
    at = station(
        options.arm,
        tool,
        "belt" if options.target == "belt" else "hand",
        scene,
        tip=options.tip,
        joints=joint_names(options.joints),
        limits=options.limits,
        speed=_tool_speed(options),
    )
    generator = at.generator(options.generator, rate=options.plan_rate)
    runner = MeetRunner(
        at, seed=options.seed, speed=_speed(options), generator=generator, recordings=recordings
    )
    check_record(options)
    if options.check:
        return checked(f"{count} trials, output to {out}")
    check_ours(out, MEETING)
    trials = list[MeetTrial]()

    def said() -> dict[str, Any]:
        head = _head(options, at) | incomplete(len(trials), count)
        return head | {
            "trials": [finite(asdict(t)) for t in trials],
            "summary": summary(trials, runner.stopwatch),
        }

    with locked(out):
        tell_of_kernels()
        with progress() as report:
            with kept_result(out, MEETING, said, count, overwrite=options.overwrite) as kept:
                keep = partial(keep_recording, options.record, "met", runner, out)
                course, stopped = _run(runner, count, report, trials, keep, kept)
            result, page = said(), RESULT
            if course is not None and not stopped:
                from mitt.report.meet_page import write_meet_page  # noqa: PLC0415 (plots)

                page = PAGE
                report("report", 0, 1)
                typed = shlex.join(["mitt", "meet", *repeated(options, files=_FILES)])
                write_meet_page(out / page, result, course, command=typed)
                report("report", 1, 1)
    if options.json:
        print_json(result)
    else:
        _show(options, trials, result["summary"], out / page)
    if stopped:
        say(f"{words_of(stopped)}; {kept_words(len(trials), count, out)}")
    return stopped


def _run(
    runner: MeetRunner,
    count: int,
    report: Progress,
    trials: list[MeetTrial],
    keep: Callable[[MeetTrial], None],
    kept: Callable[[], None],
) -> tuple[Course | None, int]:
    """Run the trials, each kept when it ends.

    Returns the course of the first, and the status of an interrupt or 0.
    """
    course = None
    try:
        for k in range(count):
            report("meeting", k, count)
            trials.append(runner.trial(k))
            keep(trials[-1])
            kept()
            course = course or runner.course
        report("meeting", count, count)
    except KeyboardInterrupt as stop:
        notice()
        return course, status_of(stop)
    return course, 0


def _recordings(target: str) -> tuple[RecordedFlight, ...]:
    """Return the motions of a target that is a file; none for another."""
    if target in TARGETS:
        return ()
    path = Path(target)
    if not path.is_file() and path.suffix.lower() == ".csv":
        raise FileError(f"--target {target}", "a CSV file of motions", "no such file")
    if not path.is_file():
        raise InputError(
            "--target", f"{', '.join(TARGETS)}, or a CSV file", target, do=meant(target, TARGETS)
        )
    recordings = read_flights(path)
    for x in recordings:
        if x.t[-1] > _LONGEST:
            raise FileError(
                f"{path} flight {x.name!r}", f"at most {_LONGEST:g} s", f"{x.t[-1]:g} s"
            )
    return recordings


def _speed(options: MeetOptions) -> float:
    """Return the speed of belt or hand [m/s]."""
    return options.speed or _SPEEDS.get(options.target, _SPEEDS["hand"])


def _tool_speed(options: MeetOptions) -> float:
    """Return the largest speed of the tool [m/s]; whatever is not a belt may be a person."""
    if options.tool_speed is not None:
        return options.tool_speed
    return float("inf") if options.target == "belt" else _NEAR_PERSON


def _head(options: MeetOptions, at: Station) -> dict[str, Any]:
    """Return what the result says of the run."""
    return {
        "schema": SCHEMA,
        "version": mitt.__version__,
        "arm": at.arm.model.name,
        "limits": at.arm.limits.name,
        "tool": options.tool,
        "gripper_delay_s": options.gripper_delay,
        "target": options.target,
        "speed_m_s": _speed(options) if options.target in TARGETS else None,
        "tool_speed_m_s": finite(_tool_speed(options)),
        "generator": options.generator,
        **({"plan_rate_hz": options.plan_rate} if options.generator in PLANNERS else {}),
        "seed": options.seed,
    }


def _show(options: MeetOptions, trials: list[MeetTrial], said: dict[str, Any], page: Path) -> None:
    """Print the table of a run, and what it comes to."""
    rows = table(
        f"{options.arm}, {options.tool}, {Path(options.target).name}, {options.generator}",
        (
            "trial",
            "status",
            "beyond [ms]",
            "t [s]",
            "in step [ms]",
            "off [mm]",
            "rel. [m/s]",
            "[N]",
            "why",
        ),
        left=("status", "why"),
        no_wrap=True,
    )
    for t in worth_a_row(trials, "met"):
        cells = (
            table_number(t.t_met_s, 2),
            f"{1e3 * t.in_sync_s:.0f}",
            table_number(t.position_error_mm, 1),
            table_number(t.velocity_error_m_s, 2),
            table_number(t.peak_contact_force_n, 0) + ("!" if t.over_force else ""),
        )
        why = t.binding_limit or ""
        if t.status == "met":
            why = "not placed" if t.placed is False else ""
        rows.add_row(str(t.index), t.status, str(t.limit_violations), *cells, why)
    show(rows)
    hand = said["hand_force_n"]
    show(
        f"met {rate_words(said, 'met', 'trials')}; placed {said['placed']}",
        *beyond_words(trials),
        *([] if hand is None else [f"force on the hand: at most {hand:.0f} N"]),
        f"written: {page}",
    )
