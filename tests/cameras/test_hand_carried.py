"""A ball in the hand: the rig's pose is found, outliers or not, with its true uncertainty."""

import numpy as np
import pytest
from throws_on_film import calibrated

from mitt.core.errors import InputError
from mitt.core.eyes.camera import inverse, turned
from mitt.core.signals import Array
from mitt.io.rig import CalibratedRig
from mitt.robot.cameras.hand_calibration import calibrate_hand, hand_problem
from mitt.robot.cameras.least_squares import fit

RADIUS = 0.04
#: The rig's frame in the world, as it was before anybody knew.
T_WORLD_RIG = turned(np.eye(4), np.array((0.3, -0.5, 0.9, -1.2, 0.4, 0.3)))


def unplaced() -> CalibratedRig:
    """Return the rig in a frame of its own."""
    return calibrated().seen_from(inverse(T_WORLD_RIG), "camera")


def centroids(places: Array, rng: np.random.Generator, noise: float) -> Array:
    """Return centroids of a ball in both cameras, those of ``triangulation``, shape (k, 4)."""
    out = []
    for c in calibrated().rig().cameras:
        p = (places - c.centre) @ c.rotation
        stretch = 1.0 / (1.0 - RADIUS**2 / p[:, 2] ** 2)
        uv = c.f_px * p[:, :2] / p[:, 2:] * stretch[:, None] + (c.cu, c.cv)
        out.append(uv + noise * rng.standard_normal(uv.shape))
    return np.hstack(out)


def places(rng: np.random.Generator, count: int = 25) -> Array:
    """Return places that a hand reaches and both cameras see [m], shape (count, 3)."""
    return rng.uniform((0.5, -0.4, -0.2), (0.9, 0.4, 0.6), (count, 3))


def test_exact_centroids_give_the_exact_pose() -> None:
    """Without noise the pose comes back to 1e-9."""
    rng = np.random.default_rng(0)
    p = places(rng)
    rig, _, stage = calibrate_hand(unplaced(), p, centroids(p, rng, 0.0), radius=RADIUS)
    for a, b in zip(rig.cameras, calibrated().cameras, strict=True):
        assert np.abs(a.T_world_cam - b.T_world_cam).max() < 1e-8
    assert rig.frame == "robot"
    assert stage.warnings == ()


def test_the_jacobian_is_central_differences() -> None:
    """To 1e-6 of its size, away from the solution."""
    rng = np.random.default_rng(1)
    p = places(rng)
    problem = hand_problem(unplaced(), p, centroids(p, rng, 3.0), RADIUS)
    J = problem.jacobian()
    for k, step in enumerate(1e-6 * np.eye(6)):
        d = (problem.moved(-step).residuals() - problem.moved(step).residuals()) / 2e-6
        assert np.abs(d - J[:, k]).max() < 1e-6 * (1.0 + np.abs(d).max())


def test_the_covariance_is_true() -> None:
    """Over 40 calibrations the squared error in its covariance has the mean 6, within 25 %."""
    rng, values = np.random.default_rng(2), []
    for _ in range(40):
        p = places(rng)
        solved = fit(hand_problem(unplaced(), p, centroids(p, rng, 0.1), RADIUS))
        T = solved.problem.T_rig_world @ T_WORLD_RIG  # identity but for the error
        w = 0.5 * np.array((T[2, 1] - T[1, 2], T[0, 2] - T[2, 0], T[1, 0] - T[0, 1]))
        v = solved.problem.T_rig_world[:3, 3] - inverse(T_WORLD_RIG)[:3, 3]
        error = np.concatenate((w, v))
        values.append(error @ np.linalg.solve(solved.covariance, error))
    assert 4.5 < np.mean(values) < 7.5


def test_wrong_centroids_are_held_down() -> None:
    """With a tenth of them 30 px off, the cameras are placed within 5 mm."""
    rng = np.random.default_rng(3)
    p = places(rng, 40)
    seen = centroids(p, rng, 0.05)
    seen[::10] += 30.0
    rig, solved, _ = calibrate_hand(unplaced(), p, seen, radius=RADIUS)
    for a, b in zip(rig.cameras, calibrated().cameras, strict=True):
        assert np.linalg.norm(a.T_world_cam[:3, 3] - b.T_world_cam[:3, 3]) < 5e-3
    assert solved.outliers > 0.0


def test_places_on_a_line_are_refused() -> None:
    """A line leaves the turn about it open; the message says what is wanted."""
    p = np.array([(0.6, 0.01 * k, 0.1) for k in range(20)])
    with pytest.raises(InputError, match="one line"):
        hand_problem(unplaced(), p, centroids(p, np.random.default_rng(4), 0.05), RADIUS)


def test_three_places_are_too_few() -> None:
    """Four are wanted."""
    rng = np.random.default_rng(5)
    p = places(rng, 3)
    with pytest.raises(InputError, match="4 places"):
        hand_problem(unplaced(), p, centroids(p, rng, 0.05), RADIUS)
