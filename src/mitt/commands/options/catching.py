"""Options of ``mitt catch`` and ``mitt learn``."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import arg

from mitt.commands.options.common import Csv, Folder, Map
from mitt.trials.choice import LimitName


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmOptions:
    """Which arm and which map.

    Attributes:
        arm: The arm: wam, or a URDF or MJCF file (then with --tip and --joints).
        tip: Frame of the file at the catch point, z along the palm's normal.
        joints: Active joints of the file, as A,B,C.
        limits: Limit set: paper, wam-48v or wam-80v for the wam, model for a file.
        catch_joint: Index of the catch joint among the active joints, from 0; the last if left out.
        q_catch: Its angle at the catch [rad]; chosen for the limit set, or pi/2, if left out.
        kappa: Velocity-match ratio; 1, the paper's, matches the ball's velocity.
        inward: How much of the ball's line leads into the palm; 0 is the paper's; chosen for the
            limit set if left out.
        order: Degree of the polynomial; 4 as in the paper if left out.
    """

    arm: Annotated[str, arg(metavar="NAME|FILE")] = "wam"
    tip: Annotated[str | None, arg(metavar="FRAME")] = None
    joints: Annotated[str | None, arg(metavar="A,B,C")] = None
    limits: LimitName | None = None
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
        json: Print one JSON object and nothing else to stdout.
        check: Validate the input and do nothing.
    """

    throws: Annotated[int | None, arg(metavar="N")] = None
    seed: Annotated[int, arg(metavar="S")] = 0
    generator: Annotated[str, arg(metavar="NAME")] = "direct"
    map: Map = None
    adapt: Literal["projection", "refine"] = "projection"
    vision: Literal["pixels", "points"] = "pixels"
    cameras: Literal["fixed", "active"] | None = None
    scene: Annotated[str | None, arg(metavar="NAME|TOML")] = None
    throws_file: Csv = None
    flights: Csv = None
    record: Literal["none", "failures", "all"] = "failures"
    out: Folder = None
    overwrite: bool = False
    json: bool = False
    check: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class LearnOptions(ArmOptions):
    """Learn a map; print the cost at each step (fig. 7) and write MAP.json.

    Attributes:
        out: File to write.
        flights_count: Number of flights in the neighbourhood to learn from.
        seed: Seed of that neighbourhood; the one that mitt catch uses if left out.
        overwrite: Replace an existing file.
        json: Print one JSON object and nothing else to stdout.
        check: Validate the input and do nothing.
    """

    out: Annotated[Path, arg(metavar="MAP.json")]
    flights_count: Annotated[int, arg(name="flights", metavar="N")] = 120
    seed: Annotated[int | None, arg(metavar="S")] = None
    overwrite: bool = False
    json: bool = False
    check: bool = False
