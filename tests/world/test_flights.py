"""Recorded flights: read with care, smoothed to the noise, placed as the contract says."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.errors import FileError
from mitt.world.ballistics import fly
from mitt.world.flights import (
    JITTER_POSITION,
    JITTER_YAW,
    Recording,
    builtin_flights,
    place_flight,
    read_flights,
)
from mitt.world.smoothing import smooth

CATCH = np.array([0.785, 0.0, 0.057])
NOISE_MM = np.array([1.6, 0.6, 0.85])
HEADER = "flight,t_s,x_m,y_m,z_m\n"
RECORDINGS = builtin_flights()
which = st.integers(0, len(RECORDINGS) - 1)


def test_the_residuals_are_the_measured_noise() -> None:
    """Over all 44 flights the smoothed curve misses the samples by the noise, to 10 %."""
    assert len(RECORDINGS) == 44
    residuals = []
    for flight in RECORDINGS:
        curve = smooth(flight.t, flight.r)
        residuals.append((flight.r - np.array([curve.at(s)[0] for s in flight.t]))[curve.used])
        assert curve.used.mean() > 0.9
    assert 1e3 * np.vstack(residuals).std(axis=0) == pytest.approx(NOISE_MM, rel=0.10)


@given(index=which)
def test_a_flight_comes_from_x_through_the_catch_point(index: int) -> None:
    """Without jitter the chord points along -x and 75 % of the duration lies at the catch point."""
    flight = RECORDINGS[index]
    placed = place_flight(flight, CATCH, rng=None)
    assert placed.at(0.75 * placed.duration)[0] == pytest.approx(CATCH, abs=1e-12)
    chord = placed.rotation @ (flight.r[-1] - flight.r[0])
    assert chord[0] < 0.0
    assert chord[1] == pytest.approx(0.0, abs=1e-12)
    assert placed.rotation @ placed.rotation.T == pytest.approx(np.eye(3), abs=1e-12)


@given(index=which, seed=st.integers(0, 10_000))
def test_jitter_stays_within_the_contract(index: int, seed: int) -> None:
    """At most 30 mm an axis and 3 degrees of yaw, the same for the same seed."""
    flight = RECORDINGS[index]
    placed, again = (place_flight(flight, CATCH, rng=np.random.default_rng(seed)) for _ in range(2))
    off = placed.at(0.75 * placed.duration)[0] - CATCH
    chord = placed.rotation @ (flight.r[-1] - flight.r[0])
    assert np.abs(off).max() <= JITTER_POSITION
    assert abs(np.arctan2(-chord[1], -chord[0])) <= JITTER_YAW + 1e-12
    assert np.array_equal(placed.at(0.3)[0], again.at(0.3)[0])


@given(index=which, beyond=st.floats(0.0, 0.4))
def test_after_the_last_sample_the_ball_flies_on(index: int, beyond: float) -> None:
    """The free flight takes over without a jump and obeys gravity and drag.

    An ulp in the duration may mean one integration step more, worth 1e-8 m at the most.
    """
    placed = place_flight(RECORDINGS[index], CATCH, rng=None)
    end = placed.at(placed.duration)
    wanted = fly(*end, drag=placed.drag, duration=beyond)
    found = placed.at(placed.duration + beyond)
    assert found[0] == pytest.approx(wanted[0], abs=1e-7)
    assert found[1] == pytest.approx(wanted[1], abs=1e-7)


def test_interleaved_flights_are_told_apart(tmp_path: Path) -> None:
    """Rows of two flights may alternate; time starts at zero in each."""
    path = tmp_path / "two.csv"
    rows = [f"{name},{5 + 0.01 * k},{-0.1 * k},0,1\n" for k in range(12) for name in "ab"]
    path.write_text(HEADER + "".join(rows))
    first, second = read_flights(path)
    assert (first.name, second.name) == ("a", "b")
    assert first.t[0] == 0.0
    assert len(second.t) == 12


def rows(count: int, *, step: float = 0.01, way: float = 0.1) -> str:
    """Return rows of one plain flight."""
    return "".join(f"a,{step * k},{way * k},0,1\n" for k in range(count))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("flight,t_s,x_m,y_m\n", "columns"),
        (HEADER, "at least one flight"),
        (HEADER + rows(9), "at least 10 samples"),
        (HEADER + rows(12, step=0.0), "line 3 column t_s"),
        (HEADER + rows(12, way=0.0), "horizontal way"),
        (HEADER + rows(12) + "a,x,0,0,0\n", "line 14 column t_s"),
        (HEADER + rows(12) + "a,9,0,nan,0\n", "line 14 column y_m"),
        (HEADER + rows(12) + "a,9,0,0,1e9\n", "line 14 column z_m"),
    ],
)
def test_bad_recordings_are_refused(tmp_path: Path, text: str, said: str) -> None:
    """Each fault names the file and the place."""
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(FileError) as caught:
        read_flights(path)
    assert said in str(caught.value)
    assert str(path) in str(caught.value)


def test_a_placed_flight_is_a_rigid_copy() -> None:
    """Distances between samples survive the placing."""
    flight = RECORDINGS[3]
    placed = place_flight(flight, CATCH, rng=np.random.default_rng(2))
    there = placed.rotation @ flight.r.T
    assert np.linalg.norm(np.diff(there.T, axis=0), axis=1) == pytest.approx(
        np.linalg.norm(np.diff(flight.r, axis=0), axis=1), abs=1e-12
    )
    assert isinstance(flight, Recording)
