"""Options of the commands as plain data; light to import, so that ``--help`` is quick."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

Csv = Annotated[Path | None, arg(metavar="CSV")]
Images = Annotated[str | None, arg(metavar="IMAGES")]
Metres = Annotated[float, arg(metavar="M")]
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
            refined each millisecond besides.
        vision: What the catcher sees: images of two cameras, or noisy points.
        cameras: Cameras that stand still, or on heads that follow the ball; as the scene says if
            left out.
        scene: The world: ideal, lab or rough, or a TOML file that may start from one of them.
        throws_file: Throws to use: columns x,y,z,vx,vy,vz [m, m/s].
        flights: Recorded flights to use: columns flight,t_s,x_m,y_m,z_m.
        record: Which throws to record, besides the first: none at all, the failures, or all.
        out: Folder to write; runs/<seed>-<generator> if left out.
        overwrite: Use a folder that has files in it.
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
    record: Literal["none", "failures", "all"] = "failures"
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
        tip: Frame of the file at the catch point, z along the palm's normal.
        joints: Joints of which three are to be active; any if left out.
        limits: Limit set: a name, or a TOML file; that of the arm's file if left out.
        aim: Point that the balls are aimed at [m], as X,Y,Z; the design chooses if left out.
        scene: The world in which it is tried: a name, or a TOML file.
        effort: How much is tried: quick for a first look.
        seed: Seed of the search.
        workers: Processes; one a core if left out.
        overwrite: Replace an existing file.
    """

    arm: Annotated[str, Positional, arg(metavar="ARM")]
    out: Annotated[Path, arg(metavar="DESIGN.toml")]
    tip: Tip = None
    joints: Joints = None
    limits: Annotated[str | None, arg(metavar="NAME|TOML")] = None
    aim: Annotated[str | None, arg(metavar="X,Y,Z")] = None
    scene: Annotated[str | None, arg(metavar="NAME|TOML")] = None
    effort: Literal["quick", "full"] = "full"
    seed: Annotated[int, arg(metavar="S")] = 0
    workers: Annotated[int | None, arg(metavar="N")] = None
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
    """

    cell: Annotated[str, Positional, arg(metavar="CELL")]
    throws: Annotated[int | None, arg(metavar="N")] = None
    yes: bool = False
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
class TrackOptions:
    """Filter recorded positions; write them with velocity, acceleration and uncertainty.

    Attributes:
        points: Positions: columns t_s,x_m,y_m,z_m and, if there are several flights, flight.
        out: File to write: the rows of the input, with what the filter knew by then.
        ahead: Time to look ahead [s]; adds x_ahead_m,y_ahead_m,z_ahead_m. 0 is the filtered place.
        sigma: Standard deviation of each coordinate [m]; learned from the positions if left out.
        overwrite: Replace an existing file.
    """

    points: Annotated[Path, Positional, arg(metavar="POINTS.csv")]
    out: Annotated[Path, arg(metavar="TRACK.csv")]
    ahead: Annotated[float | None, arg(metavar="S")] = None
    sigma: Annotated[float | None, arg(metavar="M")] = None
    overwrite: bool = False
    json: Json = False
    check: Check = False


@dataclass(frozen=True, slots=True, kw_only=True)
class SeeOptions:
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
        overwrite: Replace existing files.
    """

    left: Positional[Annotated[str, arg(metavar="LEFT")]]
    right: Positional[Annotated[str, arg(metavar="RIGHT")]]
    rig: Annotated[Path, arg(metavar="RIG.toml")]
    out: Annotated[Path, arg(metavar="TRACK.csv")]
    points: Csv = None
    video: Annotated[Path | None, arg(metavar="MKV|MP4")] = None
    no_video: bool = False
    fps: Annotated[float | None, arg(metavar="HZ")] = None
    max_skew: Annotated[float, arg(metavar="S")] = 5e-4
    frames: Annotated[int | None, arg(metavar="N")] = None
    ball: Literal["any", "thrown", "table-tennis"] = "any"
    ball_radius: Metres = 0.04
    overwrite: bool = False
    json: Json = False
    check: Check = False


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrateOptions:
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
        arm: The arm whose joint angles the tables hold: wam, an arm file, or a description file
            with --tip and --joints.
        tip: Frame of the file at the catch point.
        arm_log: The hand in motion: t_s and places as in --hand.
        points: What the cameras saw of it: t_s,x_m,y_m,z_m, from mitt see --points.
        search: Largest clock offset looked for, either way [s].
        picture: Picture of the coverage to write; beside --out if left out.
        overwrite: Replace existing files.
    """

    out: Annotated[Path, arg(metavar="RIG.toml")]
    rig: Annotated[Path | None, arg(metavar="TOML")] = None
    left: Images = None
    right: Images = None
    board: Annotated[str, arg(metavar="CxR")] = "9x6"
    square: Metres = 0.03
    marker: Metres = 0.022
    dictionary: Annotated[str, arg(metavar="NAME")] = "4X4_50"
    coefficients: Literal[0, 1, 2, 4, 5] = 4
    level: Annotated[int | None, arg(metavar="NUMBER")] = None
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
    search: Annotated[float, arg(metavar="S")] = 1.0
    picture: Annotated[Path | None, arg(metavar="PNG")] = None
    overwrite: bool = False
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
        overwrite: Use a folder that has files in it, and throw everything anew.
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
    """Write the page of a study, DIR/report.html, with replays of its worst throws beside it.

    Attributes:
        folder: Folder of a study, or of a run of mitt catch that was broken off.
        replays: Throws to show as 3-D replays, each made once more and kept beside the page.
    """

    folder: Annotated[Positional[Path], arg(metavar="DIR")]
    replays: Annotated[int, arg(metavar="N")] = 6
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
