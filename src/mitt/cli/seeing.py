"""``mitt track``, ``mitt see``, ``mitt calibrate``: positions, two cameras, and their rig."""

from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from math import isfinite
from pathlib import Path

from rich.table import Table

import mitt
from mitt.cli.options import CalibrateOptions, SeeOptions, TrackOptions
from mitt.cli.screen import (
    check_new_files,
    checked,
    file_beside,
    print_json,
    progress,
    show,
    warn,
)
from mitt.clock import Progress
from mitt.core.arm.arm import Arm
from mitt.core.ball.filter import MAX_HORIZON
from mitt.core.errors import FileError, InputError
from mitt.core.eyes.camera import inverse
from mitt.core.signals import Array
from mitt.interrupts import notice
from mitt.io.arm_file import load_arm
from mitt.io.csv_table import header_of
from mitt.io.rig import CalibratedRig, read_rig, write_rig
from mitt.lab.world.fall import WANTED, doubt_of
from mitt.numerals import whole_of
from mitt.robot.cameras.ball_colour import colour_of, read_colour
from mitt.robot.cameras.board_calibration import (
    CELLS,
    BoardProblem,
    BoardViews,
    calibrate_boards,
    look_for_board,
)
from mitt.robot.cameras.cameras import (
    check_cameras,
    check_library,
    open_cameras,
    picture_of,
    skew_of_times,
)
from mitt.robot.cameras.charuco import Board, BoardSpec
from mitt.robot.cameras.filtering import (
    POINTS,
    STATE,
    follow_all,
    read_positions,
    write_table,
    write_track,
)
from mitt.robot.cameras.hand_calibration import (
    calibrate_by_catches,
    calibrate_clock,
    calibrate_hand,
    centroid_columns,
    centroids_in,
    read_places,
)
from mitt.robot.cameras.head_calibration import FACE_UP, calibrate_head, read_head_views
from mitt.robot.cameras.least_squares import CalibrationStage, Fit
from mitt.robot.cameras.two_cameras import (
    WATCHED,
    SeenSoFar,
    complaints,
    seen_status,
    sighting_rate,
)
from mitt.robot.cameras.two_cameras import see_ball as follow
from mitt.robot.cameras.video_writer import SUFFIXES, VideoWriter

#: Largest standard deviation of a coordinate that makes sense [m].
_MAX_SIGMA = 1.0


def track_command(options: TrackOptions) -> int:
    """Run ``mitt track``; return its exit status."""
    ahead, sigma = options.ahead, options.sigma
    if ahead is not None and not 0.0 <= ahead <= MAX_HORIZON:
        raise InputError("--ahead", f"a time from 0 to {MAX_HORIZON:g} s", ahead)
    if sigma is not None and not 0.0 < sigma <= _MAX_SIGMA:
        raise InputError("--sigma", f"a length above 0, up to {_MAX_SIGMA:g} m", sigma)
    check_new_files(options, {"--out": options.out})
    positions = read_positions(options.points)
    rows, flights = len(positions.samples), len(positions.rows)
    doubt = doubt_of([(x[:, 0], x[:, 1:]) for x in map(positions.flight, positions.rows)])
    warnings = [] if doubt is None else [f"wanted {WANTED}, got {doubt.given}; {doubt.do}"]
    warn(warnings, json=options.json)
    if options.check:
        return checked(f"{rows} rows, {flights} flights, output to {options.out}")
    track = follow_all(positions.samples, positions.rows.values(), ahead=ahead or 0.0, sigma=sigma)
    write_track(options.out, positions, track, ahead=ahead is not None)
    if options.json:
        print_json(
            {
                "schema": "mitt.track/1",
                "version": mitt.__version__,
                "rows": rows,
                "flights": flights,
                "ahead_s": ahead,
                "sigma_m": sigma,
                "unused": track.unused,
                "warnings": warnings,
                "out": str(options.out),
            }
        )
    else:
        unused = ", ".join(f"{count} {why}" for why, count in track.unused.items())
        left = f", not used: {unused}" if unused else ""
        show(f"{rows} rows, {flights} flights{left}; written: {options.out}")
    return 0


def see_command(options: SeeOptions) -> int:
    """Run ``mitt see``; return its exit status."""
    rig, video = _checked_rig(options), _video(options)
    made = {"--out": options.out, "--points": options.points, "--video": video}
    check_new_files(options, made)
    for spec in (options.left, options.right):
        if ":" not in spec and not Path(spec).exists():
            raise InputError(spec, "a video, a folder of images or a camera", "nothing there")
    check_cameras((options.left, options.right))
    background, colour = _background(options), _colour(options)
    for module in () if video is None else ("cv2", "av"):
        check_library(module)
    if options.check:
        return checked(f"{options.left} and {options.right}, output to {options.out}")
    seen = SeenSoFar()
    try:
        with (
            progress() as report,
            nullcontext() if video is None else VideoWriter(video, rate=WATCHED) as writer,
        ):
            follow(
                options.left,
                options.right,
                rig,
                seen,
                writer,
                ball=options.ball,
                radius=options.ball_radius,
                max_skew=options.max_skew,
                fps=options.fps,
                frames=options.frames,
                background=background,
                colour=colour,
                progress=report,
            )
    except KeyboardInterrupt:
        notice()
        raise
    finally:
        if seen.points:  # what is finished is kept, also of an interrupted run
            write_table(options.out, STATE, seen.states)
            if options.points is not None:
                write_table(options.points, POINTS, seen.points)
    said = complaints(seen, tuple(c.name for c in rig.cameras))
    if not seen.points:
        raise InputError(
            "cameras", "a ball that both see", said[0] if said else "none", do="; ".join(said[1:])
        )
    _show_seen(options, rig, seen, said, video)
    return 0


def _checked_rig(options: SeeOptions) -> CalibratedRig:
    """Return the rig, checked with the other numbers of the options."""
    rig = read_rig(options.rig)
    if len(rig.cameras) != 2:
        raise InputError(str(options.rig), "two cameras", len(rig.cameras))
    if rig.frame == "camera":
        raise InputError(
            str(options.rig),
            "poses in a frame with z up, for gravity",
            "poses in the left camera's frame",
            do="calibrate with --level or --hand",
        )
    if options.left == options.right:
        raise InputError("LEFT and RIGHT", "two different cameras", f"{options.left} twice")
    if not 0.0 < options.ball_radius < 1.0:
        raise InputError("--ball-radius", "a length between 0 and 1 m", options.ball_radius)
    return rig


def _background(options: SeeOptions) -> tuple[str, str] | None:
    """Return what shows each camera's background; None where that is not said."""
    left, right = options.left_background, options.right_background
    if left is None and right is None:
        return None
    if left is None or right is None:
        missing = "--left-background" if left is None else "--right-background"
        raise InputError(missing, "the background of both cameras, or of none", "one alone")
    for name, spec in (("--left-background", left), ("--right-background", right)):
        if not Path(spec).exists():
            raise FileError(
                spec, f"{name}: an image, a video or a folder of images", "no such file"
            )
    check_cameras((left, right))
    return left, right


def _colour(options: SeeOptions) -> Array | None:
    """Return red, green and blue of the ball; None where they are not said."""
    text = options.ball_colour
    if text is None:
        return None
    colour = read_colour(text)
    if colour is None and not Path(text).is_file():
        wanted = "six digits as ff8000, or a picture of the ball"
        raise InputError("--ball-colour", wanted, text[:60])
    return colour_of(picture_of(Path(text))) if colour is None else colour


def _video(options: SeeOptions) -> Path | None:
    """Return the video to write; None for none."""
    if options.no_video:
        return None
    video = options.video or file_beside(options.out, ".mkv")
    if video.suffix.lower() not in SUFFIXES:
        raise InputError("--video", f"a name that ends with {' or '.join(SUFFIXES)}", video.name)
    return video


def _show_seen(
    options: SeeOptions,
    rig: CalibratedRig,
    seen: SeenSoFar,
    said: tuple[str, ...],
    video: Path | None,
) -> None:
    """Print what was seen."""
    counts, status = seen.counts, seen_status(seen)
    left, right = counts.frames
    if options.json:
        print_json(
            {
                "schema": "mitt.see/1",
                "version": mitt.__version__,
                "status": status,
                "track": str(options.out),
                "points": None if options.points is None else str(options.points),
                "video": None if video is None else str(video),
                "frame": rig.frame,
                "frames": {"left": left, "right": right, "paired": counts.paired},
                "targets": {"left": seen.targets[0], "right": seen.targets[1], "both": seen.both},
                "sightings": seen.agreed,
                "rows": len(seen.states),
                "rate_hz": sighting_rate(seen.points),
                "offset_s": None if seen.synchrony is None else seen.synchrony.mean,
                "offset_sigma_s": None if seen.synchrony is None else seen.synchrony.mean_sigma,
                "warnings": list(said),
            }
        )
        return
    show(
        f"{left} and {right} frames, {counts.paired} pairs; the ball in "
        f"{seen.targets[0]} and {seen.targets[1]} of them, {seen.agreed} sightings, "
        f"{len(seen.states)} rows"
    )
    warn(said)
    files = ", ".join(str(p) for p in (options.out, options.points, video) if p is not None)
    show(f"status {status}; written: {files}")


NAMES = ("left", "right")


@dataclass(slots=True, kw_only=True, eq=False)
class CalibrationRun:
    """A calibration under way.

    Attributes:
        options: What the user wants.
        names: Stages to come.
        board: The board; None where no stage needs one.
        arm: The arm; None where no stage needs one.
        rig: The rig to begin with; None where boards give it.
        stages: What each stage found.
        boards: What the cameras saw of the boards, and the solution; None without boards.
    """

    options: CalibrateOptions
    names: tuple[str, ...]
    board: Board | None
    arm: Arm | None
    rig: CalibratedRig | None
    stages: list[CalibrationStage] = field(default_factory=list)
    boards: tuple[BoardViews, Fit[BoardProblem]] | None = None


def calibrate_command(options: CalibrateOptions) -> int:
    """Run ``mitt calibrate``; return its exit status."""
    job = _prepare(options)
    picture = (options.picture or file_beside(options.out, ".png")) if options.left else None
    if picture is not None and picture.suffix.lower() != ".png":
        raise InputError("--picture", "a name that ends with .png", picture.name)
    check_new_files(options, {"--out": options.out, "--picture": picture})
    if options.check:
        return checked(f"{', '.join(job.names)}, output to {options.out}")
    with progress() as report:
        rig = _calibrate(job, report)
    write_rig(options.out, rig, version=mitt.__version__)
    if picture is not None and job.boards is not None:
        _draw_coverage(picture, *job.boards)
    warnings = [text for stage in job.stages for text in stage.warnings]
    if options.json:
        print_json(
            {
                "schema": "mitt.calibrate/1",
                "version": mitt.__version__,
                "rig": str(options.out),
                "picture": None if picture is None else str(picture),
                "frame": rig.frame,
                "cameras": [c.name for c in rig.cameras],
                "stages": {s.name: {"status": s.status, **_finite(s.numbers)} for s in job.stages},
                "warnings": warnings,
            }
        )
    else:
        for stage in job.stages:
            _show_stage(stage)
        warn(warnings)
        files = ", ".join(str(path) for path in (options.out, picture) if path is not None)
        show(f"poses in the frame of the {rig.frame}; written: {files}")
    return 0


def _finite(numbers: Mapping[str, float]) -> dict[str, float | None]:
    """Return numbers as JSON has them: none for what is not determined."""
    return {name: value if isfinite(value) else None for name, value in numbers.items()}


def _show_stage(stage: CalibrationStage) -> None:
    """Print what a stage found."""
    table = Table(title=f"{stage.name}: {stage.status}", title_justify="left", show_header=False)
    table.add_column(no_wrap=True)
    table.add_column(justify="right", no_wrap=True)
    for name, value in stage.numbers.items():
        table.add_row(name.replace("_", " "), f"{value:.5g}")
    show(table)


def _draw_coverage(picture: Path, views: BoardViews, solved: Fit[BoardProblem]) -> None:
    """Draw the coverage of the boards."""
    from mitt.lab.report.pictures import draw_coverage  # noqa: PLC0415 (plots: only when drawn)

    corners = solved.problem.corners
    r = solved.problem.residuals().reshape(-1, 2)
    seen = {
        name: (size, corners.uv[corners.camera == k], r[corners.camera == k])
        for k, (name, size) in enumerate(zip(views.names, views.sizes, strict=True))
    }
    draw_coverage(picture, seen, CELLS)


def _prepare(options: CalibrateOptions) -> CalibrationRun:
    """Check what can be checked without the work, and return the calibration to be made."""
    o = options
    heads = [path for path in (o.left_head, o.right_head) if path is not None]
    stages = [
        name
        for name, given in (
            ("boards", o.left),
            ("heads", heads),
            ("hand", o.hand),
            ("clock", o.arm_log or o.catches),
        )
        if given
    ]
    if o.right is not None and o.left is None:
        raise InputError("--right", "--left as well (one camera alone is --left)", "--right alone")
    if not stages:
        wanted = "--left and --right, --left-head, --hand, --arm-log or --catches"
        raise InputError("mitt calibrate", wanted, "none of them", do="see docs/rig.md")
    if (o.rig is None) == (o.left is None):
        raise InputError(
            "mitt calibrate",
            "either --left (boards) or --rig (a rig to begin with)",
            "both" if o.rig else "neither",
        )
    if (o.arm_log is None) != (o.points is None):
        raise InputError("--arm-log and --points", "both or neither", "one of them")
    if o.arm_log is not None and o.catches:
        raise InputError("--arm-log and --catches", "one of them", "both")
    if o.level is not None and o.left is None:
        raise InputError("--level", "boards (--left) in the same run", "none")
    if not 0.0 < o.ball_radius < 1.0:
        raise InputError("--ball-radius", "a length between 0 and 1 m", o.ball_radius)
    for path in (*heads, *(p for p in (o.hand, o.arm_log, o.points) if p)):
        if not path.is_file():
            raise FileError(str(path), "a CSV file", "no such file")
    if o.catches is not None and not _recordings(o.catches):
        raise FileError(str(o.catches), "a recording, or a folder of them", "nothing there")
    for spec in (o.left, o.right, o.hand_left, o.hand_right):
        if spec is not None and ":" not in spec and not Path(spec).exists():
            raise FileError(spec, "a folder of images or a video", "nothing there")
    check_cameras([x for x in (o.left, o.right, o.hand_left, o.hand_right) if x is not None])
    joints = None if o.joints is None else [x.strip() for x in o.joints.split(",")]
    return CalibrationRun(
        options=o,
        names=tuple(stages),
        board=Board(_spec(o)) if o.left or heads else None,
        arm=load_arm(o.arm, tip=o.tip, joints=joints) if o.hand or o.arm_log else None,
        rig=None if o.rig is None else read_rig(o.rig),
    )


def _recordings(path: Path) -> list[Path]:
    """Return the recordings that a path names, or a folder holds."""
    return sorted(path.glob("*.mcap")) if path.is_dir() else [path] * path.is_file()


def _spec(options: CalibrateOptions) -> BoardSpec:
    """Return the board that the options describe."""
    columns, cross, rows = options.board.lower().partition("x")
    across, down = whole_of(columns), whole_of(rows)
    if not cross or across is None or down is None:
        raise InputError("--board", "squares across and down as 9x6", repr(options.board))
    return BoardSpec(
        columns=across,
        rows=down,
        square=options.square,
        marker=options.marker,
        dictionary=options.dictionary,
    )


def _calibrate(job: CalibrationRun, report: Progress) -> CalibratedRig:
    """Run the stages, and return the rig."""
    o, board, arm = job.options, job.board, job.arm
    rig = job.rig
    if rig is None:
        assert board is not None
        rig = _from_boards(job, board, report)
    if board is not None and (o.left_head or o.right_head):
        rig = _with_heads(job, rig, board)
    if arm is not None and o.hand is not None:
        rig = _with_hand(job, rig, arm, o.hand)
    if arm is not None and o.arm_log is not None and o.points is not None:
        rig, stage = calibrate_clock(rig, arm, log=o.arm_log, points=o.points, search=o.search)
        job.stages.append(stage)
    if o.catches is not None:
        rig, stage = calibrate_by_catches(rig, _recordings(o.catches))
        job.stages.append(stage)
    return rig


def _from_boards(job: CalibrationRun, board: Board, report: Progress) -> CalibratedRig:
    """Return lenses and stereo pose from boards."""
    o = job.options
    given = [spec for spec in (o.left, o.right) if spec is not None]
    skew = skew_of_times(given)
    with open_cameras(given, fps=1.0 if skew is None else None) as sources:
        names = NAMES[: len(given)]
        views = look_for_board(board, sources, names, progress=report, max_skew=skew)
    rig, solved, stage = calibrate_boards(board, views, coefficients=o.coefficients)
    if o.level is not None:
        if o.level not in views.numbers:
            raise InputError("--level", f"an image that was used: {views.numbers}", o.level)
        T_rig_board = solved.problem.T_rig_board[views.numbers.index(o.level)]
        rig = rig.seen_from(FACE_UP @ inverse(T_rig_board), "board")
    job.stages.append(stage)
    job.boards = views, solved
    return rig


def _with_heads(job: CalibrationRun, rig: CalibratedRig, board: Board) -> CalibratedRig:
    """Return the rig with the axes of its heads, all in the frame of the board."""
    given = zip(NAMES, (job.options.left_head, job.options.right_head), strict=True)
    tables = {name: path for name, path in given if path is not None}
    missing = [c.name for c in rig.cameras if c.name not in tables]
    if missing:
        raise InputError(
            "heads",
            "views of every camera of the rig, of one board in one place",
            f"none of {', '.join(missing)}",
        )
    cameras = []
    for camera in rig.cameras:
        size = (camera.lens.width, camera.lens.height)
        angles, seen, without = read_head_views(tables[camera.name], board, size)
        moved, _, stage = calibrate_head(camera, board, angles, seen)
        stage = replace(stage, numbers={**stage.numbers, "without_board": without})
        cameras.append(moved)
        job.stages.append(stage)
    return replace(rig, frame="board", cameras=tuple(cameras))


def _with_hand(job: CalibrationRun, rig: CalibratedRig, arm: Arm, hand: Path) -> CalibratedRig:
    """Return the rig in the robot's frame, from places of the hand."""
    o = job.options
    if len(rig.cameras) < 2:
        raise InputError("--hand", "a rig of two cameras", "one of a single camera")
    columns = centroid_columns(rig)
    specs = [spec for spec in (o.hand_left, o.hand_right) if spec is not None]
    if columns[0] in header_of(hand):
        places, centroids = read_places(hand, arm, columns)
    elif len(specs) == len(rig.cameras):
        places, _ = read_places(hand, arm, ())
        with open_cameras(specs, fps=1.0) as sources:
            centroids = centroids_in(sources, len(places))
    else:
        raise FileError(
            f"{hand} line 1",
            f"columns {','.join(columns)}",
            "none of them",
            do="add them or say --hand-left and --hand-right",
        )
    rig, _, stage = calibrate_hand(rig, places, centroids, radius=o.ball_radius)
    job.stages.append(stage)
    return rig
