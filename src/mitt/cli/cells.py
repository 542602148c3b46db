"""``mitt run``, ``mitt sim``, ``mitt measure``: a cell catches, is simulated, is measured."""

import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager, nullcontext
from pathlib import Path
from typing import Any

import mitt
from mitt.cli.options import GuardOptions, MeasureOptions, RunOptions, SimOptions
from mitt.cli.screen import check_new_files, checked, live_table, print_json, show, tell_of_kernels
from mitt.clock import hurried, pinned, timekeeping, uncollected
from mitt.core.errors import InputError
from mitt.interrupts import notice, status_of, tell
from mitt.io.cell import Cell, arm_of, cell_text, read_cell, without_load
from mitt.io.measured_cell import measured_text, write_measured
from mitt.io.writing import Leaves, check_folder, check_ours, claim_folder, file_name, locked
from mitt.lab.trials.result import spread_words
from mitt.robot.cell.drivers import check_driver, connect_robot
from mitt.robot.cell.excitation import NotedRobot, excitation
from mitt.robot.cell.identification import Figure, Identified, identify
from mitt.robot.cell.prepare import (
    CellMap,
    PreparedCell,
    cell_about,
    feed_of,
    period_of,
    prepare,
    scene_of_cell,
)
from mitt.robot.cell.recorder import Recorder
from mitt.robot.cell.session import (
    CORE,
    STATES,
    Person,
    Session,
    loop_of,
    made_ready,
    serve,
    shared_numbers,
    words,
)

#: Core of the loop among those allowed: the last; ``mitt sim`` takes the first.
_CORE = -1


def run_command(options: RunOptions) -> int:
    """Run ``mitt run``; return its exit status: 1 where it was stopped before all was done."""
    prepared = prepare(read_cell(options.cell))
    throws = options.throws or prepared.cell.throws
    if options.out is not None:
        check_folder(options.out, overwrite=options.overwrite or options.check)
    if options.out is not None and not options.check:
        check_ours(options.out, _leaves(prepared))
    controllers = check_driver(prepared.cell, prepared.arm)
    simulated = prepared.cell.robot.driver == "sim"  # as fast as it goes: others want to run too
    if options.check:
        checked(_about(prepared))
        for wanted in controllers:
            tell(wanted)
        if not simulated:
            tell(timekeeping(_CORE))
        return 0
    tell_of_kernels()
    f = made_ready(prepared, tell)
    person, shown, said = Person(yes=options.yes), shared_numbers(), words()
    counted = ("throws", "caught") if prepared.cell.task is None else ("parts", "met", "placed")
    drawn = nullcontext() if options.json else live_table(shown, said, STATES, counted)
    in_time = nullcontext("no real time") if simulated else hurried()
    session: Session | None = None
    try:
        with drawn, uncollected(), recording(prepared, f, options) as recorder:
            connection = connect_robot(prepared)
            robot = connection.robot
            with closing(robot):
                loop = loop_of(prepared, f, connection, recorder)
                session = Session(
                    loop,
                    robot,
                    person,
                    tell,
                    throws=throws,
                    shown=shown,
                    said=said,
                    recorder=recorder,
                )
                with in_time as granted, pinned(_CORE):
                    tell(f"{_about(prepared)}; {granted}")
                    done = session.run()
    finally:  # what was caught before an error is told all the same
        if session is not None:
            _show_session(session, json=options.json)
    return 128 + session.signal if session.signal else int(not done)


def _show_session(session: Session, *, json: bool) -> None:
    """Print what happened in a session."""
    summary = session.summary()
    if json:
        print_json(summary)
    else:
        said = {
            _named(name, summary): _value_in_words(value)
            for name, value in summary.items()
            if name not in ("schema", "command_age_us", "force_n", "clock")
        }
        force = summary["force_n"]
        pressed = "not measured" if force is None else spread_words(force)
        words = [f"{name} {value}" for name, value in said.items()]
        show(", ".join([*words, f"contact force {pressed}"]), session.clock)


def _named(name: str, said: Mapping[str, object]) -> str:
    """Return what a person calls a figure of a summary: what comes to a cell of parts is parts."""
    return "parts" if name == "throws" and "met" in said else name.replace("_", " ")


def _value_in_words(value: object) -> str:
    """Return a value of the summary for a person."""
    if isinstance(value, list):
        return "; ".join(map(str, value)) or "none"
    return "unknown" if value is None else str(value)


@contextmanager
def recording(prepared: PreparedCell, f: CellMap, options: RunOptions) -> Iterator[Recorder | None]:
    """Give what records the catches, for ``mitt replay`` and ``mitt view``, if there is a DIR.

    The folder is ours alone until the recording is written to its end.
    """
    out = options.out
    if out is None:
        yield None
        return
    with locked(out):
        claim_folder(out, _leaves(prepared), overwrite=options.overwrite)
        with Recorder(out / _name(prepared), cell_about(prepared, f)) as recorder:
            yield recorder


def _name(prepared: PreparedCell) -> str:
    """Return what the recording of a cell is called."""
    return f"{file_name(prepared.cell.name)}.mcap"


def _leaves(prepared: PreparedCell) -> Leaves:
    """Return what is left in a folder: a recording, which says itself who wrote it."""
    names = (re.escape(_name(prepared)),)
    return Leaves(command="mitt run", schema="", manifests=(), names=names)


def _about(prepared: PreparedCell) -> str:
    """Say what a cell is, in a few words."""
    cell, arm = prepared.cell, prepared.arm
    return (
        f"{cell.name}: {arm.model.name}, limits {arm.limits.name}, {cell.robot.driver},"
        f" {cell.robot.takes}, joints {', '.join(cell.robot.joints or arm.names)}"
    )


def sim_command(options: SimOptions) -> int:
    """Run ``mitt sim``; return its exit status."""
    prepared = prepare(read_cell(options.cell))
    if prepared.cell.robot.driver != "ros2":
        raise InputError("mitt sim", "a cell with the driver ros2", prepared.cell.robot.driver)
    scene = scene_of_cell(prepared.cell, options.scene)
    feed = feed_of(prepared, scene, seed=options.seed, count=options.throws)
    check_driver(prepared.cell, prepared.arm)
    if options.check:
        checked(f"{prepared.cell.name}, scene {scene.base}")
        tell(timekeeping(CORE))
        return 0
    tell_of_kernels()
    served = serve(prepared, scene, feed, tell)
    status = _until_stopped(served.run)
    said = {
        "schema": "mitt.sim/1",
        "version": mitt.__version__,
        "cell": prepared.cell.name,
        "seed": options.seed,
        **served.summary(),
    }
    if options.json:
        print_json(said)
    else:
        show(_in_words(said))
    return status


def measure_command(options: MeasureOptions) -> int:
    """Run ``mitt measure``; return its exit status: 1 where the motion was not made to its end."""
    cell = read_cell(options.cell)
    prepared = prepare(cell)
    path, text = cell_text(options.cell)
    out = options.out
    check_new_files(options, {"--out": out})
    if out is not None:
        _check_measurable(cell, path, out, text)
    controllers = check_driver(cell, prepared.arm)
    if options.check:
        checked(_about(prepared))
        for wanted in controllers:
            tell(wanted)
        return 0
    tell_of_kernels()
    f = made_ready(prepared, tell)
    in_time = nullcontext("no real time") if cell.robot.driver == "sim" else hurried()
    with uncollected():
        connection = connect_robot(prepared)
        noted = NotedRobot(connection.robot, cell.robot.takes)
        with closing(noted):
            loop = loop_of(prepared, f, connection._replace(robot=noted), measures=excitation)
            session = Session(loop, noted, Person(yes=options.yes), tell, throws=0)
            with in_time as granted, pinned(_CORE):
                tell(f"{_about(prepared)}; {granted}")
                session.run()
    if loop.measured is None:
        tell("the arm was not measured: the motion was not made to its end")
        return 128 + session.signal if session.signal else 1
    log = noted.log(*loop.measured)
    found = identify(arm_of(without_load(cell)), cell.robot.takes, log, period=period_of(cell))
    said = {"schema": "mitt.measure/1", "version": mitt.__version__, "cell": cell.name}
    if options.json:
        print_json({**said, **found.figures, "out": None if out is None else str(out)})
    else:
        show(*found.words)
    if out is not None:
        about = f"{cell.name}, by mitt {mitt.__version__}"
        write_measured(out, measured_text(text, found.values, place=str(path)), about=about)
        read_cell(out)  # says what no cell may have, as a delay of 30 ms
        tell(f"written: {out}")
    return 0


def _check_measurable(cell: Cell, path: Path, out: Path, text: str) -> None:
    """Refuse a file that could not say what is measured, before the arm moves."""
    named = (cell.arm.file, cell.arm.limits, cell.map, cell.source.rig)
    files = any(x is not None and Path(x).suffix for x in named)
    if files and path.parent.absolute() != out.parent.absolute():
        do = "the cell names other files as seen from there"
        raise InputError("--out", f"a file in the folder {path.parent}", str(out), do=do)
    some = Figure(1.0, 0.0)
    measured_text(text, Identified(delay=some, servo=some).values, place=str(path))


def guard_command(options: GuardOptions) -> int:
    """Run ``mitt guard``; return its exit status."""
    from mitt.robot.cell.ros2_guard import Guard, check_guard  # noqa: PLC0415 (the extra ros2)

    cell = read_cell(options.cell)
    arm = arm_of(cell)
    guarded = check_guard(cell, arm)
    if options.check:
        return checked(f"{cell.name}: from {guarded} to {cell.robot.options['command']}")
    guard = Guard(cell, arm, tell)

    def pass_on() -> None:
        with closing(guard), uncollected(), hurried() as granted:
            tell(granted)
            while True:
                guard.step()

    status = _until_stopped(pass_on)
    said = {
        "schema": "mitt.guard/1",
        "version": mitt.__version__,
        "cell": cell.name,
        "passed": guard.passed,
        "refused": guard.refused,
        "silences": guard.silences,
    }
    if options.json:
        print_json(said)
    else:
        show(f"{cell.name}: {guard.passed} commands passed on, {guard.silences} silences")
    return status


def _until_stopped(run: Callable[[], object]) -> int:
    """Run to the end, or until a signal; return the exit status."""
    try:
        run()
    except KeyboardInterrupt as stop:
        notice()
        return status_of(stop)
    return 0


def _in_words(said: dict[str, Any]) -> str:
    """Return what came and what became of it as a line for a person."""
    ages = said.get("command_age_us")
    ends = [
        f"{said[name]} {name}"
        for name in ("caught", "dropped", "met", "placed", "slipped", "missed", "aborted")
        if said.get(name)
    ]
    come = f"{said['throws']} {_named('throws', said)}"
    parts = [f"{said['cell']}, seed {said['seed']}: {come}", *ends]
    if said.get("force_n"):
        parts.append(f"contact force {spread_words(said['force_n'])}")
    if "limit_violations" in said:
        parts += [
            f"{said['limit_violations']} ticks beyond a limit",
            f"{said['late_ticks']} late ticks, {said['slipped_ticks']} slipped",
        ]
    if ages is not None:
        parts.append(f"commands {ages['p50']:.0f} us old (median), {ages['max']:.0f} at most")
    return ", ".join(parts)
