"""Boards: the true rig is found as well as can be, and what cannot be found is named."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from boards import SPEC, many_views, true_lens, true_stereo
from cramer_rao import one_calibration

from mitt.robot.cameras.board_calibration import board_problem, calibrate_boards, free_numbers
from mitt.robot.cameras.charuco import Board
from mitt.robot.cameras.least_squares import fit

#: Largest ratio of rms error to the Cramer-Rao bound.
NEAR_BOUND = 1.3


@pytest.fixture(scope="module")
def board() -> Board:
    """The board of all tests."""
    return Board(SPEC)


def test_exact_corners_give_the_exact_rig(board: Board) -> None:
    """Without noise lenses and stereo pose come back to 1e-6."""
    seen = many_views(board, 8, np.random.default_rng(2), noise=0.0)
    p = fit(board_problem(board, seen, free_numbers(4))).problem
    assert np.abs(p.lenses - true_lens().numbers).max() < 1e-6
    assert np.abs(p.T_cam_rig[1] - true_stereo()).max() < 1e-8


def test_the_jacobian_is_central_differences(board: Board) -> None:
    """Every column of the bundle's Jacobian, to 1e-6 of its size."""
    seen = many_views(board, 4, np.random.default_rng(3))
    p = board_problem(board, seen, free_numbers(5))
    J = p.jacobian()
    for k, step in enumerate(1e-6 * np.eye(J.shape[1])):
        d = (p.moved(-step).residuals() - p.moved(step).residuals()) / 2e-6
        assert np.abs(d - J[:, k]).max() < 1e-6 * (1.0 + np.abs(d).max()), p.names[k]


def test_opencv_finds_the_same_minimum(board: Board) -> None:
    """One camera: cv2.calibrateCamera ends at the same lens to 0.01 px, with the same rms."""
    seen = many_views(board, 12, np.random.default_rng(4))
    p = board_problem(board, seen, free_numbers(5))
    left = p.corners.camera == 0
    c = replace(
        p.corners,
        camera=p.corners.camera[left],
        view=p.corners.view[left],
        on_board=p.corners.on_board[left],
        uv=p.corners.uv[left],
    )
    alone = replace(p, corners=c, lenses=p.lenses[:1], T_cam_rig=p.T_cam_rig[:1], cameras=("left",))
    ours = fit(alone)
    points = [board.corners[v[0].ids].astype(np.float32) for v in seen.views if v[0]]
    images = [v[0].uv.astype(np.float32) for v in seen.views if v[0]]
    rms, K, bend, _, _ = cv2.calibrateCamera(points, images, (640, 480), None, None)
    assert np.abs(ours.problem.lenses[0, :4] - (K[0, 0], K[1, 1], K[0, 2], K[1, 2])).max() < 0.01
    assert np.abs(ours.problem.lenses[0, 4:] - np.ravel(bend)[:5]).max() < 1e-3
    assert np.sqrt(2.0) * ours.rms == pytest.approx(rms, rel=1e-4)


@pytest.mark.thorough
@pytest.mark.slow
def test_errors_are_those_of_the_cramer_rao_bound() -> None:
    """20 views, 0.2 px: rms errors of base line and points at 2 m within 1.3 of the bound."""
    runs = [one_calibration(seed) for seed in range(8100, 8116)]
    for name in runs[0]:
        error, bound = np.sqrt(np.mean([np.square(run[name]) for run in runs], axis=0))
        assert error <= NEAR_BOUND * bound, name


def test_the_covariance_is_true(board: Board) -> None:
    """Over 12 calibrations the error of fu, in its standard deviations, is of size one."""
    errors = []
    for seed in range(12):
        seen = many_views(board, 10, np.random.default_rng(100 + seed))
        f = fit(board_problem(board, seen, free_numbers(4)))
        errors.append((f.problem.lenses[0, 0] - 700.0) / f.sigma_of("left.fu"))
    assert 0.5 < np.sqrt(np.mean(np.square(errors))) < 1.6


def test_boards_that_face_the_camera_do_not_tell_the_focal_length(board: Board) -> None:
    """Without tilt a warning names fu, and says that tilted views are missing."""
    seen = many_views(board, 6, np.random.default_rng(1), tilt=0.0)
    _, _, stage = calibrate_boards(board, seen, coefficients=0)
    said = [text for text in stage.warnings if "left.fu" in text]
    assert len(said) == 1
    assert "tilted" in said[0]


def test_good_views_bring_no_warning(board: Board) -> None:
    """Twenty tilted views all over the image are enough."""
    seen = many_views(board, 20, np.random.default_rng(0))
    _, _, stage = calibrate_boards(board, seen, coefficients=4)
    assert stage.warnings == ()
    assert 0.18 < stage.numbers["rms_px"] < 0.22
