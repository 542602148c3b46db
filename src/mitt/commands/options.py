"""Options of the commands as plain data; light to import, so that ``--help`` is quick.

Those of the commands around cameras are in :mod:`mitt.commands.camera_options`.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

Csv = Annotated[Path | None, arg(metavar="CSV")]
Json = Annotated[bool, arg(help="Print one JSON object and nothing else to stdout.")]
Check = Annotated[bool, arg(help="Validate the input and do nothing.")]
ArmName = Annotated[str, arg(metavar="NAME|FILE")]
Limits = Annotated[str | None, arg(metavar="NAME|TOML")]
Tip = Annotated[str | None, arg(metavar="FRAME")]
Joints = Annotated[str | None, arg(metavar="A,B,C", help="Active joints of the file, as A,B,C.")]


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmOptions:
    """Which arm and which map.

    Attributes:
        arm: The arm: wam, an arm file (.toml), or a URDF or MJCF file (with --tip and --joints).
        tip: Frame of the file at the catch point, z along the palm's normal.
        limits: Limit set: paper, wam-48v or wam-80v for the wam; for a file model, what it states,
            one that ships, as franka-fr3, or a TOML file (docs/arms.md).
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
    catch_joint: Annotated[int | None, arg(metavar="INT")] = None
    q_catch: Annotated[float | None, arg(metavar="RAD")] = None
    kappa: Annotated[float | None, arg(metavar="RATIO")] = None
    inward: Annotated[float | None, arg(metavar="RATIO")] = None
    order: Annotated[int | None, arg(metavar="INT")] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class CatchOptions(ArmOptions):
    """Throw, see, map, catch; print a table and write DIR.

    Attributes:
        throws: Number of throws; 10, or as many as a file has.
        seed: Seed of throws, plant and noise.
        generator: What turns the ball's estimate into joint motion: direct, several, unoptimised, a
            rival (ik, quintic, ruckig, mpc, ds, clairvoyant), or one that another package adds.
        map: A map from mitt learn; learned first if left out.
        adapt: How the direct map is adapted to a throw: once before moving, by projection, or
            refined for that throw besides.
        vision: What the catcher sees: images of two cameras, or noisy points.
        cameras: Cameras that stand still, or on heads that follow the ball; as the scene says if
            left out.
        scene: The world: ideal, lab or rough, or a TOML file that may start from one of them.
        throws_file: Throws to use: columns x,y,z,vx,vy,vz [m, m/s].
        flights: Recorded flights to use: columns flight,t_s,x_m,y_m,z_m.
        learn_clock: Learn the offset between the clocks of eyes and arm from each catch, and
            correct it from the next throw on.
        record: Which throws to record, besides the first: none at all, the failures, or all.
        record_images: Keep the images in recordings, 11 MB a throw: a replay begins with them.
        out: Folder to write; a new runs/<seed>-<generator> if left out.
        overwrite: Use a folder that has files in it; what mitt catch left there is replaced.
    """

    throws: Annotated[int | None, arg(metavar="N")] = None
    seed: Annotated[int, arg(metavar="S")] = 0
    generator: Annotated[str, arg(metavar="NAME")] = "direct"
    map: Annotated[Path | None, arg(metavar="MAP.json")] = None
    adapt: Literal["projection", "refine"] = "projection"
    vision: Literal["pixels", "points"] = "pixels"
    cameras: Literal["fixed", "active"] | None = None
    scene: Annotated[str | None, arg(metavar="NAME|TOML")] = None
    throws_file: Csv = None
    flights: Csv = None
    learn_clock: bool = False
    record: Literal["none", "failures", "all"] = "failures"
    record_images: bool = False
    out: Annotated[Path | None, arg(metavar="DIR")] = None
    overwrite: bool = False
    json: Json = False
    check: Check = False


@dataclass(frozen=True, slots=True, kw_only=True)
class LearnOptions(ArmOptions):
    """Learn a map; print the cost at each step (fig. 7) and write MAP.json.

    Attributes:
        out: File to write.
        flights_count: Number of flights in the neighbourhood to learn from.
        seed: Seed of that neighbourhood; the one that mitt catch uses if left out.
        overwrite: Replace an existing file.
    """

    out: Annotated[Path, arg(metavar="MAP.json")]
    flights_count: Annotated[int, arg(name="flights", metavar="N")] = 120
    seed: Annotated[int | None, arg(metavar="S")] = None
    overwrite: bool = False
    json: Json = False
    check: Check = False


@dataclass(frozen=True, slots=True, kw_only=True)
class DesignOptions:
    """Find what an arm can catch and the map that does it; write DESIGN.toml for --arm.

    Attributes:
        arm: The arm: wam, a URDF or MJCF file (then with --tip), or an arm file.
        out: Arm file to write, if a design is found.
        tip: Frame of the file, z along the palm's normal: where the hand is mounted.
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
        effort: How much is tried: quick for a first look.
        seed: Seed of the search.
        workers: Processes; one a core if left out.
        resume: Go on with a search that was broken off; it comes to the same design.
        overwrite: Replace an existing file, and begin a search anew.
    """

    arm: Annotated[str, Positional, arg(metavar="ARM")]
    out: Annotated[Path, arg(metavar="DESIGN.toml")]
    tip: Tip = None
    mount: Literal["plate", "catch"] | None = None
    joints: Joints = None
    limits: Annotated[str | None, arg(metavar="NAME|TOML")] = None
    hand: Literal["three-finger", "basket"] | None = None
    tilt: Annotated[float | None, arg(metavar="RAD")] = None
    aim: Annotated[str | None, arg(metavar="X,Y,Z")] = None
    throws_file: Csv = None
    flights: Csv = None
    rate: Annotated[float, arg(metavar="SHARE")] = 0.98
    scene: Annotated[str | None, arg(metavar="NAME|TOML")] = None
    effort: Literal["quick", "full"] = "full"
    seed: Annotated[int, arg(metavar="S")] = 0
    workers: Annotated[int | None, arg(metavar="N")] = None
    resume: bool = False
    overwrite: bool = False
    json: Json = False
    check: Check = False


@dataclass(frozen=True, slots=True, kw_only=True)
class RunOptions:
    """Catch with the robot of a cell, throw after throw, until stopped.

    The arm moves only once Enter was pressed or --yes was said; after a stop, only once it is said
    again (docs/cell.md).

    Attributes:
        cell: A cell that ships (wam-sim), or a CELL.toml file.
        throws: Number of throws; as many as the cell says, or until stopped, if left out.
        yes: The arm may move at once: somebody watches it.
        out: Folder for a recording of the catches, for mitt replay and mitt view.
        overwrite: Use a folder that has files in it, and replace an earlier recording of this cell.
    """

    cell: Annotated[str, Positional, arg(metavar="CELL")]
    throws: Annotated[int | None, arg(metavar="N")] = None
    yes: bool = False
    out: Annotated[Path | None, arg(metavar="DIR")] = None
    overwrite: bool = False
    json: Json = False
    check: Check = False


@dataclass(frozen=True, slots=True, kw_only=True)
class SimOptions:
    """Be a cell in simulation, in real time: robot, thrower, and what sees the ball.

    Attributes:
        cell: A cell that ships (wam-sim), or a CELL.toml file.
        throws: Number of throws; until stopped if left out.
        seed: Seed of throws, plant and noise.
        scene: The world: ideal, lab or rough, or a TOML file; lab with the cell's ball if left out.
    """

    cell: Annotated[str, Positional, arg(metavar="CELL")]
    throws: Annotated[int | None, arg(metavar="N")] = None
    seed: Annotated[int, arg(metavar="S")] = 0
    scene: Annotated[str | None, arg(metavar="NAME|TOML")] = None
    json: Json = False
    check: Check = False


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyOptions:
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

    study: Annotated[Positional[Path], arg(metavar="STUDY.toml")]
    out: Annotated[Path, arg(metavar="DIR")]
    engine: Annotated[str, arg(metavar="local|dask://HOST:PORT")] = "local"
    workers: Annotated[int | None, arg(metavar="N")] = None
    resume: bool = False
    overwrite: bool = False
    json: bool = False
    check: Check = False


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportOptions:
    """Write DIR/report.html: the page of a study, with replays of its worst throws beside it.

    Attributes:
        folder: Folder of a study, or of a run of mitt catch that was broken off.
        replays: Throws to show as 3-D replays, each made once more and kept beside the page.
    """

    folder: Annotated[Positional[Path], arg(metavar="DIR")]
    replays: Annotated[int, arg(metavar="N")] = 6
    json: Json = False
    check: Check = False


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplayOptions:
    """Drive the catcher with recorded senses: same commands? Why was the ball missed?

    Attributes:
        recordings: Recordings of mitt catch, mitt study or mitt run.
        map: Another map for the same arm: where would it have acted differently?
        settings: Other settings of the catcher: TOML with keys of CatcherSettings.
        generator: Another generator, made from the map.
        out: Folder for a page about each recording.
        overwrite: Use a folder that has files in it.
    """

    recordings: Positional[Annotated[tuple[Path, ...], arg(metavar="REC.mcap")]]
    map: Annotated[Path | None, arg(metavar="MAP.json")] = None
    settings: Annotated[Path | None, arg(metavar="TOML")] = None
    generator: Annotated[str | None, arg(metavar="NAME")] = None
    out: Annotated[Path | None, arg(metavar="DIR")] = None
    overwrite: bool = False
    json: Json = False
    check: Check = False


@dataclass(frozen=True, slots=True, kw_only=True)
class ViewOptions:
    """Show a recording in the browser: scrub it, or follow it while it is written.

    Attributes:
        recording: A recording, or a folder whose newest one is followed; runs if left out.
        host: Address to listen at; 0.0.0.0 lets every machine of the network look.
        port: Port; the next free one where it is taken.
        seconds: Time after which to end [s]; never if left out.
    """

    recording: Positional[Annotated[Path | None, arg(metavar="REC.mcap|DIR")]] = None
    host: Annotated[str, arg(metavar="ADDRESS")] = "127.0.0.1"
    port: Annotated[int, arg(metavar="N")] = 8080
    seconds: Annotated[float | None, arg(metavar="S")] = None
    json: Json = False
    check: Check = False


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchOptions:
    """Measure how fast everything is on this machine, beside other libraries, in one run.

    Attributes:
        quick: Fewer repeats, and no IPOPT.
    """

    quick: bool = False
    json: Json = False
    check: Check = False
