"""``mitt bat``: hit thrown balls back to a target, or stop them."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, Final, final

import numpy as np

import mitt
from mitt.cli.options import BatOptions
from mitt.cli.running import RunCommand, with_origin
from mitt.cli.screen import (
    beyond_words,
    check_record,
    rate_words,
    run_folder,
    table_number,
)
from mitt.clock import Progress
from mitt.core.errors import InputError
from mitt.core.signals import Array
from mitt.io.arm_file import arm_of_task
from mitt.io.reading import reals_of
from mitt.io.writing import check_ours
from mitt.lab.trials.bat_station import (
    TARGET,
    BatStation,
    bat_station,
    coming,
    strike_share,
    throw_ranges,
)
from mitt.lab.trials.batting import BAT, BatTrial, bat_trials
from mitt.lab.trials.prepared import OptionsRun, Trials
from mitt.lab.trials.scored_task import ScoredTask
from mitt.lab.trials.source import Source, source_of
from mitt.lab.trials.task_run import FinishedRun
from mitt.lab.world.flights import RecordedFlight, builtin_flights, read_flights
from mitt.lab.world.scene import DEFAULT_SCENE, Scene, read_scene

#: Name of the recorded flights that ship.
_SHIPPED = "tennicam"
#: Limits of the WAM's motors: those of the idealised arm would flatter.
_LIMITS = {"wam": "wam-48v"}


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class BatRun(OptionsRun):
    """A run of throws to be hit back that can start.

    Attributes:
        target: Where balls are sent [m], shape (3,); None for a shield.
        speed: Least and largest speed of the balls [m/s]; that of default throws where None.
        recordings: Recorded flights instead of throws; none where none are.
        station: The arm where it bats, its map not learned yet.
        source: What is thrown.
    """

    task: ClassVar[ScoredTask] = BAT
    options: BatOptions
    target: Array | None
    speed: tuple[float, float] | None
    recordings: tuple[RecordedFlight, ...]
    station: BatStation
    source: Source

    @property
    def count(self) -> int:
        """Number of throws."""
        return self.source.count

    @property
    def head(self) -> dict[str, object]:
        """What the result says of the run."""
        of, arm = self.options, self.station.arm
        return {
            "version": mitt.__version__,
            "arm": arm.model.name,
            "limits": arm.limits.name,
            "scene": of.scene or DEFAULT_SCENE,
            "vision": of.vision,
            "generator": of.generator,
            "flights": of.flights,
            "target": None if self.target is None else self.target.tolist(),
            "shield": of.shield,
            "speed_m_s": None if self.speed is None else list(self.speed),
            "seed": of.seed,
        }

    def begin(self, progress: Progress) -> Trials:
        """Learn the map, and return what runs the trials."""
        of = self.options
        progress("learning", 0, 1)
        learned = _station(of, self.station.scene, self.target, self.speed, self.recordings)
        progress("learning", 1, 1)
        return bat_trials(
            learned,
            self.source,
            vision=of.vision,
            generator=of.generator,
            keeps=of.record != "none",
        )


def _station(
    options: BatOptions,
    scene: Scene,
    target: Array | None,
    speed: tuple[float, float] | None,
    recordings: tuple[RecordedFlight, ...],
    *,
    learns: bool = True,
) -> BatStation:
    """Return the arm where it bats; without ``learns`` its map is not learned."""
    return bat_station(
        options.arm,
        scene=scene,
        target=target,
        limits=_limits(options),
        around=coming(speed, recordings),
        learns=learns,
    )


def prepare_bats(options: BatOptions) -> BatRun:
    """Read and check all that a run needs, without learning anything.

    Raises:
        MittError: An input cannot be used.
    """
    return with_origin(_prepared, options)


def _prepared(options: BatOptions) -> BatRun:
    """Read and check what was said."""
    if options.shield and options.target is not None:
        raise InputError(
            "--target", "none for a shield", options.target, do="leave one of them out"
        )
    rival = "" if options.generator == "direct" else f"-{options.generator}"
    out = run_folder(options, f"bat-{options.seed}{rival}")
    name, flights = options.scene or DEFAULT_SCENE, options.flights is not None
    given = None if options.speed is None else reals_of("--speed", options.speed, 2, most=100.0)
    if given is not None and not 1.0 <= given[0] <= given[1] <= 20.0:
        raise InputError("--speed", "MIN,MAX with 1 <= MIN <= MAX <= 20 m/s", options.speed)
    speed = None if given is None else (given[0], given[1])
    target = None
    if not options.shield:
        said = options.target
        place = None if said is None else reals_of("--target", said, 3, most=100.0)
        target = np.array(TARGET if place is None else place)
    recordings = _recordings(options.flights)
    scene = read_scene(name, flights=flights)
    at = _station(options, scene, target, speed, recordings, learns=False)
    source = source_of(
        at.arm,
        seed=options.seed,
        drag=scene.ball.drag,
        spinning=scene.ball.spinning,
        count=options.throws,
        recordings=recordings,
        ranges=throw_ranges(speed, at),
    )
    check_record(options)
    if not options.check:
        check_ours(out, BAT.leaves)
    return BatRun(
        options=options,
        target=target,
        speed=speed,
        recordings=recordings,
        station=at,
        source=replace(source, shares=tuple(strike_share(x) for x in recordings)),
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


def _title(finished: FinishedRun) -> str:
    """Return what is above the table of a run."""
    head = finished.run.head
    return f"{head['arm']}, {'shield' if head['shield'] else 'to a target'}, {head['generator']}"


def _row(t: BatTrial) -> tuple[str, ...]:
    """Return a trial as cells of the table."""
    return (
        str(t.index),
        t.status,
        str(t.limit_violations),
        table_number(t.t_hit_s, 2),
        table_number(None if t.landing_m is None else 100.0 * t.landing_m, 1),
        table_number(t.return_speed_m_s, 1),
        table_number(t.peak_contact_force_n, 0),
        "" if t.status == BAT.success else t.binding_limit or "",
    )


def _lines(finished: FinishedRun, said: dict[str, Any]) -> list[str]:
    """Return what the trials of a run come to, a line each."""
    if finished.run.head["shield"]:
        return [
            f"stopped {rate_words(said, BAT.success, 'throws')}",
            *beyond_words(finished.trials),
        ]
    of = {**said, "ci95": said["within_10_cm_ci95"] or said["ci95"]}
    out = [
        f"within 10 cm of the target {rate_words(of, 'within_10_cm', 'throws')}",
        f"within 25 cm of the target {rate_words(said, BAT.success, 'throws')}",
    ]
    if said["median_landing_m"] is not None:
        far = said["p90_landing_m"]
        within = (
            "more than 10 % did not land" if far is None else f"90 % within {100.0 * far:.1f} cm"
        )
        out.append(
            f"landing error: {100.0 * said['median_landing_m']:.1f} cm in the median, {within}"
        )
    return [*out, *beyond_words(finished.trials)]


bat_command: Final = RunCommand(
    task=BAT,
    prepare=prepare_bats,
    title=_title,
    columns=("trial", "status", "beyond [ms]", "t [s]", "off [cm]", "back [m/s]", "[N]", "why"),
    row=_row,
    lines=_lines,
)
"""``mitt bat``."""
