"""Head axes: lens offsets, skew axes and zero angles are found from views of a board."""

import numpy as np
import pytest
from boards import SPEC, seen_by, true_lens

from mitt.core.errors import InputError
from mitt.core.eyes.camera import inverse, turned
from mitt.core.signals import Array
from mitt.io.rig import HeadAxes, RigCamera
from mitt.robot.cameras.charuco import Board, BoardCorners
from mitt.robot.cameras.head_calibration import calibrate_head, head_problem
from mitt.robot.cameras.least_squares import fit

#: Camera at encoder zero: 1.8 m above the face of the board, which is the world.
T_0 = turned(np.eye(4), np.array((0.1, -0.05, 0.2, 0.27, 0.18, -1.8)))


def true_head() -> HeadAxes:
    """Return axes that miss each other by 4 mm and a right angle by 0.01 rad."""
    R, at = T_0[:3, :3], T_0[:3, 3]
    return HeadAxes(
        T_world_cam=T_0,
        pan_axis=R @ np.array((0.0, 1.0, 0.0)),
        pan_point=at + R @ np.array((0.004, 0.0, -0.05)),
        tilt_axis=R @ np.array((np.cos(0.01), np.sin(0.01), 0.0)),
        tilt_point=at + R @ np.array((0.0, 0.01, -0.046)),
    )


def views(board: Board, noise: float, seed: int = 0) -> tuple[Array, list[BoardCorners]]:
    """Return angles and corners of a sweep over both axes."""
    rng, head = np.random.default_rng(seed), true_head()
    angles = [(p, t) for p in (-0.15, -0.05, 0.05, 0.15) for t in (-0.1, 0.0, 0.1)]
    seen = [seen_by(board, true_lens(), inverse(head.pose(p, t)), rng, noise) for p, t in angles]
    return np.array([a for a, s in zip(angles, seen, strict=True) if s]), [s for s in seen if s]


def camera() -> RigCamera:
    """Return the camera that the head carries."""
    return RigCamera(name="left", lens=true_lens(), T_world_cam=np.eye(4), rms_px=0.1)


@pytest.fixture(scope="module")
def board() -> Board:
    """The board of all tests."""
    return Board(SPEC)


def test_exact_corners_give_the_exact_head(board: Board) -> None:
    """Poses at angles never seen come back to 1e-7."""
    angles, seen = views(board, 0.0)
    assert len(seen) == 12
    solved = fit(head_problem(camera(), board, angles, seen))
    for pan, tilt in ((0.0, 0.0), (0.3, -0.2), (-0.4, 0.25)):
        ours, true = solved.problem.head.pose(pan, tilt), true_head().pose(pan, tilt)
        assert np.abs(ours - true).max() < 1e-7


def test_noise_moves_the_axes_by_what_is_said(board: Board) -> None:
    """With 0.1 px of noise the axes' directions are found within 5 of their sigmas, 5 mrad."""
    angles, seen = views(board, 0.1)
    moved, solved, stage = calibrate_head(camera(), board, angles, seen)
    true = true_head()
    for name, axis in (("pan", true.pan_axis), ("tilt", true.tilt_axis)):
        found = solved.problem.head.pan_axis if name == "pan" else solved.problem.head.tilt_axis
        sigma = np.hypot(
            solved.sigma_of(f"{name}_direction_1"), solved.sigma_of(f"{name}_direction_2")
        )
        assert np.linalg.norm(np.cross(found, axis)) < min(5.0 * sigma, 5e-3)
    assert 0.08 < stage.numbers["rms_px"] < 0.12
    assert moved.head is not None
    assert moved.T_world_cam[2, 3] == pytest.approx(1.8, abs=0.02)  # above the face, z up


def test_one_axis_alone_is_refused(board: Board) -> None:
    """Views at one tilt say nothing about tilt, and the message names it."""
    angles, seen = views(board, 0.1)
    level = angles[:, 1] == 0.0
    more = np.tile(angles[level], (2, 1))
    with pytest.raises(InputError, match="tilt"):
        head_problem(camera(), board, more, [s for s, k in zip(seen, level, strict=True) if k] * 2)
