"""The Cramer-Rao bound of a calibration, and the errors of many."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from boards import SPEC, many_views, true_lens, true_stereo

from mitt.core.eyes.camera import applied, inverse
from mitt.core.eyes.lens import Lens
from mitt.core.signals import Array
from mitt.robot.cameras.board_calibration import BoardProblem, board_problem, free_numbers
from mitt.robot.cameras.charuco import Board
from mitt.robot.cameras.least_squares import fit

VIEWS = 20
NOISE = 0.2
#: Points 2 m before the rig that both cameras see, in the frame of the left one [m].
TARGETS = np.array([(x, y, 2.0) for x in (0.0, 0.3, 0.6) for y in (-0.4, 0.0, 0.4)])


def base_line(problem: BoardProblem) -> Array:
    """Return the length of the base line [m], shape (1,)."""
    return np.array([np.linalg.norm(problem.T_cam_rig[1][:3, 3])])


def triangulated(problem: BoardProblem) -> Array:
    """Return where a rig puts the targets that it sees without noise [m], shape (27,)."""
    truth, rays, centres = (np.eye(4), true_stereo()), [], []
    for T_true, T, numbers in zip(truth, problem.T_cam_rig, problem.lenses, strict=True):
        uv = true_lens().project(applied(T_true, TARGETS))
        xy = Lens(width=640, height=480, numbers=numbers).undistort(uv)
        d = np.column_stack((xy, np.ones(len(xy)))) @ T[:3, :3]
        rays.append(d / np.linalg.norm(d, axis=1)[:, None])
        centres.append(inverse(T)[:3, 3])
    out = []
    for a, b in zip(*rays, strict=True):
        A, B = np.eye(3) - np.outer(a, a), np.eye(3) - np.outer(b, b)
        out.append(np.linalg.solve(A + B, A @ centres[0] + B @ centres[1]))
    return np.ravel(out)


def bound(problem: BoardProblem, what: Callable[[BoardProblem], Array]) -> float:
    """Return the least rms error of an unbiased estimate of ``what``, at the true problem.

    ``what`` is of the cameras alone: the poses of the board, last in a step, do not change it.
    """
    J = problem.jacobian() / NOISE
    steps = 1e-6 * np.eye(J.shape[1])[: J.shape[1] - 6 * len(problem.T_rig_board)]
    of_cameras = [(what(problem.moved(s)) - what(problem.moved(-s))) / 2e-6 for s in steps]
    G = np.zeros((len(of_cameras[0]), J.shape[1]))
    G[:, : len(steps)] = np.transpose(of_cameras)
    return float(np.sqrt(np.mean(np.diag(G @ np.linalg.solve(J.T @ J, G.T)))))


def one_calibration(seed: int) -> dict[str, tuple[float, float]]:
    """Return the rms error of base line and points at 2 m, each with its bound [m]."""
    board = Board(SPEC)
    seen = many_views(board, VIEWS, np.random.default_rng(seed), noise=NOISE)
    solved = fit(board_problem(board, seen, free_numbers(4))).problem
    exact = replace(
        solved,
        lenses=np.array([true_lens().numbers] * 2),
        T_cam_rig=np.array((np.eye(4), true_stereo())),
    )
    return {
        name: (float(np.sqrt(np.mean((what(solved) - what(exact)) ** 2))), bound(exact, what))
        for name, what in (("base line", base_line), ("points at 2 m", triangulated))
    }
