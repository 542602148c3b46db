"""Options of the commands around cameras: track, see, calibrate."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from mitt.commands.options import ArmName, Check, Csv, Joints, Json, Tip

Images = Annotated[str | None, arg(metavar="IMAGES")]
Metres = Annotated[float, arg(metavar="M")]


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
        catches: Recording of catches, or a folder of them, instead of --arm-log and --points: the
            ball that rides on the braking hand tells the clock.
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
    catches: Annotated[Path | None, arg(metavar="MCAP|FOLDER")] = None
    search: Annotated[float, arg(metavar="S")] = 1.0
    picture: Annotated[Path | None, arg(metavar="PNG")] = None
    overwrite: bool = False
    json: Json = False
    check: Check = False
