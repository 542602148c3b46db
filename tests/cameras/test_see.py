"""``mitt see``: the track of a throw that was filmed, and what can go wrong with two cameras."""

import json
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import pytest
from throws_on_film import RATE, Film, calibrated, film, lens_of, write_film

from mitt.cli.main import main
from mitt.core.eyes.camera import Camera, Rig, fixed_rig, inverse
from mitt.core.eyes.lens import Lens
from mitt.core.signals import GRAVITY, Array, Image
from mitt.io.rig import CalibratedRig, write_rig
from mitt.robot.cameras import two_cameras
from mitt.robot.cameras.cameras import ImageSource
from mitt.robot.cameras.other_rigs import fall_error
from mitt.robot.cameras.video_writer import VideoWriter

See = Callable[..., tuple[int, dict[str, Any], str]]
FRAMES = 220


@pytest.fixture(scope="module")
def taken() -> Film:
    """A throw on film."""
    return film(FRAMES)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, taken: Film) -> Path:
    """A folder with the film and its rig."""
    path = tmp_path_factory.mktemp("film")
    write_film(path, taken)
    write_rig(path / "RIG.toml", calibrated(), version="test")
    return path


@pytest.fixture
def see(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> See:
    """Run mitt see --json without a video; return status, result and stderr."""

    def run(left: str | Path, right: str | Path, *more: str | Path) -> tuple[int, Any, str]:
        words = ["see", left, right, "--json"]
        if "--rig" not in more:
            words += ["--rig", folder / "RIG.toml"]
        words += ["--out", tmp_path / "T.csv", "--overwrite", *more]
        if "--video" not in more:
            words.append("--no-video")
        status = main([str(word) for word in words])
        out, err = capsys.readouterr()
        return status, json.loads(out) if out else {}, err

    return run


def table(path: Path) -> Array:
    """Return the rows of a table."""
    return np.atleast_2d(np.loadtxt(path, delimiter=",", skiprows=1))


def check_track(path: Path, taken: Film) -> None:
    """Hold a track to the truth from 0.1 s on: 3 mm, 0.1 m/s, and within 6 of its sigmas."""
    rows = table(path)
    rows = rows[rows[:, 0] > 0.1]
    k = np.rint(rows[:, 0] * RATE).astype(int)
    assert len(rows) > 0.9 * (len(taken.r_o) - 100)
    error = rows[:, 1:4] - taken.r_o[k]
    assert np.linalg.norm(error, axis=1).max() < 3e-3
    assert np.abs(error / rows[:, 10:13]).max() < 6.0
    assert np.linalg.norm(rows[:, 4:7] - taken.dr_o[k], axis=1).max() < 0.1
    assert np.abs(rows[:, 9] + GRAVITY).max() < 2.0


def test_two_videos_give_the_track(see: See, folder: Path, taken: Film, tmp_path: Path) -> None:
    """Track, points and video of a throw; every number of the result is right."""
    status, result, _ = see(
        folder / "left.mkv",
        folder / "right.mkv",
        "--points",
        tmp_path / "P.csv",
        "--video",
        tmp_path / "V.mkv",
        "--ball",
        "thrown",
    )
    assert status == 0
    assert (result["schema"], result["status"], result["warnings"]) == ("mitt.see/1", "ok", [])
    assert result["frames"] == {"left": FRAMES, "right": FRAMES, "paired": FRAMES}
    assert result["sightings"] == FRAMES - 5
    assert result["rate_hz"] == pytest.approx(RATE, rel=1e-6)
    head = (tmp_path / "T.csv").read_text().splitlines()[0]
    assert head == ("t_s,x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s,ax_m_s2,ay_m_s2,az_m_s2,sx_m,sy_m,sz_m")
    check_track(tmp_path / "T.csv", taken)
    points = table(tmp_path / "P.csv")
    assert points.shape == (FRAMES - 5, 4)
    with av.open(str(tmp_path / "V.mkv")) as container:
        pictures = [f.to_ndarray(format="rgb24") for f in container.decode(video=0)]
    assert len(pictures) == FRAMES
    green = (pictures[100][..., 1].astype(int) - pictures[100][..., 0]) > 60
    assert green[:, : green.shape[1] // 2].any()
    assert green[:, green.shape[1] // 2 :].any()
    assert not ((pictures[2][..., 1].astype(int) - pictures[2][..., 0]) > 60).any()


def bent_film(taken: Film, lens: Lens) -> Film:
    """Return the film as if taken through a lens that bends: each pixel fetched from the old."""
    v, u = np.mgrid[: lens.height, : lens.width]
    at = lens.straighten(np.column_stack((u.ravel(), v.ravel())).astype(float))
    x, y = (at[:, k].reshape(u.shape).astype(np.float32) for k in (0, 1))

    def bend(image: Image) -> Image:
        out = cv2.remap(image, x, y, cv2.INTER_LINEAR, borderValue=24)
        return np.asarray(out, dtype=np.uint8)

    return replace(taken, left=[bend(i) for i in taken.left], right=[bend(i) for i in taken.right])


def test_images_of_other_sizes_through_lenses_that_bend(see: See, tmp_path: Path) -> None:
    """320 x 240 folders of images with 8 px of distortion at the corner give the same track."""
    cameras = tuple(
        Camera(width=320, height=240, f_px=420.0, cu=159.5, cv=119.5, T_world_cam=c.T_world_cam)
        for c in fixed_rig().cameras
    )
    rig = Rig(cameras=cameras)
    straight, plain = film(160, rig=rig), calibrated(rig)
    numbers = lens_of(cameras[0]).numbers.copy()
    numbers[4:8] = (-0.25, 0.05, 1e-3, -1e-3)
    lens = Lens(width=320, height=240, numbers=numbers)
    bent = replace(plain, cameras=tuple(replace(c, lens=lens) for c in plain.cameras))
    write_rig(tmp_path / "RIG.toml", bent, version="test")
    taken = bent_film(straight, lens)
    for name, images in (("left", taken.left), ("right", taken.right)):
        (tmp_path / name).mkdir()
        for k, image in enumerate(images):
            cv2.imwrite(str(tmp_path / name / f"{k / RATE:.4f}.png"), image)
    status, result, _ = see(
        tmp_path / "left", tmp_path / "right", "--rig", tmp_path / "RIG.toml", "--ball", "thrown"
    )
    assert (status, result["status"]) == (0, "ok")
    check_track(tmp_path / "T.csv", taken)


def test_swapped_eyes_are_noticed(see: See, folder: Path) -> None:
    """Also where a symmetric rig makes the rays meet: what they show does not fall."""
    status, result, _ = see(folder / "right.mkv", folder / "left.mkv")
    assert (status, result["status"]) == (0, "exchanged")
    assert "exchanged" in result["warnings"][0]


def test_a_rig_that_is_anothers_is_noticed(see: See, folder: Path, tmp_path: Path) -> None:
    """One camera turned by two degrees: the cameras agree on nothing, and the message says why."""
    rig = calibrated()
    c, s = np.cos(0.035), np.sin(0.035)
    T = rig.cameras[1].T_world_cam.copy()
    T[:3, :3] = T[:3, :3] @ np.array(((1, 0, 0), (0, c, -s), (0, s, c)))
    other = replace(rig, cameras=(rig.cameras[0], replace(rig.cameras[1], T_world_cam=T)))
    write_rig(tmp_path / "RIG.toml", other, version="test")
    status, _, err = see(folder / "left.mkv", folder / "right.mkv", "--rig", tmp_path / "RIG.toml")
    assert status == 2
    assert "agree on a ball in 0 of" in err
    assert len(err.strip().splitlines()) == 1


GL = np.diag((1.0, -1.0, -1.0, 1.0))
BODY = np.array(((0.0, -1.0, 0.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0)))


def in_mm(T: Array) -> Array:
    """Return a pose in millimetres."""
    return np.vstack((np.column_stack((T[:3, :3], 1e3 * T[:3, 3])), T[3]))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (inverse, "write the inverses"),
        (lambda T: T @ GL, "second and third column"),
        (lambda T: GL @ inverse(T), "then write the inverses"),
        (lambda T: T @ np.block([[BODY, np.zeros((3, 1))], [np.zeros((1, 3)), 1.0]]), "optical"),
        (in_mm, "write metres"),
        (lambda T: in_mm(inverse(T)), "write the inverses, and write metres"),
    ],
)
def test_poses_of_other_programs_are_told_apart(
    see: See, taken: Film, tmp_path: Path, change: Callable[[Array], Array], says: str
) -> None:
    """The inverse, other axes, another unit: which it is stands in the line, with the remedy."""
    films = [
        video_of(tmp_path / f"{name}.mkv", images[::4], rate=RATE / 4)
        for name, images in (("l", taken.left), ("r", taken.right))
    ]
    rig = calibrated()
    cameras = tuple(replace(c, T_world_cam=change(c.T_world_cam)) for c in rig.cameras)
    write_rig(tmp_path / "RIG.toml", replace(rig, cameras=cameras), version="test")
    status, result, err = see(*films, "--rig", tmp_path / "RIG.toml")
    assert status == 2 or result["status"] != "ok"
    said = err + " ".join(result.get("warnings", []))
    assert "T_world_cam holds" in said
    assert says in said
    assert "exchanged" not in said


def video_of(path: Path, images: list[Image], *, rate: float = RATE) -> Path:
    """Write images as a video and return its path."""
    with VideoWriter(path, rate=rate, lossless=True) as writer:
        for image in images:
            writer.write(image)
    return path


def test_a_camera_that_ends_early_is_told(
    see: See, folder: Path, taken: Film, tmp_path: Path
) -> None:
    """The track goes on to the end of the shorter video, and the rest is counted."""
    short = video_of(tmp_path / "short.mkv", taken.right[:150])
    status, result, _ = see(folder / "left.mkv", short)
    assert (status, result["status"]) == (0, "ok")
    assert result["frames"] == {"left": FRAMES, "right": 150, "paired": 150}
    assert "70 without a partner" in result["warnings"][0]


def test_films_a_frame_apart_are_out_of_step(see: See, taken: Film, tmp_path: Path) -> None:
    """At 125 Hz the ball is 2 cm off: said, and in the standard deviation; equal counts or not."""
    left = video_of(tmp_path / "l.mkv", taken.left[:-8:8], rate=RATE / 8)
    right = video_of(tmp_path / "r.mkv", taken.right[8::8], rate=RATE / 8)
    status, result, _ = see(left, right)
    assert (status, result["status"]) == (0, "out_of_step")
    assert "the cameras are not in step" in result["warnings"][0]
    assert result["offset_s"] == pytest.approx(8.0 / RATE, abs=1e-3)
    rows = table(tmp_path / "T.csv")
    off = np.linalg.norm(rows[:, 1:4] - taken.r_o[np.rint(rows[:, 0] * RATE).astype(int)], axis=1)
    assert np.median(off) > 0.01
    assert np.all(np.linalg.norm(rows[:, 10:13], axis=1) > 0.6 * off)


def test_a_black_camera_is_named(see: See, folder: Path, taken: Film, tmp_path: Path) -> None:
    """No sighting at all is bad input, and nothing is written."""
    black = video_of(tmp_path / "black.mkv", [np.zeros_like(i) for i in taken.right])
    status, _, err = see(folder / "left.mkv", black)
    assert status == 2
    assert "camera right saw no ball" in err
    assert not (tmp_path / "T.csv").exists()


def test_a_frozen_camera_does_not_pass_for_a_ball(
    see: See, folder: Path, taken: Film, tmp_path: Path
) -> None:
    """One image over and over: the status is not ok."""
    frozen = video_of(tmp_path / "frozen.mkv", [taken.right[100]] * FRAMES)
    status, result, err = see(folder / "left.mkv", frozen)
    assert status == 2 or result["status"] != "ok" or result["warnings"], err


def test_other_sizes_than_the_rigs_are_refused(see: See, folder: Path, tmp_path: Path) -> None:
    """The message names the camera and both sizes."""
    small = video_of(tmp_path / "small.mkv", [np.full((96, 96), 24, dtype=np.uint8)] * 5)
    status, _, err = see(folder / "left.mkv", small)
    assert status == 2
    assert "128 x 128" in err
    assert "96 x 96" in err


def test_frames_that_never_meet_are_told(see: See, tmp_path: Path) -> None:
    """Two folders half a period apart: no pair, and the message says --max-skew."""
    for name, shift in (("a", 0.0), ("b", 0.005)):
        (tmp_path / name).mkdir()
        for k in range(10):
            image = np.full((128, 128), 24, dtype=np.uint8)
            cv2.imwrite(str(tmp_path / name / f"{0.01 * k + shift:.4f}.png"), image)
    status, _, err = see(tmp_path / "a", tmp_path / "b")
    assert status == 2
    assert "max-skew" in err


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda rig: replace(rig, frame="camera"), "--level or --hand"),
        (lambda rig: replace(rig, cameras=rig.cameras[:1]), "two cameras"),
    ],
)
def test_rigs_that_cannot_see_are_refused(
    see: See,
    folder: Path,
    tmp_path: Path,
    change: Callable[[CalibratedRig], CalibratedRig],
    says: str,
) -> None:
    """Without the vertical there is no gravity, with one camera no depth."""
    write_rig(tmp_path / "RIG.toml", change(calibrated()), version="test")
    status, _, err = see(folder / "left.mkv", folder / "right.mkv", "--rig", tmp_path / "RIG.toml")
    assert status == 2
    assert says in err


@pytest.mark.parametrize(
    ("more", "says"),
    [
        (["--ball-radius", "0"], "--ball-radius"),
        (["--max-skew", "-1"], "--max-skew"),
        (["--frames", "0"], "--frames"),
        (["--fps", "nan"], "--fps"),
        (["--video", "a.avi"], "--video"),
        (["--ball", "bowling"], "ball"),
    ],
)
def test_bad_options_are_one_line(see: See, folder: Path, more: list[str], says: str) -> None:
    """Exit status 2, and the option is named."""
    status, _, err = see(folder / "left.mkv", folder / "right.mkv", *more)
    assert status == 2
    assert says in err
    assert len(err.strip().splitlines()) == 1


def test_check_does_nothing(see: See, folder: Path, tmp_path: Path) -> None:
    """--check says that the input is good, and writes no file."""
    status, _, err = see(folder / "left.mkv", folder / "right.mkv", "--check")
    assert status == 0
    assert "input is good" in err
    assert not (tmp_path / "T.csv").exists()


def test_what_falls_falls_at_g() -> None:
    """A parabola has no error, a straight path that of g; short records tell nothing."""
    t = np.arange(0.0, 0.5, 0.004)
    fall = np.column_stack((t, 3.0 - 5.0 * t, 0.0 * t, 1.0 * t - 0.5 * GRAVITY * t * t))
    straight = fall.copy()
    straight[:, 3] = t
    assert fall_error(list(fall)) == pytest.approx(0.0, abs=1e-9)
    assert fall_error(list(straight)) == pytest.approx(GRAVITY, abs=1e-9)
    assert fall_error(list(fall[:10])) is None


def painted(grey: Image, ground: tuple[int, int, int], ball: tuple[int, int, int]) -> Image:
    """Return an image in which ground and ball of a film have other colours, with their noise."""
    share = np.clip((grey - 24.0) / 160.0, 0.0, 1.0)[..., None]
    noise = np.where(share > 0.1, 0.0, grey[..., None] - 24.0)
    colours = (1.0 - share) * np.array(ground) + share * np.array(ball) + noise
    return np.asarray(np.clip(np.rint(colours), 0.0, 255.0), dtype=np.uint8)


def write_painted(path: Path, images: list[Image], ball: tuple[int, int, int]) -> None:
    """Write a film before a blue wall that is as bright as the ball."""
    with VideoWriter(path, rate=RATE, lossless=True) as writer:
        for image in images:
            writer.write(painted(image, (60, 120, 180), ball))


def test_a_ball_of_the_walls_brightness_is_told_by_its_colour(
    see: See, taken: Film, tmp_path: Path
) -> None:
    """Six digits, or a picture of the ball; without, a ball of the same mean is not seen."""
    orange = (210, 110, 40)
    for name, images in (("left.mkv", taken.left), ("right.mkv", taken.right)):
        write_painted(tmp_path / name, images, orange)
    films = tmp_path / "left.mkv", tmp_path / "right.mkv"
    picture = np.full((20, 20, 3), orange[::-1], np.uint8)
    cv2.imwrite(str(tmp_path / "ball.png"), picture)
    for said in ("d26e28", tmp_path / "ball.png"):
        status, result, _ = see(*films, "--ball", "thrown", "--ball-colour", said)
        assert (status, result["status"]) == (0, "ok")
        check_track(tmp_path / "T.csv", taken)
    assert see(*films)[0] == 2


def test_a_background_may_be_a_film_of_its_own(see: See, taken: Film, tmp_path: Path) -> None:
    """A ball in sight from the first frame to the last of a short film, darker than the wall."""
    for name, images in (("left", taken.left), ("right", taken.right)):
        for kind, shown in (("empty", images[:3]), ("film", images[100:112])):
            (tmp_path / f"{kind}-{name}").mkdir()
            for k, image in enumerate(shown):
                path = tmp_path / f"{kind}-{name}" / f"{0.001 * k:.4f}.png"
                cv2.imwrite(str(path), 255 - image)
    films = tmp_path / "film-left", tmp_path / "film-right"
    left = "--left-background", tmp_path / "empty-left"
    right = "--right-background", tmp_path / "empty-right"
    status, result, _ = see(*films, *left, *right)
    assert status == 0
    assert result["sightings"] == 12
    status, _, said = see(*films, *left)
    assert status == 2
    assert "--right-background" in said
    big = tmp_path / "big.png"
    cv2.imwrite(str(big), np.zeros((64, 64), np.uint8))
    status, _, said = see(*films, "--left-background", big, "--right-background", big)
    assert status == 2
    assert "128 x 128" in said


@pytest.mark.parametrize("said", ["ff80", "gg0000", "3c78b4"])
def test_colours_that_say_nothing_are_refused(
    see: See, taken: Film, tmp_path: Path, said: str
) -> None:
    """Too few digits, no digits, the colour of the wall: one line."""
    for name, images in (("left.mkv", taken.left[:8]), ("right.mkv", taken.right[:8])):
        write_painted(tmp_path / name, images, (210, 110, 40))
    films = tmp_path / "left.mkv", tmp_path / "right.mkv"
    status, _, err = see(*films, "--ball-colour", said)
    assert status == 2
    assert "--ball-colour" in err


class Shown(ImageSource):
    """A live camera that shows images."""

    live = True

    def __init__(self, camera: int, images: list[Image]) -> None:
        """Take what it shows, one image a millisecond."""
        super().__init__(f"shown {camera}", camera, None)
        self._images = iter(enumerate(images))

    def _grab(self) -> tuple[float, Image] | None:
        """Return the next image."""
        k, pixels = next(self._images, (0, None))
        return None if pixels is None else (k / RATE, pixels)

    def close(self) -> None:
        """Nothing is held open."""


def test_live_cameras_learn_their_background_from_the_first_images(
    taken: Film, monkeypatch: pytest.MonkeyPatch
) -> None:
    """So a ball may be darker than the wall."""
    empty = (taken.left[:4] * 8, taken.right[:4] * 8)
    shown = [
        Shown(k, [255 - image for image in (*ground, *images)])
        for k, (ground, images) in enumerate(zip(empty, (taken.left, taken.right), strict=True))
    ]
    monkeypatch.setattr(two_cameras, "open_cameras", lambda *_, **__: nullcontext(shown))
    monkeypatch.setattr(two_cameras, "film_looks", lambda *_: list[Image]())
    seen = two_cameras.SeenSoFar()
    two_cameras.see_ball(
        "left",
        "right",
        calibrated(),
        seen,
        None,
        ball="thrown",
        radius=0.04,
        max_skew=5e-4,
        fps=None,
        frames=None,
        background=None,
        colour=None,
        progress=lambda *_: None,
    )
    assert seen.counts.paired == FRAMES
    assert seen.agreed > 0.95 * (FRAMES - 5)
