"""``mitt sim``: a cell in simulation, as a process of its own in real time."""

import mitt
from mitt.cell.drivers import check_driver
from mitt.cell.prepare import balls_of, endless, prepare, scene_of_cell
from mitt.cell.serve import CORE, serve
from mitt.commands.options import SimOptions
from mitt.commands.screen import checked, print_json, show, tell_of_kernels
from mitt.errors import InputError
from mitt.files.cell import read_cell
from mitt.interrupts import notice, status_of, tell
from mitt.link.realtime import timekeeping


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
    check_driver(prepared.cell)
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
        show(", ".join(f"{name} {value}" for name, value in said.items() if name != "schema"))
    return status
