"""Options of the commands as plain data; light to import, so that ``--help`` is quick.

A command is a class here, and a function of the command's name in the module that the class names.
Its docstring is its help.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal


@dataclass(frozen=True, slots=True)
class Arg:
    """How an option is said.

    Attributes:
        value: What stands for its value in a text.
        name: What it is called, where that is not the name of its field.
        place: Whether it is said by its place.
        range: Least and largest number that it takes; any where None.
        known: What has a name and may be its value, as of :mod:`mitt.cli.completion`.
    """

    value: str
    name: str = ""
    place: bool = False
    range: tuple[float, float] | None = None
    known: str = ""


Csv = Annotated[Path | None, Arg("CSV")]
Images = Annotated[str | None, Arg("IMAGES")]
Metres = Annotated[float, Arg("M")]
Workers = Annotated[int | None, Arg("N", range=(1, 1024))]
_OF_SEEDS = Arg("S", range=(0, 2**63 - 1))
Seed = Annotated[int, _OF_SEEDS]
Count = Annotated[int | None, Arg("N", range=(1, 2**31 - 1))]
Trials = Annotated[int | None, Arg("N", range=(1, 100_000))]
Scene = Annotated[str | None, Arg("NAME|TOML", known="scenes")]
Folder = Annotated[Path | None, Arg("DIR")]
MapFile = Annotated[Path | None, Arg("MAP.json")]
ArmName = Annotated[str, Arg("NAME|FILE", known="arms")]
Limits = Annotated[str | None, Arg("NAME|TOML", known="limits")]
Tip = Annotated[str | None, Arg("FRAME")]
Joints = Annotated[str | None, Arg("A,B,C")]
Ratio = Annotated[float | None, Arg("RATIO")]
Seconds = Annotated[float | None, Arg("S")]
CellName = Annotated[str, Arg("CELL", place=True, known="cells")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """What every command takes.

    Attributes:
        json: Print one JSON object and nothing else to stdout.
        check: Validate the input and do nothing.
    """

    module: ClassVar[str]
    examples: ClassVar[tuple[str, ...]]

    json: bool = False
    check: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class TaskOptions(Options):
    """What every command takes that runs trials of a task; see :mod:`mitt.lab.trials.tasks`.

    Attributes:
        seed: Seed of throws, plant and noise.
        scene: The world: ideal, lab, room or rough, or a TOML file.
        record: Recordings to keep, of trials that the map made: none, failures or all.
        out: Folder to write; a new runs/<task>-<seed> if left out.
        overwrite: Use a folder that has files in it; what the same command left there is replaced.
    """

    module: ClassVar = "running"

    seed: Seed = 0
    scene: Scene = None
    record: Literal["none", "failures", "all"] = "none"
    out: Folder = None
    overwrite: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmOptions(Options):
    """Which arm and which map.

    Attributes:
        arm: The arm: a name, as wam or ur5e (mitt arms), an arm file (.toml), or a URDF or MJCF
            file (with --tip and --joints).
        tip: Frame of the file at the catch point, z along the palm's normal; another axis is named
            behind it, as link06:x.
        joints: Active joints of the file, as A,B,C.
        limits: Limit set: paper, wam-48v or wam-80v for the wam; for another arm model, what its
            file states, one that ships, as franka-fr3, or a TOML file (docs/arms.md).
        catch_joint: Index of the catch joint among the active joints, from 0; the last if left out.
        q_catch: Its angle at the catch [rad]; if left out that of the arm file, or chosen for the
            limit set, or pi/2.
        kappa: Velocity-match ratio; 1, the paper's, matches the ball's velocity.
        inward: How much of the ball's line leads into the palm; 0 is the paper's; chosen for the
            limit set if left out.
        order: Degree of the polynomial; 4 as in the paper if left out.
    """

    arm: ArmName = "wam"
    tip: Tip = None
    joints: Joints = None
    limits: Limits = None
    catch_joint: Annotated[int | None, Arg("INT")] = None
    q_catch: Annotated[float | None, Arg("RAD")] = None
    kappa: Ratio = None
    inward: Ratio = None
    order: Annotated[int | None, Arg("INT")] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class CatchOptions(ArmOptions):
    """Throw, see, map, catch; print a table and write DIR.

    Attributes:
        throws: Number of throws; 10, or as many as a file has.
        seed: Seed of throws, plant and noise.
        generator: What turns the ball's estimate into joint motion: direct, single (the paper's one
            map), unoptimised, a rival (ik, quintic, ruckig, mpc, ds, clairvoyant), or one that
            another package adds.
        map: A map from mitt learn; learned first if left out.
        adapt: How the single map is adapted to a throw: once before moving, by projection, or
            refined for that throw besides.
        vision: What the catcher sees: images of two cameras, or noisy points.
        cameras: Cameras that stand still, or on heads that follow the ball; as the scene says if
            left out.
        scene: The world: ideal, lab, room or rough, or a TOML file that may start from one of them.
        throws_file: Throws to use: columns x,y,z,vx,vy,vz [m, m/s].
        flights: Recorded flights to use: columns flight,t_s,x_m,y_m,z_m.
        learn_clock: Learn the offset between the clocks of eyes and arm from each catch, and
            correct it from the next throw on.
        record: Which throws to record, besides the first: none at all, the failures, or all.
        record_images: Keep the images in recordings, 11 MB a throw: a replay begins with them.
        out: Folder to write; a new runs/<seed>-<generator> if left out.
        overwrite: Use a folder that has files in it; what mitt catch left there is replaced.
    """

    module: ClassVar = "catching"
    examples: ClassVar = (
        "mitt catch --throws 100 --seed 1 --out many",
        "mitt catch --arm ARM.toml --scene rough --record all",
    )

    throws: Trials = None
    seed: Seed = 0
    generator: Annotated[str, Arg("NAME", known="generators")] = "direct"
    map: MapFile = None
    adapt: Literal["projection", "refine"] = "projection"
    vision: Literal["pixels", "points"] = "pixels"
    cameras: Literal["fixed", "active"] | None = None
    scene: Scene = None
    throws_file: Csv = None
    flights: Csv = None
    learn_clock: bool = False
    record: Literal["none", "failures", "all"] = "failures"
    record_images: bool = False
    out: Folder = None
    overwrite: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class MeetOptions(TaskOptions):
    """Meet what moves on a belt or in a hand, and take it; print a table and write DIR.

    Attributes:
        arm: The arm: a name, as ur5e (mitt arms), an arm file (.toml), whose hand the tool
            replaces, or a URDF or MJCF file (with --tip and --joints).
        tip: Frame of the file at which the tool is mounted, as its flange, z out of it; another
            axis is named behind it, as link06:x.
        joints: Joints of the file that move, as A,B,C: 5, 6 or 7.
        limits: Limit set, as of mitt catch.
        tool: What the arm takes it with.
        target: What moves it: belt, hand (of a person), or a file of recorded motions, columns
            flight,t_s,x_m,y_m,z_m, each placed before the arm and held by a hand until it is taken.
        speed: Mean speed of the belt, or largest speed of the hand [m/s]; 0.3 and 0.8 if left out.
        gripper_delay: Time from the command until the tool acts [s].
        tool_speed: Largest speed of the tool on its way [m/s]; if left out 0.25 near a person, the
            reduced speed of manual mode in ISO 10218-1, and any at a belt.
        generator: What moves the arm: direct, the map; quintic, ruckig, mpc, planned anew; ds; line
            and line-compensated, which follow a belt's encoder.
        plan_rate: How often those that plan do so [Hz].
        trials: Number of trials; 10, or as many as a file has motions.
        seed: Seed of the trials.
        scene: The world: a name or a TOML file; if left out, lab with a camera of 60 Hz, 30 ms late
            and with 2 mm of noise, above the belt or beside the arm, and with the belt's encoder.
            Its faults (docs/studies.md) stop a belt, turn or take a part.
        out: Folder to write; a new runs/meet-<seed>-<target> if left out.
        overwrite: Use a folder that has files in it; what mitt meet left there is replaced.
    """

    module = "meeting"
    examples = (
        "mitt meet --arm ur5e --target belt --speed 0.5",
        "mitt meet --arm franka-panda --tool jaw --target hand --trials 20",
        "mitt meet --target MOTIONS.csv --gripper-delay 0.2",
    )

    arm: ArmName = "ur5e"
    tip: Tip = None
    joints: Joints = None
    limits: Limits = None
    tool: Literal["suction", "jaw"] = "suction"
    target: Annotated[str, Arg("belt|hand|CSV")] = "belt"
    speed: Annotated[float | None, Arg("M/S", range=(0.01, 5.0))] = None
    gripper_delay: Annotated[float, Arg("S", range=(0.0, 2.0))] = 0.05
    tool_speed: Annotated[float | None, Arg("M/S", range=(0.01, 20.0))] = None
    generator: Literal["direct", "quintic", "ruckig", "mpc", "ds", "line", "line-compensated"] = (
        "direct"
    )
    plan_rate: Annotated[float, Arg("HZ", range=(1.0, 1000.0))] = 100.0
    trials: Trials = None


@dataclass(frozen=True, slots=True, kw_only=True)
class BatOptions(TaskOptions):
    """Hit balls back to a target, or put the paddle in their way; print a table and write DIR.

    Attributes:
        arm: The arm, one that has a stance for batting: wam, ur5e or franka-panda, or an arm file
            (.toml) of one of these.
        limits: Limit set, as of mitt catch; wam-48v for the wam if left out.
        target: Where balls are sent [m], as X,Y,Z; 3,0,0.3 if left out.
        shield: Put the paddle in the way, at rest, instead of hitting to a target.
        throws: Number of throws; 10, or as many as a file has.
        speed: Least and largest speed of the throws at release [m/s], as MIN,MAX; 5,7.1 if left
            out.
        vision: What the catcher sees: images of two cameras, or noisy points.
        flights: Recorded flights to use: columns flight,t_s,x_m,y_m,z_m; or tennicam, the 44 of
            table tennis that ship.
        generator: What moves the arm: direct, the map; rivals to the same contact: quintic, ruckig,
            mpc, ik; and clairvoyant, which is told the true flight and restitution.
        out: Folder to write; a new runs/bat-<seed> if left out.
        overwrite: Use a folder that has files in it; what mitt bat left there is replaced.
    """

    module = "batting"
    examples = (
        "mitt bat --throws 40",
        "mitt bat --limits wam-80v --target 3,0.3,0.4 --vision points",
    )

    arm: ArmName = "wam"
    limits: Limits = None
    target: Annotated[str | None, Arg("X,Y,Z")] = None
    shield: bool = False
    throws: Trials = None
    speed: Annotated[str | None, Arg("MIN,MAX")] = None
    vision: Literal["pixels", "points"] = "pixels"
    flights: Annotated[str | None, Arg("CSV|NAME", known="flights")] = None
    generator: Literal["direct", "quintic", "ruckig", "mpc", "ik", "clairvoyant"] = "direct"


@dataclass(frozen=True, slots=True, kw_only=True)
class LearnOptions(ArmOptions):
    """Learn a map; print the cost at each step (fig. 7) and write MAP.json.

    Attributes:
        out: File to write.
        flights_count: Number of flights in the neighbourhood to learn from.
        seed: Seed of that neighbourhood; the one that mitt catch uses if left out.
        overwrite: Replace an existing file of mitt.
    """

    module: ClassVar = "catching"
    examples: ClassVar = ("mitt learn --limits wam-80v --out MAP.json",)

    out: Annotated[Path, Arg("MAP.json")]
    flights_count: Annotated[int, Arg("N", name="flights", range=(1, 10_000))] = 120
    seed: Annotated[int | None, _OF_SEEDS] = None
    overwrite: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class DesignOptions(Options):
    """Find what an arm can catch and the map that does it; write DESIGN.toml for --arm.

    Attributes:
        arm: The arm: a name, as wam or ur5e, a URDF or MJCF file (then with --tip), or an arm file.
        out: Arm file to write, if a design is found.
        tip: Frame of the file, z along the palm's normal: where the hand is mounted; another axis
            is named behind it, as link06:x.
        mount: What of the hand is at the tip: its plate, as on a flange, or its catch point.
        joints: Joints that may move; any if left out.
        limits: Limit set: a name, or a TOML file; that of the arm's file if left out.
        hand: What is mounted at the tip; that of the arm file, or three-finger, if left out.
        tilt: Angle by which a basket's opening is turned off the tip's z axis [rad].
        aim: Point that the balls are aimed at [m], as X,Y,Z; the design chooses if left out.
        throws_file: Throws to be caught: columns x,y,z,vx,vy,vz [m, m/s]; default ones if left out.
        flights: Recorded flights to be caught: columns flight,t_s,x_m,y_m,z_m.
        rate: Share of the throws to be caught; the softest design that does is taken.
        scene: The world in which it is tried: a name, or a TOML file.
        effort: How much is tried: quick for a first look; refine for small changes of the design
            that ARM has, which it keeps if it finds nothing better.
        seed: Seed of the search.
        workers: Processes; one a core if left out.
        resume: Go on with a search that was broken off; it comes to the same design.
        overwrite: Replace an existing design, once one is found, and begin a search anew.
    """

    module: ClassVar = "designing"
    examples: ClassVar = (
        "mitt design ARM.urdf --tip palm --joints yaw,pitch,elbow --out DESIGN.toml",
        "mitt design wam --limits wam-48v --effort quick --out soft.toml",
        "mitt design ur5e --effort refine --out better.toml",
    )

    arm: Annotated[str, Arg("ARM", place=True, known="arms")]
    out: Annotated[Path, Arg("DESIGN.toml")]
    tip: Tip = None
    mount: Literal["plate", "catch"] | None = None
    joints: Joints = None
    limits: Limits = None
    hand: Literal["three-finger", "basket"] | None = None
    tilt: Annotated[float | None, Arg("RAD")] = None
    aim: Annotated[str | None, Arg("X,Y,Z")] = None
    throws_file: Csv = None
    flights: Csv = None
    rate: Annotated[float, Arg("SHARE")] = 0.98
    scene: Scene = None
    effort: Literal["quick", "full", "refine"] = "full"
    seed: Seed = 0
    workers: Workers = None
    resume: bool = False
    overwrite: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class RunOptions(Options):
    """Catch with the robot of a cell, throw after throw, until stopped.

    The arm moves only once Enter was pressed or --yes was said; after a stop, only once it is said
    again (docs/cell.md).

    Attributes:
        cell: A cell that ships, as wam-sim, ur5e-sim or ur5e-belt-sim (parts on a belt), or a
            CELL.toml file.
        throws: Number of throws; as many as the cell says, or until stopped, if left out.
        yes: The arm may move at once: somebody watches it.
        out: Folder for a recording of the catches, for mitt replay and mitt view.
        overwrite: Use a folder that has files in it, and replace an earlier recording of this cell.
    """

    module: ClassVar = "cells"
    examples: ClassVar = ("mitt run wam-sim --throws 5 --yes",)

    cell: CellName
    throws: Count = None
    yes: bool = False
    out: Folder = None
    overwrite: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class SimOptions(Options):
    """Be a cell in simulation, in real time: robot, thrower, and what sees the ball.

    Attributes:
        cell: A cell that ships, as wam-sim, ur5e-sim or ur5e-belt-sim (parts on a belt), or a
            CELL.toml file.
        throws: Number of throws; until stopped if left out.
        seed: Seed of throws, plant and noise.
        scene: The world: ideal, lab, room or rough, or a TOML file; lab with the cell's ball if
            left out.
    """

    module: ClassVar = "cells"
    examples: ClassVar = ("mitt sim wam-sim --throws 5 --seed 1",)

    cell: CellName
    throws: Count = None
    seed: Seed = 0
    scene: Scene = None


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasureOptions(Options):
    """Measure how the robot of a cell follows, by a motion of 8 s about its ready pose.

    The delay of the link, the bandwidth of a joint control and, where torques are sent, the mass at
    the tool plate, each with its standard deviation. The arm moves only once Enter was pressed or
    --yes was said (docs/cell.md).

    Attributes:
        cell: A cell as of mitt run.
        yes: The arm may move at once: somebody watches it.
        out: File for a copy of the cell with these figures in it, in the folder of the cell's file.
        overwrite: Replace an earlier file of mitt measure.
    """

    module: ClassVar = "cells"
    examples: ClassVar = ("mitt measure wam-sim --yes --out CELL-measured.toml",)

    cell: CellName
    yes: bool = False
    out: Annotated[Path | None, Arg("NEW.toml")] = None
    overwrite: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class GuardOptions(Options):
    """Stand between mitt run and a controller without a timeout: zeros where no command comes.

    Attributes:
        cell: The CELL.toml file of mitt run, with robot.options.guard (docs/cell.md).
    """

    module: ClassVar = "cells"
    examples: ClassVar = ("mitt guard CELL.toml",)

    cell: CellName


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmsOptions(Options):
    """List the arms that have a name, and how well each catches."""

    module: ClassVar = "listing"
    examples: ClassVar = ("mitt arms", "mitt catch --arm ur5e")


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyOptions(Options):
    """Many throws: several generators in a grid of conditions; write tables and a summary.

    Attributes:
        study: A study file, or the name of one that ships (docs/studies.md).
        out: Folder to write.
        engine: Where to throw: local, or dask://HOST:PORT of a scheduler.
        workers: Processes of the local engine; one a core if left out.
        resume: Go on with a study that was broken off; only what is missing is thrown.
        overwrite: Use a folder that has files in it; what a study left there is thrown anew.
        json: Print the summary as one JSON object and nothing else to stdout.
    """

    module: ClassVar = "measuring"
    examples: ClassVar = (
        "mitt study smoke --out STUDY",
        "mitt study STUDY.toml --out MINE --workers 4",
    )

    study: Annotated[Path, Arg("STUDY.toml", place=True, known="studies")]
    out: Annotated[Path, Arg("DIR")]
    engine: Annotated[str, Arg("local|dask://HOST:PORT")] = "local"
    workers: Workers = None
    resume: bool = False
    overwrite: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportOptions(Options):
    """Write DIR/report.html: the page of a study, with replays of its worst throws beside it.

    Attributes:
        folder: Folder of a study, or of a run of mitt catch that was broken off.
        replays: Throws to show as 3-D replays, each made once more and kept beside the page.
    """

    module: ClassVar = "measuring"
    examples: ClassVar = ("mitt report STUDY --replays 3",)

    folder: Annotated[Path, Arg("DIR", place=True)]
    replays: Annotated[int, Arg("N", range=(0, 200))] = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplayOptions(Options):
    """Drive the catcher with recorded senses: same commands? Why was the ball missed?

    Attributes:
        recordings: Recordings of mitt catch, mitt study or mitt run.
        map: Another map for the same arm: where would it have acted differently?
        settings: Other settings of the catcher: TOML with keys of CatcherSettings.
        generator: Another generator, made from the map.
        out: Folder for a page about each recording.
        overwrite: Use a folder that has files in it.
    """

    module: ClassVar = "replaying"
    examples: ClassVar = (
        "mitt replay REC.mcap --out why",
        "mitt replay REC.mcap --map MAP.json",
    )

    recordings: Annotated[tuple[Path, ...], Arg("REC.mcap", place=True)]
    map: MapFile = None
    settings: Annotated[Path | None, Arg("TOML")] = None
    generator: Annotated[str | None, Arg("NAME", known="generators")] = None
    out: Folder = None
    overwrite: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class ViewOptions(Options):
    """Show a recording in the browser: scrub it, or follow it while it is written.

    Attributes:
        recording: A recording, or a folder whose newest one is followed; runs if left out.
        host: Address to listen at; 0.0.0.0 lets every machine of the network look.
        port: Port; the next free one where it is taken.
        seconds: Time after which to end [s]; never if left out.
    """

    module: ClassVar = "replaying"
    examples: ClassVar = ("mitt view REC.mcap --port 8080",)

    recording: Annotated[Path | None, Arg("REC.mcap|DIR", place=True)] = None
    host: Annotated[str, Arg("ADDRESS")] = "127.0.0.1"
    port: Annotated[int, Arg("N", range=(1, 65_535))] = 8080
    seconds: Seconds = None


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchOptions(Options):
    """Measure how fast everything is on this machine, beside other libraries, in one run.

    Attributes:
        quick: Fewer repeats, and no IPOPT.
    """

    module: ClassVar = "measuring"
    examples: ClassVar = ("mitt bench --json",)

    quick: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackOptions(Options):
    """Filter recorded positions; write them with velocity, acceleration and uncertainty.

    Attributes:
        points: Positions: columns t_s,x_m,y_m,z_m and, if there are several flights, flight.
        out: File to write: the rows of the input, with what the filter knew by then.
        ahead: Time to look ahead [s]; adds x_ahead_m,y_ahead_m,z_ahead_m. 0 is the filtered place.
        sigma: Standard deviation of each coordinate [m]; learned from the positions if left out.
        overwrite: Replace an existing file of mitt.
    """

    module: ClassVar = "seeing"
    examples: ClassVar = ("mitt track POINTS.csv --out TRACK.csv --ahead 0.1",)

    points: Annotated[Path, Arg("POINTS.csv", place=True)]
    out: Annotated[Path, Arg("TRACK.csv")]
    ahead: Seconds = None
    sigma: Annotated[float | None, Arg("M")] = None
    overwrite: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class SeeOptions(Options):
    """Follow a ball through two videos, image folders or cameras; write its track.

    Attributes:
        left: Video, folder of images, genicam:PRODUCER.cti#INDEX or basler:SERIAL.
        right: The same of the right camera.
        rig: The rig, from mitt calibrate.
        out: Track to write: time, position, velocity, acceleration and standard deviations.
        points: Positions as triangulated, unfiltered, to write as well: t_s,x_m,y_m,z_m.
        video: Side-by-side video to write, .mkv or .mp4; beside --out if left out.
        no_video: Write no video.
        fps: Frames a second, where files and cameras do not tell the time.
        max_skew: Largest difference of two frames' times that are taken as one instant [s].
        frames: Most frames to take from each camera; 1000 from live ones if left out.
        ball: What is believed of the flight: any ball, the thrown one of mitt catch, or a
            table-tennis ball.
        ball_radius: Radius of the ball [m].
        ball_colour: Its colour, where that tells it from what is behind it better than its
            brightness: red, green, blue as six hexadecimal digits, or a picture of it.
        left_background: Images or a film of the left camera without the ball; the film itself, or
            the first images of a live camera, if left out.
        right_background: The same of the right camera.
        overwrite: Replace existing files of mitt.
    """

    module: ClassVar = "seeing"
    examples: ClassVar = ("mitt see LEFT.mkv RIGHT.mkv --rig RIG.toml --out TRACK.csv",)

    left: Annotated[str, Arg("LEFT", place=True)]
    right: Annotated[str, Arg("RIGHT", place=True)]
    rig: Annotated[Path, Arg("RIG.toml")]
    out: Annotated[Path, Arg("TRACK.csv")]
    points: Csv = None
    video: Annotated[Path | None, Arg("MKV|MP4")] = None
    no_video: bool = False
    fps: Annotated[float | None, Arg("HZ")] = None
    max_skew: Annotated[float, Arg("S", range=(0.0, 1.0))] = 5e-4
    frames: Count = None
    ball: Literal["any", "thrown", "table-tennis"] = "any"
    ball_radius: Metres = 0.04
    ball_colour: Annotated[str | None, Arg("RRGGBB|PICTURE")] = None
    left_background: Annotated[str | None, Arg("FILE|FOLDER")] = None
    right_background: Annotated[str | None, Arg("FILE|FOLDER")] = None
    overwrite: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrateOptions(Options):
    """Calibrate cameras, heads, their place before the robot, their clock; write RIG.toml.

    Does what the given files allow, in this order: boards, heads, hand, clock (docs/rig.md).

    Attributes:
        out: File to write.
        rig: A rig to begin with, where no boards are given.
        left: Images of a ChArUco board from the left camera: folder or video.
        right: The same from the right camera, image by image at the same instants.
        board: Squares across and down.
        square: Side of a square [m].
        marker: Side of a marker [m].
        dictionary: Markers, as OpenCV names them.
        coefficients: Distortion coefficients to find: k1, k2, p1 and p2, k3 in this order.
        level: Number of the image in which the board lies level: it becomes the world, z up.
        left_head: Views at angles of the left head: columns image,pan_rad,tilt_rad.
        right_head: The same of the right head, with the same board in the same place.
        hand: Places of a ball held in the hand: x_m,y_m,z_m or q1_rad,q2_rad,... of each, and its
            centroids u_left_px,v_left_px,u_right_px,v_right_px, or images of it.
        hand_left: Images of the ball, one a row of --hand, if it has no centroids.
        hand_right: The same from the right camera.
        ball_radius: Radius of that ball [m].
        arm: The arm whose joint angles the tables hold: a name, an arm file, or a description file
            with --tip and --joints.
        tip: Frame of the file at the catch point.
        joints: Active joints of the file, as A,B,C.
        arm_log: The hand in motion: t_s and places as in --hand.
        points: What the cameras saw of it: t_s,x_m,y_m,z_m, from mitt see --points.
        catches: Recording of catches, or a folder of them, instead of --arm-log and --points: the
            ball that rides on the braking hand tells the clock.
        search: Largest clock offset looked for, either way [s].
        picture: Picture of the coverage to write; beside --out if left out.
        overwrite: Replace existing files of mitt.
    """

    module: ClassVar = "seeing"
    examples: ClassVar = (
        "mitt calibrate --left LEFT --right RIGHT --out RIG.toml",
        "mitt calibrate --rig RIG.toml --hand HAND.csv --out PLACED.toml",
    )

    out: Annotated[Path, Arg("RIG.toml")]
    rig: Annotated[Path | None, Arg("TOML")] = None
    left: Images = None
    right: Images = None
    board: Annotated[str, Arg("CxR")] = "9x6"
    square: Metres = 0.03
    marker: Metres = 0.022
    dictionary: Annotated[str, Arg("NAME")] = "4X4_50"
    coefficients: Literal[0, 1, 2, 4, 5] = 4
    level: Annotated[int | None, Arg("NUMBER")] = None
    left_head: Csv = None
    right_head: Csv = None
    hand: Csv = None
    hand_left: Images = None
    hand_right: Images = None
    ball_radius: Metres = 0.04
    arm: ArmName = "wam"
    tip: Tip = None
    joints: Joints = None
    arm_log: Csv = None
    points: Csv = None
    catches: Annotated[Path | None, Arg("MCAP|FOLDER")] = None
    search: Annotated[float, Arg("S")] = 1.0
    picture: Annotated[Path | None, Arg("PNG")] = None
    overwrite: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class EvaluateOptions(Options):
    """Play episodes of a Gymnasium environment; print what policies without learning earn.

    Actions are torques of zero, random torques, or what the map commands (expert); each lasts 5 ms.
    A policy of your own is played in the same way by mitt.gym.evaluate (docs/gym.md).

    Attributes:
        task: The environment: catch is mitt/Catch-v0, meet mitt/Meet-v0, bat mitt/Bat-v0.
        policy: One of the policies; all of them if left out.
        episodes: Number of episodes.
        seed: Seed of the first; each next episode has the next one.
        scene: The world: ideal, lab, room or rough, or a TOML file; as of the environment if left
            out.
    """

    module: ClassVar = "evaluating"
    examples: ClassVar = (
        "mitt evaluate catch",
        "mitt evaluate meet --policy random --episodes 20",
    )

    task: Annotated[Literal["catch", "meet", "bat"], Arg("TASK", place=True)]
    policy: Literal["zero", "random", "expert"] | None = None
    episodes: Annotated[int, Arg("N", range=(1, 100_000))] = 100
    seed: Annotated[int, Arg("S", range=(0, 2**31 - 1))] = 80_000
    scene: Scene = None


@dataclass(frozen=True, slots=True, kw_only=True)
class CompletionOptions(Options):
    """Write what lets a shell complete commands, options and names.

    It is kept in a file where the shell looks: ~/.local/share/bash-completion/completions/mitt,
    ~/.config/fish/completions/mitt.fish, or a file _mitt in a folder of zsh's fpath. Names of other
    packages stand in it as they were when it was written.

    Attributes:
        shell: The shell: bash, zsh or fish.
    """

    module: ClassVar = "completion"
    examples: ClassVar = ("mitt completion bash", "mitt completion zsh")

    shell: Annotated[Literal["bash", "zsh", "fish"], Arg("SHELL", place=True)]


COMMANDS: dict[str, type[Options]] = {
    "catch": CatchOptions,
    "arms": ArmsOptions,
    "meet": MeetOptions,
    "bat": BatOptions,
    "learn": LearnOptions,
    "design": DesignOptions,
    "run": RunOptions,
    "sim": SimOptions,
    "measure": MeasureOptions,
    "guard": GuardOptions,
    "study": StudyOptions,
    "report": ReportOptions,
    "track": TrackOptions,
    "see": SeeOptions,
    "calibrate": CalibrateOptions,
    "replay": ReplayOptions,
    "view": ViewOptions,
    "bench": BenchOptions,
    "evaluate": EvaluateOptions,
    "completion": CompletionOptions,
}
"""Options of each command, in the order of the help."""
