"""The ball in the hand: its disc is found though a part of it is hidden, and nothing else is."""

import numpy as np
import pytest

from mitt.core.eyes.camera import fixed_rig, in_camera, sphere_centroid
from mitt.core.eyes.eyes import Eyes
from mitt.core.eyes.held import find_held
from mitt.core.eyes.localization import eyes_handle
from mitt.core.kernels import Fields
from mitt.core.signals import Array, Image

RADIUS = 0.04
WALL = 25.0
HAND = 80.0
BALL = 170.0
#: Where the ball lies in the hand's frame of the world [m].
OFF = np.array([0.02, -0.01, 0.015])


def drawn(camera: Fields, r: Array, hidden: float, *, ball: float = BALL) -> Image:
    """Return an image of a ball whose lower part a darker hand covers.

    Args:
        camera: A record of ``CAMERA``.
        r: Its centre [m].
        hidden: Share of its diameter that is covered.
        ball: Its grey level.
    """
    place, fine = in_camera(camera, r), 8
    uv = sphere_centroid(camera, place, RADIUS)
    size = camera["f_px"] * RADIUS / place[2]
    x = (np.arange(128 * fine) + 0.5) / fine - 0.5
    u, v = np.meshgrid(x, x)
    grey = np.full(u.shape, WALL)
    grey[(u - uv[0]) ** 2 + (v - uv[1]) ** 2 < size**2] = ball
    grey[(np.abs(u - uv[0]) < 8.0) & (v > uv[1] + size * (1.0 - 2.0 * hidden)) & (v < 127)] = HAND
    noise = np.random.default_rng(0).normal(0.0, 2.0, (128, 128))
    grey = grey.reshape(128, fine, 128, fine).mean(axis=(1, 3)) + noise
    image: Image = np.clip(np.rint(grey), 0, 255).astype(np.uint8)
    return image


def found_at(
    r: Array, hidden: tuple[float, float], *, learned: bool = True, ball: float = BALL
) -> tuple[bool, Array, Array]:
    """Return whether a ball at a place is found, where, and its covariance."""
    eyes = Eyes(fixed_rig()).memory
    eyes.targets["level"], eyes.targets["gain"] = WALL, BALL - WALL
    eyes.targets["weighed"] = 20.0 * learned
    images = tuple(drawn(x, r, h, ball=ball) for x, h in zip(eyes.cameras, hidden, strict=True))
    place, P = np.zeros(3), np.zeros((3, 3))
    found = find_held(images, 0, eyes_handle(eyes), r - OFF, place, P)
    return bool(found), place, P


@pytest.mark.parametrize("r", [(0.9, 0.1, 0.2), (0.7, -0.2, -0.1), (0.8, 0.0, 0.4)])
@pytest.mark.parametrize("hidden", [(0.0, 0.0), (0.25, 0.0), (0.3, 0.3)])
def test_a_ball_is_found_where_it_is_though_a_part_is_hidden(
    r: tuple[float, float, float], hidden: tuple[float, float]
) -> None:
    """Within a fifth of its radius; the middle of what is in sight would be up to 12 mm off.

    The error is one of 99 in a hundred of the covariance that is told (chi-squared, 3 degrees).
    """
    found, place, P = found_at(np.array(r), hidden)
    assert found
    error = place - np.array(r)
    assert np.linalg.norm(error) < 0.2 * RADIUS
    assert error @ np.linalg.solve(P, error) < 11.3


def test_what_one_camera_sees_alone_lies_on_its_ray() -> None:
    """Hidden from one, the other tells two directions, and says so."""
    r = np.array([0.8, 0.05, 0.1])
    found, place, P = found_at(r, (0.0, 0.95))
    assert found
    ray = r - fixed_rig().cameras[0].centre
    ray /= np.linalg.norm(ray)
    off = place - r
    assert np.linalg.norm(off - ray * (off @ ray)) < 0.004
    assert ray @ P @ ray > 0.5


@pytest.mark.parametrize("ball", [30.0, HAND])
def test_nothing_is_found_without_a_bright_ball(ball: float) -> None:
    """An empty hand, or something as dark as one."""
    assert not found_at(np.array([0.8, 0.05, 0.1]), (0.0, 0.0), ball=ball)[0]


def test_nothing_is_found_whose_light_was_never_learned() -> None:
    """In flight no frame told how bright the ball is."""
    assert not found_at(np.array([0.8, 0.05, 0.1]), (0.0, 0.0), learned=False)[0]
