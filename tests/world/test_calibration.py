"""The errors that a calibration leaves: as large as those of calibrations that were made."""

import numpy as np
import pytest

from mitt.core.errors import InputError
from mitt.core.eyes.camera import Camera, Rig, fixed_rig
from mitt.core.signals import Array
from mitt.lab.world.calibration_errors import (
    bends,
    drawn_rig,
    error_root,
    image_grid,
    pinhole_errors,
)
from mitt.lab.world.scene import scene_of

BEND = (-0.10, 0.02)
#: The place of the paper's catch [m].
CATCH = np.array([0.785, 0.0, 0.057])


@pytest.fixture(scope="module")
def rig() -> Rig:
    return fixed_rig()


def triangulated(rig: Rig, seen: list[tuple[float, float]]) -> Array:
    """Return the point nearest to the lines of sight [m], shape (3,)."""
    A, b = np.zeros((3, 3)), np.zeros(3)
    for camera, (u, v) in zip(rig.cameras, seen, strict=True):
        d = camera.ray(u, v)
        across = np.eye(3) - np.outer(d, d)
        A, b = A + across, b + across @ camera.centre
    return np.asarray(np.linalg.solve(A, b))


def errors_at(rig: Rig, root: Array, p: Array, count: int = 200) -> Array:
    """Return where the calibrated rig sees a point, less where it is [m], shape (count, 3)."""
    rng = np.random.default_rng(5)
    seen = [[c.project(p) for c in drawn_rig(rig, root, rng).cameras] for _ in range(count)]
    return np.array([triangulated(rig, uv) - p for uv in seen])


def test_a_calibrated_rig_sees_well_where_the_hand_is_and_worse_far_away(rig: Rig) -> None:
    """A ball in the hand placed it: 1.8 mm at the catch, within a fifth.

    Corners of 0.2 px leave 23 mm at 3.8 m, where nobody held anything.
    """
    root = error_root(rig, 20, 0.2, BEND)
    near, far = errors_at(rig, root, CATCH), errors_at(rig, root, np.array([3.8, 0.2, 0.3]))
    assert 1.4e-3 < np.sqrt(np.mean(np.sum(near**2, axis=1))) < 2.1e-3
    assert 18e-3 < np.sqrt(np.mean(np.sum(far**2, axis=1))) < 27e-3
    assert np.abs(near.mean(axis=0)).max() < 0.22e-3


def test_errors_grow_with_the_noise_and_shrink_with_views(rig: Rig) -> None:
    """In proportion to the noise; four times the views leave a quarter of the variance."""
    root = error_root(rig, 20, 0.2, BEND)
    assert np.allclose(error_root(rig, 20, 0.4, BEND), 2.0 * root)
    more = error_root(rig, 80, 0.2, BEND)
    assert 0.22 < np.trace(more @ more.T) / np.trace(root @ root.T) < 0.28


def test_the_ball_in_the_hand_fits_the_placed_rig(rig: Rig) -> None:
    """The errors of the cameras' poses hang together so that balls near the hand are seen well.

    One camera moved by as much without the other errs more than ten times as much there.
    """
    root = error_root(rig, 20, 0.2, BEND)
    alone = root.copy()
    alone[6:12] = 0.0  # the left camera as if it were known, the right one as it was found
    placed = np.std(errors_at(rig, root, CATCH))
    assert placed < 0.1 * np.std(errors_at(rig, alone, CATCH))


def test_a_lens_moves_image_points_as_its_derivatives_say(rig: Rig) -> None:
    """The table of derivatives is that of a lens whose numbers are changed a little."""
    from mitt.core.eyes.lens import Lens  # noqa: PLC0415 (beside its use)

    camera, step = rig.cameras[0], 1e-6
    xy = image_grid(camera)
    numbers = np.array([camera.f_px, camera.f_px, camera.cu, camera.cv, *BEND, 0.0, 0.0, 0.0])
    points = np.column_stack((xy, np.ones(len(xy))))
    derivatives = bends(camera, xy, BEND)
    for n in range(6):
        more, less = numbers.copy(), numbers.copy()
        more[n] += step
        less[n] -= step
        moved = Lens(width=128, height=128, numbers=more).project(points)
        moved -= Lens(width=128, height=128, numbers=less).project(points)
        assert np.allclose(moved / (2.0 * step), derivatives[:, :, n], atol=1e-4)


def test_a_longer_lens_is_a_longer_pinhole(rig: Rig) -> None:
    """What a pinhole can be wrong by is found as it is."""
    camera: Camera = rig.cameras[0]
    error = np.array([0.01 * camera.f_px, 0.01 * camera.f_px, 0.3, -0.2, 0.0, 0.0])
    assert np.allclose(pinhole_errors(camera, error), (0.01, 0.3, -0.2))


def test_too_few_views_are_refused() -> None:
    """A calibration from three views is open; none at all is exact."""
    with pytest.raises(InputError, match="views"):
        scene_of({"sensing": {"views": 3}}, place="x.toml")


def test_images_come_from_another_rig_than_the_catcher_has() -> None:
    """Drawn from the trial's seed: other trials have other rigs, an exact scene has none."""
    from mitt.lab.trials.runner import cameras_of  # noqa: PLC0415 (beside its use)

    rig = fixed_rig()
    for views, equal in ((0, True), (20, False)):
        made = cameras_of(rig, scene_of({"sensing": {"views": views}}, place="x.toml"))
        optics = [made(np.random.default_rng(k)).film[0].optics.copy() for k in (1, 1, 2)]
        assert np.array_equal(optics[0], optics[1])
        assert np.array_equal(optics[0], optics[2]) is equal
