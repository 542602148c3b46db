"""From a cell file to what runs it: arm, map, catcher, world, balls."""

import hashlib
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from math import pi
from pathlib import Path
from typing import TypeAlias, final

import numpy as np

from mitt.core.arm.arm import Arm, identity_of
from mitt.core.arm.shapes import Surroundings
from mitt.core.arm.tools import TOOLS
from mitt.core.catcher.catcher import Catcher, CatcherSettings
from mitt.core.catcher.family import Family, direct
from mitt.core.catcher.meeting import Meeting
from mitt.core.control.encoders import Encoders
from mitt.core.control.setpoints import Setpoints
from mitt.core.errors import InputError, MittError
from mitt.core.eyes.camera import Rig
from mitt.core.eyes.eyes import Eyes, EyesConfig
from mitt.core.eyes.lens import Lens
from mitt.core.eyes.triangulation import TriangulatorConfig
from mitt.core.kernels import cache_folder
from mitt.core.map.learn import Learned
from mitt.core.map.map_design import MapDesign, default_design
from mitt.core.map.mapping import DirectMap, unlearned
from mitt.core.map.meeting import MeetingMap
from mitt.core.map.neighbourhood import learn, neighbourhood_of_ball
from mitt.core.signals import TICK
from mitt.io.about import About
from mitt.io.arm_file import ArmFile
from mitt.io.cell import (
    BallPart,
    Cell,
    MeetTask,
    arm_and_file,
    around_of,
    check_names,
    lenses_of,
    rig_of,
)
from mitt.io.maps import read_map, save_map
from mitt.io.schema import in_words_of
from mitt.lab.trials.catcher_settings import bandwidth_of, filter_settings, rebound_in, reserved
from mitt.lab.trials.source import source_of, widened
from mitt.lab.trials.station import Station, station
from mitt.lab.world.scene import Ball, Belt, Scene, named_scene, read_scene
from mitt.robot.cell.feeds import Feed, Parts, Throws
from mitt.robot.cell.placing import PutDown
from mitt.version import __version__

#: Largest speed of the hand that brings parts in a simulated cell [m/s].
_HAND = 0.8


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Catching:
    """What a cell catches balls with.

    Attributes:
        file: The arm file that its arm comes from; None where it comes from none.
        design: Design of its map.
        learned: Its map, where the file names one.
    """

    file: ArmFile | None
    design: MapDesign
    learned: Learned | None


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class PreparedCell:
    """A cell whose file was read and found good.

    Attributes:
        cell: What the file says.
        arm: The arm.
        around: What stands around it.
        work: What it catches balls with, or where it meets parts.
        rig: Its cameras, straightened.
        lenses: What bends their images; empty where nothing does.
        placing: How it puts parts down; None where it catches balls.
    """

    cell: Cell
    arm: Arm
    around: Surroundings
    work: Catching | Station
    rig: Rig
    lenses: tuple[Lens, ...] = ()
    placing: PutDown | None = None


CellMap: TypeAlias = DirectMap | MeetingMap
"""What moves the arm of a cell."""


def prepare(cell: Cell) -> PreparedCell:
    """Return a cell whose arm, zones and map were found to fit.

    Raises:
        MittError: Something does not fit; the message says what.
    """
    if cell.task is not None:
        return _meeting(cell, cell.task)
    arm, file = arm_and_file(cell)
    around = around_of(cell, arm)
    learned = None if cell.map is None else read_map(Path(cell.map), arm)
    design = default_design(arm) if learned is None else learned.map.design
    return PreparedCell(
        cell=cell,
        arm=arm,
        around=around,
        rig=rig_of(cell),
        lenses=lenses_of(cell),
        work=Catching(file=file, design=design, learned=learned),
    )


def _meeting(cell: Cell, task: MeetTask) -> PreparedCell:
    """Return a cell where parts are met."""
    tool = replace(TOOLS[task.tool], delay=task.gripper_delay)
    at = station(
        cell.arm.file,
        tool,
        task.target,
        scene_of_cell(cell, None),
        tip=cell.arm.tip,
        joints=cell.arm.joints,
        limits=cell.arm.limits,
        speed=task.tool_speed,
        speed_scale=cell.motion.speed_scale,
    )
    check_names(cell, at.arm)
    if task.area is not None:
        settings = replace(at.settings, low=task.area.low, high=task.area.high)
        at = replace(at, settings=settings)
    placing = PutDown(at.map, np.array(task.put), pause=task.gripper_delay, speed=task.tool_speed)
    return PreparedCell(
        cell=cell,
        arm=at.arm,
        around=around_of(cell, at.arm),
        work=at,
        rig=rig_of(cell),
        placing=placing,
    )


def cell_map(prepared: PreparedCell) -> CellMap:
    """Return the map of a cell: its own, one that was learned for the same before, or a new one."""
    work = prepared.work
    if isinstance(work, Station):
        return work.map
    if work.learned is not None:
        return work.learned.map
    arm, drag, kept = prepared.arm, prepared.cell.ball.drag, _kept_map(prepared, work.design)
    if kept is not None and kept.exists():
        try:
            return read_map(kept, arm).map
        except MittError:
            pass  # of another version: learned anew
    found = learn(arm, design=work.design, around=neighbourhood_of_ball(drag))
    if kept is not None:
        save_map(kept, found)
    return found.map


def _kept_map(prepared: PreparedCell, design: MapDesign) -> Path | None:
    """Return where the map of a cell is kept between runs; None where nothing can be kept."""
    folder = cache_folder()
    if folder is None:
        return None
    model = prepared.arm.model
    tables = [None if x is None else x.tolist() for x in (model.aim, model.arrivals)]
    of = [
        identity_of(prepared.arm),
        asdict(design),
        prepared.cell.ball.drag,
        __version__,
        prepared.arm.limits.name,
        *tables,
    ]
    name = hashlib.sha256(json.dumps(of, sort_keys=True).encode()).hexdigest()[:24]
    return folder / "maps" / f"{name}.json"


def cell_about(prepared: PreparedCell, f: CellMap) -> About:
    """Return what makes the catcher of a cell, as its recordings say it."""
    cell, arm, work = prepared.cell, prepared.arm, prepared.work
    task, ball = cell.task, cell.ball
    ball = ball if task is None else BallPart(mass=task.mass, drag=0.0)
    settings = CatcherSettings(
        ball_mass=ball.mass,
        ball_radius=ball.radius,
        ball_restitution=rebound_in(arm, ball.restitution),
        ball_friction=ball.friction,
        flight=filter_settings(ball.drag, ball.mass, spread=ball.drag_spread),
        around=prepared.around,
        encoders=Encoders(step=tuple(arm.encoder_step.tolist())),
        torque_lead=cell.robot.delay,
        bandwidth=bandwidth_of(cell.robot.takes, cell.robot.servo),
        setpoint_delay=0 if cell.robot.takes == "torque" else round(_delay_of(cell) / TICK),
    )
    floor = float(np.hypot(TriangulatorConfig().sigma_floor, cell.source.calibration_px))
    config = EyesConfig(ball_radius=ball.radius, triangulator=TriangulatorConfig(sigma_floor=floor))
    notes = {"cell": cell.name}
    if isinstance(work, Station):
        settings, notes = work.for_parts(settings), notes | work.notes
    g = cell_generator(prepared, f)
    return About(
        arm=arm,
        generator="direct" if isinstance(g, Family) else "meeting",
        maps=tuple(x.map for x in g.maps) if isinstance(g, Family) else (),
        made_of=g if isinstance(g, Meeting) else None,
        settings=settings,
        rig=prepared.rig,
        eyes=config,
        driven=reserved(arm).limits,
        notes=notes,
    )


def cell_generator(prepared: PreparedCell, f: CellMap) -> Family | Meeting:
    """Return what moves the arm of a cell."""
    if isinstance(f, DirectMap):
        return direct(f)
    assert isinstance(prepared.work, Station)
    return Meeting(f, prepared.work.settings)


def catchers(prepared: PreparedCell, f: CellMap) -> tuple[Catcher, Callable[[Catcher], Catcher]]:
    """Return a catcher of a cell, and what makes a fresh one of it for another throw."""
    of, generator = cell_about(prepared, f), cell_generator(prepared, f)
    eyes = Eyes(of.rig, of.eyes)
    first = Catcher(of.driven_arm, generator, eyes, settings=of.settings)
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
    """Return the world of a simulated cell: a scene, by default ``lab`` with the cell's ball.

    Parts are seen by a camera of 60 Hz, 30 ms late, where no scene says otherwise.
    """
    if scene is not None:
        read = read_scene(scene)
        if read.actuation.takes != "torque":  # what a cell's robot takes is said by the cell
            raise InputError(
                "actuation.takes of the scene",
                "torque",
                read.actuation.takes,
                do="say robot.takes in the cell's file",
            )
        return read if cell.task is None else _with_parts(cell.name, cell.task, read)
    lab, ball = named_scene("lab"), cell.ball
    same = {"radius": ball.radius, "mass": ball.mass, "drag": ball.drag}
    with in_words_of(cell.name, Ball="ball"):
        thrown = Ball(**(lab.ball.model_dump() | same))
    sees = {"point_noise": cell.source.sigma}
    lab = lab.model_copy(update={"ball": thrown, "floor": cell.floor})
    if cell.task is not None:
        lab, sees = (
            _with_parts(cell.name, cell.task, lab),
            sees | {"latency": 30, "frame_rate": 60.0},
        )
    return lab.model_copy(update={"sensing": lab.sensing.model_copy(update=sees)})


def _with_parts(name: str, task: MeetTask, scene: Scene) -> Scene:
    """Return a scene with the parts of the task of a cell of a name, and its belt."""
    with in_words_of(name, Ball="task", Belt="task.belt"):
        part = Ball(sides=task.sides, mass=task.mass, drag=0.0)
        if task.belt is None:
            return scene.model_copy(update={"ball": part})
        belt = Belt(**task.belt.model_dump(exclude={"speed"}))
    return scene.model_copy(update={"ball": part, "belt": belt})


def feed_of(prepared: PreparedCell, scene: Scene, *, seed: int, count: int | None) -> Feed:
    """Return what comes to a simulated cell: throws, or parts; without an end where no count is."""
    work, task = prepared.work, prepared.cell.task
    if isinstance(work, Station):
        assert task is not None
        speed = _HAND if task.belt is None else task.belt.speed
        return Parts(work, speed=speed, seed=seed, count=count or endless(), put=task.put)
    f = unlearned(prepared.arm, work.design)
    source = source_of(
        f.arm,
        seed=seed,
        count=count or endless(),
        drag=scene.ball.drag,
        spinning=scene.ball.spinning,
    )
    throws = None if work.file is None else work.file.throws
    return Throws(source if throws is None else widened(source, throws), prepared.arm)


def endless() -> int:
    """Return the number of throws of a cell that goes on until it is stopped."""
    return int(np.iinfo(np.int32).max)
