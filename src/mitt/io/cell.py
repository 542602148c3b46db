"""Cell files: an arm, what it is thrown, who sees it, how the robot is reached (docs/cell.md)."""

from math import pi
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from mitt.core import checks
from mitt.core.arm.arm import Arm
from mitt.core.arm.description import Capsule
from mitt.core.arm.limits import slowed
from mitt.core.arm.shapes import Surroundings, shapes_of
from mitt.core.arm.standing import check_standing
from mitt.core.errors import FileError, InputError, meant
from mitt.core.eyes.camera import Rig, fixed_rig
from mitt.core.eyes.lens import Lens, is_bent
from mitt.core.signals import TICK
from mitt.io.arm_file import ArmFile, Name, arm_with_hand
from mitt.io.reading import MAX_TOML_BYTES, read_text, read_toml, shipped, shipped_path
from mitt.io.rig import read_rig
from mitt.io.schema import FileSection, Finite, parsed

SCHEMA = "mitt.cell/1"

Takes = Literal["torque", "velocity", "position"]
"""What a robot's drives are commanded."""

#: Ticks from one reading to the next that a catcher goes on by: at 250 Hz balls are still caught.
_TICKS = (1, 2, 4)
#: Of a cell: part of file names.
_FileName = Annotated[str, Field(pattern=r"^\w[\w .+-]{0,59}$")]
_Point = tuple[Finite, Finite, Finite]
_Positive = Annotated[float, Field(gt=0.0, le=1e4)]
_Beside = Annotated[float, Field(ge=-1.0, le=1.0)]
_Side = Annotated[float, Field(ge=0.005, le=0.5)]


class ArmPart(FileSection):
    """The arm, as ``mitt catch`` takes it.

    Attributes:
        file: Its name, or its file.
        tip: Frame at which the hand, or the tool of a task, is mounted.
        joints: The active joints.
        limits: Limit set, by name or file.
        load: Mass that is fixed at the tool plate beside the hand, as ``mitt measure`` finds it
            [kg].
        load_at: Its centre in the frame of the tool plate [m].
    """

    file: Name = "wam"
    tip: Name | None = None
    joints: list[Name] | None = None
    limits: Name | None = None
    load: Annotated[float, Field(ge=0.0, le=20.0)] = 0.0
    load_at: tuple[_Beside, _Beside, _Beside] = (0.0, 0.0, 0.0)


class BallPart(FileSection):
    """What is thrown.

    Attributes:
        radius: Radius [m].
        mass: Mass [kg].
        drag: Quadratic drag coefficient [1/m].
        drag_spread: How wrong that may be, as share.
        restitution: Share of its speed that the ball keeps on the palm.
        friction: Friction on the palm.
    """

    radius: Annotated[float, Field(ge=0.005, le=0.06)] = 0.04
    mass: Annotated[float, Field(ge=0.001, le=2.0)] = 0.07
    drag: Annotated[float, Field(ge=0.0, le=1.0)] = 0.04
    drag_spread: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.3
    restitution: Annotated[float, Field(ge=0.0, le=0.95)] = 0.2
    friction: Annotated[float, Field(gt=0.0, le=3.0)] = 1.0


class BeltPart(FileSection):
    """A level, straight belt.

    Attributes:
        middle: Its middle, where parts are met, seen from above [m].
        direction: Where it leads, from +x towards +y [rad].
        height: Of its surface [m].
        width: Across [m].
        length: Of the straight part [m].
        speed: Mean speed, for a simulated cell [m/s].
    """

    middle: tuple[Finite, Finite]
    direction: Annotated[float, Field(ge=-7.0, le=7.0)] = 0.5 * pi
    height: Annotated[float, Field(ge=-5.0, le=5.0)]
    width: Annotated[float, Field(gt=0.02, le=10.0)] = 0.3
    length: Annotated[float, Field(ge=0.2, le=100.0)] = 6.0
    speed: Annotated[float, Field(ge=0.0, le=5.0)] = 0.3


class AreaPart(FileSection):
    """Where parts may be met, in the arm's base frame.

    Attributes:
        low: Its lowest corner [m].
        high: Its highest corner [m].
    """

    low: _Point
    high: _Point

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        """Refuse corners that are the wrong way round."""
        if any(low >= high for low, high in zip(self.low, self.high, strict=True)):
            raise ValueError("low below high in each coordinate")
        return self


class MeetTask(FileSection):
    """Parts are met on a belt, or in a hand, taken, and put down.

    Attributes:
        kind: What is done; without this table balls are caught that somebody throws.
        target: What moves the part.
        tool: What takes it.
        gripper_delay: Time from the command until the tool acts [s].
        tool_speed: Largest speed of the tool [m/s].
        sides: Of a part: along and across the belt, and its height [m].
        mass: Of a part [kg].
        belt: The belt; a part in a hand needs none.
        area: Where parts may be met; about the middle of the belt if left out.
        put: Where the middle of a part is put down, in the arm's base frame [m].
    """

    kind: Literal["meet"]
    target: Literal["belt", "hand"] = "belt"
    tool: Literal["suction", "jaw"] = "suction"
    gripper_delay: Annotated[float, Field(ge=0.0, le=2.0)] = 0.05
    tool_speed: Annotated[float, Field(ge=0.01, le=20.0)] = 0.25
    sides: tuple[_Side, _Side, _Side] = (0.05, 0.06, 0.04)
    mass: Annotated[float, Field(ge=0.001, le=50.0)] = 0.1
    belt: BeltPart | None = None
    area: AreaPart | None = None
    put: _Point


class SourcePart(FileSection):
    """Where the ball is seen.

    Attributes:
        kind: Positions of the ball, or images of two cameras.
        tracker: What sends the positions: ``natnet`` (OptiTrack), ``qtm`` (Qualisys),
            ``motioncapture``, ``ros2``, or a name of the entry points ``mitt.trackers``; if left
            out, the robot's driver.
        options: Options of the tracker.
        topic: ROS 2 topic.
        message: ``geometry_msgs/PointStamped`` or ``PoseStamped``.
        frame: Frame that the messages must name (REP 105).
        origin: Place of that frame in the arm's base frame [m].
        rpy: Its roll, pitch and yaw there, about fixed axes (REP 103) [rad].
        sigma: Standard deviation of each coordinate [m].
        latency: By how much stamps are later than the exposure [s].
        memory: Of images: name of the shared memory that they come through.
        rig: Of images: RIG.toml; that of ``mitt catch`` if left out.
        calibration_px: Of images: error of the image places that the calibration leaves [px].
    """

    kind: Literal["points", "images"] = "points"
    tracker: Name | None = None
    options: dict[str, str | float | bool] = Field(default_factory=dict)
    topic: Name = "/ball"
    message: Literal["point", "pose"] = "point"
    frame: Name = "world"
    origin: _Point = (0.0, 0.0, 0.0)
    rpy: _Point = (0.0, 0.0, 0.0)
    sigma: Annotated[float, Field(gt=0.0, le=0.1)] = 0.002
    latency: Annotated[float, Field(ge=0.0, le=0.1)] = 0.0
    memory: Name = "mitt-cameras"
    rig: Name | None = None
    calibration_px: Annotated[float, Field(ge=0.0, le=5.0)] = 0.05


class RobotPart(FileSection):
    """How the robot is reached.

    Attributes:
        driver: ``ros2``, ``franka``, ``ur``, ``sim`` (in the same process, without real time), or a
            name of the entry points ``mitt.robots``.
        takes: What its drives are commanded; positions and velocities are setpoints that lead the
            desired motion by delay and lag.
        rate: Readings and commands a second: 1000 or 500, without torques also 250 [Hz].
        watchdog: Time without a command after which it brakes by itself [s].
        delay: Time from reading the joints until the command made then ceases to act [s].
        servo: Bandwidth of its own joint control, where it takes no torques [Hz], as
            ``mitt measure`` finds it.
        joints: Names of the active joints at the robot, in the arm's order; the arm's if left out.
        options: Options of the driver.
    """

    driver: Name = "ros2"
    takes: Takes = "torque"
    rate: _Positive = 1000.0
    watchdog: Annotated[float, Field(ge=0.002, le=1.0)] = 0.02
    delay: Annotated[float, Field(ge=0.0, le=0.02)] = 0.002
    servo: Annotated[float, Field(ge=0.5, le=100.0)] = 8.0
    joints: list[Name] | None = None
    options: dict[str, str | float | bool] = Field(default_factory=dict)

    @property
    def ticks(self) -> int:
        """Ticks from one reading to the next."""
        return round(1.0 / (self.rate * TICK))


class ZonePart(FileSection):
    """A capsule that no part of the arm may enter, in the arm's base frame.

    Attributes:
        start: One end of its axis [m].
        end: The other end [m].
        radius: Radius [m].
    """

    start: _Point
    end: _Point
    radius: _Positive


class MotionPart(FileSection):
    """How fast the arm moves.

    Attributes:
        speed_scale: Share of the speed limits that is used at all, for which the map is learned.
        ready_speed: Share of those that motions to the ready pose use.
    """

    speed_scale: Annotated[float, Field(gt=0.0, le=1.0)] = 1.0
    ready_speed: Annotated[float, Field(gt=0.0, le=0.5)] = 0.15


class Cell(FileSection):
    """All that a cell file says.

    Attributes:
        schema_name: Schema of the file.
        name: Letters, digits, spaces and ``_ . + -``; its recordings are called so.
        arm: The arm.
        map: MAP.json of ``mitt learn``; learned if left out, and kept for the next start.
        task: Parts that are met; balls are caught if left out.
        ball: What is thrown.
        source: Where the ball, or the middle of a part, is seen.
        robot: How the robot is reached.
        zones: Tables ``[[zones]]``: what no part of the arm may enter.
        floor: Height of the floor [m].
        motion: How fast the arm moves.
        throws: Number of throws where ``--throws`` says none; until stopped if left out.
    """

    schema_name: Literal["mitt.cell/1"] = Field(alias="schema")
    name: _FileName
    arm: ArmPart = ArmPart()
    map: Name | None = None
    task: MeetTask | None = None
    ball: BallPart = BallPart()
    source: SourcePart = SourcePart()
    robot: RobotPart = RobotPart()
    zones: list[ZonePart] = Field(default_factory=list, max_length=32)
    floor: Finite = -1.0
    motion: MotionPart = MotionPart()
    throws: Annotated[int, Field(ge=1, le=100_000)] | None = None


def read_cell(name_or_path: str | Path) -> Cell:
    """Return a cell that ships, by name, or one from a TOML file.

    File names in it are taken from the folder of the file.

    Raises:
        FileError: The file cannot be read, or does not say what it should.
    """
    path = _path_of(name_or_path)
    return cell_of(read_toml(path), place=str(path), folder=path.parent)


def _path_of(name_or_path: str | Path) -> Path:
    """Return the file of a cell; errors as of :func:`read_cell`."""
    path = checks.path("cell", name_or_path)
    if path.suffix == ".toml":
        return path
    known = shipped("cells")
    if str(name_or_path) not in known:
        raise FileError(
            str(name_or_path),
            f"a .toml file, or one of {', '.join(known)}",
            "neither",
            do=meant(str(name_or_path), known),
        )
    return shipped_path("cells", str(name_or_path))


def cell_text(name_or_path: str | Path) -> tuple[Path, str]:
    """Return the file of a cell, and its text; errors as of :func:`read_cell`."""
    path = _path_of(name_or_path)
    return path, read_text(path, max_bytes=MAX_TOML_BYTES)


def bare_arm(cell: Cell, arm: Arm) -> Arm:
    """Return the arm of a cell as its robot knows it: without the load that the cell adds."""
    of = cell.arm
    if of.load == 0.0:
        return arm
    none = np.zeros((3, 3))
    return Arm(arm.model.loaded(-of.load, at=np.array(of.load_at), inertia=none), arm.limits)


def without_load(cell: Cell) -> Cell:
    """Return a cell whose arm carries nothing beside its hand."""
    return cell.model_copy(update={"arm": cell.arm.model_copy(update={"load": 0.0})})


def cell_of(raw: Any, *, place: str, folder: Path = Path()) -> Cell:  # noqa: ANN401 (any TOML)
    """Return a cell from what its file says; see :func:`read_cell`."""
    cell = parsed(
        Cell, raw, place=place, wanted=f"a cell of schema {SCHEMA}", do="see docs/cell.md"
    )
    if not any(abs(cell.robot.rate * k * TICK - 1.0) < 1e-3 for k in _TICKS):
        wanted = " or ".join(f"{1.0 / (k * TICK):g}" for k in _TICKS)
        raise FileError(
            f"{place} key 'robot.rate'",
            f"{wanted} Hz",
            f"{cell.robot.rate:g}",
            do="let the driver fill in readings",
        )
    if cell.robot.takes == "torque" and cell.robot.ticks > 2:
        raise FileError(
            f"{place} key 'robot.rate'", "1000 or 500 Hz for torques", f"{cell.robot.rate:g}"
        )
    _check_source(cell, place)
    _check_task(cell, place)
    named = {"file": _beside(folder, cell.arm.file), "limits": _beside(folder, cell.arm.limits)}
    arm = cell.arm.model_copy(update=named)
    source = cell.source.model_copy(update={"rig": _beside(folder, cell.source.rig)})
    beside = {"arm": arm, "source": source, "map": _beside(folder, cell.map)}
    return cell.model_copy(update=beside)


def _check_source(cell: Cell, place: str) -> None:
    """Refuse a tracker where nothing asks one, and options of none."""
    of = cell.source
    if of.tracker is None and of.options:
        wanted, given = "a tracker that they are for", "none"
        raise FileError(f"{place} key 'source.options'", wanted, given, do="say source.tracker")
    if of.tracker is not None and of.kind == "images":
        wanted, given = "none where images are taken", of.tracker
        raise FileError(f"{place} key 'source.tracker'", wanted, given, do="leave it out")


def _check_task(cell: Cell, place: str) -> None:
    """Refuse what a task does not go with."""
    if cell.task is None:
        return
    if cell.task.target == "belt" and cell.task.belt is None:
        raise FileError(f"{place} key 'task.belt'", "the belt that brings the parts", "none")
    images = "images" if cell.source.kind == "images" else None
    load = f"{cell.arm.load:g} kg" if cell.arm.load else None
    for key, value in {"map": cell.map, "source.kind": images, "arm.load": load}.items():
        if value is not None:
            raise FileError(
                f"{place} key {key!r}",
                "none where parts are met",
                str(value)[:60],
                do="leave it out",
            )


def _beside(folder: Path, name: str | None) -> str | None:
    """Return a file's name as seen from here; names without a suffix are names of ours."""
    return name if name is None or Path(name).suffix == "" else str(folder / name)


def arm_of(cell: Cell) -> Arm:
    """Return the arm of a cell, its speeds scaled; errors as of :func:`arm_and_file`."""
    return arm_and_file(cell)[0]


def arm_and_file(cell: Cell) -> tuple[Arm, ArmFile | None]:
    """Return the arm of a cell, its speeds scaled, and the arm file that it comes from, if any.

    Raises:
        MittError: The arm cannot be, carries no hand, or its joints do not fit the robot's.
    """
    of = cell.arm
    arm, file = arm_with_hand(of.file, tip=of.tip, joints=of.joints, limits=of.limits)
    if arm.model.hand is None:
        do = 'say name = "three-finger" in its table [hand]'
        raise InputError(f"{cell.name} arm", "an arm with a hand", "none", do=do)
    check_names(cell, arm)
    scale = cell.motion.speed_scale
    model, limits = arm.model, arm.limits
    if of.load > 0.0:
        model = model.loaded(of.load, at=np.array(of.load_at), inertia=np.zeros((3, 3)))
    if scale != 1.0:
        limits = slowed(limits, scale)
    return (arm if model is arm.model and limits is arm.limits else Arm(model, limits)), file


def check_names(cell: Cell, arm: Arm) -> None:
    """Refuse names of joints at the robot that do not fit an arm, by InputError."""
    names = cell.robot.joints
    if names is not None and (len(names) != arm.n or len(set(names)) != arm.n):
        raise InputError(
            f"{cell.name} robot.joints",
            f"{arm.n} different names, one for each of {', '.join(arm.names)}",
            ", ".join(names),
        )


def around_of(cell: Cell, arm: Arm) -> Surroundings:
    """Return what stands around the arm of a cell.

    Raises:
        MittError: The arm is in a zone, or in the floor, in its ready pose.
    """
    zones = tuple(Capsule(start=z.start, end=z.end, radius=z.radius) for z in cell.zones)
    around = Surroundings(floor=cell.floor, zones=zones)
    shapes_of(arm, around)
    check_standing(arm, cell.floor)
    return around


def rig_of(cell: Cell) -> Rig:
    """Return the cameras of a cell, straightened; those of ``mitt catch`` where it names none.

    Raises:
        FileError: The rig cannot be read.
    """
    return fixed_rig() if cell.source.rig is None else read_rig(Path(cell.source.rig)).rig()


def lenses_of(cell: Cell) -> tuple[Lens, ...]:
    """Return the lenses by which the images of a cell are bent; none where none is.

    Raises:
        FileError: The rig cannot be read.
    """
    if cell.source.rig is None:
        return ()
    found = tuple(c.lens for c in read_rig(Path(cell.source.rig)).cameras)
    return found if any(map(is_bent, found)) else ()
