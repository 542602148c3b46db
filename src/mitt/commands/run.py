"""``mitt run``: catch with the robot of a cell."""

import re
from contextlib import AbstractContextManager, closing, nullcontext

from mitt.cell.drivers import check_driver, connect
from mitt.cell.prepare import PreparedCell, about_of, map_of, prepare
from mitt.cell.session import STATES, Person, Session, loop_of, numbers, rehearse, words
from mitt.commands.live_table import live_table
from mitt.commands.options import RunOptions
from mitt.commands.screen import checked, print_json, show, tell_of_kernels
from mitt.errors import InputError
from mitt.files.cell import read_cell
from mitt.files.files import check_folder, file_name
from mitt.files.folders import Leaves, check_ours, claim_folder
from mitt.generator.mapping import DirectMap
from mitt.interrupts import tell
from mitt.link.clock import hurried, pinned, timekeeping, uncollected
from mitt.link.recorder import Recorder
from mitt.trials.result import spread_words

#: Core of the loop among those allowed: the last; ``mitt sim`` takes the first.
_CORE = -1


def run(options: RunOptions) -> int:
    """Run ``mitt run``; return its exit status: 1 where it was stopped before all was done."""
    if options.throws is not None and options.throws < 1:
        raise InputError("--throws", "at least 1", options.throws)
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
    f = map_of(prepared)
    rehearse(prepared, f)
    person, shown, said = Person(yes=options.yes), numbers(), words()
    drawn = nullcontext() if options.json else live_table(shown, said, STATES)
    in_time = nullcontext("no real time") if simulated else hurried()
    session: Session | None = None
    try:
        with drawn, uncollected(), recording(prepared, f, options) as recorder:
            connection = connect(prepared)
            robot = connection.robot
            with closing(robot):
                loop = loop_of(prepared, f, connection, recorder)
                session = Session(loop, robot, person, tell, throws=throws, shown=shown,
                                  said=said, recorder=recorder)  # fmt: skip
                with in_time as granted, pinned(_CORE):
                    tell(f"{_about(prepared)}; {granted}")
                    done = session.run()
    finally:  # what was caught before an error is told all the same
        if session is not None:
            _show(session, json=options.json)
    return 128 + session.signal if session.signal else int(not done)


def _show(session: Session, *, json: bool) -> None:
    """Print what happened in a session."""
    summary = session.summary()
    if json:
        print_json(summary)
    else:
        said = {name.replace("_", " "): _in_words(value) for name, value in summary.items()
                if name not in ("schema", "command_age_us", "force_n", "clock")}  # fmt: skip
        force = summary["force_n"]
        pressed = "not measured" if force is None else spread_words(force)
        words = [f"{name} {value}" for name, value in said.items()]
        show(", ".join([*words, f"contact force {pressed}"]), session.clock)


def _in_words(value: object) -> str:
    """Return a value of the summary for a person."""
    if isinstance(value, list):
        return "; ".join(map(str, value)) or "none"
    return "unknown" if value is None else str(value)


def recording(
    prepared: PreparedCell, f: DirectMap, options: RunOptions
) -> AbstractContextManager[Recorder | None]:
    """Return what records the catches, for ``mitt replay`` and ``mitt view``, if there is a DIR."""
    out = options.out
    if out is None:
        return nullcontext()
    claim_folder(out, _leaves(prepared), overwrite=options.overwrite)
    return Recorder(out / _name(prepared), about_of(prepared, f))


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
