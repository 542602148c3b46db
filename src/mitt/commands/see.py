"""``mitt see``: two videos, folders or cameras to a track and a side-by-side video."""

from contextlib import nullcontext
from pathlib import Path

import mitt
from mitt.cameras.cameras import check_cameras, check_library
from mitt.cameras.video_writer import SUFFIXES, VideoWriter
from mitt.commands.camera_options import SeeOptions
from mitt.commands.screen import check_new_files, checked, print_json, progress, show, warn
from mitt.errors import InputError
from mitt.files.rig import CalibratedRig, read_rig
from mitt.interrupts import notice
from mitt.tracks.filtering import POINTS, STATE, write_table
from mitt.tracks.two_cameras import WATCHED, Seen, complaints, rate_of, see, status_of


def run(options: SeeOptions) -> int:
    """Run ``mitt see``; return its exit status."""
    rig, video = _checked_rig(options), _video(options)
    made = {"--out": options.out, "--points": options.points, "--video": video}
    check_new_files(options, made)
    for spec in (options.left, options.right):
        if ":" not in spec and not Path(spec).exists():
            raise InputError(spec, "a video, a folder of images or a camera", "nothing there")
    check_cameras((options.left, options.right))
    for module in () if video is None else ("cv2", "av"):
        check_library(module)
    if options.check:
        return checked(f"{options.left} and {options.right}, output to {options.out}")
    seen = Seen()
    try:
        with (
            progress() as report,
            nullcontext() if video is None else VideoWriter(video, rate=WATCHED) as writer,
        ):
            see(
                options.left, options.right, rig, seen, writer, ball=options.ball,
                radius=options.ball_radius, max_skew=options.max_skew, fps=options.fps,
                frames=options.frames, progress=report,
            )  # fmt: skip
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
        raise InputError("cameras", "a ball that both see", "; ".join(said) or "none")
    _show(options, rig, seen, said, video)
    return 0


def _checked_rig(options: SeeOptions) -> CalibratedRig:
    """Return the rig, checked with the other numbers of the options.

    Raises:
        InputError: The rig cannot be seen with, or a number is out of range.
    """
    rig = read_rig(options.rig)
    if len(rig.cameras) != 2:
        raise InputError(str(options.rig), "two cameras", len(rig.cameras))
    if rig.frame == "camera":
        raise InputError(str(options.rig), "poses in a frame with z up, for gravity",
                         "poses in the left camera's frame",
                         do="calibrate with --level or --hand")  # fmt: skip
    if options.left == options.right:
        raise InputError("LEFT and RIGHT", "two different cameras", f"{options.left} twice")
    if not 0.0 < options.ball_radius < 1.0:
        raise InputError("--ball-radius", "a length between 0 and 1 m", options.ball_radius)
    if not 0.0 <= options.max_skew <= 1.0:
        raise InputError("--max-skew", "seconds in 0..1", options.max_skew)
    if options.frames is not None and options.frames < 1:
        raise InputError("--frames", "1 or more", options.frames)
    return rig


def _video(options: SeeOptions) -> Path | None:
    """Return the video to write; None for none."""
    if options.no_video:
        return None
    video = options.video or options.out.with_suffix(".mkv")
    if video.suffix.lower() not in SUFFIXES:
        raise InputError("--video", f"a name that ends with {' or '.join(SUFFIXES)}", video.name)
    return video


def _show(
    options: SeeOptions, rig: CalibratedRig, seen: Seen, said: tuple[str, ...], video: Path | None
) -> None:
    """Print what was seen."""
    counts, status = seen.counts, status_of(seen)
    left, right = counts.frames
    if options.json:
        print_json({
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
            "rate_hz": rate_of(seen.points),
            "warnings": list(said),
        })  # fmt: skip
        return
    show(f"{left} and {right} frames, {counts.paired} pairs; the ball in "
         f"{seen.targets[0]} and {seen.targets[1]} of them, {seen.agreed} sightings, "
         f"{len(seen.states)} rows")  # fmt: skip
    warn(said)
    files = ", ".join(str(p) for p in (options.out, options.points, video) if p is not None)
    show(f"status {status}; written: {files}")
