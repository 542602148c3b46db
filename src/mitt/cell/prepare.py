"""From a cell file to what runs it: arm, map, catcher, world, balls."""

import hashlib
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from math import pi
from pathlib import Path
from typing import final

import numpy as np

from mitt.arm.arm import Arm, identity_of
from mitt.arm.shapes import Surroundings
from mitt.catcher.catcher import Catcher, CatcherSettings
from mitt.catcher.generators import Direct
from mitt.control.encoders import Encoders
from mitt.control.setpoints import Setpoints
from mitt.errors import InputError, MittError
from mitt.eyes.camera import Rig
from mitt.eyes.eyes import Eyes, EyesConfig
from mitt.eyes.lens import Lens
from mitt.eyes.triangulation import TriangulatorConfig
from mitt.files.about import About
from mitt.files.arm_file import ArmFile
from mitt.files.cell import Cell, arm_and_file, around_of, lenses_of, rig_of
from mitt.files.maps import read_map, save_map
from mitt.kernels import cache_folder
from mitt.map.learn import Learned
from mitt.map.map_design import MapDesign, default_design
from mitt.map.mapping import DirectMap, unlearned
from mitt.signals import TICK
from mitt.trials.catcher_settings import bandwidth_of, filter_settings, rebound, reserved
from mitt.trials.learning import learn, neighbourhood_of_ball
from mitt.trials.source import Source, source_of, widened
from mitt.version import __version__
from mitt.world.scene import Ball, Scene, named_scene, read_scene


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PreparedCell:
    """A cell whose file was read and found good.

    Attributes:
        cell: What the file says.
        arm: The arm.
        file: The arm file that it comes from; None where it comes from none.
        around: What stands around it.
        design: Design of its map.
        learned: Its map, where the file names one.
        rig: Its cameras, straightened.
        lenses: What bends their images; empty where nothing does.
    """

    cell: Cell
    arm: Arm
    file: ArmFile | None
    around: Surroundings
    design: MapDesign
    learned: Learned | None
    rig: Rig
    lenses: tuple[Lens, ...] = ()


def prepare(cell: Cell) -> PreparedCell:
    """Return a cell whose arm, zones and map were found to fit.

    Raises:
        MittError: Something does not fit; the message says what.
    """
    arm, file = arm_and_file(cell)
    around = around_of(cell, arm)
    learned = None if cell.map is None else read_map(Path(cell.map), arm)
    if learned is not None:
        design = learned.map.design
    else:
        design = default_design(arm, base=None if file is None else file.map)
    return PreparedCell(
        cell=cell, arm=arm, file=file, around=around, design=design, learned=learned,
        rig=rig_of(cell), lenses=lenses_of(cell),
    )  # fmt: skip


def map_of(prepared: PreparedCell) -> DirectMap:
    """Return the map of a cell: its own, one that was learned for the same before, or a new one."""
    if prepared.learned is not None:
        return prepared.learned.map
    arm, drag, kept = prepared.arm, prepared.cell.ball.drag, _kept_map(prepared)
    if kept is not None and kept.exists():
        try:
            return read_map(kept, arm).map
        except MittError:
            pass  # of another version: learned anew
    found = learn(arm, design=prepared.design, around=neighbourhood_of_ball(drag))
    if kept is not None:
        save_map(kept, found)
    return found.map


def _kept_map(prepared: PreparedCell) -> Path | None:
    """Return where the map of a cell is kept between runs; None where nothing can be kept."""
    folder = cache_folder()
    if folder is None:
        return None
    model = prepared.arm.model
    tables = [None if x is None else x.tolist() for x in (model.aim, model.arrivals)]
    of = [identity_of(prepared.arm), asdict(prepared.design), prepared.cell.ball.drag, __version__,
          prepared.arm.limits.name, *tables]  # fmt: skip
    name = hashlib.sha256(json.dumps(of, sort_keys=True).encode()).hexdigest()[:24]
    return folder / "maps" / f"{name}.json"


def about_of(prepared: PreparedCell, f: DirectMap) -> About:
    """Return what makes the catcher of a cell, as its recordings say it."""
    cell, ball, arm = prepared.cell, prepared.cell.ball, prepared.arm
    settings = CatcherSettings(
        ball_mass=ball.mass, ball_radius=ball.radius,
        ball_restitution=rebound(arm, ball.restitution),
        ball_friction=ball.friction,
        flight=filter_settings(ball.drag, ball.mass, spread=ball.drag_spread),
        around=prepared.around, encoders=Encoders(step=tuple(arm.encoder_step.tolist())),
        torque_lead=cell.robot.delay, bandwidth=bandwidth_of(cell.robot.takes, cell.robot.servo),
        setpoint_delay=0 if cell.robot.takes == "torque" else round(_delay_of(cell) / TICK),
    )  # fmt: skip
    floor = float(np.hypot(TriangulatorConfig().sigma_floor, cell.source.calibration_px))
    config = EyesConfig(ball_radius=ball.radius, triangulator=TriangulatorConfig(sigma_floor=floor))
    return About(
        arm=arm, generator="direct", maps=(f,), settings=settings, rig=prepared.rig, eyes=config,
        driven=reserved(arm).limits, notes={"cell": cell.name},
    )  # fmt: skip


def catchers(prepared: PreparedCell, f: DirectMap) -> tuple[Catcher, Callable[[Catcher], Catcher]]:
    """Return a catcher of a cell, and what makes a fresh one of it for another throw."""
    of, generator = about_of(prepared, f), Direct(f)
    first = Catcher(of.driven_arm, generator, Eyes(of.rig, of.eyes), settings=of.settings)
    return first, lambda catcher: catcher.again(generator)


def setpoints_of(prepared: PreparedCell) -> Setpoints | None:
    """Return what makes setpoints for a cell's robot; None where it takes torques."""
    robot = prepared.cell.robot
    if robot.takes == "torque":
        return None
    w = 2.0 * pi * robot.servo
    return Setpoints(prepared.arm, robot.takes, bandwidth=w, delay=_delay_of(prepared.cell))


def period_of(cell: Cell) -> float:
    """Return the time from one reading of a cell's robot to the next [s]."""
    return cell.robot.ticks * TICK


def _delay_of(cell: Cell) -> float:
    """Return the time after which a setpoint acts, until the next one does [s]."""
    return max(cell.robot.delay - period_of(cell), 0.0)


def scene_of_cell(cell: Cell, scene: str | None) -> Scene:
    """Return the world of a simulated cell: a scene, by default ``lab`` with the cell's ball."""
    if scene is not None:
        read = read_scene(scene)
        if read.actuation.takes != "torque":  # what a cell's robot takes is said by the cell
            raise InputError("actuation.takes of the scene", "torque", read.actuation.takes,
                             do="say robot.takes in the cell's file")  # fmt: skip
        return read
    lab, ball = named_scene("lab"), cell.ball
    same = {"radius": ball.radius, "mass": ball.mass, "drag": ball.drag}
    thrown = lab.ball.model_copy(update=same)
    sensing = lab.sensing.model_copy(update={"point_noise": cell.source.sigma})
    update = {"ball": Ball.model_validate(thrown), "sensing": sensing, "floor": cell.floor}
    return lab.model_copy(update=update)


def balls_of(prepared: PreparedCell, scene: Scene, *, seed: int, count: int | None) -> Source:
    """Return what a simulated cell throws."""
    f = unlearned(prepared.arm, prepared.design)
    source = source_of(f.arm, seed=seed, count=count, drag=scene.ball.drag)
    throws = None if prepared.file is None else prepared.file.throws
    return source if throws is None else widened(source, throws)


def endless() -> int:
    """Return the number of throws of a cell that goes on until it is stopped."""
    return int(np.iinfo(np.int32).max)
