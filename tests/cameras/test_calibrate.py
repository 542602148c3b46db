"""``mitt calibrate`` from files: drawn images of boards, a ball in the hand, a moving hand."""

import csv
import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from boards import SPEC, board_pose, drawn, seen_by, true_lens, true_stereo
from throws_on_film import RADIUS, calibrated

from mitt.cli.main import main
from mitt.core.arm.arm import Arm
from mitt.core.eyes.camera import inverse, turned
from mitt.core.signals import Array
from mitt.io.rig import read_rig, write_rig
from mitt.lab.world.imaging import Imager, ImageSensor
from mitt.robot.cameras.charuco import Board

Call = Callable[..., tuple[int, dict[str, Any], str]]
BOARD = ["--board", "9x6", "--square", "0.06", "--marker", "0.045"]
VIEWS = 14
UNPLACED = turned(np.eye(4), np.array((0.3, -0.5, 0.9, -1.2, 0.4, 0.3)))


@pytest.fixture(scope="module")
def images(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Array]]:
    """A folder with drawn views of the board by both cameras, and the true poses of the board."""
    folder, board, lens = tmp_path_factory.mktemp("boards"), Board(SPEC), true_lens(0.0)
    rng = np.random.default_rng(7)
    poses: list[Array] = []
    for name in ("left", "right"):
        (folder / name).mkdir()
    while len(poses) < VIEWS:
        pose = board_pose(board, rng, 0.5)
        both = (pose, true_stereo() @ pose)
        if pose[2, 3] > 2.0 or not all(seen_by(board, lens, T, rng, 0.0) for T in both):
            continue
        for name, T in zip(("left", "right"), both, strict=True):
            path = folder / name / f"{len(poses):03d}.png"
            assert cv2.imwrite(str(path), drawn(board, lens, T, rng))
        poses.append(pose)
    return folder, poses


@pytest.fixture
def call(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Call:
    """Run mitt calibrate --json into RIG.toml; return status, result and stderr."""

    def run(*words: str | Path) -> tuple[int, dict[str, Any], str]:
        line = ["calibrate", "--out", tmp_path / "RIG.toml", "--json", *words]
        status = main([str(word) for word in line])
        out, err = capsys.readouterr()
        return status, json.loads(out) if out else {}, err

    return run


def write_csv(path: Path, head: str, rows: Iterable[Iterable[float | str]]) -> Path:
    """Write a table and return its path."""
    with path.open("w", newline="") as file:
        csv.writer(file).writerows([head.split(","), *rows])
    return path


def test_drawn_boards_give_the_rig(
    call: Call, images: tuple[Path, list[Array]], tmp_path: Path
) -> None:
    """Images in, rig out: f within 0.5 %, base line within 2 mm, 0.2 px; the picture is a PNG."""
    folder, poses = images
    status, result, err = call(
        "--left", folder / "left", "--right", folder / "right", *BOARD, "--level", "3"
    )
    assert status == 0, err
    assert (result["schema"], result["frame"]) == ("mitt.calibrate/1", "board")
    numbers = result["stages"]["boards"]
    assert numbers["rms_px"] < 0.2
    assert numbers["left_f_px"] == pytest.approx(701.5, rel=5e-3)
    base = float(np.linalg.norm(true_stereo()[:3, 3]))
    assert numbers["baseline_m"] == pytest.approx(base, abs=2e-3)
    assert cv2.imread(str(tmp_path / "RIG.png")) is not None
    # The world is the face of the board in view 3, z up out of it, seen from above.
    rig = read_rig(tmp_path / "RIG.toml")
    up = np.diag((1.0, -1.0, -1.0, 1.0))
    assert np.abs(rig.cameras[0].T_world_cam - up @ inverse(poses[3])).max() < 0.02
    assert rig.cameras[0].T_world_cam[2, 3] > 0.5


def test_a_single_camera_gives_its_lens(call: Call, images: tuple[Path, list[Array]]) -> None:
    """--left alone is a rig of one camera."""
    status, result, _ = call("--left", images[0] / "left", *BOARD, "--coefficients", "0")
    assert (status, result["cameras"]) == (0, ["left"])
    assert "baseline_m" not in result["stages"]["boards"]


def test_few_views_bring_warnings(
    call: Call, images: tuple[Path, list[Array]], tmp_path: Path
) -> None:
    """Three views do not cover the image: the warning names the camera and what is missing."""
    for name in ("left", "right"):
        (tmp_path / name).mkdir()
        for k in range(3):
            data = (images[0] / name / f"{k:03d}.png").read_bytes()
            (tmp_path / name / f"{k}.png").write_bytes(data)
    status, result, _ = call("--left", tmp_path / "left", "--right", tmp_path / "right", *BOARD)
    assert status == 0
    assert any("near the edges" in text for text in result["warnings"])


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--board", "5x4"], "the board in 3 different views"),
        (["--board", "9by6"], "--board"),
        (["--dictionary", "9X9_1"], "--dictionary"),
        (["--dictionary", "4X4_50", "--board", "20x20"], "markers or more"),
        (["--marker", "0.07"], "--marker"),
        (["--level", "999"], "--level"),
    ],
)
def test_a_wrong_board_is_one_line(
    call: Call, images: tuple[Path, list[Array]], words: list[str], says: str, tmp_path: Path
) -> None:
    """Exit status 2, one line, no file."""
    folder = images[0]
    status, _, err = call("--left", folder / "left", "--right", folder / "right", *BOARD, *words)
    assert status == 2
    assert says in err
    assert len(err.strip().splitlines()) == 1
    assert not (tmp_path / "RIG.toml").exists()


def test_different_numbers_of_images_are_refused(
    call: Call, images: tuple[Path, list[Array]], tmp_path: Path
) -> None:
    """The k-th images belong together, so there must be as many."""
    (tmp_path / "one").mkdir()
    (tmp_path / "one" / "0.png").write_bytes((images[0] / "right" / "000.png").read_bytes())
    status, _, err = call("--left", images[0] / "left", "--right", tmp_path / "one", *BOARD)
    assert status == 2
    assert "as many from each camera" in err


@pytest.fixture
def unplaced(tmp_path: Path) -> Path:
    """The catcher's rig in the frame of nobody knows what."""
    rig = calibrated().seen_from(inverse(UNPLACED), "camera")
    write_rig(tmp_path / "unplaced.toml", rig, version="test")
    return tmp_path / "unplaced.toml"


def angles(arm: Arm, count: int) -> list[Array]:
    """Return joint angles at which both cameras see the hand."""
    rng = np.random.default_rng(3)
    return [arm.q_ready + rng.uniform(-0.25, 0.25, arm.n) for _ in range(count)]


def placed_well(path: Path, limit: float) -> bool:
    """Say whether the cameras of a file stand where the catcher's do [m]."""
    rig = read_rig(path)
    pairs = zip(rig.cameras, calibrated().cameras, strict=True)
    gap = max(np.linalg.norm((a.T_world_cam - b.T_world_cam)[:3, 3]) for a, b in pairs)
    return rig.frame == "robot" and bool(gap < limit)


def test_a_ball_in_the_hand_places_the_rig(
    call: Call, unplaced: Path, arm: Arm, tmp_path: Path
) -> None:
    """Joint angles and images of the ball: the cameras stand within 10 mm of the truth."""
    imager = Imager(calibrated().rig(), ImageSensor(), np.random.default_rng(0))
    for name in ("l", "r"):
        (tmp_path / name).mkdir()
    rows = angles(arm, 20)
    for k, q in enumerate(rows):
        for name, frame in zip("lr", imager.render(0.0, arm.position(q), RADIUS), strict=True):
            assert cv2.imwrite(str(tmp_path / name / f"{k}.png"), frame.pixels)
    table = write_csv(tmp_path / "hand.csv", "q1_rad,q2_rad,q3_rad", rows)
    status, result, err = call(
        "--rig",
        unplaced,
        "--hand",
        table,
        "--hand-left",
        tmp_path / "l",
        "--hand-right",
        tmp_path / "r",
    )
    assert status == 0, err
    assert result["stages"]["hand"]["places"] == 20
    assert result["stages"]["hand"]["rms_px"] < 0.1
    assert placed_well(tmp_path / "RIG.toml", 0.01)


def test_positions_and_centroids_do_as_well(
    call: Call, unplaced: Path, arm: Arm, tmp_path: Path
) -> None:
    """One table with places and centroids, exact: within 0.1 mm."""
    places = np.array([arm.position(q) for q in angles(arm, 12)])
    columns = [places]
    for c in calibrated().rig().cameras:
        p = (places - c.centre) @ c.rotation
        stretch = 1.0 / (1.0 - RADIUS**2 / p[:, 2:] ** 2)
        columns.append(c.f_px * p[:, :2] / p[:, 2:] * stretch + (c.cu, c.cv))
    head = "x_m,y_m,z_m,u_left_px,v_left_px,u_right_px,v_right_px"
    table = write_csv(tmp_path / "hand.csv", head, np.hstack(columns))
    status, _, err = call("--rig", unplaced, "--hand", table)
    assert status == 0, err
    assert placed_well(tmp_path / "RIG.toml", 1e-4)


def test_a_table_without_rows_is_refused_in_one_line(call: Call, tmp_path: Path) -> None:
    """A header alone: status 2, no warning of empty means."""
    write_rig(tmp_path / "placed.toml", calibrated(), version="test")
    for name in ("log.csv", "points.csv"):
        (tmp_path / name).write_text("t_s,x_m,y_m,z_m\n")
    status, _, err = call(
        "--rig",
        tmp_path / "placed.toml",
        "--arm-log",
        tmp_path / "log.csv",
        "--points",
        tmp_path / "points.csv",
    )
    assert status == 2
    assert len(err.splitlines()) == 1
    assert "a table with rows" in err


def test_a_moving_hand_sets_the_clock(call: Call, tmp_path: Path) -> None:
    """The offset of 37.3 ms is found within 0.1 ms and stands in the file."""
    write_rig(tmp_path / "placed.toml", calibrated(), version="test")
    t = np.arange(0.0, 3.0, 0.002)

    def hand(t: Array) -> Array:
        return np.column_stack((0.7 + 0.1 * np.sin(9 * t), 0.2 * np.sin(7 * t), 0.3 + 0.0 * t))

    log = write_csv(tmp_path / "log.csv", "t_s,x_m,y_m,z_m", np.column_stack((t, hand(t))))
    seen = t[200:1200]
    noise = 1e-3 * np.random.default_rng(0).standard_normal((len(seen), 3))
    points = write_csv(
        tmp_path / "points.csv",
        "t_s,x_m,y_m,z_m",
        np.column_stack((seen, hand(seen + 0.0373) + noise)),
    )
    status, result, err = call(
        "--rig", tmp_path / "placed.toml", "--arm-log", log, "--points", points
    )
    assert status == 0, err
    assert result["stages"]["clock"]["offset_ms"] == pytest.approx(37.3, abs=0.1)
    assert result["warnings"] == []
    assert read_rig(tmp_path / "RIG.toml").clock_offset == pytest.approx(0.0373, abs=1e-4)


def test_heads_are_found_from_drawn_views(call: Call, tmp_path: Path) -> None:
    """A head seen by its own images: its axes meet at right angles, its poses are right."""
    board, lens = Board(SPEC), true_lens(0.0)
    rig = calibrated()
    one = type(rig.cameras[0])(name="left", lens=lens, T_world_cam=np.eye(4), rms_px=0.1)
    write_rig(tmp_path / "lens.toml", type(rig)(frame="camera", cameras=(one,)), version="test")
    start = turned(np.eye(4), np.array((0.1, -0.05, 0.2, 0.27, 0.18, -1.6)))
    rng = np.random.default_rng(0)
    rows: list[tuple[str, float, float]] = []
    for pan in (-0.12, 0.0, 0.12):
        for tilt in (-0.08, 0.0, 0.08):
            turn = turned(
                turned(np.eye(4), np.array((tilt, 0, 0, 0, 0, 0))), np.array((0, pan, 0, 0, 0, 0))
            )
            name = f"{len(rows)}.png"
            assert cv2.imwrite(str(tmp_path / name), drawn(board, lens, inverse(start @ turn), rng))
            rows.append((name, pan, tilt))
    table = write_csv(tmp_path / "left.csv", "image,pan_rad,tilt_rad", rows)
    status, result, err = call("--rig", tmp_path / "lens.toml", "--left-head", table, *BOARD)
    assert status == 0, err
    assert result["stages"]["head left"]["rms_px"] < 0.2
    assert result["stages"]["head left"]["axes_deg"] == pytest.approx(90.0, abs=0.5)
    (camera,) = read_rig(tmp_path / "RIG.toml").cameras
    assert camera.head is not None
    true = np.diag((1.0, -1.0, -1.0, 1.0)) @ start
    assert np.abs(camera.head.pose(0.0, 0.0) - true).max() < 0.01


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ([], "none of them"),
        (["--hand", "hand.csv"], "either --left"),
        (["--right", "r"], "--left as well"),
        (["--rig", "unplaced.toml", "--arm-log", "hand.csv"], "both or neither"),
        (["--rig", "unplaced.toml", "--arm-log", "hand.csv", "--points", "hand.csv"], "--hand"),
        (["--rig", "unplaced.toml", "--hand", "hand.csv"], "u_left_px"),
        (["--rig", "unplaced.toml", "--hand", "none.csv"], "none.csv"),
        (["--rig", "none.toml", "--hand", "hand.csv"], "none.toml"),
        (["--rig", "unplaced.toml", "--hand", "hand.csv", "--ball-radius", "2"], "--ball-radius"),
        (["--left", "nowhere"], "nowhere"),
        (["--rig", "unplaced.toml", "--left-head", "hand.csv"], "right"),
    ],
)
@pytest.mark.usefixtures("unplaced")
def test_options_that_do_not_go_together_are_one_line(
    call: Call, words: list[str], says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Exit status 2 and one line that says what is missing."""
    monkeypatch.chdir(tmp_path)
    write_csv(tmp_path / "hand.csv", "x_m,y_m,z_m", [(0.5, 0.1, 0.2)])
    status, _, err = call(*words)
    assert status == 2
    assert says in err
    assert len(err.strip().splitlines()) == 1


def test_files_are_not_replaced_unasked_and_check_writes_none(
    call: Call, images: tuple[Path, list[Array]], tmp_path: Path
) -> None:
    """--check leaves nothing; an existing RIG.toml needs --overwrite."""
    folder = images[0]
    words = ["--left", folder / "left", "--right", folder / "right", *BOARD]
    status, _, err = call(*words, "--check")
    assert (status, "input is good" in err) == (0, True)
    assert not (tmp_path / "RIG.toml").exists()
    (tmp_path / "RIG.toml").write_text("mine")
    status, _, err = call(*words)
    assert status == 2
    assert "--overwrite" in err
    assert (tmp_path / "RIG.toml").read_text() == "mine"
