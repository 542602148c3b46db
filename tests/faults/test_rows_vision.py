"""Rows 1 to 8 of the fault table: what cameras do to a catch.

What they do to the estimate, in numbers: tests/ball/test_late_sightings.py and benchmarks/track.py.
"""

from typing import Any

import numpy as np
import pytest
from faults.conftest import Range

from mitt.core.ball.filter import THROWN_BALL, BallFilter
from mitt.core.eyes.blobs import MOMENTS, is_merged
from mitt.core.signals import Array, Sighting


def sightings(count: int, seed: int) -> list[Sighting]:
    """Return sightings of a ball that flies at 6 m/s, a millisecond apart."""
    rng, t = np.random.default_rng(seed), 1e-3 * np.arange(count)[:, None]
    r = np.array([3.0, 0.0, 0.3]) + np.array([-5.5, 0.2, 2.0]) * t - [0.0, 0.0, 4.9] * t * t
    r += 1e-3 * rng.standard_normal(r.shape)
    return [
        Sighting(t=float(s), found=True, r_o=x, covariance=1e-6 * np.eye(3))
        for (s,), x in zip(t, r, strict=True)
    ]


def told(order: list[Sighting]) -> tuple[Array, Array]:
    """Return state and covariance after sightings in an order of arrival."""
    ball = BallFilter(THROWN_BALL)
    for sighting in order:
        ball.update(sighting)
    state = ball.state(0.25)
    return np.concatenate([state.r_o, state.dr_o]), state.covariance


@pytest.mark.parametrize("start", [0.10, 0.25, 0.40])
@pytest.mark.parametrize("length", [0.005, 0.020, 0.050])
def test_row_01_camera_dropout(place: Range, start: float, length: float) -> None:
    """The motion goes on along the prediction, which the ticks say, and the ball is caught."""
    thrown = place.throw({"kind": "dropout", "start": start, "length": length})
    assert thrown.status == "caught"
    assert thrown.violations == 0
    assert length < 0.01 or "no measurement" in thrown.reasons


def test_row_01_camera_dropout_for_good_stops_the_arm(place: Range) -> None:
    """Blind from 0.12 s on: within all limits the catcher predicts, or stops for a lost ball."""
    thrown = place.throw({"kind": "dropout", "start": 0.12})
    assert thrown.violations == 0
    assert thrown.states & {"predict", "abort"}
    assert thrown.reasons <= {"none", "no measurement", "ball lost"}


@pytest.mark.parametrize("delay", [0.005, 0.020])
def test_row_02_frame_late(place: Range, delay: float) -> None:
    """Late frames with the time of their exposure cost no catch, constant or jittered."""
    for fault in (
        {"kind": "latency", "magnitude": delay},
        {"kind": "late", "magnitude": delay, "chance": 0.5},
    ):
        assert place.throw(fault).status == "caught"


@pytest.mark.parametrize("seed", range(8))
def test_row_03_out_of_order(seed: int) -> None:
    """Any order of arrival within 15 ms gives the state of the right order."""
    rng, right = np.random.default_rng(seed), sightings(220, seed)
    keys = np.arange(len(right)) + 15.0 * rng.random(len(right))
    keys[0] = -1.0
    shuffled = [right[k] for k in np.argsort(keys)]
    for a, b in zip(told(right), told(shuffled), strict=True):
        np.testing.assert_allclose(a, b, rtol=0.0, atol=1e-9)


def test_row_04_duplicated(place: Range) -> None:
    """A sighting that comes twice changes no bit, and a frame that comes twice no catch."""
    once = sightings(150, 3)
    for a, b in zip(told(once), told([s for s in once for _ in (0, 1)]), strict=True):
        assert np.array_equal(a, b)
    assert place.throw({"kind": "duplicate", "magnitude": 0.2}, pixels=True).status == "caught"


@pytest.mark.parametrize("numbered", [False, True])
def test_row_05_frozen_camera(place: Range, numbered: bool) -> None:
    """Both cameras show one image for 50 ms, honest numbers or not: a dropout within 6 ms."""
    fault = {"kind": "frozen", "start": 0.2, "length": 0.05, "numbered": numbered}
    thrown = place.throw(fault, pixels=True)
    assert thrown.violations == 0
    blind = thrown.ticks.scalars["t"][thrown.ticks.scalars["age"] > 0.005]
    assert blind.min() < 0.2 + 0.005 + 0.006
    assert thrown.status == "caught"


@pytest.mark.parametrize("chance", [0.01, 0.10])
def test_row_06_outlier_blobs(place: Range, chance: float) -> None:
    """Sightings 0.3 m off, one or ten in a hundred, lose no ball and no track."""
    for number in range(3):
        fault = {"kind": "outlier", "magnitude": 0.3, "chance": chance}
        thrown = place.throw(fault, number=number)
        assert thrown.status == "caught"
        first = thrown.ticks.scalars["t_first"][thrown.ticks.scalars["tracked"]]
        assert first.max() - first.min() < 0.02


def test_row_07_two_balls() -> None:
    """A blob of two balls side by side is told from one by its second moments."""
    y, x = np.mgrid[0:41, 0:61]
    for gap, merged in ((0.0, False), (14.0, True)):
        seen = ((x - 20) ** 2 + (y - 20) ** 2 <= 64) | ((x - 20 - gap) ** 2 + (y - 20) ** 2 <= 64)
        u, v = x[seen].astype(float), y[seen].astype(float)
        second = u.var(), np.cov(u, v)[0, 1], v.var()
        moments = np.array([(u.size, u.mean(), v.mean(), *second, u.size)], MOMENTS)
        assert bool(is_merged(moments[0])) is merged


@pytest.mark.parametrize("camera", [0, 1])
@pytest.mark.parametrize("start", [0.15, 0.30])
def test_row_08_ball_out_of_view(place: Range, camera: int, start: float) -> None:
    """One camera lost for 50 ms: the ticks say so, and no command breaks a limit."""
    fault: dict[str, Any] = {"kind": "dropout", "camera": camera, "start": start, "length": 0.05}
    thrown = place.throw(fault, pixels=True)
    assert thrown.finite
    assert thrown.violations == 0
    assert "one camera" in thrown.reasons
