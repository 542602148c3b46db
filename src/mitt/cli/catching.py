"""``mitt catch`` and ``mitt learn``: throw, see, map, catch; learn a map."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any, Final

import mitt
from mitt.cli.options import ArmOptions, CatchOptions, LearnOptions
from mitt.cli.running import RunCommand, with_origin
from mitt.cli.screen import (
    check_new_files,
    checked,
    print_json,
    progress,
    rate_words,
    run_folder,
    show,
    table,
    table_number,
    warn,
)
from mitt.core.errors import InputError
from mitt.core.map.learn import Learned
from mitt.core.map.map_design import warnings_of
from mitt.core.map.neighbourhood import LEARNING_SEED, Neighbourhood
from mitt.core.map.neighbourhood import learn as learn_map
from mitt.io.arm_file import ArmSpec
from mitt.io.maps import read_map, save_map
from mitt.io.writing import check_ours
from mitt.lab.trials.registry import check_generator
from mitt.lab.trials.result import force_words
from mitt.lab.trials.runs import Prepared, RunSettings, ThrownBalls
from mitt.lab.trials.score import CATCH, MAP, STATUSES, Trial, reason_of
from mitt.lab.trials.source import source_of, widened
from mitt.lab.trials.task_run import FinishedRun
from mitt.lab.world.overlap import check_scene
from mitt.lab.world.scene import DEFAULT_SCENE, read_scene

#: Options that a map has decided already.
_OF_THE_MAP = ("catch_joint", "q_catch", "kappa", "inward", "order")


def spec_of(options: ArmOptions) -> ArmSpec:
    """Return which arm and which map the options name."""
    said = asdict(options)
    return ArmSpec.model_construct(**{name: said[name] for name in ArmSpec.model_fields})


def prepare_run(options: CatchOptions) -> Prepared:
    """Read and check all that a run needs, without learning or writing anything.

    Raises:
        MittError: An input cannot be used.
    """
    return with_origin(_prepared, options, kept=str(options.map))


def _anew(options: CatchOptions, folder: Path) -> CatchOptions:
    """Return the options of a run again, with the map in its folder."""
    less: dict[str, Any] = dict.fromkeys(_OF_THE_MAP)
    return replace(options, map=folder / MAP, out=folder, overwrite=True, **less)


def _prepared(options: CatchOptions) -> Prepared:
    """Read and check all that a run needs."""
    check_generator(options.generator)
    if options.adapt == "refine" and options.generator != "single":
        raise InputError("--adapt refine", "--generator single", options.generator)
    if options.throws_file is not None and options.flights is not None:
        raise InputError("--throws-file and --flights", "one of them", "both")
    chosen = spec_of(options).read()
    arm = chosen.arm
    if arm.model.hand is None:
        raise InputError(
            "--arm",
            "an arm with a hand or a basket",
            "none",
            do='say name = "three-finger" or "basket" in [hand]',
        )
    scene = read_scene(options.scene or DEFAULT_SCENE, flights=options.flights is not None)
    check_scene(arm, scene)
    if options.cameras is not None:
        sensing = scene.sensing.model_copy(update={"cameras": options.cameras})
        scene = scene.model_copy(update={"sensing": sensing})
    given = [
        f"--{name.replace('_', '-')}"
        for name, value in asdict(options).items()
        if name in _OF_THE_MAP and value is not None
    ]
    if options.map is not None and given:
        raise InputError("--map", "no option that the map itself decides", " and ".join(given))
    learned = None if options.map is None else read_map(options.map, arm)
    design = chosen.design if learned is None else learned.map.design
    source = source_of(
        arm,
        seed=options.seed,
        count=options.throws,
        throws_file=options.throws_file,
        flights_file=options.flights,
        drag=scene.ball.drag,
        spinning=scene.ball.spinning,
    )
    source = source if chosen.throws is None else widened(source, chosen.throws)
    out = run_folder(options, f"{options.seed}-{options.generator}")
    if not options.check:
        check_ours(out, CATCH.leaves)
    said = asdict(options)
    settings = RunSettings(**{x.name: said[x.name] for x in fields(RunSettings)})
    return Prepared(
        settings=settings,
        arm=arm,
        design=design,
        scene=scene,
        source=source,
        learned=learned,
        out=out,
    )


def _title(finished: FinishedRun) -> str:
    """Return what is above the table of a run."""
    head = finished.run.head
    scene = f"scene {head['scene']}" + (", changed" if "scene_changed" in head else "")
    return f"{head['arm']}, limits {head['limits']}, {head['generator']}, {head['vision']}, {scene}"


def _lines(finished: FinishedRun, summary: dict[str, Any]) -> list[str]:
    """Return what the throws of a run come to, a line each."""
    stops = (trial.stopped_by for trial in finished.trials)
    hints = dict.fromkeys(str(stop["hint"]) for stop in stops if stop and stop["hint"])
    failed = shortfalls(summary, finished.trials)
    clock = finished.runner.clock if isinstance(finished.runner, ThrownBalls) else None
    return [
        *(f"stopped: {hint}" for hint in hints),
        f"caught {rate_words(summary, 'caught', 'throws')}",
        *([", ".join(failed)] if failed else []),
        f"{force_words(summary['force_n'], summary['over_force'])}; "
        f"tick {summary['tick_us']['p50']:.0f} us median",
        *([] if clock is None else [clock.words]),
    ]


def shortfalls(summary: Mapping[str, Any], trials: Sequence[Trial]) -> list[str]:
    """Return in words how throws ended that were not caught, and how many exceeded a limit."""
    words = [f"{summary[status]} {status}" for status in STATUSES[1:] if summary[status]]
    beyond = sum(trial.limit_violations > 0 for trial in trials)
    return [*words, f"{beyond} beyond a limit"] if beyond else words


def _row(trial: Trial) -> tuple[str, ...]:
    """Return a trial as cells of the table."""
    return (
        str(trial.index),
        trial.status,
        table_number(trial.t_catch_s, 3),
        table_number(trial.position_error_mm, 1),
        table_number(trial.velocity_error_m_s, 2),
        table_number(trial.peak_contact_force_n, 0) + ("!" if trial.over_force else ""),
        f"{100 * max(trial.peak_speed_ratio):.0f}",
        reason_of(trial.stopped_by) or trial.binding_limit or "",
    )


catch_command: Final = RunCommand(
    task=CATCH,
    prepare=prepare_run,
    anew=_anew,
    title=_title,
    columns=(
        "throw",
        "status",
        "catch [s]",
        "miss [mm]",
        "rel. [m/s]",
        "force [N]",
        "speed [%]",
        "asks most, stopped by",
    ),
    left=("status", "asks most, stopped by"),
    row=_row,
    lines=_lines,
)
"""``mitt catch``."""


def learn_command(options: LearnOptions) -> int:
    """Run ``mitt learn``; return its exit status."""
    chosen = spec_of(options).read()
    arm, design = chosen.arm, chosen.design
    check_new_files(options, {"--out": options.out})
    warn(warnings_of(arm, design), json=options.json)
    if options.check:
        return checked(f"{options.flights_count} flights, output to {options.out}")
    with progress() as report:
        report("learning", 0, 1)
        learned = learn_map(
            arm,
            design=design,
            seed=LEARNING_SEED if options.seed is None else options.seed,
            around=Neighbourhood(flights=options.flights_count),
        )
        report("learning", 1, 1)
    save_map(options.out, learned)
    if options.json:
        print_json(
            {
                "schema": "mitt.learn/1",
                "version": mitt.__version__,
                "map": str(options.out),
                "status": learned.status,
                "flights": learned.flights,
                "left_out": learned.left_out,
                "cost_torque": [step.cost_torque for step in learned.steps],
                "cost_speed": [step.cost_speed for step in learned.steps],
            }
        )
    else:
        _show_learned(learned, options.out)
    return 0


def _show_learned(learned: Learned, out: Path) -> None:
    """Print the cost at each step, the numbers behind fig. 7."""
    costs = table(
        "cost over the optimisation (fig. 7)",
        ("step", "torque", "speed", "sum", "largest share of a limit"),
    )
    for k, step in enumerate(learned.steps):
        numbers = step.cost_torque, step.cost_speed, step.cost_torque + step.cost_speed
        costs.add_row(
            "alpha = 0" if k == 0 else str(k - 1),
            *(f"{x:.4f}" for x in numbers),
            f"{step.worst:.2f}",
        )
    show(
        costs,
        f"{learned.status}: {learned.flights} flights, {learned.left_out} left out; written: {out}",
    )
