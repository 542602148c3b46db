"""``mitt calibrate``: the stages that the given files allow, one after the other."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeVar

from mitt.calibration.boards import calibrate_boards
from mitt.calibration.hand import calibrate_clock, calibrate_hand, centroid_columns, centroids_in
from mitt.calibration.heads import FACE_UP, calibrate_head, read_head_views, with_heads
from mitt.calibration.stage import Stage
from mitt.calibration.tables import header_of, read_places
from mitt.calibration.views import BoardViews, look_for_board
from mitt.commands.options import CalibrateOptions
from mitt.errors import FileError, InputError
from mitt.link.cameras.opening import open_cameras
from mitt.link.charuco import Board, BoardSpec
from mitt.link.rig import CalibratedRig, read_rig
from mitt.robot.arm import Arm
from mitt.robot.load import load_arm
from mitt.vision.calibration.boards import BoardProblem
from mitt.vision.calibration.fit import Fit
from mitt.vision.poses import inverse

NAMES = ("left", "right")

Progress = Callable[[str, int, int], None]
T = TypeVar("T")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Calibration:
    """What a calibration found.

    Attributes:
        rig: The rig.
        stages: What each stage found.
        views: What the cameras saw of the boards; None without boards.
        boards: The solution of the boards; None without them.
    """

    rig: CalibratedRig
    stages: tuple[Stage, ...]
    views: BoardViews | None = None
    boards: Fit[BoardProblem] | None = None

    @property
    def warnings(self) -> tuple[str, ...]:
        """All warnings of all stages."""
        return tuple(text for stage in self.stages for text in stage.warnings)


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """A calibration whose options have been looked at.

    Attributes:
        options: What the user wants.
        board: The board; None where no stage needs one.
        arm: The arm; None where no stage needs one.
        rig: The rig to begin with; None where boards give it.
        stages: Names of the stages to come.
    """

    options: CalibrateOptions
    board: Board | None
    arm: Arm | None
    rig: CalibratedRig | None
    stages: tuple[str, ...] = field(default=())


def prepare(options: CalibrateOptions) -> Job:
    """Check what can be checked without the work, and return the job.

    Raises:
        InputError: The options do not go together; also its child FileError.
    """
    o = options
    heads = [path for path in (o.left_head, o.right_head) if path is not None]
    stages = [name for name, given in (("boards", o.left), ("heads", heads), ("hand", o.hand),
              ("clock", o.arm_log)) if given]  # fmt: skip
    if o.right is not None and o.left is None:
        raise InputError("--right", "--left as well (one camera alone is --left)", "--right alone")
    if not stages:
        raise InputError("mitt calibrate", "--left and --right, --left-head, --hand or --arm-log",
                         "none of them", do="see docs/rig.md")  # fmt: skip
    if (o.rig is None) == (o.left is None):
        raise InputError("mitt calibrate", "either --left (boards) or --rig (a rig to begin with)",
                         "both" if o.rig else "neither")  # fmt: skip
    if (o.arm_log is None) != (o.points is None):
        raise InputError("--arm-log and --points", "both or neither", "one of them")
    if o.level is not None and o.left is None:
        raise InputError("--level", "boards (--left) in the same run", "none")
    if not 0.0 < o.ball_radius < 1.0:
        raise InputError("--ball-radius", "a length between 0 and 1 m", o.ball_radius)
    for path in (*heads, *(p for p in (o.hand, o.arm_log, o.points) if p)):
        if not path.is_file():
            raise FileError(str(path), "a CSV file", "no such file")
    for spec in (o.left, o.right, o.hand_left, o.hand_right):
        if spec is not None and ":" not in spec and not Path(spec).exists():
            raise FileError(spec, "a folder of images or a video", "nothing there")
    names = None if o.joints is None else [x.strip() for x in o.joints.split(",")]
    needs_board = bool(o.left or heads)
    return Job(
        options=o,
        board=Board(_spec(o)) if needs_board else None,
        arm=load_arm(o.arm, tip=o.tip, joints=names) if o.hand or o.arm_log else None,
        rig=None if o.rig is None else read_rig(o.rig),
        stages=tuple(stages),
    )


def _spec(options: CalibrateOptions) -> BoardSpec:
    """Return the board that the options describe."""
    columns, cross, rows = options.board.lower().partition("x")
    if not (cross and columns.isdecimal() and rows.isdecimal()):
        raise InputError("--board", "squares across and down as 9x6", options.board)
    return BoardSpec(
        columns=int(columns), rows=int(rows), square=options.square, marker=options.marker,
        dictionary=options.dictionary,
    )  # fmt: skip


def calibrate(job: Job, *, progress: Progress) -> Calibration:
    """Run the stages of a job."""
    done = _with_boards(job, progress)
    done = _with_heads(job, done)
    done = _with_hand(job, done)
    o = job.options
    if o.arm_log is None or o.points is None or job.arm is None:
        return done
    rig, stage = calibrate_clock(done.rig, job.arm, log=o.arm_log, points=o.points, search=o.search)
    return replace(done, rig=rig, stages=(*done.stages, stage))


def _with_boards(job: Job, progress: Progress) -> Calibration:
    """Return lenses and stereo pose from boards, or the rig to begin with."""
    o = job.options
    if job.rig is not None:
        return Calibration(rig=job.rig, stages=())
    given = [spec for spec in (o.left, o.right) if spec is not None]
    names = NAMES[: len(given)]
    board = _needed(job.board)
    with open_cameras(given, fps=1.0) as sources:
        views = look_for_board(board, sources, names, progress=progress)
    rig, solved, stage = calibrate_boards(board, views, coefficients=o.coefficients)
    if o.level is not None:
        if o.level not in views.numbers:
            raise InputError("--level", f"an image that was used: {views.numbers}", o.level)
        T_rig_board = solved.problem.T_rig_board[views.numbers.index(o.level)]
        rig = rig.seen_from(FACE_UP @ inverse(T_rig_board), "board")
    return Calibration(rig=rig, stages=(stage,), views=views, boards=solved)


def _with_heads(job: Job, done: Calibration) -> Calibration:
    """Return the calibration with the axes of the heads, where their views are given."""
    o = job.options
    tables = {name: path for name, path in zip(NAMES, (o.left_head, o.right_head), strict=True)
              if path is not None}  # fmt: skip
    if not tables:
        return done
    missing = [c.name for c in done.rig.cameras if c.name not in tables]
    if missing:
        raise InputError("heads", "views of every camera of the rig, of one board in one place",
                         f"none of {', '.join(missing)}")  # fmt: skip
    board, cameras, stages = _needed(job.board), [], []
    for camera in done.rig.cameras:
        size = (camera.lens.width, camera.lens.height)
        angles, seen = read_head_views(tables[camera.name], board, size)
        moved, _, stage = calibrate_head(camera, board, angles, seen)
        cameras.append(moved)
        stages.append(stage)
    rig = with_heads(done.rig, tuple(cameras))
    return replace(done, rig=rig, stages=(*done.stages, *stages))


def _with_hand(job: Job, done: Calibration) -> Calibration:
    """Return the calibration in the robot's frame, where places of the hand are given."""
    o = job.options
    if o.hand is None:
        return done
    if len(done.rig.cameras) < 2:
        raise InputError("--hand", "a rig of two cameras", "one of a single camera")
    columns = centroid_columns(done.rig)
    specs = [spec for spec in (o.hand_left, o.hand_right) if spec is not None]
    if columns[0] in header_of(o.hand):
        places, centroids = read_places(o.hand, _needed(job.arm), columns)
    elif len(specs) == len(done.rig.cameras):
        places, _ = read_places(o.hand, _needed(job.arm), ())
        with open_cameras(specs, fps=1.0) as sources:
            centroids = centroids_in(sources, len(places))
    else:
        raise FileError(f"{o.hand} line 1", f"columns {','.join(columns)}", "none of them",
                        do="add them or say --hand-left and --hand-right")  # fmt: skip
    rig, _, stage = calibrate_hand(done.rig, places, centroids, radius=o.ball_radius)
    return replace(done, rig=rig, stages=(*done.stages, stage))


def _needed(value: T | None) -> T:
    """Return what ``prepare`` has provided."""
    if value is None:
        raise InputError("calibration", "a prepared job", "one without a board or an arm")
    return value
