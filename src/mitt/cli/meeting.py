"""``mitt meet``: meet what moves on a belt or in a hand, and take it."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, Final, final

import mitt
from mitt.cli.options import MeetOptions
from mitt.cli.running import RunCommand, with_origin
from mitt.cli.screen import (
    beyond_words,
    check_record,
    rate_words,
    run_folder,
    table_number,
)
from mitt.clock import Progress
from mitt.core.arm.tools import TOOLS
from mitt.core.errors import FileError, InputError, meant
from mitt.io.arm_file import joint_names
from mitt.io.writing import check_ours
from mitt.lab.rivals.meeting import PLANNERS
from mitt.lab.trials.meeting import MEET, MeetRunner, MeetTrial
from mitt.lab.trials.prepared import OptionsRun
from mitt.lab.trials.result import finite
from mitt.lab.trials.scored_task import ScoredTask
from mitt.lab.trials.station import PARTS_SCENE, TARGETS, Station, check_seen_in_time, station
from mitt.lab.trials.task_run import FinishedRun
from mitt.lab.world.flights import RecordedFlight, read_flights
from mitt.lab.world.scene import read_scene

#: Speeds of belt and hand where none is said [m/s]; and of the tool near a person: the reduced
#: speed of manual mode (ISO 10218-1: 0.25 m/s), which says nothing of forces (ISO/TS 15066).
_SPEEDS = {"belt": 0.3, "hand": 0.8}
_NEAR_PERSON = 0.25
#: Trials where none are said, and longest recorded motion [s].
_TRIALS = 10
_LONGEST = 60.0


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class MeetRun(OptionsRun):
    """A run of meetings that can start.

    Attributes:
        runner: What runs the trials.
        at: The arm where it meets things.
        count: Number of trials.
    """

    task: ClassVar[ScoredTask] = MEET
    options: MeetOptions
    runner: MeetRunner
    at: Station
    count: int

    @property
    def head(self) -> dict[str, object]:
        """What the result says of the run."""
        of = self.options
        return {
            "version": mitt.__version__,
            "arm": self.at.arm.model.name,
            "limits": self.at.arm.limits.name,
            "tool": of.tool,
            "gripper_delay_s": of.gripper_delay,
            "target": of.target,
            "speed_m_s": _speed(of) if of.target in TARGETS else None,
            "tool_speed_m_s": finite(_tool_speed(of)),
            "generator": of.generator,
            **({"plan_rate_hz": of.plan_rate} if of.generator in PLANNERS else {}),
            "seed": of.seed,
        }

    def begin(self, progress: Progress) -> MeetRunner:  # noqa: ARG002
        """Return what runs the trials: there is nothing to be learned."""
        return self.runner


def prepare_meetings(options: MeetOptions) -> MeetRun:
    """Read and check all that a run needs.

    Raises:
        MittError: An input cannot be used.
    """
    return with_origin(_prepared, options)


def _prepared(options: MeetOptions) -> MeetRun:
    """Read and check all that a run needs."""
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
    check_seen_in_time(at, _speed(options))
    generator = at.generator(options.generator, rate=options.plan_rate)
    runner = MeetRunner(
        at, seed=options.seed, speed=_speed(options), generator=generator, recordings=recordings
    )
    check_record(options)
    if not options.check:
        check_ours(out, MEET.leaves)
    return MeetRun(options=options, runner=runner, at=at, count=count, out=out)


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


def _title(finished: FinishedRun) -> str:
    """Return what is above the table of a run."""
    head = finished.run.head
    return f"{head['arm']}, {head['tool']}, {Path(str(head['target'])).name}, {head['generator']}"


def _row(t: MeetTrial) -> tuple[str, ...]:
    """Return a trial as cells of the table."""
    why = t.binding_limit or ""
    if t.status == "met":
        why = "not placed" if t.placed is False else ""
    return (
        str(t.index),
        t.status,
        str(t.limit_violations),
        table_number(t.t_met_s, 2),
        f"{1e3 * t.in_sync_s:.0f}",
        table_number(t.position_error_mm, 1),
        table_number(t.velocity_error_m_s, 2),
        table_number(t.peak_contact_force_n, 0) + ("!" if t.over_force else ""),
        why,
    )


def _lines(finished: FinishedRun, said: dict[str, Any]) -> list[str]:
    """Return what the trials of a run come to, a line each."""
    hand, rate = said["hand_force_n"], said["parts_a_minute"]
    return [
        *([] if rate is None else [f"{rate:.1f} parts a minute, one at a time"]),
        f"met {rate_words(said, 'met', 'trials')}; placed {said['placed']}",
        *beyond_words(finished.trials),
        *([] if hand is None else [f"force on the hand: at most {hand:.0f} N"]),
    ]


meet_command: Final = RunCommand(
    task=MEET,
    prepare=prepare_meetings,
    title=_title,
    columns=(
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
    row=_row,
    lines=_lines,
)
"""``mitt meet``."""
