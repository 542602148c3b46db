"""``mitt meet``: meet what moves on a belt or in a hand, and take it."""

from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import mitt
from mitt.arm.tools import TOOLS
from mitt.cli.options import MeetOptions
from mitt.cli.screen import checked, print_json, progress, say, show, table, tell_of_kernels
from mitt.files.writing import check_folder, file_name, locked, new_folder, write_json
from mitt.rivals.meeting import PLANNERS
from mitt.trials.meeting import SCHEMA, MeetRunner, MeetTrial, summary
from mitt.trials.result import finite
from mitt.trials.station import Station, station
from mitt.world.scene import read_scene, scene_of

#: What a scene is where none is named: a camera of 60 Hz, 30 ms late, and 2 mm of noise.
_SCENE = {
    "base": "lab",
    "sensing": {"latency": 30, "point_noise": 0.002, "frame_rate": 60.0},
}
#: Speeds of belt and hand where none is said [m/s]; and of the tool near a person, as robots that
#: a person may touch are set to (ISO 10218-1: 0.25 m/s).
_SPEEDS, _NEAR_PERSON = {"belt": 0.3, "hand": 0.8}, 0.25


def meet(options: MeetOptions) -> int:
    """Run ``mitt meet``; return its exit status."""
    out = options.out or _default_folder(options)
    check_folder(out, overwrite=options.overwrite or options.check)
    scene = scene_of(_SCENE, place="scene") if options.scene is None else read_scene(options.scene)
    tool = replace(TOOLS[options.tool], delay=options.gripper_delay)
    at = station(options.arm, tool, options.target, scene, limits=options.limits,
                 speed=_tool_speed(options))  # fmt: skip
    if options.check:
        return checked(f"{options.trials} trials, output to {out}")
    with locked(out):
        tell_of_kernels()
        with progress() as report:
            runner = _runner(options, at)
            trials = []
            for k in range(options.trials):
                report("meeting", k, options.trials)
                trials.append(runner.trial(k))
            report("meeting", options.trials, options.trials)
        result = _result(options, at, trials, summary(trials, runner.stopwatch))
        write_json(out / "result.json", result)
    if options.json:
        print_json(result)
    else:
        _show(options, trials, result["summary"], out)
    return 0


def _tool_speed(options: MeetOptions) -> float:
    """Return the largest speed of the tool [m/s]."""
    if options.tool_speed is not None:
        return options.tool_speed
    return _NEAR_PERSON if options.target == "hand" else float("inf")


def _runner(options: MeetOptions, at: Station) -> MeetRunner:
    """Return what runs the trials."""
    speed = options.speed or _SPEEDS[options.target]
    generator = at.generator(options.generator, rate=options.plan_rate)
    return MeetRunner(at, seed=options.seed, speed=speed, generator=generator)


def _result(
    options: MeetOptions, at: Station, trials: list[MeetTrial], said: dict[str, Any]
) -> dict[str, Any]:
    """Return the result as the contract writes it."""
    return {
        "schema": SCHEMA,
        "version": mitt.__version__,
        "arm": at.arm.model.name,
        "limits": at.arm.limits.name,
        "tool": options.tool,
        "gripper_delay_s": options.gripper_delay,
        "target": options.target,
        "speed_m_s": options.speed or _SPEEDS[options.target],
        "generator": options.generator,
        **({"plan_rate_hz": options.plan_rate} if options.generator in PLANNERS else {}),
        "seed": options.seed,
        "trials": [finite(asdict(t)) for t in trials],
        "summary": said,
    }


def _default_folder(options: MeetOptions) -> Path:
    """Return where the result goes whose user named no place."""
    folder = Path("runs") / file_name(f"meet-{options.seed}-{options.target}")
    return folder if options.overwrite else new_folder(folder)


def _show(options: MeetOptions, trials: list[MeetTrial], said: dict[str, Any], out: Path) -> None:
    """Print the table of a run: the first 20 trials, and 40 of the others that failed."""
    rows = table(
        f"{options.arm}, {options.tool}, {options.target}, {options.generator}",
        ("trial", "status", "t [s]", "in step [ms]", "off [mm]", "rel. [m/s]", "[N]", "why"),
        left=("status", "why"), no_wrap=True,
    )  # fmt: skip
    for t in trials[:20] + [x for x in trials[20:] if x.status != "met"][:40]:
        cells = (
            _number(t.t_met_s, 2), f"{1e3 * t.in_sync_s:.0f}", _number(t.position_error_mm, 1),
            _number(t.velocity_error_m_s, 2), _number(t.peak_contact_force_n, 0),
        )  # fmt: skip
        rows.add_row(str(t.index), t.status, *cells, "" if t.status == "met" else
                     t.binding_limit or "")  # fmt: skip
    show(rows)
    low, high = said["ci95"]
    say(f"met {said['met']} of {said['trials']}, {100.0 * said['meet_rate']:.1f} % "
        f"({100.0 * low:.1f} to {100.0 * high:.1f}); {out / 'result.json'}")  # fmt: skip


def _number(value: float | None, digits: int) -> str:
    """Return a number as a table has it."""
    return "" if value is None else f"{value:.{digits}f}"
