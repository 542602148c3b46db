"""A valid file for every reader of the command line, and the command that reads it."""

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from small_study import TEXT, Here, quiet, ready, write_study
from throws_on_film import calibrated, film, write_film

from mitt.core.catcher.generators import Direct
from mitt.io.recordings import write_recording
from mitt.io.rig import write_rig
from mitt.lab.trials.log import recording_of
from mitt.lab.trials.runner import TrialRunner
from mitt.lab.trials.source import source_of
from mitt.lab.trials.study_run import run_study
from mitt.lab.world.scene import named_scene
from soak.packing import packed, unpacked
from soak.samples import CATCHING, Sample, no_learning

#: Frames of the film; rounds of which one reads what takes long.
_FRAMES = 12
_RARELY = 10
#: Ticks of the recording.
_TICKS = 50


def _written(folder: Path, *words: str | Path, name: str = "out.csv") -> tuple[str, ...]:
    """Return a command that does its work and writes a file."""
    return (*map(str, words), "--out", str(folder / name), "--overwrite", "--json")


def _placed(folder: Path) -> Path:
    """Return the file of a rig in the robot's frame."""
    path = folder / "placed.toml"
    write_rig(path, calibrated(), version="0")
    return path


def _csv(head: str, rows: np.ndarray) -> bytes:
    """Return a table as a file."""
    return "\n".join([head, *(",".join(f"{x:.5f}" for x in row) for row in rows)]).encode()


def _rig(folder: Path) -> Sample:
    """Return a rig, and two things to see with it."""
    path = folder / "rig.toml"
    for name in ("a.mkv", "b.mkv"):
        (folder / name).write_bytes(b"")
    words = (
        "see",
        str(folder / "a.mkv"),
        str(folder / "b.mkv"),
        "--rig",
        str(path),
        "--check",
        "--out",
        str(folder / "see.csv"),
    )
    return Sample(name="rig", path=path, valid=_placed(folder).read_bytes(), command=words)


def _points(folder: Path) -> Sample:
    """Return positions to filter."""
    t = 0.002 * np.arange(40)
    r = np.column_stack((t, 3.0 - 5.0 * t, 0.1 * t, 0.3 + 3.0 * t - 4.905 * t * t))
    path = folder / "points.csv"
    words = _written(folder, "track", path, "--ahead", "0.1")
    return Sample(name="points", path=path, valid=_csv("t_s,x_m,y_m,z_m", r), command=words)


def _video(folder: Path) -> Sample:
    """Return a video, the left one of two."""
    place = folder / "film"
    place.mkdir()
    left, right = write_film(place, film(_FRAMES))
    words = _written(folder, "see", left, right, "--rig", _placed(folder), "--no-video")
    return Sample(name="video", path=left, valid=left.read_bytes(), command=words)


def _image(folder: Path) -> Sample:
    """Return an image, the eighth of the left folder of two."""
    taken = film(_FRAMES)
    for name, images in (("left", taken.left), ("right", taken.right)):
        (folder / name).mkdir()
        for k, pixels in enumerate(images):
            cv2.imwrite(str(folder / name / f"{k}.png"), pixels)
    path = folder / "left" / "7.png"
    words = _written(
        folder,
        "see",
        folder / "left",
        folder / "right",
        "--fps",
        "1000",
        "--rig",
        _placed(folder),
        "--no-video",
    )
    return Sample(name="image", path=path, valid=path.read_bytes(), command=words)


def _hand(folder: Path) -> Sample:
    """Return places of a ball in the hand and its centroids."""
    rng, rig = np.random.default_rng(3), calibrated().rig()
    places = np.array((0.7, 0.0, 0.3)) + rng.uniform(-0.15, 0.15, (12, 3))
    columns = [places]
    for c in rig.cameras:
        p = (places - c.centre) @ c.rotation
        columns.append(c.f_px * p[:, :2] / p[:, 2:] + (c.cu, c.cv))
    head = "x_m,y_m,z_m,u_left_px,v_left_px,u_right_px,v_right_px"
    path = folder / "hand.csv"
    words = _written(
        folder, "calibrate", "--rig", _placed(folder), "--hand", path, name="hand.toml"
    )
    return Sample(name="hand", path=path, valid=_csv(head, np.hstack(columns)), command=words)


def _heads(folder: Path) -> Sample:
    """Return angles of a head; its images show no board, so that none is good."""
    names = ("0.png", "1.png")
    for name in names:
        cv2.imwrite(str(folder / name), np.zeros((128, 128), dtype=np.uint8))
    rows = [f"{name},{0.1 * k:.3f},{0.05 * k:.3f}" for k, name in enumerate(names)]
    path, right = folder / "left_head.csv", folder / "right_head.csv"
    valid = "\n".join(("image,pan_rad,tilt_rad", *rows)).encode()
    right.write_bytes(valid)
    words = _written(
        folder,
        "calibrate",
        "--rig",
        _placed(folder),
        "--left-head",
        path,
        "--right-head",
        right,
        name="heads.toml",
    )
    return Sample(name="heads", path=path, valid=valid, command=words)


def _moving(folder: Path) -> tuple[Path, Path, tuple[str, ...]]:
    """Return the log of a moving hand, what was seen of it, and the command that reads both."""
    t = np.arange(0.0, 1.5, 0.01)
    r = np.column_stack((t, 0.7 + 0.1 * np.sin(9 * t), 0.2 * np.sin(7 * t), 0.3 + 0.0 * t))
    log, points = folder / "arm_log.csv", folder / "seen.csv"
    log.write_bytes(_csv("t_s,x_m,y_m,z_m", r))
    points.write_bytes(_csv("t_s,x_m,y_m,z_m", r[40:100] - (0.02, 0.0, 0.0, 0.0)))
    words = _written(
        folder,
        "calibrate",
        "--rig",
        _placed(folder),
        "--arm-log",
        log,
        "--points",
        points,
        "--search",
        "0.2",
        name="clock.toml",
    )
    return log, points, words


def _arm_log(folder: Path) -> Sample:
    """Return the log of a moving hand."""
    place = folder / "log"
    place.mkdir()
    log, _, words = _moving(place)
    return Sample(name="arm-log", path=log, valid=log.read_bytes(), command=words)


def _seen(folder: Path) -> Sample:
    """Return what the cameras saw of a moving hand."""
    place = folder / "seen"
    place.mkdir()
    _, seen, words = _moving(place)
    return Sample(name="seen", path=seen, valid=seen.read_bytes(), command=words)


def _study(folder: Path) -> Sample:
    """Return a study file."""
    path = folder / "study.toml"
    words = ("study", str(path), "--check", "--out", str(folder / "no-study"))
    return Sample(name="study", path=path, valid=TEXT.encode(), command=words)


def _of_study(name: str) -> Callable[[Path], Sample]:
    """Return what makes a sample of a file in the folder of a finished study."""

    def sample(folder: Path) -> Sample:
        made, place = folder / "study", folder / f"study-{name}"
        if not made.exists():
            made.mkdir()
            study = write_study(made, TEXT)
            run_study(study, ready(made / "run", study, no_learning()), Here(), progress=quiet)
        shutil.copytree(made / "run", place)
        words = ("report", str(place), "--replays", "0")
        path = place / name
        return Sample(name=name, path=path, valid=path.read_bytes(), command=words, each=_RARELY)

    return sample


def _recording(folder: Path) -> Sample:
    """Return the first ticks of a recorded throw, unpacked: mutants get behind its checksums."""
    learned, path = no_learning(), folder / "throw.mcap"
    arm = learned.map.arm
    runner = TrialRunner(arm, Direct(learned.map), named_scene("lab"), pixels=False)
    thrown = runner.throw(source_of(arm, seed=5, drag=0.04), 0, log=True)
    assert thrown.log is not None
    whole = recording_of(thrown.log, thrown.trial, runner.about("direct", learned.map), {})
    points = {k: x for k, x in whole.points.items() if k < _TICKS}
    tracks = tuple(replace(x, t=x.t[:_TICKS], r=x.r[:_TICKS]) for x in whole.tracks)
    write_recording(path, replace(whole, ticks=whole.ticks[:_TICKS], points=points, tracks=tracks))
    valid = unpacked(path.read_bytes())
    return Sample(
        name="recording",
        path=path,
        valid=valid,
        mend=packed,
        command=("replay", str(path), "--check"),
    )


#: One for every reader.
SAMPLES: tuple[Callable[[Path], Sample], ...] = (
    *CATCHING,
    _rig,
    _points,
    _video,
    _image,
    _hand,
    _heads,
    _arm_log,
    _seen,
    _study,
    _of_study("study.json"),
    _of_study("trials.parquet"),
    _recording,
)
