"""``mitt sim``: a cell in simulation, as a process of its own in real time."""

from typing import Any

import mitt
from mitt.cell.drivers import check_driver
from mitt.cell.prepare import balls_of, endless, prepare, scene_of_cell
from mitt.cell.session import CORE, serve
from mitt.commands.options import SimOptions
from mitt.commands.screen import checked, print_json, show, tell_of_kernels
from mitt.errors import InputError
from mitt.files.cell import read_cell
from mitt.interrupts import notice, status_of, tell
from mitt.link.clock import timekeeping
from mitt.trials.result import spread_words


def run(options: SimOptions) -> int:
    """Run ``mitt sim``; return its exit status."""
    if options.throws is not None and options.throws < 1:
        raise InputError("--throws", "at least 1", options.throws)
    if not 0 <= options.seed < 2**63:
        raise InputError("--seed", "a number from 0 to 2^63 - 1", options.seed)
    prepared = prepare(read_cell(options.cell))
    if prepared.cell.robot.driver != "ros2":
        raise InputError("mitt sim", "a cell with the driver ros2", prepared.cell.robot.driver)
    scene = scene_of_cell(prepared.cell, options.scene)
    source = balls_of(prepared, scene, seed=options.seed, count=options.throws or endless())
    check_driver(prepared.cell, prepared.arm)
    if options.check:
        checked(f"{prepared.cell.name}, scene {scene.base}")
        tell(timekeeping(CORE))
        return 0
    tell_of_kernels()
    status, served = 0, serve(prepared, scene, source, tell)
    try:
        served.run()
    except KeyboardInterrupt as stop:
        notice()
        status = status_of(stop)
    said = {"schema": "mitt.sim/1", "version": mitt.__version__, "cell": prepared.cell.name,
            "seed": options.seed, **served.summary()}  # fmt: skip
    if options.json:
        print_json(said)
    else:
        show(_words(said))
    return status


def _words(said: dict[str, Any]) -> str:
    """Return what was thrown and what became of it as a line for a person."""
    ages = said.get("command_age_us")
    ends = [f"{said[name]} {name}" for name in ("caught", "dropped", "missed", "aborted")
            if said.get(name)]  # fmt: skip
    parts = [f"{said['cell']}, seed {said['seed']}: {said['throws']} throws", *ends]
    if said.get("force_n"):
        parts.append(f"contact force {spread_words(said['force_n'])}")
    if "limit_violations" in said:
        parts += [f"{said['limit_violations']} ticks beyond a limit",
                  f"{said['late_ticks']} late ticks, {said['slipped_ticks']} slipped"]  # fmt: skip
    if ages is not None:
        parts.append(f"commands {ages['p50']:.0f} us old (median), {ages['max']:.0f} at most")
    return ", ".join(parts)
