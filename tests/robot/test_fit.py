"""Capsules about points: they hold them all, and are not much larger than they must be."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.robot.fit import behind, capsules_about, volume
from mitt.signals import Array


def _gap(points: Array, capsule: object) -> Array:
    """Return how far points are outside a capsule [m]; negative inside."""
    start, end = np.array(capsule.start), np.array(capsule.end)  # type: ignore[attr-defined]
    way = end - start
    share = np.clip((points - start) @ way / max(float(way @ way), 1e-30), 0.0, 1.0)
    nearest = start + share[:, None] * way
    return np.asarray(
        np.linalg.norm(points - nearest, axis=1) - capsule.radius  # type: ignore[attr-defined]
    )


@given(seed=st.integers(0, 2**31), count=st.integers(1, 60), radius=st.floats(0.0, 0.1))
def test_every_ball_is_inside(seed: int, count: int, radius: float) -> None:
    """Whatever the points: on a line, in a plane, all in one place."""
    rng = np.random.default_rng(seed)
    points = rng.standard_normal((count, 3)) * rng.choice([0.0, 0.01, 0.1, 1.0], 3)
    points = points @ np.linalg.qr(rng.standard_normal((3, 3)))[0] + rng.standard_normal(3)
    found = capsules_about(points, radius)
    assert np.min([_gap(points, x) + radius for x in found], axis=0).max() < 1e-8


@given(seed=st.integers(0, 2**31))
def test_the_convex_hull_is_inside(seed: int) -> None:
    """Mixtures of the points too, whether one capsule holds them or two."""
    rng = np.random.default_rng(seed)
    tall = rng.uniform(0.1, 1.0)
    points = rng.standard_normal((30, 3)) * (0.02, 0.02, 0.02) + rng.choice([0.0, tall], (30, 1))
    points[:10] += rng.standard_normal(3) * (0.3, 0.0, 0.0)
    found = capsules_about(points)
    inside = rng.dirichlet(np.full(30, 0.1), 400) @ points
    assert np.min([_gap(inside, x) for x in found], axis=0).max() < 1e-8


@pytest.mark.parametrize(("radius", "length"), [(0.05, 0.4), (0.1, 0.1)])
def test_a_capsule_is_found_again(radius: float, length: float) -> None:
    """Points on its surface give it back to a few per cent of its volume."""
    rng = np.random.default_rng(1)
    sphere = rng.standard_normal((2000, 3))
    sphere *= radius / np.linalg.norm(sphere, axis=1)[:, None]
    points = sphere + np.sign(sphere[:, :1]) * (0.5 * length, 0.0, 0.0)
    found = capsules_about(points)
    assert len(found) == 1
    expected = np.pi * radius**2 * (length + 4.0 / 3.0 * radius)
    assert expected < volume(found[0]) * 1.02
    assert volume(found[0]) < 1.06 * expected


@given(seed=st.integers(0, 2**31), count=st.integers(1, 60), flat=st.booleans())
def test_what_is_behind_a_plane_is_held(seed: int, count: int, flat: bool) -> None:
    """Mixtures of points that lie behind it are mixtures of what is kept, which lies behind it."""
    rng = np.random.default_rng(seed)
    points = rng.standard_normal((count, 3)) * (1.0, 0.0 if flat else 1.0, 1.0)
    normal = rng.standard_normal(3)
    normal /= np.linalg.norm(normal)
    kept = behind(points, points @ normal)
    assert np.all(kept @ normal < 1e-9)
    inside = rng.dirichlet(np.full(count, 0.2), 200) @ points
    inside = inside[inside @ normal <= 0.0]
    if len(inside):
        ways = rng.standard_normal((50, 3))
        assert np.all((inside @ ways.T).max(axis=0) <= (kept @ ways.T).max(axis=0) + 1e-9)
